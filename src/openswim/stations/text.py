"""Files of text of stations and photometers: all of one, or its rows, within bounds."""

from __future__ import annotations

import csv
import os
from collections.abc import Iterator
from itertools import islice
from pathlib import Path

from openswim.errors import UserError
from openswim.system.inputs import lines_of

PLACES = {"latitude": (-90.0, 90.0), "longitude": (-360.0, 360.0), "height_m": (-1000.0, 10_000.0)}
_WHAT = "a file of a station"
_MOST = 100_000_000  # characters, unpacked
_COMMENT = "#"
_HEAD = 100  # lines
_FEW = 0.01  # share of the rows


def text_of(path: Path, encoding: str = "utf-8-sig") -> str:
    """All of a file, packed by gzip or not."""
    return "".join(lines_of(path, _WHAT, _MOST, encoding=encoding))


def head_of(path: Path) -> str:
    """The first lines of a file, packed or not."""
    return "".join(islice(lines_of(path, _WHAT, _MOST, encoding="utf-8-sig"), _HEAD))


def rows_of(path: Path, most: int = _MOST, encoding: str = "utf-8-sig", separator: str = ",") -> Iterator[list[str]]:
    """The rows of a table (CSV), empty ones and comments (#) left out. most: characters of the file."""
    lines = lines_of(path, _WHAT, most, encoding=encoding)
    rows = csv.reader((line for line in lines if not line.startswith(_COMMENT)), delimiter=separator)
    try:
        yield from filter(None, rows)
    except csv.Error as error:
        raise UserError(f"{path}: line {rows.line_num} is no CSV ({error}): mend it") from None


def names_in(head: str) -> tuple[list[str], str]:
    """The names of the columns in the first lines of a table, and what divides them: comma, semicolon or tab."""
    first = next((line for line in head.splitlines() if line.strip() and not line.startswith(_COMMENT)), "")
    separator = max(",;\t", key=first.count)
    try:
        return [name.strip() for name in next(csv.reader([first], delimiter=separator), [])], separator
    except csv.Error:
        return [], separator


def told_of_lost(lost: int, count: int) -> str:
    """What is to be told of rows of another length than the names': few are left out, as of a file that was cut; many
    say that columns are not what they are taken for, and raise UserError."""
    told = f"{lost} of {count} rows have not as many columns as there are names"
    if lost and (lost > max(_FEW * count, 1) or lost == count):
        raise UserError(f"{told}: mend the file")
    return f"{told}: left out" if lost else ""


def told_of_end(path: Path) -> str:
    """What is to be told of a last line that does not end: a number in it may have lost digits."""
    with path.open("rb") as file:
        packed = file.read(2) == b"\x1f\x8b"
        file.seek(-1, os.SEEK_END)
        return "" if packed or file.read() in b"\r\n" else "its last line has no end: the file may have been cut there"
