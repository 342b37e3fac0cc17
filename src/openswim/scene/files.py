"""Writing files whole or not at all."""

from __future__ import annotations

import errno
import os
import re
import stat
import tempfile
from collections.abc import Iterable, Iterator
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path

from openswim.errors import UserError
from openswim.system.inputs import check_name, check_ordinary
from openswim.system.workshops import replace_folder, workshop

ZARR_MARKS = (".zgroup", ".zmetadata", "zarr.json")
_MARKED = 2000  # bytes of a file's beginning that have our mark
_FULL = (errno.ENOSPC, errno.EDQUOT)
_ANYBODY_WRITES = stat.S_IWUSR | stat.S_IWGRP | stat.S_IWOTH
_PIECE = re.compile(r"\.z(group|array|attrs|metadata)|zarr\.json|\d+(\.\d+)*|c(\.\d+)*")  # files of a Zarr store


def check_target(
    path: str | os.PathLike[str], inputs: Iterable[str | os.PathLike[str]] = (), name: str = "output"
) -> None:
    """Raise UserError unless `written_whole` could write `path` and would replace none of `inputs`.

    Meant to be called before a long computation; `name`: what the message calls the file.
    """
    check_name(path, name)
    check_kept(name, Path(path), inputs)
    target = _pointed_at(Path(path), name)
    with _writable_beside(target, name):
        _check_no_device(target, name)
        if _others_folder(target):
            raise UserError(f"{name} {target} is a folder, not a Zarr store; choose another name")
        if target.is_dir():
            _check_own(target, name)
        _check_unprotected(target, name)


def check_targets(
    targets: Iterable[tuple[str, str | os.PathLike[str] | None]], inputs: Iterable[str | os.PathLike[str]] = ()
) -> None:
    """`check_target` of several (what the message calls it, path or None), of which none may replace another."""
    needed, before = list(inputs), list[Path]()
    for name, path in targets:
        if path is None:
            continue
        check_target(path, needed, name)
        for other in before:
            check_apart(name, Path(path), other)
        before.append(Path(path))


def check_kept(name: str, target: Path, inputs: Iterable[str | os.PathLike[str]]) -> None:
    """Raise UserError where a target is one of the inputs, or a folder that holds one."""
    for each in map(Path, inputs):
        if any(_same(target, held) for held in (each, *each.absolute().parents)):
            raise UserError(f"{name} {target}: would replace {each}, which is needed; choose another name")


def check_ours(path: Path, mark: str, remedy: str) -> None:
    """Raise UserError where a file without our mark in its first bytes has a name that we write to unasked."""
    if not os.path.lexists(path):
        return
    start = ""
    with suppress(OSError):
        check_ordinary(path)
        with path.open("rb") as file:
            start = file.read(_MARKED).decode("utf-8", "replace")
    if mark not in start:
        raise UserError(f"{path}: would be replaced, and is not of OpenSWIm: {remedy}")


def check_apart(name: str, target: Path, other: Path) -> None:
    """Raise UserError where a target is another output, or lies in it: it would be lost with what is there."""
    if _same(target, other):
        raise UserError(f"{name} {target}: another output has this name too; choose another name")
    if any(_same(folder, other) for folder in target.absolute().parents):
        raise UserError(f"{name} {target}: lies in {other}, another output; choose another name")


def check_folder(path: str | os.PathLike[str], name: str = "output") -> None:
    """Raise UserError unless a folder could be made under this name; what may lie there is not looked at."""
    check_name(path, name)
    target = Path(path)
    with _writable_beside(target, name):
        pass


@contextmanager
def _writable_beside(target: Path, name: str) -> Iterator[None]:
    """Around checks of a target: raise UserError where nothing could be written beside it, or not under its name."""
    try:
        if not target.parent.is_dir():
            raise UserError(f"{name} {target}: folder {target.parent} does not exist; make it first")
        with suppress(FileNotFoundError):
            target.lstat()  # fails where the name is too long
        yield
        with tempfile.TemporaryFile(dir=target.parent):
            pass
    except OSError as error:
        raise UserError(
            f"{name} {target}: cannot be written ({error.strerror}); choose another name or folder"
        ) from None


