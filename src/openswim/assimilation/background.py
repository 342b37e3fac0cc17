"""What is believed before anything is seen: how far, and how alike, a first guess may be off."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from openswim.arguments import check_choice, number, shown
from openswim.assimilation.filters import Filter
from openswim.assimilation.observing.controls import LEAST_SHARE
from openswim.assimilation.observing.rows import Rows
from openswim.assimilation.observing.variables import ALIASES, Variable, variable_of
from openswim.assimilation.transforms import Transform, check_transform
from openswim.errors import UserError

F64 = NDArray[np.float64]

SPREADS = {"extinction": 8.0, "content": 8.0, "effective_radius": 0.3, "number": 0.5, "factor": 0.5, "albedo": 0.05,
           "scale": 0.05}  # fmt: skip
_PER_KM = 1e-3  # 1/m: the extinction that is one unit of a transformed field
_LEAST = 0.02  # of such units, that a first guess has everywhere: the floor's


@dataclass(frozen=True)
class Background:
    """length_m: of correlations, one for all or by control; height_m: the same along the vertical (default: as
    length_m). spread: standard deviation by control. Of extinction and content it is that of the transformed field, in
    1/km of extinction: 8 with a softplus, 2 with a root, .7 with a logarithm. Of albedo it is that of the albedo; of
    sizes, of the aerosol's factor and of a camera's scale, that of the logarithm.
    filter: "gaussian" or "diffusion".
    """

    length_m: float | Mapping[str, float]
    spread: float | Mapping[str, float] = field(default_factory=dict)
    height_m: float | Mapping[str, float] | None = None
    filter: str = "gaussian"

    def __post_init__(self) -> None:
        check_choice("background: filter", self.filter, ("gaussian", "diffusion"))
        for name in ("length_m", "spread", "height_m"):
            given = getattr(self, name)
            for key in given if isinstance(given, Mapping) else ():
                variable_of(str(key))
            for value in given.values() if isinstance(given, Mapping) else [] if given is None else [given]:
                if not 0 < number(f"background: {name}", value) < np.inf:
                    raise UserError(f"background: {name} = {shown(value)}: give a positive number")

    def of(self, name: str, variable: Variable) -> float:
        """A length, height or spread of a control; its default where none is given."""
        given = getattr(self, name)
        if isinstance(given, Mapping):
            by_name = {ALIASES.get(key, key): value for key, value in given.items()}
            if variable.name in by_name:
                return float(by_name[variable.name])
            if name == "length_m":
                raise UserError(f"background: length_m names no {variable.name}")
            given = None
        if name == "spread" and (given is None or not variable.on_levels):
            return SPREADS[variable.kind]
        return self.of("length_m", variable) if given is None else float(given)


@dataclass(frozen=True, eq=False)
class Space:
    """The space of a minimisation: v, of which the background says that it is noise of variance one.

    state(v) = T(T^-1(first) + spread S v), of each control by itself, at the nodes that may change.
    """

    rows: Rows
    first: xr.Dataset
    background: Background
    transform: str = "softplus"

    def __post_init__(self) -> None:
        check_transform(self.transform)

    @cached_property
    def pieces(self) -> list[Piece]:
        out, start = [], 0
        for variable in self.rows.controls.variables:
            out.append(self._piece(variable, start))
            start = out[-1].stop
        return out

    @property
    def size(self) -> int:
        return self.pieces[-1].stop

    def state(self, v: F64) -> xr.Dataset:
        """Of a v (size,)."""
        data = {p.name: p.first.copy(data=p.whole(p.transform.value(p.x(v)))) for p in self.pieces}
        return self.first.assign(data)

    def tangent(self, v: F64, change: F64) -> xr.Dataset:
        """What a change of v changes."""
        data = {}
        for p in self.pieces:
            data[p.name] = p.first.copy(data=p.spread_out(p.transform.slope(p.x(v)) * p.smooth(change)))
        return self.first.assign(data)

    def adjoint(self, v: F64, bars: xr.Dataset) -> F64:
        """The transpose of `tangent`."""
        out = np.empty(self.size)
        for p in self.pieces:
            out[p.here] = p.unsmooth(p.transform.slope(p.x(v)) * bars[p.name].values[p.box])
        return out

    def sample(self, seed: int) -> F64:
        """A v of a first guess that is as far off as the background says."""
        return np.random.default_rng(seed).standard_normal(self.size)

    def _piece(self, variable: Variable, start: int) -> Piece:
        controls, first = self.rows.controls, self.first[variable.name]
        mask = controls.where if variable.dims == ("z", "y", "x") else np.ones(first.shape, bool)
        box = _box(mask)
        spread = self.background.of("spread", variable)
        if variable.on_levels:
            unit = _PER_KM * np.ones(mask.shape)
            if variable.kind == "content":
                unit = controls.particles(variable.species).content_of(_PER_KM)
            least = LEAST_SHARE * controls.floors[variable.name][box]
            transform = Transform(self.transform, least, unit[box], _LEAST)
        else:
            transform = Transform("linear" if variable.kind == "albedo" else "log", 0.0, 1.0)
        return Piece(variable.name, first, mask[box], box, start, spread, transform, self._filter(variable, box))

    def _filter(self, variable: Variable, box: tuple[slice, ...]) -> Filter:
        grid = self.rows.scene.grid
        assert grid is not None
        dx, dy = grid.spacing_m()
        places = {"y": dy * np.arange(grid.shape[1]), "x": dx * np.arange(grid.shape[2])}
        places["z"] = grid.height_m.reshape(grid.shape[0], -1).mean(axis=1).astype(float)
        along = [(dim, cut) for dim, cut in zip(variable.dims, box, strict=True) if dim in places]
        if not along:
            return Filter(())
        length, height = self.background.of("length_m", variable), self.background.of("height_m", variable)
        lengths = [height if dim == "z" else length for dim, _ in along]
        return Filter.of([places[dim][cut] for dim, cut in along], lengths, self.background.filter)


@dataclass(frozen=True, eq=False)
class Piece:
    """A control in a minimisation: where it lies in v, and in which box of its field it may change."""

    name: str
    first: xr.DataArray
    mask: NDArray[np.bool_]
    box: tuple[slice, ...]
    start: int
    spread: float
    transform: Transform
    filter: Filter

    @property
    def stop(self) -> int:
        return self.start + self.mask.size

    @property
    def here(self) -> slice:
        return slice(self.start, self.stop)

    @cached_property
    def guess(self) -> F64:
        """The first guess, transformed."""
        return np.asarray(self.transform.back(self.first.values[self.box]), float)

    def smooth(self, v: F64) -> F64:
        return self.mask * (self.spread * self.filter.apply(v[self.here].reshape(self.mask.shape)))

    def unsmooth(self, bar: F64) -> F64:
        return self.spread * self.filter.transpose(self.mask * bar).ravel()

    def x(self, v: F64) -> F64:
        return self.guess + self.smooth(v)

    def whole(self, inner: F64) -> F64:
        """A field with its box filled, where it may change."""
        out = np.array(self.first.values, float)
        out[self.box] = np.where(self.mask, inner, out[self.box])
        return out

    def spread_out(self, inner: F64) -> F64:
        """A change of a field that is that in its box."""
        out = np.zeros(self.first.shape)
        out[self.box] = self.mask * inner
        return out


def _box(mask: NDArray[np.bool_]) -> tuple[slice, ...]:
    """The smallest box with all that is true."""
    out = []
    for axis in range(mask.ndim):
        some = np.flatnonzero(mask.any(axis=tuple(a for a in range(mask.ndim) if a != axis)))
        out.append(slice(int(some[0]), int(some[-1]) + 1))
    return tuple(out)
