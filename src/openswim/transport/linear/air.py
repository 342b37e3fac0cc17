"""The air of a scene as the linear core has it: kinds of matter that are alike in every column, and what enters."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from openswim.optics.species import Background
from openswim.scene.phase import PhaseFunction
from openswim.transport.air.shells import rows_between, shell_levels
from openswim.transport.engine.pack import PACK
from openswim.transport.linear.optics import Scatterer
from openswim.transport.march.forward_peak import forward_share
from openswim.transport.march.volume import AIR_DEGREE, Shells
from openswim.transport.medium.coefficients import on_levels
from openswim.transport.medium.medium import Medium

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]

MOLECULES, AEROSOL = "air_molecules", "background_aerosol"
_DARK = 80.0  # depth at which there is no sun


@dataclass(frozen=True, eq=False)
class OfAir:
    """The air at one term: extinction (2, nz) of molecules and aerosol, the aerosol's single-scattering albedo, both
    phase functions; gas (nz,): all other absorption; sun_depth, sun_forward (nz, ny, nx): of the shells, to the sun."""

    extinction: F64
    albedo: float
    phase: tuple[PhaseFunction, PhaseFunction]
    gas: F64
    sun_depth: F64
    sun_forward: F64


def air_at(medium: Medium, air: Background, shells: Shells, mu_sun: F64, w: int) -> OfAir:
    """The air of one of a pack's wavelengths; mu_sun (ny, nx)."""
    rows = np.stack([shells.extinction[:, w], shells.rows[:, PACK + w], shells.rows[:, 2 * PACK + w]], axis=-1)
    scaled, molecules, scattered = on_levels(medium, shells, rows).T
    albedo = float(np.nan_to_num(air.aerosol_albedo[w], nan=1.0)) or 1.0
    f = float(forward_share(np.asarray(air.aerosol_phase[w].moments(AIR_DEGREE + 1), float), AIR_DEGREE))
    aerosol = scattered / albedo
    gas = scaled - molecules - aerosol * (1 - albedo * f)
    tables = (shells.sun_depth[..., w], shells.sun_forward[..., w])
    depth, forward = (_to_sun(medium, shells, table, mu_sun) for table in tables)
    return OfAir(
        np.stack([molecules, aerosol]), albedo, (air.rayleigh_phase, air.aerosol_phase[w]), gas, depth, forward
    )  # fmt: skip


def _to_sun(medium: Medium, shells: Shells, table: F32, mu_sun: F64) -> F64:
    """Depth (nz, ny, nx) to the sun by a table (nl, suns) of the shells, linear in height between their levels."""
    count = table.shape[1]
    out = np.empty((len(medium.levels_m), *mu_sun.shape))
    above = np.maximum(medium.levels_m - shells.ground_m, 0.0)
    levels = np.interp(above, shell_levels(), np.arange(len(table)))
    for k, level in enumerate(levels):
        lower = min(int(level), len(table) - 2)
        ends = []
        for n in (lower, lower + 1):
            horizon = float(shells.horizon[n])
            t = np.sqrt(np.clip((mu_sun - horizon) / (1 - horizon), 0, 1)) * (count - 1)
            ends.append(rows_between(table[n][:, None], t)[..., 0])
        out[k] = ends[0] + (level - lower) * (ends[1] - ends[0])
    return np.minimum(out, _DARK)


def air_kinds(airs: Sequence[OfAir]) -> list[Scatterer]:
    """Molecules and background aerosol at the terms."""
    albedo = np.array([one.albedo for one in airs])
    return [
        Scatterer(MOLECULES, np.ones(len(airs)), [one.phase[0] for one in airs]),
        Scatterer(AEROSOL, albedo, [one.phase[1] for one in airs], AIR_DEGREE),
    ]
