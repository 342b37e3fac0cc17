"""The scene: one labelled, validated description of the world that light travels through."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from copy import copy
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
import xarray as xr
from numpy.typing import ArrayLike, NDArray

from openswim.arguments import check_kind, number, numbers, shown, takes
from openswim.errors import UserError, one_line
from openswim.scene.aerosol import DEFAULT_AEROSOL
from openswim.scene.atmosphere import Atmosphere
from openswim.scene.checks import WAVELENGTH_DIM, checked_dataset, fill_below_ground
from openswim.scene.grid import EARTH_RADIUS_M, Grid
from openswim.scene.ground import Ground
from openswim.scene.labels.dimensions import ordered
from openswim.scene.labels.places import Axis, aligned, falls, upward
from openswim.scene.labels.units import STATE, canonical, converted, in_units
from openswim.scene.oddities.values import odd_time
from openswim.scene.optics import Optics
from openswim.scene.phase import HenyeyGreenstein, PhaseFunction
from openswim.scene.plausible import check_plausible
from openswim.scene.times import parse_time
from openswim.scene.variables import DIRECT_PREFIX, LEVEL_DIMS, SURFACE_DIMS, species_of, variable

if TYPE_CHECKING:
    from pyproj import CRS


DEFAULT_WAVELENGTH_NM = (615.0, 546.0, 450.0)
DEFAULT_ALBEDO = 0.15


@dataclass
class Scene:
    """Grid, fields, gas and aerosol background, place and time.

    grid : where the fields live; None for a clear sky without any field on levels.
    data : fields named as in docs/scene-format.md, float32 in SI units, dimensions (z, y, x) or (y, x).
    atmosphere : gas and aerosol background on 0..100 km; None for no gas at all.
    optics : properties of the species given as extinction_<name> (required), and of "aerosol" (optional).
    time : valid time, UTC, to the millisecond; None where unknown.
    source : where the fields come from; notes : what was assumed or repaired.
    ground : the user's own maps of albedo and height, which come before the scene's fields.
    wider : a scene on a wider, coarser grid, seen where this one's ends (not by solver "reference"; not saved with it).
    cut : whether the grid is a part of a domain that goes on.
    drift_m : how far its clouds have travelled to the east and north; detail below the grid, which is invented, has
        come with them (`openswim.films.Weather` sets it; not saved with the scene).
    """

    grid: Grid | None
    data: xr.Dataset
    atmosphere: Atmosphere | None = None
    optics: dict[str, Optics] = field(default_factory=dict)
    time: np.datetime64 | None = None
    source: str = ""
    notes: list[str] = field(default_factory=list)
    ground: Ground | None = None
    wider: Scene | None = None
    cut: bool = False
    drift_m: tuple[float, float] = (0.0, 0.0)

    def __post_init__(self) -> None:
        kinds: dict[str, tuple[Any, str]] = {
            "grid": ((Grid, type(None)), "give a Grid, or None for a clear sky"),
            "data": (xr.Dataset, "give an xarray.Dataset of the scene's fields"),
            "atmosphere": ((Atmosphere, type(None)), "give an Atmosphere, such as Atmosphere.us_standard(), or None"),
            "optics": (Mapping, "give {name of a species: Optics(...)}"),
            "source": (str, "give text"),
            "notes": ((list, tuple), "give a list of lines"),
            "wider": ((Scene, type(None)), "give a Scene on a wider grid, or None"),
        }
        for name, (kind, remedy) in kinds.items():
            check_kind(f"scene: {name}", getattr(self, name), kind, remedy)
        for note in self.notes:
            check_kind("scene: a note", note, str, "give text")
        if self.wider is not None:
            _check_wider(self.grid, self.wider.grid)
        self.data, repairs = checked_dataset(self.data, self.grid)
        told: list[str] = []
        self.time = parse_time(self.time, told)
        odd = check_plausible(self.data, self.grid) + told + odd_time(self.time)
        self.notes = list(dict.fromkeys(one_line(" ".join(note.split())) for note in [*self.notes, *repairs, *odd]))
        self.source = one_line(" ".join(self.source.split()))
        direct = [
            str(name).removeprefix(DIRECT_PREFIX) for name in self.data.data_vars if str(name).startswith(DIRECT_PREFIX)
        ]
        for name in direct:
            if name not in self.optics:
                raise UserError(f"scene: {DIRECT_PREFIX}{name} needs optics={{'{name}': Optics(...)}}")
        for name in self.optics:
            if name not in direct and name != "aerosol":
                raise UserError(f"scene: optics are given for {name}, but there is no field {DIRECT_PREFIX}{name}")

    def __repr__(self) -> str:
        """One line: where from, when, how large, what is in it."""
        size = "no grid"
        if self.grid is not None:
            dx, dy = (f"{step:.0f}" for step in self.grid.spacing_m())
            size = "{2} x {1} x {0} nodes, cells of {dx} x {dy} m".format(*self.grid.shape, dx=dx, dy=dy)
        parts = [self.source or "arrays", str(self.time or "no time"), size, ", ".join(self.species) or "clear sky"]
        parts += [f"in {len(self.levels) - 1} wider"] * (self.wider is not None) + [f"{len(self.notes)} notes"]
        return f"<Scene: {'; '.join(parts)}>"

    @property
    def levels(self) -> list[Scene]:
        """This scene and the wider ones around it."""
        return [self] if self.wider is None else [self, *self.wider.levels]

    def alone(self) -> Scene:
        """This scene without the wider ones around it."""
        if self.wider is None:
            return self
        out = copy(self)
        out.wider = None
        return out

    @property
    def species(self) -> list[str]:
        """Names of the species present: hydrometeors, "aerosol", then those given as extinction_<name>."""
        return species_of([str(name) for name in self.data.data_vars])

    @property
    def place(self) -> tuple[float, float]:
        """(latitude, longitude) [degrees] of the centre of the domain, or the scene's given place."""
        if self.grid is not None and self.grid.curved:
            lon, lat = self.grid.lonlat(*self.grid.centre_index)
            return float(lat), float(lon)
        if "latitude" in self.data.coords and "longitude" in self.data.coords:
            return float(self.data.coords["latitude"]), float(self.data.coords["longitude"])
        raise UserError(
            "a flat scene without a place: give it latitude and longitude (docs/scene-format.md, Scene.from_arrays) "
            "(or the sun's azimuth and altitude: sun=..., --sun)"
        )

    @property
    def earth_radius_m(self) -> float:
        """Radius of the sphere the scene lies on [m]."""
        return EARTH_RADIUS_M if self.grid is None else self.grid.earth_radius_m

    @classmethod
    @takes
    def from_arrays(
        cls,
        extinction_per_m: ArrayLike | Mapping[str, ArrayLike] | None,
        x_m: ArrayLike,
        y_m: ArrayLike,
        z_m: ArrayLike,
        *,
        single_scattering_albedo: float | ArrayLike | Mapping[str, Any] = 1.0,
        phase: PhaseFunction | Mapping[Any, Any] | None = None,
        kind: str | Mapping[str, str] = "other",
        periodic: bool = False,
        atmosphere: Atmosphere | Literal["default"] | None = "default",
        surface_albedo: ArrayLike | None = None,
        wavelength_nm: ArrayLike | None = None,
        terrain_m: ArrayLike | None = None,
        crs: CRS | str | None = None,
        earth_radius_m: float = EARTH_RADIUS_M,
        place: tuple[float, float] | None = None,
        time: np.datetime64 | None = None,
        fields: Mapping[str, ArrayLike] | None = None,
        source: str = "arrays",
    ) -> Scene:
        """A scene from plain arrays.

        extinction_per_m : (nz, ny, nx) extinction [m-1] at nodes, trilinear between them; or a dict of such
            arrays by species name (None for none). A bare array is the species "cloud". DataArrays, here
            and below, may have their dimensions z, y, x in any order, and are converted from the units that they say.
            Where their coordinates are the nodes in another order, values are put where they belong; other places
            than the nodes are refused.
        x_m, y_m, z_m : node coordinates [m] (x_m and y_m in the units of `crs` where one is given);
            z_m is (nz,) or (nz, ny, nx). Where one of the first three falls, as latitudes from the north or levels from
            the top do, it is turned over, with all that is given on it.
        single_scattering_albedo, phase, kind : for all species, or dicts by name. Default phase: HG, g = .85.
        atmosphere : gas and aerosol; None for none. By default the US standard atmosphere where a `crs` is given, as
            for the same fields in a file, and none in flat scenes.
        surface_albedo : scalar, (ny, nx), or (ny, nx, nwl) at wavelength_nm (default 615, 546, 450 nm). By default
            that of the ground map where a `crs` is given, and black in flat scenes.
        terrain_m : (ny, nx) height of the ground above sea level. By default that of the ground map where a `crs` is
            given, and sea level (z = 0) in flat scenes.
        place : (latitude, longitude) [degrees] of a flat scene, for the sun's position.
        fields : further variables of docs/scene-format.md, e.g. {"liquid_content": (nz, ny, nx)}.
        """
        projection = _projection(crs)
        x, y = (_across(name, values, projection) for name, values in (("x_m", x_m), ("y_m", y_m)))
        unit = "degrees" if projection is not None and projection.is_geographic else "m"
        axes: dict[str, Axis] = {"x": (x, unit), "y": (y, unit)}
        if getattr(z_m, "ndim", 1) == 3:  # Grid keeps float32 as it is, and this is the caller's
            z = np.array(_in_units("z_m", z_m, LEVEL_DIMS, "m", axes), np.float32, order="C")
        else:
            axes["z"] = (_in_units("z_m", z_m, ("z",), "m"), "m")
            z = upward(axes["z"][0])
        grid = Grid(upward(x), upward(y), z, projection, earth_radius_m, periodic)
        extinction_per_m = {} if extinction_per_m is None else extinction_per_m
        extinctions = extinction_per_m if isinstance(extinction_per_m, Mapping) else {"cloud": extinction_per_m}
        optics = {
            str(name): Optics(
                _for_species(single_scattering_albedo, name),
                _for_species(phase, name) or HenyeyGreenstein(0.85),
                _for_species(kind, name),
            )
            for name in extinctions
        }
        fields = {} if fields is None else fields
        check_kind("scene: fields", fields, Mapping, "give {name of docs/scene-format.md: array}")
        arrays = {f"{DIRECT_PREFIX}{name}": values for name, values in extinctions.items()} | dict(fields)
        if terrain_m is not None:
            arrays["surface_altitude"] = terrain_m
        told: list[str] = []
        data = _fields(arrays, grid, axes, told)
        notes = _taken(grid, data, atmosphere, surface_albedo) + told
        if atmosphere == "default":
            atmosphere = Atmosphere.us_standard() if grid.curved else None
        if surface_albedo is None and not grid.curved and "surface_albedo" not in data:
            surface_albedo = 0.0
        if surface_albedo is not None:
            data["surface_albedo"] = _albedo(surface_albedo, grid, axes | _spectral_axis(wavelength_nm))
        data = _with_wavelengths(data, wavelength_nm)
        if place is not None:
            data = data.assign_coords(dict(zip(("latitude", "longitude"), _checked_place(place), strict=True)))
        return cls(grid, data, atmosphere, optics, time, source, notes)

    @classmethod
    @takes
    def clear(
        cls,
        lat: float,
        lon: float,
        atmosphere: Atmosphere | Literal["default"] | None = "default",
        surface_albedo: ArrayLike = DEFAULT_ALBEDO,
        terrain_m: float = 0.0,
        wavelength_nm: ArrayLike | None = None,
        time: np.datetime64 | None = None,
        water_vapour_cm: float | None = None,
    ) -> Scene:
        """A cloudless sky over level ground at a place [degrees], without a grid.

        surface_albedo : scalar, or (nwl,) at wavelength_nm (default 615, 546, 450 nm).
        terrain_m : height of the ground above sea level, everywhere. Default atmosphere: US standard.
        water_vapour_cm : precipitable water above the ground, of broadband irradiance and of the near infrared.
            Default: that of the US standard.
        """
        lat, lon = _checked_place((lat, lon))
        albedo = _in_units(
            "surface_albedo", surface_albedo, (WAVELENGTH_DIM,), "1", _spectral_axis(wavelength_nm)
        ).astype(np.float32)
        if albedo.ndim > 1:
            raise UserError(f"scene: surface_albedo has shape {albedo.shape}; it must be a number or (wavelengths)")
        data = xr.Dataset(
            {
                "surface_albedo": ((WAVELENGTH_DIM,) if albedo.ndim else (), albedo),
                "surface_altitude": ((), np.float32(_in_units("terrain_m", terrain_m, (), "m"))),
            }
        )
        if water_vapour_cm is not None:
            data["precipitable_water"] = ((), np.float32(10.0 * number("scene: water_vapour_cm", water_vapour_cm)))
        data = _with_wavelengths(data, wavelength_nm).assign_coords(latitude=float(lat), longitude=float(lon))
        background = Atmosphere.us_standard() if isinstance(atmosphere, str) and atmosphere == "default" else atmosphere
        return cls(None, data, background, time=time, source="clear sky")

    def to_dataset(self) -> xr.Dataset:
        """The scene as it stands in a file (docs/scene-format.md)."""
        from openswim.scene.cf import in_layout

        history = {"source": self.source, "assumptions": "\n".join(self.notes)}
        return in_layout(self.data, self.grid, self.optics, self.atmosphere, self.time, history)

    def to_netcdf(self, path: str | os.PathLike[str]) -> None:
        """Save as CF netCDF (docs/scene-format.md); `openswim.open_scene` reads it back."""
        from openswim.scene.cf import save_netcdf

        save_netcdf(self.to_dataset(), path)

    def to_zarr(self, path: str | os.PathLike[str]) -> None:
        """Save as a Zarr folder (docs/scene-format.md); `openswim.open_scene` reads it back."""
        from openswim.scene.cf import save_zarr

        save_zarr(self.to_dataset(), path)


