"""The demo scene: a summer afternoon over foothills and a lake, made of nothing but numbers drawn here."""

from __future__ import annotations

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from openswim.errors import UserError
from openswim.scene.atmosphere import Atmosphere
from openswim.scene.grid import EARTH_RADIUS_M, Grid
from openswim.scene.ground import Ground
from openswim.scene.procedural.cirrus import cirrus_field
from openswim.scene.procedural.cumulus import cumulus_field
from openswim.scene.procedural.noise import blur, smoothstep
from openswim.scene.procedural.terrain import WAVELENGTH_NM, land_albedo, terrain_field
from openswim.scene.scene import Scene
from openswim.scene.times import parse_time

CLOUD_BASE_M = 2150.0  # condensation level, 1500 m above the mean ground
CLOUD_TOP_M = 3900.0
CIRRUS_M = (9500.0, 10_800.0)


def demo_scene(
    nx: int = 256,
    ny: int = 256,
    nz: int = 64,
    seed: int = 3,
    spacing_m: float = 100.0,
    *,
    latitude: float = 47.7,
    longitude: float = 11.2,
    time: str = "2026-07-10T14:00",
    cloud_cover: float = 0.35,
) -> Scene:
    """Broken cumulus and some cirrus over hills and a lake, on a curved Earth.

    The same arguments give the same scene.
    The grid has `nx` by `ny` nodes `spacing_m` apart on a Lambert projection about `latitude`, `longitude`
    (degrees) and `nz` levels between 400 m and 12 km above sea level, close together where cumulus is. At the
    default time (UTC) and place the sun stands 49 degrees high in the south-west, beyond the lake. No field
    is measured; contents, radii and albedos are within observed ranges (see `cumulus_field`, `cirrus_field`,
    `terrain_field`, `land_albedo`). Nodes at 100 m show clouds from about 300 m across; a coarser grid has
    only the larger ones.
    """
    if min(nx, ny) < 16 or nz < 16 or not 10.0 <= spacing_m <= 2000.0:
        raise UserError(
            f"demo scene: {nx} x {ny} x {nz} nodes at {spacing_m} m cannot show clouds: "
            "use at least 16 nodes each way, 10 to 2000 m apart"
        )
    if not 0.02 <= cloud_cover <= 0.8:
        raise UserError(
            f"demo scene: cloud_cover = {cloud_cover} is not broken cloud: give a fraction of 0.02 to 0.8"
        )
    x, y = ((np.arange(n) - 0.5 * (n - 1)) * spacing_m for n in (nx, ny))
    height_m = demo_levels(nz)
    # chosen by eye, for the default seed: a sun beside the cirrus, a lake below it
    seeds = [int(np.random.SeedSequence(seed, spawn_key=(n,)).generate_state(1)[0]) for n in (0, 1, 12, 3)]
    altitude, land = terrain_field(x, y, seed=seeds[0])
    pressure, temperature = summer_sounding(height_m)
    base_pressure, base_temperature = summer_sounding(np.array([CLOUD_BASE_M]))
    liquid, liquid_radius = cumulus_field(
        x, y, height_m, seed=seeds[1], base_m=CLOUD_BASE_M, top_m=CLOUD_TOP_M, cover=cloud_cover,
        base_pressure_pa=float(base_pressure[0]), base_temperature_k=float(base_temperature[0]),
        preference=_updraught_preference(x, y, altitude, land),
    )  # fmt: skip
    ice, ice_radius = cirrus_field(x, y, height_m, seed=seeds[2], base_m=CIRRUS_M[0], top_m=CIRRUS_M[1])
    volume, plane, shape = ("z", "y", "x"), ("y", "x"), (nz, ny, nx)
    data = xr.Dataset(
        {
            "liquid_content": (volume, liquid),
            "liquid_effective_radius": (volume, liquid_radius),
            "ice_content": (volume, ice),
            "ice_effective_radius": (volume, ice_radius),
            "air_pressure": (volume, _on_columns(pressure, shape)),
            "air_temperature": (volume, _on_columns(temperature, shape)),
            "surface_altitude": (plane, altitude),
            "land_area_fraction": (plane, land),
            "surface_albedo": ((*plane, "wavelength"), land_albedo(x, y, altitude, land, seed=seeds[3])),
            "wind_east_10m": (plane, np.full((ny, nx), 3.7, np.float32)),
            "wind_north_10m": (plane, np.full((ny, nx), 1.5, np.float32)),
        },
        coords={"wavelength": WAVELENGTH_NM},
    )
    return _scene(x, y, height_m, data, latitude, longitude, time)


