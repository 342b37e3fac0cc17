"""What may be read: ordinary files and folders, and nothing that waits for ever or never ends."""

from __future__ import annotations

import errno
import gzip
import os
import stat
import zlib
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path

from openswim.arguments import check_kind
from openswim.errors import UserError
from openswim.system.workshops import sweep

_LONGEST_LINE = 1_000_000  # characters
MOST_IN_FOLDER = 100_000  # files of a Zarr store that are looked at


def check_ordinary(path: str | os.PathLike[str], name: str = "") -> None:
    """Raise UserError unless this is a file with something in it, or a folder; pipes, devices and sockets are neither.

    name: what messages call it, such as "--dem".
    """
    label = f"{name} {os.fspath(path)}".strip()
    try:
        if not os.path.lexists(path):
            sweep(Path(path).parent)  # a folder whose writer died as it gave it its name
        found = os.stat(path)
    except OSError as error:
        raise UserError(f"{label}: {_why(Path(path), error)}") from None
    except ValueError:  # a null byte
        raise UserError(f"{label!r}: no file can have this name") from None
    if stat.S_ISDIR(found.st_mode):
        return
    if not stat.S_ISREG(found.st_mode):
        raise UserError(f"{label}: a pipe, device or socket: copy what it gives to a file, and give that")
    if found.st_size == 0:  # of which some in /proc wait for ever
        raise UserError(f"{label}: empty: copy or download it again")


def lines_of(
    path: Path, what: str, most_characters: int, most_lines: int = 1_100_000, encoding: str = "utf-8-sig"
) -> Iterator[str]:
    """The lines of a file of text, unpacked where it is packed by gzip, each ended by a newline; raises UserError where
    it is damaged, or larger than it can be. what: it is called in messages, such as "a station's file"."""
    check_ordinary(path)
    left = most_characters
    try:
        with path.open("rb") as file:
            packed = file.read(2) == b"\x1f\x8b"
        with (gzip.open if packed else open)(path, "rt", encoding=encoding) as text:
            for _ in range(most_lines):
                line = text.readline(_LONGEST_LINE)
                left -= len(line)
                if not line:
                    return
                if len(line) == _LONGEST_LINE or left < 0:
                    break
                yield line
            else:
                raise UserError(f"{path}: has more than {most_lines} lines, more than {what} can have: divide it")
    except EOFError:
        raise UserError(f"{path}: ends early: copy or download it again") from None
    except UnicodeDecodeError:
        raise UserError(f"{path}: is no text in UTF-8: save it as such") from None
    except (OSError, zlib.error) as error:
        why = getattr(error, "strerror", None) or error
        raise UserError(f"{path}: cannot be read ({why}): copy or download it again") from None
    raise UserError(f"{path}: is larger than {what} can be, or has no lines: divide it")


def check_name(path: str | os.PathLike[str], name: str = "") -> None:
    """Refuse names that libraries which read and write files cannot be told. name: as in `check_ordinary`."""
    check_kind(name or "a file", path, (str, os.PathLike), "give a file's name")
    text = os.fspath(path)
    if "\0" in str(text):
        raise UserError(f"{f'{name} {text!r}'.strip()}: no file can have this name")
    try:
        str(text).encode("utf-8")
    except UnicodeEncodeError:
        with suppress(UnicodeEncodeError):  # of half a pair of UTF-16, which no system gives
            text = os.fsencode(text).decode("utf-8", "backslashreplace")
        shown = str(text).encode("utf-8", "backslashreplace").decode()
        raise UserError(f"{f'{name} {shown}'.strip()}: this name is not UTF-8: rename it") from None


def check_within(path: Path, folder: Path | None, label: str, remedy: str) -> None:
    """Raise UserError where no file can have a name, or where it, links followed, leads out of a folder.

    folder: None where it may lead anywhere; remedy: which folder that is, and what to do.
    """
    try:
        found = Path(os.path.realpath(path))
        inside = folder is None or found.is_relative_to(os.path.realpath(folder))
    except (OSError, ValueError):
        raise UserError(f"{label}: no file can have this name") from None
    if not inside:
        raise UserError(f"{label} leads out of {remedy}")


def _why(path: Path, error: OSError) -> str:
    if error.errno == errno.ELOOP:
        return "a link that leads to itself: give the file that is meant"
    if error.errno in (errno.ENOENT, errno.ENOTDIR):
        return "a link to a file that is not there" if path.is_symlink() else "no such file"
    return f"cannot be read ({error.strerror})"


def size_and_change(path: str | os.PathLike[str]) -> tuple[int, int]:
    """Bytes, and nanoseconds of the last change, of a file; of a folder, of all files in it. Raises OSError."""
    about = os.stat(path)
    if not stat.S_ISDIR(about.st_mode):
        return about.st_size, about.st_mtime_ns
    size, changed, count = 0, about.st_mtime_ns, 0
    for folder, _, files in os.walk(path):
        for name in files:
            inner = os.lstat(os.path.join(folder, name))
            size, changed = size + inner.st_size, max(changed, inner.st_mtime_ns)
        count += len(files)
        if count > MOST_IN_FOLDER:
            break
    return size, changed
