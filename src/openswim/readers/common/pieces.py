"""Pieces of a Zarr store that are not there: read as zeros or fill, they would be taken for values."""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from openswim.errors import UserError
from openswim.readers.common.kept import first_bytes

_MOST_PIECES = 100_000  # of one variable at one time; beyond, nobody counts them
_LONGEST_REFERENCES = 50_000_000  # bytes
_EPOCH = np.datetime64("1970-01-01", "ms")


def lost_pieces(path: Path, data: xr.Dataset, names: Iterable[str], at: Mapping[Any, int]) -> list[str]:
    """Notes on pieces of some variables, at chosen indices of dimensions, that a Zarr store lacks.

    Writers leave out pieces of nothing but zeros or fill, so that they may be missing in a store that is whole.
    """
    store = _store_of(path)
    if store is None:
        return []
    notes = []
    for name in names:
        if name not in data.variables:
            continue
        lost, every = _counted(store, name, data[name].dims, at)
        if lost:
            notes.append(f"{name}: {lost} of {every} pieces are not in the store: read as fill or zero")
    return notes


def check_clock(path: Path, data: xr.Dataset, clock: str, time: np.datetime64) -> list[str]:
    """A note on a clock that a Zarr store lacks; UserError where its zero is the beginning of 1970."""
    lost = lost_pieces(path, data, [clock], {})
    if lost and time == _EPOCH:
        raise UserError(f"{path}: the values of {clock} are not in the store: copy or download it again")
    return lost


def _store_of(path: Path) -> Mapping[str, Any] | Path | None:
    """A folder, or the keys of kerchunk references; None for other files."""
    if path.is_dir():
        return path
    try:
        if first_bytes(path)[:1] != b"{" or path.stat().st_size > _LONGEST_REFERENCES:
            return None
        found = json.loads(path.read_text("utf-8"))
        refs = found.get("refs", found)
        return refs if isinstance(refs, dict) else None
    except (OSError, ValueError, AttributeError, RecursionError):
        return None


def _counted(
    store: Mapping[str, Any] | Path, name: str, dims: tuple[Any, ...], at: Mapping[Any, int]
) -> tuple[int, int]:
    """How many pieces of a variable are not there, and how many there should be."""
    old, new = _json(store, f"{name}/.zarray"), _json(store, f"{name}/zarr.json")
    try:
        if old is not None:
            shape, chunks = old["shape"], old["chunks"]
            separator, start = old.get("dimension_separator", "."), ""
        elif new is not None:
            shape, chunks = new["shape"], new["chunk_grid"]["configuration"]["chunk_shape"]
            encoding = new.get("chunk_key_encoding", {})
            v2 = encoding.get("name") == "v2"
            separator = encoding.get("configuration", {}).get("separator", "." if v2 else "/")
            start = "" if v2 else f"c{separator if shape else ''}"
        else:
            return 0, 0
        axes = [
            [at[dim] // chunk] if dim in at else range(-(-size // chunk))
            for dim, size, chunk in zip(dims, shape, chunks, strict=True)
        ]
        count = int(np.prod([len(axis) for axis in axes], dtype=object)) if axes else 1
        if count > _MOST_PIECES:
            return 0, count
        keys = (start + (separator.join(map(str, each)) or ("0" if not start else "")) for each in product(*axes))
        return sum(not _has(store, f"{name}/{key}") for key in keys), count
    except (KeyError, TypeError, ValueError, AttributeError, ZeroDivisionError):
        return 0, 0  # what is wrong with the description is said where it is opened


def _has(store: Mapping[str, Any] | Path, key: str) -> bool:
    return (store / key).is_file() if isinstance(store, Path) else key in store


def _json(store: Mapping[str, Any] | Path, key: str) -> Any:
    try:
        text = (store / key).read_text("utf-8") if isinstance(store, Path) else store[key]
        return json.loads(text) if isinstance(text, str) else text
    except (OSError, ValueError, KeyError, RecursionError):
        return None
