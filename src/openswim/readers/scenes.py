"""From files to one scene: each model's files by its reader, domains laid into each other, the part around a place."""

from __future__ import annotations

import os
from collections.abc import Iterable, Sequence
from dataclasses import replace
from inspect import signature
from pathlib import Path
from typing import Any

import numpy as np

from openswim import arguments
from openswim.arguments import number, numbers, shown, takes, whole
from openswim.errors import UserError
from openswim.readers.common.asked import winds_asked
from openswim.readers.common.base import SceneInfo, Time
from openswim.readers.common.bounds import references_allowed
from openswim.readers.common.kept import handed_over
from openswim.readers.common.members import OneMember, of_member
from openswim.readers.domain.beyond import with_beyond
from openswim.readers.domain.cutting import part_of
from openswim.readers.domain.neighbourhood import Neighbourhood
from openswim.readers.domain.shores import astray, complete_ground
from openswim.readers.registry import by_reader
from openswim.readers.series import describe_series, files_at, files_by_time, info_of, times_of
from openswim.scene import Grid, Ground, Scene

Paths = str | os.PathLike[str] | Iterable[str | os.PathLike[str]]


@takes
def open_scene(
    path: Paths,
    time: Time = None,
    around: tuple[float, float] | Neighbourhood | None = None,
    radius_km: float | None = None,
    ground: Ground | None = None,
    allow_references: bool = False,
    member: int | None = None,
    winds: bool = False,
) -> Scene:
    """Open a model's file or files, or a scene saved in the layout of docs/scene-format.md (netCDF or Zarr).

    path : one file, a pattern such as "wrfout_d01_*", or a list of files of one model: a time series, or the parts of
        one state (pressure levels and surface); or of nested domains, of one model or several, of which each place is
        shown from the finest that covers it.
    time : UTC; one of the files' times to within 1 s (default: the first).
    around : (latitude, longitude): only the part of the domain around this place, to `radius_km` (default 200 km) to
        the north, east, south and west. Works over the date line and the poles. Global fields need it: light is
        followed on up to a hemisphere (radius_km=10000). Domains without a place on Earth are laid around it.
    member : which member of an ensemble, by the file's own number (default: the first, and a note says which).
    ground : your own maps of albedo and height, `openswim.Ground(albedo="tile.tif", height="dem.tif")`.
    winds : also the wind on levels, `wind_east` and `wind_north`, by which clouds travel from one time to another.
    allow_references : follow what the files say lies in others, wherever that is, in the network too. By default
        references of kerchunk are followed below the folder of their JSON only, and no other file points anywhere.
    """
    if ground is not None:
        from openswim.ground.maps import maps_of

        maps_of(ground)  # all files now, so that what is wrong with them is known before any work is done
    paths = files_of(path)
    place = _neighbourhood(around, radius_km)
    # what comes of absurd numbers is checked in the end
    with references_allowed(allow_references), handed_over(), winds_asked(winds), np.errstate(all="ignore"):
        groups: dict[Any, list[Path]] = dict(by_reader(paths, times_of))
        if member is not None:
            chosen = whole("member", member)
            groups = {OneMember(reader, chosen): of_member(reader, own, chosen) for reader, own in groups.items()}
        scene = _open_several(groups, time, place) if len(groups) > 1 else _open(*groups.popitem(), time, place)
    scene.notes += [note for note in astray(scene) if note not in scene.notes]  # of one that was kept with it
    for level in scene.levels:
        complete_ground(level)
    if member is not None:
        scene.source = f"{scene.source}, member {member}"
    if place is not None and scene.cut and scene.wider is None and not place.from_space:
        scene.notes.append("a part of the domain was read; clouds beyond it are not in the picture")
    if ground is not None:
        for level in scene.levels:
            level.ground = ground
    return scene


def describe(path: Paths, allow_references: bool = False) -> SceneInfo:
    """What files hold and what will be assumed; `print(describe(path))` is `openswim info path`."""
    with references_allowed(allow_references), handed_over(), np.errstate(all="ignore"):
        first, *others = [each for group in by_reader(files_of(path), info_of).items()
                          for each in _described(*group)]  # fmt: skip
    return replace(first, others=others)


def states_of(path: Paths, allow_references: bool = False) -> list[tuple[np.datetime64 | None, list[Path]]]:
    """The times (datetime64[ms], ascending) that files hold, each with those of the files that are to be opened for it;
    (None, files) where they tell no time."""
    paths = files_of(path)
    with references_allowed(allow_references), handed_over(), np.errstate(all="ignore"):
        groups = by_reader(paths, times_of)
        reader = next(iter(groups))
        if len(paths) > 1 and len(groups) == 1 and not hasattr(reader, "read_parts"):
            return list(files_by_time(reader, paths).items())
        infos = [each for group in groups.items() for each in _described(*group)]
    times = np.unique([np.datetime64(time, "ms") for each in infos for time in each.times])
    return [(time, paths) for time in times] if times.size else [(None, paths)]


