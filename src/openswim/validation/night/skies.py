"""Light that has gone through the air at dusk and at night, against measured fits: moonlit sky, twilight, lux."""

import re
from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from openswim.cameras import Rays
from openswim.colour.photometry import illuminance_lx
from openswim.lights import solar_irradiance
from openswim.lights.illuminance import NIGHT_SKY_LX
from openswim.lights.moonlight import MEAN_SOLID_ANGLE_SR, disc_reflectance
from openswim.lights.refraction import lit_altitude_deg
from openswim.lights.units import magnitude_of_radiance
from openswim.scene import Scene
from openswim.scene.atmosphere import AerosolProfile, Atmosphere
from openswim.scene.frame import scene_frame
from openswim.validation.reference import Reference, Row, Solver, Stopwatch, groups
from openswim.validation.reference.metrics import Score, in_marks
from openswim.validation.reference.phases import PhaseTables

Array = NDArray[np.float64]

_LAT, _LON, _AZIMUTH_DEG, _EYE_M = 40.0, 10.0, 150.0, 2.0  # any place and azimuth will do
# Extinction of .172 magnitudes is that of a site at 2800 m with aerosol of depth .06, .25 that of one at sea level, .12
_SITES = {0.172: (2800.0, 0.06), 0.25: (0.0, 0.12)}
_MOON_ALBEDO, _USUAL_ALBEDO, _USUAL_AEROSOL = 0.1, 0.15, 0.15
_PARANAL_PA = 74_400.0
_PARANAL_DU = 255.0  # ozone over the desert in the tropics, where there is less
_COLOURS_NM = np.array([615.0, 546.0, 450.0])
_BANDS_NM = {"B": (440.0, 6.32e-11), "V": (550.0, 3.63e-11), "R": (640.0, 2.18e-11)}  # W m-2 nm-1 (Bessell 1979)
_MOST_SZA, _MARKS_DEX = 102.0, ((-6.0, 0.1), (-12.0, 0.15), (-18.0, 0.2))


def _scene(height_m: float, aerosol: float, albedo: float, ozone_du: float = 300.0) -> Scene:
    profile = AerosolProfile(aerosol, base_height_m=height_m) if aerosol else None
    return Scene.clear(_LAT, _LON, Atmosphere.us_standard(ozone_du, profile), surface_albedo=albedo)


def _field(solver: Solver, scene: Scene, altitude_deg: float, wavelengths_nm: Array) -> Any:
    frame = scene_frame(scene)
    return solver.solve(scene, frame.direction(_AZIMUTH_DEG, altitude_deg, _LAT, _LON), wavelengths_nm)


def _seen(field: Any, scene: Scene, height_m: float, azimuth: Array, altitude: Array) -> Array:
    frame = scene_frame(scene)
    direction = frame.direction(_AZIMUTH_DEG + azimuth, altitude, _LAT, _LON)
    return np.asarray(field.view(Rays(frame.position(_LAT, _LON, max(height_m, _EYE_M)), direction)).radiance, float)


def is_moonlit_table(reference: Reference) -> bool:
    return reference.is_table and reference.has("k_V_mag_per_airmass", "moon_zenith_deg", "moonlight_V_mag_arcsec2")


def compare_moonlit_sky(reference: Reference, solver: Solver, phases: PhaseTables) -> Iterator[Row]:
    """Median and ninth decile of differences in magnitudes, in marks of .15 and .3."""
    names = ("k_V_mag_per_airmass", "moon_zenith_deg", "view_zenith_deg", "relative_azimuth_deg", "phase_angle_deg")
    k, moon, view, azimuth, phase = (reference.column(name).astype(float) for name in names)
    off, watch = np.full(len(k), np.nan), Stopwatch()
    for (extinction, zenith), rows in groups(k, moon):
        height_m, aerosol = _SITES.get(extinction, (0.0, 0.12))
        scene = _scene(height_m, aerosol, _MOON_ALBEDO)
        with watch.running():
            field = _field(solver, scene, 90 - zenith, np.array([550.0]))
            light = _seen(field, scene, height_m, azimuth[rows], 90 - view[rows])[:, 0] / (4 * np.pi)
        beam = np.array([float(disc_reflectance(550.0, p)) for p in phase[rows]]) * MEAN_SOLID_ANGLE_SR / np.pi
        found = magnitude_of_radiance(light * beam * solar_irradiance(550.0))
        off[rows] = found - reference.column("moonlight_V_mag_arcsec2").astype(float)[rows]
    cpu, size = watch.lap(), np.abs(off)
    bias = float(np.median(off))
    middle, most = "median difference, in marks of .15 mag", "ninth decile of differences, in marks of .3 mag"
    for words, value, mark in ((middle, np.median(size), 0.15), (most, np.quantile(size, 0.9), 0.3)):
        score = Score(float(value / mark), bias / mark, np.nan, len(off))
        yield reference.row(solver.name, f"moonlit sky, {words}", score, cpu)


