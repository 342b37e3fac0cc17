"""RAMS analysis files (HDF5, no attributes, nameless dimensions), with or without the -head.txt beside them."""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from openswim.arguments import written_number
from openswim.errors import UserError
from openswim.readers.common.base import Time
from openswim.readers.common.bounds import check_sizes
from openswim.readers.common.clock import start_of_undated
from openswim.readers.common.kept import first_bytes
from openswim.readers.domain.neighbourhood import Neighbourhood
from openswim.readers.fields.particles import Category, checked_content, known_sizes, together
from openswim.readers.gridded.reader import GriddedReader
from openswim.scene import Grid, Scene
from openswim.scene.grid import EARTH_RADIUS_M
from openswim.scene.labels.units import check_decimals
from openswim.scene.times import since_1970_s

F32 = NDArray[np.float32]
HEAT_CAPACITY = 1004.0  # J kg-1 K-1, as in RAMS
DRY_GAS_CONSTANT = 287.0
GRAVITY = 9.80
NEEDED = ("GLAT", "GLON", "TOPT", "THETA", "PI")
# Scene species: (mass, number) of the categories that make it.
SPECIES = {
    "liquid": (("RCP", "CCP"),),
    "ice": (("RPP", "CPP"),),
    "rain": (("RRP", "CRP"), ("RDP", "CDP")),
    "snow": (("RSP", "CSP"), ("RAP", "CAP")),
    "graupel": (("RGP", "CGP"), ("RHP", "CHP")),
}
# Aerosol mass mixing ratios, as the species of aerosol_species.py whose particles they are most like.
AEROSOL = {"MD1MP": "DU001", "MD2MP": "DU003", "CCCMP": "SO4", "GCCMP": "SS003", "SALT_FILM_MP": "SS002"}
AEROSOL |= {"SALT_JET_MP": "SS003", "SALT_SPUM_MP": "SS004", "ABC1MP": "OCPHILIC", "ABC2MP": "OCPHOBIC"}
_STAMP = re.compile(r"(\d{4})-(\d{2})-(\d{2})(?:-(\d{2})(\d{2})(\d{2}))?")
_ICE_CAP = 2.0  # LEAF class
_ROUNDING = 1e-3  # of shares in single precision


