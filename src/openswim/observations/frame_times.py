"""When a frame was taken: by its FITS header, its name, or its EXIF; the zone is told, never guessed."""

import re
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta, timezone
from pathlib import Path
from typing import Any

import numpy as np

from openswim.arguments import shown
from openswim.cameras.files import FrameSettings
from openswim.errors import UserError

_DIRECTIVES = {
    "%Y": r"\d{4}", "%y": r"\d{2}", "%m": r"\d{2}", "%d": r"\d{2}", "%H": r"\d{2}", "%M": r"\d{2}", "%S": r"\d{2}",
    "%j": r"\d{3}", "%f": r"\d{1,6}", "%b": "[A-Za-z]{3}", "%z": r"[+-]\d{2}:?\d{2}",
}  # fmt: skip
# year to second (or minute), the parts apart or not: image_20250215080830, FE3_20160901_100000, 2020-12-11_20-09-36
_USUAL = re.compile(
    r"(?<!\d)((?:19|20)\d{2})[-_.]?(0[1-9]|1[0-2])[-_.]?(0[1-9]|[12]\d|3[01])[-_.T ]?"
    r"([01]\d|2[0-3])[-_.:h]?([0-5]\d)(?:[-_.:m]?([0-5]\d))?(?!\d)"
)
_ZONE = re.compile(
    r"(?<![A-Za-z])(?:UTC|GMT)(?:([pm+-])(\d{1,2})(?::?([0-5]\d)|(\.\d+))?)?(?![A-Za-z\d])", re.IGNORECASE
)
_ZULU = re.compile(r"T\d{2}[-_.:]?\d{2}(?:[-_.:]?\d{2})?(?:[.,]\d+)?Z(?![A-Za-z\d])")  # as ISO 8601 has it
_OFFSET = re.compile(r"([+-])(0\d|1[0-4]):([0-5]\d)")  # as EXIF has it
_LONGEST_EXPOSURE_S = 3600.0
_NAME = "the frame a name such as sky_20240620_110000.jpg"


@dataclass(frozen=True)
class FrameTime:
    """The middle of the exposure (UTC), who says so, and what speaks against it, half a sentence."""

    time: np.datetime64
    source: str
    doubt: str = ""


def frame_time(
    path: Path, header: dict[str, Any], exif: dict[str, str], settings: FrameSettings, alone: bool = True
) -> FrameTime:
    """FITS goes before the name, and the name before EXIF, whose clocks are set by hand. alone: a time can be given."""
    option = "time=... (UTC, --time), or " if alone else ""
    if "DATE-OBS" in header:
        return FrameTime(_of_fits(path, header, option), "FITS DATE-OBS and half of the exposure")
    pattern = settings.time_pattern
    local = _by_pattern(path, pattern, option) if pattern else _by_usual(path.name)
    if local is not None:
        said = _ZONE.search(path.stem) or _ZULU.search(path.stem)
        stated = None if said is None else _hours(said)
        if stated is not None and abs(stated) > 15:
            raise UserError(f"{path}: its name says UTC{stated:+g}, which no clock has: give {option}another name")
        if stated is not None and settings.utc_offset_h not in (None, stated):
            raise UserError(
                f"{path}: its name says UTC{stated:+g}, utc_offset_h (--utc-offset, or in the camera's file) "
                f"{settings.utc_offset_h:g}: leave that out, or give {option}another name"
            )
        return FrameTime(_utc(path, local, stated if stated is not None else settings.utc_offset_h, option), "name")
    if "DateTimeOriginal" in exif:
        when, doubt = _of_exif(path, exif, settings.utc_offset_h, option)
        return FrameTime(when, "EXIF and half of the exposure", doubt)
    raise UserError(
        f"{path}: neither its name nor its metadata tell the time: give {option}{_NAME}, or say by time_pattern in the "
        "camera's file (--time-pattern) how its name tells it"
    )


def _utc(
    path: Path, local: datetime, offset_h: float | None, option: str, exposure_s: Any = None
) -> np.datetime64:
    """The middle of an exposure that began at a local time."""
    if local.tzinfo is None and offset_h is None:
        raise UserError(
            f"{path}: says {local}, not in which zone: give {option}utc_offset_h (--utc-offset, or in the camera's "
            "file; 0 for UTC, 1 for UTC+1)"
        )
    try:
        if local.tzinfo is None:
            local = local.replace(tzinfo=timezone(timedelta(hours=offset_h or 0.0)))
        middle = (local + _half(exposure_s)).astimezone(UTC).replace(tzinfo=None)
    except OverflowError:
        raise UserError(f"{path}: says {local}, at the end of all calendars: set the right time") from None
    return np.datetime64(middle, "ms")


