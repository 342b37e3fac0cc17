"""What every field of a scene must be: known by name, of the right shape, finite, in range."""

from __future__ import annotations

from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from openswim.arguments import shown
from openswim.errors import UserError
from openswim.scene.grid import Grid
from openswim.scene.labels.units import STATE, has_value
from openswim.scene.particles import WAVELENGTHS_NM
from openswim.scene.variables import Variable, variable

WAVELENGTH_DIM = "wavelength"
_LITTLE = 1e-7  # of its range, that any value may be beyond it
_CLIPPED_SHARE = 0.1  # clipping may change a field's sum by no more than this share


def checked_dataset(data: xr.Dataset, grid: Grid | None) -> tuple[xr.Dataset, list[str]]:
    """A scene's fields as float32 (z, y, x), validated against `grid`, with coordinates and CF attributes.

    Returns the dataset and notes on what was repaired. Raises UserError naming the variable otherwise.
    """
    sizes = {} if grid is None else dict(zip(("z", "y", "x"), grid.shape, strict=True))
    notes: list[str] = []
    fields = {str(name): _checked(str(name), data[name], sizes, notes) for name in data.data_vars}
    if grid is not None and "surface_altitude" in fields:
        above_m = float(np.median(fields["surface_altitude"].values - grid.height_m[-1]))
        if above_m > 0:  # through some levels it may rise
            raise UserError(
                f"scene: surface_altitude is {above_m:.0f} m above the highest level in most columns: give both in "
                "metres above sea level"
            )
    return xr.Dataset(fields, coords=_coordinates(data, grid), attrs=dict(data.attrs)), notes


def fill_below_ground(fields: dict[str, xr.DataArray], grid: Grid, notes: list[str]) -> None:
    """Missing values below the terrain are usual on height or pressure levels and matter to nothing."""
    if "surface_altitude" not in fields:
        return
    height = grid.height_m if grid.height_m.ndim == 3 else grid.height_m[:, None, None]
    ground = fields["surface_altitude"].transpose("y", "x").values
    for name, field in fields.items():
        if set(field.dims) != {"z", "y", "x"}:
            continue
        values = field.transpose("z", "y", "x").values
        gaps = ~has_value(values) & (height < ground)
        if not gaps.any():
            continue
        values = np.where(gaps, 0.0, values).astype(values.dtype)
        if name in STATE:
            for level in range(values.shape[0] - 2, -1, -1):
                values[level] = np.where(gaps[level], values[level + 1], values[level])
        notes.append(f"{name}: {int(gaps.sum())} missing values below the terrain filled")
        fields[name] = xr.DataArray(values, dims=("z", "y", "x"))


def _coordinates(data: xr.Dataset, grid: Grid | None) -> dict[str, Any]:
    coords: dict[str, Any] = {}
    for name in ("latitude", "longitude"):  # the place of a scene whose grid does not say it
        if name in data.coords and data.coords[name].ndim == 0:
            coords[name] = float(data.coords[name])
    if WAVELENGTH_DIM in data.dims:
        coords[WAVELENGTH_DIM] = _wavelengths(data)
    if grid is not None:
        dims = ("z",) if grid.height_m.ndim == 1 else ("z", "y", "x")
        units = "degrees" if grid.in_degrees else "m"
        coords["x"] = ("x", grid.x, {"units": units})
        coords["y"] = ("y", grid.y, {"units": units})
        coords["height"] = (
            dims,
            grid.height_m,
            {"standard_name": "altitude", "units": "m", "positive": "up"},
        )
    return coords


def _wavelengths(data: xr.Dataset) -> Any:
    if WAVELENGTH_DIM not in data.coords:
        raise UserError(
            "scene: surface_albedo varies with wavelength, but there is no coordinate wavelength [nm]"
        )
    values, (low, high) = np.asarray(data.coords[WAVELENGTH_DIM].values, dtype=np.float64), WAVELENGTHS_NM
    if not np.isfinite(values).all() or values.min() < low or values.max() > high:
        raise UserError(f"scene: wavelength is out of range ({low:.0f} to {high:.0f} nm): give nanometres")
    if np.unique(values).size < values.size:
        raise UserError(f"scene: wavelengths {shown(values.tolist())} nm: leave out what is there twice")
    return WAVELENGTH_DIM, values, {"standard_name": "radiation_wavelength", "units": "nm"}