class RAMSReader(GriddedReader):
    """Reads RAMS 6 HDF5 files; give the header as a second file, or leave it beside the first."""

    name = "RAMS"

    def recognises(self, data: xr.Dataset) -> bool:
        return {"GLAT", "GLON", "TOPT"} <= set(data.variables) and not {"THETA", "THP", "PI"}.isdisjoint(data.variables)

    def detects(self, path: Path) -> bool:
        return is_header(path) or super().detects(path)

    def read_parts(
        self, paths: Sequence[Path], time: Time = None, around: Neighbourhood | None = None, member: int | None = None
    ) -> Scene:
        return super().read_parts(_without_headers(paths), time, around, member)

    def adapt(self, path: Path, data: xr.Dataset) -> xr.Dataset:
        """The file as CF: coordinates, names, units; heights and pressure from what RAMS keeps."""
        lacking = [name for name in NEEDED if name not in data.variables]
        if lacking:
            raise UserError(f"{path}: a RAMS file without {', '.join(lacking)}: every analysis file has them")
        check_sizes(path, data)
        if min(data["THETA"].shape, default=0) < 2:
            raise UserError(f"{path}: THETA has {' x '.join(map(str, data['THETA'].shape))} values: cut a wider part")
        y, x = (str(dim) for dim in data["GLAT"].dims)
        z = next(str(dim) for dim in data["THETA"].dims if dim not in (x, y))
        header = read_header(path)
        levels = slice(1, None)  # the first lies below the ground
        out: dict[str, Any] = {}
        notes: list[str] = []

        def field(name: str) -> F32:
            return np.asarray(data[name].transpose(z, y, x).values[levels], np.float32)

        def mass(name: str) -> F32:
            check_decimals(f"{path}: {name}", data[name].dtype.kind, "kg kg-1")
            return checked_content(name, field(name), "kg kg-1", notes)

        def number(name: str, content: F32) -> F32 | None:
            there = name in data.variables and bool(np.any(content > 0))
            return known_sizes(name, field(name), notes) if there else None

        terrain = np.asarray(data["TOPT"].transpose(y, x).values, np.float32)
        exner, theta = np.asarray(data["PI"].transpose(z, y, x).values, np.float64), data["THETA"].transpose(z, y, x)
        if not (exner > 0).all():
            raise UserError(f"{path}: PI is not positive everywhere: damaged file")
        vapour = np.asarray(data["RV"].transpose(z, y, x).values) if "RV" in data.variables else np.zeros(exner.shape)
        if header and "ztn" in header and len(header["ztn"]) == exner.shape[0]:
            ztn, top = np.array(header["ztn"]), header["zmn"][-2] if "zmn" in header else header["ztn"][-1]
            height = ztn[:, None, None] * (1 - terrain / top) + terrain
        else:
            height = _hydrostatic(exner, np.asarray(theta.values) * (1 + 0.608 * vapour), terrain)
            notes.append("no header (-head.txt) with the levels: heights from PI and THETA")
        pressure = 1e5 * (exner / HEAT_CAPACITY) ** (HEAT_CAPACITY / DRY_GAS_CONSTANT)
        dims = ("z", "y", "x")
        out["height"] = (dims, height[levels].astype(np.float32), {"units": "m", "standard_name": "altitude"})
        out["pressure"] = (dims, pressure[levels].astype(np.float32), {"units": "Pa"})
        out["temperature"] = (dims, (theta.values * exner / HEAT_CAPACITY)[levels].astype(np.float32), {"units": "K"})
        out["qv"] = (dims, (vapour / (1 + vapour))[levels].astype(np.float32), {"units": "kg kg-1"})
        wanted = ["RV", *(name for categories in SPECIES.values() for name, _ in categories)]
        lacking = [name for name in wanted if name not in data.variables]
        notes += [f"no {', '.join(lacking)} in the file: none of it"] if lacking else []
        for species, categories in SPECIES.items():
            there = [(mass, number) for mass, number in categories if mass in data.variables]
            if there:
                parts = [Category(content, number(n, content)) for content, n in ((mass(m), n) for m, n in there)]
                content, radius = together(species, parts)
                called = ", ".join(mass for mass, _ in there)
                said = {"units": "kg kg-1", "standard_name": f"{species}_mixing_ratio", "called": called}
                out[f"{species}_content"] = (dims, content, said)
                if radius is not None and radius.any():
                    out[f"{species}_effective_radius"] = (dims, radius, {"units": "m"})
        for name, species in AEROSOL.items():
            if name in data.variables and (found := field(name)).any():
                found = out[species][1] + found if species in out else found
                out[species] = (dims, found, {"units": "kg kg-1", "called": name})
        out |= _ground(path, data, terrain, (y, x))
        lat, lon = (np.asarray(data[name].transpose(y, x).values, np.float64) for name in ("GLAT", "GLON"))
        axes, mapping = _placed(path, lat, lon, header)
        out["crs"] = ((), 0, mapping)
        out["latitude"] = (("y", "x"), lat, {"units": "degrees_north", "standard_name": "latitude"})
        out["longitude"] = (("y", "x"), lon, {"units": "degrees_east", "standard_name": "longitude"})
        coords: dict[str, Any] = {
            name: (name, values, {"standard_name": f"projection_{name}_coordinate", "units": "m"})
            for name, values in zip(("x", "y"), axes, strict=True)
        }
        when, dated = _time(path, header, _mean_longitude(lon))
        if when is not None:
            said = {"units": "seconds since 1970-01-01", "standard_name": "time"}
            coords["time"] = ((), since_1970_s(when), said)
        attrs = {"title": "RAMS analysis", "openswim_notes": "\n".join(notes + dated)}
        return xr.Dataset(out, coords=coords, attrs=attrs)


def is_header(path: Path) -> bool:
    """Whether a file is a RAMS -head.txt: text with the level heights in it."""
    try:
        start = first_bytes(path)
    except OSError:
        return False
    return b"__ztn01" in start and b"\0" not in start


def read_header(path: Path) -> dict[str, list[float]]:
    """Numbers of a header beside a file, by name without "__" and grid number; empty where there is none."""
    grid = re.search(r"-g(\d+)$", path.stem)
    number = int(grid[1]) if grid else 1
    stem = path.stem.removesuffix(grid[0]) if grid else path.stem
    for name in (f"{stem}-head.txt", f"{path.stem}-head.txt"):
        beside = path.with_name(name)
        if beside.is_file() and is_header(beside):
            return _parsed(beside, number)
    return {}


def _parsed(path: Path, grid: int) -> dict[str, list[float]]:
    if path.stat().st_size > 50_000_000:
        raise UserError(f"{path}: a RAMS header of over 50 MB: damaged file")
    lines = path.read_text("ascii", "replace").splitlines()
    found: dict[str, list[float]] = {}
    for index, line in enumerate(lines):
        name = line.strip()
        if not name.startswith("__") or index + 1 >= len(lines):
            continue
        try:
            count = int(lines[index + 1])
            values = [written_number(text) for text in " ".join(lines[index + 2 : index + 2 + count]).split()]
        except ValueError:
            continue
        if len(values) < count:
            raise UserError(f"{path}: {name} lists {len(values)} of {count} values: truncated header")
        plain = name[2:]
        own = re.fullmatch(r"(ztn|zmn)(\d\d)", plain)
        if own is None:
            found[plain] = values
        elif int(own[2]) == grid:
            found[own[1]] = values
    return found


def _without_headers(paths: Sequence[Path]) -> list[Path]:
    files = [path for path in paths if not is_header(path)]
    if not files:
        raise UserError(f"{paths[0]}: a RAMS header without its data: give the .h5 file")
    return files


