"""The path of a camera: places, heights and attitudes at times, from CSV or GPX, and smoothly in between."""

from __future__ import annotations

import csv
import difflib
import os
import re
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from openswim.arguments import check_keys, numbers, shown, takes, written_number
from openswim.cameras import Camera
from openswim.cameras.checks import MOST_TURNED_DEG
from openswim.errors import UserError
from openswim.progress import tell
from openswim.scene.frame import horizon_vector
from openswim.scene.times import parse_time
from openswim.system.inputs import check_ordinary

F64 = NDArray[np.float64]

PLACE = ("lat", "lon", "height_m")
ATTITUDE = ("azimuth", "altitude", "roll", "fov")
MOST_POINTS = 100_000
_DECIMALS = 9  # of degrees and m: a tenth of a millimetre, and tables are free of what arithmetic leaves behind
_MOST_COLUMNS = 1000
_FARTHEST = -0.99  # cosine of the angle, as seen from the Earth's centre, up to which two points say which way leads
MOST_BYTES = 50_000_000


@dataclass(frozen=True)
class CameraPath:
    """Where a camera is and how it looks, at times.

    time : (n,) datetime64[ms], increasing. place : (n, 3) latitude, longitude in degrees, height in m above sea level.
    attitude : (n, 4) azimuth, altitude, roll and field of view in degrees; columns of NaN keep the camera's own.
    file : what it was read from.
    """

    time: NDArray[np.datetime64]
    place: F64
    attitude: F64
    file: Path | None = None

    def __post_init__(self) -> None:
        if not (isinstance(self.time, np.ndarray) and self.time.ndim == 1 and self.time.dtype.kind == "M"):
            raise UserError(f"a camera's path: time is {shown(self.time)}: give an array of datetime64[ms]")
        for name, width in (("place", len(PLACE)), ("attitude", len(ATTITUDE))):
            values, shape = numbers(f"a camera's path: {name}", getattr(self, name)), (len(self.time), width)
            if values.shape != shape:
                raise UserError(f"a camera's path: {name} has shape {values.shape}: it must be {shape}")
            object.__setattr__(self, name, values.astype(float))
        if len(self.time) < 2:
            raise UserError("a camera's path needs at least two points")
        forward = np.diff(self.time.astype(np.int64)) > 0
        if not forward.all():
            at = int(np.argmin(forward))
            raise UserError(
                f"a camera's path must go forward in time, and point {at + 2} ({self.time[at + 1]}) is not after the "
                f"one before it ({self.time[at]}): sort its points, each time once"
            )
        fine = (np.abs(self.place) <= (90.0, 360.0, 1e9)).all(axis=1)
        if not fine.all():
            at = int(np.argmin(fine))
            raise UserError(
                f"a camera's path has places that are none: latitude, longitude in degrees, height in m; point "
                f"{at + 1} says {shown(self.place[at].tolist())}"
            )
        apart = (_outward(self.place[1:]) * _outward(self.place[:-1])).sum(-1)
        if (apart < _FARTHEST).any():
            at = int(np.argmin(apart))
            raise UserError(
                f"a camera's path goes to the other side of the Earth from point {at + 1} to {at + 2}: give points on "
                "the way between them"
            )
        for name, values in zip(ATTITUDE, self.attitude.T, strict=True):
            if not np.isfinite(values).all() and not np.isnan(values).all():
                raise UserError(f"a camera's path has no finite {name} at some points: give it at all or at none")
            most = 90.0 if name == "altitude" else MOST_TURNED_DEG
            if (np.abs(values) > most).any():
                raise UserError(f"a camera's path has {name} beyond {most:g} degrees at some points: mend it")

    @classmethod
    @takes
    def read(cls, path: str | os.PathLike[str]) -> CameraPath:
        """A path from GPX (ele, time), or CSV: columns time, lat, lon, height_m; optional azimuth, altitude, roll,
        fov."""
        file = Path(path)
        check_ordinary(file)
        try:
            if file.stat().st_size > MOST_BYTES:
                raise UserError(f"{file}: larger than {MOST_BYTES // 1_000_000} MB: too many points for a path")
            text = file.read_text(encoding="utf-8-sig")
        except (OSError, UnicodeDecodeError) as error:
            why = getattr(error, "strerror", None) or error
            raise UserError(f"{file}: cannot be read as text ({why}): give a CSV or GPX file") from error
        rows = _gpx(text, file) if file.suffix.lower() == ".gpx" or text.lstrip().startswith("<") else _csv(text, file)
        if len(rows) > MOST_POINTS:
            raise UserError(f"{file}: {len(rows)} points; a path has at most {MOST_POINTS}")
        time = np.array([row[0] for row in rows], "datetime64[ms]")
        values = np.array([row[1] for row in rows], float).reshape(len(rows), len(PLACE) + len(ATTITUDE))
        try:
            return cls(time, values[:, :3], values[:, 3:], file)
        except UserError as error:
            raise UserError(f"{file}: {error}") from error

    def at(self, times: NDArray[np.datetime64]) -> tuple[F64, F64]:
        """Place (n, 3) and attitude (n, 4) at times: monotone cubics in place, great circles in the line of sight."""
        from scipy.interpolate import PchipInterpolator

        own = (self.time - self.time[0]).astype("timedelta64[ms]").astype(float)
        asked = (np.asarray(times, "datetime64[ms]") - self.time[0]).astype("timedelta64[ms]").astype(float)
        asked = np.clip(asked, own[0], own[-1])
        over = PchipInterpolator(own, np.column_stack([_outward(self.place), self.place[:, 2]]))(asked)
        lat = np.degrees(np.arctan2(over[:, 2], np.hypot(over[:, 0], over[:, 1])))
        lon = np.degrees(np.arctan2(over[:, 1], over[:, 0]))
        place = np.round(np.column_stack([lat, (lon + 180.0) % 360.0 - 180.0, over[:, 3]]), _DECIMALS)
        attitude = np.full((len(asked), 4), np.nan)
        known = np.all(np.isfinite(self.attitude), axis=0)
        turned, turned_there = _turned(own, self.place, asked, place)
        given = self.attitude - np.column_stack([turned, np.zeros((len(own), 3))])
        for column in np.flatnonzero(known):
            values = given[:, column]
            if ATTITUDE[column] in ("azimuth", "roll"):
                values = np.unwrap(values, period=360.0)  # the short way
            attitude[:, column] = PchipInterpolator(own, values)(asked)
        if known[:2].all():
            attitude[:, :2] = _looking(own, given[:, :2], asked)
        attitude[:, 0] = (attitude[:, 0] + turned_there) % 360.0
        return place, attitude

    def camera(self, base: Camera, times: NDArray[np.datetime64]) -> list[Camera]:
        """The cameras of frames at times: ``base``, moved and turned. Without azimuths it looks along its way."""
        place, attitude = self.at(times)
        out = []
        ahead = self._headings(times) if base.view in ("perspective", "pinhole") else np.full(len(times), np.nan)
        for time, (lat, lon, height), (azimuth, altitude, roll, fov), heading in zip(
            times, place, attitude, ahead, strict=True
        ):
            change: dict[str, Any] = {
                "lat": float(lat), "lon": float(lon), "height_m": float(height), "above": "sea level",
                "x_m": None, "y_m": None,
            }  # fmt: skip
            turned = {"azimuth_deg": azimuth if np.isfinite(azimuth) else heading, "altitude_deg": altitude,
                      "roll_deg": roll, "fov_deg": fov}  # fmt: skip
            if base.view == "perspective":
                change |= {name: float(value) for name, value in turned.items() if np.isfinite(value)}
            try:
                out.append(replace(base, **change))
            except UserError as error:
                raise UserError(f"{self.file or 'a camera path'}: at {time}: {error}") from None
        return out

    def _headings(self, times: NDArray[np.datetime64]) -> F64:
        """Azimuths (n,) of the way itself, degrees; where it stands still, that of before; NaN where it never moves."""
        step = np.timedelta64(500, "ms")
        (before, _), (after, _) = self.at(times - step), self.at(times + step)
        way, (place, _) = _outward(after) - _outward(before), self.at(times)
        east, north = (np.degrees((way * axis).sum(-1)) for axis in _east_north(place))
        still = np.hypot(north, east) < 1e-9
        heading = np.degrees(np.arctan2(east, north)) % 360.0
        if still.all():
            return np.full(heading.shape, np.nan)
        last = np.maximum.accumulate(np.where(still, -1, np.arange(still.size)))
        return np.asarray(heading[np.where(last < 0, int(np.argmin(still)), last)])


