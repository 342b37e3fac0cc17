"""Files of pictures from space: written as CF netCDF and as GeoTIFF (COG), read as ABI's netCDF and GeoTIFF."""

from __future__ import annotations

import re
import warnings
from collections.abc import Sequence
from math import prod
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from openswim.arguments import shown
from openswim.errors import UserError
from openswim.readers.common.opening import opened
from openswim.satellites.fixed_grid import FixedGrid
from openswim.scene.cf import save_netcdf
from openswim.scene.files import written_whole
from openswim.system.inputs import check_name, check_ordinary
from openswim.system.machine import free_memory
from openswim.system.rasters import open_raster

F64 = NDArray[np.float64]

_BYTES_PER_PIXEL = 150  # while their places are found
_MOST_MEMORY = 0.8  # share of what is free
_LEAN = 0.1  # pixels by which rows may lean over a whole picture
_UNITS = {"": 1.0, "1": 1.0, "%": 0.01, "percent": 0.01}  # of reflectance factors; else it is a radiance, or warmth
_BRIGHTEST = 2.0  # that one pixel in twenty of a picture may have; deep cloud below a high sun has 1.3
_QUALITY = "DQF"  # ABI's flags, which lie beside its pictures on the same grid
# 0 is good, 1 conditionally usable, 2 out of range, 3 no value, 4 of a focal plane that was too warm. What is out of
# range is plausible: in a picture of deep cloud below a high sun 9402 pixels up to 1.26, without a heap at the end
_USABLE = 2
_ONE_OF_SEVERAL = re.compile(r"CMI_(C\d\d)")  # of ABI's files of all bands


def write(picture: xr.Dataset, path: str | Path) -> Path:
    """A picture of `openswim.satellites.reflectance` as .nc (CF, which satpy and xarray read) or .tif (a
    cloud-optimised GeoTIFF of reflectance factors, one band each). In a folder it is a .nc of the name by which satpy
    knows it. Returns what was written."""
    target = Path(path)
    if target.is_dir():
        target = target / satpy_name(picture)
    if target.suffix.lower() == ".nc":
        save_netcdf(picture, target)
    elif target.suffix.lower() in (".tif", ".tiff"):
        _write_geotiff(picture, target)
    else:
        raise UserError(f"output {target}: suffix {target.suffix!r} is unknown; use .nc or .tif")
    return target


def satpy_name(picture: xr.Dataset) -> str:
    """IMAGER-START-END.nc: satpy's reader "satpy_cf_nc" takes files of no other names."""
    times = ("time_coverage_start", "time_coverage_end")
    stamps = ["".join(c for c in picture.attrs[name] if c.isdigit())[:14] for name in times]
    platform, sensor = picture.attrs["platform"].rsplit(" ", 1)
    return "-".join((platform.replace("-", ""), sensor, *stamps)) + ".nc"


def _write_geotiff(picture: xr.Dataset, target: Path) -> None:
    try:
        import rasterio
        from rasterio.io import MemoryFile
        from rasterio.shutil import copy
    except ImportError as error:
        raise UserError("GeoTIFF needs the package rasterio: pip install 'openswim[geotiff]'") from error
    grid = grid_of(picture)
    values = picture.reflectance_factor.values
    count, ny, nx = values.shape
    step = [(axis[-1] - axis[0]) / (axis.size - 1) * grid.height_m for axis in (grid.x, grid.y)]
    corner = [axis[0] * grid.height_m - 0.5 * one for axis, one in zip((grid.x, grid.y), step, strict=True)]
    profile = {
        "driver": "GTiff", "count": count, "height": ny, "width": nx, "dtype": "float32", "nodata": np.nan,
        "crs": _proj(grid), "transform": rasterio.Affine(step[0], 0, corner[0], 0, step[1], corner[1]),
    }  # fmt: skip
    with MemoryFile() as memory:
        with memory.open(**profile) as file:
            file.write(values)
            for number, name in enumerate(picture.band.values, 1):
                file.set_band_description(number, str(name))
            file.update_tags(**{k: str(v) for k, v in picture.attrs.items()}, AREA_OR_POINT="Area")
        with MemoryFile() as whole:  # GDAL itself does not hear of every full disk
            with memory.open() as file:
                copy(file, whole.name, driver="COG", compress="deflate")
            with written_whole(target) as partial:
                partial.write_bytes(whole.getbuffer())


def _proj(grid: FixedGrid) -> str:
    return (
        f"+proj=geos +lon_0={grid.lon_0} +h={grid.height_m} +a={grid.semi_major_m} +b={grid.semi_minor_m} "
        f"+sweep={grid.sweep} +units=m +no_defs"
    )


def grid_of(picture: xr.Dataset) -> FixedGrid:
    """The grid of a picture."""
    return FixedGrid.of_cf(picture.x.values, picture.y.values, picture.geostationary.attrs)