def _checked(name: str, field: xr.DataArray, sizes: dict[str, int], notes: list[str]) -> xr.DataArray:
    spec = variable(name)
    dims = tuple(dim for dim in spec.dims if dim in sizes)
    if name == "surface_albedo" and WAVELENGTH_DIM in field.dims:
        dims += (WAVELENGTH_DIM,)
    if not sizes and "z" in spec.dims:
        raise UserError(f"scene: {name} is a field on levels, but the scene has no grid")
    if set(field.dims) != set(dims):
        raise UserError(f"scene: {name} has dimensions {_tuple(field.dims)}; it must have {_tuple(dims)}")
    for dim in dims:
        if field.sizes[dim] != sizes.get(dim, field.sizes[dim]):
            raise UserError(
                f"scene: {name} has {field.sizes[dim]} values along {dim}; the grid has {sizes[dim]}"
            )
    if field.dtype.kind not in "fiub":
        raise UserError(f"scene: {name} holds no numbers")
    values = np.asarray(field.transpose(*dims).values, dtype=np.float32, order="C")
    values = checked_values(f"scene: {name}", values, spec, notes)
    attrs = {"long_name": spec.long_name, "units": spec.units}
    if spec.standard_name:
        attrs["standard_name"] = spec.standard_name
    return xr.DataArray(values, dims=dims, attrs=attrs)


def checked_values(
    what: str, values: NDArray[np.float32], spec: Variable, notes: list[str]
) -> NDArray[np.float32]:
    """Values within the range of `spec`: noise just outside is clipped (with a note), the rest refused."""
    if values.size == 0:
        raise UserError(f"{what} is empty")
    lowest, highest = float(values.min()), float(values.max())  # NaN anywhere makes these NaN
    low, high = np.float32(spec.low), np.float32(spec.high)  # as values have them
    if low <= lowest and highest <= high:
        return values
    missing = int(values.size - np.isfinite(values).sum())
    if missing or highest > 1e19:
        missing = missing or int((values > 1e19).sum())
        raise UserError(
            f"{what} has {missing} missing values (NaN or fill) of {values.size}: fill them, "
            "or crop the file to where it has data"
        )
    units = "" if spec.units == "1" else f" {spec.units}"
    clipped = np.clip(values, low, high)
    changed = float(np.abs(values - clipped).sum(dtype=np.float64))
    kept = float(np.abs(clipped).sum(dtype=np.float64))
    noise = highest <= spec.high * 1.01 and (lowest >= spec.low or changed <= _CLIPPED_SHARE * kept)
    # where there is nothing else, noise has no sum to be compared with
    little = _LITTLE * (spec.high - spec.low) if spec.noise is None else spec.noise
    noise = noise or (lowest >= spec.low - little and highest <= spec.high + little)
    if not (spec.clip and noise):
        hint = f" ({spec.hint})" if spec.hint else ""
        raise UserError(
            f"{what} runs from {lowest:.4g} to {highest:.4g}{units}; it must lie within "
            f"{spec.low:g} to {spec.high:g}{units}{hint}"
        )
    for count, bound, word, extreme in (
        (int((values < spec.low).sum()), spec.low, "below", lowest),
        (int((values > spec.high).sum()), spec.high, "above", highest),
    ):
        if count:
            notes.append(
                f"{what.removeprefix('scene: ')}: {count} of {values.size} values {word} {bound:g} "
                f"(to {extreme:.2g}{units}) set to {bound:g}"
            )
    return clipped


def _tuple(dims: Any) -> str:
    return "(" + ", ".join(str(dim) for dim in dims) + ")"