def _check_no_device(target: Path, name: str) -> None:
    """Raise UserError where a name leads to a pipe, device or socket, such as /dev/stdout: it would be gone."""
    with suppress(OSError):
        mode = target.stat().st_mode
        if not (stat.S_ISREG(mode) or stat.S_ISDIR(mode)):
            raise UserError(f"{name} {target}: is a pipe, device or socket, and would be replaced; choose another name")


def _check_unprotected(target: Path, name: str) -> None:
    """Raise UserError where a file may not be written, which a new one in its place would get around."""
    if not os.path.exists(target):
        return
    if not (os.access(target, os.W_OK) and target.stat().st_mode & _ANYBODY_WRITES):  # root may all
        raise UserError(f"{name} {target} is write-protected; remove it or choose another name")


def _pointed_at(target: Path, name: str) -> Path:
    """What a symbolic link leads to, there or not yet; any other name as it is."""
    if not os.path.islink(target):  # False of names that are too long, too
        return target
    found = Path(os.path.realpath(target))
    if os.path.islink(found):
        raise UserError(f"{name} {target}: is a symbolic link that leads round in a circle; choose another name")
    return found


def _same(one: Path, other: Path) -> bool:
    """Whether two names stand for one file or folder, there or not yet."""
    try:
        return one.samefile(other)
    except OSError:
        return one.absolute() == other.absolute()


def _others_folder(target: Path) -> bool:
    """Whether this is a folder that is not ours to replace."""
    return target.is_dir() and not any((target / mark).exists() for mark in ZARR_MARKS)


@contextmanager
def written_whole(path: str | os.PathLike[str], own_folder: bool = False) -> Iterator[Path]:
    """Yield a temporary name in the folder of `path`; on success it is renamed to `path`, on failure removed.

    Works for files and for Zarr folders. A symbolic link stays, and what it leads to is written. Raises UserError where
    the name cannot be written. own_folder: a folder of this name is known to be ours, whatever it holds.
    """
    check_name(path, "output")
    target = _pointed_at(Path(path), "output")
    _check_no_device(target, "output")
    _check_unprotected(target, "output")
    with ExitStack() as stack:
        try:
            if not own_folder and _others_folder(target):
                raise UserError(f"{target}: is a folder: choose another name")
            made = stack.enter_context(workshop(target.parent))
        except OSError as error:
            remedy = (
                "free some space" if error.errno in _FULL else "choose a folder that exists and that you may write to"
            )
            raise UserError(f"{target}: cannot be written ({error.strerror}): {remedy}") from error
        try:
            partial = made / Path(path).name  # a link's own, whose suffix is the one that was asked for
            yield partial
            if target.exists() and target.is_dir() is not partial.is_dir():
                raise UserError(f"{target}: is a {'folder' if target.is_dir() else 'file'}: choose another name")
            if target.is_dir() and partial.is_dir():
                if not own_folder:
                    _check_own(target)
                replace_folder(partial, target, made)
            else:
                _settle(partial)
                os.replace(partial, target)
        except (OSError, RuntimeError) as error:  # the latter is netCDF4's of a full disk
            why = getattr(error, "strerror", None) or error
            raise UserError(f"{target}: cannot be written ({why}): free some space or choose another folder") from error


def _settle(partial: Path) -> None:
    """Have a file on the disk, or hear that it is full, before it gets its name."""
    if partial.is_file():
        file = os.open(partial, os.O_RDWR)
        try:
            os.fsync(file)
        finally:
            os.close(file)


def _check_own(store: Path, name: str = "output") -> None:
    """Raise UserError where a Zarr store holds what is none of it, and would be lost with it."""
    for folder, _, files in os.walk(store):
        for file in files:
            if not _PIECE.fullmatch(file):
                foreign = os.path.relpath(os.path.join(folder, file), store)
                raise UserError(f"{name} {store}: holds {foreign}, which is no part of a Zarr store: move it away")
