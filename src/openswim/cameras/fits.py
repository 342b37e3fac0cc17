"""FITS images: plain, or packed whole by gzip or bzip2 (FITS standard 4.0, sections 3 to 5)."""

import bz2
import gzip
import zlib
from pathlib import Path
from typing import IO, Any

import numpy as np
from numpy.typing import NDArray

from openswim.errors import UserError

_BLOCK, _CARD = 2880, 80
_MOST_CARDS = 10_000
_MOST_PIXELS = 400_000_000
_TYPES = {8: "u1", 16: ">i2", 32: ">i4", 64: ">i8", -32: ">f4", -64: ">f8"}


def is_fits(head: bytes, path: Path) -> bool:
    """By the first bytes; where the file is packed, by those within."""
    if head[:3] == b"BZh" or head[:2] == b"\x1f\x8b":
        try:
            with _opened(path) as stream:
                head = stream.read(_CARD)
        except (OSError, EOFError, ValueError, zlib.error):
            return False
    return head[:6] == b"SIMPLE"


def read_fits(path: Path) -> tuple[dict[str, Any], NDArray[Any]]:
    """Header and array of the first image, scaled by BZERO and BSCALE; the last axis is the first in the file."""
    with _opened(path) as stream:
        header = _header(stream, path)
        if not _axes(header) and header.get("EXTEND"):  # the image is in the first extension
            header |= _header(stream, path)
        if header.get("ZIMAGE"):
            raise UserError(f"{path}: is FITS packed by tiles (.fz): unpack it first (funpack)")
        axes = _axes(header)
        count = int(np.prod(axes)) if axes else 0
        if not 0 < count <= _MOST_PIXELS or header.get("BITPIX") not in _TYPES:
            raise UserError(f"{path}: FITS without a picture of up to {_MOST_PIXELS:.0e} pixels")
        kind = np.dtype(_TYPES[header["BITPIX"]])
        data = stream.read(count * kind.itemsize)
    if len(data) < count * kind.itemsize:
        raise UserError(f"{path}: FITS ends early: damaged, fetch it again")
    values = np.frombuffer(data, kind).reshape(axes[::-1])
    zero, scale = float(header.get("BZERO", 0.0)), float(header.get("BSCALE", 1.0))
    if kind.kind != "f" and "BLANK" in header:
        return header, np.where(values == header["BLANK"], np.nan, values * scale + zero)
    if scale == 1.0 and zero == 32768.0 and kind == ">i2":
        return header, (values.astype(np.int32) + 32768).astype(np.uint16)
    if scale == 1.0 and zero == 0.0:
        return header, values.astype(kind.newbyteorder("="))
    return header, values * scale + zero


def _opened(path: Path) -> Any:
    with path.open("rb") as stream:
        start = stream.read(3)
    if start == b"BZh":
        return bz2.open(path, "rb")
    return gzip.open(path, "rb") if start[:2] == b"\x1f\x8b" else path.open("rb")


def _axes(header: dict[str, Any]) -> tuple[int, ...]:
    count = header.get("NAXIS", 0)
    if not isinstance(count, int) or not 0 <= count <= 9:
        return ()
    lengths = [header.get(f"NAXIS{i + 1}", 0) for i in range(count)]
    return tuple(lengths) if all(isinstance(n, int) and n > 0 for n in lengths) else ()


def _header(stream: IO[bytes], path: Path) -> dict[str, Any]:
    found: dict[str, Any] = {}
    for _ in range(_MOST_CARDS * _CARD // _BLOCK):
        block = stream.read(_BLOCK)
        if len(block) < _BLOCK:
            break
        for start in range(0, _BLOCK, _CARD):
            card = block[start : start + _CARD].decode("ascii", "replace")
            if card.startswith("END "):
                return found
            if card[8:10] == "= ":
                found[card[:8].strip()] = _value(card[10:])
    raise UserError(f"{path}: FITS header without an end: damaged")


def _value(text: str) -> Any:
    """A string, T or F, or a number; None where it is something else."""
    text = text.strip()
    if text.startswith("'"):
        end = 1
        while (end := text.find("'", end)) != -1 and text[end : end + 2] == "''":
            end += 2
        return text[1 : end if end != -1 else None].replace("''", "'").rstrip()
    word = text.split("/")[0].strip()
    if word in ("T", "F"):
        return word == "T"
    try:
        return int(word)
    except ValueError:
        pass
    try:
        return float(word.replace("D", "E"))
    except ValueError:
        return None
