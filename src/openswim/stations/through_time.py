"""`openswim.irradiance`: global, direct and diffuse light at places through time."""

from __future__ import annotations

from collections.abc import Sequence
from copy import copy
from dataclasses import dataclass
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import ArrayLike, NDArray

from openswim.arguments import number, numbers, takes
from openswim.cameras import Camera
from openswim.errors import UserError
from openswim.fluxes import broadband
from openswim.lighting import solver_of
from openswim.lights import SunTrack, solar_irradiance, sun_track
from openswim.scene import Scene
from openswim.scene.times import parse_time
from openswim.solver import Solver
from openswim.stations.light import DARK_DEG, Light, Place, even, of_clear_sky, of_scene, solves_of_scene
from openswim.stations.planes import HORIZONTAL, Planes
from openswim.stations.series import Series

F64 = NDArray[np.float64]

# Solved for at no more cost than three; broadband diffuse light is within 1 W/m2 of that from eleven, 330-1600 nm.
WAVELENGTHS_NM = (870.0, 615.0, 500.0, 400.0)
STEP_MINUTES = 30.0
MOST_VAPOUR_CM = 20.0  # the wettest air has some 8
_NAMES = {  # of variables: CF standard name, description
    "ghi": ("surface_downwelling_shortwave_flux_in_air", "global horizontal irradiance"),
    "dni": ("surface_direct_along_beam_shortwave_flux_in_air", "direct normal irradiance"),
    "dhi": ("surface_diffuse_downwelling_shortwave_flux_in_air", "diffuse horizontal irradiance"),
}


@takes
def irradiance(
    scene: Scene | Sequence[Scene] | Series,
    lat: ArrayLike,
    lon: ArrayLike,
    times: Any,
    planes: Sequence[tuple[float, float]] = (),
    solver: str | Solver = "fast",
    wavelengths_nm: Sequence[float] = WAVELENGTHS_NM,
    height_m: float = 2.0,
    x_m: float | None = None,
    y_m: float | None = None,
    water_vapour_cm: ArrayLike | None = None,
    step_minutes: float = STEP_MINUTES,
) -> xr.Dataset:
    """Global, direct and diffuse irradiance at places of a scene through time: docs/irradiance.md.

    scene : a Scene, which then stands for all times; scenes in order of time, or `Series.open(paths)`: between two
        model times the light of both, each under the sun of that moment, is mixed linearly in time.
    lat, lon : of one place, or of several (n,), degrees. In a flat scene they are one place, which serves for the sun
        whatever place the scene names, and x_m, y_m (default: the middle) for where in it.
    times : UTC, one or many (nt,).
    planes : tilted planes as pairs (tilt, azimuth that they face) in degrees.
    height_m : of the instruments above the ground.
    water_vapour_cm : precipitable water above the ground, one number or (nt,), in place of the scene's own.
    step_minutes : diffuse light under clouds is solved for at most so far apart, and linear in time between.

    Returns a Dataset on (time[, place][, plane][, wavelength]): ``ghi``, ``dni``, ``dhi`` in W m-2 (280-4000 nm), their
    ``spectral_`` parts in W m-2 nm-1, ``poa_global``, ``poa_direct``, ``poa_diffuse`` on the planes (the diffuse part
    with light from the ground), and the sun's place.
    """
    series, stamps, tilted = Series.of(scene), _stamps(times), Planes.of(planes) if len(planes) else HORIZONTAL
    wavelengths = np.atleast_1d(numbers("wavelengths_nm", wavelengths_nm).astype(float))
    where = [numbers(name, value).astype(float) for name, value in (("lat", lat), ("lon", lon))]
    several = any(each.ndim for each in where)
    latitudes, longitudes = map(np.atleast_1d, where)
    if latitudes.ndim > 1 or latitudes.shape != longitudes.shape:
        raise UserError(f"lat has shape {latitudes.shape} and lon {longitudes.shape}: give as many of each, in a row")
    vapour = None if water_vapour_cm is None else numbers("water_vapour_cm", water_vapour_cm).astype(float)
    if vapour is not None and vapour.shape not in ((), stamps.shape):
        raise UserError(f"water_vapour_cm has shape {vapour.shape}: give one number, or one per time")
    impossible = np.empty(0) if vapour is None else vapour[~((vapour >= 0) & (vapour <= MOST_VAPOUR_CM))]
    if impossible.size:
        limits = f"is not within 0 to {MOST_VAPOUR_CM:g}: give cm of precipitable water"
        raise UserError(f"water_vapour_cm: {impossible[0]:g} {limits}")
    if not number("step_minutes", step_minutes) > 0:
        raise UserError(f"step_minutes = {step_minutes}: give minutes above 0")

    chosen, solves = solver_of(solver), 0
    total: list[_Sums] = []
    places: list[Place] = []
    notes: list[str] = []
    for which, weight in series.weights(stamps):
        here = _under_sun_of(series.scene(which), latitudes, longitudes)
        places = places or _places(here, latitudes, longitudes, stamps, height_m, x_m, y_m)
        total = total or [_Sums.zero(stamps.size, len(tilted), wavelengths.size) for _ in places]
        if even(here):
            lights, count = of_clear_sky(here, places, tilted, chosen, wavelengths)
        else:
            lights, count = of_scene(here, stamps, weight > 0, places, tilted, chosen, wavelengths, step_minutes)
        solves += count
        notes += [note for note in here.notes if note not in notes]
        for sums, place, light in zip(total, places, lights, strict=True):
            sums.add(light, place.track, weight, wavelengths, vapour)
    out = xr.concat(
        [_dataset(sums, place, tilted, stamps, wavelengths) for sums, place in zip(total, places, strict=True)],
        "place",
        coords="minimal", compat="override",
    )  # fmt: skip
    out = out.assign_coords(latitude=("place", latitudes), longitude=("place", longitudes))
    out.attrs = {
        "Conventions": "CF-1.11",
        "title": "OpenSWIm irradiance",
        "solver": chosen.name,
        "solves": solves,
        "assumptions": "\n".join(notes),
        "between_model_times": "light of both scenes under the sun of the moment, mixed linearly in time",
    }
    return out.transpose("time", "place", ...) if several else out.isel(place=0)


