"""One file, opened once: what a reader opened to see whose it is goes to the next that looks, and to the one that reads
it."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager, nullcontext
from contextvars import ContextVar
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from openswim.errors import UserError

HEAD = 200_000  # bytes that tell of what kind a file is


@dataclass
class _Look:
    """What is open, and what was found instead, by its kind and path; the files' first bytes; what was found out."""

    known: dict[tuple[str, Path], Any]
    looking: bool = False
    open: dict[tuple[str, Path], Any] = field(default_factory=dict)
    heads: dict[Path, bytes] = field(default_factory=dict)


_look: ContextVar[_Look | None] = ContextVar("openswim_look", default=None)


@contextmanager
def handed_over() -> Iterator[None]:
    """Within the block what was opened within `looking` is handed over to whoever opens it next; the rest is closed in
    the end. For files that do not change meanwhile."""
    outer = _look.get()
    look = _Look({} if outer is None else outer.known)
    token = _look.set(look)
    try:
        yield
    finally:
        _look.reset(token)
        for each in look.open.values():
            if not isinstance(each, UserError):
                each.close()


@contextmanager
def looking() -> Iterator[None]:
    """Within the block what is opened stays open."""
    with handed_over() if _look.get() is None else nullcontext():
        look = _look.get()
        assert look is not None
        look.looking = True
        try:
            yield
        finally:
            look.looking = False


def take(kind: str, path: Path, make: Callable[[], Any]) -> Any:
    """What ``make`` opens, or what was left open; what it said is wrong is said again."""
    look = _look.get()
    if look is None:
        return make()
    found = look.open.pop((kind, path), None)
    if found is None:
        try:
            return make()
        except UserError as error:
            found = error
    if isinstance(found, UserError):
        look.open[kind, path] = found
        raise found
    return found


def leave(kind: str, path: Path, opened: Any) -> None:
    """Close what was taken, unless it is only looked at."""
    look = _look.get()
    if look is not None and look.looking and (kind, path) not in look.open:
        look.open[kind, path] = opened
    else:
        opened.close()


def once(kind: str, path: Path, find: Callable[[], Any]) -> Any:
    """What ``find`` finds out of a file; within the outermost block it is looked for once."""
    look = _look.get()
    if look is None:
        return find()
    if (kind, path) not in look.known:
        look.known[kind, path] = find()
    return look.known[kind, path]


def first_bytes(path: Path) -> bytes:
    """A file's first bytes; raises OSError."""
    look = _look.get()
    if look is not None and path in look.heads:
        return look.heads[path]
    with path.open("rb") as file:
        start = file.read(HEAD)
    if look is not None and look.looking:
        look.heads[path] = start
    return start