def _by_usual(name: str) -> datetime | None:
    found = _USUAL.search(name)
    if found is None:
        return None
    parts = [int(part or 0) for part in found.groups()]
    try:
        return datetime(*parts)  # type: ignore[arg-type]
    except ValueError:  # the thirtieth of February
        return None


def _by_pattern(path: Path, pattern: str, option: str) -> datetime:
    """The first place in the name that a strptime pattern fits."""
    parts = re.split(r"(%.)", pattern)
    directives = parts[1::2]
    twice = len(set(directives)) < len(directives)
    if twice or not set(directives) <= set(_DIRECTIVES) or not {"%Y", "%y"} & set(directives):
        raise UserError(
            f"time pattern {shown(pattern)}: takes {' '.join(_DIRECTIVES)}, each once, a year among them, such as "
            "%d%m%y_%H%M%S"
        )
    expression = "".join(_DIRECTIVES[part] if i % 2 else re.escape(part) for i, part in enumerate(parts))
    for found in re.finditer(rf"(?=({expression}))", path.name):
        try:
            return datetime.strptime(found[1], pattern)
        except ValueError:
            continue
    raise UserError(f"{path}: its name does not follow the time pattern {shown(pattern)}: give {option}another pattern")


def _hours(said: re.Match[str]) -> float:
    """UTC, UTCp1 (as Hamburg's cameras write UTC+1), GMT-3, UTC+05:30, UTC+5.5."""
    if said.re is _ZULU or said[1] is None:
        return 0.0
    return (1 if said[1] in "pP+" else -1) * (float(said[2]) + float(said[3] or 0) / 60 + float(said[4] or 0))


def _of_fits(path: Path, header: dict[str, Any], option: str) -> np.datetime64:
    text = str(header["DATE-OBS"]).strip()
    clock = header.get("TIME-OBS") or header.get("UTSTART") or header.get("UT")
    if "T" not in text and clock:
        text = f"{text}T{clock}"
    if re.fullmatch(r"\d{4}-?\d{2}-?\d{2}", text):
        raise UserError(f"{path}: FITS DATE-OBS {shown(text)} is a day without a time: give {option}a header with one")
    try:
        start = datetime.fromisoformat(text)
    except ValueError:
        raise UserError(f"{path}: FITS DATE-OBS {shown(text)} is no time: give {option}a header that has one") from None
    return _utc(path, start, 0.0, option, header.get("EXPTIME", header.get("EXPOSURE")))


def _of_exif(path: Path, exif: dict[str, str], offset_h: float | None, option: str) -> tuple[np.datetime64, str]:
    """The zone that is told goes before EXIF's, which is set by hand; where they differ, half a sentence says so."""
    text, zone, doubt = exif["DateTimeOriginal"], exif.get("OffsetTimeOriginal", ""), ""
    try:
        start = datetime.strptime(text, "%Y:%m:%d %H:%M:%S")
        if zone and offset_h is None:
            start = datetime.strptime(f"{text} {zone}", "%Y:%m:%d %H:%M:%S %z")
    except ValueError:
        raise UserError(f"{path}: EXIF time {shown(text)} is none: give {option}{_NAME}") from None
    own = _OFFSET.fullmatch(zone)
    if own and offset_h is not None and abs(float(f"{own[1]}1") * (int(own[2]) + int(own[3]) / 60) - offset_h) > 1e-3:
        doubt = (
            f"its EXIF says UTC{zone}, and utc_offset_h {offset_h:g} (--utc-offset, or in the camera's file) is taken: "
            "leave that out if EXIF is right"
        )
    return _utc(path, start, offset_h, option, exif.get("ExposureTime")), doubt


def _half(exposure_s: Any) -> timedelta:
    """Half of an exposure: headers have its beginning."""
    try:
        seconds = float(exposure_s)
    except (TypeError, ValueError):
        return timedelta(0)
    return timedelta(seconds=seconds / 2 if 0 < seconds <= _LONGEST_EXPOSURE_S else 0)
