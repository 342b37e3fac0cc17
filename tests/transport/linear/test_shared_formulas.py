"""Formulas that `fast` and the linear core share, each against the other: who changes one changes the other, and its
slope (`test_cell.py`). Differences are those of single precision where nothing else is said."""

from typing import NamedTuple

import numpy as np
import pytest
from numba import njit
from tests.transport.linear.plain import plain_world

from openswim.scene.phase import HenyeyGreenstein
from openswim.transport.beam.sun_sweep import BEYOND
from openswim.transport.beam.within_cells import bend_cells
from openswim.transport.diffuse.absorbed_beam import cell_ratios
from openswim.transport.diffuse.absorbed_light import _amend_row
from openswim.transport.diffuse.step import Row, Step
from openswim.transport.engine.pack import LANES, PACK, spread, write
from openswim.transport.engine.types import FLOAT
from openswim.transport.linear import beam_taken, cell, sun_depth
from openswim.transport.linear.sun_depth import depths
from openswim.transport.march.forward_peak import peak_row, peak_table
from openswim.transport.march.march import _plain_step
from openswim.transport.march.sample import _peak_at, _peak_place
from openswim.transport.march.state import Gathered, Sample


@njit
def _peak_of_fast(table, depth, out):
    q, part = _peak_place(spread(depth), table.shape[0])
    write(out, 0, _peak_at(table, 0, q, part))


def test_the_peak_is_read_alike() -> None:
    """At entries of the table both have the entry; between them one is a line and the other a cubic."""
    table = peak_table(HenyeyGreenstein(0.85), 5)
    row = table[int(peak_row(np.radians(3.0), len(table)))]
    packs, out = np.repeat(row[:, None], PACK, axis=1), np.empty(PACK, FLOAT)

    def both(place: float) -> tuple[float, float]:
        share = place / (row.size - 1)
        depth = share / (1 - share)
        _peak_of_fast(packs, FLOAT(depth), out)
        return float(out[0]), cell.peak.py_func(row.astype(float), depth)

    for entry in range(row.size - 1):
        assert both(entry) == pytest.approx((row[entry], row[entry]), rel=2e-5), entry
    apart = [np.ptp(both(entry + 0.5)) / both(entry + 0.5)[1] for entry in range(row.size - 2)]
    assert max(apart) < 1.3 * 0.0201  # at the deepest, where the row bends most


class Buffers(NamedTuple):
    light: np.ndarray
    emitted: np.ndarray
    extinction: np.ndarray
    amended: np.ndarray
    work: np.ndarray


class Ground(NamedTuple):
    cloudy: np.ndarray
    ground_node: np.ndarray


@njit
def _amended_by_fast(row, step, grid, buffers):
    _amend_row(row, 0, step, (FLOAT(1.0), FLOAT(0.0)), -1, 0, grid, buffers)


def test_what_a_step_takes_is_the_same() -> None:
    """`fast` tells it over what the nodes at both ends say, the linear core over their extinction."""
    rng, ds = np.random.default_rng(0), 40.0
    light, emitted, extinction = (rng.uniform(a, b, 5 * LANES) for a, b in ((0.8, 1.2), (2e-3, 2e-2), (2e-3, 2e-2)))
    weights = np.array([0.4, 0.3, 0.2, 0.1, ds, 0.0, 0.0, 0.0])
    at = LANES * np.arange(4)
    buffers = Buffers(*(a.astype(FLOAT) for a in (light, emitted, extinction, 0 * light, 0 * light)))
    grid = Ground(np.ones((1, 1, 1), np.bool_), np.zeros((1, LANES), np.int64))
    _amended_by_fast(Row(4 * LANES, 4 * LANES, 0, LANES, -1), Step(weights.astype(FLOAT), at, at), grid, buffers)
    own, corners = slice(4 * LANES, None), np.stack([np.arange(LANES) + n for n in at])
    share = weights[:4, None]
    up, emitted_up = ((share * a[corners]).sum(axis=0) for a in (light, emitted))
    told = (share * light[corners] * extinction[corners]).sum(axis=0)
    taken = cell.amendment.py_func(light[own], up, emitted[own], emitted_up, extinction[own], told, 1.0, ds)
    of_nodes = told + light[own] * extinction[own]
    assert buffers.amended[own] == pytest.approx(taken / of_nodes, abs=2e-5)
    assert np.abs(buffers.amended[own]).max() > 0.5  # and no bound has been met
    assert -1 < buffers.amended[own].min() < buffers.amended[own].max() < 50


@njit
def _step_of_fast(v, ds, out):
    none = spread(FLOAT(0.0))
    near = Sample(spread(v[0, 0]), none, spread(v[0, 1]), spread(v[0, 2]), spread(v[0, 3]), none, v[0, 4], v[0, 4])
    far = Sample(spread(v[1, 0]), none, spread(v[1, 1]), spread(v[1, 2]), spread(v[1, 3]), none, v[1, 4], v[1, 4])
    seen = _plain_step(Gathered(none, spread(FLOAT(1.0)), none), near, far, ds, none)
    write(out, 0, seen.radiance)
    write(out, PACK, seen.through)