def _taken(grid: Grid, data: xr.Dataset, atmosphere: Any, surface_albedo: Any) -> list[str]:
    """What stands in for what a curved scene of arrays is not told."""
    if not grid.curved:
        return []
    ground = {
        "surface albedo": surface_albedo is not None or "surface_albedo" in data,
        "terrain height": "surface_altitude" in data,
        "land and water": "land_area_fraction" in data,
    }
    absent = [what for what, given in ground.items() if not given]
    notes = [f"not given: {', '.join(absent)}: of the ground map"] if absent else []
    air = f"gas and aerosol background: US standard atmosphere with {DEFAULT_AEROSOL}"
    return [*notes, air] if isinstance(atmosphere, str) else notes


def _check_wider(grid: Grid | None, wider: Grid | None) -> None:
    """Grids on the same Earth, or none lies in the other."""
    if grid is None or wider is None or not (grid.curved and wider.curved):
        raise UserError("scene: only a grid with a place on Earth (crs) can lie in a wider one with a place on Earth")
    if abs(grid.earth_radius_m - wider.earth_radius_m) > 1.0:
        raise UserError(
            f"scene: its Earth has a radius of {grid.earth_radius_m:.0f} m, that of the wider scene "
            f"{wider.earth_radius_m:.0f} m: give both the same"
        )