def solves(series: Series, lat: float, lon: float, times: Any, step_minutes: float = STEP_MINUTES) -> int:
    """How many times `irradiance` solves for the light at a place of scenes with clouds or hills."""
    stamps = _stamps(times)
    tracks = [sun_track(stamps, lat, lon)]
    return sum(solves_of_scene(stamps, weight > 0, tracks, step_minutes) for _, weight in series.weights(stamps))


@dataclass
class _Sums:
    """Weighted sums over scenes of broadband (nt, 2 + planes) and relative spectral light (nt, 2, nw), and of gases."""

    wide: F64
    spectral: F64
    vapour_cm: F64
    ozone_du: F64

    @classmethod
    def zero(cls, nt: int, planes: int, nw: int) -> _Sums:
        return cls(np.zeros((nt, 2 + planes)), np.zeros((nt, 2, nw)), np.zeros(nt), np.zeros(nt))

    def add(self, light: Light, track: SunTrack, weight: F64, wavelengths_nm: F64, vapour: F64 | None) -> None:
        """DNI, DHI, and diffuse light on planes."""
        column = np.broadcast_to(light.gases["water_vapour_cm"] if vapour is None else vapour, weight.shape)
        self.spectral += weight[:, None, None] * np.stack([light.beam, light.diffuse[:, 0]], axis=1)
        self.vapour_cm += weight * column
        self.ozone_du += weight * light.gases["ozone_du"]
        top = solar_irradiance(wavelengths_nm)
        for row in np.flatnonzero((weight > 0) & (track.lit_altitude_deg > DARK_DEG)):
            diffuse = light.diffuse[row]
            gases = light.gases | {"water_vapour_cm": float(column[row])}
            found = broadband(
                light.open[row], diffuse[0], wavelengths_nm, float(light.altitude_deg[row]),
                float(track.distance_au[row]), visible=float(light.visible[row]), **gases,
            )  # fmt: skip
            up = max(float(np.sin(np.radians(light.altitude_deg[row]))), 0.0)
            seen, whole = diffuse @ top, float((light.beam[row] * up + diffuse[0]) @ top)
            half = 1 + (len(seen) - 1) // 2
            on_planes = (  # light of the sky is as blue as the diffuse, that of the ground as the global
                found.diffuse_horizontal * seen[1:half] / max(seen[0], 1e-30)
                + found.global_horizontal * seen[half:] / max(whole, 1e-30)
            )
            self.wide[row] += weight[row] * np.concatenate([[found.direct_normal, found.diffuse_horizontal], on_planes])


def _stamps(times: Any) -> NDArray[np.datetime64]:
    remedy = "times: give one time, or a list of times (UTC), such as 2016-06-23T12:00"
    try:
        array = np.asarray(times)
    except (ValueError, TypeError):  # lists of several lengths, data of several kinds
        raise UserError(remedy) from None
    if array.dtype.kind == "M":
        stamps = np.atleast_1d(array).astype("datetime64[ms]")
    else:
        listed = [times] if array.ndim == 0 else list(times)
        stamps = np.array([parse_time(each) for each in listed], "datetime64[ms]")
    if stamps.ndim != 1 or not stamps.size or np.isnat(stamps).any():
        raise UserError(remedy)
    return stamps


