"""The least that a view could be: straight rays through a flat grid of eight channels, one cell a step, nothing else.

Engines were compared on this job before there was a model, and its mark for the view comes from it. No curved Earth, no
terrain, no air above, no phase functions, no ground, no colour: what the machine gives, not what a picture needs.
"""

import math
from typing import Any

import numpy as np
from numba import njit, prange

CHANNELS, TILE, OPAQUE = 8, 16, np.float32(12.0)
ONE = np.float32(1.0)


def grid(nx: int, ny: int, nz: int) -> Any:
    """Channels (nz, ny, nx, 8): depth of a cell, thin enough that most rays leave the grid, and sources."""
    field = np.random.default_rng(0).random((nz, ny, nx, CHANNELS), np.float32)
    field[..., 0] *= np.float32(0.002)
    return field


@njit(fastmath=True)
def along(field, x, y, z, dx, dy, dz, at):  # type: ignore[no-untyped-def]
    """Light of three channels along a ray from a place in cells, and its samples; ``at`` (8,) is scratch."""
    nz, ny, nx, _ = field.shape
    depth, a, b, c = np.float32(0.0), np.float32(0.0), np.float32(0.0), np.float32(0.0)
    samples = 0
    while depth < OPAQUE and 0 <= x < nx - 1 and 0 <= y < ny - 1 and 0 <= z < nz - 1:
        i, j, k = int(x), int(y), int(z)
        u, v, w = x - np.float32(i), y - np.float32(j), z - np.float32(k)
        p, q, r, s = (ONE - u) * (ONE - v), u * (ONE - v), (ONE - u) * v, u * v
        p0, q0, r0, s0 = p * (ONE - w), q * (ONE - w), r * (ONE - w), s * (ONE - w)
        p1, q1, r1, s1 = p * w, q * w, r * w, s * w
        for n in range(CHANNELS):
            at[n] = (
                p0 * field[k, j, i, n] + q0 * field[k, j, i + 1, n]
                + r0 * field[k, j + 1, i, n] + s0 * field[k, j + 1, i + 1, n]
                + p1 * field[k + 1, j, i, n] + q1 * field[k + 1, j, i + 1, n]
                + r1 * field[k + 1, j + 1, i, n] + s1 * field[k + 1, j + 1, i + 1, n]
            )  # fmt: skip
        seen = np.float32(math.exp(-depth)) * (ONE - np.float32(math.exp(-at[0])))
        a, b, c = a + seen * at[1], b + seen * at[2], c + seen * at[3]
        depth += at[0]
        x, y, z = x + dx, y + dy, z + dz
        samples += 1
    return a, b, c, samples


@njit(parallel=True, fastmath=True)
def panorama(field, rows, columns, out):  # type: ignore[no-untyped-def]
    """The sphere from the grid's middle, tile by tile, into ``out`` (rows, columns, 3). Returns all samples."""
    nz, ny, nx, channels = field.shape
    across = columns // TILE
    samples = 0
    for tile in prange(rows // TILE * across):
        at = np.empty(channels, np.float32)
        count = 0
        for pixel in range(TILE * TILE):
            row, column = tile // across * TILE + pixel // TILE, tile % across * TILE + pixel % TILE
            azimuth, zenith = 2 * math.pi * column / columns, math.pi * row / rows
            dx, dy = math.sin(zenith) * math.sin(azimuth), math.sin(zenith) * math.cos(azimuth)
            a, b, c, n = along(
                field, np.float32(nx / 2), np.float32(ny / 2), np.float32(nz / 2),
                np.float32(dx), np.float32(dy), np.float32(math.cos(zenith)), at,
            )  # fmt: skip
            out[row, column, 0], out[row, column, 1], out[row, column, 2] = a, b, c
            count += n
        samples += count
    return samples
