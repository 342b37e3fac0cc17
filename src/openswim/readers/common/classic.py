"""How long a classic netCDF file must be: the library silently reads what is cut off from one as zeros."""

from __future__ import annotations

import struct
from math import prod
from pathlib import Path
from typing import BinaryIO

from openswim.readers.common.kept import first_bytes

_TYPE_BYTES = {1: 1, 2: 1, 3: 2, 4: 4, 5: 4, 6: 8, 7: 1, 8: 2, 9: 4, 10: 8, 11: 8}
_STREAMING = 0xFFFFFFFF  # number of records not known when the header was written


def classic_length(path: Path) -> int | None:
    """Bytes a classic netCDF file needs for all it declares (netCDF Classic Format Specification).

    None where the file is not classic netCDF or does not know its number of records. Raises ValueError
    where the header itself is cut off or nonsense.
    """
    magic = first_bytes(path)[:4]
    if magic[:3] != b"CDF" or magic[3:] not in (b"\x01", b"\x02", b"\x05"):
        return None
    with path.open("rb") as file:
        file.seek(len(magic))
        header = _Header(file, version=magic[3])
        records = header.count()
        if records in (_STREAMING, 2**64 - 1):
            return None
        return _needed(header, records)


def _needed(header: _Header, records: int) -> int:
    lengths = []
    for _ in range(header.list_length()):
        header.name()
        lengths.append(header.count())
    header.skip_attributes()
    fixed_end, in_records = 0, []
    for _ in range(header.list_length()):
        header.name()
        dimensions = [header.count() for _ in range(header.count())]
        if any(dimension >= len(lengths) for dimension in dimensions):
            raise ValueError("a variable with a dimension that does not exist")
        shape = [lengths[dimension] for dimension in dimensions]
        header.skip_attributes()
        item = header.type_bytes()
        header.count()  # vsize: redundant, and wrong for large variables
        begin = header.offset()
        if shape and shape[0] == 0:  # the record dimension has length 0 in the header
            in_records.append((begin, item * prod(shape[1:])))
        else:
            fixed_end = max(fixed_end, begin + item * prod(shape))
    if not in_records or records == 0:
        return fixed_end
    step = in_records[0][1] if len(in_records) == 1 else sum(_padded(size) for _, size in in_records)
    return max(fixed_end, *(begin + (records - 1) * step + size for begin, size in in_records))


class _Header:
    """Reads the big-endian pieces a classic header is made of."""

    def __init__(self, file: BinaryIO, version: int) -> None:
        self._file = file
        self._count = ">Q" if version == 5 else ">I"
        self._offset = ">I" if version == 1 else ">Q"

    def _unpack(self, form: str) -> int:
        size = struct.calcsize(form)
        piece = self._file.read(size)
        if len(piece) < size:
            raise ValueError("the header is cut off")
        return int(struct.unpack(form, piece)[0])

    def word(self) -> int:
        return self._unpack(">I")

    def count(self) -> int:
        return self._unpack(self._count)

    def offset(self) -> int:
        return self._unpack(self._offset)

    def type_bytes(self) -> int:
        kind = self.word()
        if kind not in _TYPE_BYTES:
            raise ValueError(f"there is no data type {kind}")
        return _TYPE_BYTES[kind]

    def name(self) -> None:
        self._skip(self.count())

    def list_length(self) -> int:
        self.word()  # the tag that says what the list holds
        return self.count()

    def skip_attributes(self) -> None:
        for _ in range(self.list_length()):
            self.name()
            self._skip(self.type_bytes() * self.count())

    def _skip(self, size: int) -> None:
        self._file.seek(_padded(size), 1)


def _padded(size: int) -> int:
    return -(-size // 4) * 4
