"""A solve that begins from the light of the time before."""

from dataclasses import replace

import numpy as np
import pytest

import openswim
from openswim import Camera, Scene, Solver
from openswim.scene.procedural import demo_scene
from openswim.transport import EarlierLight
from openswim.transport.diffuse.earlier import displacement

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


@pytest.mark.parametrize(("columns", "most", "rms"), [(0, 0.8, 0.0014), (7, 0.9, 0.0088)])
def test_it_takes_fewer_sweeps_and_ends_where_it_would(scene: Scene, columns: int, most: float, rms: float) -> None:
    """Light of clouds that have moved is that of a solve from the beginning, well within the tolerance of .1."""
    earlier = EarlierLight()
    openswim.light(scene, SOLVER, earlier=earlier)
    for count in (1, 2):
        now = moved(scene, columns * count, 5 * count)
        anew, begun = openswim.light(now, SOLVER), openswim.light(now, SOLVER, earlier=earlier)
        one, other = (np.sum(lit.field.lit[0].sweeps) for lit in (anew, begun))
        assert other <= most * one
        one, other = seen(anew), seen(begun)
        off = (other - one)[np.isfinite(one)] / np.nanmean(one)
        assert np.sqrt((off**2).mean()) < rms
        assert abs(off.mean()) < 0.15 * rms


def test_light_of_another_scene_does_no_harm(scene: Scene) -> None:
    """Neither where the grid is another one, nor where the clouds are."""
    earlier = EarlierLight()
    for other in (demo_scene(48, 48, 20), demo_scene(64, 64, 24, seed=8), scene):
        begun = openswim.light(other, SOLVER, earlier=earlier)
    anew = openswim.light(scene, SOLVER)
    one, other = seen(anew), seen(begun)
    off = (other - one)[np.isfinite(one)] / np.nanmean(one)
    assert np.sqrt((off**2).mean()) < 0.004
    assert np.sum(begun.field.lit[0].sweeps) <= 1.1 * np.sum(anew.field.lit[0].sweeps)


def test_every_light_of_a_night_begins_from_its_own() -> None:
    scene = replace(demo_scene(48, 48, 20), time=np.datetime64("2026-06-30T23:00", "ms"))  # a full moon
    earlier = EarlierLight()
    first = openswim.light(scene, SOLVER, earlier=earlier)
    assert len(first.lights) > 1
    assert len(earlier.solved) == len(first.lights)
    again = openswim.light(scene, SOLVER, earlier=earlier)
    for one, other in zip(first.lights, again.lights, strict=True):
        sweeps = [np.sum(light.field.lit[0].sweeps) for light in (one, other)]
        assert sweeps[1] <= 0.7 * sweeps[0]


@pytest.mark.parametrize("by", [(0, 0), (3, -5), (-8, 7)])
def test_how_far_clouds_have_moved(by: tuple[int, int]) -> None:
    """Columns come in at one side and go at the other, as in a cut domain."""
    random = np.random.default_rng(4)
    wide = np.maximum(random.normal(size=(96, 112)), 0.0)
    for axis in (0, 1):
        wide = sum(np.roll(wide, k, axis) for k in range(-2, 3))
    wide = np.maximum(wide - wide.mean(), 0.0).astype(np.float32)
    before, after = wide[16:80, 16:96], wide[16 - by[0] : 80 - by[0], 16 - by[1] : 96 - by[1]]
    assert displacement(before, after) == by
    assert displacement(np.ones_like(before), np.ones_like(before)) == (0, 0)