def _under_sun_of(scene: Scene, lat: F64, lon: F64) -> Scene:
    """A flat scene with the place that is asked for in place of its own, so that one sun makes all of its light."""
    if scene.grid is None or scene.grid.curved:
        return scene
    if lat.size > 1:
        raise UserError("lat and lon are one place in a flat scene: give one of each, and x_m and y_m")
    if not (abs(lat[0]) <= 90 and abs(lon[0]) <= 360):
        raise UserError(f"lat = {lat[0]:g}, lon = {lon[0]:g} is no place on Earth: give degrees, in a flat scene too")
    out = copy(scene)
    out.data = scene.data.assign_coords(latitude=lat[0], longitude=lon[0])
    return out


def _places(
    scene: Scene, lat: F64, lon: F64, times: NDArray[np.datetime64], height_m: float, x_m: float | None,
    y_m: float | None,
) -> list[Place]:  # fmt: skip
    height = number("height_m", height_m)
    grid = scene.grid
    flat = grid is not None and not grid.curved
    if not flat and (x_m is not None or y_m is not None):
        raise UserError("x_m and y_m are for flat scenes: this one has latitudes and longitudes")
    found = []
    for one_lat, one_lon in zip(lat, lon, strict=True):
        if flat:
            assert grid is not None
            x = float(grid.x.mean()) if x_m is None else x_m
            y = float(grid.y.mean()) if y_m is None else y_m
            camera = Camera.allsky(height_m=height, size=2, x_m=x, y_m=y)
        else:
            camera = Camera.allsky(float(one_lat), float(one_lon), height, size=2)
        found.append(Place(camera, sun_track(times, float(one_lat), float(one_lon))))
    return found


def _dataset(sums: _Sums, place: Place, planes: Planes, times: NDArray[np.datetime64], wavelengths: F64) -> xr.Dataset:
    track = place.track
    up = np.maximum(np.sin(np.radians(track.lit_altitude_deg)), 0.0)
    dni, dhi = sums.wide[:, 0], sums.wide[:, 1]
    top = solar_irradiance(wavelengths) / track.distance_au[:, None] ** 2
    beam, diffuse = top * sums.spectral[:, 0], top * sums.spectral[:, 1]
    parts = {"ghi": (dni * up + dhi, beam * up[:, None] + diffuse), "dni": (dni, beam), "dhi": (dhi, diffuse)}
    out = xr.Dataset(
        coords={
            "time": ("time", times.astype("datetime64[ns]"), {"standard_name": "time"}),
            "wavelength": ("wavelength", wavelengths, {"units": "nm"}),
        }
    )
    for name, (wide, spectral) in parts.items():
        standard, text = _NAMES[name]
        out[name] = ("time", wide, {"units": "W m-2", "standard_name": standard, "long_name": text})
        about = {"units": "W m-2 nm-1", "long_name": f"spectral {text}"}
        out[f"spectral_{name}"] = (("time", "wavelength"), spectral, about)
    for name, values, units, text in (
        ("sun_altitude", track.lit_altitude_deg, "degree", "altitude of the sun, raised by refraction as its light is"),
        ("sun_azimuth", track.azimuth_deg, "degree", "azimuth of the sun, clockwise from north"),
        ("water_vapour", sums.vapour_cm, "cm", "precipitable water"),
        ("ozone", sums.ozone_du, "DU", "column of ozone"),
    ):
        out[name] = ("time", values, {"units": units, "long_name": text})
    if len(planes):
        out = out.assign_coords(
            plane_tilt=("plane", planes.tilt_deg, {"units": "degree"}),
            plane_azimuth=("plane", planes.azimuth_deg, {"units": "degree"}),
        )
        high, around = np.radians(track.lit_altitude_deg), np.radians(track.azimuth_deg)
        toward = np.stack([np.cos(high) * np.sin(around), np.cos(high) * np.cos(around), np.sin(high)], axis=-1)
        direct = dni[:, None] * np.maximum(toward @ planes.normal.T, 0.0)
        for name, values in (("global", direct + sums.wide[:, 2:]), ("direct", direct), ("diffuse", sums.wide[:, 2:])):
            about = {"units": "W m-2", "long_name": f"{name} irradiance on the plane"}
            out[f"poa_{name}"] = (("time", "plane"), values, about)
    return out