def middle_of(picture: xr.Dataset, lon_0: float) -> tuple[float, float]:
    """Mean latitude and longitude (degrees) of what a picture's pixels see; about the longitude below the satellite, as
    a picture may lie across the date line."""
    from_below = (picture.longitude.values - lon_0 + 180.0) % 360.0 - 180.0
    lon = lon_0 + float(np.nanmean(from_below))
    return float(np.nanmean(picture.latitude.values)), (lon + 180.0) % 360.0 - 180.0


def read(path: str | Path, bands: Sequence[str] = ()) -> xr.Dataset:
    """An observed picture: ``reflectance_factor`` on (y, x), and its grid, as `write` writes them. Attribute ``band``
    is the name of its band, "" where the file does not tell; ``pixels_left_out`` how many pixels became NaN since ABI's
    quality flags (DQF, in the netCDF file or as GeoTIFF beside that of CMI) call them bad.

    bands : of a file of several, the first of these that it has; else its first.

    Takes netCDF with a CF grid mapping "geostationary" and a reflectance factor (ABI L2 CMI and MCMI, our own), and
    GeoTIFF in the projection of a fixed grid whose values, with scale and offset applied, are reflectance factors.
    Units of values (1, %) and of axes (rad, microradian, m) are heeded; other units, flags and counts are refused.
    """
    source = Path(path)
    check_ordinary(source)
    check_name(source)
    take = _from_netcdf if source.suffix.lower() in (".nc", ".nc4") else _from_geotiff
    try:
        with warnings.catch_warnings(), np.errstate(all="ignore"):
            warnings.simplefilter("ignore")  # of what is refused in one line, or is no number then
            return take(source, bands)
    except UserError as error:
        raise UserError(str(error) if str(source) in str(error) else f"{source}: {error}") from None
    except Exception as error:  # whatever the back ends raise on damaged files
        raise UserError(f"{source}: no picture on a fixed grid of a geostationary imager ({error})") from error


def _from_netcdf(path: Path, bands: Sequence[str]) -> xr.Dataset:
    with opened(path, decode=False) as file:
        told, every = _names(path, file), [str(name) for name in file.data_vars if _ONE_OF_SEVERAL.fullmatch(str(name))]
        if name := next((one for one in ("reflectance_factor", "CMI") if one in file), None):
            at, values = _which(told, bands), file[name]
        elif every:
            told = [name.removeprefix("CMI_") for name in every]
            at = _which(told, bands)
            values = file[every[at]]
        else:
            raise UserError(f"{path}: no reflectance factor in it (reflectance_factor, CMI)")
        _check_size(path, values.shape)
        if "band" in values.dims:
            values = values.isel(band=at)
        values = values.squeeze([dim for dim in values.dims if dim not in ("y", "x") and values.sizes[dim] == 1])
        if set(values.dims) == {"y", "x"}:
            values = values.transpose("y", "x")
        factor = _in_ones(path, values.attrs.get("units"))
        mapping = file[str(values.attrs.get("grid_mapping", values.encoding.get("grid_mapping", "geostationary")))]
        height = float(mapping.attrs["perspective_point_height"])
        x, y = (_in_radians(path, file[axis], height) for axis in ("x", "y"))
        time = str(file.attrs.get("time_coverage_start", ""))
        found = values.values.astype(np.float32) * factor
        _check_bright(path, found)
        flags = next((file[name] for name in (f"{_QUALITY}_{told[at]}", _QUALITY) if name in file), None)
        if flags is not None:
            flags = flags.squeeze([dim for dim in flags.dims if flags.sizes[dim] == 1 and dim not in ("y", "x")])
            flags = flags.transpose(*values.dims) if set(flags.dims) == set(values.dims) else flags
        left_out = 0 if flags is None else _leave_out(path, found, flags.values)
        return _picture(found, FixedGrid.of_cf(x, y, mapping.attrs), time, told[at], left_out)


def _leave_out(path: Path, values: Any, flags: Any) -> int:
    """Make values NaN that the agency calls bad, as it does where there is no flag; how many of them were known."""
    if flags.shape != values.shape:
        raise UserError(f"{path}: {_QUALITY} has {shown(flags.shape)} pixels, its picture {shown(values.shape)}: give "
                        "the file as the agency has it, or one without flags")  # fmt: skip
    bad = ~(flags <= _USABLE)
    known = int(np.isfinite(values[bad]).sum())
    values[bad] = np.nan
    return known


def _in_radians(path: Path, axis: xr.DataArray, height_m: float) -> F64:
    """Scan angles: some programs, as CF has it, write them as lengths at the satellite's height."""
    unit = str(axis.attrs.get("units", "rad")).strip().lower()
    factors = {"m": 1 / height_m, "km": 1e3 / height_m, "rad": 1.0, "microrad": 1e-6}
    plain = re.sub(r"met(er|re)s?$", "m", unit).replace("kilom", "km")
    plain = re.sub(r"^(\N{MICRO SIGN}|u)rad", "microrad", re.sub(r"(rad)ians?$", r"\1", plain))
    if plain not in factors:
        raise UserError(f"{path}: {axis.name} is in {shown(unit)}: give scan angles in rad, or in m on the projection")
    return np.asarray(axis.values, float) * factors[plain]