def is_illuminance_table(reference: Reference) -> bool:
    return reference.is_table and reference.has("light", "altitude_deg", "horizontal_illuminance")


def compare_illuminance(reference: Reference, solver: Solver, phases: PhaseTables) -> Iterator[Row]:
    """Of the sun, in what was asked for: .1 in log10 to -6 degrees, .15 to -12, .2 to -18; the night sky's is added, as
    the measured curves have it."""
    sun = reference.column("light").astype(str) == "sun"
    altitude = reference.column("altitude_deg").astype(float)[sun]
    true = reference.column("horizontal_illuminance").astype(float)[sun]
    scene, watch = _scene(0.0, _USUAL_AEROSOL, _USUAL_ALBEDO), Stopwatch()
    found = np.full(len(altitude), np.nan)
    with watch.running():
        for (at,), rows in groups(altitude):
            fluxes = _field(solver, scene, float(lit_altitude_deg(float(at))), _COLOURS_NM).fluxes()
            found[rows] = illuminance_lx(fluxes["down_bottom"] + fluxes["direct_bottom"], _COLOURS_NM) + NIGHT_SKY_LX
    cpu, dex, highest = watch.lap(), np.log10(found / true), np.inf
    for lowest, mark in _MARKS_DEX:
        some = (altitude >= lowest) & (altitude < highest)
        words = f"illuminance, sun from {lowest:g} degrees up, in marks of {mark:g} in log10"
        yield reference.row(solver.name, words, in_marks(dex[some], mark), cpu)
        highest = lowest


def is_twilight_fit(reference: Reference) -> bool:
    return reference.is_table and reference.has("quantity", "value", "unit") and any(
        str(each).startswith("twilight zenith brightness") for each in reference.column("quantity")
    )


def compare_twilight_fit(reference: Reference, solver: Solver, phases: PhaseTables) -> Iterator[Row]:
    """The zenith of Paranal in bands B, V and R to the sun at 102, in marks of .3 magnitudes; its night is added."""
    found: dict[str, list[float]] = {}
    scene, watch = _scene(2600.0, 0.05, 0.1, _PARANAL_DU), Stopwatch()
    bands = list(_BANDS_NM)
    wavelengths, zero = np.array([_BANDS_NM[band] for band in bands]).T
    night: dict[str, float] = {}
    wanted: dict[float, dict[str, float]] = {}
    for text, value in zip(reference.column("quantity"), reference.column("value"), strict=True):
        if match := re.match(r"twilight zenith brightness (\w) SZA ([\d.]+)", str(text)):
            wanted.setdefault(float(match[2]), {})[match[1]] = float(value)
        elif match := re.match(r"dark moonless zenith (\w), Paranal", str(text)):
            night[match[1]] = float(value)
    for sza, values in wanted.items():
        if sza > _MOST_SZA:
            continue
        with watch.running():
            field = _field(solver, scene, float(lit_altitude_deg(90 - sza, _PARANAL_PA)), wavelengths)
            light = _seen(field, scene, 2600.0, np.zeros(1), np.full(1, 90.0))[0] / (4 * np.pi)
        for n, band in enumerate(bands):
            if band in values:
                radiance = light[n] * float(solar_irradiance(wavelengths[n], 80.0))
                # magnitudes in V's scale, moved to the band's own
                own = magnitude_of_radiance(radiance) + 2.5 * np.log10(zero[n] / _BANDS_NM["V"][1])
                both = -2.5 * np.log10(10 ** (-0.4 * own) + 10 ** (-0.4 * night.get(band, 21.6)))
                found.setdefault(band, []).append(float(both) - values[band])
    cpu = watch.lap()
    for band, off in found.items():
        yield reference.row(solver.name, f"zenith in twilight, {band}, in marks of .3 mag", in_marks(off, 0.3), cpu)
