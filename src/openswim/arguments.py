"""What callers hand over: a number, numbers, or a thing of a kind; one line where it is something else."""

from __future__ import annotations

import difflib
import os
from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from openswim.errors import UserError


def number(what: str, value: Any) -> float:
    """The one number that this is (NaN and infinity too); raises UserError."""
    if isinstance(value, float):  # mostly; fits make thousands of lenses
        return float(value)
    array = _array(what, value)
    if array.ndim or array.dtype.kind not in "fiu":
        raise UserError(f"{what} must be a number, got {shown(value)}")
    return float(array)


def numbers(what: str, value: Any) -> NDArray[Any]:
    """The array of numbers that this is; raises UserError."""
    array = _array(what, value)
    if array.dtype.kind not in "fiub":
        raise UserError(f"{what} must be numbers, got {shown(value)}")
    return array


def whole(what: str, value: Any) -> int:
    """The whole number that this is; raises UserError."""
    array = _array(what, value)
    if array.ndim or array.dtype.kind not in "iu":
        raise UserError(f"{what} must be a whole number, got {shown(value)}")
    return int(array)


def check_kind(what: str, value: Any, kind: type | tuple[type, ...], remedy: str) -> None:
    """Raise UserError unless the value is of a kind."""
    if not isinstance(value, kind):
        raise UserError(f"{what} is {shown(value)}: {remedy}")


def check_choice(what: str, value: Any, choices: Sequence[str]) -> None:
    """Raise UserError unless the value is one of these words."""
    if not isinstance(value, str) or value not in choices:  # an array would be compared number by number
        raise UserError(f"{what} {shown(value)} is unknown: choose {', '.join(choices[:-1])} or {choices[-1]}")


def check_keys(table: Iterable[str], known: Sequence[str], what: str) -> None:
    """Raise UserError where a table of a file says what nobody understands."""
    for key in table:
        if key not in known:
            near = difflib.get_close_matches(key, known, n=1)
            remedy = f"did you mean {near[0]}?" if near else f"it may have {', '.join(known)}"
            raise UserError(f"{what} has an unknown {shown(key)}: {remedy}")


def paths(what: str, given: Any) -> list[str | os.PathLike[str]]:
    """One name of a file, or several, as a list; raises UserError."""
    alone = isinstance(given, str | os.PathLike) or not isinstance(given, Iterable)
    alone |= isinstance(given, np.ndarray) and given.ndim == 0
    listed: list[Any] = [given] if alone else list(given)
    for each in listed:
        check_kind(what, each, (str, os.PathLike), "give a file's name, or a list of names")
    return listed


def shown(value: Any) -> str:
    """A value as messages show it: on one line, and not much of it."""
    text = " ".join(repr(value).split())
    return text if len(text) <= 60 else f"{type(value).__name__} {text[:50]}..."


def _array(what: str, value: Any) -> NDArray[Any]:
    if np.ma.is_masked(value):  # numpy would give what lies under the mask
        raise UserError(f"{what} has masked values: fill them in first, as by numpy.ma.filled")
    try:
        return np.asarray(value)
    except (TypeError, ValueError):  # lists of unequal lengths, datasets
        return np.empty(0, object)
