"""Cubes of free cells against counting them one by one."""

import numpy as np
import pytest

from openswim.transport.march.empty_space import beside, free_cubes, occupied
from openswim.transport.march.walk import _cells_free


def _counted(full, periodic, place, octant):
    """Edge of the largest cube of 1, 2, 4 or 8 cells ahead of a cell without any such node."""
    steps = [1 if octant >> bit & 1 else -1 for bit in (2, 1, 0)]  # level, iy, ix
    edge = 0
    for size in (1, 2, 4, 8):
        for offset in np.ndindex(size, size, size):
            cell = [p + o * s for p, o, s in zip(place, offset, steps, strict=True)]
            for corner in np.ndindex(2, 2, 2):
                node = [c + d for c, d in zip(cell, corner, strict=True)]
                if periodic:
                    node[1:] = (node[1] % full.shape[1], node[2] % full.shape[2])
                if all(0 <= n < most for n, most in zip(node, full.shape, strict=True)) and full[tuple(node)]:
                    return edge
        edge = size
    return edge


@pytest.mark.parametrize("periodic", [False, True])
def test_free_cubes_are_those_that_counting_finds(periodic):
    random = np.random.default_rng(7)
    full = random.random((12, 9, 11)) < 0.006
    cubes = free_cubes(full, periodic)
    assert cubes.shape == full.shape
    found = {}
    for place in random.integers(0, np.array(full.shape) - 1, (50, 3)):
        for octant in range(8):
            node = int(np.ravel_multi_index(tuple(place), full.shape))
            edge = _cells_free(cubes, node, octant)
            assert edge == _counted(full, periodic, place, octant)
            found[edge] = found.get(edge, 0) + 1
    assert set(found) == {0, 1, 2, 4, 8}


def test_occupied_is_cloud_and_what_lies_by_the_ground():
    extinction = np.zeros((1, 5, 3, 4), np.float32)
    extinction[0, 3, 1, 2] = 0.01
    terrain = np.zeros((3, 4))
    terrain[:, 0] = 150.0
    full = occupied(extinction, np.arange(5) * 100.0, terrain)
    assert full[3, 1, 2]
    assert full.sum() == 1 + 2 * 12 + 3  # a cloud, two levels everywhere, a third on the hill
    alone = np.zeros((5, 3, 4), bool)
    alone[3, 1, 3] = True
    assert beside(alone, False).sum() == 3 * 3 * 2
    assert beside(alone, True).sum() == 3 * 3 * 3
