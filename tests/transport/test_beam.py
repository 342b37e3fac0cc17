"""What cells take of the beam, against integrals over them and what the sun loses."""

from __future__ import annotations

import time

import numpy as np
import pytest
from scipy.interpolate import RegularGridInterpolator

from openswim.transport.beam.lit_volume import _between, _lattice
from openswim.transport.diffuse.absorbed_beam import beam_around
from openswim.transport.diffuse.optical_grid import OpticalGrid, optical_grid
from openswim.transport.engine.ordinates import harmonic_matrix
from openswim.transport.engine.pack import PACK
from openswim.transport.medium.delta_scaled import Coefficients

NZ, NY, NX = 18, 2, 32
CELL_M = 50.0
FINER = 5


def lit(extinction: np.ndarray, sun: np.ndarray):
    """Transmission to the sun at places (n, 2) of a plane cloud (nz, nx), in cells, extinction linear between nodes."""
    field = RegularGridInterpolator((np.arange(NZ), np.arange(NX)), extinction, bounds_error=False, fill_value=0.0)
    steps = np.arange(0.0, 40.0, 0.1) + 0.05

    def transmission(place):
        way = place[:, None, :] + steps[:, None] * np.array([sun[2], sun[0]])
        return np.exp(-0.1 * CELL_M * field(way).sum(axis=1)), field(place)

    return transmission


def grid_of(extinction: np.ndarray, beam: np.ndarray, sun: np.ndarray, air: float = 0.0) -> OpticalGrid:
    """A grid of extinction and beam (nz, nx), alike along y."""
    f32 = np.float32
    harmonics = np.broadcast_to(harmonic_matrix(sun[None], 5).astype(f32)[0][None, :, None], (NY, 25, NX))
    everywhere = np.repeat(extinction[None, :, None, :], NY, axis=2).astype(f32)
    of_air = np.full(NZ, air, f32), np.full((NZ, 5), air, f32)
    coefficients = Coefficients(np.ones(1, f32), np.ones((1, 5), f32), *of_air)
    return optical_grid(
        everywhere, harmonics, CELL_M * np.arange(NZ), np.full(2, CELL_M), False, np.full((2, 2), True),
        np.zeros((NY, NX), np.int64), coefficients, np.repeat(beam[:, None, :], NY, axis=1).astype(f32),
    )  # fmt: skip


def round_cloud(depth: float) -> np.ndarray:
    """Cells of some optical depth in its middle."""
    z, x = np.mgrid[0:NZ, 0:NX]
    return depth / CELL_M * np.clip(5.0 - np.hypot(z - 8.3, (x - 15.4) / 2.0), 0.0, 1.0)


def beam_at_nodes(extinction: np.ndarray, sun: np.ndarray) -> np.ndarray:
    z, x = np.mgrid[0:NZ, 0:NX]
    return lit(extinction, sun)(np.stack([z, x], -1).reshape(-1, 2).astype(float))[0].reshape(NZ, NX)


def toward(zenith_deg: float) -> np.ndarray:
    zenith = np.radians(zenith_deg)
    return np.array([np.sin(zenith), 0.0, np.cos(zenith)])


@pytest.mark.parametrize("zenith_deg", [0.0, 45.0, 75.0])
@pytest.mark.parametrize(("depth", "off"), [(0.3, 0.01), (1.0, 0.01), (3.0, 0.03)])
def test_sweeps_get_of_the_beam_what_the_cloud_takes(depth: float, off: float, zenith_deg: float) -> None:
    """A round cloud: its nodes' products alone are up to 28 % short."""
    sun = toward(zenith_deg)
    extinction = round_cloud(depth)
    at_nodes = beam_at_nodes(extinction, sun)
    inside = (np.arange(FINER) + 0.5) / FINER
    fine = np.stack(np.meshgrid(*((np.arange(n - 1)[:, None] + inside).ravel() for n in (NZ, NX)), indexing="ij"), -1)
    beam, there = lit(extinction, sun)(fine.reshape(-1, 2))
    taken = (beam * there).sum() / FINER**2
    around = beam_around(grid_of(extinction, at_nodes, sun))[:, 0, :NX]
    assert abs((extinction * at_nodes).sum() / taken - 1) > 0.005
    assert abs((extinction * around).sum() / taken - 1) < off


