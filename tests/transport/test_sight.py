"""What rays look at: distances and optical depths of slabs by hand, grounds, haze, nested grids."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
from tests.transport.scenes import grid_scene, sun_at_zenith_angle, toward
from tests.transport.test_nested import laid, nest, solved, waves

from openswim.cameras import Rays
from openswim.scene import Scene
from openswim.scene.aerosol import AerosolProfile
from openswim.scene.atmosphere import Atmosphere
from openswim.solver import Solver
from openswim.transport.field import Field
from openswim.transport.view.sight import LAND, SKY, Sight

CELL_M = 100.0
FOUND_M = 8.0  # 6.3 are measured, from the shallower slabs 2
SHAPE = (41, 31, 31)
Z = CELL_M * np.arange(SHAPE[0])
TENT = np.interp(Z, [1000.0, 1500.0, 2000.0], [0.0, 1.0, 0.0])  # soft cloud between 1 and 2 km
VEIL = np.interp(Z, [2900.0, 3000.0, 3200.0, 3300.0], [0.0, 1.0, 1.0, 0.0])


def slabs(low_per_m: float, high_per_m: float = 0.0, **more: object) -> Scene:
    level = np.ones(SHAPE[1:])
    fields = {"low": low_per_m * TENT[:, None, None] * level, "high": high_per_m * VEIL[:, None, None] * level}
    return grid_scene(fields, SHAPE, (3 * CELL_M, 3 * CELL_M, CELL_M), **more)


@cache
def _lit(low_per_m: float, high_per_m: float, solver: str, aerosol: float | None) -> Field:
    air = None if aerosol is None else Atmosphere.us_standard(aerosol=AerosolProfile(aerosol))
    scene = slabs(low_per_m, high_per_m, atmosphere=air)
    return Solver(solver).solve(scene, sun_at_zenith_angle(30.0), [546.0])


def seen(
    low_per_m: float, high_per_m: float, height_m: float, directions: np.ndarray, solver: str = "swim",
    aerosol: float | None = None,
) -> Sight:  # fmt: skip
    rays = Rays(np.array([0.0, 0.0, height_m]), np.atleast_2d(directions))
    field = _lit(low_per_m, high_per_m, solver, aerosol)
    return field.viewpoint(rays).sight(rays)


def by_hand(per_m: float, mu: float, height_m: float) -> tuple[float, float]:
    """Depth of the tent along a slanted way, and the distance at which it has taken half of what it takes."""
    z = np.linspace(1000.0, 2000.0, 20_001)
    steps = per_m * np.interp(0.5 * (z[1:] + z[:-1]), Z, TENT) * (z[1] - z[0]) / abs(mu)
    depth = np.concatenate([[0.0], np.cumsum(steps)])
    if mu < 0:
        z, depth = z[::-1], depth[-1] - depth[::-1]
    half = np.interp(0.5 * (1 - np.exp(-depth[-1])), 1 - np.exp(-depth), z)
    return depth[-1], abs(half - height_m) / abs(mu)


@pytest.mark.parametrize("height_m", [2.0, 3900.0])
@pytest.mark.parametrize(("tau", "solver"), [(0.3, "swim"), (3.0, "fast"), (60.0, "swim"), (60.0, "fast")])
def test_depth_and_distance_of_a_slab(tau: float, height_m: float, solver: str) -> None:
    up = 1 if height_m < 1000 else -1
    directions = np.array([toward(azimuth, up * altitude) for azimuth, altitude in ((0, 90), (40, 70), (200, 55))])
    found = seen(tau / 500.0, 0.0, height_m, directions, solver)
    for n, direction in enumerate(directions):
        depth, distance = by_hand(tau / 500.0, direction[2], height_m)
        assert found.depth[n, 0] == pytest.approx(depth, rel=2e-4)
        if tau > 1 or up > 0:
            assert found.names[found.kind[n]] == "low"
            assert found.distance_m[n] == pytest.approx(distance, abs=FOUND_M)
            assert found.position[n, 2] == pytest.approx(height_m + distance * direction[2], abs=FOUND_M)
        else:  # the ground shines through
            assert found.kind[n] == LAND
            assert found.distance_m[n] == pytest.approx(height_m / -direction[2], rel=1e-4)


def test_of_two_clouds_the_one_in_front_is_seen() -> None:
    below, above = seen(0.02, 0.05, 2.0, toward(10.0, 80.0)), seen(0.02, 0.05, 3900.0, toward(10.0, -80.0))
    assert [one.names[one.kind[0]] for one in (below, above)] == ["low", "high"]
    np.testing.assert_allclose(below.depth, above.depth, rtol=1e-3)


@pytest.mark.parametrize(("tau", "kind"), [(0.01, "sky"), (0.06, "high")])
def test_thin_cirrus_is_seen_from_an_optical_depth_of_three_hundredths(tau: float, kind: str) -> None:
    found = seen(0.0, tau / 300.0, 2.0, toward(0.0, 90.0))
    assert found.names[found.kind[0]] == kind
    assert np.isfinite(found.distance_m[0]) == (kind == "high")


def test_what_haze_hides_is_not_seen() -> None:
    down = toward(0.0, -20.0)
    clear, hazy = (
        seen(0.0, 0.0, 3900.0, down, aerosol=depth) for depth in (0.05, 3.0)
    )
    assert clear.kind[0] == LAND
    assert hazy.kind[0] == SKY
    assert np.isnan(hazy.distance_m[0])


def test_a_nested_grid_sees_what_one_fine_grid_sees() -> None:
    directions = np.array([toward(azimuth, up) for azimuth in range(0, 360, 20) for up in (9.0, 14.0, 30.0)])
    rays = Rays(np.array([0.0, 0.0, 2.0]), directions)
    one, two = (solved(scene, Solver("swim")).viewpoint(rays).sight(rays) for scene in (laid(waves), nest(waves)))
    depth = one.depth[:, 0]
    clearly = np.abs(depth - 0.03) > 0.02
    np.testing.assert_array_equal((one.kind == SKY)[clearly], (two.kind == SKY)[clearly])
    cloudy = clearly & (one.kind != SKY)
    assert cloudy.mean() > 0.3
    off = np.abs(two.distance_m - one.distance_m)[cloudy]
    assert np.median(off) < 1.0
    np.testing.assert_allclose(two.depth, one.depth, atol=0.06)  # of 5.7 at most
