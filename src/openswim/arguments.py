"""What callers hand over: a number, numbers, or a thing of a kind; one line where it is something else."""

from __future__ import annotations

import builtins
import difflib
import inspect
import os
from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import cache, wraps
from types import NoneType, UnionType
from typing import Any, Literal, ParamSpec, TypeVar, Union, get_args, get_origin, get_type_hints

import numpy as np
from numpy.typing import NDArray

from openswim.errors import UserError

P = ParamSpec("P")
R = TypeVar("R")

_WORDS = {  # of annotations
    "float": "a number", "int": "a whole number", "bool": "True or False", "str": "text", "PathLike": "a file's name",
    "Sequence": "a list", "Iterable": "a list", "Callable": "a function", "Mapping": "a dict", "Literal": "text",
    "Scene": "a Scene: open_scene(path) first", "LitScene": "what openswim.light returns",
    "Camera": "a Camera, such as Camera.allsky(lat, lon)", "Operator": "an operator: openswim.observe makes one",
    "Solver": "a Solver, such as Solver('fast')", "Ground": "openswim.Ground(albedo=..., height=...)",
    "Background": "Background(length_m=...): how far errors are alike", "DataArray": "one of its variables",
}  # fmt: skip


def takes(function: Callable[P, R]) -> Callable[P, R]:
    """Have a public function refuse, in one line, an argument that is of no kind which its annotations name.

    What a list holds, and whether a number or a word is a possible one, it looks at by itself.
    """
    signature = inspect.signature(function)
    named = {
        name for name, each in signature.parameters.items() if each.kind not in (each.VAR_POSITIONAL, each.VAR_KEYWORD)
    }

    @cache
    def hints() -> dict[str, Any]:  # not before the first call: the modules that define them may be half imported
        return get_type_hints(function, localns=_Names(inspect.unwrap(function).__globals__))

    @wraps(function)
    def call(*args: P.args, **options: P.kwargs) -> R:
        try:
            given = signature.bind(*args, **options).arguments
        except TypeError:
            return function(*args, **options)  # and Python says what is missing, or too much
        for name, value in given.items():
            if name in named and name in hints() and not _fits(value, hints()[name]):
                raise UserError(f"{name} is {shown(value)}: give {_told(hints()[name])}")
        return function(*args, **options)

    return call


def number(what: str, value: Any) -> float:
    """The one number that this is (NaN and infinity too); raises UserError."""
    if isinstance(value, float):  # mostly; fits make thousands of lenses
        return float(value)
    array = _array(what, value)
    if array.ndim or array.dtype.kind not in "fiu":
        raise UserError(f"{what} must be a number, got {shown(value)}")
    return float(array)


def written_number(text: str) -> float:
    """The number that a file has in letters; raises ValueError, for "1_000" too, which is a number only to Python."""
    return float(text.replace("_", "?"))


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


class _Names(dict[str, Any]):
    """A module's names; those that it has for type checkers alone stand for anything."""

    def __missing__(self, name: str) -> Any:
        return getattr(builtins, name, Any)


def _fits(value: Any, hint: Any) -> bool:
    """Whether a value is of the kind of an annotation; where that says nothing to be looked at, it is."""
    kind, inner = get_origin(hint) or hint, get_args(hint)
    if kind in (Union, UnionType):
        return any(_fits(value, each) for each in inner)
    if kind is Literal:
        return isinstance(value, tuple({type(each) for each in inner}))
    if kind in (float, int):
        array = _array("it", value)
        return array.ndim == 0 and array.dtype.kind in ("fiu" if kind is float else "iu")
    if kind is bool:
        return isinstance(value, bool | np.bool_)
    if kind in (tuple, np.datetime64) or getattr(kind, "__module__", "").startswith("numpy._typing"):
        return True  # which functions look at, by `parse_time` and `numbers`
    if kind in (Sequence, Iterable):
        alone = inner[0] is not Any and get_origin(inner[0]) is not tuple and _fits(value, inner[0])
        return alone or _is_list(value)
    try:
        return isinstance(value, kind)
    except TypeError:
        return True


def _is_list(value: Any) -> bool:
    alone = isinstance(value, str | bytes | Mapping) or (isinstance(value, np.ndarray) and not value.ndim)
    return isinstance(value, Iterable) and not alone


def _told(hint: Any) -> str:
    """What an annotation stands for, in words."""
    if get_origin(hint) in (Union, UnionType):
        each = [kind for kind in get_args(hint) if kind is not NoneType]
        if any(get_origin(kind) is os.PathLike for kind in each):
            each = [kind for kind in each if kind is not str]
        return " or ".join(dict.fromkeys(map(_told, each)))
    kind = get_origin(hint) or hint
    name = getattr(kind, "__name__", str(kind))
    return _WORDS.get(name, name)