@pytest.mark.parametrize("depth", [0.05, 0.5, 3.0])
def test_a_step_of_an_eye_is_the_same(depth: float) -> None:
    """With the product of what is scattered and the beam, which bends along it."""
    ds, out = 50.0, np.empty(2 * PACK, FLOAT)
    near = np.array([0.6 * depth / ds, 0.01, 0.02, 0.9, 1.0])  # extinction, diffuse, single, beam, cloud
    far = np.array([1.4 * depth / ds, 0.03, 0.06, 0.3, 1.0])
    _step_of_fast(np.stack([near, far]).astype(FLOAT), FLOAT(ds), out)
    trans, w_near, w_far = cell.step_weights.py_func(near[0], far[0], ds)
    less = cell.less_between.py_func(near[2], far[2], near[3], far[3])
    want = w_near * (near[1] + near[2] * near[3] - less) + w_far * (far[1] + far[2] * far[3] - less)
    assert out[0] == pytest.approx(want, rel=4e-5)
    assert out[PACK] == pytest.approx(trans, rel=4e-5)
    assert abs(less * (w_near + w_far)) > 0.05 * want


@pytest.mark.parametrize(("depth", "apart"), [(0.3, 0.021), (3.0, 0.025), (30.0, 0.0135)])
def test_depths_bend_alike_within_cells(depth: float, apart: float) -> None:
    """Of a body of thick and thin cells, the sun aslant. They differ where `fast` cuts what the core bounds."""
    cells, size = np.zeros((7, 8, 9)), np.array([40.0, 30.0, 20.0])
    cells[2:5, 2:6, 3:6] = depth / 30.0 * np.random.default_rng(0).uniform(0.5, 1.5, (3, 4, 3))
    world = plain_world(size[0] * np.arange(7), (20.0, 30.0), (8, 9), (0.5, -0.4, 0.77))
    to_sun = depths(world, np.stack([cells.ravel()] * 2, axis=-1))[:, 0].copy()
    own = sun_depth.bends(world, to_sun, cells.ravel()).reshape(*world.shape, 3)
    theirs, speed = np.zeros((*world.shape, PACK), FLOAT), world.local_sun[0, 0] / [size[2], size[1], 1.0]
    padded = [np.pad(f, ((0, 0), (0, 0), (BEYOND, BEYOND + 1))).astype(FLOAT)
              for f in (to_sun.reshape(world.shape), cells)]  # fmt: skip
    way = np.ascontiguousarray(np.broadcast_to(speed[:, None, None], (3, 8, 9 + LANES)), FLOAT)
    free = np.zeros(world.shape, np.uint32)
    bend_cells(0, 1, *padded, way, size[0] * np.arange(7), free, True, False, theirs)
    cloud = theirs.any(axis=-1)  # the others are left out
    assert cloud.sum() == 4 * 5 * 4
    own, theirs = own[cloud], theirs[cloud][:, :3]
    assert np.ptp(theirs) > depth
    assert np.sqrt(((own - theirs) ** 2).mean()) < apart * np.sqrt((theirs**2).mean())


def test_cells_take_the_same_of_the_beam() -> None:
    """Where no bound of `fast` is met: a beam that fades as lumps of extinction would have it, and a little else."""
    rng, shape, size = np.random.default_rng(0), (2, 2, LANES + 1), np.array([30.0, 40.0, 50.0])
    sun = np.array([0.3, -0.5, np.sqrt(1 - 0.34)])
    z, y, x = (a * n for a, n in zip(np.indices(shape), (size[2], size[1], size[0]), strict=True))
    beam = 0.5 * np.exp(8e-3 * (sun[0] * x + sun[1] * y + sun[2] * z)) * rng.uniform(0.95, 1.05, shape)
    extinction = rng.uniform(6e-3, 1e-2, shape)
    out = np.empty((1, *shape[1:]), FLOAT)
    toward = np.broadcast_to(sun[:, None, None], (3, *shape[1:])).astype(FLOAT)
    cell_ratios(
        0, 1, beam.astype(FLOAT), extinction.astype(FLOAT), np.zeros(2, FLOAT), np.ascontiguousarray(toward),
        np.array([0.0, size[2]]), size[:2], np.ones(2, np.bool_), out,
    )  # fmt: skip
    speed = tuple(np.full((1, 1, LANES), sun[n] / size[n]) for n in (2, 1, 0))
    found, _ = beam_taken._taken(beam, speed)
    corners = [(slice(None), slice(b, b + 1), slice(a, a + LANES)) for b in (0, 1) for a in (0, 1)]
    told = sum((beam * extinction)[c].mean(axis=0) for c in corners) / 4
    assert out[0, 0, :LANES] == pytest.approx((found[0] / told)[0], rel=1e-4)
    assert np.ptp(out[0, 0, :LANES]) > 0.1
