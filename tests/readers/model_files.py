"""Small files with the very names, units, order and packing of real products, and the truth they were made from.

All show one made-up atmosphere: hydrostatic, isothermal in virtual temperature, with a cloud that grows to the east and
to the north, so that any turned axis is caught. Latitudes and longitudes are the textbook's, not pyproj's.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

import netCDF4
import numpy as np
import xarray as xr

GRAVITY, GAS, RADIUS = 9.80665, 287.05, 6_371_229.0
SCALE_M, HUMIDITY = 8000.0, 0.002
TEMPERATURE = SCALE_M * GRAVITY / GAS / (1 + 0.608 * HUMIDITY)
TIME = np.datetime64("2024-06-21T12:00", "ms")
NX, NY, NZ = 9, 7, 12
PRESSURES = np.linspace(98_000.0, 25_000.0, NZ)


@dataclass
class Truth:
    """What a scene must hold: (nz, ny, nx) fields upward, northward, eastward; places of the nodes; wind; times."""

    paths: list[Path]
    height_m: np.ndarray
    fields: dict[str, np.ndarray]
    lonlat: tuple[np.ndarray, np.ndarray] | None = None
    terrain_m: np.ndarray | None = None
    wind: tuple[np.ndarray, np.ndarray] | None = None
    time: np.datetime64 | None = TIME
    height_tolerance_m: float = 2.0
    content_tolerance: float = 2e-3
    extra: dict = field(default_factory=dict)


def geometric(geopotential_height: np.ndarray) -> np.ndarray:
    return RADIUS * geopotential_height / (RADIUS - geopotential_height)


def pressure_at(geopotential_height: np.ndarray) -> np.ndarray:
    return 1e5 * np.exp(-geopotential_height / SCALE_M)


def density(pressure: np.ndarray) -> np.ndarray:
    return pressure / (GRAVITY * SCALE_M)


def cloud(height: np.ndarray, peak_m: float = 3000.0, most: float = 3e-4) -> np.ndarray:
    """Content [kg m-3], (nz, ny, nx)."""
    _, ny, nx = height.shape
    east, north = np.linspace(0, 1, nx), np.linspace(0, 1, ny)[:, None]
    return most * (0.2 + east) * (0.3 + 2 * north) * np.exp(-(((height - peak_m) / 1500.0) ** 2)) / 3


def wind(ny: int, nx: int) -> tuple[np.ndarray, np.ndarray]:
    return np.full((ny, nx), 3.0), np.linspace(-4.0, 4.0, ny)[:, None] * np.ones(nx)


def terrain(ny: int, nx: int) -> np.ndarray:
    return 40.0 + 10.0 * np.arange(nx) + 5.0 * np.arange(ny)[:, None]


def on_pressure() -> dict[str, np.ndarray]:
    """State on the pressure levels, upward."""
    level = -SCALE_M * np.log(PRESSURES / 1e5)
    gph = np.broadcast_to(level[:, None, None], (NZ, NY, NX))
    height = geometric(gph)
    return {"gph": gph, "height": height, "pressure": np.broadcast_to(PRESSURES[:, None, None], gph.shape)}


def packed(values: np.ndarray) -> tuple[np.ndarray, dict]:
    """int16 with scale and offset, as the CDS packs."""
    low, high = float(values.min()), float(values.max())
    scale = (high - low) / 65_000 or 1.0
    offset = 0.5 * (low + high)
    attrs = {
        "scale_factor": scale,
        "add_offset": offset,
        "_FillValue": np.int16(-32767),
        "missing_value": np.int16(-32767),
    }
    return np.round((values - offset) / scale).astype("i2"), attrs


def era5(path: Path, new: bool = False, first_lon: float = 6.0) -> Truth:
    """ERA5 on pressure levels, rows from the north, levels from the top; old (packed) or new (float) CDS names."""
    state = on_pressure()
    lat, lon = 45.0 + 0.25 * np.arange(NY), first_lon + 0.25 * np.arange(NX)
    rho = density(state["pressure"])
    contents = {
        "clwc": cloud(state["height"]),
        "ciwc": cloud(state["height"], 8000.0, 1e-4),
        "crwc": cloud(state["height"], 1000.0),
    }
    values = {
        "z": (GRAVITY * state["gph"], "m**2 s**-2", "geopotential"),
        "t": (np.full((NZ, NY, NX), TEMPERATURE), "K", "air_temperature"),
        "q": (np.full((NZ, NY, NX), HUMIDITY), "kg kg**-1", "specific_humidity"),
        "cc": (np.clip(contents["clwc"] / 3e-4, 0, 1), "(0 - 1)", "unknown"),
    }
    values |= {name: (content / rho, "kg kg**-1", "unknown") for name, content in contents.items()}
    names = ("valid_time", "pressure_level") if new else ("time", "level")
    with netCDF4.Dataset(path, "w") as file:
        file.Conventions = "CF-1.7" if new else "CF-1.6"
        for name, size in zip((*names, "latitude", "longitude"), (2, NZ, NY, NX), strict=True):
            file.createDimension(name, size)
        clock = file.createVariable(names[0], "i8" if new else "i4", (names[0],))
        clock.units = "seconds since 1970-01-01" if new else "hours since 1900-01-01 00:00:0.0"
        clock.calendar, clock.standard_name = "proleptic_gregorian" if new else "gregorian", "time"
        seconds = int((TIME - np.datetime64("1970-01-01")) / np.timedelta64(1, "s"))
        clock[:] = [seconds, seconds + 3600] if new else [seconds // 3600 + 613_608, seconds // 3600 + 613_609]
        level = file.createVariable(names[1], "f8" if new else "i4", (names[1],))
        level.units = "hPa" if new else "millibars"
        exact = (PRESSURES[::-1] / 100).astype("f8")
        if not new:  # whole millibars only
            exact = np.round(exact)
        level[:] = exact
        for name, axis, units in (("latitude", lat[::-1], "degrees_north"), ("longitude", lon, "degrees_east")):
            own = file.createVariable(name, "f4", (name,))
            own.units = units
            own[:] = axis
        if new:
            file.createVariable("number", "i8", ())[...] = 0
            expver = file.createVariable("expver", str, (names[0],))
            expver[:] = np.array(["0001", "0001"], object)
        for name, (field_, units, said) in values.items():
            field_ = field_[::-1, ::-1]
            field_ = np.stack([field_, 0.5 * field_ if name.startswith("c") else field_])
            if new:
                own = file.createVariable(
                    name, "f4", (*names, "latitude", "longitude"), zlib=True, fill_value=np.float32(np.nan)
                )
            else:
                field_, attrs = packed(field_)
                own = file.createVariable(
                    name, "i2", (*names, "latitude", "longitude"), fill_value=attrs.pop("_FillValue")
                )
                own.setncatts(attrs)
                own.set_auto_maskandscale(False)
            own.units, own.standard_name = units, said
            own[:] = field_
    fields = {"liquid_content": contents["clwc"], "ice_content": contents["ciwc"], "rain_content": contents["crwc"]}
    return Truth([path], state["height"], fields, np.meshgrid(lon, lat), content_tolerance=0.02 if not new else 5e-3)


def merra2(path: Path, model_levels: bool = True) -> Truth:
    """MERRA-2 on model layers (DELP, from the top) or on pressure levels (upward, 1e15 below the ground)."""
    ground = terrain(NY, NX)
    lat, lon = -10.0 + 0.5 * np.arange(NY), 170.0 + 0.625 * np.arange(NX)
    lon_file = np.where(lon > 180, lon - 360, lon)
    if model_levels:
        surface = pressure_at(ground)  # of geopotential heights
        edges = np.concatenate([[surface], np.linspace(0.95, 0.0, NZ)[:, None, None] * (surface - 1.0) + 1.0])
        middle = 0.5 * (edges[1:] + edges[:-1])
        gph = -SCALE_M * np.log(middle / 1e5)
    else:
        middle = np.broadcast_to(PRESSURES[:, None, None], (NZ, NY, NX))
        gph = -SCALE_M * np.log(middle / 1e5)
    height = geometric(gph)
    content = cloud(height)
    names = {"QL": content / density(middle), "QI": 0.3 * content / density(middle)}
    levels = {
        "T": (np.full_like(gph, TEMPERATURE), "K"),
        "QV": (np.full_like(gph, HUMIDITY), "kg kg-1"),
        **{name: (values, "kg kg-1") for name, values in names.items()},
    }
    levels |= {"DELP": (edges[:-1] - edges[1:], "Pa"), "PL": (middle, "Pa")} if model_levels else {"H": (gph, "m")}
    data = xr.Dataset()
    hidden = np.zeros(gph.shape, bool) if model_levels else gph < 300.0
    for name, (values, units) in levels.items():
        values = np.where(hidden, 1e15, values)
        ordered = values[::-1] if model_levels else values
        data[name] = (
            ("time", "lev", "lat", "lon"),
            ordered[None].astype("f4"),
            {"units": units, "standard_name": name},
        )
    data["PHIS"] = (("time", "lat", "lon"), (GRAVITY * ground)[None].astype("f4"), {"units": "m2 s-2"})
    data["PS"] = (("time", "lat", "lon"), pressure_at(ground)[None].astype("f4"), {"units": "Pa"})
    data = data.assign_coords(
        lat=("lat", lat, {"units": "degrees_north"}),
        lon=("lon", lon_file, {"units": "degrees_east"}),
        lev=(
            "lev",
            np.arange(1.0, NZ + 1) if model_levels else PRESSURES / 100,
            {"units": "layer" if model_levels else "hPa"},
        ),
        time=("time", [720], {"units": "minutes since 2024-06-21 00:00:00"}),
    )
    data.to_netcdf(path, encoding={name: {"_FillValue": np.float32(1e15)} for name in data.data_vars})
    fields = {"liquid_content": np.where(hidden, 0, content), "ice_content": np.where(hidden, 0, 0.3 * content)}
    # the geopotential of MERRA-2's own H on pressure levels is a height; below the ground it is extrapolated
    return Truth(
        [path],
        height,
        fields,
        np.meshgrid(lon, lat),
        geometric(ground),
        height_tolerance_m=25.0 if hidden.any() else 12.0,
        content_tolerance=0.03,
    )


def um(path: Path) -> Truth:
    """Unified Model CF netCDF: rotated pole, hybrid heights over orography, wind along the grid."""
    pole_lat, pole_lon = 37.5, 177.5
    rlat, rlon = -1.0 + 0.3 * np.arange(NY), 358.5 + 0.3 * np.arange(NX)
    lon, lat = unrotated(*np.meshgrid(rlon, rlat), pole_lat, pole_lon)
    ground = terrain(NY, NX)
    nominal, sigma = np.linspace(20.0, 12_000.0, NZ), np.linspace(1.0, 0.0, NZ)
    height = nominal[:, None, None] + sigma[:, None, None] * ground
    pressure = pressure_at(RADIUS * height / (RADIUS + height))
    content = cloud(height)
    grid_x, grid_y = wind(NY, NX)
    dims = ("model_level_number", "grid_latitude", "grid_longitude")
    mapped = {"grid_mapping": "rotated_latitude_longitude"}

    def level(values: np.ndarray, units: str, said: str) -> tuple:
        return dims, values.astype("f4"), {"units": units, "standard_name": said, **mapped}

    data = xr.Dataset(
        {
            "m01s00i254": level(content / density(pressure), "kg kg-1", "mass_fraction_of_cloud_liquid_water_in_air"),
            "m01s00i012": level(0.2 * content / density(pressure), "kg kg-1", "mass_fraction_of_cloud_ice_in_air"),
            "m01s00i408": level(pressure, "Pa", "air_pressure"),
            "m01s16i004": level(np.full_like(height, TEMPERATURE), "K", "air_temperature"),
            "m01s00i010": level(np.full_like(height, HUMIDITY), "kg kg-1", "specific_humidity"),
            "m01s00i033": (
                dims[1:],
                ground.astype("f4"),
                {"units": "m", "standard_name": "surface_altitude", **mapped},
            ),
            "m01s03i209": (dims[1:], grid_x.astype("f4"), {"units": "m s-1", "standard_name": "x_wind", **mapped}),
            "m01s03i210": (dims[1:], grid_y.astype("f4"), {"units": "m s-1", "standard_name": "y_wind", **mapped}),
            "rotated_latitude_longitude": (
                (),
                0,
                {
                    "grid_mapping_name": "rotated_latitude_longitude",
                    "grid_north_pole_latitude": pole_lat,
                    "grid_north_pole_longitude": pole_lon,
                    "earth_radius": 6371229.0,
                },
            ),
        },
        coords={
            "grid_latitude": ("grid_latitude", rlat, {"units": "degrees", "standard_name": "grid_latitude"}),
            "grid_longitude": ("grid_longitude", rlon, {"units": "degrees", "standard_name": "grid_longitude"}),
            "model_level_number": ("model_level_number", np.arange(1, NZ + 1), {"units": "1", "positive": "up"}),
            "level_height": ("model_level_number", nominal, {"units": "m", "positive": "up"}),
            "sigma": ("model_level_number", sigma, {"units": "1"}),
            "time": (
                (),
                454_500.0,
                {"units": "hours since 1970-01-01 00:00:00", "standard_name": "time", "calendar": "standard"},
            ),
        },
    )
    data.to_netcdf(path)
    # the angle of the grid's x axis from east, by the longitudes and latitudes of neighbours
    step = 1e-3
    lon_a, lat_a = unrotated(np.meshgrid(rlon + step, rlat)[0], np.meshgrid(rlon, rlat)[1], pole_lat, pole_lon)
    turn = np.arctan2(lat_a - lat, (lon_a - lon) * np.cos(np.radians(lat)))
    east = grid_x * np.cos(turn) - grid_y * np.sin(turn)
    north = grid_x * np.sin(turn) + grid_y * np.cos(turn)
    when = np.datetime64("1970-01-01", "ms") + np.timedelta64(454_500, "h")
    fields = {"liquid_content": content, "ice_content": 0.2 * content}
    return Truth([path], height, fields, (lon, lat), ground, (east, north), when)


def unrotated(rlon: np.ndarray, rlat: np.ndarray, pole_lat: float, pole_lon: float) -> tuple[np.ndarray, np.ndarray]:
    """Geographic longitude and latitude of rotated ones: the spherical triangle with the two poles."""
    x, y, pole, turn = (np.radians(angle) for angle in (rlon, rlat, pole_lat, pole_lon))
    up = np.cos(pole) * np.cos(y) * np.cos(x) + np.sin(pole) * np.sin(y)
    out = np.cos(pole) * np.sin(y) - np.sin(pole) * np.cos(y) * np.cos(x)
    side = np.cos(y) * np.sin(x)
    lon = np.arctan2(np.sin(turn) * out - np.cos(turn) * side, np.cos(turn) * out + np.sin(turn) * side)
    return np.degrees(lon), np.degrees(np.arcsin(up))


def stereographic(x: np.ndarray, y: np.ndarray, lat0: float, lon0: float, radius: float = 6_371_000.0):
    """Longitude and latitude of a plane that touches the sphere (Snyder 1987, Eqs 20-14, 20-15, 21-15)."""
    rho = np.maximum(np.hypot(x, y), 1e-9)
    c = 2 * np.arctan(rho / (2 * radius))
    phi = np.radians(lat0)
    lat = np.arcsin(np.cos(c) * np.sin(phi) + y * np.sin(c) * np.cos(phi) / rho)
    lon = np.arctan2(x * np.sin(c), rho * np.cos(phi) * np.cos(c) - y * np.sin(phi) * np.sin(c))
    return lon0 + np.degrees(lon), np.degrees(lat)


def rams(path: Path, header: bool = True) -> Truth:
    """RAMS HDF5: nameless dimensions, the first level under the ground, terrain-following levels."""
    ground = terrain(NY, NX)
    pole = (47.0, 11.0)
    x, y = np.meshgrid(2000.0 * (np.arange(NX) - 2.5), 2000.0 * (np.arange(NY) - 3.0))
    lon, lat = stereographic(x, y, *pole)
    depth, count = 250.0, 40
    zmn = depth * np.arange(count)
    ztn = zmn - 0.5 * depth
    top = zmn[-2]
    height = ztn[:, None, None] * (1 - ground / top) + ground
    temperature = SCALE_M * 9.80 / 287.0 / (1 + 0.608 * HUMIDITY)  # isothermal with RAMS's constants
    pressure = 1e5 * np.exp(-height / SCALE_M)
    exner = 1004.0 * (pressure / 1e5) ** (287.0 / 1004.0)
    dry = pressure / (287.05 * temperature * (1 + 0.608 * HUMIDITY)) * (1 - HUMIDITY)
    content = cloud(height)
    three = {
        "THETA": temperature * 1004.0 / exner,
        "PI": exner,
        "RV": np.full_like(height, HUMIDITY / (1 - HUMIDITY)),
        "RCP": content / dry,
        "RRP": 0.1 * content / dry,
        "RDP": 0.05 * content / dry,
        "RPP": 0.2 * content / dry,
        "RSP": 0.1 * content / dry,
        "RAP": 0.3 * content / dry,
        "RGP": 0.02 * content / dry,
        "RHP": 0.0 * content,
        "CCP": 1e8 / dry,
    }
    two = {"GLAT": lat, "GLON": lon, "TOPT": ground}
    patches = np.stack([np.zeros((NY, NX)), np.ones((NY, NX))])
    with netCDF4.Dataset(path, "w") as file:
        for name, size in (("phony_dim_0", NY), ("phony_dim_1", NX), ("phony_dim_2", count), ("phony_dim_3", 2)):
            file.createDimension(name, size)
        for name, values in three.items():
            file.createVariable(name, "f4", ("phony_dim_2", "phony_dim_0", "phony_dim_1"))[:] = values
        for name, values in two.items():
            file.createVariable(name, "f4", ("phony_dim_0", "phony_dim_1"))[:] = values
        for name, values in {"PATCH_AREA": patches, "LEAF_CLASS": np.stack([0 * ground, 5 + 0 * ground])}.items():
            file.createVariable(name, "f4", ("phony_dim_3", "phony_dim_0", "phony_dim_1"))[:] = values
    if header:
        entries = {
            "__polelat": [pole[0]],
            "__polelon": [pole[1]],
            "__ztn01": ztn,
            "__zmn01": zmn,
            "__ztn02": ztn[:3] * 0,
        }
        entries |= {"__iyear1": [2024], "__imonth1": [6], "__idate1": [21], "__itime1": [600], "__time": [21_600.0]}
        lines = [
            line
            for name, values in entries.items()
            for line in (name, str(len(values)), *(f" {v:.6f}" for v in values))
        ]
        path.with_name(f"{path.stem.removesuffix('-g1')}-head.txt").write_text("\n".join(lines) + "\n")
    fields = {"liquid_content": content, "rain_content": 0.15 * content, "ice_content": 0.2 * content}
    fields |= {"snow_content": 0.4 * content, "graupel_content": 0.02 * content}
    when = TIME
    if not header:  # 10 o'clock local solar time on the day of the file's name
        when = np.datetime64("2024-06-21T10:00", "ms") - np.timedelta64(
            round(float(lon.astype("f4").mean()) * 240), "s"
        )
    return Truth(
        [path],
        height[1:],
        {name: values[1:] for name, values in fields.items()},
        (lon, lat),
        ground,
        time=when,
        height_tolerance_m=2.0 if header else 4.0,
        content_tolerance=5e-3,
    )


def lambert(
    x: np.ndarray, y: np.ndarray, lat1: float, lat2: float, lon0: float, lat_at: float, lon_at: float, radius: float
):
    """Longitude and latitude of a conic plane (Snyder 1987, Eqs 15-1 to 15-5), with (0, 0) at (lat_at, lon_at)."""
    p1, p2 = np.radians(lat1), np.radians(lat2)
    quarter = np.pi / 4
    if abs(lat1 - lat2) < 1e-6:
        n = np.sin(p1)
    else:
        n = np.log(np.cos(p1) / np.cos(p2)) / np.log(np.tan(quarter + p2 / 2) / np.tan(quarter + p1 / 2))
    f = radius * np.cos(p1) * np.tan(quarter + p1 / 2) ** n / n
    rho0 = f / np.tan(quarter + np.radians(lat_at) / 2) ** n
    theta0 = n * np.radians(lon_at - lon0)
    east, south = x + rho0 * np.sin(theta0), rho0 * np.cos(theta0) - y
    rho = np.hypot(east, south)
    return lon0 + np.degrees(np.arctan2(east, south) / n), np.degrees(2 * np.arctan((f / rho) ** (1 / n)) - np.pi / 2)


def laps(folder: Path) -> Truth:
    """LAPS lwc, lt1, lq3, lsx, lm2 of one time: Lambert navigation, 1.e37 fill, units as in the schemas."""
    state = on_pressure()
    content = cloud(state["height"])
    x, y = np.meshgrid(5000.0 * np.arange(NX), 5000.0 * np.arange(NY))
    lon, lat = lambert(x, y, 25.0, 45.0, 255.0, 39.0, 254.0, 6_371_200.0)
    grid_x, grid_y = wind(NY, NX)
    products = {
        "lwc": {
            "lwc": (content, "kg/meter**3"),
            "ice": (0.2 * content, "kg/meter**3"),
            "rai": (0.1 * content, "kg/meter**3"),
            "sno": (0.3 * content, "kg/meter**3"),
            "pic": (0.05 * content, "kg/meter**3"),
        },
        "lt1": {"ht": (state["gph"], "meters"), "t3": (np.full_like(content, TEMPERATURE), "degrees Kelvin")},
        "lq3": {"sh": (np.full_like(content, HUMIDITY), "kg/kg")},
        "lsx": {"u": (grid_x[None], "meter/second"), "v": (grid_y[None], "meter/second")},
        "lm2": {"sc": (np.full((1, NY, NX), 0.5), "none")},
    }
    paths = []
    for product, variables in products.items():
        path = folder / f"241731200.{product}"
        levels = next(iter(variables.values()))[0].shape[0]
        with netCDF4.Dataset(path, "w", format="NETCDF3_CLASSIC") as file:
            file.title = f"LAPS {product} file"
            sizes = {"record": None, "z": levels, "x": NX, "y": NY, "nav": 1, "namelen": 132}
            for name, size in sizes.items():
                file.createDimension(name, size)
            for name, (values, units) in variables.items():
                own = file.createVariable(name, "f4", ("record", "z", "y", "x"), fill_value=np.float32(1e37))
                own.units, own.LAPS_var, own.navigation_dim = units, name.upper(), "nav"
                own[0] = values
            file.createVariable("level", "f4", ("z",))[:] = PRESSURES / 100 if levels > 1 else [0]
            file["level"].units = "hectopascals"
            seconds = float((TIME - np.datetime64("1970-01-01")) / np.timedelta64(1, "s"))
            for name in ("valtime", "reftime"):
                own = file.createVariable(name, "f8", ("record",))
                own.units = "seconds since (1970-1-1 00:00:00.0)"
                own[0] = seconds
            own = file.createVariable("grid_type", "S1", ("nav", "namelen"))
            own[0] = np.array(list("secant lambert conformal".ljust(132)), "S1")
            navigation = {
                "La1": 39.0,
                "Lo1": 254.0,
                "LoV": 255.0,
                "Latin1": 25.0,
                "Latin2": 45.0,
                "Dx": 5000.0,
                "Dy": 5000.0,
            }
            for name, value in navigation.items():
                file.createVariable(name, "f4", ("nav",))[0] = value
            for name, value in {"Nx": NX, "Ny": NY}.items():
                file.createVariable(name, "i2", ("nav",))[0] = value
        paths.append(path)
    n = np.log(np.cos(np.radians(25.0)) / np.cos(np.radians(45.0))) / np.log(
        np.tan(np.radians(67.5)) / np.tan(np.radians(57.5))
    )
    turn = -n * np.radians(lon - 255.0)  # convergence of the meridians
    east = grid_x * np.cos(turn) - grid_y * np.sin(turn)
    north = grid_x * np.sin(turn) + grid_y * np.cos(turn)
    shares = {"liquid": 1.0, "ice": 0.2, "rain": 0.1, "snow": 0.3, "graupel": 0.05}
    fields = {f"{name}_content": share * content for name, share in shares.items()}
    return Truth(paths, state["height"], fields, (lon, lat), None, (east, north))


def cosp(path: Path) -> Truth:
    """COSP input of the Met Office: two kinds of cloud, precipitation as fluxes, radii by `hydro`."""
    ground = terrain(NY, NX)
    height = np.linspace(20.0, 14_000.0, NZ)[:, None, None] + ground
    gph = RADIUS * height / (RADIUS + height)
    pressure = pressure_at(gph)
    dry = density(pressure) * (1 - HUMIDITY)
    content = cloud(height)
    lat, lon = 40.0 + 1.25 * np.arange(NY), 1.875 * np.arange(NX)
    three = {
        "height": (height, "m"),
        "pfull": (pressure, "Pa"),
        "T_abs": (np.full_like(height, TEMPERATURE), "K"),
        "qv": (np.full_like(height, HUMIDITY), "kg/kg"),
        "tca": (np.clip(content / 3e-4, 0, 1), "1"),
        "mr_lsliq": (0.8 * content / dry, "kg/kg"),
        "mr_ccliq": (0.2 * content / dry, "kg/kg"),
        "mr_lsice": (0.1 * content / dry, "kg/kg"),
        "mr_ccice": (0.0 * content, "kg/kg"),
        "fl_lsrain": (np.full_like(height, 1 / 3600.0), "kg m^-2 s^-1"),
        "fl_lssnow": (0 * height, "kg m^-2 s^-1"),
    }
    radii = np.zeros((9, *height.shape))
    radii[0], radii[4], radii[1] = 10e-6, 20e-6, 40e-6
    data = xr.Dataset(
        {
            name: (("level", "lat", "lon"), values.astype("f4"), {"units": units})
            for name, (values, units) in three.items()
        }
        | {
            "Reff": (("hydro", "level", "lat", "lon"), radii.astype("f4"), {"units": "m"}),
            "orography": (("lat", "lon"), ground.astype("f4"), {"units": "m"}),
            "landmask": (("lat", "lon"), np.ones((NY, NX), "f4"), {"units": "1"}),
        },
        coords={"lat": ("lat", lat, {"units": "degrees_north"}), "lon": ("lon", lon, {"units": "degrees_east"})},
    )
    data.to_netcdf(path)
    fields = {"liquid_content": content, "ice_content": 0.1 * content, "rain_content": np.full_like(height, 72e-6)}
    when = np.datetime64("2000-03-20T10:00", "ms") - np.timedelta64(round(float(lon.mean()) * 240), "s")
    return Truth(
        [path], height, fields, np.meshgrid(lon, lat), ground, time=when, height_tolerance_m=0.1, content_tolerance=5e-3
    )


def ecrad(path: Path) -> Truth:
    """ecRad columns on (nearly even) Gaussian latitudes from the north, half levels from the top."""
    lat = np.array([24.9199, 19.3822, 13.8445, 8.3067, 2.7689, -2.7689, -8.3067])[::-1]
    ny = lat.size
    edges = np.linspace(1.0, 0.0, NZ + 1)[:, None] * (1e5 - 100.0) + 100.0 + np.zeros(ny)
    middle = 0.5 * (edges[1:] + edges[:-1])
    height = geometric(-SCALE_M * np.log(middle / 1e5))
    content = cloud(np.repeat(height[..., None], 3, 2))[..., 1]
    columns = {
        "pressure_hl": edges,
        "temperature_hl": np.full_like(edges, TEMPERATURE),
        "q": np.full_like(middle, HUMIDITY),
        "q_liquid": content / density(middle),
        "q_ice": 0.5 * content / density(middle),
        "re_liquid": np.full_like(middle, 9e-6),
        "re_ice": np.full_like(middle, 50e-6),
    }
    data = xr.Dataset(
        {
            name: (("column", "half_level" if values.shape[0] > NZ else "level"), values[::-1, ::-1].T.astype("f4"))
            for name, values in columns.items()
        }
        | {"lat": ("column", lat[::-1].astype("f4")), "lon": ("column", np.full(ny, 135.0, "f4"))},
        attrs={"comment": "a meridian line on 21 June 2024", "history": "changed to be for 12.0 UTC, 21 June"},
    )
    data.to_netcdf(path)
    lons = 135.0 + (lat[-1] - lat[0]) / (ny - 1) * np.arange(-7, 8)
    spread = np.repeat(height[..., None], lons.size, 2)
    fields = {"liquid_content": np.repeat(content[..., None], lons.size, 2)}
    fields["ice_content"] = 0.5 * fields["liquid_content"]
    return Truth([path], spread, fields, np.meshgrid(lons, lat), height_tolerance_m=60.0, content_tolerance=0.05)


def les(path: Path, kind: str) -> Truth:
    """Large-eddy models in flat metres: MicroHH (z, y, x), PALM (zu_3d, ...), CM1 (km)."""
    level = np.linspace(50.0, 4000.0, NZ)
    height = np.broadcast_to(level[:, None, None], (NZ, NY, NX))
    pressure = pressure_at(RADIUS * height / (RADIUS + height))
    rho = density(pressure)
    content = cloud(height, 1500.0)
    x, y = 100.0 * np.arange(NX) + 50.0, 100.0 * np.arange(NY) + 50.0
    theta = TEMPERATURE * (1e5 / pressure) ** (287.05 / 1004.6)
    dry = rho * (1 - HUMIDITY)
    names: dict[str, tuple[np.ndarray, str]]
    if kind == "microhh":
        dims, axes = ("time", "z", "y", "x"), (level, y, x, "m")
        names = {
            "ql": (content / rho, "kg kg-1"),
            "qi": (0.1 * content / rho, "kg kg-1"),
            "phydro": (pressure, "Pa"),
            "qt": (np.full_like(height, HUMIDITY), "kg kg-1"),
            "T": (np.full_like(height, TEMPERATURE), "K"),
        }
        clock, attrs = ("seconds since 2024-06-21 12:00:00", [0.0]), {"title": "MicroHH"}
    elif kind == "palm":
        dims, axes = ("time", "zu_3d", "y", "x"), (level, y, x, "m")
        names = {
            "qc": (content / dry, "kg/kg"),
            "ql": (9 * content, "kg/kg"),
            "qi": (0.1 * content / dry, "kg/kg"),
            "theta": (theta, "K"),
            "p": (pressure, "Pa"),
            "qv": (np.full_like(height, HUMIDITY), "kg/kg"),
        }
        clock, attrs = (
            ("seconds", [0.0]),
            {"title": "PALM 23", "origin_time": "2024-06-21 12:00:00 +00", "origin_lat": 50.0},
        )
    else:
        dims, axes = ("time", "zh", "yh", "xh"), (level / 1e3, y / 1e3, x / 1e3, "km")
        names = {
            "qc": (content / dry, "kg/kg"),
            "qi": (0.1 * content / dry, "kg/kg"),
            "prs": (pressure, "Pa"),
            "th": (theta, "K"),
            "qv": (np.full_like(height, HUMIDITY / (1 - HUMIDITY)), "kg/kg"),
        }
        clock, attrs = ("seconds since 2024-06-21 12:00:00", [0.0]), {"title": "CM1"}
    data = xr.Dataset(
        {name: (dims, values[None].astype("f4"), {"units": units}) for name, (values, units) in names.items()}
    )
    for dim, axis in zip(dims[1:], axes[:3], strict=True):
        data = data.assign_coords({dim: (dim, axis, {"units": axes[3]})})
    data = data.assign_coords(time=("time", clock[1], {"units": clock[0]})).assign_attrs(attrs)
    data.to_netcdf(path)
    fields = {"liquid_content": content, "ice_content": 0.1 * content}
    return Truth([path], height, fields, height_tolerance_m=0.1, content_tolerance=6e-3, extra={"x": x, "y": y})


def les_text(path: Path, kind: str) -> Truth:
    """Rows i j k lwc reff: SHDOM (dense, from 0) or AT3D (commas, cloudy cells only)."""
    level = np.linspace(500.0, 2000.0, NZ)
    height = np.broadcast_to(level[:, None, None], (NZ, NY, NX))
    content = np.where(cloud(height, 1500.0) > 5e-5, cloud(height, 1500.0), 0.0)
    km = " ".join(f"{z / 1e3:.4f}" for z in level)
    every = [(i, j, k) for i in range(NX) for j in range(NY) for k in range(NZ)]
    if kind == "shdom":
        lines = ["# a cloud", f"{NX} {NY} {NZ}", f"0.05 0.04 {km}"]
        lines += [f"{i} {j} {k} {1e3 * content[k, j, i]:.6f} 8.000" for i, j, k in every]
    else:
        lines = [
            "# a cloud",
            f"{NX},{NY},{NZ}   # nx,ny,nz",
            "0.05,0.04  # dx,dy [km]",
            km.replace(" ", ",") + "  # km",
            "i,j,k,lwc,reff",
        ]
        lines += [f"{i},{j},{k},{1e3 * content[k, j, i]:.6f},8.0" for i, j, k in every if content[k, j, i]]
    path.write_text("\n".join(lines) + "\n")
    extra = {"x": 50.0 * (np.arange(NX) - (NX - 1) / 2), "y": 40.0 * (np.arange(NY) - (NY - 1) / 2)}
    when = np.datetime64("2000-03-20T10:00", "ms")
    return Truth([path], height, {"liquid_content": content}, time=when, height_tolerance_m=0.1, extra=extra)


MAKERS: dict[str, Callable[[Path], Truth]] = {
    "ERA5 (old CDS)": lambda folder: era5(folder / "a.nc"),
    "ERA5 (new CDS)": lambda folder: era5(folder / "a.nc", new=True),
    "ERA5 over the date line": lambda folder: era5(folder / "a.nc", new=True, first_lon=179.0),
    "MERRA-2 model layers": lambda folder: merra2(folder / "a.nc4"),
    "MERRA-2 pressure levels": lambda folder: merra2(folder / "a.nc4", model_levels=False),
    "UM": lambda folder: um(folder / "a.nc"),
    "RAMS with header": lambda folder: rams(folder / "x-A-2024-06-21-120000-g1.h5"),
    "RAMS without header": lambda folder: rams(folder / "x-2024-06-21-g1.h5", header=False),
    "LAPS": laps,
    "COSP": lambda folder: cosp(folder / "a.nc"),
    "ecRad columns": lambda folder: ecrad(folder / "a.nc"),
    "MicroHH": lambda folder: les(folder / "a.nc", "microhh"),
    "PALM": lambda folder: les(folder / "a.nc", "palm"),
    "CM1": lambda folder: les(folder / "a.nc", "cm1"),
    "SHDOM text": lambda folder: les_text(folder / "a.txt", "shdom"),
    "AT3D text": lambda folder: les_text(folder / "a.txt", "at3d"),
}