def _hydrostatic(exner: NDArray[Any], theta_v: NDArray[Any], terrain: F32) -> NDArray[Any]:
    """dz = -theta_v/g d(PI); the ground lies midway between the first two levels."""
    steps = 0.5 * (theta_v[1:] + theta_v[:-1]) * -np.diff(exner, axis=0) / GRAVITY
    rise = np.concatenate([-0.5 * steps[:1], 0.5 * steps[:1], 0.5 * steps[:1] + np.cumsum(steps[1:], axis=0)])
    return np.asarray(terrain + rise)


def _ground(path: Path, data: xr.Dataset, terrain: F32, dims: tuple[str, str]) -> dict[str, Any]:
    out: dict[str, Any] = {"surface_altitude": (("y", "x"), terrain, {"units": "m", "called": "TOPT"})}
    if "PATCH_AREA" in data.variables:  # the first patch is water
        patches = np.asarray(data["PATCH_AREA"].transpose(..., *dims).values, np.float32)
        whole = patches.sum(axis=0, dtype=np.float64)
        if not (np.abs(whole - 1.0) < _ROUNDING).all():
            raise UserError(
                f"{path}: PATCH_AREA, the shares of a cell's {len(patches)} patches, adds up to {whole.min():.3g} to "
                f"{whole.max():.3g}, not to 1: damaged file"
            )
        out["LAND"] = (("y", "x"), 1.0 - patches[0], {"units": "1", "called": "PATCH_AREA"})
        if "LEAF_CLASS" in data.variables:
            classes = np.rint(np.asarray(data["LEAF_CLASS"].transpose(..., *dims).values))
            ice = (patches * (classes == _ICE_CAP)).sum(axis=0)
            out["snowc"] = (("y", "x"), ice, {"units": "1", "called": "LEAF_CLASS"})
    return out


def _placed(
    path: Path, lat: NDArray[Any], lon: NDArray[Any], header: dict[str, list[float]]
) -> tuple[tuple[NDArray[Any], NDArray[Any]], dict[str, Any]]:
    """RAMS's polar stereographic plane, tangent at the header's pole or, without one, at the domain's centre."""
    from pyproj import CRS

    pole = [header.get(name, [None])[0] for name in ("polelat", "polelon")]
    if None in pole:
        pole = [float(lat.mean()), _mean_longitude(lon)]
    crs = CRS.from_proj4(f"+proj=stere +lat_0={pole[0]} +lon_0={pole[1]} +R={EARTH_RADIUS_M} +no_defs")
    probe = Grid(np.array([0.0, 1.0]), np.array([0.0, 1.0]), np.array([0.0, 1.0]), crs)
    x, y = probe.index(lon, lat)
    if not (np.isfinite(x).all() and np.isfinite(y).all() and min(x.shape) > 1):
        raise UserError(f"{path}: GLAT, GLON are no places on Earth: damaged file")
    ny, nx = x.shape
    columns, rows = x.mean(axis=0), y.mean(axis=1)
    x_axis, y_axis = np.linspace(columns[0], columns[-1], nx), np.linspace(rows[0], rows[-1], ny)
    off = np.hypot((x - x_axis) / abs(x_axis[1] - x_axis[0]), (y - y_axis[:, None]) / abs(y_axis[1] - y_axis[0])).max()
    rounding = 4e-6 * 111e3 / abs(y_axis[1] - y_axis[0])  # of float32 degrees
    if not off < 0.1 + rounding:
        raise UserError(
            f"{path}: GLAT, GLON lie {off:.2g} cells off a polar stereographic grid at {pole[0]:.2f}, {pole[1]:.2f}: "
            "put the header (-head.txt), which holds polelat and polelon, beside the file"
        )
    return (x_axis, y_axis), dict(crs.to_cf())


def _mean_longitude(lon: NDArray[Any]) -> float:
    """Of places that may lie on both sides of the date line."""
    return float(np.degrees(np.angle(np.exp(1j * np.radians(lon)).mean())))


def _time(path: Path, header: dict[str, list[float]], lon: float) -> tuple[np.datetime64 | None, list[str]]:
    names = ("iyear1", "imonth1", "idate1", "itime1", "time")
    if all(name in header for name in names):
        year, month, day, clock, seconds = (header[name][0] for name in names)
        start = np.datetime64(f"{int(year):04d}-{int(month):02d}-{int(day):02d}", "ms")
        minutes = 60 * (int(clock) // 100) + int(clock) % 100
        return start + np.timedelta64(round(1e3 * (60 * minutes + seconds)), "ms"), []
    found = _STAMP.search(path.stem)
    if found is None:
        return None, []
    day_text = "-".join(found.groups()[:3])
    try:
        if found[4] is not None:
            return np.datetime64(f"{day_text}T{found[4]}:{found[5]}:{found[6]}", "ms"), []
        at = start_of_undated(lon) - start_of_undated(lon).astype("datetime64[D]")
        return np.datetime64(day_text, "ms") + at, [f"no time of day in the file: {day_text} from its name, 10 h local"]
    except ValueError:
        return None, []