def demo_levels(nz: int) -> NDArray[np.float64]:
    """Node heights (nz,) in m above sea level, 400 m to 12 km: three times finer in cumulus than above."""
    fine = np.linspace(400.0, 12_000.0, 4000)
    density = 1.0 + 2.6 * smoothstep(fine, 1200.0, 2050.0) * smoothstep(-fine, -4900.0, -4200.0)
    density += 0.5 * smoothstep(fine, 7500.0, 8500.0) * smoothstep(-fine, -11_500.0, -10_800.0)
    index = np.concatenate([[0.0], np.cumsum(0.5 * (density[1:] + density[:-1]))])
    return np.interp(np.linspace(0.0, index[-1], nz), index, fine)


def summer_sounding(height_m: NDArray) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Pressure (Pa) and temperature (K) at heights (n,) above sea level up to 20 km, in hydrostatic balance.

    A fair summer afternoon: 25 C at 600 m, well mixed (9.8 K/km) to the cloud base, 5.5 K/km up to 5 km, 6.8
    K/km to the tropopause at 11.8 km, isothermal above; 1016 hPa at sea level.
    """
    nodes = np.array([0.0, CLOUD_BASE_M, 5000.0, 11_800.0, 20_000.0])
    lapse = np.array([9.8e-3, 5.5e-3, 6.8e-3, 0.0])
    values = 298.15 + 600.0 * lapse[0] - np.concatenate([[0.0], np.cumsum(lapse * np.diff(nodes))])
    fine = np.linspace(0.0, 20_000.0, 2001)
    inverse = 1 / np.interp(fine, nodes, values)
    integral = np.concatenate([[0.0], np.cumsum(0.5 * (inverse[1:] + inverse[:-1]) * np.diff(fine))])
    pressure = 101_600.0 * np.exp(-9.80665 / 287.05 * np.interp(height_m, fine, integral))
    return pressure, np.interp(height_m, nodes, values)


def _updraught_preference(x_m: NDArray, y_m: NDArray, altitude_m: NDArray, land: NDArray) -> NDArray:
    """Logarithm of cumulus density (ny, nx): more over high ground, less over the lake and at the sides."""
    width = 800.0 / float(x_m[1] - x_m[0])
    hills = blur((altitude_m - altitude_m.mean()) / max(float(altitude_m.std()), 1.0), (width, width))
    water = blur(1 - land, (width, width))
    margin = np.minimum.outer(1 - np.abs(y_m / y_m[-1]), 1 - np.abs(x_m / x_m[-1]))
    return 0.25 * hills - 3.0 * water - 1.0 * (1 - smoothstep(margin, 0.0, 0.08))


def _on_columns(profile: NDArray, shape: tuple[int, int, int]) -> NDArray[np.float32]:
    return np.broadcast_to(profile.astype(np.float32)[:, None, None], shape)


def _scene(
    x_m: NDArray,
    y_m: NDArray,
    height_m: NDArray,
    data: xr.Dataset,
    latitude: float,
    longitude: float,
    time: str,
) -> Scene:
    from pyproj import CRS

    centre = f"+lat_1={latitude} +lat_0={latitude} +lon_0={longitude}"
    crs = CRS.from_proj4(f"+proj=lcc {centre} +R={EARTH_RADIUS_M} +units=m +no_defs")
    return Scene(
        grid=Grid(x_m, y_m, height_m, crs, EARTH_RADIUS_M),
        data=data,
        atmosphere=Atmosphere.us_standard(),
        time=parse_time(time),
        source="procedural demo scene: summer cumulus and cirrus over foothills and a lake",
        ground=Ground(mountains=False),  # real ones have no place around made-up hills
        notes=["all fields are invented (openswim.scene.procedural), none is measured or forecast"],
    )
