"""The sky over towns, clear and overcast, against published brightness."""

from collections.abc import Iterator
from typing import Any

import numpy as np

from openswim.cameras import Rays
from openswim.colour.photometry import illuminance_lx
from openswim.ground.cities import lamp_spectrum
from openswim.lights import NightSky, solar_irradiance
from openswim.lights.units import magnitude_of_luminance
from openswim.scene import Scene
from openswim.scene.atmosphere import AerosolProfile, Atmosphere
from openswim.scene.frame import scene_frame
from openswim.validation.reference import Reference, Row, Solver, Stopwatch
from openswim.validation.reference.metrics import Score
from openswim.validation.reference.phases import PhaseTables

_WAVELENGTHS_NM = np.array([615.0, 546.0, 450.0])
_NODES, _STEP_KM = 15, 8.0
_Z_M = np.array([0.0, 500.0, 1000.0, 1500.0, 2000.0, 3000.0, 4000.0, 5000.0, 6000.0])
# The lowest and the highest node of a cloud, m, and its optical depth: stratus, and rain cloud of .5 kg m-2 of droplets
# of 10 um, as the darkest overcast is the thickest
_CLOUDS = {"clear": (0.0, 0.0, 0.0), "overcast": (1000.0, 1500.0, 20.0), "darkest": (1000.0, 4000.0, 75.0)}
_TIME = "2016-03-09T00:00"  # without a moon
# What a row speaks of: a place, and its cloud, or "ratio": overcast over clear
_ROWS = {
    "overcast / clear sky luminance, 32 km": (52.24, 13.4, "ratio"),
    "overcast / clear, lowest of the stations": (44.6, 7.05, "ratio"),
    "zenith, clear, Lake Stechlin": (53.15, 13.02, "clear"),
    "zenith, overcast, darkest, Lake Stechlin": (53.15, 13.02, "darkest"),
    "zenith, Vienna inside": (48.21, 16.37, "clear"),
}


def is_sky_glow(reference: Reference) -> bool:
    return reference.is_table and reference.has("quantity", "value", "unit") and any(
        str(each).startswith("overcast / clear") for each in reference.column("quantity")
    )


def compare_sky_glow(reference: Reference, solver: Solver, phases: PhaseTables) -> Iterator[Row]:
    """The zenith by a coarse domain around each place, over the value that was published; in magnitudes the difference
    in light. What lies beyond the domain, 56 km away, sends no light."""
    known: dict[tuple[float, float, str], float] = {}
    for text, value in zip(reference.column("quantity"), reference.column("value").astype(float), strict=True):
        row = next((row for start, row in _ROWS.items() if str(text).startswith(start)), None)
        if row is None:
            continue
        lat, lon, kind = row
        watch = Stopwatch()
        with watch.running():
            for cloud in ("overcast", "clear") if kind == "ratio" else (kind,):
                if (lat, lon, cloud) not in known:
                    known[lat, lon, cloud] = zenith_luminance(solver, lat, lon, cloud)
        if kind == "ratio":
            off = known[lat, lon, "overcast"] / known[lat, lon, "clear"] / value - 1
        else:
            off = 10 ** (-0.4 * (float(magnitude_of_luminance(known[lat, lon, kind])) - value)) - 1
        yield reference.row(solver.name, str(text), Score(abs(off), off, np.nan, 1), watch.lap())


def zenith_luminance(solver: Any, lat: float, lon: float, cloud: str, nodes: int = _NODES) -> float:
    """cd/m2 under one of `_CLOUDS`, stars and planets left out."""
    north = lat + (np.arange(nodes) - nodes // 2) * _STEP_KM / 111.2
    east = lon + (np.arange(nodes) - nodes // 2) * _STEP_KM / 111.2 / np.cos(np.radians(lat))
    low, high, depth = _CLOUDS[cloud]
    filled = (low <= _Z_M) & (high >= _Z_M) & (depth > 0)
    extinction = np.zeros((len(_Z_M), nodes, nodes), np.float32)
    extinction[filled] = depth / max(float(np.trapezoid(filled.astype(float), _Z_M)), 1.0)
    air = Atmosphere.us_standard(300.0, AerosolProfile(0.15))
    scene = Scene.from_arrays(extinction, east, north, _Z_M, crs="latlon", surface_albedo=0.15, atmosphere=air)
    frame = scene_frame(scene)
    sky = NightSky.at(_TIME, lat, lon, np.eye(3))
    mean = sky.mean(_WAVELENGTHS_NM)
    field = solver.solve_starlit(scene, _WAVELENGTHS_NM, lamp_spectrum(_WAVELENGTHS_NM) / mean)
    place = frame.position(lat, lon, 2.0)
    up = np.array([[0.0, 0.0, 1.0], [1e-3, 0.0, 1.0]])
    view = field.view(Rays(place, up / np.linalg.norm(up, axis=1)[:, None]))
    behind = sky.beyond_air(up[:1], _WAVELENGTHS_NM) + sky.airglow(0.0, up[:1], _WAVELENGTHS_NM) - mean
    radiance = view.radiance[0] * mean + view.transmittance[0] * behind[0]
    return illuminance_lx(radiance / solar_irradiance(_WAVELENGTHS_NM), _WAVELENGTHS_NM)
