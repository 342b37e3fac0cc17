"""Files of text of stations and photometers: all of one, or its rows, within bounds."""

from __future__ import annotations

import csv
import re
from collections.abc import Callable, Iterator, Sequence
from itertools import islice
from pathlib import Path

import numpy as np

from openswim.arguments import shown
from openswim.errors import UserError
from openswim.scene.times import parse_time
from openswim.system.inputs import lines_of

PLACES = {"latitude": (-90.0, 90.0), "longitude": (-360.0, 360.0), "height_m": (-1000.0, 10_000.0)}
_WHAT = "a file of a station"
_MOST = 100_000_000  # characters, unpacked
_COMMENT = "#"
_HEAD = 100  # lines
_FEW = 0.01  # share of the rows
_STAMP = re.compile(  # Python would take any sign between day and hour, and 12.30 for a third of a second past twelve
    r"\d{4}-?\d\d-?\d\d([T _-]\d\d(:?\d\d(:?\d\d([.,]\d+)?)?)?\s*(Z|[+-]\d\d(:?\d\d){0,2})?)?", re.IGNORECASE
)
_LEAP_SECOND = re.compile(r"(?<=59)(:?)60([.,]\d+)?")


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


def whole_rows(rows: Sequence[list[str]], fits: Callable[[int], bool]) -> tuple[list[list[str]], str]:
    """Those of a length that fits, and what is to be told of the others: few are left out, as of a file that was cut;
    many say that columns are not what they are taken for."""
    whole = [row for row in rows if fits(len(row))]
    lost = len(rows) - len(whole)
    told = f"{lost} of {len(rows)} rows have not as many columns as there are names"
    if lost and (lost > max(_FEW * len(rows), 1) or not whole):
        raise UserError(f"{told}: mend the file")
    return whole, f"{told}: left out" if lost else ""


def utc_of(text: str) -> np.datetime64:
    """A time in a table. Leap seconds, which no clock of ours has, end the second before."""
    plain = _LEAP_SECOND.sub(r"\g<1>59.999", text.strip())
    if not _STAMP.fullmatch(plain):
        raise UserError(f"time {shown(text)} is not understood: write it as 2005-08-28T18:00 (UTC)")
    time = parse_time(plain)
    assert time is not None
    return time
