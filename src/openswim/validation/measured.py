"""Measured irradiance on clear days, against the model's clear sky with its default aerosol."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from openswim.cameras import Rays
from openswim.fluxes import broadband, gases_above, quadrature_directions, spectral_irradiance
from openswim.lights import Sun, sun_position
from openswim.scene import Scene
from openswim.scene.aerosol import AerosolProfile
from openswim.scene.atmosphere import Atmosphere
from openswim.scene.frame import scene_frame
from openswim.scene.times import parse_time
from openswim.validation.metrics import score
from openswim.validation.phases import PhaseTables
from openswim.validation.reference import Reference, Row, Solver, Stopwatch

Array = NDArray[np.float64]

WAVELENGTHS_NM = np.array([615.0, 546.0, 450.0])
_LOWEST_SUN_DEG = 15.0
_MOST_TIMES = 300
_SUNS = 8  # the model is solved for so many solar altitudes and interpolated
_DEFAULT_ALBEDO = 0.2
_STEADY_MINUTES = 10.0
_STEADY = 0.015  # standard deviation of measured over modelled, within those minutes
_NEAR = 0.2  # of the model: what is further off is cloud


@dataclass(frozen=True)
class Day:
    """A day at a station: times UTC (n,), the sun, and measured W/m2 by quantity (NaN: no value)."""

    time: NDArray[np.datetime64]
    suns: list[Sun]
    measured: dict[str, Array]

    @property
    def sine(self) -> Array:
        return np.sin(np.radians([sun.altitude_deg for sun in self.suns]))


def matches(reference: Reference) -> bool:
    place = {"lat", "lon", "elev_m"} <= set(reference.about)
    return reference.is_table and place and reference.has("utc") and bool(_columns(reference, "ghi"))


def compare(reference: Reference, solver: Solver, phases: PhaseTables) -> Iterator[Row]:
    """Rows for GHI and, where measured, DNI and DHI: clear minutes with the sun above 15 degrees.

    The AOD of the day is not known to the model: it takes its default (.05 at 550 nm above the station).
    """
    day = _day(reference)
    watch = Stopwatch()
    with watch.running():
        model = _clear_day(reference, day, solver)
    clear = steady(day.time, day.measured["ghi"] / model["ghi"])
    cpu = watch.lap() / len(day.measured)
    for name, values in day.measured.items():
        yield reference.row(
            solver.name, f"{name.upper()}, clear sky", score(model[name][clear], values[clear]), cpu
        )


def steady(time: NDArray[np.datetime64], ratio: Array) -> NDArray[np.bool_]:
    """Where measured over modelled irradiance (n,) hardly varies within ten minutes and is near one."""
    minutes = (time - time[0]) / np.timedelta64(1, "m")
    kept = np.zeros(ratio.size, bool)
    for i in range(ratio.size):
        window = ratio[np.abs(minutes - minutes[i]) <= _STEADY_MINUTES / 2]
        kept[i] = window.size >= 3 and window.std() < _STEADY and abs(ratio[i] - 1) < _NEAR
    return kept


def _columns(reference: Reference, prefix: str) -> list[str]:
    return [str(name) for name in reference.data.data_vars if str(name).split("_")[0] == prefix]


def _mean(reference: Reference, *prefixes: str) -> Array | None:
    """The mean of the columns whose names begin so (two instruments of a kind); None: there are none."""
    names = [name for prefix in prefixes for name in _columns(reference, prefix)]
    return np.mean([reference.column(name) for name in names], axis=0) if names else None


def _day(reference: Reference) -> Day:
    """At most 300 times of the day, those with the sun high enough."""
    time = np.array([parse_time(str(t)) for t in reference.column("utc")])
    rows = np.arange(0, time.size, max(1, time.size // _MOST_TIMES))
    lat, lon, height = (float(reference.about[key]) for key in ("lat", "lon", "elev_m"))
    suns = {int(i): sun_position(time[i], lat, lon, height) for i in rows}
    high = np.array([i for i, sun in suns.items() if sun.altitude_deg > _LOWEST_SUN_DEG], int)
    found = {name: _mean(reference, name) for name in ("ghi", "dni", "dhi")}
    measured = {name: values[high] for name, values in found.items() if values is not None}
    return Day(time[high], [suns[int(i)] for i in high], measured)


def _clear_day(reference: Reference, day: Day, solver: Solver) -> dict[str, Array]:
    """Modelled clear-sky GHI, DNI and DHI (n,) in W/m2."""
    about = reference.about
    lat, lon, height = (float(about[key]) for key in ("lat", "lon", "elev_m"))
    aerosol = AerosolProfile(base_height_m=height)
    scene = Scene.clear(
        lat, lon, Atmosphere.us_standard(aerosol=aerosol), surface_albedo=_albedo(reference), terrain_m=height
    )
    water_cm = _water_cm(reference, height)
    sine = day.sine
    nodes = np.linspace(sine.min(), sine.max(), _SUNS)
    solved = [_irradiance(scene, solver, float(node), day.suns[0].distance_au, water_cm) for node in nodes]
    return {
        name: np.interp(sine, nodes, [getattr(one, attribute) for one in solved])
        for name, attribute in (
            ("ghi", "global_horizontal"),
            ("dni", "direct_normal"),
            ("dhi", "diffuse_horizontal"),
        )
    }


def _irradiance(scene: Scene, solver: Solver, sine: float, distance_au: float, water_cm: float) -> Any:
    """Broadband irradiance at the station for a solar altitude; the azimuth does not matter."""
    frame = scene_frame(scene)
    lat, lon = scene.place
    height = float(scene.data["surface_altitude"])
    altitude, azimuth = float(np.degrees(np.arcsin(sine))), 180.0
    sky = quadrature_directions(8, azimuth, altitude)
    toward_sun = frame.direction(azimuth, altitude, lat, lon)
    field = solver.solve(scene, toward_sun, WAVELENGTHS_NM)
    here = np.asarray(frame.position(lat, lon, height + 1.0))
    radiance = field.view(Rays(here, frame.direction(sky.azimuth_deg, sky.altitude_deg, lat, lon))).radiance
    beam = np.asarray(field.view(Rays(here, toward_sun[None])).transmittance)[0]
    spectral = spectral_irradiance(radiance, sky, beam, altitude, WAVELENGTHS_NM, distance_au)
    diffuse = spectral["relative_diffuse_horizontal"].values
    gases = gases_above(scene.atmosphere, height) | {"water_vapour_cm": water_cm}
    return broadband(beam, diffuse, WAVELENGTHS_NM, altitude, distance_au, **gases)


def _albedo(reference: Reference) -> float:
    """Upwelling over global irradiance around noon where it was measured, else 0.2."""
    up, down = _mean(reference, "uw"), _mean(reference, "ghi")
    if up is None or down is None:
        return _DEFAULT_ALBEDO
    noon = down > 0.7 * np.nanmax(down)
    return float(np.clip(np.nanmedian(up[noon] / down[noon]), 0.0, 1.0))


def _water_cm(reference: Reference, height_m: float) -> float:
    """Precipitable water in cm by temperature and humidity (Gueymard 1994), else a climatological guess."""
    celsius, humidity = _mean(reference, "temp"), _mean(reference, "rh", "relative")
    if celsius is None or humidity is None:
        return float(1.5 * np.exp(-height_m / 2000.0))
    kelvin = float(np.nanmedian(celsius)) + 273.15
    theta = kelvin / 273.15
    scale_km = 0.4976 + 1.5265 * theta + np.exp(13.6897 * theta - 14.9188 * theta**3)
    saturation_hpa = np.exp(
        22.330 - 49.140 * 100 / kelvin - 10.922 * (100 / kelvin) ** 2 - 0.39015 * kelvin / 100
    )
    vapour = 216.7 * float(np.nanmedian(humidity)) / 100 / kelvin * saturation_hpa
    return float(max(0.1 * scale_km * vapour, 0.1))