def grids_of(path: Paths, time: Time = None, allow_references: bool = False) -> list[tuple[str, Grid]]:
    """The grids of files at a time, with the files' names, from their headers; none of a reader that needs more than
    those."""
    with references_allowed(allow_references), handed_over(), np.errstate(all="ignore"):
        groups = by_reader(files_of(path))
        own = [(reader, each) for reader, paths in groups.items() if hasattr(reader, "grid") for each in paths]
        grids = [(each.name, reader.grid(each, time)) for reader, each in own]
    return [(name, grid) for name, grid in grids if grid is not None]


def members_of(path: Paths, allow_references: bool = False) -> list[int]:
    """The members of an ensemble that files hold, by their own numbers, ascending; none where there is no ensemble."""
    with references_allowed(allow_references), handed_over():
        groups = by_reader(files_of(path))
        found = [reader.members(each) for reader, own in groups.items() if hasattr(reader, "members") for each in own]
    every = sorted(set().union(*found))
    return [] if every == [0] else every  # what a single run is called


def _described(reader: Any, paths: Sequence[Path]) -> list[SceneInfo]:
    """What one model's files hold, one description for all that are of one grid."""
    if len(paths) == 1:
        return [reader.describe(paths[0])]
    if hasattr(reader, "describe_parts"):
        return [reader.describe_parts(paths)]
    return describe_series(reader, paths)


def files_of(path: Paths) -> list[Path]:
    """The files that a name, a pattern with * ? [ ], or a list of these stands for; each once, in order."""
    found: list[Path] = []
    for each in map(Path, arguments.paths("path", path)):
        if os.path.lexists(each) or not any(mark in str(each) for mark in "*?["):
            found.append(each)
            continue
        hits = sorted(Path(each.anchor or ".").glob(str(each.relative_to(each.anchor) if each.anchor else each)))
        if not hits:
            raise UserError(f"{each}: no file matches this pattern")
        found += hits
    if not found:
        raise UserError("no file given: name a model's file")
    return list(dict.fromkeys(found))


def _open(reader: Any, paths: Sequence[Path], time: Time, place: Neighbourhood | None) -> Scene:
    """The scene of one model's files."""
    if hasattr(reader, "read_parts"):
        return with_beyond(reader.read_parts(paths, time, place), place,
                           lambda beyond: reader.read_parts(paths, time, beyond))  # fmt: skip
    if len(paths) == 1:
        return _read(reader, paths[0], time, place)
    holding, time = files_at(reader, paths, time, place)
    if len(holding) == 1:
        return _read(reader, holding[0], time, place)
    from openswim.readers.domain.nested import merged

    return merged([_read(reader, path, time, _wider(place)) for path in holding], place)


def _open_several(groups: dict[Any, list[Path]], time: Time, place: Neighbourhood | None) -> Scene:
    """The scene of several models' files, one domain within the other."""
    from openswim.readers.domain.nested import merged

    if place is None:
        path = list(groups.values())[1][0]
        raise UserError(
            f"{path}: not of the same model as the other files; nested domains need around=(latitude, longitude)"
        )
    return merged([_open(reader, paths, time, _wider(place)) for reader, paths in groups.items()], place)


def _wider(place: Neighbourhood | None) -> Neighbourhood | None:
    """What to read of a domain that may be large, so that it reaches beyond the part that is wanted."""
    if place is None:
        return None
    return replace(place, radius_m=1.2 * place.radius_m + 1e4, far_m=1.2 * place.far_m, if_large=True)


def _read(reader: Any, path: Path, time: Time, place: Neighbourhood | None) -> Scene:
    """A file's scene around a place, in what is seen beyond."""
    return with_beyond(_read_part(reader, path, time, place), place,
                       lambda beyond: _read_part(reader, path, time, beyond))  # fmt: skip


def _read_part(reader: Any, path: Path, time: Time, place: Neighbourhood | None) -> Scene:
    scene: Scene
    if place is None:
        scene = reader.read(path, time)
        return scene
    if "around" in signature(reader.read).parameters:
        scene = reader.read(path, time, around=place)
        return scene
    return part_of(reader.read(path, time), place)


def _neighbourhood(around: tuple[float, float] | Neighbourhood | None, radius_km: float | None) -> Neighbourhood | None:
    if around is None:
        if radius_km is not None:
            raise UserError("radius_km needs around=(latitude, longitude)")
        return None
    if isinstance(around, Neighbourhood):
        return around
    place = numbers("around", around)
    if place.shape != (2,):
        raise UserError(f"around = {shown(around)}: give (latitude, longitude) in degrees")
    lat, lon = (float(angle) for angle in place)
    if radius_km is None:
        return Neighbourhood(lat, lon)
    return Neighbourhood(lat, lon, radius_m=1e3 * number("radius_km", radius_km))
