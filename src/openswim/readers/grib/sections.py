"""Where the fields of a GRIB file lie: its messages and sections walked by their lengths, nothing decoded.

A GRIB2 message may hold several fields (sections 2-7, 3-7 or 4-7 repeated, WMO FM 92 GRIB edition 2); each is handed
out as a message of its own. Every length is checked before it is believed.
"""

from __future__ import annotations

import mmap
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from openswim.errors import UserError
from openswim.readers.common.kept import first_bytes

Span = tuple[int, int]  # offset and length in the file
_END = b"7777"
_ECMWF_LARGE = 0x800000  # GRIB1 messages over 8 MB: bit 24 set, length in units of 120 bytes
_GAP = 1 << 20  # bytes searched for the next message; headings of bulletins are far shorter


@dataclass(frozen=True, slots=True)
class Sections:
    """One field: the edition of its message, and the spans that make a message of it alone.

    head, grid, data : GRIB2: everything between sections 0 and 7 in order (the grid definition among it), the grid
        definition, section 7. GRIB1: the whole message, the grid definition (or nothing), the binary data.
    """

    edition: int
    head: tuple[Span, ...]
    grid: Span
    data: Span
    discipline: int = 0


class Damaged(UserError):
    """The file does not keep to the format."""


def is_grib(path: Path) -> bool:
    """Whether a file begins with a GRIB message, if need be after the heading of a bulletin."""
    try:
        start = first_bytes(path)[:512]
    except OSError:
        return False
    at = start.find(b"GRIB")
    return at >= 0 and at + 8 <= len(start) and start[at + 7] in (1, 2)


def fields_in(path: Path, data: mmap.mmap) -> Iterator[Sections]:
    """All fields of a file in order; Damaged where it is truncated or not GRIB."""
    at, number = _next(path, data, 0, 1), 0
    while at >= 0:
        number += 1
        edition = data[at + 7]
        if edition == 2:
            length = int.from_bytes(data[at + 8 : at + 16], "big")
        elif edition == 1:
            length = _grib1_length(data, at)
        else:
            raise Damaged(f"{path}: message {number} is GRIB edition {edition}: only 1 and 2 exist")
        if length < 32 or at + length > len(data):
            raise Damaged(
                f"{path}: message {number} is {length} bytes long, but the file ends after {len(data) - at}: "
                "truncated: copy or download it again"
            )
        if data[at + length - 4 : at + length] != _END:
            raise Damaged(f"{path}: message {number} has no end mark: damaged: copy or download it again")
        what = f"{path}: message {number}"
        yield from _grib2(what, data, at, length) if edition == 2 else _grib1(what, data, at, length)
        at = _next(path, data, at + length, number + 1)


def message(data: mmap.mmap, field: Sections, values: bool = True) -> bytes:
    """A field as a GRIB message of its own; without its values it is short, and only its keys can be read."""
    if field.edition == 1:
        start, length = field.head[0]
        return data[start : start + length]
    parts = [data[start : start + length] for start, length in field.head]
    start, length = field.data
    parts.append(data[start : start + length] if values else (5).to_bytes(4, "big") + b"\x07")
    body = b"".join(parts) + _END
    head = b"GRIB\xff\xff" + bytes([field.discipline, 2])
    return head + (16 + len(body)).to_bytes(8, "big") + body


def packing(data: mmap.mmap, field: Sections) -> tuple[bytes, bytes, bytes] | None:
    """Sections 5 (data representation), 6 (bitmap) and 7 (data) of a GRIB2 field; None for GRIB1."""
    if field.edition != 2:
        return None
    five, six, seven = (data[start : start + length] for start, length in (*field.head[-2:], field.data))
    return five, six, seven


def _next(path: Path, data: mmap.mmap, start: int, number: int) -> int:
    """Offset of the next message; -1 at the end (padding with zeros or blanks is no message)."""
    at = data.find(b"GRIB", start, start + _GAP)
    if at >= 0 and at + 16 <= len(data):
        return at
    if data[start : start + _GAP].strip(b"\0 \r\n\x03\x1a"):
        raise Damaged(f"{path}: no GRIB message {number} where one should begin: damaged: download it again")
    return -1


def _grib2(what: str, data: mmap.mmap, start: int, length: int) -> Iterator[Sections]:
    spans: dict[int, Span] = {}
    own_bitmap: Span | None = None
    at, end = start + 16, start + length - 4
    while at < end:
        size, number = int.from_bytes(data[at : at + 4], "big"), data[at + 4] if at + 4 < end else 0
        if size < 5 or at + size > end or not 1 <= number <= 7:
            raise Damaged(f"{what} has a broken section {number}: damaged: copy or download it again")
        if number < 4:  # a new grid or local section: what follows is described anew
            spans = {n: span for n, span in spans.items() if n < number}
        spans[number] = at, size
        if number == 6:
            if size < 6:
                raise Damaged(f"{what} has a broken bitmap: damaged: copy or download it again")
            if data[at + 5] != 254:
                own_bitmap = spans[6]
            elif own_bitmap is not None:  # "the bitmap already defined in this message"
                spans[6] = own_bitmap
        if number == 7:
            if not all(n in spans for n in (1, 3, 4, 5, 6)):
                raise Damaged(f"{what} lacks a section: damaged: copy or download it again")
            head = tuple(spans[n] for n in (1, 2, 3, 4, 5, 6) if n in spans)
            yield Sections(2, head, spans[3], spans[7], data[start + 6])
        at += size


def _grib1_length(data: mmap.mmap, at: int) -> int:
    """Length of a GRIB1 message; those over 8 MB are told in units of 120 bytes, less a remainder."""
    length = int.from_bytes(data[at + 4 : at + 7], "big")
    if not length & _ECMWF_LARGE:
        return length
    whole = (length & ~_ECMWF_LARGE) * 120
    pos = at + 8
    flags = data[pos + 7]
    pos += int.from_bytes(data[pos : pos + 3], "big")
    for present in (flags & 0x80, flags & 0x40):
        if present:
            pos += int.from_bytes(data[pos : pos + 3], "big")
    remainder = int.from_bytes(data[pos : pos + 3], "big")
    return whole - remainder + 4 if remainder < 120 else length


def _grib1(what: str, data: mmap.mmap, start: int, length: int) -> Iterator[Sections]:
    at, end = start + 8, start + length - 4
    flags = data[at + 7]
    spans: list[Span] = []
    for present in (True, bool(flags & 0x80), bool(flags & 0x40)):
        size = int.from_bytes(data[at : at + 3], "big") if present else 0
        if present and (size < 6 or at + size > end):
            raise Damaged(f"{what} has a broken section: damaged: copy or download it again")
        spans.append((at, size))
        at += size
    if at + 11 > end:
        raise Damaged(f"{what} has no data: damaged: copy or download it again")
    yield Sections(1, ((start, length),), spans[1], (at, end - at))
