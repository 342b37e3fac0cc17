"""How a model's own aerosol goes on beyond the sides and the top of its domain: as layers of the background.

Nothing is known there. What the domain has at least at each height, in all of its columns, is taken to go on:
within, the domain's field is what it says, no more and no less, and plumes fade over a rim.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from openswim.scene import Optics
from openswim.scene.aerosol import DEFAULT_AEROSOL, AerosolProfile
from openswim.scene.interpolation import on_levels
from openswim.scene.variables import DIRECT_PREFIX

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]

_SCALE_M = 1500.0  # over which it thins above the model's top
_DEEPEST_M = -500.0  # of the ground beyond
_MOST_COLUMNS = 20_000  # that are looked at where levels follow the ground
_HIGHEST_M = 99_000.0


@dataclass(frozen=True)
class Haze:
    """A file's own aerosol: extinction at 550 nm (1/m) and optics by kind; whole: whether that is all of it, or lies
    on the background."""

    extinction_per_m: Mapping[str, F32] = field(default_factory=dict)
    optics: Mapping[str, Optics] = field(default_factory=dict)
    whole: bool = False

    @property
    def fields(self) -> dict[str, F32]:
        """As a scene names them; "aerosol" is the scene's own `aerosol_extinction`."""
        return {"aerosol_extinction" if kind == "aerosol" else DIRECT_PREFIX + kind: values
                for kind, values in self.extinction_per_m.items()}  # fmt: skip

    def background(self, height_m: NDArray[Any], notes: list[str]) -> list[AerosolProfile]:
        """The layers of the background: how this aerosol goes on, on the default one if it is not all there is."""
        beyond = layers_beyond(self.extinction_per_m, self.optics, height_m)
        notes.append(background_note(self.extinction_per_m if self.whole else ()))
        return beyond if self.whole else [AerosolProfile(), *beyond]


def background_note(kinds: Iterable[str]) -> str:
    """What the background is where a file's own aerosol is all there is, of these kinds; of none: where it is not."""
    named = ", ".join(kind.replace("_", " ") for kind in kinds)
    if not named:
        return f"gas and aerosol background: US standard atmosphere with {DEFAULT_AEROSOL}"
    return f"gas background: US standard atmosphere; no aerosol but the file's ({named})"


def layers_beyond(
    extinction: Mapping[str, F32], optics: Mapping[str, Optics], height_m: NDArray[Any]
) -> list[AerosolProfile]:
    """One layer for each kind of aerosol whose extinction at 550 nm (nz, ny, nx) at heights (nz[, ny, nx]) is given."""
    return [_layer(kind, optics[kind], *_least(values, height_m)) for kind, values in extinction.items()]


def _least(values: F32, height_m: NDArray[Any]) -> tuple[F64, F64]:
    """Heights, and the least extinction of all columns there."""
    if height_m.ndim == 1:
        levels, least = height_m.astype(float), values.min(axis=(1, 2)).astype(float)
    else:
        step = max(1, round((values[0].size / _MOST_COLUMNS) ** 0.5))
        some, heights = values[:, ::step, ::step], height_m[:, ::step, ::step]
        of_levels = [getattr(heights, which)(axis=(1, 2)).astype(float) for which in ("min", "mean", "max")]
        levels = np.unique(np.round(np.concatenate(of_levels), 1))
        # nothing is known below a column's lowest level, and nothing asked
        known = [(heights[0] <= z + 0.1, on_levels(some, heights, np.array([z]), True)[0]) for z in levels]
        least = np.array([np.where(there, each, np.inf).min() for there, each in known], float)
    inside = levels < _HIGHEST_M
    return levels[inside], least[inside]


def _layer(kind: str, optics: Optics, levels: F64, least: F64) -> AerosolProfile:
    rise = np.array([0.5, 1.0, 1.5, 2.0, 3.0, 4.0]) * _SCALE_M
    above = levels[-1] + rise[levels[-1] + rise < _HIGHEST_M]
    thinned = least[-1] * np.exp(-(above - levels[-1]) / _SCALE_M)
    low = min(_DEEPEST_M, float(levels[0]) - 1.0)
    heights = np.concatenate([[low], levels, above])
    values = np.concatenate([[least[0]], least, thinned])
    if thinned.size:
        values[-1] = 0.0
    depth = float(np.trapezoid(values, heights))
    albedo = optics.single_scattering_albedo
    return AerosolProfile(
        optical_depth=depth,
        angstrom_exponent=optics.angstrom_exponent or 0.0,
        single_scattering_albedo=float(np.mean(albedo)) if isinstance(albedo, np.ndarray) else albedo,
        phase=optics.phase,
        profile=dict(zip(heights.tolist(), (values if depth > 0 else np.ones_like(values)).tolist(), strict=True)),
        relative_extinction=optics.relative_extinction,
        name=kind,
        beyond=True,
    )