def _projection(crs: CRS | str | None) -> CRS | None:
    from pyproj import CRS as Projection
    from pyproj.exceptions import CRSError

    try:
        return None if crs is None else Projection.from_user_input(crs)
    except (CRSError, TypeError, ValueError) as error:  # of what is neither text nor a number
        raise UserError(f"crs = {shown(crs)} is no projection: give a pyproj.CRS, or text such as EPSG:4326") from error


def _checked_place(place: tuple[float, float]) -> tuple[float, float]:
    try:
        lat, lon = (float(angle) for angle in place)
    except (TypeError, ValueError, OverflowError):
        lat = lon = np.nan
    if not (-90.0 <= lat <= 90.0 and -360.0 <= lon <= 360.0):
        raise UserError(f"scene: {shown(place)} is no place on Earth: give latitude and longitude in degrees")
    return lat, lon


def _for_species(value: Any, name: str) -> Any:
    by_species = isinstance(value, Mapping) and all(isinstance(key, str) for key in value)
    if not by_species:  # one for all; a phase function may itself be a mapping by wavelength
        return value
    if name not in value:
        raise UserError(f"scene: nothing is given for species {name} among {', '.join(map(str, value))}")
    return value[name]


def _across(name: str, values: Any, projection: CRS | None) -> NDArray[Any]:
    """An axis x_m or y_m: metres, or degrees where those of the projection are."""
    array = _labelled(name, values, name[:1])
    angles = projection is not None and projection.is_geographic
    if not angles and canonical(str(array.attrs.get("units"))) == "degrees":
        raise UserError(f'scene: {name} is in degrees: give crs="EPSG:4326" for longitude and latitude, or metres')
    return converted(f"scene: {name}", array, "degrees" if angles else "m")