def test_clear_air_and_shadows_keep_their_beam() -> None:
    """Where there is no cloud the beam is left as it is, whatever shadow's edge crosses it; nor does thin cloud there
    seem to take many times its light."""
    sun = toward(45.0)
    thick = round_cloud(3.0)
    air = 1e-5
    found = beam_around(grid_of(thick, beam_at_nodes(thick, sun), sun, air))[:, 0, :NX]
    far = np.ones((NZ, NX), bool)
    for k, i in np.argwhere(thick > 0):
        far[max(k - 1, 0) : k + 2, max(i - 1, 0) : i + 2] = False
    assert np.abs(found - beam_at_nodes(thick, sun))[far].max() < 1e-6
    thin = np.where(thick > 0, thick, 2e-6)
    found = beam_around(grid_of(thin, beam_at_nodes(thick, sun), sun))[:, 0, :NX]
    assert np.abs(found - beam_at_nodes(thick, sun))[far].max() < 3e-3


def test_the_terrains_shadow_is_no_cloud() -> None:
    """Cloud behind a hill: the beam ends between two nodes, and nothing has taken it."""
    sun = toward(60.0)
    deck = np.zeros((NZ, NX))
    deck[5:9] = 0.2 / CELL_M
    above = [np.trapezoid(deck[k:, 0]) * CELL_M for k in range(NZ)]
    beam = np.exp(-np.array(above) / sun[2])[:, None] * np.ones(NX)
    free = beam_around(grid_of(deck, beam, sun))[:, 0, :NX]
    found = beam_around(grid_of(deck, np.where(np.arange(NX) < 12, 0.0, beam), sun))[:, 0, :NX]
    assert (found[:, :12] == 0).all()
    np.testing.assert_allclose(found[:, 13:], free[:, 13:], rtol=1e-6)
    np.testing.assert_allclose(found[:, 12], free[:, 12], rtol=0.15)


@pytest.mark.parametrize("altitude_deg", [30.0, 5.0, 2.0, 1.0])
def test_a_deck_takes_all_of_a_low_sun(altitude_deg: float) -> None:
    """Across a cell of an even deck the beam fades by up to e^-38; half of it was lost at two degrees, all at one."""
    altitude = np.radians(altitude_deg)
    sun = np.array([np.cos(altitude), 0.0, np.sin(altitude)])
    extinction = np.repeat(0.03 * np.clip(5.0 - np.abs(np.arange(NZ) - 8.0), 0.0, 1.0)[:, None], NX, axis=1)
    layer = 0.5 * CELL_M * (extinction[1:] + extinction[:-1])
    above = np.append(np.cumsum(layer[::-1], axis=0)[::-1], np.zeros((1, NX)), axis=0)
    around = beam_around(grid_of(extinction, np.exp(-np.minimum(above / sun[2], 80.0)), sun))[:, 0, 4 : NX - 4]
    taken = CELL_M * (extinction[:, 4 : NX - 4] * around).sum(axis=0)
    np.testing.assert_allclose(taken, sun[2] * (1 - np.exp(-above[0, 0] / sun[2])), rtol=0.01)


def test_what_the_moon_leaves_is_found_quickly_where_cells_are_wide() -> None:
    """Between places of a lattice, which has every node of a grid of wide cells, in two steps and not for all pairs."""
    rows, columns = _lattice(60, 1000.0)[1], _lattice(45, 1500.0)[1]
    values = np.random.default_rng(3).random((2, rows.shape[1], columns.shape[1], PACK))
    right = np.einsum("jJ,iI,hJIw->whji", rows, columns, values)
    np.testing.assert_allclose(_between(rows, columns, values), right, rtol=1e-12)
    every = _lattice(240, 9000.0)[1]
    assert every.shape == (240, 240)
    started = time.process_time()
    _between(every, every, np.ones((4, 240, 240, PACK)))
    assert time.process_time() - started < 5.0
