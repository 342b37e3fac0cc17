"""The field's smooth source toward one eye, node by node: what the march reads between them."""

from __future__ import annotations

from typing import Any

import numpy as np
from numba import njit, prange
from numpy.typing import NDArray

from openswim.transport.moments import moment_row
from openswim.transport.pack import LANES, flat, put, read_quadruple, root, spread_quadruple, write
from openswim.transport.scalar import ALONG, BACK, UP
from openswim.transport.volume import DEGREE

_FLAGS = {"contract", "reassoc", "nsz", "arcp", "nnan", "ninf"}
_ZERO, _ONE = np.float32(0.0), np.float32(1.0)
_ROOT_2 = np.float32(2.0**0.5)
_FIRST = np.float32(0.28209479177387814)


def columns_of(axes: NDArray, place: NDArray, eye: NDArray, parallel: bool) -> NDArray[np.float32]:
    """Rows (ny, 12, nx) for `view_source`: sea-level points (ny, nx, 3) seen from the eye, then the columns' axes."""
    away = np.zeros_like(place) if parallel else place - eye
    rows = np.concatenate([away, axes.reshape(*axes.shape[:2], 9)], axis=-1)
    return wide(np.ascontiguousarray(np.moveaxis(rows, -1, 1), np.float32))


def wide(array: NDArray[Any]) -> NDArray[np.float32]:
    """The array itself, or with rows too short for a pack made long enough."""
    short = LANES - array.shape[-1]
    padded = array if short <= 0 else np.pad(array, [(0, 0)] * (array.ndim - 1) + [(0, short)])
    return np.require(padded, np.float32, "CW")


@njit(cache=True, error_model="numpy", _nrt=False, fastmath=_FLAGS)
def _row(
    k, j, extinction, scattering, air_scattering, beam, moments, columns, height, eye, parallel, sun, channel, fields,
    scratch,
):  # fmt: skip
    """The nodes of a row, LANES at a time; ``moments`` (M^2, nx) are the row's own."""
    nz, ny, nx = beam.shape
    for block in range((nx + LANES - 1) // LANES):
        i = min(block * LANES, nx - LANES)
        node = (k * ny + j) * nx + i
        c = j * 12 * nx + i
        ax, ay, az = read_quadruple(columns, c + 9 * nx), read_quadruple(columns, c + 10 * nx), read_quadruple(
            columns, c + 11 * nx
        )
        if parallel:
            vx, vy, vz = spread_quadruple(eye[0]), spread_quadruple(eye[1]), spread_quadruple(eye[2])
        else:
            vx = read_quadruple(columns, c) + height * ax
            vy = read_quadruple(columns, c + nx) + height * ay
            vz = read_quadruple(columns, c + 2 * nx) + height * az
            r = _ONE / (root(vx * vx + vy * vy + vz * vz) + np.float32(1e-6))
            vx, vy, vz = vx * r, vy * r, vz * r
        x = read_quadruple(columns, c + 3 * nx) * vx + read_quadruple(columns, c + 4 * nx) * vy
        x += read_quadruple(columns, c + 5 * nx) * vz
        y = read_quadruple(columns, c + 6 * nx) * vx + read_quadruple(columns, c + 7 * nx) * vy
        y += read_quadruple(columns, c + 8 * nx) * vz
        z = ax * vx + ay * vy + az * vz
        angle = vx * sun[0] + vy * sun[1] + vz * sun[2]
        lit = read_quadruple(beam, node)
        total = spread_quadruple(_ZERO)
        p0, p1 = spread_quadruple(_ONE), angle
        for ell in range(DEGREE):
            sigma = spread_quadruple(_ZERO)
            for s in range(extinction.shape[0]):
                sigma += scattering[s, ell] * read_quadruple(extinction, s * nz * ny * nx + node)
            # once scattered: 4 pi sum_m Y_lm(v) Y_lm(sun) = (2l+1) P_l; by air at the ray's own angle, in the march
            total += sigma * lit * (np.float32(2 * ell + 1) * p0)
            write(scratch, ell * LANES, sigma + air_scattering[k, ell])
            up = (np.float32((2 * ell + 3) / (ell + 2)) * angle) * p1 - np.float32((ell + 1) / (ell + 2)) * p0
            p0, p1 = p1, up
        # the harmonics of `scalar.harmonics`, each used at once
        cosine, sine, corner = spread_quadruple(_ONE), spread_quadruple(_ZERO), spread_quadruple(_FIRST)
        for m in range(DEGREE):
            p0, p1 = spread_quadruple(_ZERO), corner
            for ell in range(m, DEGREE):
                if ell > m:
                    up = np.float32(UP[ell, m]) * (z * p1 - np.float32(BACK[ell, m]) * p0)
                    p0, p1 = p1, up
                sigma = read_quadruple(scratch, ell * LANES)
                n = (ell * ell + ell) * nx + i
                if m == 0:
                    total += sigma * p1 * read_quadruple(moments, n)
                else:
                    both = cosine * read_quadruple(moments, n + m * nx) + sine * read_quadruple(moments, n - m * nx)
                    total += _ROOT_2 * sigma * p1 * both
            corner *= np.float32(ALONG[m])
            cosine, sine = cosine * x - sine * y, sine * x + cosine * y
        write(scratch, DEGREE * LANES, total)
        for n in range(min(LANES, fields.shape[2] - i)):
            place = ((k * ny + j) * fields.shape[2] + i + n) * fields.shape[3] + channel
            put(fields, place, flat(scratch, DEGREE * LANES + n))


@njit(cache=True, error_model="numpy", parallel=True, fastmath=_FLAGS)
def view_source(
    extinction, scattering, air_scattering, beam, kept, values, coarser, columns, levels_m, eye, parallel, sun,
    channel, fields,
):  # fmt: skip
    """Smooth source toward one eye at every node, into fields[..., channel].

    Per wavelength: ``extinction`` (ns, nz, ny, nx), Legendre moments of the scattering coefficient ``scattering`` (ns,
    M) per extinction and ``air_scattering`` (nz, M), ``beam`` (nz, ny, nx), ``kept`` and ``values`` of the diffuse
    field's `Moments` in the columns' own axes, and the ``coarser`` field for the rest. ``columns``: see `columns_of`.
    ``eye``: the viewing direction where ``parallel``.
    """
    nz, ny = beam.shape[:2]
    for j in prange(ny):
        scratch = np.zeros((DEGREE + 1) * LANES, np.float32)
        coarse = np.empty((DEGREE * DEGREE, coarser.columns), np.float32)
        moments = np.empty((DEGREE * DEGREE, beam.shape[2]), np.float32)
        for k in range(nz):
            moment_row(kept, values, coarser, k, j, coarse, moments)
            _row(
                k, j, extinction, scattering, air_scattering, beam, moments, columns, np.float32(levels_m[k]),
                eye, parallel, sun, channel, fields, scratch,
            )  # fmt: skip