def _fields(arrays: Mapping[str, Any], grid: Grid, axes: Mapping[str, Axis], notes: list[str]) -> xr.Dataset:
    """Arrays by name of a variable, in its units and its order of dimensions."""
    given: dict[str, NDArray[Any]] = {}
    fields: dict[str, xr.DataArray] = {}
    for name in sorted(arrays, key=lambda name: name not in STATE):  # mixing ratios need pressure and temperature
        spec = variable(name)
        array = _labelled(name, arrays[name], spec.dims, axes)
        shape = grid.shape[3 - len(spec.dims) :]
        if array.shape != shape:
            raise UserError(f"scene: {name} has shape {array.shape}; on this grid ({', '.join(spec.dims)}) is {shape}")
        given[name] = array.values
        fields[name] = in_units(name, array, spec.units, fields, notes)
    fill_below_ground(fields, grid, notes)
    return xr.Dataset({name: (field.dims, _own(field.values, given[name])) for name, field in fields.items()})


def _labelled(name: str, values: Any, dims: Sequence[str], axes: Mapping[str, Axis] | None = None) -> xr.DataArray:
    """Numbers with these dimensions, in the rising order of the axes, and with the units that they say; nothing else of
    what they are labelled with."""
    what, axes = f"scene: {name}", axes or {}
    array = numbers(what, aligned(what, ordered(what, values, dims), dims, axes))
    if array.ndim == len(dims):
        falling = [n for n, dim in enumerate(dims) if dim in LEVEL_DIMS and dim in axes and falls(axes[dim][0])]
        array = np.flip(array, tuple(falling))
    said = values.attrs if isinstance(values, xr.DataArray) else {}
    names = dims if array.ndim == len(dims) else [f"axis {number}" for number in range(array.ndim)]
    return xr.DataArray(array, dims=names, attrs={"units": said["units"]} if "units" in said else {})


