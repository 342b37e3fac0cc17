"""However many readers look at a file, it is opened once."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import netCDF4
import numpy as np
import pytest
import xarray as xr
from tests.readers.model_files import les_text, rams

from openswim.errors import UserError
from openswim.readers import describe, members_of, open_scene, states_of
from openswim.scene.procedural import demo_scene

_opened: list[str] = []
_watching: list[bool] = []


def _hook(event: str, args: tuple) -> None:  # stays, so it is added once, and looks only while a test asks it to
    if _watching and event == "open" and isinstance(args[0], (str, bytes, os.PathLike)):
        _opened.append(os.fsdecode(args[0]))


sys.addaudithook(_hook)


class _Counting(netCDF4.Dataset):
    def __init__(self, name, *args, **options) -> None:
        if _watching:
            _opened.append(f"netCDF {name}")
        super().__init__(name, *args, **options)


@pytest.fixture
def opened(monkeypatch):
    """Names as Python and netCDF open them; what netCDF opens is closed in the end."""
    monkeypatch.setattr(netCDF4, "Dataset", _Counting)
    _opened.clear()
    _watching.append(True)
    yield _opened
    _watching.clear()


def _still_open(path: Path) -> bool:
    links = (Path("/proc/self/fd") / each for each in os.listdir("/proc/self/fd"))
    return any(os.path.realpath(link).startswith(str(path)) for link in links)


@pytest.mark.parametrize("ask", [open_scene, describe, members_of])
def test_hdf5_is_opened_once(tmp_path: Path, opened: list[str], ask) -> None:
    """The sixth of the readers knows it, after four others have looked."""
    (path, *_) = rams(tmp_path / "a-A-2020-06-21-120000-g1.h5").paths
    opened.clear()
    ask(path)
    assert opened.count(f"netCDF {path}") == 1
    assert opened.count(str(path)) <= 1
    assert not _still_open(path)


@pytest.mark.parametrize("ask", [states_of, describe])
def test_each_of_a_series_is_opened_once(tmp_path: Path, opened: list[str], ask) -> None:
    """To see whose it is, and for its times."""
    scene, paths = demo_scene(16, 16, 16), [tmp_path / f"{n}.nc" for n in range(3)]
    for path in paths:
        scene.to_netcdf(path)
        scene.time += np.timedelta64(5, "m")
    opened.clear()
    ask(paths)
    for path in paths:
        assert opened.count(f"netCDF {path}") == 1
        assert opened.count(str(path)) <= 1
        assert not _still_open(path)


def test_text_is_looked_at_once(tmp_path: Path, opened: list[str]) -> None:
    (path, *_) = les_text(tmp_path / "a.txt", "shdom").paths
    opened.clear()
    open_scene(path)
    assert opened.count(f"netCDF {path}") == 1
    assert opened.count(str(path)) <= 3  # its first bytes, and its rows


def test_zarr_is_opened_once_and_has_its_times(tmp_path: Path, opened: list[str]) -> None:
    scene = demo_scene(16, 16, 16)
    scene.to_zarr(tmp_path / "a.zarr")
    opened.clear()
    assert open_scene(tmp_path / "a.zarr").time == scene.time
    assert opened.count(str(tmp_path / "a.zarr" / "x" / "0")) == 1  # which every dataset reads as it is opened


def test_a_file_that_nobody_knows_is_closed(tmp_path: Path) -> None:
    path = tmp_path / "a.nc"
    xr.Dataset({"sst": ("x", [1.0, 2.0])}).to_netcdf(path)
    for paths in (path, [path, path]):
        with pytest.raises(UserError, match="no reader"):
            open_scene(paths)
        assert not _still_open(path)


def test_opening_netcdf_imports_no_engine_of_others(tmp_path: Path) -> None:
    """Zarr and what registers itself with xarray take a third of a second."""
    demo_scene(16, 16, 16).to_netcdf(tmp_path / "scene.nc")
    code = (
        "import sys, openswim; openswim.open_scene(sys.argv[1]);"
        "sys.exit(', '.join(sorted({'zarr', 'kerchunk', 'scipy.ndimage'} & set(sys.modules))) or 0)"
    )
    done = subprocess.run([sys.executable, "-c", code, str(tmp_path / "scene.nc")], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