def _outward(place: F64) -> F64:
    """Unit vectors (n, 3) from the Earth's centre through places (n, 2 or more): latitude, longitude in degrees."""
    lat, lon = np.radians(place[:, 0]), np.radians(place[:, 1])
    return np.column_stack([np.cos(lat) * np.cos(lon), np.cos(lat) * np.sin(lon), np.sin(lat)])


def _east_north(place: F64) -> tuple[F64, F64]:
    """Unit vectors (n, 3) to the east and to the north at places; at a pole north is along its longitude."""
    lon = np.radians(place[:, 1])
    east = np.column_stack([-np.sin(lon), np.cos(lon), np.zeros_like(lon)])
    return east, np.cross(_outward(place), east)


def _at(own: F64, asked: F64) -> NDArray[np.intp]:
    """The point (n,) after which each of the times comes, never the last one."""
    return np.clip(np.searchsorted(own, asked, side="right") - 1, 0, len(own) - 2)


def _turned(own: F64, points: F64, asked: F64, place: F64) -> tuple[F64, F64]:
    """How far (degrees) north has turned below a camera that has come straight on from the first point, at points and
    at the places of times: the meridians' convergence, and half a circle over a pole."""

    def turn(here: F64, there: F64) -> F64:
        """Azimuth at another place of what is north here, carried along the great circle between both."""
        old, new, north = _outward(here), _outward(there), _east_north(here)[1]
        along = np.cross(old, new)
        carried = north + np.cross(along, north)
        carried += np.cross(along, np.cross(along, north)) / (1.0 + (old * new).sum(-1, keepdims=True))
        x, y = ((carried * axis).sum(-1) for axis in _east_north(there))
        return np.degrees(np.arctan2(x, y))

    turned = np.concatenate([[0.0], np.cumsum(turn(points[:-1], points[1:]))])
    at = _at(own, asked)
    return turned, turned[at] + turn(points[at], place)


