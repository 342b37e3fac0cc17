"""What a medium is made of, delta-scaled: extinction and scattering per species and wavelength, and of the air."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import solveh_banded

from openswim.optics.species import Background
from openswim.transport.air.shells import rows_between, shell_levels
from openswim.transport.engine.pack import PACK
from openswim.transport.engine.types import FLOAT
from openswim.transport.march.forward_peak import forward_share, peak_tables
from openswim.transport.march.volume import AIR_DEGREE, DEGREE, Shells
from openswim.transport.medium.delta_scaled import Coefficients
from openswim.transport.medium.medium import Medium

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]


def forward_tables(medium: Medium, fast: bool) -> F32:
    """Forward-peak tables of the species, each by what it scatters per reference extinction, then of the background
    aerosol; `swim` reads none in clouds."""
    rows = [s.phase for s in medium.species]
    if medium.air is not None:
        last = aerosol_peaks(medium.air)
        clouds = peak_tables(rows, DEGREE) if rows and fast else np.zeros((len(rows), *last.shape[1:]), FLOAT)
        return np.concatenate([clouds * _scattering(medium), last])
    if not rows or not fast:
        return np.zeros((len(rows) + 1, 2, 2, PACK), FLOAT)
    clouds = peak_tables(rows, medium.degree) * _scattering(medium)
    return np.concatenate([clouds, np.zeros_like(clouds[:1])])


def aerosol_peaks(air: Background | None) -> F32:
    """That of the background aerosol alone; without air there is none."""
    return np.zeros((1, 2, 2, PACK), FLOAT) if air is None else peak_tables([air.aerosol_phase], AIR_DEGREE)


def _scattering(medium: Medium) -> F32:
    """omega per reference extinction, (ns, 1, 1, nw)."""
    rows = [s.relative_extinction * s.single_scattering_albedo for s in medium.species]
    return np.array(rows, FLOAT).reshape(len(rows), 1, 1, PACK)


def coefficients_of(medium: Medium, shells: Shells, w: int, fast: bool) -> Coefficients:
    """Delta-scaled coefficients of species and air at one wavelength; `swim` keeps the full extinction."""
    scaled, scattering = [], []
    for s in medium.species:
        chi = s.phase[w].moments(medium.degree + 1)
        f = forward_share(chi, medium.degree) if fast else 0.0
        k, omega = s.relative_extinction[w], s.single_scattering_albedo[w]
        scaled.append(k * (1 - omega * f))
        scattering.append(k * omega * (chi[:-1] - f))
    air = np.zeros((len(medium.levels_m), 1 + DEGREE))
    if medium.air is not None:
        air = on_levels(medium, shells, np.column_stack([shells.extinction[:, w], shells.scattering[:, :, w]]))
    return Coefficients(
        np.array(scaled, FLOAT),
        np.array(scattering, FLOAT).reshape(-1, medium.degree),
        air[:, 0].astype(FLOAT),
        air[:, 1:].astype(FLOAT),
    )


def on_levels(medium: Medium, shells: Shells, rows: NDArray) -> F64:
    """The piecewise linear profile (nz, c) on a medium's levels that is nearest to one of the shells (nl, c).

    Its values at the levels would not do: what is linear between levels far apart has more air than there is.
    """
    node, weight = np.polynomial.legendre.leggauss(4)
    share = (0.5 + 0.5 * node)[:, None, None]
    levels, dz = medium.levels_m, np.diff(medium.levels_m)
    height = levels[:-1] + share[..., 0] * dz
    own = np.interp(np.maximum(height - shells.ground_m, 0.0), shell_levels(), np.arange(len(rows)))
    within = 0.5 * (weight[:, None] * dz)[..., None] * rows_between(np.asarray(rows, FLOAT), own)
    given = np.zeros((len(levels), rows.shape[1]))
    given[:-1] += (within * (1 - share)).sum(axis=0)
    given[1:] += (within * share).sum(axis=0)
    # overlaps of the levels' hat functions
    overlap = np.zeros((2, len(levels)))
    overlap[0, 1:] = dz / 6
    overlap[1, :-1] += dz / 3
    overlap[1, 1:] += dz / 3
    nearest = np.ascontiguousarray(solveh_banded(overlap, given))
    return np.where((rows >= 0).all(axis=0), np.maximum(nearest, 0), nearest)  # also beside a haze's edge
