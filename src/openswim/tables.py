"""The tables that ship with the package, in the `data` folder of the room that uses them."""

from __future__ import annotations

from functools import cache
from importlib.resources import files

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]


@cache
def csv_columns(room: str, name: str) -> FloatArray:
    """Columns (k, n) of a table of numbers; lines that begin otherwise are its heading."""
    text = (files(f"openswim.{room}") / "data" / f"{name}.csv").read_text("utf-8")
    return np.array([line.split(",") for line in text.splitlines() if line[:1].isdigit()], float).T


@cache
def named_arrays(room: str, name: str) -> dict[str, FloatArray]:
    """The arrays of an .npz file by name."""
    with (files(f"openswim.{room}") / "data" / f"{name}.npz").open("rb") as stream:
        return dict(np.load(stream))
