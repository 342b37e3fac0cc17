"""Complex packing of GRIB2 with or without spatial differencing (WMO data templates 5.2 and 5.3): NCEP's own.

Large files are mostly this. Every read is checked against the section's length: ecCodes takes the widths and lengths of
groups on trust, and would end the program on some.
"""

from __future__ import annotations

import struct
import threading
from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray

F32 = NDArray[np.float32]
_WIDEST = 32  # bits
_scratch = threading.local()


def is_complex(section5: bytes) -> bool:
    """Whether a data representation section describes complex packing."""
    return len(section5) >= 11 and int.from_bytes(section5[9:11], "big") in (2, 3)


def unpacked(section5: bytes, section6: bytes, section7: bytes, points: int) -> F32 | None:
    """(points,) values, NaN where missing; None where the sections do not fit each other."""
    spatial = int.from_bytes(section5[9:11], "big") == 3
    if len(section5) < (49 if spatial else 47):
        return None
    count = int.from_bytes(section5[5:9], "big")
    (reference,) = struct.unpack(">f", section5[11:15])
    two, ten = _signed(section5[15:17]), _signed(section5[17:19])
    groups, width_ref, width_bits = int.from_bytes(section5[31:35], "big"), section5[35], section5[36]
    length_ref, length_step = int.from_bytes(section5[37:41], "big"), section5[41]
    last, length_bits = int.from_bytes(section5[42:46], "big"), section5[46]
    order, octets = (section5[47], section5[48]) if spatial else (0, 0)
    bits, management = section5[19], section5[22]
    there = _bitmap(section6, points)
    if there is None or count != (points if there.size == 0 else int(there.sum())) or not np.isfinite(reference):
        return None
    if max(bits, width_bits, length_bits) > _WIDEST or order > 2 or octets > 4 or management > 2 or groups > count:
        return None
    if max(abs(two), abs(ten)) > 300:
        return None
    body = np.frombuffer(section7, np.uint8)[5:]
    coded, missing = _room(count)
    fine = _groups(body, bits, groups, width_ref, width_bits, length_ref, length_step, last, length_bits, order, octets,
                   management, coded, missing)  # fmt: skip
    if not fine:
        return None
    values = np.empty(count, np.float32)
    _scaled(coded, missing, float(reference), 2.0**two, 10.0**-ten, values)
    if there.size == 0:
        return values
    whole = np.full(points, np.nan, np.float32)
    whole[there] = values
    return whole


def _room(count: int) -> tuple[NDArray[np.int64], NDArray[np.bool_]]:
    """Scratch for so many values: touching new memory for every message takes as long as unpacking it."""
    if getattr(_scratch, "coded", np.empty(0)).size < count:
        _scratch.coded, _scratch.missing = np.empty(count, np.int64), np.empty(count, np.bool_)
    missing = _scratch.missing[:count]
    missing[:] = False
    return _scratch.coded[:count], missing


def _signed(octets: bytes) -> int:
    """Sign and magnitude, as GRIB writes integers."""
    number = int.from_bytes(octets, "big")
    sign = 1 << (8 * len(octets) - 1)
    return -(number & (sign - 1)) if number & sign else number


def _bitmap(section6: bytes, points: int) -> NDArray[np.bool_] | None:
    """Which points have values; empty: all of them; None: a bitmap that is too short or of the centre's own."""
    if section6[5] == 255:
        return np.empty(0, np.bool_)
    if section6[5] != 0 or 8 * (len(section6) - 6) < points:
        return None
    return np.unpackbits(np.frombuffer(section6, np.uint8)[6:], count=points).astype(np.bool_)


@njit(cache=True)
def _read(body: Any, at: int, bits: int) -> int:
    """Unsigned integer of up to 32 bits, from bit `at` on; the caller has checked that it lies within."""
    value = 0
    byte, free = at >> 3, 8 - (at & 7)
    while bits > 0:
        taken = min(free, bits)
        value = (value << taken) | ((int(body[byte]) >> (free - taken)) & ((1 << taken) - 1))
        bits -= taken
        byte += 1
        free = 8
    return value


@njit(cache=True)
def _magnitude(body: Any, at: int, bits: int) -> int:
    """Sign and magnitude."""
    if bits == 0:
        return 0
    value = _read(body, at + 1, bits - 1)
    return -value if _read(body, at, 1) else value


@njit(cache=True, nogil=True)
def _groups(
    body: Any, bits: int, groups: int, width_ref: int, width_bits: int, length_ref: int, length_step: int, last: int,
    length_bits: int, order: int, octets: int, management: int, coded: Any, missing: Any,
) -> bool:  # fmt: skip
    """Fill `coded` and `missing`; False where the groups do not fit the data (template 7.2, and 7.3 on top)."""
    size, count = 8 * body.size, coded.size
    refs_at = 8 * octets * (order + 1) if order else 0
    widths_at = refs_at + (groups * bits + 7) // 8 * 8
    lengths_at = widths_at + (groups * width_bits + 7) // 8 * 8
    at = lengths_at + (groups * length_bits + 7) // 8 * 8
    if at > size:
        return False
    n = 0
    for g in range(groups):
        reference = _read(body, refs_at + g * bits, bits)
        width = width_ref + _read(body, widths_at + g * width_bits, width_bits)
        length = length_ref + length_step * _read(body, lengths_at + g * length_bits, length_bits)
        if g == groups - 1:
            length = last
        if width > 32 or n + length > count or at + width * length > size:
            return False
        none = management > 0 and width == 0 and bits > 0
        none = none and reference >= (1 << bits) - management
        for _ in range(length):
            own = _read(body, at, width)
            at += width
            coded[n] = reference + own
            missing[n] = none or (management > 0 and width > 0 and own >= (1 << width) - management)
            n += 1
    if n != count:
        return groups == 0 and _constant(coded)
    if order:
        first = _magnitude(body, 0, 8 * octets)
        second = _magnitude(body, 8 * octets, 8 * octets) if order == 2 else 0
        least = _magnitude(body, 8 * octets * order, 8 * octets)
        seen = 0
        before, last_one = 0, 0
        for i in range(count):
            if missing[i]:
                continue
            if seen == 0:
                value = first
            elif seen == 1 and order == 2:
                value = second
            elif order == 1:
                value = coded[i] + least + last_one
            else:
                value = coded[i] + least + 2 * last_one - before
            before, last_one = last_one, value
            coded[i] = value
            seen += 1
    return True


@njit(cache=True, nogil=True)
def _scaled(coded: Any, missing: Any, reference: float, two: float, ten: float, values: Any) -> None:
    for n in range(coded.size):
        values[n] = np.nan if missing[n] else (reference + coded[n] * two) * ten


@njit(cache=True)
def _constant(coded: Any) -> bool:
    coded[:] = 0
    return True
