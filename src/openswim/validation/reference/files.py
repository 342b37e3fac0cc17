"""Reference files as labelled tables, and the rows that a comparison yields."""

import csv
import json
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Protocol

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from openswim.errors import UserError
from openswim.readers.common.opening import opened, reading, said
from openswim.validation.reference.metrics import UNKNOWN, Agreement, Score

Array = NDArray[np.float64]


class Solver(Protocol):
    """What is validated: `openswim.Solver`, or anything else that solves a scene."""

    @property
    def name(self) -> str: ...

    def solve(self, scene: Any, sun_direction: Any, wavelengths_nm: Any) -> Any: ...


@dataclass(frozen=True)
class Row:
    """One line of the table: how far one quantity of one case is from its reference.

    Of solvers with a standard error: its mean over the reference's mean, and the share of values within three combined
    standard errors of the reference (`metrics.Agreement`).
    """

    case: str
    solver: str
    quantity: str
    relative_rmse: float
    bias: float
    correlation: float
    n: int
    cpu_seconds: float
    sigma: float = float("nan")
    within_3_sigma: float = float("nan")


@dataclass
class Stopwatch:
    """CPU seconds (all threads) spent inside its `running()` blocks since the last `lap()`."""

    seconds: float = 0.0

    @contextmanager
    def running(self) -> Iterator[None]:
        start = time.process_time()
        try:
            yield
        finally:
            self.seconds += time.process_time() - start

    def lap(self) -> float:
        lap, self.seconds = self.seconds, 0.0
        return lap


@dataclass(frozen=True)
class Reference:
    """A reference file: netCDF as it is, CSV as columns along `row`; `about` is the JSON beside it."""

    path: Path
    data: xr.Dataset
    about: dict[str, Any] = field(default_factory=dict)

    @property
    def name(self) -> str:
        return self.path.stem

    def has(self, *names: str) -> bool:
        return all(name in self.data.variables for name in names)

    @property
    def is_table(self) -> bool:
        return set(self.data.dims) == {"row"}

    def column(self, name: str, default: float | None = None) -> NDArray[Any]:
        """A column of a table; absent ones are `default` throughout."""
        if name in self.data:
            return np.asarray(self.data[name].values)
        if default is None:
            raise UserError(f"{self.path.name}: column {name!r} is missing")
        return np.full(self.data.sizes["row"], default)

    def row(
        self, solver: str, quantity: str, score: Score, cpu_seconds: float, agreement: Agreement = UNKNOWN
    ) -> Row:
        return Row(self.name, solver, quantity, *score, cpu_seconds, *agreement)


def with_sigma(view: Any) -> tuple[Array, Array]:
    """L' that rays see and its standard error, zero for solvers that have none: both (n, nw)."""
    radiance = np.asarray(view.radiance, float)
    sigma = getattr(view, "sigma", None)
    return radiance, np.zeros_like(radiance) if sigma is None else np.asarray(sigma, float)


def read_reference(path: Path) -> Reference:
    """Read a .nc or .csv file whole; what cannot be read raises UserError."""
    try:
        beside = path.with_suffix(".json")
        if path.suffix == ".csv":
            data = _read_csv(path)
        elif path.suffix not in (".nc", ".nc4", ".cdf"):  # a network's, read where it is compared
            data = xr.Dataset()
        else:
            with opened(path) as lazy, reading(path):
                data = lazy.load()
        about = json.loads(beside.read_text()) if beside.exists() else {}
    except (OSError, ValueError, KeyError, csv.Error, RuntimeError) as error:
        raise UserError(f"{path}: cannot be read{said(error)}: damaged, or {beside.name} is no JSON") from error
    return Reference(path, data, about if isinstance(about, dict) else {})


def _read_csv(path: Path) -> xr.Dataset:
    with path.open(newline="", encoding="utf-8-sig") as file:
        header, *rows = list(csv.reader(file)) or [[]]
    if not header or not rows:
        raise UserError(f"{path}: no header or no rows")
    if any(len(row) != len(header) for row in rows):
        raise UserError(f"{path}: rows differ in length: damaged")
    columns = zip(header, zip(*rows, strict=True), strict=True)
    return xr.Dataset({name.strip(): ("row", _numbers_or_text(values)) for name, values in columns})


def _numbers_or_text(values: tuple[str, ...]) -> NDArray[Any]:
    try:
        return np.array([float(v) if v.strip() else np.nan for v in values])
    except ValueError:
        return np.array(values)


def groups(*columns: NDArray[Any]) -> Iterator[tuple[tuple[Any, ...], NDArray[np.intp]]]:
    """Unique combinations of the columns' values, in order, with the indices of their rows."""
    keys = list(zip(*(column.tolist() for column in columns), strict=True))
    for key in sorted(set(keys)):
        yield key, np.array([i for i, k in enumerate(keys) if k == key])
