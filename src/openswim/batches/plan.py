"""The plan of a batch: a TOML file that says which pictures are to be made (docs/batch.md)."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from openswim.arguments import check_keys, check_kind, number, numbers, shown, whole
from openswim.batches.names import Names
from openswim.batches.plan_cameras import PlannedCamera, planned_cameras
from openswim.batches.values import check_name, text_of, texts
from openswim.cameras.toml_text import read_toml
from openswim.colour.exposure import check_exposure, check_gamma
from openswim.colour.picture import check_caption
from openswim.errors import UserError
from openswim.lighting import WAVELENGTHS_NM, checked_wavelengths
from openswim.scene.times import parse_time
from openswim.solver import Solver

VERSION = 1
MOST_WEATHERS, MOST_MEMBERS, MOST_TIMES = 1000, 10_000, 100_000
SUN_W_M2 = 120.0  # of direct light across the beam: WMO-No. 8, sunshine
CLOUD_DEPTH = 0.03  # along a line of sight, from which on cirrus is seen (Sassen and Cho 1992)
ENSEMBLE = "ensemble"  # the folder of what all members say
_TOP = ("openswim_batch", "files", "members", "output", "outputs", "times", "from", "to", "sun", "solver", "quality",
        "wavelengths", "only", "aerosol", "aod", "weather", "camera", "picture", "ensemble")  # fmt: skip
_LOOK = ("exposure", "eye", "matrix", "gamma", "bits", "caption")


@dataclass(frozen=True)
class Weather:
    """One run of a model: its files, as patterns that are resolved, and which members of them: the first (None) or
    numbers; ``all_members``: those that the files of each time hold."""

    name: str
    files: tuple[Path, ...]
    members: tuple[int | None, ...] = (None,)
    all_members: bool = False


@dataclass(frozen=True)
class Ensemble:
    """What is asked of all members together: there is sun where direct light across the beam is ``sun_w_m2`` and more,
    and cloud where the optical depth along a line of sight is ``cloud_depth`` and more."""

    sun_w_m2: float = SUN_W_M2
    cloud_depth: float = CLOUD_DEPTH


@dataclass(frozen=True)
class Plan:
    """All that a plan says, checked."""

    folder: Path
    weathers: tuple[Weather, ...]
    cameras: tuple[PlannedCamera, ...]
    times: tuple[np.datetime64, ...] = ()
    start: np.datetime64 | None = None
    end: np.datetime64 | None = None
    sun: np.datetime64 | tuple[float, float] | None = None
    solver: Solver = Solver()  # noqa: RUF009
    wavelengths_nm: tuple[float, ...] = WAVELENGTHS_NM
    only: tuple[str, ...] = ()
    aerosol: str | None = None
    aod: float | None = None
    look: tuple[tuple[str, Any], ...] = ()
    ensemble: Ensemble | None = None
    allow_references: bool = False
    patterns: tuple[str, ...] = ()  # of the files, as the plan has them

    @property
    def sun_options(self) -> dict[str, Any]:
        """Where the sun is, as `openswim.light` takes it; nothing where that follows from the weather's time."""
        if self.sun is None:
            return {}
        return {"sun": self.sun} if isinstance(self.sun, tuple) else {"time": self.sun}


def read_plan(
    path: str | os.PathLike[str], files: Sequence[str | os.PathLike[str]] = (),
    output: str | os.PathLike[str] | None = None, allow_references: bool = False, watched: bool = False,
) -> Plan:  # fmt: skip
    """Read a plan; raises UserError with one line.

    files, output: in place of those that the plan names. watched: files are to arrive, so none is looked for. Files
    that the plan itself names lie below its own folder, unless ``allow_references``.
    """
    check_kind("plan", path, (str, os.PathLike), "give a file's name")
    path = Path(path)
    tables = read_toml(path, "a plan in TOML")
    names = Names(path.parent, allow_references)
    try:
        if watched:
            tables = {"files": "*"} | tables
        plan = _plan(tables, names, [Path(each) for each in files], None if output is None else Path(output), watched)
        return replace(plan, patterns=texts(tables, "files", ()))
    except UserError as error:
        text = str(error)
        raise UserError(text if str(path) in text else f"{path}: {text}") from None


def _plan(
    tables: dict[str, Any], names: Names, files: Sequence[Path], output: Path | None, watched: bool
) -> Plan:
    version = tables.get("openswim_batch")
    if version != VERSION or isinstance(version, bool):
        said = "" if version is None else f", it says {shown(version)}"
        raise UserError(f"no plan for this version: a plan begins with the line openswim_batch = {VERSION}{said}")
    check_keys(tables, _TOP, "the plan")
    folder = output if output is not None else names.beside(text_of(tables, "output", "openswim-batch"), "output")
    sun = tables.get("sun")
    solver, quality = text_of(tables, "solver", "fast"), text_of(tables, "quality", "standard")
    wavelengths = tuple(checked_wavelengths(numbers("wavelengths", tables.get("wavelengths", WAVELENGTHS_NM))).tolist())
    aod = tables.get("aod")
    look = _look(tables.get("picture", {}))
    ensemble = _ensemble(tables["ensemble"]) if "ensemble" in tables else None
    if ensemble is not None and solver == "reference":
        raise UserError("[ensemble] needs solver fast or swim: reference does not tell how deep its clouds are")
    return Plan(
        folder, _weathers(tables, names, files, watched),
        planned_cameras(tables.get("camera"), texts(tables, "outputs", (".png",)), names, dict(look).get("bits", 8),
                        ensemble is not None),
        _times(tables.get("times", [])), _time(tables.get("from"), "from"), _time(tables.get("to"), "to"),
        None if sun is None else _sun(sun), Solver(solver, quality=quality), wavelengths, texts(tables, "only", ()),
        text_of(tables, "aerosol", None), None if aod is None else number("aod", aod), look, ensemble, names.anywhere,
    )  # fmt: skip


