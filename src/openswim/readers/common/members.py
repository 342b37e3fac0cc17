"""Members of an ensemble: which there are in a file, and which one is taken."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from inspect import signature
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from openswim.errors import UserError

MEMBER_DIMS = ("number", "member", "ensemble", "ensemble_member", "realization", "realization_index")


def member_index(path: Path, data: xr.Dataset, member: int | None, notes: list[str]) -> dict[Any, int]:
    """Index along each ensemble dimension of a dataset, by its coordinate (else counted from 0); the first by default,
    with a note where there are several."""
    chosen: dict[Any, int] = {}
    for dim in MEMBER_DIMS:
        if dim not in data.dims:
            continue
        chosen[dim] = picked(path, list(_own(data, dim)), member, notes)
    return chosen


def member_numbers(path: Path, data: xr.Dataset) -> set[int]:
    """The members of a dataset, by their own numbers; none where it holds no ensemble."""
    found: list[set[int]] = []
    for dim in (dim for dim in MEMBER_DIMS if dim in data.dims):
        own = _own(data, dim)
        if own.dtype.kind not in "iuf" or not (np.isfinite(own) & (own == np.round(own))).all():
            raise UserError(f"{path}: its members are not numbered ({dim} has {own.ravel()[0]!s:.20}): number them")
        found.append({int(each) for each in own})
    return set.intersection(*found) if found else set()


def _own(data: xr.Dataset, dim: str) -> NDArray[Any]:
    """The file's own names of its members along a dimension, else numbers from 0."""
    if dim in data.variables and data[dim].dims == (dim,):
        return np.asarray(data[dim].values)
    return np.arange(data.sizes[dim])


def picked(path: Path, members: Sequence[Any], member: int | None, notes: list[str]) -> int:
    """Index of a member among those of a file."""
    listed = ", ".join(f"{each}" for each in members[:8]) + (f" ... {members[-1]}" if len(members) > 8 else "")
    if member is None:
        if len(members) > 1:
            notes.append(f"{len(members)} ensemble members in the file ({listed}): {members[0]} is shown (--member)")
        return 0
    hits = [index for index, each in enumerate(members) if each == member]
    if not hits:
        raise UserError(f"{path}: no ensemble member {member} in it; it has {listed}: choose one of these (--member)")
    return hits[0]


class OneMember:
    """A reader that reads one member of ensembles."""

    def __init__(self, reader: Any, member: int) -> None:
        if "member" not in signature(reader.read).parameters:
            raise UserError(f"member {member}: files of {reader.name} hold no ensemble: leave out member (--member)")
        self.reader, self.member = reader, member

    def __getattr__(self, name: str) -> Any:
        found = getattr(self.reader, name)
        return partial(found, member=self.member) if name in ("read", "read_parts") else found