def _looking(own: F64, looking_deg: F64, asked: F64) -> F64:
    """Azimuth and altitude on the great circles between the lines of sight of neighbouring points; where these are
    more than 90 degrees apart, and the circle might go by zenith or nadir, the camera pans and tilts evenly."""
    vectors = horizon_vector(looking_deg[:, 0], looking_deg[:, 1])
    at = _at(own, asked)
    share = ((asked - own[at]) / (own[at + 1] - own[at]))[:, None]
    one, other = vectors[at], vectors[at + 1]
    across = looking_deg[at + 1] - looking_deg[at]
    across[:, 0] = (across[:, 0] + 180.0) % 360.0 - 180.0
    panned = looking_deg[at] + share * across
    angle = np.arccos(np.clip((one * other).sum(-1, keepdims=True), -1.0, 1.0))
    small = angle < 1e-6
    safe = np.where(small | (angle > np.pi / 2), 1.0, np.sin(angle))
    first = np.where(small, 1 - share, np.sin((1 - share) * angle) / safe)
    second = np.where(small, share, np.sin(share * angle) / safe)
    mixed = first * one + second * other
    mixed /= np.linalg.norm(mixed, axis=-1, keepdims=True)
    azimuth = np.degrees(np.arctan2(mixed[:, 0], mixed[:, 1])) % 360.0
    along = np.column_stack([azimuth, np.degrees(np.arcsin(np.clip(mixed[:, 2], -1.0, 1.0)))])
    return np.where(angle > np.pi / 2, panned, along)


