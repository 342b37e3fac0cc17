"""Some 150 spoilt files: each is refused in one line or opened with a note, never quietly another picture.

Wrong units, values no atmosphere has, fields that are missing, cut, or lost above the ground, by the roles that
variables have in each model's file. What comes out with the fields of the good file is no fault.
"""

from __future__ import annotations

import shutil
from collections.abc import Callable
from pathlib import Path

import netCDF4
import numpy as np
import pytest
from tests.readers import grib_files
from tests.readers.conftest import WRFSpec, write_wrf
from tests.readers.model_files import MAKERS
from tests.readers.verdicts import Found, verdict

from openswim.errors import UserError
from openswim.readers import open_scene

FILES: dict[str, Callable[[Path], list[Path]]] = {
    **{name: lambda folder, make=make: make(folder).paths for name, make in MAKERS.items()},
    "WRF": lambda folder: [write_wrf(folder / "wrfout_d01_x", WRFSpec())],
}
# Variables by what they are: pressure, humidity, contents, height, radii, latitude and longitude.
ROLES = {
    "ERA5 (new CDS)": ("pressure_level", "q", "clwc ciwc", "z", "", "latitude", "longitude"),
    "MERRA-2 model layers": ("DELP", "QV", "QL", "", "", "lat", "lon"),
    "UM": ("m01s00i408", "m01s00i010", "m01s00i254 m01s00i012", "level_height", "", "grid_latitude", "grid_longitude"),
    "COSP": ("pfull", "qv", "mr_lsliq fl_lsrain", "height", "Reff", "lat", "lon"),
    "RAMS with header": ("PI", "RV", "RCP RSP", "", "", "GLAT", "GLON"),
    "LAPS": ("level", "sh", "lwc rai", "ht", "", "", ""),
    "ecRad columns": ("pressure_hl", "q", "q_ice", "", "re_liquid re_ice", "lat", "lon"),
    "MicroHH": ("phydro", "qt", "ql", "z", "", "", ""),
    "CM1": ("prs", "qv", "qi", "zh", "", "", ""),
    "WRF": ("PB", "QVAPOR", "QCLOUD", "PHB", "", "XLAT", "XLONG"),
}


