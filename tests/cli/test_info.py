"""`openswim info`: maps of column maxima that lie the right way up."""

from pathlib import Path

import numpy as np
import pytest
from PIL import Image
from pyproj import CRS

from openswim import Scene
from openswim.cli.info import PANEL, column_maxima, maps
from openswim.cli.main import run

LEVELS = np.array([0.0, 1000.0, 2000.0])


def scene() -> Scene:
    """Liquid in the north-east corner's middle level, ice everywhere but there."""
    axis = 1000.0 * np.arange(8)
    liquid, ice = np.zeros((2, 3, 8, 8), np.float32)
    liquid[1, 7, 7], ice[2] = 5e-4, 1e-4
    ice[2, 7, 7] = 0.0
    crs = CRS.from_proj4("+proj=lcc +lat_1=40 +lat_2=55 +lat_0=47 +lon_0=8 +R=6371000")
    return Scene.from_arrays({}, axis, axis, LEVELS, crs=crs, fields={"liquid_content": liquid, "ice_content": ice})


def test_column_maxima_are_the_fields_own() -> None:
    found = column_maxima(scene())
    assert set(found) == {"liquid", "ice"}
    field, units = found["liquid"]
    assert units == "g m-3"
    assert field.max() == pytest.approx(0.5)
    assert np.argwhere(field > 0).tolist() == [[7, 7]]
    assert found["ice"][0].min() == 0


def test_north_is_on_top_and_thick_is_bright() -> None:
    sheet = np.asarray(maps(scene()).convert("L")).astype(int)
    panel = sheet[-(PANEL + 4 + 12 + 36) :][:PANEL, 12 : 12 + PANEL]  # the first panel, above its bar of colours
    corners = {"north-west": panel[10, 10], "north-east": panel[10, -10], "south-east": panel[-30, -10]}
    assert corners["north-east"] > corners["north-west"] + 100
    assert corners["south-east"] == corners["north-west"]


def test_the_command_writes_them(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    scene().to_netcdf(tmp_path / "a.nc")
    assert run(["info", str(tmp_path / "a.nc"), "--map", str(tmp_path / "a.png")]) == 0
    said = capsys.readouterr().out
    for label in ("model", "grid", "projection", "levels", "times", "species", "missing"):
        assert f"\n{label}" in said
    assert "liquid" in said.split("species")[1].splitlines()[0]
    with Image.open(tmp_path / "a.png") as picture:
        assert picture.size[0] > 2 * PANEL
    assert run(["info", str(tmp_path / "a.nc"), "--map", str(tmp_path / "a.jpg")]) == 2


def test_a_time_is_that_of_the_maps(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    scene().to_netcdf(tmp_path / "a.nc")
    assert run(["info", str(tmp_path / "a.nc"), "--time", "2005-08-28T12:00"]) == 2
    assert "--map" in capsys.readouterr().err


def test_nothing_to_map_is_said(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    clear = scene()
    for name in ("liquid_content", "ice_content"):
        clear.data[name][:] = 0
    clear.to_netcdf(tmp_path / "a.nc")
    assert run(["info", str(tmp_path / "a.nc"), "--map", str(tmp_path / "a.png")]) == 2
    assert "nothing to map" in capsys.readouterr().err
