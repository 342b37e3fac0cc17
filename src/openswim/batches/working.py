"""The work of one task, in whatever process: its light is solved once, and seen by all its cameras."""

from __future__ import annotations

import time as clock
from collections.abc import Callable, Sequence
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
    """What became of a task: of how many cameras the pictures were made, and one line if any failed, which names the
    cameras it was. ``fault``: ours."""

    task: str
    made: int = 0
    failure: str = ""
    fault: bool = False
    seconds: float = 0.0
    cpu_s: float = 0.0
    peak_bytes: float = 0.0

    @property
    def told(self) -> str:
        """What failed and why, the task named once: that of an unreadable file is the file."""
        names_it = Path(self.failure.partition(": ")[0]).name == self.task
        return self.failure if names_it else f"{self.task}: {self.failure}"


def do(plan: Plan, task: Task, threads: int = 1) -> Outcome:
    """Make what of a task is not there yet; never raises what a task can be blamed for."""
    import numba

    numba.set_num_threads(max(1, min(threads, numba.config.NUMBA_NUM_THREADS)))  # type: ignore[attr-defined]
    records, lights = Records(plan.folder), _Lights(plan, task)

    def make(camera: PlannedCamera) -> None:
        image = _image(plan, camera, lights.of(camera))
        records.add(task, camera, _written(plan, task, camera, image))

    return attempted(plan, task, records.missing(task, plan.cameras), make)


def attempted(
    plan: Plan, task: Task, cameras: Sequence[PlannedCamera], make: Callable[[PlannedCamera], None]
) -> Outcome:
    """What becomes of a task whose missing pictures are made by a call for each camera. What one camera or task
    fails of, whatever it is, ends no other."""
    start, cpu = clock.perf_counter(), clock.process_time()
    reasons: dict[str, list[str]] = {}  # why not: the names of the cameras
    fault = False
    for camera in cameras:
        try:
            make(camera)
        except UserError as error:
            why = str(error)
        except MemoryError:
            why = "out of memory: use fewer workers (--jobs), smaller pictures or a smaller domain"
        except Exception as error:
            why, fault = " ".join(f"{type(error).__name__}: {error}".split())[:600], True
        else:
            continue
        reasons.setdefault(why, []).append(camera.name)
    failed = sum(map(len, reasons.values()))
    return Outcome(
        task.name, len(cameras) - failed, _told(reasons, len(plan.cameras)), fault,
        clock.perf_counter() - start, clock.process_time() - cpu, peak_bytes(),
    )  # fmt: skip


def _told(reasons: dict[str, list[str]], cameras: int) -> str:
    """Reasons and the cameras that have each, of so many in the plan; an only camera is not named."""
    return "; ".join(
        why if len(names) == cameras == 1
        else f"all {cameras} cameras: {why}" if len(names) == cameras
        else f"camera{'s' * (len(names) > 1)} {', '.join(names)}: {why}"
        for why, names in reasons.items()
    )  # fmt: skip


class _Lights:
    """The light of a task for its cameras, one after the other. It is solved once wherever the scene is the whole
    domain, and what fails at a place is not tried again there."""

    def __init__(self, plan: Plan, task: Task) -> None:
        self._plan, self._task = plan, task
        self._held: tuple[Any, LitScene] | None = None
        self._failed: dict[Any, Exception] = {}

    def of(self, camera: PlannedCamera) -> LitScene:
        place = (camera.camera.lat, camera.camera.lon, camera.camera.height_m)
        if self._held is not None and (self._held[0] == place or not self._held[1].scene.cut):
            return self._held[1]
        if place in self._failed:
            raise self._failed[place]
        self._held = None
        try:
            self._held = place, self._solved(camera)
        except Exception as error:
            self._failed[place] = error
            raise
        return self._held[1]

    def _solved(self, camera: PlannedCamera) -> LitScene:
        from openswim.lighting import light
        from openswim.pictures.observer import check_observer

        plan, scene = self._plan, scene_of(self._plan, self._task, camera)
        check_observer(scene, camera.camera, plan.solver.name)  # before the work, which would be in vain
        return light(scene, plan.solver, plan.wavelengths_nm, **plan.sun_options)


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
    from openswim.colour.picture import only_looked_at
    from openswim.pictures.viewpoint import LOOKED_AT

    viewpoint = lit.viewpoint(camera.camera)
    if plan.ensemble is not None:
        return with_cloud_depth(viewpoint)
    looked_at = only_looked_at(camera.suffixes, dict(plan.look).get("bits", 8))
    return viewpoint.view(sparse=LOOKED_AT if looked_at else 0.0)


def _written(plan: Plan, task: Task, camera: PlannedCamera, image: xr.Dataset) -> list[str]:
    """Write a camera's files; returns their names, also of those that come along with others."""
    from openswim.colour import save
    from openswim.colour.beside import beside

    names = []
    for name in task.targets(camera):
        path = plan.folder / name
        save(image, path, **dict(plan.look))
        names += [name, *map(str, beside(Path(name), image.attrs.get("view")))]
    return names
