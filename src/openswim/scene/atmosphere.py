"""The spherically symmetric background: pressure, temperature, ozone and a 1-D aerosol, 0 to 100 km."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from openswim.errors import UserError
from openswim.scene.aerosol import AerosolProfile, Layers, layers_from, layers_of

TOP_M = 100_000.0
DOBSON_PER_M2 = 2.6868e20

# US Standard Atmosphere 1976, Table 4: base of each layer in geopotential km and its lapse rate in K/km.
_LAYER_BASE_KM = np.array([0.0, 11.0, 20.0, 32.0, 47.0, 51.0, 71.0])
_LAPSE_K_PER_KM = np.array([-6.5, 0.0, 1.0, 2.8, 0.0, -2.8, -2.0])
_EARTH_RADIUS_KM = 6356.766  # the standard's, for geopotential height
_HYDROSTATIC_K_PER_KM = 34.163195  # g0 M0 / R

# The standard's pressure above 86 km (Table I), hPa; log-linear in between within 0.3 %.
_UPPER_KM = np.array([86.0, 88.0, 90.0, 92.0, 94.0, 96.0, 98.0, 100.0])
_UPPER_HPA = np.array([3.7338e-3, 2.6173e-3, 1.8359e-3, 1.2887e-3, 9.0560e-4, 6.3765e-4, 4.5057e-4, 3.2011e-4])

# The standard's mid-latitude ozone (Table 18, after Krueger & Minzner 1976), 1e18 molecules per m3.
_OZONE_KM = np.array([0.0, *range(2, 76, 2), 80.0, 90.0, 100.0])
# fmt: off
_OZONE_1E18_PER_M3 = np.array([
    0.68, 0.68, 0.58, 0.57, 0.65, 1.13, 2.02, 2.35, 2.95, 4.04, 4.77, 4.86, 4.54, 4.03, 3.24, 2.52, 2.03,
    1.58, 1.22, 0.873, 0.607, 0.398, 0.274, 0.169, 0.103, 6.64e-2, 3.84e-2, 2.55e-2, 1.61e-2, 1.12e-2,
    7.33e-3, 4.81e-3, 3.17e-3, 1.72e-3, 7.5e-4, 5.4e-4, 2.2e-4, 1.7e-4, 1.1e-4, 5.0e-5, 5.0e-6,
])
# fmt: on


# Water vapour of the AFGL constituent profile for the US standard (Anderson et al. 1986, AFGL-TR-86-0110): shares of
# air by volume, in 1e-6; 1.42 cm above sea level.
_VAPOUR_KM = np.array([*range(26), 30.0, 35.0, 40.0, 50.0, 60.0, 80.0, 100.0])
# fmt: off
_VAPOUR_PPM = np.array([
    7752, 6076, 4635, 3184, 2159, 1398, 925.8, 572.5, 367, 158.4, 70.01,
    36.16, 19.07, 10.86, 5.931, 5.003, 3.953, 3.853, 3.827, 3.853, 3.902, 3.977,
    4.068, 4.202, 4.303, 4.428, 4.728, 4.904, 5.028, 5.228, 4.753, 2.051, 0.4003,
])
# fmt: on
_VAPOUR_KG_PER_PPM = 18.015e-9 / 8.31446  # kg m-3 per ppm and mol m-3 of gas: times p/T

_DEFAULT = AerosolProfile()


@dataclass(frozen=True)
class Atmosphere:
    """Gas profiles (n,) on ascending heights above sea level, and the background aerosol: a layer, a list of layers
    that are added, or None for no aerosol. Without ``vapour_kg_m3`` there is the water vapour of the US standard, 1.42
    cm above sea level; it counts in bands of the near infrared."""

    height_m: NDArray[np.float64]
    pressure_pa: NDArray[np.float64]
    temperature_k: NDArray[np.float64]
    ozone_per_m3: NDArray[np.float64]
    aerosol: Layers = field(default_factory=AerosolProfile)
    vapour_kg_m3: NDArray[np.float64] | None = None

    def __post_init__(self) -> None:
        object.__setattr__(self, "aerosol", layers_of(self.aerosol))
        if self.vapour_kg_m3 is not None:
            vapour = np.asarray(self.vapour_kg_m3, np.float64)
            if vapour.shape != np.shape(self.height_m) or not (np.isfinite(vapour) & (vapour >= 0)).all():
                raise UserError("atmosphere: vapour_kg_m3 must have one value of zero or more per height")
            object.__setattr__(self, "vapour_kg_m3", vapour)
        for name in ("height_m", "pressure_pa", "temperature_k", "ozone_per_m3"):
            object.__setattr__(self, name, np.asarray(getattr(self, name), np.float64))
        if not (self.height_m.ndim == 1 and self.height_m.size > 1 and (np.diff(self.height_m) > 0).all()):
            raise UserError("atmosphere: height_m must be a 1-D array of ascending heights")
        for name in ("pressure_pa", "temperature_k", "ozone_per_m3"):
            value = getattr(self, name)
            if value.shape != self.height_m.shape or not np.isfinite(value).all():
                raise UserError(f"atmosphere: {name} must have one finite value per height")
        if not ((self.pressure_pa > 0).all() and (self.temperature_k > 0).all()):
            raise UserError("atmosphere: pressure (Pa) and temperature (K) must be positive")

    def __repr__(self) -> str:
        """One line: how high, how warm below, how much aerosol."""
        air = f"{self.height_m[0]:g} to {self.height_m[-1]:g} m, {self.temperature_k[0]:.1f} K at the lowest"
        depth = f"aerosol depth {float(self.aerosol_depth_at(550.0)):.3g} at 550 nm"
        return f"<Atmosphere: {self.height_m.size} heights, {air}; {depth}>"

    @staticmethod
    def us_standard(ozone_du: float = 300.0, aerosol: Layers = _DEFAULT) -> Atmosphere:
        """US Standard Atmosphere 1976 every 500 m to 100 km, its ozone scaled to a column in Dobson units.

        Pressure agrees with the standard's tables within 0.1 % below 86 km and 0.5 % above.
        """
        if not ozone_du >= 0:
            raise UserError(f"ozone column must be zero or more Dobson units, got {ozone_du}")
        height_m = np.arange(0.0, TOP_M + 1.0, 500.0)
        pressure, temperature = us_standard_pressure_temperature(height_m)
        ozone = np.exp(np.interp(height_m / 1e3, _OZONE_KM, np.log(_OZONE_1E18_PER_M3)))
        ozone *= ozone_du * DOBSON_PER_M2 / np.trapezoid(ozone, height_m)
        return Atmosphere(height_m, pressure, temperature, ozone, aerosol)

    @property
    def layers(self) -> tuple[AerosolProfile, ...]:
        """The layers of the background aerosol; none without."""
        given = self.aerosol
        return () if given is None else (given,) if isinstance(given, AerosolProfile) else tuple(given)

    def aerosol_depth_at(self, wavelength_nm: ArrayLike) -> NDArray[np.float64]:
        """Optical depth of all layers together (same shape as `wavelength_nm`)."""
        none = np.zeros(np.shape(wavelength_nm))
        return sum((layer.optical_depth_at(wavelength_nm) for layer in self.layers), none)

    def with_aerosol_depth(self, optical_depth: float, wavelength_nm: float = 550.0) -> Atmosphere:
        """The same with this much aerosol in all: each layer keeps its share; the default's kind where there is
        none."""
        layers = self.layers or (AerosolProfile(),)
        depths = np.array([float(layer.optical_depth_at(wavelength_nm)) for layer in layers])
        shares = depths / depths.sum() if depths.sum() > 0 else np.full(len(layers), 1 / len(layers))
        changed = []
        for layer, share in zip(layers, shares, strict=True):
            unit = float(replace(layer, optical_depth=1.0).optical_depth_at(wavelength_nm))
            changed.append(replace(layer, optical_depth=float(optical_depth * share / unit)))
        return replace(self, aerosol=changed)

    def above_ground(self, ground_m: float) -> Atmosphere:
        """The same, with layers that count from the ground of the place counting from this height above sea level."""
        if all(layer.base_height_m is not None or layer.profile is not None for layer in self.layers):
            return self
        return replace(self, aerosol=[layer.above_ground(ground_m) for layer in self.layers])

    def at(self, height_m: ArrayLike) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
        """Pressure (Pa), temperature (K) and ozone (1/m3) at any heights; all gas ends at the profile's top.

        Pressure is log-linear in height, also below the lowest node (the Dead Sea); the others are linear.
        """
        z = np.asarray(height_m, float)
        log_p = np.log(self.pressure_pa)
        below = np.minimum(z - self.height_m[0], 0.0) * (log_p[1] - log_p[0]) / (self.height_m[1] - self.height_m[0])
        inside = z <= self.height_m[-1]
        pressure = np.where(inside, np.exp(np.interp(z, self.height_m, log_p) + below), 0.0)
        ozone = np.where(inside, np.interp(z, self.height_m, self.ozone_per_m3), 0.0)
        return pressure, np.interp(z, self.height_m, self.temperature_k), ozone

    def vapour_kg_m3_at(self, height_m: ArrayLike) -> NDArray[np.float64]:
        """Density of water vapour at any heights, in between log-linear."""
        z = np.asarray(height_m, float)
        if self.vapour_kg_m3 is None:
            pressure, temperature, _ = self.at(z)
            ppm = np.exp(np.interp(z / 1e3, _VAPOUR_KM, np.log(_VAPOUR_PPM)))
            return np.asarray(_VAPOUR_KG_PER_PPM * ppm * pressure / temperature)
        log_vapour = np.log(np.maximum(self.vapour_kg_m3, 1e-30))
        return np.where(z <= self.height_m[-1], np.exp(np.interp(z, self.height_m, log_vapour)), 0.0)

    def with_precipitable_water(self, cm: float, above_m: float) -> Atmosphere:
        """The same with so much water vapour above a height."""
        own = self.precipitable_water_cm(above_m)
        return replace(self, vapour_kg_m3=self.vapour_kg_m3_at(self.height_m) * (cm / own if own > 0 else 0.0))

    def precipitable_water_cm(self, above_m: float = 0.0) -> float:
        """Water vapour above a height, as the depth of its water."""
        height = np.linspace(above_m, max(above_m, 30_000.0), 601)
        return 0.1 * float(np.trapezoid(self.vapour_kg_m3_at(height), height))

    def ozone_column_du(self, above_m: float = -np.inf) -> float:
        """Ozone (Dobson units) above a height; of the whole profile by default."""
        height = np.unique(np.append(self.height_m, np.clip(above_m, self.height_m[0], self.height_m[-1])))
        height = height[height >= above_m]
        return float(np.trapezoid(np.interp(height, self.height_m, self.ozone_per_m3), height) / DOBSON_PER_M2)

    def to_dict(self) -> dict[str, Any]:
        """A JSON-ready description; `from_dict` is its inverse."""
        names = ("height_m", "pressure_pa", "temperature_k", "ozone_per_m3")
        saved: dict[str, Any] = {name: getattr(self, name).tolist() for name in names}
        layers = [layer.to_dict() for layer in self.layers]
        saved["aerosol"] = layers[0] if len(layers) == 1 else layers or None
        if self.vapour_kg_m3 is not None:
            saved["vapour_kg_m3"] = self.vapour_kg_m3.tolist()
        return saved

    @staticmethod
    def from_dict(saved: Mapping[str, Any]) -> Atmosphere:
        kwargs = dict(saved)
        kwargs["aerosol"] = layers_from(kwargs.get("aerosol"))
        return Atmosphere(**kwargs)


def us_standard_pressure_temperature(height_m: ArrayLike) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Pressure (Pa) and temperature (K) of the US Standard Atmosphere 1976 at geometric heights up to 100
    km."""
    z_km = np.asarray(height_m, float) / 1e3
    h_km = _EARTH_RADIUS_KM * z_km / (_EARTH_RADIUS_KM + z_km)
    base_temperature, base_log_p = _layer_bases()
    layer = np.clip(np.searchsorted(_LAYER_BASE_KM, h_km, side="right") - 1, 0, len(_LAYER_BASE_KM) - 1)
    rise = h_km - _LAYER_BASE_KM[layer]
    temperature = base_temperature[layer] + _LAPSE_K_PER_KM[layer] * rise
    log_p = base_log_p[layer] - _log_pressure_drop(base_temperature[layer], _LAPSE_K_PER_KM[layer], rise)
    upper = z_km > _UPPER_KM[0]
    log_upper = np.interp(z_km, _UPPER_KM, np.log(_UPPER_HPA * 100.0))
    return np.exp(np.where(upper, log_upper, log_p)), np.where(upper, _upper_temperature(z_km), temperature)


