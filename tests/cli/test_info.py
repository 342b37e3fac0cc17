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
    assert run(["info", str(tmp_path / "a.nc"), "--map", str(tmp_path / "a.png")]) == 0
    assert "nothing to map" in capsys.readouterr().err
    assert not (tmp_path / "a.png").exists()


def test_the_extent_is_that_of_the_sides(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    scene().to_netcdf(tmp_path / "a.nc")
    assert run(["info", str(tmp_path / "a.nc")]) == 0
    (line,) = [line for line in capsys.readouterr().out.splitlines() if line.startswith("extent")]
    # 7 km north and east of 47 N 8 E, on a sphere of 6371 km
    assert line.split(maxsplit=1)[1] == "47.00 to 47.06 N, 8.00 to 8.09 E"


def test_maps_have_their_coasts_where_they_are() -> None:
    """Land begins at 5.3 W on the line of 36 N (Tarifa): shores beside it, none in the Atlantic."""
    axis = np.linspace(0, 3, 60)
    crs = CRS.from_proj4("+proj=longlat +R=6371000")
    fields = {"liquid_content": np.full((3, 60, 60), 1e-4, np.float32)}
    marked = np.asarray(maps(Scene.from_arrays({}, axis - 8.0, axis + 35.0, LEVELS, crs=crs, fields=fields)))
    panel = marked[-(PANEL + 4 + 12 + 36) :][:PANEL, 12 : 12 + PANEL].astype(int)
    white = (panel > 250).all(axis=-1)
    assert white[:, 2 * PANEL // 3 :].sum() > 150  # Cadiz and Gibraltar, Tangier
    assert not white[PANEL // 3 : PANEL // 2, 60 : PANEL // 3].any()  # the Gulf of Cadiz
