"""The increments of an analysis, put back into a copy of the model's own file."""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from openswim.arguments import check_kind
from openswim.assimilation.departures import scene_of
from openswim.assimilation.observing.variables import variable_of
from openswim.assimilation.result import Found
from openswim.errors import UserError
from openswim.readers.common.base import Reader
from openswim.readers.models.laps import LAPSReader
from openswim.readers.models.laps_increments import check_files as check_laps
from openswim.readers.models.laps_increments import put_increments as put_into_laps
from openswim.readers.registry import by_reader
from openswim.readers.wrf.increments import check_file as check_wrf
from openswim.readers.wrf.increments import put_increments as put_into_wrf
from openswim.readers.wrf.reader import WRFReader
from openswim.scene.files import check_target
from openswim.scene.variables import LEVEL_DIMS

F64 = NDArray[np.float64]

_PUT_BACK = ("content", "number")


Names = str | os.PathLike[str]


def write_back(
    analysis: Found, model_file: Names | Sequence[Names], out: Names, member: int | None = None
) -> dict[str, int]:
    """Write a copy of a model's file with what an analysis changed; returns how many nodes of each variable changed.

    model_file : of WRF, or of LAPS, whose products of one time may be several; on the grid of the analysis and with its
    time. It is never written to. out : a file, of several products a folder. member : of an ensemble in one file, that
    which was analysed (default: the first). Contents and numbers that were controls
    are put back, as analysis minus first guess, at the analysis's time only. Where cloud was added (1e-6 kg/kg; of less
    its share) vapour is raised to saturation, where all was taken away it is lowered to 95 % of it; temperature stays.
    """
    check_kind("write_back: analysis", analysis, Found, "give what openswim.analyse returns")
    listed = list(model_file) if isinstance(model_file, list | tuple) else [model_file]
    for name in (*listed, out):
        check_kind("write_back: file", name, (str, os.PathLike), "give a file's name")
    paths, target = [Path(name) for name in listed], Path(out)  # type: ignore[arg-type]
    reader = check_write_back(paths, target, [each.name for each in analysis.rows.controls.variables])
    scene, found = analysis.rows.scene, increments_of(analysis)
    assert scene.grid is not None
    if isinstance(reader, LAPSReader):
        return put_into_laps(paths, target, scene.grid, found, scene.time)
    return put_into_wrf(paths[0], target, scene.grid, found, scene.time, member)


def check_write_back(
    model_files: Sequence[Path], out: Path, controls: Sequence[str] | str, taken: Sequence[Path] = ()
) -> Reader:
    """Raise UserError where an analysis with these controls could not be put back into copies of these files, or the
    copies would replace them or what is ``taken``; the files' reader."""
    named = controls if isinstance(controls, list | tuple) else [controls]
    listed = [variable_of(str(name)) for name in named]
    if not any(each.kind in _PUT_BACK for each in listed):
        names = ", ".join(each.name for each in listed)
        raise UserError(f"write-back: {names} cannot be put back: contents such as cloud_liquid and numbers can")
    readers = list(by_reader(model_files))
    where = ", ".join(map(str, model_files))
    if len(readers) > 1 or not isinstance(readers[0], WRFReader | LAPSReader):
        names = ", ".join(each.name for each in readers)
        raise UserError(f"{where}: {names} files cannot be written back to; those of WRF can, and products of LAPS")
    several = len(model_files) > 1
    if several and isinstance(readers[0], WRFReader):
        raise UserError(f"{where}: name the one WRF file that has the time of the analysis")
    if several and not out.is_dir():
        raise UserError(f"write-back {out}: name a folder that exists, for copies of {len(model_files)} products")
    for target in [out / path.name for path in model_files] if several else [out]:
        check_target(target, [*model_files, *taken], "write-back")
    if isinstance(readers[0], LAPSReader):
        check_laps(model_files)
    else:
        check_wrf(model_files[0])
    return readers[0]


def increments_of(analysis: Found) -> dict[str, F64]:
    """Analysis minus first guess, (nz, ny, nx), of contents (kg m-3) and numbers (m-3) that were controls. What is not
    above the floor is clear air in both."""
    rows = analysis.rows
    found, first = scene_of(rows, analysis.state).data, scene_of(rows, analysis.first).data
    out = {}
    for each in rows.controls.variables:
        if each.kind in _PUT_BACK:
            now, was = (np.asarray(data[each.name].transpose(*LEVEL_DIMS), float) for data in (found, first))
            if each.kind == "number":
                # a first guess has a number in clear air too, which the model has not
                own = np.asarray(rows.scene.data[each.name].transpose(*LEVEL_DIMS), float)
                cloudy = found[f"{each.species}_content"].transpose(*LEVEL_DIMS).values > 0
                out[each.name] = np.where(own > 0, now - was, np.where(cloudy, now, 0.0))
            else:
                out[each.name] = now - was
    return out
