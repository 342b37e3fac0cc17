"""Rays through hexagonal prisms of ice: geometric optics, unpolarised Fresnel shares at every face, no absorption.

A prism has the circumradius 1 and its axis along z. Light comes from anywhere and leaves in several directions, each
with its share of the light that fell on the prism.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from openswim.transport.engine.compiled import kernel

F64 = NDArray[np.float64]

MOST_WAYS = 24  # out of a prism: reflected outside, then at each face that is met within
_LEAST_SHARE = 2e-3  # of light that is followed further
_ROOT = 1.085070245491451
_APOTHEM = math.sqrt(0.75)
NORMALS = np.array(
    [[math.cos(math.radians(60 * k)), math.sin(math.radians(60 * k)), 0.0] for k in range(6)]
    + [[0.0, 0.0, 1.0], [0.0, 0.0, -1.0]]
)


@kernel()
def _reflected(cos_in, cos_out, n_in, n_out):
    """Fresnel's share of unpolarised light, by the cosines on both sides of a face."""
    s = (n_in * cos_in - n_out * cos_out) / (n_in * cos_in + n_out * cos_out)
    p = (n_out * cos_in - n_in * cos_out) / (n_out * cos_in + n_in * cos_out)
    return 0.5 * (s * s + p * p)


@kernel()
def trace(px, py, pz, dx, dy, dz, index, half_length, ways):
    """Follow a ray through a point, in a direction, of a prism of a refractive index and half as long as given. Fills
    ``ways`` (MOST_WAYS, 4) with unit directions and shares; returns how many there are, 0 where the ray misses."""
    enter, leave, face = -1e30, 1e30, -1
    for k in range(8):
        nx, ny, nz = NORMALS[k]
        far = _APOTHEM if k < 6 else half_length
        along = dx * nx + dy * ny + dz * nz
        left = far - (px * nx + py * ny + pz * nz)
        if along < -1e-12:
            if left / along > enter:
                enter, face = left / along, k
        elif along > 1e-12:
            leave = min(leave, left / along)
        elif left < 0.0:
            return 0
    if enter >= leave or face < 0:
        return 0
    x, y, z = px + enter * dx, py + enter * dy, pz + enter * dz
    nx, ny, nz = NORMALS[face]
    cos_in = -(dx * nx + dy * ny + dz * nz)
    cos_out = math.sqrt(1.0 - (1.0 - cos_in * cos_in) / (index * index))
    share = _reflected(cos_in, cos_out, 1.0, index)
    ways[0, 0], ways[0, 1], ways[0, 2] = dx + 2 * cos_in * nx, dy + 2 * cos_in * ny, dz + 2 * cos_in * nz
    ways[0, 3] = share
    left_share, count = 1.0 - share, 1
    bend = cos_in / index - cos_out
    dx, dy, dz = dx / index + bend * nx, dy / index + bend * ny, dz / index + bend * nz
    for _ in range(200):
        leave, face = 1e30, -1
        for k in range(8):
            nx, ny, nz = NORMALS[k]
            along = dx * nx + dy * ny + dz * nz
            if along > 1e-12:
                far = _APOTHEM if k < 6 else half_length
                t = (far - (x * nx + y * ny + z * nz)) / along
                if t < leave:
                    leave, face = t, k
        x, y, z = x + leave * dx, y + leave * dy, z + leave * dz
        nx, ny, nz = NORMALS[face]
        cos_in = dx * nx + dy * ny + dz * nz
        square = 1.0 - (1.0 - cos_in * cos_in) * index * index
        if square > 0.0:
            cos_out = math.sqrt(square)
            share = _reflected(cos_in, cos_out, index, 1.0)
            bend = cos_out - index * cos_in
            ways[count, 0], ways[count, 1] = index * dx + bend * nx, index * dy + bend * ny
            ways[count, 2] = index * dz + bend * nz
            last = count == MOST_WAYS - 1 or left_share * share < _LEAST_SHARE
            ways[count, 3] = left_share if last else left_share * (1.0 - share)
            count += 1
            if last:
                return count
            left_share *= share
        dx, dy, dz = dx - 2 * cos_in * nx, dy - 2 * cos_in * ny, dz - 2 * cos_in * nz
    ways[count, 0], ways[count, 1], ways[count, 2], ways[count, 3] = dx, dy, dz, left_share  # caught for good
    return count + 1


@kernel()
def even(n, which):
    """Numbers from 0 to 1 that fill the unit cube of up to eight dimensions evenly (Roberts's sequence, of the root
    of x^9 = x + 1)."""
    return (0.5 + n * _ROOT ** -(which + 1.0)) % 1.0


@kernel()
def through_disc(dx, dy, dz, radius, share, part):
    """The point of a disc around the origin, across a direction, at a share of its area and a part of a turn."""
    sine = math.sqrt(max(1.0 - dz * dz, 1e-12))
    r, turn = radius * math.sqrt(share), 2.0 * math.pi * part
    u, v = r * math.cos(turn), r * math.sin(turn)
    # two directions across the ray: (dy, -dx, 0)/sine, and the product of both
    return u * dy / sine + v * dx * dz / sine, -u * dx / sine + v * dy * dz / sine, -v * sine


@kernel()
def scattered(index, half_length, rays, angles):
    """What prisms of all orientations scatter: shares of the light that falls on them in even bins (angles,) of the
    scattering angle, and, last, of what goes straight on."""
    out, ways = np.zeros(angles + 1), np.zeros((MOST_WAYS + 1, 4))
    radius, hits = math.sqrt(1.0 + half_length * half_length), 0
    for ray in range(rays):
        dz = 2.0 * even(ray, 0) - 1.0
        turn = 2.0 * math.pi * even(ray, 1)
        sine = math.sqrt(1.0 - dz * dz)
        dx, dy = sine * math.cos(turn), sine * math.sin(turn)
        px, py, pz = through_disc(dx, dy, dz, radius, even(ray, 2), even(ray, 3))
        count = trace(px, py, pz, dx, dy, dz, index, half_length, ways)
        hits += min(count, 1)
        for n in range(count):
            cosine = dx * ways[n, 0] + dy * ways[n, 1] + dz * ways[n, 2]
            if cosine > 1.0 - 1e-9:
                out[angles] += ways[n, 3]
            else:
                out[min(int(math.acos(max(cosine, -1.0)) / math.pi * angles), angles - 1)] += ways[n, 3]
    return out / hits
