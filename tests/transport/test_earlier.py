"""A solve that begins from the light of the time before."""

from copy import deepcopy
from dataclasses import replace

import numpy as np
import pytest

import openswim
from openswim import Camera, Scene, Solver
from openswim.pictures.viewpoint import LitScene
from openswim.scene.procedural import demo_scene
from openswim.transport import EarlierLight

SOLVER = Solver("fast", quality="preview")
CLOUDS = ("liquid_content", "liquid_effective_radius", "ice_content", "ice_effective_radius")


def moved(scene: Scene, columns: int, minutes: int) -> Scene:
    data = scene.data.copy()
    for name in CLOUDS:
        data[name] = scene.data[name].copy(data=np.roll(scene.data[name].values, columns, -1))
    return replace(scene, data=data, time=scene.time + np.timedelta64(minutes, "m"))


def seen(lit) -> np.ndarray:
    camera = Camera.allsky(*lit.scene.place, size=48)
    return lit.viewpoint(camera).view(irradiance=False).radiance.values


@pytest.fixture(scope="module")
def scene() -> Scene:
    return demo_scene(64, 64, 24)


@pytest.fixture(scope="module")
def first(scene: Scene) -> tuple[EarlierLight, LitScene]:
    """What a solve of the scene from the beginning leaves to later ones, to be copied, and its light."""
    earlier = EarlierLight()
    return earlier, openswim.light(scene, SOLVER, earlier=earlier)


@pytest.mark.parametrize(("columns", "counts", "most", "rms"), [(0, (1,), 0.55, 0.0009), (7, (1, 2), 0.9, 0.0088)])
def test_it_takes_fewer_sweeps_and_ends_where_it_would(scene, first, columns, counts, most, rms) -> None:
    """Light of clouds that have moved is that of a solve from the beginning, well within the tolerance of .1."""
    earlier = deepcopy(first[0])
    for count in counts:
        now = moved(scene, columns * count, 5 * count)
        anew, begun = openswim.light(now, SOLVER), openswim.light(now, SOLVER, earlier=earlier)
        one, other = (lit.field.lit[0].sweeps for lit in (anew, begun))
        assert np.sum(other) <= most * np.sum(one)
        assert other[0][-1] < one[0][-1]  # on the finest grid, by what it added then, moved as the clouds have moved
        one, other = seen(anew), seen(begun)
        off = (other - one)[np.isfinite(one)] / np.nanmean(one)
        assert np.sqrt((off**2).mean()) < rms
        assert abs(off.mean()) < 0.15 * rms


def changed(scene: Scene, by) -> Scene:
    data = scene.data.copy()
    for name in CLOUDS:
        data[name] = scene.data[name].copy(data=by(scene.data[name].values))
    return replace(scene, data=data)


def test_light_of_other_clouds_does_no_harm(scene: Scene, first: tuple[EarlierLight, LitScene]) -> None:
    earlier = EarlierLight()
    openswim.light(changed(scene, lambda clouds: clouds[:, ::-1, ::-1].copy()), SOLVER, earlier=earlier)
    anew, begun = first[1], openswim.light(scene, SOLVER, earlier=earlier)
    one, other = seen(anew), seen(begun)
    off = (other - one)[np.isfinite(one)] / np.nanmean(one)
    assert 0 < np.sqrt((off**2).mean()) < 0.0015
    assert np.sum(begun.field.lit[0].sweeps) <= np.sum(anew.field.lit[0].sweeps)


def test_other_levels_and_other_grids(scene: Scene, first: tuple[EarlierLight, LitScene]) -> None:
    """Thicker clouds divide levels more finely: what was on the nearest ones still helps. Another grid's is left."""
    earlier = EarlierLight()
    thick = changed(scene, lambda clouds: 1.5 * clouds)
    openswim.light(demo_scene(16, 16, 16), SOLVER, earlier=earlier)
    before = openswim.light(thick, SOLVER, earlier=earlier)
    anew, begun = first[1], openswim.light(scene, SOLVER, earlier=earlier)
    assert before.field.medium.shape != begun.field.medium.shape
    assert np.sum(begun.field.lit[0].sweeps) <= 0.6 * np.sum(anew.field.lit[0].sweeps)
    one, other = seen(anew), seen(begun)
    off = (other - one)[np.isfinite(one)] / np.nanmean(one)
    assert np.sqrt((off**2).mean()) < 0.0015


def test_every_light_of_a_night_begins_from_its_own() -> None:
    scene = replace(demo_scene(24, 24, 20), time=np.datetime64("2026-06-30T23:00", "ms"))  # a full moon
    earlier = EarlierLight()
    first = openswim.light(scene, SOLVER, earlier=earlier)
    assert len(first.lights) > 1
    assert len(earlier.solved) == len(first.lights)
    again = openswim.light(scene, SOLVER, earlier=earlier)
    for one, other in zip(first.lights, again.lights, strict=True):
        sweeps = [np.sum(light.field.lit[0].sweeps) for light in (one, other)]
        assert sweeps[1] <= 0.46 * sweeps[0]
