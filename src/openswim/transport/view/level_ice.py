"""The crystals of ice that float level in solved light, as an eye sees them."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from openswim.transport.engine.types import FLOAT
from openswim.transport.ice.level import beyond_means
from openswim.transport.lit.lit_grid import LitGrid
from openswim.transport.march.level_ice import NO_LEVEL_ICE, LevelIce, axes_at

F64 = NDArray[np.float64]

_SAME_DEG = 0.1  # of the sun's altitude, within which eyes share a map


def level_ice(lit: LitGrid, eye: F64 | None) -> LevelIce:
    """Those of a grid as seen from an eye (3,), at whose place all are taken to be upright; None: from far away."""
    species = [] if lit.medium is None else lit.medium.species
    which = next((n for n, one in enumerate(species) if one.level), None)
    if which is None or lit.options.name == "swim":
        return NO_LEVEL_ICE
    axes = axes_at(np.zeros(3) if eye is None else eye, lit.sun, lit.frame.radius_m)
    altitude = float(np.degrees(np.arcsin(np.clip(lit.sun @ axes[2], -1, 1))))
    altitude = _SAME_DEG * round(altitude / _SAME_DEG)
    crystals = species[which]
    scattering = crystals.relative_extinction * crystals.single_scattering_albedo

    def table() -> NDArray[np.float32]:
        return (beyond_means(lit.wavelengths_nm, altitude, crystals.level) * scattering).astype(FLOAT)

    return LevelIce(which, axes, lit.once(f"level ice, sun at {altitude:.1f}", table))
