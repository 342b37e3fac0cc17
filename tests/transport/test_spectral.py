"""Wavelengths between others, against solutions of their own."""

from __future__ import annotations

import numpy as np
import pytest
from tests.transport.scenes import down_on, grid_scene, toward
from tests.transport.test_quality import CELL_M, SHAPE, cumuli

from openswim.solver import Solver
from openswim.transport.diffuse.moments import Moments, nothing_coarser
from openswim.transport.diffuse.multigrid import Solution
from openswim.transport.diffuse.spectral import Known, in_order, on_both_sides

SUN = toward(200.0, 35.0)
APART = 50.0  # m, of the places that are looked at
OF_THREE, ITS_OWN = [615.0, 546.0, 450.0], [546.0]


@pytest.mark.parametrize("albedo", [0.05, 0.4])
def test_a_wavelength_between_is_as_if_it_were_swept(albedo: float) -> None:
    """From above, and fluxes; what is left of sweeps (`tolerance`) is made small, so that it does not hide anything."""
    scene = grid_scene(cumuli(), SHAPE, (CELL_M,) * 3, surface_albedo=albedo, air=True, curved=True)
    at = np.arange(-1300.0, 1300.0, APART)
    rays = down_on(*(a.ravel() for a in np.meshgrid(at, at)), 3000.0)
    three, own = (Solver(tolerance=1e-3).solve(scene, SUN, wl) for wl in (OF_THREE, ITS_OWN))
    swept = [sweeps[-1] for sweeps in three.lit[0].sweeps]
    assert swept[0] > 0
    assert swept[1] == 0
    assert swept[2] > 0
    found, truth = three.view(rays).radiance[:, 1], own.view(rays).radiance[:, 0]
    assert np.sqrt(np.mean((found / truth - 1) ** 2)) < 4e-3
    assert abs(found.mean() / truth.mean() - 1) < 2.5e-3
    fluxes, alone = three.fluxes(), own.fluxes()
    for name in ("up_top", "down_bottom"):
        assert abs(fluxes[name][1] / alone[name][0] - 1) < 2.5e-3


def known(wavelength_nm: float, properties: list[float], told: bool = True) -> Known:
    """A wavelength with a solution of nothing."""
    nothing = np.zeros((1, 25, 16), np.float32)
    moments = Moments(np.zeros((1, 1, 1), np.int32), nothing)
    fluxes = np.zeros((2, 1, 1), np.float32)
    known_coarse = (nothing[:, :9], fluxes) if told else None
    solution = Solution(moments, nothing_coarser(5), [1], [], fluxes, nothing[:, 0], known_coarse)
    return Known(wavelength_nm, np.array(properties), solution)


def test_only_what_changes_smoothly_is_taken_from_others() -> None:
    a, b = known(450.0, [0.0, 3.0]), known(600.0, [30.0, 3.0])
    assert [k.share for k in on_both_sides(500.0, np.array([10.0, 3.5]), [a, b])] == pytest.approx([2 / 3, 1 / 3])
    assert on_both_sides(500.0, np.array([10.0, 4.5]), [a, b]) == []  # it absorbs, say, and they do not
    assert on_both_sides(620.0, np.array([34.0, 3.0]), [a, b]) == []  # not between
    far = known(700.0, [50.0, 3.0])
    assert on_both_sides(500.0, np.array([10.0, 3.0]), [a, far]) == []  # too far apart
    near = known(480.0, [6.0, 3.0])
    assert [k.wavelength_nm for k in on_both_sides(500.0, np.array([10.0, 3.0]), [a, far, near, b])] == [480.0, 600.0]
    assert on_both_sides(500.0, np.array([10.0, 3.0]), [a, known(600.0, [30.0, 3.0], False)]) == []  # no coarser grid


def test_the_ends_come_first() -> None:
    assert in_order(np.array([615.0, 546.0, 450.0])) == [0, 2, 1]
    assert in_order(np.array([500.0, 400.0, 700.0, 600.0])) == [1, 2, 0, 3]
    assert in_order(np.array([546.0])) == [0]
