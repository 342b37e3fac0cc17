"""Light through the sides of a grid: the ground's beyond them, and clouds that they cut."""

from __future__ import annotations

import numpy as np
import pytest

from openswim.cameras import Rays
from openswim.scene import Scene
from openswim.scene.phase import HenyeyGreenstein
from openswim.solver import Solver
from openswim.transport.diffuse.inflow import Columns
from openswim.transport.diffuse.sweeper import pairs

SUN = np.array([-0.8138, -0.2962, 0.5])
SUN = SUN / np.linalg.norm(SUN)


def test_a_thin_cloud_is_lit_by_half_a_sphere_of_ground() -> None:
    """What white ground adds to an optically thin cloud seen from below is tau I/2, I the ground's radiance: the ground
    reaches to the horizon all around, far beyond the grid."""
    x, z = 100.0 * np.arange(17), np.array([0.0, 100.0, 400.0, 500.0, 600.0])
    extinction = np.zeros((5, 17, 17), np.float32)
    extinction[3] = 1e-5
    zenith = Rays(np.array([800.0, 800.0, 1.0]), np.array([[0.0, 0.0, 1.0]]))
    radiance = []
    for albedo in (0.0, 1.0):
        scene = Scene.from_arrays(extinction, x, x, z, phase=HenyeyGreenstein(0.0), surface_albedo=albedo)
        radiance.append(float(Solver().solve(scene, SUN, [550.0]).view(zenith).radiance[0, 0]))
    # scattered once: tau/(4 pi) of the beam, and tau/2 of mu/pi of it
    assert (radiance[1] - radiance[0]) / radiance[0] == pytest.approx(2 * SUN[2], rel=0.02)


def test_a_cloud_that_the_sides_cut_ends_there() -> None:
    """A block of cloud as wide as its grid, seen from above, against Monte Carlo: nothing lies beyond its faces. (Light
    bends steeply behind them; taken straight between nodes it is a few per cent too dark.)"""
    x, z = 25.0 * np.arange(33), 500.0 + 25.0 * np.arange(18)
    extinction = np.full((18, 33, 33), 0.02, np.float32)
    extinction[-1] = 0.0
    scene = Scene.from_arrays(extinction, x, x, z, phase=HenyeyGreenstein(0.85), surface_albedo=0.0)
    across = np.linspace(10.0, 790.0, 28)
    place = np.stack([*np.meshgrid(across, across), np.full((28, 28), 950.0)], axis=-1).reshape(-1, 3)
    look = Rays(place, np.tile([0.0, 0.0, -1.0], (len(place), 1)))
    fast = Solver().solve(scene, SUN, [550.0]).view(look).radiance[:, 0].reshape(28, 28)
    exact = Solver("reference", paths=600).solve(scene, SUN, [550.0]).view(look).radiance[:, 0].reshape(28, 28)
    assert fast.mean() == pytest.approx(exact.mean(), rel=0.05)
    for edge in (np.s_[:4], np.s_[-4:], np.s_[:, :4], np.s_[:, -4:]):
        assert fast[edge].mean() == pytest.approx(exact[edge].mean(), rel=0.08)


@pytest.mark.parametrize(("ny", "nx"), [(7, 12), (12, 7), (5, 5), (130, 9)])
def test_what_is_even_along_the_sides_is_so_on_coarser_grids(ny: int, nx: int) -> None:
    """Sides of odd and of different lengths: no node of a coarser grid takes in what lies past a side's end."""
    columns = Columns(ny, nx)
    clear, more = np.full((2, 3), 0.5, np.float32), np.full((2, 3, len(columns.j)), 0.25)
    sides = columns.light(clear, more)
    while sides.shape[-1] > 1:
        np.testing.assert_allclose(sides, 0.75, rtol=1e-6)
        sides = pairs(sides)
