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
from openswim.readers.registry import by_reader
from openswim.readers.wrf.increments import put_increments
from openswim.readers.wrf.reader import WRFReader
from openswim.scene.files import check_target
from openswim.scene.variables import LEVEL_DIMS

F64 = NDArray[np.float64]

_PUT_BACK = ("content", "number")


def write_back(
    analysis: Found, model_file: str | os.PathLike[str], out: str | os.PathLike[str]
) -> dict[str, int]:
    """Write a copy of a model's file with what an analysis changed; returns how many nodes of each variable changed.

    model_file : of WRF, on the grid of the analysis and with its time; it is never written to. Contents and numbers
    that were controls are put back, as analysis minus first guess, at the analysis's time only. Where cloud was added
    vapour is raised to saturation, where all was taken away it is lowered to 95 % of it; temperature stays.
    """
    check_kind("write_back: analysis", analysis, Found, "give what openswim.analyse returns")
    for name in (model_file, out):
        check_kind("write_back: file", name, (str, os.PathLike), "give a file's name")
    path, target = Path(model_file), Path(out)
    check_write_back(path, [each.name for each in analysis.rows.controls.variables])
    check_target(target, [path], "write-back")
    scene = analysis.rows.scene
    assert scene.grid is not None
    return put_increments(path, target, scene.grid, increments_of(analysis), scene.time)


def check_write_back(model_file: Path, controls: Sequence[str] | str) -> None:
    """Raise UserError where an analysis with these controls could not be put back into this file."""
    named = controls if isinstance(controls, list | tuple) else [controls]
    listed = [variable_of(str(name)) for name in named]
    if not any(each.kind in _PUT_BACK for each in listed):
        names = ", ".join(each.name for each in listed)
        raise UserError(f"write-back: {names} cannot be put back: contents such as cloud_liquid and numbers can")
    reader = next(iter(by_reader([model_file])))
    if not isinstance(reader, WRFReader):
        raise UserError(f"{model_file}: {reader.name} files cannot be written back to; those of WRF can")


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
