"""The field's source toward one eye, node by node: what the march reads between them."""

from __future__ import annotations

import math

import numpy as np
from numba import njit, prange

from openswim.transport.march import PEAK_INNER, PEAK_OUTER
from openswim.transport.scalar import harmonics, smoothstep

_FLAGS = {"contract", "reassoc", "nsz", "arcp"}
_FOUR_PI = np.float32(4.0 * math.pi)


@njit(cache=True, error_model="numpy", _nrt=False, fastmath=_FLAGS)
def _haze_peak(cos_angle, phi, table, w):
    """The haze's forward peak behind a delta-scaled forward depth ``phi``; as `prepare_ray`, for one place only."""
    angle = math.acos(min(1.0, max(-1.0, cos_angle)))
    t = math.sqrt(angle / math.pi) * (table.shape[1] - 1)
    i = min(int(t), table.shape[1] - 2)
    a = np.float32(t - i)
    share = smoothstep((cos_angle - PEAK_OUTER) / (PEAK_INNER - PEAK_OUTER))
    seen = (1.0 - share) * (table[0, i, 0, w] + a * (table[0, i + 1, 0, w] - table[0, i, 0, w]))
    if share > 0.0:
        p = phi / (1.0 + phi) * (table.shape[2] - 1)
        q = min(int(p), table.shape[2] - 2)
        p -= q
        here = table[0, i, q, w] + a * (table[0, i + 1, q, w] - table[0, i, q, w])
        beyond = table[0, i, q + 1, w] + a * (table[0, i + 1, q + 1, w] - table[0, i, q + 1, w])
        seen += share * (here * (1.0 - p) + beyond * p)
    return seen


@njit(cache=True, error_model="numpy", parallel=True, fastmath=_FLAGS)
def view_source(
    species_extinction,
    scattering,
    air_scattering,
    air_forward,
    beam,
    sun_harmonics,
    moments,
    axes,
    place,
    levels_m,
    eye,
    parallel_view,
    sun,
    haze_table,
    w,
    forward_channel,
    channel,
    fields,
):
    """Smooth source toward one eye at every node, and the haze's forward peak, into fields[..., channel].

    axes (ny, nx, 3, 3): the columns' own axes (rows) in the scene frame; place (ny, nx, 3): their sea-level points.
    eye: the eye's position, or its viewing direction where ``parallel_view``. haze_table (angle, depth, PACK).
    """
    nz, ny, nx = beam.shape
    ns = species_extinction.shape[0]
    degree = air_scattering.shape[1]
    for j in prange(ny):
        harmonic = np.zeros(degree * degree)
        for k in range(nz):
            for i in range(nx):
                a = axes[j, i]
                if parallel_view:
                    vx, vy, vz = eye[0], eye[1], eye[2]
                else:
                    h = levels_m[k]
                    vx = place[j, i, 0] + h * a[2, 0] - eye[0]
                    vy = place[j, i, 1] + h * a[2, 1] - eye[1]
                    vz = place[j, i, 2] + h * a[2, 2] - eye[2]
                    r = 1.0 / (math.sqrt(vx * vx + vy * vy + vz * vz) + 1e-6)
                    vx, vy, vz = vx * r, vy * r, vz * r
                lx = a[0, 0] * vx + a[0, 1] * vy + a[0, 2] * vz
                ly = a[1, 0] * vx + a[1, 1] * vy + a[1, 2] * vz
                lz = a[2, 0] * vx + a[2, 1] * vy + a[2, 2] * vz
                harmonics(lx, ly, lz, degree, harmonic)
                total = 0.0
                for ell in range(degree):
                    sigma = air_scattering[k, ell]
                    for s in range(ns):
                        sigma += scattering[s, ell] * species_extinction[s, k, j, i]
                    if sigma == 0.0:
                        continue
                    part = 0.0
                    for index in range(ell * ell, (ell + 1) * (ell + 1)):
                        part += harmonic[index] * (
                            moments[k, j, index, i] + _FOUR_PI * sun_harmonics[index, j, i] * beam[k, j, i]
                        )
                    total += sigma * part
                if air_forward[k] > 0.0:
                    cos_angle = vx * sun[0] + vy * sun[1] + vz * sun[2]
                    seen = _haze_peak(cos_angle, fields[k, j, i, forward_channel], haze_table, w)
                    total += air_forward[k] * seen * beam[k, j, i]
                fields[k, j, i, channel] = total
