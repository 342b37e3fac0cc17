"""Pictures by fewer rays: what goes on straight between neighbours, and what must be looked at."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

import openswim
from openswim import Camera
from openswim.scene.procedural import demo_scene
from openswim.solver import Solver
from openswim.transport.engine.pack import PACK
from openswim.transport.march.volume import FAR_M
from openswim.transport.view import sparse
from openswim.transport.view.seen import Seen

F64 = NDArray[np.float64]
ROWS, COLUMNS, ALIKE = 41, 61, 0.02


class World:
    """Rays whose direction names their pixel see given light, through given haze, down to given ends."""

    def __init__(self, light: F64, through: F64, ends: F64) -> None:
        self.light, self.through, self.ends = light, through, ends
        self.marched: list[int] = []
        self.image = np.arange(light.size).reshape(light.shape)
        j, i = np.mgrid[: light.shape[0], : light.shape[1]]
        self.direction = np.stack([j, i, 0 * i], axis=-1).reshape(-1, 3).astype(float)

    def march(self, origin: F64, direction: F64, ends: F64 | None, cone: F64 | None) -> Seen:
        j, i = direction[:, :2].astype(int).T
        self.marched += self.image[j, i].tolist()
        of = self.light[j, i], self.through[j, i]
        light, through = (np.repeat(v[:, None], PACK, axis=1).astype(np.float32) for v in of)
        assert ends is not None
        np.testing.assert_array_equal(ends, self.ends[j, i])
        distance = np.where((ends < FAR_M) & (through[:, 0] > 0), ends, -1.0)
        depth = -np.log(np.maximum(through[:, :1], 1e-9))
        return Seen(light, through, through, distance, depth, len(j), np.zeros(len(j), np.int8))

    def seen(self) -> Seen:
        flat = self.direction
        return sparse.march(self.march, 0 * flat, flat, self.ends.ravel(), None, self.image, ALIKE)

    def exact(self) -> Seen:
        return self.march(0 * self.direction, self.direction, self.ends.ravel(), None)


def _gentle(on_land: bool = True) -> tuple[F64, F64, F64]:
    """Light and depth that change evenly along rows and columns; of rays to land, per metre of ways that do not."""
    j, i = np.mgrid[:ROWS, :COLUMNS]
    light, depth = 1 + 4e-3 * j - 8e-3 * i, 0.5 + 1e-3 * i
    if not on_land:
        return light, np.exp(-depth), np.full(light.shape, FAR_M)
    km = 1 + 0.005 * (j - 20) ** 2 + 0.003 * i + 0.1 * np.random.default_rng(1).random(light.shape)
    return light * km, np.exp(-depth * km), 1000.0 * km


@pytest.mark.parametrize("on_land", [True, False])
def test_even_slopes_of_light_need_a_sixteenth_of_the_rays(on_land: bool) -> None:
    world = World(*_gentle(on_land))
    found = world.seen()
    assert sorted(world.marched) == sorted(set(world.marched))
    nodes = (ROWS // 4 + 1) * (COLUMNS // 4 + 1)
    ends = ROWS - ROWS // 4 + COLUMNS - COLUMNS // 4  # of rows and of columns, which are in no block
    assert nodes <= len(world.marched) <= nodes + ends
    exact = world.exact()
    for name in ("radiance", "through", "full", "distance", "depth", "level"):
        np.testing.assert_allclose(getattr(found, name), getattr(exact, name), rtol=2e-5, atol=1e-6)


@pytest.mark.parametrize("what", ["light", "haze", "ridge", "sky"])
def test_what_differs_at_a_corner_or_ends_between_is_marched(what: str) -> None:
    light, through, ends = _gentle(what in ("ridge", "sky"))
    edge = np.mgrid[:ROWS, :COLUMNS][1] > 30
    if what == "light":
        light[edge] *= 1.1
    elif what == "haze":
        through[edge] *= 1.1
    elif what == "ridge":
        ends[20, 31] = 500.0  # seen by one ray alone, between corners
    else:
        ends[20, 31] = FAR_M
    world = World(light, through, ends)
    found, exact = world.seen(), world.exact()
    for name in ("radiance", "through", "distance"):
        np.testing.assert_allclose(getattr(found, name), getattr(exact, name), rtol=2e-5)
    assert world.image[20, 31] in world.marched[: -light.size]


def test_a_picture_with_holes_sees_every_ray_once() -> None:
    light, through, ends = _gentle(on_land=False)
    world = World(light, through, ends)
    j, i = np.mgrid[:ROWS, :COLUMNS]
    inside = np.hypot(j - 20, i - 30) < 20
    world.direction = world.direction[inside.ravel()]
    image = np.where(inside, np.cumsum(inside).reshape(inside.shape) - 1, -1)
    found = sparse.march(world.march, 0 * world.direction, world.direction, ends[inside], None, image, ALIKE)
    np.testing.assert_allclose(found.radiance[:, 0], light[inside], rtol=1e-5)
    assert len(world.marched) == len(set(world.marched)) < 0.3 * inside.sum()
    assert found.samples == len(world.marched)


@pytest.mark.parametrize(("alike", "told", "rms", "most"), [(0.005, 0.6, 5.2e-4, 3.9e-3), (0.1, 0.8, 9.6e-4, 5.4e-3)])
def test_skies_by_fewer_rays_are_those_by_all(alike: float, told: float, rms: float, most: float) -> None:
    """Cloud, haze and land of the demo: most of the pixels are told by those around."""
    lit = openswim.light(demo_scene(64, 64, 20), Solver(tolerance=0.3))
    place = {"height_m": 1500.0, "azimuth_deg": 300.0, "altitude_deg": 10.0}
    eye = lit.viewpoint(Camera.perspective(*lit.scene.place, fov_deg=10, size=(90, 160), **place))
    fewer, all_rays = (eye.view(irradiance=False, sparse=way)["solar_relative_radiance"] for way in (alike, 0.0))
    np.testing.assert_array_equal(openswim.render(lit, eye.camera, sparse=alike).solar_relative_radiance, fewer)
    off = np.abs(fewer / all_rays - 1).values
    assert np.mean(off > 0) > told
    assert np.sqrt((off**2).mean()) < rms
    assert np.percentile(off, 99.9) < most


def test_faint_light_beside_bright_needs_few_rays() -> None:
    light, through, ends = _gentle(on_land=False)
    light[np.mgrid[:ROWS, :COLUMNS][1] > 30] *= 1.5
    world = World(light, through, ends)
    beside = np.full(light.size, 100.0)
    found = sparse.march(
        world.march, 0 * world.direction, world.direction, ends.ravel(), None, world.image, ALIKE, beside
    )
    count = len(world.marched)
    assert count < 0.12 * light.size
    exact = world.exact()
    assert abs(found.radiance - exact.radiance).max() < ALIKE * 100
    alone = World(light, through, ends)
    alone.seen()
    assert len(alone.marched) > 1.5 * count


def test_nights_by_fewer_rays_are_those_by_all() -> None:
    """Moon, dusk and the sky's own light, of which the brightest is looked at most."""
    lit = openswim.light(demo_scene(16, 16, 16, spacing_m=1000.0), Solver(quality="preview"), time="2024-06-20T22:00")
    assert len(lit.lights) > 1
    eye = lit.viewpoint(Camera.allsky(*lit.scene.place, size=64))
    fewer, all_rays = (eye.view(irradiance=False, sparse=way).radiance.values for way in (0.1, 0.0))
    off = np.abs(fewer / all_rays - 1)[np.isfinite(all_rays)]
    assert np.mean(off > 1e-6) > 0.4
    assert np.sqrt((off**2).mean()) < 5.6e-3
