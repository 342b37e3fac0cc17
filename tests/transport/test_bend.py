"""The beam between nodes, against integrals along the way to the sun through the same nodes."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
from scipy.ndimage import map_coordinates
from tests.transport.scenes import WAVELENGTH_NM, grid_scene, sun_at_zenith_angle, toward

from openswim.cameras import Rays
from openswim.solver import Solver

CELL_M, NODES = 40.0, 25
OMEGA = 0.01  # whatever is scattered twice does not count
_STEP = 0.1  # of a cell


def bodies() -> dict[str, np.ndarray]:
    """Extinction (nz, ny, nx), 1/m: a box of 16 cells and a ball, half as thick on nodes of their surface."""
    away = np.abs(np.arange(NODES) - NODES // 2)
    side = np.interp(away, [7.5, 8.5], [1.0, 0.0])
    distance = np.sqrt(away[:, None, None] ** 2 + away[:, None] ** 2 + away**2)
    return {
        "box": 0.03 * side[:, None, None] * side[:, None] * side,
        "ball": 0.06 * np.interp(distance, [7.5, 8.5], [1.0, 0.0]),
    }


def depth(extinction: np.ndarray, place: np.ndarray, direction: np.ndarray) -> np.ndarray:
    """Optical depths (n,) from places (n, 3; x, y, z in cells) along a direction, extinction linear between nodes."""
    total = np.zeros(len(place))
    for s in np.arange(0.5 * _STEP, 1.8 * NODES, _STEP):
        total += map_coordinates(extinction, (place + s * direction).T[::-1], order=1)
    return total * _STEP * CELL_M


def scattered_once(extinction: np.ndarray, start: np.ndarray, along: np.ndarray, sun: np.ndarray) -> np.ndarray:
    """L' (n,) of single scattering (Henyey-Greenstein, g = .85) at places ``start`` (n, 3) in cells, looking along."""
    light, through = np.zeros(len(start)), np.zeros(len(start))
    for s in np.arange(0.5 * _STEP, 1.8 * NODES, _STEP):
        place = start + s * along
        beta = map_coordinates(extinction, place.T[::-1], order=1)
        own = beta * _STEP * CELL_M
        found = np.flatnonzero((beta > 0) & (through < 12))
        if found.size:
            to_sun = depth(extinction, place[found], sun)
            light[found] += OMEGA * own[found] * np.exp(-to_sun - through[found] - 0.5 * own[found])
        through += own
    return light * (1 - 0.85**2) / (1 + 0.85**2 - 1.7 * (along @ sun)) ** 1.5


@cache
def exact(body: str, zenith: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Where rays start (n, 3; cells), where they go, and what they see of a body."""
    along = toward(70.0, -4.0)
    right, up = np.cross(along, [0.0, 0.0, 1.0]), np.array([0.0, 0.0, 1.0])
    across = np.linspace(-10.0, 10.0, 15)
    offset = (across[:, None, None] * right + across[:, None] * up).reshape(-1, 3)
    start = NODES // 2 + offset - 18.0 * along
    return start, along, scattered_once(bodies()[body], start, along, sun_at_zenith_angle(zenith))


@pytest.mark.parametrize("body", ["box", "ball"])
@pytest.mark.parametrize("zenith", [75.0, 40.0])
@pytest.mark.parametrize(("solver", "bound"), [("fast", 0.08), ("linear", 0.14)])
def test_single_scattering_on_the_shaded_side(body: str, zenith: float, solver: str, bound: float) -> None:
    """The beam grazes faces, fades into them and ends behind them within a cell of optical depth 1.2 or 2.4.

    `fast` is 4 to 7 % off and the linear core 5 to 12; straight lines between the nodes' square roots are 13 to 49, and
    31 to 67.
    """
    extinction, sun = bodies()[body], sun_at_zenith_angle(zenith)
    scene = grid_scene(extinction.astype(np.float32), extinction.shape, (CELL_M,) * 3, single_scattering_albedo=OMEGA)
    start, along, expected = exact(body, zenith)
    middle = np.array([scene.grid.x[NODES // 2], scene.grid.y[NODES // 2], CELL_M * (NODES // 2)])
    seen = Solver(solver, step=0.25).solve(scene, sun, [WAVELENGTH_NM]).view(
        Rays(middle + CELL_M * (start - NODES // 2), along)
    )  # fmt: skip
    error = seen.radiance[:, 0] - expected
    assert np.sqrt(np.mean(error**2)) < bound * expected.mean()
