"""The hidden folder beside a file in which it is made, until it is whole and gets its name.

Each is held by its process with a lock that ends with it, however that ends. What a dead process has left is swept by
the next one that writes there, and what it had put aside gets its name back.
"""

from __future__ import annotations

import ctypes
import os
import shutil
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from functools import cache
from pathlib import Path

_PREFIX = ".openswim-"
_LOCK, _ASIDE = ".openswim-lock", ".openswim-aside"
_OLD_S = 86_400.0  # after which a folder that nobody could lock is swept
_EXCHANGE, _HERE = 2, -100  # RENAME_EXCHANGE, AT_FDCWD of Linux

_held: dict[Path, int] = {}  # of this process: folder, and what holds its lock


@cache
def _host() -> bytes:
    import socket

    return socket.gethostname().encode()[:256]


@contextmanager
def workshop(folder: Path) -> Iterator[Path]:
    """A new hidden folder in a folder, removed in the end; before, those of dead processes are."""
    sweep(folder)
    made = _made(folder)
    try:
        yield made
    finally:
        _close(made)


@contextmanager
def alone_in(folder: Path) -> Iterator[None]:
    """Hold a folder, which is made if need be, against whoever else asks for it; BlockingIOError where somebody has it.

    Where the system locks no folders, nothing is held.
    """
    held = _entered(folder)
    try:
        yield
    finally:
        if held is not None:
            os.close(held)


def _entered(folder: Path) -> int | None:
    while True:
        folder.mkdir(exist_ok=True)
        try:
            held = os.open(folder, os.O_RDONLY)
        except PermissionError:  # Windows opens no folders
            return None
        free = _lock(held)
        if free is not False and _is_open(folder, held):
            return held
        os.close(held)
        if free is False:
            raise BlockingIOError(f"{folder} is held")


def _is_open(folder: Path, held: int) -> bool:
    """Whether what was opened still has this name; who held it before may have removed it."""
    try:
        return os.path.samestat(folder.stat(), os.fstat(held))
    except FileNotFoundError:
        return False


def sweep(folder: Path) -> None:
    """Remove what dead processes have left in a folder, and give back what they had put aside."""
    with suppress(OSError), os.scandir(folder) as entries:
        for entry in entries:
            if entry.name.startswith(_PREFIX) and entry.is_dir(follow_symlinks=False):
                with suppress(OSError):
                    _sweep_one(Path(entry.path))


def abandon() -> None:
    """Remove the folders of this process, which is about to end."""
    for made in list(_held):
        _close(made)


def replace_folder(new: Path, target: Path, made: Path) -> None:
    """Put a folder in place of another one: in one step where the system can, else by way of a workshop."""
    if _exchanged(new, target):
        return
    aside = made / _ASIDE / target.name
    aside.parent.mkdir()
    os.replace(target, aside)
    try:
        os.replace(new, target)
    except OSError:
        os.replace(aside, target)
        raise


def _exchanged(one: Path, other: Path) -> bool:
    try:
        call = ctypes.CDLL(None).renameat2
    except (OSError, AttributeError, TypeError):
        return False
    return bool(call(_HERE, os.fsencode(one), _HERE, os.fsencode(other), _EXCHANGE) == 0)


def _made(folder: Path) -> Path:
    while True:
        made = Path(tempfile.mkdtemp(prefix=_PREFIX, dir=folder))
        try:
            lock = os.open(made / _LOCK, os.O_CREAT | os.O_EXCL | os.O_RDWR, 0o600)
        except FileNotFoundError:  # swept before it was locked
            continue
        if _lock(lock) is not False and os.fstat(lock).st_nlink:
            _held[made] = lock
            try:
                os.write(lock, _host())
            except OSError:  # a full disk has room for an empty file
                _close(made)
                raise
            return made
        os.close(lock)


def _lock(file: int) -> bool | None:
    """Whether a file is now locked by this process; None where the system has no locks."""
    try:
        import fcntl

        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        return False
    except (ImportError, OSError):
        return None
    return True


def _sweep_one(made: Path) -> None:
    try:
        lock = os.open(made / _LOCK, os.O_RDWR)
    except FileNotFoundError:  # of a process that ended as it made or removed it
        if time.time() - made.stat().st_mtime > _OLD_S:
            _clear(made)
        made.rmdir()
        return
    try:
        free = _lock(lock)
        # of another machine its process may live on: locks may be local
        told = free is not None and os.read(lock, 256) in (_host(), b"")
        if (free and told) or (free is not False and time.time() - made.stat().st_mtime > _OLD_S):
            _clear(made)
    finally:
        os.close(lock)


def _close(made: Path) -> None:
    lock = _held.pop(made, None)
    if lock is not None:
        _clear(made)
        os.close(lock)
        shutil.rmtree(made, ignore_errors=True)  # over a network what is open has another name until it is closed


def _clear(made: Path) -> None:
    """Remove a folder, its lock last."""
    for aside in (made / _ASIDE).glob("*"):
        home = made.parent / aside.name
        if not os.path.lexists(home):
            with suppress(OSError):
                os.rename(aside, home)
    with suppress(OSError):
        for each in made.iterdir():
            if each.is_dir() and not each.is_symlink():
                shutil.rmtree(each, ignore_errors=True)
            elif each.name != _LOCK:
                each.unlink(missing_ok=True)
    shutil.rmtree(made, ignore_errors=True)
