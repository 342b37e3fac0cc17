"""The work of one task, in whatever process: its light is solved once, and seen by all its cameras."""

from __future__ import annotations

import time as clock
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from openswim.batches.cloud_depth import with_cloud_depth
from openswim.batches.plan import Plan
from openswim.batches.plan_cameras import PlannedCamera
from openswim.batches.records import Records
from openswim.batches.tasks import Task
from openswim.errors import UserError
from openswim.system.side_by_side import peak_bytes

if TYPE_CHECKING:
    import xarray as xr

    from openswim.pictures.viewpoint import LitScene
    from openswim.scene import Scene


@dataclass(frozen=True)
class Outcome:
    """What became of a task: how many pictures' cameras were new, and one line if it failed. ``fault``: ours."""

    task: str
    made: int = 0
    failure: str = ""
    fault: bool = False
    seconds: float = 0.0
    cpu_s: float = 0.0
    peak_bytes: float = 0.0


def do(plan: Plan, task: Task, threads: int = 1) -> Outcome:
    """Make what of a task is not there yet; never raises what a task can be blamed for."""
    import numba

    numba.set_num_threads(max(1, min(threads, numba.config.NUMBA_NUM_THREADS)))  # type: ignore[attr-defined]
    return attempted(task, lambda: _make(plan, task))


def attempted(task: Task, make: Callable[[], int]) -> Outcome:
    """What becomes of a task whose missing pictures are made by a call, which says of how many cameras. One task's
    fault, whatever it is, ends no other."""
    start, cpu = clock.perf_counter(), clock.process_time()
    made, failure, fault = 0, "", False
    try:
        made = make()
    except UserError as error:
        failure = str(error)
    except MemoryError:
        failure = "out of memory: use fewer workers (--jobs), smaller pictures or a smaller domain"
    except Exception as error:
        failure, fault = " ".join(f"{type(error).__name__}: {error}".split())[:600], True
    return Outcome(
        task.name, made, failure, fault, clock.perf_counter() - start, clock.process_time() - cpu, peak_bytes()
    )


def _make(plan: Plan, task: Task) -> int:
    records = Records(plan.folder)
    missing = records.missing(task, plan.cameras)
    for camera, lit in _lights(plan, task, missing):
        image = _image(plan, camera, lit)
        records.add(task, camera, _written(plan, task, camera, image))
    return len(missing)


def _lights(plan: Plan, task: Task, cameras: Sequence[PlannedCamera]) -> Iterator[tuple[PlannedCamera, LitScene]]:
    """Each camera with its light, which is that of the one before wherever the scene is the whole domain."""
    from openswim.lighting import light

    held: tuple[Any, LitScene] | None = None
    for camera in cameras:
        place = (camera.camera.lat, camera.camera.lon, camera.camera.height_m)
        if held is None or (held[1].scene.cut and held[0] != place):
            held = None
            scene = scene_of(plan, task, camera)
            held = place, light(scene, plan.solver, plan.wavelengths_nm, **plan.sun_options)
        yield camera, held[1]


def scene_of(plan: Plan, task: Task, camera: PlannedCamera) -> Scene:
    """The weather of a task around a camera."""
    from openswim.optics.choosing import only
    from openswim.optics.chosen import with_aerosol
    from openswim.optics.species import for_wavelengths
    from openswim.readers import Neighbourhood, open_scene

    at, alone = camera.camera, plan.solver.name == "reference"
    around = None
    if at.lat is not None and at.lon is not None:
        around = Neighbourhood.seen_from(at.lat, at.lon, at.height_m, beyond=not alone)
    scene = open_scene(
        list(task.files), time=task.time, around=around, allow_references=plan.allow_references, member=task.member
    )
    scene = only(scene, *plan.only) if plan.only else scene
    if plan.aerosol is not None or plan.aod is not None:
        place = None if at.lat is None or at.lon is None else (at.lat, at.lon)
        when = plan.sun if isinstance(plan.sun, np.datetime64) else None
        scene = with_aerosol(scene, plan.aerosol, plan.aod, when, place)
    scene = for_wavelengths(scene, np.array(plan.wavelengths_nm))
    return scene.alone() if alone else scene


def _image(plan: Plan, camera: PlannedCamera, lit: LitScene) -> xr.Dataset:
    viewpoint = lit.viewpoint(camera.camera)
    return viewpoint.view() if plan.ensemble is None else with_cloud_depth(viewpoint)


def _written(plan: Plan, task: Task, camera: PlannedCamera, image: xr.Dataset) -> list[str]:
    """Write a camera's files; returns their names, also of those that come along with others."""
    from openswim.colour import save

    names = []
    for name in task.targets(camera):
        path = plan.folder / name
        save(image, path, **dict(plan.look))
        names.append(name)
        if path.suffix == ".hdr" and str(image.attrs.get("view")) in ("panorama", "sphere"):
            names += [str(Path(name).with_suffix(suffix)) for suffix in (".cal", ".rad")]
    return names
