"""Files of text of stations and photometers: all of one, or its rows, within bounds."""

from __future__ import annotations

import csv
from collections.abc import Iterator
from pathlib import Path

from openswim.errors import UserError
from openswim.system.inputs import lines_of

PLACES = {"latitude": (-90.0, 90.0), "longitude": (-360.0, 360.0), "height_m": (-1000.0, 10_000.0)}
_WHAT = "a file of a station"
_MOST = 100_000_000  # characters, unpacked


def text_of(path: Path, encoding: str = "utf-8-sig") -> str:
    """All of a file, packed by gzip or not."""
    return "".join(lines_of(path, _WHAT, _MOST, encoding=encoding))


def rows_of(path: Path, most: int = _MOST, encoding: str = "utf-8-sig") -> Iterator[list[str]]:
    """The rows of a table (CSV), empty ones left out. most: characters of the file."""
    rows = csv.reader(lines_of(path, _WHAT, most, encoding=encoding))
    try:
        yield from filter(None, rows)
    except csv.Error as error:
        raise UserError(f"{path}: line {rows.line_num} is no CSV ({error}): mend it") from None
