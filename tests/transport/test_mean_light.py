"""What the medium between nodes takes of the beam, against integrals over the cells."""

import numpy as np
import pytest
from scipy.interpolate import RegularGridInterpolator

from openswim.transport.mean_light import beam_around
from openswim.transport.optical_grid import Coefficients, optical_grid

NZ, NY, NX = 18, 2, 32
CELL_M = 50.0
FINER = 5


def lit(extinction, sun):
    """Transmission to the sun at places (n, 2) of a plane cloud (nz, nx), in cells, extinction linear between nodes."""
    field = RegularGridInterpolator((np.arange(NZ), np.arange(NX)), extinction, bounds_error=False, fill_value=0.0)
    steps = np.arange(0.0, 40.0, 0.1) + 0.05

    def transmission(place):
        way = place[:, None, :] + steps[:, None] * np.array([sun[2], sun[0]])
        return np.exp(-0.1 * CELL_M * field(way).sum(axis=1)), field(place)

    return transmission


@pytest.mark.parametrize("zenith_deg", [0.0, 45.0, 75.0])
@pytest.mark.parametrize("depth", [0.3, 1.0])
def test_sweeps_get_of_the_beam_what_the_cloud_takes(depth: float, zenith_deg: float) -> None:
    """A round cloud of cells of some optical depth: its nodes' products alone are up to 10 % short."""
    z, x = np.mgrid[0:NZ, 0:NX]
    round_ = np.clip(5.0 - np.hypot(z - 8.3, (x - 15.4) / 2.0), 0.0, 1.0)
    extinction = (depth / CELL_M * round_).astype(np.float32)
    zenith = np.radians(zenith_deg)
    sun = np.array([np.sin(zenith), 0.0, np.cos(zenith)])
    transmission = lit(extinction, sun)
    at_nodes = transmission(np.stack([z, x], -1).reshape(-1, 2).astype(float))[0].reshape(NZ, NX)
    inside = (np.arange(FINER) + 0.5) / FINER
    fine = np.stack(np.meshgrid(*((np.arange(n - 1)[:, None] + inside).ravel() for n in (NZ, NX)), indexing="ij"), -1)
    beam, there = transmission(fine.reshape(-1, 2))
    taken = (beam * there).sum() / FINER**2

    f32 = np.float32
    everywhere = np.repeat(extinction[None, :, None, :], NY, axis=2)
    grid = optical_grid(
        everywhere, np.zeros((NY, 25, NX), f32), CELL_M * np.arange(NZ), np.full(2, CELL_M), False, True,
        np.zeros((NY, NX), np.int64),
        Coefficients(np.ones(1, f32), np.ones((1, 5), f32), np.zeros(NZ, f32), np.zeros((NZ, 5), f32)),
        np.repeat(at_nodes[:, None, :], NY, axis=1).astype(f32),
    )  # fmt: skip
    around = beam_around(grid)[:, 0, :NX]
    nodes = (extinction * at_nodes).sum() / taken - 1
    assert nodes < -0.005
    assert abs((extinction * around).sum() / taken - 1) < 0.012
