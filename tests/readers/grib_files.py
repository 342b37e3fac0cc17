"""Synthetic GRIB files with the keys, grids and packing of real products.

Where a point lies is ecCodes' word, not ours: fields are functions of latitude and longitude, evaluated on the points
that ecCodes' iterator gives for the message, in its order.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import pyproj  # noqa: F401 - before ecCodes, as in openswim.readers.grib.file

GAS, GRAVITY = 287.05, 9.80665
TEMPERATURE_K = 260.0
SCALE_M = GAS * TEMPERATURE_K / GRAVITY
SEA_PA = 101_325.0

Values = Callable[[np.ndarray, np.ndarray], Any]

# as in hrrr2d/hrrr_20260301t00z_MASSDEN_8m.grib2, but for the number of points
HRRR = {
    "gridType": "lambert", "shapeOfTheEarth": 6, "Nx": 31, "Ny": 23, "latitudeOfFirstGridPoint": 21138123,
    "longitudeOfFirstGridPoint": 237280472, "resolutionAndComponentFlags": 8, "LaD": 38500000, "LoV": 262500000,
    "Dx": 3000000, "Dy": 3000000, "projectionCentreFlag": 0, "scanningMode": 64, "Latin1": 38500000,
    "Latin2": 38500000, "latitudeOfSouthernPole": 0, "longitudeOfSouthernPole": 0,
}  # fmt: skip
RAP = HRRR | {
    "latitudeOfFirstGridPoint": 16281000, "longitudeOfFirstGridPoint": 233862000, "LaD": 25000000, "LoV": 265000000,
    "Dx": 13545087, "Dy": 13545087, "Latin1": 25000000, "Latin2": 25000000,
}  # fmt: skip


def latlon(west: float, south: float, east: float, north: float, nx: int, ny: int, **more: Any) -> dict[str, Any]:
    """From the north, as most centres list them."""
    return {
        "gridType": "regular_ll", "Ni": nx, "Nj": ny, "latitudeOfFirstGridPointInDegrees": north,
        "latitudeOfLastGridPointInDegrees": south, "longitudeOfFirstGridPointInDegrees": west,
        "longitudeOfLastGridPointInDegrees": east, "iDirectionIncrementInDegrees": ((east - west) % 360) / (nx - 1),
        "jDirectionIncrementInDegrees": (north - south) / (ny - 1), "jScansPositively": 0,
    } | more  # fmt: skip


GLOBAL = latlon(0.0, -90.0, 355.0, 90.0, 72, 37)
AROME = latlon(352.0, 37.5, 16.0, 55.5, 41, 31)
COSMO = latlon(355.0, -4.0, 1.0, 3.0, 31, 36, gridType="rotated_ll", latitudeOfSouthernPoleInDegrees=-43.0,
               longitudeOfSouthernPoleInDegrees=10.0, jScansPositively=1,
               latitudeOfFirstGridPointInDegrees=-4.0, latitudeOfLastGridPointInDegrees=3.0,
               resolutionAndComponentFlags=8)  # fmt: skip
GAUSSIAN = {
    "gridType": "regular_gg", "N": 16, "Ni": 64, "Nj": 32, "iDirectionIncrementInDegrees": 5.625,
    "latitudeOfFirstGridPointInDegrees": 85.76058712044382, "longitudeOfFirstGridPointInDegrees": 0.0,
    "latitudeOfLastGridPointInDegrees": -85.76058712044382, "longitudeOfLastGridPointInDegrees": 354.375,
    "jScansPositively": 0,
}  # fmt: skip
POLAR = {
    "gridType": "polar_stereographic", "shapeOfTheEarth": 6, "Nx": 25, "Ny": 21,
    "latitudeOfFirstGridPointInDegrees": 55.0, "longitudeOfFirstGridPointInDegrees": 200.0, "LaDInDegrees": 60.0,
    "orientationOfTheGridInDegrees": 249.0, "DxInMetres": 15000, "DyInMetres": 15000, "projectionCentreFlag": 0,
    "jScansPositively": 1, "resolutionAndComponentFlags": 8,
}  # fmt: skip


@dataclass
class Message:
    """One field. parameter: (discipline, category, number), or (table, number) for GRIB1.

    level: (type, value) of the first fixed surface (and of the second), or GRIB1's type and level.
    """

    parameter: tuple[int, ...]
    level: tuple[int, ...]
    values: Values
    keys: dict[str, Any] = field(default_factory=dict)
    missing: Values | None = None  # where this is true


@dataclass
class Product:
    """A file as a centre writes it."""

    grid: dict[str, Any]
    messages: list[Message]
    edition: int = 2
    centre: int = 7
    process: int = 83
    date: int = 20240621
    time: int = 1200
    packing: str = "grid_simple"
    bits: int = 24
    pv: Sequence[float] = ()


def encode(product: Product, one: Message) -> bytes:
    """The message's bytes. Tests write the same again and again: what it is made of decides, and is made once."""
    known = _key(product)
    if known not in _COMMON:
        _COMMON[known] = _common(product)
    common, lat, lon = _COMMON[known]
    values = np.broadcast_to(np.asarray(one.values(lat, lon), float), lat.shape).copy()
    if one.missing is not None:
        values[one.missing(lat, lon)] = _MISSING
    more = (product.packing, product.bits, tuple(product.pv), one.parameter, one.level, repr(one.keys))
    whole = (known, *more, one.missing is not None, values.tobytes())
    if whole not in _MADE:
        _MADE[whole] = _encoded(product, common, one, values)
    return _MADE[whole]


