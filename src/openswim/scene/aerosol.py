"""The background aerosol: layers that are the same everywhere on Earth, each with its own kind of particle."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

from openswim.arguments import shown
from openswim.errors import UserError
from openswim.scene.particles import (
    ANGSTROM_EXPONENTS,
    RELATIVE_EXTINCTIONS,
    WAVELENGTHS_NM,
    check_albedo,
    check_number,
    check_phase,
    check_spectrum,
    relative_extinction,
)
from openswim.scene.phase import PhaseFunction, by_wavelength, phases_from_dict

F64 = NDArray[np.float64]
DEFAULT_DEPTH = 0.05
GROUND_WITHIN_M = 50e3
ABOVE_PLACE = "above the mean ground of the domain's middle"  # as users are told; see `central_ground_m`
DEFAULT_AEROSOL = f"the default aerosol (optical depth {DEFAULT_DEPTH:g} at 550 nm {ABOVE_PLACE})"  # the same
EXPONENTIAL_TOP_M = 30_000.0
_RANGES = {
    "optical_depth": (0.0, 100.0),
    "angstrom_exponent": ANGSTROM_EXPONENTS,
    "scale_height_m": (1.0, 1e9),
    "reference_nm": WAVELENGTHS_NM,
}
_BASES = (-1e4, 0.99 * EXPONENTIAL_TOP_M)
_HEIGHTS = (-1e4, 1e5)
_OPTIONAL = ("base_height_m", "phase", "profile", "relative_extinction")
_SPECTRAL = ("single_scattering_albedo", "relative_extinction")


@dataclass(frozen=True)
class AerosolProfile:
    """A horizontally uniform layer of aerosol, which thins exponentially with height or follows a table of heights.

    Exponential: extinction is ~ exp(-(z - base) / scale height) above the base, constant below it, zero above 30 km;
    the optical depth, at `reference_nm`, is that of the column above the base. `base_height_m=None`: the ground of the
    place.
    By table: `profile` = {height above sea level in m: relative extinction}, linear in between, zero beyond its ends;
    the optical depth is that of the whole table.

    `single_scattering_albedo` and `phase` are one value for all wavelengths, or a mapping {wavelength_nm: value} that
    is interpolated; `phase=None` means HG with g = .65. Extinction follows `angstrom_exponent`, or
    `relative_extinction` = {wavelength_nm: value} where that is given. `openswim.optics.aerosol_profile("dust", .3)`
    makes a layer of a named type.

    name: what the layer is called. beyond: whether it stands for the field of this name (`extinction_<name>`) beyond
    that field's sides and top, and adds nothing within.
    """

    optical_depth: float = DEFAULT_DEPTH
    angstrom_exponent: float = 1.3
    scale_height_m: float = 1500.0
    base_height_m: float | None = None
    single_scattering_albedo: float | Mapping[float, float] = 0.95
    phase: PhaseFunction | Mapping[float, PhaseFunction] | None = None
    reference_nm: float = 550.0
    profile: Mapping[float, float] | None = None
    relative_extinction: Mapping[float, float] | None = None
    name: str = "aerosol"
    beyond: bool = False

    def __post_init__(self) -> None:
        for name, (low, high) in _RANGES.items():
            check_number(f"aerosol {name}", getattr(self, name), low, high)
        if self.base_height_m is not None:
            check_number("aerosol base_height_m", self.base_height_m, *_BASES)
        check_albedo("aerosol single_scattering_albedo", self.single_scattering_albedo)
        if self.phase is not None:
            check_phase("aerosol phase", self.phase)
        if self.profile is not None:
            _check_profile(self.profile)
        if self.relative_extinction is not None:
            check_spectrum("aerosol relative_extinction", self.relative_extinction, *RELATIVE_EXTINCTIONS)
        if not (isinstance(self.name, str) and self.name.isidentifier()):
            raise UserError(f"aerosol name {shown(self.name)}: give a word of letters, digits and _")
        object.__setattr__(self, "beyond", bool(self.beyond))

    def above_ground(self, ground_m: float) -> AerosolProfile:
        """The layer with its base at the ground of the place, where it has none of its own."""
        if self.base_height_m is not None or self.profile is not None:
            return self
        return replace(self, base_height_m=float(np.clip(ground_m, *_BASES)))

    def optical_depth_at(self, wavelength_nm: ArrayLike) -> F64:
        """Column optical depth (same shape as `wavelength_nm`)."""
        return self.optical_depth * relative_extinction(
            wavelength_nm, self.reference_nm, self.angstrom_exponent, self.relative_extinction
        )

    def extinction_per_m(self, height_m: ArrayLike, wavelength_nm: ArrayLike) -> F64:
        """Extinction coefficient (nwl, *height shape) in 1/m at heights above sea level; the ground of a layer that
        counts from the ground lies at sea level here (see `above_ground`)."""
        z = np.asarray(height_m, float)
        depth = np.atleast_1d(self.optical_depth_at(wavelength_nm))
        return depth.reshape(depth.shape + (1,) * z.ndim) * self._shape_per_m(z)

    def depth_above(self, height_m: float, wavelength_nm: float = 550.0) -> float:
        """Optical depth of the column above a height."""
        if self.profile is not None:
            table = np.array(sorted(self.profile), float)
            start = np.clip(height_m, table[0], table[-1])
            nodes = np.array([start, *table[table > start]])
        else:
            nodes = np.linspace(height_m, max(EXPONENTIAL_TOP_M, height_m), 3001)
        return float(np.trapezoid(self.extinction_per_m(nodes, wavelength_nm)[0], nodes))

    def _shape_per_m(self, z: F64) -> F64:
        """Extinction at heights for an optical depth of 1."""
        if self.profile is not None:
            nodes = np.array(sorted(self.profile), float)
            values = np.array([self.profile[node] for node in nodes], float)
            column = np.trapezoid(values, nodes)
            return np.interp(z, nodes, values, left=0.0, right=0.0) / (column if column > 0 else 1.0)
        base = self.base_height_m or 0.0
        column = -self.scale_height_m * np.expm1(-(EXPONENTIAL_TOP_M - base) / self.scale_height_m)
        thinned = np.exp(-np.maximum(z - base, 0.0) / self.scale_height_m)
        return np.where(z <= EXPONENTIAL_TOP_M, thinned, 0.0) / column

    def to_dict(self) -> dict[str, Any]:
        """A JSON-ready description; `from_dict` is its inverse."""
        saved = {name: getattr(self, name) for name in self.__dataclass_fields__}
        saved = {name: value for name, value in saved.items() if value is not None}
        for name in (*_SPECTRAL, "profile"):
            if isinstance(value := saved.get(name), Mapping):
                saved[name] = {str(float(key)): float(each) for key, each in value.items()}
        if isinstance(self.phase, Mapping):
            saved["phase"] = {"spectral": {str(wl): p.to_dict() for wl, p in self.phase.items()}}
        elif self.phase is not None:
            saved["phase"] = self.phase.to_dict()
        return saved

    @staticmethod
    def from_dict(saved: Mapping[str, Any]) -> AerosolProfile:
        """The layer that `to_dict` described."""
        kwargs = {key: value for key, value in saved.items() if value is not None or key not in _OPTIONAL}
        for name in _SPECTRAL:
            if isinstance(value := kwargs.get(name), Mapping):
                kwargs[name] = by_wavelength(name, value)
        if isinstance(profile := kwargs.get("profile"), Mapping):
            try:
                kwargs["profile"] = {float(height): value for height, value in profile.items()}
            except ValueError:
                raise UserError(f"aerosol profile must have heights in metres, got {shown(list(profile))}") from None
        if "phase" in kwargs:
            kwargs["phase"] = phases_from_dict(kwargs["phase"])
        return AerosolProfile(**kwargs)


Layers: TypeAlias = AerosolProfile | Sequence[AerosolProfile] | None


def layers_of(given: Any) -> AerosolProfile | tuple[AerosolProfile, ...] | None:
    """What was given as background aerosol, checked; a list of one is that one, an empty list is None."""
    if given is None or isinstance(given, AerosolProfile):
        return given
    layers = tuple(given) if isinstance(given, Sequence) and not isinstance(given, str) else (given,)
    for layer in layers:
        if not isinstance(layer, AerosolProfile):
            raise UserError(f"atmosphere: aerosol {shown(layer)}: give an AerosolProfile, a list of them, or None")
    return layers if len(layers) > 1 else layers[0] if layers else None


def layers_from(saved: Any) -> AerosolProfile | tuple[AerosolProfile, ...] | None:
    """The background aerosol of which `Atmosphere.to_dict` speaks."""
    if saved is None or isinstance(saved, Mapping):
        return None if saved is None else AerosolProfile.from_dict(saved)
    return layers_of([AerosolProfile.from_dict(each) for each in saved])


def central_ground_m(terrain_m: ArrayLike, spacing_m: tuple[float, float]) -> float:
    """The ground of a domain's place: mean of a terrain (ny, nx) on cells of (dx, dy) within 50 km of the centre."""
    terrain = np.nan_to_num(np.asarray(terrain_m, float))
    ny, nx = terrain.shape
    east, north = (np.arange(n) - 0.5 * (n - 1) for n in (nx, ny))
    far = np.hypot(east * spacing_m[0], north[:, None] * spacing_m[1])
    return float(terrain[far <= max(GROUND_WITHIN_M, far.min() + 1.0)].mean())


def _check_profile(profile: Any) -> None:
    if not isinstance(profile, Mapping) or len(profile) < 2:
        raise UserError("aerosol profile: give {height_m: relative extinction} at two heights or more")
    for height, value in profile.items():
        check_number("aerosol profile: a height", height, *_HEIGHTS)
        check_number("aerosol profile: a relative extinction", value, 0.0, 1e9)