def _weathers(
    tables: dict[str, Any], names: Names, files: Sequence[Path], watched: bool
) -> tuple[Weather, ...]:
    listed = tables.get("weather", [])
    check_kind("weather", listed, list, "write a table [[weather]] for each run")
    if watched and listed:
        raise UserError("a watched folder has the files of one run: leave out the tables [[weather]]")
    if "files" in tables and listed:
        raise UserError("give either files, or a table [[weather]] for each run")
    if files and listed:
        raise UserError("has tables [[weather]] with files of their own: leave out the files on the command line")
    if not listed and watched:
        return (Weather("", (), *_members(tables.get("members"))),)
    if not listed:
        found = tuple(files) if files else names.files(texts(tables, "files", ()), "files")
        if not found:
            raise UserError('names no files: write files = "wrfout_d01_*", or give them on the command line')
        return (Weather("", found, *_members(tables.get("members"))),)
    if "members" in tables:
        raise UserError("members belong to each [[weather]]")
    if len(listed) > MOST_WEATHERS:
        raise UserError(f"{len(listed)} tables [[weather]]; at most {MOST_WEATHERS}")
    weathers = []
    for count, table in enumerate(listed, 1):
        what = f"[[weather]] {count}"
        check_kind(what, table, dict, "write a table")
        check_keys(table, ("name", "files", "members"), what)
        name = check_name(f"{what} name", table.get("name"))
        weathers.append(Weather(name, names.files(texts(table, "files", ()), f"{what} files"),
                                *_members(table.get("members"))))  # fmt: skip
    if "ensemble" in tables and any(weather.name == ENSEMBLE for weather in weathers):
        raise UserError(f"[[weather]] is called {ENSEMBLE}, as the folder of what all members say: call it otherwise")
    if len({weather.name for weather in weathers}) < len(weathers):
        raise UserError("two [[weather]] have the same name")
    return tuple(weathers)


def _members(given: Any) -> tuple[tuple[int | None, ...], bool]:
    """Numbers, and whether all are wanted, whatever their numbers."""
    if given is None or given == "all":
        return (None,), given is not None
    if isinstance(given, str):
        raise UserError(f'members = {shown(given)}: write "all", or the files\' own numbers')
    listed = given if isinstance(given, list) else [given]
    found = tuple(whole("members", each) for each in listed)
    if not found or len(found) > MOST_MEMBERS or len(set(found)) < len(found):
        raise UserError(f"members: give 1 to {MOST_MEMBERS} numbers, each once")
    if min(found) < 0:
        raise UserError(f"members: {min(found)} is no member: give the files' own numbers")
    return found, False


def _times(given: Any) -> tuple[np.datetime64, ...]:
    listed = given if isinstance(given, list) else [given]
    if len(listed) > MOST_TIMES:
        raise UserError(f"times: {len(listed)} are given, at most {MOST_TIMES}")
    found = {time for each in listed if (time := _time(each, "times")) is not None}
    return tuple(sorted(found))


def _time(given: Any, what: str) -> np.datetime64 | None:
    try:
        return parse_time(given)
    except UserError:
        raise UserError(f'{what} {shown(given)} is not understood: write "2005-08-28T18:00" (UTC)') from None


def _sun(given: Any) -> np.datetime64 | tuple[float, float]:
    if isinstance(given, list):
        angles = numbers("sun", given)
        if angles.shape != (2,) or not (np.isfinite(angles).all() and abs(angles[0]) <= 360 and abs(angles[1]) <= 90):
            raise UserError(f"sun {shown(given)}: give [azimuth, altitude] in degrees, or a time")
        return float(angles[0]), float(angles[1])
    time = _time(given, "sun")
    assert time is not None
    return time


def _look(table: Any) -> tuple[tuple[str, Any], ...]:
    """How pictures look, as `openswim.save` takes it."""
    check_kind("picture", table, dict, "write a table [picture]")
    check_keys(table, _LOOK, "[picture]")
    if "exposure" in table:
        check_exposure(table["exposure"])
    if "gamma" in table:
        check_gamma(table["gamma"])
    if table.get("matrix", "srgb") not in ("srgb", "paper"):
        raise UserError(f"[picture] matrix {shown(table['matrix'])}: choose srgb or paper")
    if table.get("bits", 8) not in (8, 16):
        raise UserError(f"[picture] bits {shown(table['bits'])}: choose 8 or 16")
    check_kind("[picture] eye", table.get("eye", False), bool, "write true or false")
    check_caption(table.get("caption", "inside"))
    return tuple(sorted(table.items()))


def _ensemble(table: Any) -> Ensemble:
    check_kind("ensemble", table, dict, "write a table [ensemble]")
    check_keys(table, ("sun_w_m2", "cloud_depth"), "[ensemble]")
    found = Ensemble(*(number(f"[ensemble] {name}", table.get(name, default))
                       for name, default in (("sun_w_m2", SUN_W_M2), ("cloud_depth", CLOUD_DEPTH))))  # fmt: skip
    if not (0 < found.sun_w_m2 <= 1500 and 0 < found.cloud_depth <= 100):
        raise UserError("[ensemble] sun_w_m2 is within 0 to 1500 W m-2, cloud_depth within 0 to 100")
    return found