def _key(product: Product) -> tuple[Any, ...]:
    """What all messages of a product have in common."""
    return repr(product.grid), product.edition, product.centre, product.process, product.date, product.time


_MISSING = 1e30
_COMMON: dict[tuple[Any, ...], tuple[Any, np.ndarray, np.ndarray]] = {}
_MADE: dict[tuple[Any, ...], bytes] = {}


def _common(product: Product) -> tuple[Any, np.ndarray, np.ndarray]:
    """Handle of a message with what all of a product have in common, and where its values lie."""
    import eccodes as ec

    handle = ec.codes_grib_new_from_samples("GRIB2" if product.edition == 2 else "GRIB1")
    ec.codes_set(handle, "centre", product.centre)
    ec.codes_set(handle, "generatingProcessIdentifier", product.process)
    ec.codes_set(handle, "gridType", product.grid["gridType"])
    for name, value in product.grid.items():
        if name == "pl":
            ec.codes_set_array(handle, "pl", value)
        elif name != "gridType":
            ec.codes_set(handle, name, value)
    if product.edition == 2:
        sides = (product.grid.get(a, product.grid.get(b)) for a, b in (("Ni", "Nx"), ("Nj", "Ny")))
        count = sum(product.grid["pl"]) if "pl" in product.grid else math.prod(sides)
        ec.codes_set(handle, "numberOfDataPoints", count)
    ec.codes_set(handle, "dataDate", product.date)
    ec.codes_set(handle, "dataTime", product.time)
    lat, lon = points(handle)
    for place in (lat, lon):
        place.flags.writeable = False
    return handle, lat, lon