def _layer_bases() -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    temperature, log_p = [288.15], [np.log(101325.0)]
    for lapse, thickness in zip(_LAPSE_K_PER_KM[:-1], np.diff(_LAYER_BASE_KM), strict=True):
        log_p.append(log_p[-1] - float(_log_pressure_drop(temperature[-1], lapse, thickness)))
        temperature.append(temperature[-1] + lapse * thickness)
    return np.array(temperature), np.array(log_p)


def _log_pressure_drop(temperature: ArrayLike, lapse: ArrayLike, rise_km: ArrayLike) -> NDArray[np.float64]:
    t, lapse, rise = np.asarray(temperature, float), np.asarray(lapse, float), np.asarray(rise_km, float)
    safe = np.where(lapse == 0, 1.0, lapse)
    graded = np.log1p(safe * rise / t) / safe
    return _HYDROSTATIC_K_PER_KM * np.where(lapse == 0, rise / t, graded)


def _upper_temperature(z_km: NDArray[np.float64]) -> NDArray[np.float64]:
    """Kinetic temperature from 86 km (isothermal to 91 km, then the standard's ellipse)."""
    bend = np.clip((z_km - 91.0) / -19.9429, -1.0, 0.0)
    return 263.1905 - 76.3232 * np.sqrt(1.0 - bend**2)