def _low_half(values: np.ndarray) -> np.ndarray:
    """Missing in a corner of the lower half, and of the upper half, whichever way the levels run."""
    if values.ndim < 3:
        return np.full_like(values, np.nan)
    levels = values.shape[-3]
    values[..., : levels // 2, :3, :3] = np.nan
    values[..., -(levels // 2) :, 3:5, 3:5] = np.nan
    return values


WAYS: dict[str, list[tuple[str, Callable[[np.ndarray], np.ndarray]]]] = {
    "pressure": [
        ("x .01", lambda v: 0.01 * v), ("x .001", lambda v: 1e-3 * v), ("x 100", lambda v: 100 * v),
        ("constant", lambda v: np.full_like(v, v.mean())),
    ],
    "humidity": [
        ("x 1000", lambda v: 1e3 * v), ("-1", lambda v: np.full_like(v, -1)), ("1e20", lambda v: np.full_like(v, 1e20)),
    ],
    "content": [
        ("NaN", lambda v: np.full_like(v, np.nan)), ("negative", lambda v: -v), ("x 1000", lambda v: 1e3 * v),
        ("cut", _low_half),
    ],
    "height": [("x 1000", lambda v: 1e3 * v), ("x .01", lambda v: 0.01 * v)],
    "radius": [
        ("x 1e6", lambda v: 1e6 * v), ("negative", lambda v: -v), ("NaN", lambda v: np.full_like(v, np.nan)),
        ("x .001", lambda v: 1e-3 * v),
    ],
    "latitude": [("+181", lambda v: v + 181), ("x 10", lambda v: 10 * v)],
    "longitude": [("x 1000", lambda v: 1e3 * v)],
}  # fmt: skip


def _changed(paths: list[Path], name: str, change: Callable[[np.ndarray], np.ndarray] | None) -> None:
    """Change one variable, or rename it (None), in the file that has it."""
    for path in paths:
        with netCDF4.Dataset(path, "a") as file:
            if name not in file.variables:
                continue
            if change is None:
                file.renameVariable(name, "lost")
                return
            file.set_auto_mask(False)
            values = file[name][:]
            if np.issubdtype(values.dtype, np.floating):
                file[name][:] = change(values.copy())
            return
    raise AssertionError(name)


@pytest.mark.parametrize("model", list(ROLES))
def test_no_spoilt_file_is_quietly_another_picture(tmp_path, model):
    (tmp_path / "good").mkdir()
    good_paths = FILES[model](tmp_path / "good")
    good = Found.of(open_scene(good_paths))
    names = dict(zip(WAYS, ROLES[model], strict=True))
    cases = [(name, way, change) for role, each in names.items() for name in each.split() for way, change in WAYS[role]]
    cases += [(name, "lost", None) for role in ("humidity", "content", "radius") for name in names[role].split()]
    verdicts = {}
    for name, way, change in cases:
        shutil.rmtree(tmp_path / "spoilt", ignore_errors=True)
        shutil.copytree(tmp_path / "good", tmp_path / "spoilt")
        paths = [tmp_path / "spoilt" / path.name for path in good_paths]
        _changed(paths, name, change)
        verdicts[f"{name} {way}"] = verdict(paths, good)
    assert {case: one for case, one in verdicts.items() if one not in ("refused", "told", "same")} == {}
    # a gate that lets everything pass would be seen here
    assert sum(one == "refused" for one in verdicts.values()) > 0.4 * len(verdicts)
    # what falls may be much in the core of a storm, so that it is told alone
    falls = {"fl_lsrain", "RSP", "rai"}
    too_much = [case for case in verdicts if case.endswith(("x 100", "x 1000")) and case.split()[0] not in falls]
    assert all(verdicts[case] != "told" for case in too_much)


@pytest.mark.parametrize("kept", [0.3, 0.5, 0.8])
@pytest.mark.parametrize("product", ["hrrr", "gfs"])
def test_grib_of_which_messages_are_lost(tmp_path, product, kept):
    """Whole messages, so that nothing is damaged: the levels and species that are gone are told."""
    made = grib_files.hrrr() if product == "hrrr" else grib_files.on_pressure(grib_files.AROME)
    path = grib_files.write(tmp_path / "file.grib", made)
    good = Found.of(open_scene(path))
    whole = path.read_bytes()
    starts = [at for at in range(len(whole)) if whole.startswith(b"GRIB", at) and whole[at + 7] in (1, 2)]
    path.write_bytes(whole[: starts[int(kept * len(starts))]])
    assert verdict([path], good) in ("refused", "told")


@pytest.mark.parametrize("kind", ["SHDOM text", "AT3D text"])
@pytest.mark.parametrize("kept", [0.25, 0.5, 0.9])
@pytest.mark.parametrize("within", [False, True])
def test_rows_of_text_that_are_cut(tmp_path, kind, kept, within):
    """At a row, or within one; all cells listed, or cloudy ones alone."""
    paths = FILES[kind](tmp_path)
    good = Found.of(open_scene(paths))
    text = paths[0].read_text()
    end = text.index("\n", int(kept * len(text)))
    paths[0].write_text(text[: end - 1] if within else text[: end + 1])
    assert verdict(paths, good) == ("refused" if within or kind == "SHDOM text" else "told")


def test_shares_of_a_cell_that_are_no_whole_are_refused(tmp_path: Path) -> None:
    """RAMS's patches: what a cell has of water and of each kind of land."""
    path = MAKERS["RAMS with header"](tmp_path).paths[0]
    with netCDF4.Dataset(path, "a") as file:
        file["PATCH_AREA"][1, 0, 0] = 0.4
    with pytest.raises(UserError, match=r"PATCH_AREA.*adds up to 0\.4 to 1, not to 1"):
        open_scene(path)