def _encoded(product: Product, common: Any, one: Message, values: np.ndarray) -> bytes:
    import eccodes as ec

    handle = ec.codes_clone(common)
    try:
        names: tuple[str, ...]
        if product.edition == 2:
            names = ("discipline", "parameterCategory", "parameterNumber")
            level = ("typeOfFirstFixedSurface", "scaledValueOfFirstFixedSurface", "typeOfSecondFixedSurface",
                     "scaledValueOfSecondFixedSurface")  # fmt: skip
        else:
            names, level = ("table2Version", "indicatorOfParameter"), ("indicatorOfTypeOfLevel", "level")
        for name, value in zip(names, one.parameter, strict=True):
            ec.codes_set(handle, name, value)
        if one.level[0] == 150:  # these carry a vertical grid's identity, which ecCodes adds by the level's name
            ec.codes_set(handle, "typeOfLevel", "generalVerticalLayer" if len(one.level) > 2 else "generalVertical")
        for name, value in zip(level, one.level, strict=False):
            ec.codes_set(handle, name, value)
            if name.startswith("scaledValue"):
                ec.codes_set(handle, name.replace("scaledValue", "scaleFactor"), 0)
        if len(product.pv):
            ec.codes_set(handle, "PVPresent", 1)
            ec.codes_set_array(handle, "pv", list(product.pv))
        for name, value in one.keys.items():
            ec.codes_set(handle, name, value)
        if one.missing is not None:
            ec.codes_set(handle, "bitmapPresent", 1)
            ec.codes_set(handle, "missingValue", _MISSING)
        ec.codes_set(handle, "packingType", product.packing)
        ec.codes_set(handle, "bitsPerValue", product.bits)
        ec.codes_set_values(handle, values)
        return bytes(ec.codes_get_message(handle))
    finally:
        ec.codes_release(handle)


def points(handle: Any) -> tuple[np.ndarray, np.ndarray]:
    """Latitudes and longitudes [degrees] of a message's values, by ecCodes."""
    import eccodes as ec

    return ec.codes_get_array(handle, "latitudes"), ec.codes_get_array(handle, "longitudes")


def points_of(message: bytes) -> tuple[np.ndarray, np.ndarray]:
    """The same, of the bytes of a message."""
    import eccodes as ec

    handle = ec.codes_new_from_message(message)
    try:
        return points(handle)
    finally:
        ec.codes_release(handle)


def write(path: Path, product: Product) -> Path:
    """Write a file; its messages one after another."""
    path.write_bytes(b"".join(encode(product, one) for one in product.messages))
    return path


# -- an isothermal atmosphere in which all answers are known ----------------------------------------------------------


def terrain_m(lat: np.ndarray, lon: np.ndarray) -> np.ndarray:
    return 300.0 + 200.0 * np.sin(np.radians(3 * lat)) + 100.0 * np.cos(np.radians(lon))


def pressure_at(height_m: np.ndarray) -> np.ndarray:
    """At geopotential heights."""
    return SEA_PA * np.exp(-np.asarray(height_m) / SCALE_M)


def height_at(pressure_pa: np.ndarray) -> np.ndarray:
    return SCALE_M * np.log(SEA_PA / np.asarray(pressure_pa))


def cloud(lat: np.ndarray, lon: np.ndarray) -> np.ndarray:
    """kg/kg; distinct everywhere, so that a turned or shifted field is found out."""
    return 1e-4 * (1.2 + np.sin(np.radians(2 * lat)) * np.cos(np.radians(lon)))