def _in_ones(path: Path, unit: Any) -> np.float32:
    """What values in a unit are as reflectance factors."""
    plain = "" if unit is None else str(unit).strip().lower()
    if plain not in _UNITS:
        raise UserError(f"{path}: its values are in {shown(str(unit))}, and no reflectance factors: give a picture of "
                        "a band of sunlight")  # fmt: skip
    return np.float32(_UNITS[plain])


def _check_bright(path: Path, values: Any) -> None:
    """Raise UserError where values are too large to be reflectance factors."""
    known = values[np.isfinite(values)]
    most = float(np.percentile(known, 95)) if known.size else 0.0
    if most > _BRIGHTEST:
        raise UserError(f"{path}: a twentieth of its values lie above {most:.3g}, which no reflectance factors do: are "
                        "they counts without scale, per cent, or temperatures? Give reflectance factors")  # fmt: skip


def _check_size(path: Path, shape: tuple[int, ...]) -> None:
    """Raise UserError where a picture and its places would not fit into memory, however little of it is stored."""
    needed, free = prod(shape) * _BYTES_PER_PIXEL, free_memory()
    if needed > _MOST_MEMORY * free:
        sides = " x ".join(map(str, shape))
        raise UserError(f"{path}: {sides} pixels take {needed / 1e9:.1f} GB, {free / 1e9:.1f} GB are free: cut it out")


def _names(path: Path, file: xr.Dataset) -> list[str]:
    """Of a netCDF file's bands: our own names, ABI's number, or what the name of the file says."""
    if "band" in file.coords:
        return [str(name) for name in np.atleast_1d(file.band.values)]
    if "band_id" in file.variables:
        return [f"C{int(number):02d}" for number in np.atleast_1d(file.band_id.values)]
    return [_named(path.name)]


def _named(name: str) -> str:
    """The band that a name of an ABI file tells, such as OR_ABI-L2-CMIPC-M6C02_G16_..."""
    told = re.search(r"ABI-L\w+-\w+-M\d+(C\d\d)_G\d\d", name)
    return "" if told is None else told.group(1)


def _which(names: Sequence[str], bands: Sequence[str]) -> int:
    return next((names.index(name) for name in bands if name in names), 0)


def _from_geotiff(path: Path, bands: Sequence[str]) -> xr.Dataset:
    file = open_raster(path)
    from pyproj import CRS

    with file:
        mapping = {} if file.crs is None else CRS.from_wkt(file.crs.to_wkt()).to_cf()
        if mapping.get("grid_mapping_name") != "geostationary":
            raise UserError(f"{path}: its projection is not that of a geostationary imager (+proj=geos)")
        tags = file.tags()  # with the prefix as GDAL has it of a netCDF file, without as `write` does
        if any(file.descriptions):
            names = [each or "" for each in file.descriptions]
        else:
            names = [_named(path.name) or _named(tags.get("NC_GLOBAL#dataset_name", ""))] * file.count
        at = _which(names, bands)
        _check_size(path, file.shape)
        raw = file.read(at + 1, masked=True)
        about = file.tags(at + 1)
        if _QUALITY in (about.get("NETCDF_VARNAME"), path.stem.rsplit("_", 1)[-1]):
            raise UserError(f"{path}: holds flags of quality ({_QUALITY}), and no picture: give the CMI of it")
        factor = _in_ones(path, file.units[at] or about.get("units"))
        values = np.ma.filled((raw.astype(np.float32) * file.scales[at] + file.offsets[at]) * factor, np.nan)
        _check_bright(path, values)
        beside = path.with_name(f"{path.stem.removesuffix('_CMI')}_{_QUALITY}{path.suffix}")
        left_out = 0
        if path.stem.endswith("_CMI") and beside.exists():
            with open_raster(beside) as flags:
                left_out = _leave_out(path, values, np.ma.filled(flags.read(1, masked=True).astype(float), np.nan))
        height, transform = float(mapping["perspective_point_height"]), file.transform
        if max(abs(transform.b), abs(transform.d)) * max(file.shape) > _LEAN * min(abs(transform.a), abs(transform.e)):
            raise UserError(f"{path}: its rows are turned or sheared against the imager's: warp it upright (gdalwarp)")
        x = (transform.c + transform.a * (np.arange(file.width) + 0.5)) / height
        y = (transform.f + transform.e * (np.arange(file.height) + 0.5)) / height
        grid = FixedGrid.of_cf(x, y, mapping)
        time = tags.get("NC_GLOBAL#time_coverage_start") or tags.get("time_coverage_start", "")
        return _picture(values, grid, time, names[at], left_out)


def _picture(values: Any, grid: FixedGrid, time: str, band: str, left_out: int) -> xr.Dataset:
    lat, lon = grid.latlon()
    return xr.Dataset(
        {"reflectance_factor": (("y", "x"), values), "geostationary": ((), 0, grid.to_cf())},
        coords={"x": grid.x, "y": grid.y, "latitude": (("y", "x"), lat), "longitude": (("y", "x"), lon)},
        attrs={"time_coverage_start": time, "band": band, "pixels_left_out": left_out},
    )
