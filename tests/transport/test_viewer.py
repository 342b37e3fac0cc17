"""Solved light has no eye and is not changed; a viewer hands out rays in any order, from any thread, bit for bit."""

from __future__ import annotations

import copy
import hashlib
import pickle
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import numpy as np
import pytest

import openswim
from openswim import Camera
from openswim.lighting import light
from openswim.pictures.viewpoint import LitScene
from openswim.scene.procedural import demo_scene
from openswim.scene.rays import Rays
from openswim.solver import Solver
from openswim.transport.view import toward_eye

ROWS, COLUMNS = 60, 120


@pytest.fixture(scope="module")
def lit() -> LitScene:
    """The demo, small: clouds, hills, a lake, air."""
    return light(demo_scene(64, 64, 20), Solver(tolerance=0.3))


@pytest.fixture(scope="module")
def camera(lit: LitScene) -> Camera:
    return Camera.panorama(*lit.scene.place, height_m=150.0, size=(ROWS, COLUMNS))


@pytest.fixture(scope="module")
def whole(lit: LitScene, camera: Camera) -> np.ndarray:
    return lit.viewpoint(camera).view()["radiance"].values


def arrays(thing: Any, seen: set[int]) -> Iterator[np.ndarray]:
    """All arrays that a thing holds, but for what was worked out from it later."""
    if id(thing) in seen or thing is None:
        return
    seen.add(id(thing))
    if isinstance(thing, np.ndarray):
        yield thing
    elif isinstance(thing, (list, tuple)):
        for one in thing:
            yield from arrays(one, seen)
    elif type(thing).__module__.startswith("openswim.transport") and hasattr(thing, "__dataclass_fields__"):
        for name in thing.__dataclass_fields__:
            yield from arrays(getattr(thing, name), seen)


def fingerprint(lit: LitScene) -> str:
    found = hashlib.sha256()
    for array in arrays(lit.field.packs, set()):
        found.update(np.ascontiguousarray(array).view(np.uint8).data)
    return found.hexdigest()


def test_views_leave_the_light_as_it_was(lit: LitScene, camera: Camera) -> None:
    before = fingerprint(lit)
    openswim.render(lit, camera)
    openswim.render(lit, Camera.allsky(*lit.scene.place, height_m=900.0, size=40))
    openswim.render(lit, Camera.satellite(*lit.scene.place, height_m=400e3, fov_deg=3.2, size=40))
    assert fingerprint(lit) == before


def test_there_is_water_and_cloud_in_the_picture(lit: LitScene, camera: Camera) -> None:
    """Or what is the same would say little."""
    viewer = lit.viewpoint(camera)._eye.packs[0]  # type: ignore[union-attr]
    assert viewer.grid.mirrored.picture is not None
    assert lit.field.medium.extinction.max() > 1e-3  # type: ignore[union-attr]


@pytest.mark.parametrize("seed", range(3))
def test_tiles_are_the_whole_in_any_order(lit: LitScene, camera: Camera, whole: np.ndarray, seed: int) -> None:
    """Cut at random into 25 tiles, in a random order, each from a viewpoint that has seen nothing but tiles."""
    rng = np.random.default_rng(seed)
    rows, columns = (
        np.concatenate([[0], np.sort(rng.choice(np.arange(1, n), 4, replace=False)), [n]]) for n in (ROWS, COLUMNS)
    )
    viewpoint = lit.viewpoint(camera)
    out = np.zeros_like(whole)
    for n in rng.permutation(25):
        part = slice(*rows[n // 5 : n // 5 + 2]), slice(*columns[n % 5 : n % 5 + 2])
        out[part] = viewpoint.tile(*part)["radiance"].values
    np.testing.assert_array_equal(out, whole)


def test_a_copy_shows_the_same_here_and_in_another_process(lit: LitScene, camera: Camera, whole: np.ndarray) -> None:
    for copied in (copy.deepcopy(lit), pickle.loads(pickle.dumps(lit))):
        np.testing.assert_array_equal(openswim.render(copied, camera).radiance, whole)


def test_threads_see_what_one_sees(lit: LitScene, camera: Camera, whole: np.ndarray) -> None:
    viewpoint = lit.viewpoint(camera)
    parts = [(slice(a, a + 12), slice(b, b + 30)) for a in range(0, ROWS, 12) for b in range(0, COLUMNS, 30)]
    with ThreadPoolExecutor(4) as threads:
        found = list(threads.map(lambda part: viewpoint.tile(*part)["radiance"].values, parts))
    for part, seen in zip(parts, found, strict=True):
        np.testing.assert_array_equal(seen, whole[part])


def test_single_rays_see_what_they_see_together(lit: LitScene, camera: Camera) -> None:
    viewpoint = lit.viewpoint(camera)
    azimuth, altitude = np.linspace(0.0, 350.0, 15), np.linspace(-25.0, 80.0, 15)
    together = viewpoint.look(azimuth, altitude)
    alone = np.concatenate([viewpoint.look(a, b) for a, b in zip(azimuth, altitude, strict=True)])
    np.testing.assert_array_equal(alone, together)


def test_a_single_ray_is_seen_by_the_eye_that_is_there(lit: LitScene, camera: Camera) -> None:
    """It could be one of parallel rays, too, for which all nodes would be turned anew."""
    eye = lit.field.viewpoint(camera.rays(lit.field.frame, 0.0, camera.pixels()))
    (here,), (other,) = eye.packs, eye.of_others(camera.rays(lit.field.frame, 0.0, camera.pixels())[7:8]).packs
    assert other.grid.volume.fields is here.grid.volume.fields


def test_eyes_along_a_path_share_what_does_not_depend_on_them(lit: LitScene, monkeypatch: pytest.MonkeyPatch) -> None:
    """Sources toward every direction, of the nodes around an eye in cloud: the same bits, whoever made them."""
    medium = lit.field.medium  # type: ignore[union-attr]
    assert medium is not None
    cloud = medium.extinction.sum(axis=0)
    k, j, i = np.unravel_index(cloud[:, 20:-20, 20:-20].argmax(), cloud[:, 20:-20, 20:-20].shape)
    eye = medium.place[j + 20, i + 20] + medium.axes[j + 20, i + 20, 2] * medium.levels_m[k]
    toward = np.random.default_rng(1).normal(size=(40, 3))
    toward /= np.linalg.norm(toward, axis=1, keepdims=True)
    made, turning = [], toward_eye._turning
    monkeypatch.setattr(toward_eye, "_turning", lambda *given: made.append(1) or turning(*given))

    def seen(step_m: float) -> np.ndarray:
        return np.asarray(lit.field.viewpoint(rays := Rays(eye + step_m, toward)).view(rays).radiance)

    first, after = seen(0.0), seen(3.0)
    assert len(made) == len(lit.field.packs)  # type: ignore[union-attr]
    assert np.abs(after - first).max() > 0
    for pack in lit.field.packs:  # type: ignore[union-attr]
        pack.once._last.clear()
    np.testing.assert_array_equal(seen(3.0), after)


@pytest.mark.parametrize("part", [(slice(0, 0), slice(None)), (slice(None), slice(0, 50, 2)), (slice(70, 90),) * 2])
def test_tiles_that_are_none_are_refused(lit: LitScene, camera: Camera, part: tuple[slice, slice]) -> None:
    with pytest.raises(openswim.UserError, match="give slices within 60 x 120"):
        lit.viewpoint(camera).tile(*part)
