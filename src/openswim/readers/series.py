"""Several files of one model as one series of times, and the finest of several nested domains."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from openswim.errors import UserError
from openswim.readers.common.base import SceneInfo, iso, times_text
from openswim.readers.common.kept import once
from openswim.readers.domain.neighbourhood import Neighbourhood
from openswim.scene.times import Time, parse_time


def files_at(reader: Any, paths: Sequence[Path], time: Time, place: Neighbourhood | None) -> tuple[list[Path], Time]:
    """The files that hold a time (default: the first of all), and that time.

    Several where domains are nested: those that cover the place; without a place, the coarsest alone.
    """
    times = {path: times_of(reader, path) for path in paths}
    everything = np.unique(np.concatenate([np.asarray(each, "datetime64[ms]") for each in times.values()]))
    if not everything.size:
        raise UserError(f"{paths[0]}: several files without times: open them one by one")
    wanted = parse_time(time)
    if wanted is None:
        wanted = everything[0]
    near = everything[np.argmin(np.abs(everything - wanted))]
    if abs(near - wanted) > np.timedelta64(1, "s"):
        raise UserError(
            f"{paths[0]}: no time {iso(wanted)} in it and the others; they have {times_text(everything)}: "
            "choose one of these times"
        )
    holding = [path for path in paths if near in np.asarray(times[path], "datetime64[ms]")]
    if len(holding) > 1:
        return _nested(reader, holding, near, place), near
    return holding, near


def files_by_time(reader: Any, paths: Sequence[Path]) -> dict[np.datetime64, list[Path]]:
    """Every time of a series, ascending, and the files that hold it."""
    found: dict[np.datetime64, list[Path]] = {}
    for path in paths:
        for time in np.unique(np.asarray(times_of(reader, path), "datetime64[ms]")):
            found.setdefault(time, []).append(path)
    if not found:
        raise UserError(f"{paths[0]}: several files without times: open them one by one")
    return dict(sorted(found.items()))


def describe_series(reader: Any, paths: Sequence[Path]) -> list[SceneInfo]:
    """The first file's description for every grid, with the times of all files on it."""
    series: dict[tuple[str, ...], list[SceneInfo]] = {}
    for info in (info_of(reader, path) for path in paths):
        series.setdefault((info.grid, info.projection, info.spacing), []).append(info)
    return [_joined(alike) for alike in series.values()]


def _joined(alike: Sequence[SceneInfo]) -> SceneInfo:
    if len(alike) == 1:
        return alike[0]
    times = sorted({time for info in alike for time in info.times})
    return replace(alike[0], path=f"{alike[0].path} and {len(alike) - 1} more", times=times)


def times_of(reader: Any, path: Path) -> list[np.datetime64]:
    """The times of one file of a series; within `handed_over` it is looked for them once."""
    if hasattr(reader, "times"):
        return once("times", path, lambda: list(reader.times(path)))
    return [np.datetime64(time, "ms") for time in info_of(reader, path).times]


def info_of(reader: Any, path: Path) -> SceneInfo:
    """The description of one file of a series; within `handed_over` it is made once."""
    return once("info", path, lambda: reader.describe(path))


def _nested(reader: Any, paths: Sequence[Path], time: np.datetime64, place: Neighbourhood | None) -> list[Path]:
    grids = {path: reader.grid(path, time) for path in paths} if hasattr(reader, "grid") else {}
    if not grids or any(grid is None or not grid.curved for grid in grids.values()):
        raise UserError(f"{paths[0]} and {paths[1]} both hold {iso(time)}: open one of them")
    by_cell = sorted(paths, key=lambda path: grids[path].spacing_m()[0])
    alike = [(grid.shape, *grid.lonlat(0, 0)) for grid in grids.values()]
    if any(one == other for n, one in enumerate(alike) for other in alike[:n]):
        of_ensemble = any(reader.members(path) - {0} for path in paths) if hasattr(reader, "members") else False
        which = "one of them, or one member (--member)" if of_ensemble else "one of them"
        raise UserError(f"{paths[0]} and others hold {iso(time)} on the same grid: open {which}")
    return by_cell[-1:] if place is None else by_cell