def _own(values: NDArray[Any], given: NDArray[Any]) -> NDArray[np.float32]:
    """Values as a scene keeps them, in memory that is not the caller's; what was converted is no longer there."""
    return values.astype(np.float32, order="C", copy=np.may_share_memory(values, given))


def _in_units(
    name: str, values: Any, dims: Sequence[str], units: str, axes: Mapping[str, Axis] | None = None
) -> NDArray[Any]:
    """Numbers in the units that a scene has them in."""
    return converted(f"scene: {name}", _labelled(name, values, dims, axes), units)


def _albedo(
    surface_albedo: ArrayLike, grid: Grid, axes: Mapping[str, Axis]
) -> tuple[tuple[str, ...], NDArray[np.float32]]:
    dims = (*SURFACE_DIMS, WAVELENGTH_DIM) if getattr(surface_albedo, "ndim", 2) == 3 else SURFACE_DIMS
    albedo = _in_units("surface_albedo", surface_albedo, dims, "1", axes).astype(np.float32)
    if albedo.ndim == 0:
        albedo = np.full(grid.shape[1:], albedo)
    if albedo.ndim not in (2, 3) or albedo.shape[:2] != grid.shape[1:]:
        ny, nx = grid.shape[1:]
        raise UserError(
            f"scene: surface_albedo has shape {albedo.shape}; it must be a number, ({ny}, {nx}) or "
            f"({ny}, {nx}, wavelengths)"
        )
    return SURFACE_DIMS + (WAVELENGTH_DIM,) * (albedo.ndim - 2), albedo


def _with_wavelengths(data: xr.Dataset, wavelength_nm: ArrayLike | None) -> xr.Dataset:
    if WAVELENGTH_DIM not in data.dims:
        return data
    wavelengths = _wavelengths(wavelength_nm)
    if wavelengths.shape != (data.sizes[WAVELENGTH_DIM],):
        raise UserError(
            f"scene: surface_albedo has {data.sizes[WAVELENGTH_DIM]} wavelengths; wavelength_nm lists "
            f"{wavelengths.size}"
        )
    return data.assign_coords({WAVELENGTH_DIM: wavelengths})


def _wavelengths(wavelength_nm: ArrayLike | None) -> NDArray[np.float64]:
    given = DEFAULT_WAVELENGTH_NM if wavelength_nm is None else wavelength_nm
    return _in_units("wavelength_nm", given, (WAVELENGTH_DIM,), "nm").astype(np.float64)


def _spectral_axis(wavelength_nm: ArrayLike | None) -> dict[str, Axis]:
    return {WAVELENGTH_DIM: (_wavelengths(wavelength_nm), "nm")}
