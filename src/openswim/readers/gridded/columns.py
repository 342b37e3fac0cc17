"""The columns of a gridded CF file at one time: what is found under which name, read level by level upward."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from openswim.errors import UserError
from openswim.readers.common.fileset import FileSet, values
from openswim.readers.domain.neighbourhood import Neighbourhood
from openswim.readers.fields.gaps import Gaps
from openswim.readers.gridded.horizontal import Horizontal, horizontal
from openswim.readers.gridded.names import CONTENTS, RADII, STATE, Quantity, matches
from openswim.scene.labels.units import conversion
from openswim.scene.oddities.damage import copied_levels

F32 = NDArray[np.float32]
PER_VOLUME = ("kg m-3",)
_STAND_INS = {name for what in ("geopotential", "geopotential_height", "thickness") for name in STATE[what].names}


class Columns:
    """Fields on levels (nz, ny, nx) from the ground up and on the ground (ny, nx), each read when asked for."""

    def __init__(self, files: FileSet, around: Neighbourhood | None, notes: list[str]) -> None:
        self.files, self.notes = files, notes
        sample = _sample(files)
        self.laid: Horizontal = horizontal(files, sample, around, notes)
        (self.z_dim,) = (str(dim) for dim in sample.dims if dim not in (self.laid.x_dim, self.laid.y_dim))
        self.nz = sample.sizes[self.z_dim]
        self.levels: NDArray[np.intp] = np.arange(self.nz)  # of the file, upward; `turn_up` orders them
        self.used: dict[str, list[str]] = {}  # what was read for what
        self.gaps = Gaps()

    @property
    def path(self) -> Path:
        return self.files.path

    @property
    def shape(self) -> tuple[int, int, int]:
        return (self.levels.size, *self.laid.selection.shape)

    def find(self, quantity: Quantity, units: tuple[str, ...] = (), on_levels: bool = True) -> xr.DataArray | None:
        """The variable that is this quantity on levels (or on the ground); in the order of the table's names."""
        dims = {self.laid.x_dim, self.laid.y_dim} | ({self.z_dim} if on_levels else set())
        there = [f for f in self.files if set(f.dims) == dims and f.ndim == len(dims) and matches(f, quantity, units)]
        rank = {name: index for index, name in enumerate(quantity.names)}
        return min(there, key=lambda f: rank.get(str(f.name), len(rank)), default=None)

    def profile(self, quantity: Quantity) -> NDArray[np.float64] | None:
        """A 1-D variable along the levels, in the quantity's units, upward."""
        for f in self.files:
            if f.dims == (self.z_dim,) and (matches(f, quantity) or f.name == self.z_dim):
                factor = conversion(str(f.attrs.get("units", "")), quantity.units)
                if factor is not None:
                    return (np.asarray(f.values, np.float64) * factor[0])[self.levels]
        return None

    def get(self, what: str, quantity: Quantity | None = None) -> F32 | None:
        """A quantity on levels with gaps below the terrain filled from above; None where the file lacks it."""
        found = self.find(quantity or STATE[what])
        if found is None:
            return None
        return self.gaps.state(_called(found), self.read(what, found, (quantity or STATE[what]).units))

    def cloud(self, what: str, found: xr.DataArray, units: str) -> F32:
        """A variable of which clouds are made, upward, in the wanted units; none of it below the terrain."""
        return self.gaps.cloud(_called(found), self.read(what, found, units, cloud=True))

    def ground(self, what: str, quantity: Quantity) -> F32 | None:
        """A quantity on the ground; None where the file lacks it or has it nowhere."""
        found = self.find(quantity, on_levels=False)
        if found is None:
            return None
        field = self.laid.read(self.path, found, quantity.units)
        if np.isnan(field).all():
            return None
        self.used.setdefault(what, []).append(_called(found))
        return field

    def read(self, what: str, found: xr.DataArray, units: str, cloud: bool = False) -> F32:
        """A variable on levels, upward, in the wanted units; `cloud`: none of it beyond the domain."""
        self.used.setdefault(what, []).append(_called(found))
        found = found.transpose(self.z_dim, self.laid.y_dim, self.laid.x_dim)
        levels = self.levels
        field = self.laid.read(self.path, found, units, cloud)
        if levels.size != self.nz or not np.array_equal(levels, np.arange(self.nz)):
            field = field[levels]
        self.notes += copied_levels(_called(found), field)
        return field

    @property
    def read_names(self) -> set[str]:
        """What the file calls the variables that have been read."""
        return {name for names in self.used.values() for each in names for name in each.split(", ")}

    def unused(self) -> list[str]:
        """A note on variables on levels that are in none of the tables, or not in the units that these ask for."""
        read = self.read_names
        every = [f for f in self.files if f.ndim == 3 and self.z_dim in f.dims]
        names = sorted({str(f.name) for f in every if not set(_called(f).split(", ")) <= read} - _STAND_INS)
        more = f" and {len(names) - 8} more" if len(names) > 8 else ""
        return [f"variables on levels not used: {', '.join(names[:8])}{more}"] if names else []

    def keep(self, levels: NDArray[np.intp]) -> None:
        """Take only these of the present levels, in this order."""
        self.levels = self.levels[levels]

    def scalar(self, name: str, units: str) -> float | None:
        """A variable without dimensions."""
        found = self.files.get(name, ndim=0)
        return None if found is None else float(values(self.path, found, units))


def _called(found: xr.DataArray) -> str:
    """What the file calls a variable."""
    return str(found.attrs.get("called", found.name))


def _sample(files: FileSet) -> xr.DataArray:
    """A 3-D variable whose grid is the scene's: a species if there is one, else any known quantity."""
    every = [f for f in files if f.ndim == 3]
    wanted = [q for groups in CONTENTS.values() for q in groups]
    for quantities in (wanted, [*STATE.values(), *RADII.values()]):
        for quantity in quantities:
            for field in every:
                if matches(field, quantity, PER_VOLUME):
                    return field
    from openswim.readers.fields.aerosol_species import species_of_name

    for field in every:
        if species_of_name(str(field.name)):
            return field
    known = [q for quantities in (wanted, STATE.values(), RADII.values()) for q in quantities]
    for field in files:
        if field.ndim > 3 and any(matches(field, quantity, PER_VOLUME) for quantity in known):
            dims = ", ".join(f"{dim} ({size})" for dim, size in field.sizes.items())
            raise UserError(
                f"{files.path}: {field.name} lies along more than levels, rows and columns: {dims}: call what counts "
                "the members of an ensemble number, and take one along anything else"
            )
    raise UserError(f"{files.path}: no field on levels that is known: docs/models.md lists the names")