def hrrr(grid: dict[str, Any] = HRRR, levels: int = 12, **more: Any) -> Product:
    """HRRR's native levels: PRES, HGT, TMP, SPFH, CLMR, CIMIXR, RWMR, SNMR, GRLE, MASSDEN; from the ground up."""
    native: list[Message] = []
    for k in range(1, levels + 1):
        above = 20.0 + 15_000.0 * ((k - 1) / (levels - 1)) ** 1.6

        def height(lat: Any, lon: Any, above: float = above) -> Any:
            return terrain_m(lat, lon) + above

        at = (105, k)
        native += [
            Message((0, 3, 0), at, lambda lat, lon, h=height: pressure_at(h(lat, lon))),
            Message((0, 3, 5), at, height),
            Message((0, 0, 0), at, lambda lat, lon: TEMPERATURE_K),
            Message((0, 1, 0), at, lambda lat, lon: 0.0),
            Message((0, 1, 22), at, lambda lat, lon, k=k: cloud(lat, lon) * (k % 3)),
            Message((0, 1, 82), at, lambda lat, lon, k=k: 0.1 * cloud(lat, lon) * (k > 6)),
            Message((0, 1, 24), at, lambda lat, lon: 2e-5),
            Message((0, 1, 25), at, lambda lat, lon: 3e-5),
            Message((0, 1, 32), at, lambda lat, lon: 4e-5),
            Message((0, 6, 28), at, lambda lat, lon: 1e8),
            Message((0, 20, 0), at, lambda lat, lon, k=k: 1e-8 / k),
        ]
    ground = [
        Message((0, 3, 5), (1, 0), terrain_m),
        Message((2, 0, 0), (1, 0), lambda lat, lon: lon < 260.0),
        Message((0, 1, 42), (1, 0), lambda lat, lon: 25.0),
        Message((0, 2, 2), (103, 10), lambda lat, lon: 3.0),
        Message((0, 2, 3), (103, 10), lambda lat, lon: 4.0),
    ]
    return Product(grid, native + ground, **({"packing": "grid_complex_spatial_differencing"} | more))


def on_pressure(
    grid: dict[str, Any], levels: Sequence[int] = (100, 200, 300, 400, 500, 600, 700, 800, 850, 900, 950, 1000),
    cloud_levels: Sequence[int] | None = None, **more: Any,
) -> Product:  # fmt: skip
    """GFS of before 2019: HGT, TMP, RH and one condensate on isobaric levels (hPa), listed from the top."""
    messages = []
    for hpa in levels:
        at = (100, 100 * hpa) if more.get("edition", 2) == 2 else (100, hpa)
        codes = ((0, 3, 5), (0, 0, 0), (0, 1, 1), (0, 1, 22))
        if more.get("edition", 2) == 1:
            codes = ((2, 7), (2, 11), (2, 52), (2, 153))
        messages += [
            Message(codes[0], at, lambda lat, lon, p=100.0 * hpa: height_at(p)),
            Message(codes[1], at, lambda lat, lon: TEMPERATURE_K),
            Message(codes[2], at, lambda lat, lon: 0.0),
        ]
        if cloud_levels is None or hpa in cloud_levels:
            messages.append(Message(codes[3], at, lambda lat, lon, p=hpa: cloud(lat, lon) * (p / 1000)))
    surface = (((0, 3, 5), (1, 0)), ((2, 0, 0), (1, 0)))
    if more.get("edition", 2) == 1:
        surface = (((2, 7), (1, 0)), ((2, 81), (1, 0)))
    messages.append(Message(*surface[0], terrain_m))
    messages.append(Message(*surface[1], lambda lat, lon: lat > 0))
    return Product(grid, messages, **({"process": 96} | more))


def half_levels(count: int) -> tuple[np.ndarray, np.ndarray]:
    """A and B of a hybrid coordinate numbered from the top, from 0 Pa to the surface."""
    eta = np.linspace(0.0, 1.0, count + 1)
    b = eta**2
    return 6e4 * (eta - b) * (eta < 1), b