def _csv(text: str, file: Path) -> list[tuple[np.datetime64, list[float]]]:
    lines = csv.reader(text.splitlines(keepends=True))
    try:
        table = [(lines.line_num, [cell.strip() for cell in row]) for row in lines if any(map(str.strip, row))]
    except csv.Error as error:
        raise UserError(f"{file}: line {lines.line_num} is no CSV ({error}): mend it") from error
    names = [name.lower() for name in table[0][1]] if table else []
    if len(names) > _MOST_COLUMNS:
        raise UserError(f"{file}: {len(names)} columns; leave out those that a path does not have")
    lacking = [name for name in ("time", *PLACE) if name not in names]
    if lacking:
        raise UserError(
            f"{file}: no column {', '.join(lacking)}; the first line names time, lat, lon, height_m and, as you like, "
            f"{', '.join(ATTITUDE)}"
        )
    named = [name for name in names if name]
    known = ("time", *PLACE, *ATTITUDE)
    others = [name for name in named if name not in known]
    misspelt = [name for name in others if difflib.get_close_matches(name, known, n=1)]
    check_keys(misspelt, known, f"{file}: the first line")
    if others:  # as logs of drones have them
        tell(f"note: {file}: columns that are not used: {', '.join(map(shown, others[:9]))}")
    if any(named.count(name) > 1 for name in known):
        raise UserError(f"{file}: the first line has a name twice: leave one of the columns out")
    rows = []
    if len(table) > MOST_POINTS + 1:
        raise UserError(f"{file}: {len(table) - 1} points; a path has at most {MOST_POINTS}")
    for number, cells in table[1:]:
        if any(cells[len(names) :]):
            raise UserError(f"{file}: line {number} has more cells than the first line has names: mend it")
        row = dict(zip(names, cells, strict=False))
        values = [_cell(row.get(name, ""), name, f"line {number}", file) if name in names else np.nan
                  for name in (*PLACE, *ATTITUDE)]  # fmt: skip
        try:
            time = parse_time(row["time"])
        except (ValueError, UserError) as error:
            raise UserError(f"{file}: line {number} is no point of a path ({error})") from error
        assert time is not None
        rows.append((time, values))
    return rows


def _cell(text: str, name: str, where: str, file: Path) -> float:
    """The finite number of a cell."""
    try:
        value = written_number(text)
    except ValueError:
        value = np.nan
    if not np.isfinite(value):
        remedy = ", or leave the column out" if name in ATTITUDE else ""
        raise UserError(f"{file}: {where}: {name} is {shown(text)}: give a finite number{remedy}")
    return value


def _gpx(text: str, file: Path) -> list[tuple[np.datetime64, list[float]]]:
    from xml.etree import ElementTree

    if "<!DOCTYPE" in text or "<!ENTITY" in text:
        raise UserError(f"{file}: a GPX file with declarations of its own is not read; save it without them")
    if re.search(r"""xmlns[^=<>]{0,99}=\s*["'][^"']{1000}""", text):  # each element would carry it
        raise UserError(f"{file}: a GPX file with endless names (xmlns) is not read; save it without them")
    try:
        root = ElementTree.fromstring(text)
    except ElementTree.ParseError as error:
        raise UserError(f"{file}: damaged GPX ({error})") from error
    rows = []
    for number, point in enumerate((each for each in root.iter() if each.tag.endswith("trkpt")), 1):
        inside = {child.tag.rpartition("}")[2]: (child.text or "").strip() for child in point}
        try:
            time = parse_time(inside["time"])
            place = [float(point.attrib["lat"]), float(point.attrib["lon"])]
        except (KeyError, ValueError, UserError) as error:
            raise UserError(f"{file}: track point {number} lacks time, lat or lon, or they are none") from error
        if "ele" not in inside:
            raise UserError(f"{file}: track point {number} has no height (ele, m above sea level): add it to each")
        place.append(_cell(inside["ele"], "ele", f"track point {number}", file))
        assert time is not None
        rows.append((time, [*place, *[np.nan] * len(ATTITUDE)]))
    if not rows:
        raise UserError(f"{file}: no track points (trkpt) in it")
    return rows
