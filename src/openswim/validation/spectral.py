"""Measured spectral irradiance: diffuse over direct, band by band, which no calibration changes."""

from __future__ import annotations

import re
from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

import openswim
from openswim.ground.spectra import generic_land
from openswim.lights import solar_irradiance, sun_track
from openswim.scene import Scene
from openswim.scene.aerosol import AerosolProfile
from openswim.scene.atmosphere import Atmosphere
from openswim.scene.times import parse_time
from openswim.stations.clear_sky import clear_times
from openswim.validation.reference import Reference, Row, Solver, Stopwatch
from openswim.validation.reference.metrics import score
from openswim.validation.reference.phases import PhaseTables

F64 = NDArray[np.float64]

_LOWEST_SUN_DEG, _EVERY = 20.0, 5
_DEPTHS = (0.01, 0.15)  # of the aerosol, solved for


def matches(reference: Reference) -> bool:
    about = {"lat", "lon", "elev_m", "centroid_nm", "langley_optical_depth_total_am_pm", "langley_I0_mean_w_m2_nm"}
    return reference.is_table and reference.has("utc") and about <= set(reference.about) and bool(_bands(reference))


def _bands(reference: Reference) -> list[str]:
    names = map(str, reference.data.data_vars)
    return [m.group(1) for m in (re.fullmatch(r"direct_normal_(\d+)", name) for name in names) if m]


def compare(reference: Reference, solver: Solver, phases: PhaseTables) -> Iterator[Row]:
    """A row per band whose beam outside of the air is known: diffuse over direct on the horizontal, clear moments.

    The aerosol has the depth at each time and in each band that makes the model's beam the measured one, and is else
    the default; the ground is the generic land of `openswim.ground`. Diffuse light is linear in the depth between two
    that are solved for.
    """
    about = reference.about
    lat, lon, height = (float(about[key]) for key in ("lat", "lon", "elev_m"))
    time = np.array([parse_time(str(t)) for t in reference.column("utc")], "datetime64[ms]")
    track = sun_track(time, lat, lon, height)
    rows = np.flatnonzero(track.refracted_altitude_deg > _LOWEST_SUN_DEG)[::_EVERY]
    time, sine = time[rows], np.sin(np.radians(track.refracted_altitude_deg[rows]))
    langley = dict(zip(about["langley_optical_depth_total_am_pm"], about["langley_I0_mean_w_m2_nm"], strict=False))
    top = {float(wavelength): float(value) for wavelength, value in langley.items()}
    for band, centre in zip(_bands(reference), map(float, about["centroid_nm"]), strict=False):
        if centre not in top:
            continue
        watch = Stopwatch()
        direct, diffuse = (reference.column(f"{kind}_{band}")[rows] for kind in ("direct_normal", "diffuse"))
        with watch.running():
            place = lat, lon, height
            beam, sky = zip(*(_solved(depth, centre, place, time, solver) for depth in _DEPTHS), strict=True)
        with np.errstate(all="ignore"):
            measured = direct / top[centre]
            share = np.log(beam[0] / measured) / np.log(beam[0] / beam[1])
            model = ((1 - share) * sky[0] + share * sky[1]) / (measured * sine)
        clear = clear_times(time, {"dni": measured}, {"dni": beam[0]}) & np.isfinite(model)
        ratio = np.divide(diffuse, direct * sine, out=np.full(time.size, np.nan), where=direct > 0)
        found = score(model[clear], ratio[clear])
        yield reference.row(solver.name, f"diffuse over direct, {band} nm", found, watch.lap())


def _solved(
    depth: float, wavelength_nm: float, place: tuple[float, float, float], time: NDArray[np.datetime64], solver: Solver
) -> tuple[F64, F64]:
    """Transmittance of the beam and diffuse horizontal light over E_TOA, (nt,), under an aerosol of a depth."""
    assert isinstance(solver, openswim.Solver)
    lat, lon, height = place
    air = Atmosphere.us_standard(aerosol=AerosolProfile(depth, base_height_m=height, reference_nm=wavelength_nm))
    scene = Scene.clear(lat, lon, air, float(generic_land(wavelength_nm)[0]), height)
    found = openswim.irradiance(scene, lat, lon, time, wavelengths_nm=[wavelength_nm], solver=solver)
    top = float(solar_irradiance(wavelength_nm)) / sun_track(time, lat, lon, height).distance_au ** 2
    return found.spectral_dni.values[:, 0] / top, found.spectral_dhi.values[:, 0] / top