def ifs(grid: dict[str, Any], levels: int = 60, **more: Any) -> Product:
    """IFS model levels: t, q, clwc, ciwc, cc with A and B in the messages; lnsp and z on model level 1."""
    a, b = half_levels(levels)
    one = more.get("edition", 2) == 1
    kind = 109 if one else 105
    codes = dict(t=(128, 130), q=(128, 133), clwc=(128, 246), ciwc=(128, 247), cc=(128, 248), z=(128, 129),
                 lnsp=(128, 152), lsm=(128, 172), al=(128, 174)) if one else dict(
        t=(0, 0, 0), q=(0, 1, 0), clwc=(0, 1, 83), ciwc=(0, 1, 84), cc=(0, 6, 32), z=(0, 3, 4),
        lnsp=(0, 3, 25), lsm=(2, 0, 0), al=(192, 128, 174))  # fmt: skip
    messages = []
    for k in range(1, levels + 1):
        at = (kind, k)
        messages += [
            Message(codes["t"], at, lambda lat, lon: TEMPERATURE_K),
            Message(codes["q"], at, lambda lat, lon: 0.0),
            Message(codes["clwc"], at, lambda lat, lon, k=k: cloud(lat, lon) * (k > levels // 2)),
            Message(codes["ciwc"], at, lambda lat, lon, k=k: 0.2 * cloud(lat, lon) * (k <= levels // 2)),
            Message(codes["cc"], at, lambda lat, lon: 0.5),
        ]
    messages += [
        Message(codes["lnsp"], (kind, 1), lambda lat, lon: np.log(pressure_at(terrain_m(lat, lon)))),
        Message(codes["z"], (kind, 1), lambda lat, lon: GRAVITY * terrain_m(lat, lon)),
        Message(codes["lsm"], (1, 0), lambda lat, lon: lat > 0),
    ]
    return Product(grid, messages, **({"centre": 98, "process": 148, "pv": [*a, *b]} | more))


def icon(grid: dict[str, Any], levels: int = 10, **more: Any) -> Product:
    """ICON (regridded) or COSMO: P, T, QV, QC, QI, CLC on layers numbered from the top, HHL on their interfaces."""

    def interface(k: int) -> Values:
        return lambda lat, lon: terrain_m(lat, lon) + 20_000.0 * (1 - (k - 1) / levels)

    def pressure(k: int) -> Values:
        return lambda lat, lon: pressure_at(0.5 * (interface(k)(lat, lon) + interface(k + 1)(lat, lon)))

    messages = []
    for k in range(1, levels + 1):
        at = (150, k, 150, k + 1)
        messages += [
            Message((0, 3, 0), at, pressure(k)),
            Message((0, 0, 0), at, lambda lat, lon: TEMPERATURE_K),
            Message((0, 1, 0), at, lambda lat, lon: 0.0),
            Message((0, 1, 22), at, lambda lat, lon, k=k: cloud(lat, lon) * (k > 5)),
            Message((0, 1, 82), at, lambda lat, lon, k=k: 0.3 * cloud(lat, lon) * (k <= 5)),
            Message((0, 6, 22), at, lambda lat, lon: 40.0),
        ]
    messages += [Message((0, 3, 6), (150, k), interface(k)) for k in range(1, levels + 2)]
    messages += [
        Message((0, 3, 6), (1, 0), terrain_m),
        Message((0, 2, 2), (103, 10), lambda lat, lon: 3.0),
        Message((0, 2, 3), (103, 10), lambda lat, lon: 4.0),
    ]
    return Product(grid, messages, **({"centre": 78, "process": 1} | more))


def arome(grid: dict[str, Any] = AROME, **more: Any) -> Product:
    """AROME on heights above the ground: t, r, clwc, ciwc, cc; pressure at the surface only."""
    messages = []
    for above in (20, 100, 250, 500, 1000, 1500, 2000, 3000):
        at = (103, above)
        messages += [
            Message((0, 0, 0), at, lambda lat, lon: TEMPERATURE_K),
            Message((0, 1, 1), at, lambda lat, lon: 0.0),
            Message((0, 1, 83), at, lambda lat, lon, z=above: cloud(lat, lon) * (z > 400)),
            Message((0, 1, 84), at, lambda lat, lon: 0.0),
        ]
    messages += [
        Message((0, 3, 5), (1, 0), terrain_m),
        Message((0, 3, 0), (1, 0), lambda lat, lon: pressure_at(terrain_m(lat, lon))),
        Message((0, 2, 2), (103, 10), lambda lat, lon: 3.0),
        Message((0, 2, 3), (103, 10), lambda lat, lon: 4.0),
    ]
    return Product(grid, messages, **({"centre": 85, "process": 204} | more))
