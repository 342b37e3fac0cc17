"""Reflectance as an imager in space sees it, pixel for pixel of its own grid."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from openswim.arguments import check_kind
from openswim.cameras import Rays
from openswim.errors import UserError
from openswim.lighting import daylight, moon_shadow, solver_of
from openswim.lights import subsolar_point
from openswim.satellites.bands import Band
from openswim.satellites.fixed_grid import FixedGrid
from openswim.satellites.pixels import Pixels
from openswim.scene import Scene
from openswim.scene.frame import Frame
from openswim.scene.times import parse_time
from openswim.solver import Solver
from openswim.transport import Field, ReferenceField

F64 = NDArray[np.float64]

SAME_SUN_S = 60.0  # the sun moves by a quarter of a degree: one solve
_LOWEST_VIEW_DEG = 88.0  # zenith angle of the satellite beyond which pixels are left out


def reflectance(
    scene: Scene,
    grid: FixedGrid | Pixels,
    bands: Sequence[Band] | Band,
    time: Any = None,
    end: Any = None,
    solver: str | Solver = "fast",
) -> xr.Dataset:
    """The scene as an imager sees it: docs/satellites.md.

    grid : the pixels, a `FixedGrid` or `Pixels`. bands : one or several, see `openswim.satellites.band`. time, end :
        UTC of the first row and of the last (default: the scene's time, for all rows): light is solved for at both
        and mixed row by row.

    Returns a Dataset on (band, y, x): ``reflectance_factor`` (pi L d^2 / E, which ABI, AHI and MODIS files hold) and
    ``bidirectional_reflectance`` (the same over the cosine of the sun's zenith angle; NaN where the sun is down), with
    latitude, longitude, and the zenith angles of sun and satellite; NaN beside the Earth and outside of the domain.
    """
    check_kind("scene", scene, Scene, "give one: open_scene(path) first")
    check_kind("grid", grid, (FixedGrid, Pixels), "give an openswim.satellites.FixedGrid, or Pixels")
    if scene.grid is not None and not scene.grid.curved:
        raise UserError("a flat scene has no place on Earth for a satellite to look at: give it a crs")
    listed: list[Any] = [bands] if isinstance(bands, Band) or not isinstance(bands, Iterable) else list(bands)
    if not listed or not all(isinstance(one, Band) for one in listed):
        raise UserError("bands: give a list of bands, such as [openswim.satellites.band('goes-16 abi', 'C02')]")
    wavelengths = np.unique(np.concatenate([one.wavelength_nm for one in listed]))
    first, last = scene.time if time is None else parse_time(time), parse_time(end)
    times = [when for when in (first, last) if when is not None]
    if not times:
        raise UserError("the scene has no time: give time=... (UTC)")
    if len(times) == 2 and abs((times[1] - times[0]) / np.timedelta64(1, "s")) < SAME_SUN_S:
        times = times[:1]

    lat, lon = grid.latlon()
    zenith, azimuth = grid.view(lat, lon)
    seen = np.isfinite(lat) & (zenith < _LOWEST_VIEW_DEG) & _within(scene, lat, lon)
    if not seen.any():
        there = np.isfinite(lat)
        if not there.any():
            raise UserError("no pixel of the grid lies on the Earth: give another grid")
        (south, north), (west, east) = ((part[there].min(), part[there].max()) for part in (lat, lon))
        raise UserError(
            "no pixel of the grid lies on the scene's domain: its pixels are within latitude "
            f"{south:.1f} to {north:.1f}, longitude {west:.1f} to {east:.1f}"
        )
    parts = []
    for when in times:
        # the sun's light alone: reflectance is of that, also at night
        shadow = moon_shadow(scene, when)
        field = solver_of(solver).solve(scene, daylight(scene, when).direction, list(wavelengths), shadow=shadow)
        reach = grid.reach_m(lat[seen], lon[seen]) if isinstance(grid, Pixels) else None
        parts.append(_factor(field, lat[seen], lon[seen], zenith[seen], azimuth[seen], reach))
    down = np.linspace(0.0, 1.0, len(lat))[:, None]
    row = np.broadcast_to(down, lat.shape)[seen]
    share = row[:, None] if len(parts) == 2 else 0.0
    factor = (1 - share) * parts[0] + share * parts[-1]
    stamps = [times[0] + (times[-1] - times[0]) * part for part in np.linspace(0, 1, 2)]
    sun = [_sun_zenith(lat, lon, stamp) for stamp in stamps]
    sun_zenith = sun[0] + (sun[1] - sun[0]) * down
    return _dataset(grid, listed, wavelengths, factor, seen, (lat, lon, zenith, sun_zenith), times, scene)


def _within(scene: Scene, lat: F64, lon: F64) -> NDArray[np.bool_]:
    """Pixels whose ground lies in the (widest) domain."""
    grid = scene.levels[-1].grid
    if grid is None:
        return np.ones(lat.shape, bool)
    out = np.zeros(lat.shape, bool)
    known = np.isfinite(lat)
    ix, iy = grid.index(lon[known], lat[known])
    _, ny, nx = grid.shape
    out[known] = (ix >= 0) & (ix <= nx - 1) & (iy >= 0) & (iy <= ny - 1)
    return out


def _factor(
    field: Field | ReferenceField, lat: F64, lon: F64, zenith: F64, azimuth: F64, reach_m: F64 | None
) -> F64:
    """Reflectance factor (n, nw) L'/4 of light that leaves places toward the satellite.

    The model's Earth is a sphere. A ray arrives at the pixel's latitude and longitude from the direction in which the
    satellite stands there on the ellipsoid. Such rays meet within kilometres of one point in space, from which all are
    sent: over 36,000 km that turns a ray by less than .02 degrees. From much farther away rays are too nearly parallel
    for such a point to be found. There it is where the distances to the satellite, `reach_m` (n,), end on average; that
    turns the rays of a whole disc by up to .2 degrees.
    """
    frame = field.frame
    ground = frame.position(lat, lon, 0.0)
    up = _toward(frame, lat, lon, zenith, azimuth)
    eye = _meeting_point(ground, up) if reach_m is None else (ground + reach_m[:, None] * up).mean(axis=0)
    away = ground - eye
    direction = away / np.linalg.norm(away, axis=-1, keepdims=True)
    rays = Rays(eye, direction)
    return np.asarray(field.view(rays).radiance, float) / 4.0


def _toward(frame: Frame, lat: F64, lon: F64, zenith: F64, azimuth: F64) -> F64:
    """Unit vectors (n, 3) in the frame toward a zenith angle and azimuth, each at its place."""
    la, lo, z, a = (np.radians(v) for v in (lat, lon, zenith, azimuth))
    e, n, u = np.sin(z) * np.sin(a), np.sin(z) * np.cos(a), np.cos(z)
    out = u * np.cos(la) - n * np.sin(la)
    earth = np.stack([out * np.cos(lo) - e * np.sin(lo), out * np.sin(lo) + e * np.cos(lo),
                      n * np.cos(la) + u * np.sin(la)], axis=-1)  # fmt: skip
    return earth @ frame.enu(0.0, 0.0)[[2, 0, 1]]


def _meeting_point(place: F64, direction: F64) -> F64:
    """The point nearest to all lines, by least squares."""
    across = np.eye(3) - direction[:, :, None] * direction[:, None, :]
    return np.linalg.solve(across.sum(axis=0), (across @ place[..., None]).sum(axis=0)[:, 0])


def _sun_zenith(lat: F64, lon: F64, when: np.datetime64) -> F64:
    below_lat, below_lon = subsolar_point(when)
    la, lb, away = np.radians(lat), np.radians(below_lat), np.radians(lon - below_lon)
    cosine = np.sin(la) * np.sin(lb) + np.cos(la) * np.cos(lb) * np.cos(away)
    return np.degrees(np.arccos(np.clip(cosine, -1, 1)))


def _dataset(
    grid: FixedGrid | Pixels, bands: list[Band], wavelengths: F64, factor: F64, seen: NDArray[np.bool_],
    angles: tuple[F64, F64, F64, F64], times: list[np.datetime64], scene: Scene,
) -> xr.Dataset:  # fmt: skip
    lat, lon, zenith, sun_zenith = angles
    values = np.full((len(bands), *seen.shape), np.nan, np.float32)
    for number, one in enumerate(bands):
        values[number, seen] = factor[:, np.searchsorted(wavelengths, one.wavelength_nm)] @ one.weight
    up = np.cos(np.radians(sun_zenith))
    with np.errstate(all="ignore"):
        over = np.where(up > 0.01, values / up, np.nan).astype(np.float32)
    dims = ("band", "y", "x")
    platform, sensor = bands[0].imager.rsplit(" ", 1)
    about = {"units": "1", "platform_name": platform, "sensor": sensor}
    placed: dict[str, Any] = {}
    if isinstance(grid, FixedGrid):
        about["grid_mapping"] = "geostationary"
        placed = {
            "x": ("x", grid.x, {"units": "radian", "standard_name": "projection_x_coordinate"}),
            "y": ("y", grid.y, {"units": "radian", "standard_name": "projection_y_coordinate"}),
            "geostationary": ((), 0, grid.to_cf()),
        }
    turned = dict(standard_name="toa_lambertian_equivalent_albedo_multiplied_by_cosine_solar_zenith_angle")
    out = xr.Dataset(
        {
            "reflectance_factor": (dims, values, about | turned | {"long_name": "reflectance factor"}),
            "bidirectional_reflectance": (
                dims, over, about | {"standard_name": "toa_bidirectional_reflectance",
                                     "long_name": "bidirectional reflectance"}),
        },
        coords={
            "band": [one.name for one in bands],
            "latitude": (("y", "x"), lat, {"units": "degrees_north", "standard_name": "latitude"}),
            "longitude": (("y", "x"), lon, {"units": "degrees_east", "standard_name": "longitude"}),
            "sun_zenith": (("y", "x"), sun_zenith, {"units": "degree", "standard_name": "solar_zenith_angle"}),
            "satellite_zenith": (("y", "x"), zenith, {"units": "degree", "standard_name": "sensor_zenith_angle"}),
            "band_wavelength": ("band", [one.centre_nm for one in bands], {"units": "nm"}),
        },
    )  # fmt: skip
    out = out.assign(placed)
    out.attrs = {
        "Conventions": "CF-1.11", "title": "OpenSWIm satellite picture", "platform": bands[0].imager,
        "source": scene.source, "assumptions": "\n".join(scene.notes),
        "time_coverage_start": f"{np.datetime_as_string(times[0], 's')}Z",
        "time_coverage_end": f"{np.datetime_as_string(times[-1], 's')}Z",
        "bands_in_water_vapour": ", ".join(one.name for one in bands if one.in_vapour) or "none",
    }  # fmt: skip
    return out
