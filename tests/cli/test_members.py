"""Every command that opens a model takes a member of an ensemble, and says which there are."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import PIL.Image
import pytest
import xarray as xr

from openswim import Camera, save_camera
from openswim.cli.main import run
from openswim.comparison.settings import skies_of
from openswim.scene.procedural import demo_scene

LAT, LON = demo_scene(16, 16, 16).place or (0.0, 0.0)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Members 3, with cloud, and 8, without; a frame, its camera and an analysis."""
    folder = tmp_path_factory.mktemp("members")
    data = demo_scene(16, 16, 16).to_dataset()
    clear = data.assign(liquid_content=0 * data.liquid_content)
    joined = xr.concat([data, clear], xr.DataArray([3, 8], dims="member", name="member"), data_vars=["liquid_content"])
    joined.to_netcdf(folder / "model.nc")
    save_camera(Camera.allsky(LAT, LON, size=64), folder / "camera.toml")
    PIL.Image.fromarray(np.full((64, 64, 3), 90, np.uint8)).save(folder / "sky_20240621_120000UTC.png")
    (folder / "analysis.toml").write_text(
        'openswim_analysis = 1\nmodel = "model.nc"\nmember = 7\n[observe]\nwavelengths_nm = [550]\n'
        'controls = ["cloud_liquid"]\n[background]\nlength_m = 200\n'
        f"[[pyranometer]]\nlat = {LAT}\nlon = {LON}\nw_m2 = 600.0\n"
    )
    return folder


@pytest.mark.parametrize("words", [
    f"render FOLDER/model.nc --lat {LAT} --lon {LON} --member 7 -o FOLDER/a.png",
    f"film FOLDER/model.nc --lat {LAT} --lon {LON} --member 7 -o FOLDER/a.mp4",
    f"irradiance FOLDER/model.nc --lat {LAT} --lon {LON} --member 7 -o FOLDER/a.csv",
    "satellite FOLDER/model.nc --grid full --band C02 --member 7 -o FOLDER/b.nc",
    "compare FOLDER/model.nc FOLDER/sky_20240621_120000UTC.png --camera FOLDER/camera.toml --member 7 -o FOLDER/out",
    "correct-clouds FOLDER/model.nc FOLDER/sky_20240621_120000UTC.png --camera FOLDER/camera.toml --member 7 "
    "-o FOLDER/c.nc",
    "analyse FOLDER/analysis.toml -o FOLDER/c.nc",
])  # fmt: skip
def test_commands_ask_for_the_member(words: str, folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(words.replace("FOLDER", str(folder)).split()) == 2
    assert "no ensemble member 7 in it; it has 3, 8" in capsys.readouterr().err


@pytest.mark.parametrize("words", [
    f"irradiance --clear --lat {LAT} --lon {LON} --start 2024-06-21T12:00 --member 7 -o FOLDER/a.csv",
    "compare --clear FOLDER/sky_20240621_120000UTC.png --camera FOLDER/camera.toml --member 7 -o FOLDER/out",
])  # fmt: skip
def test_a_clear_sky_has_no_members(words: str, folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(words.replace("FOLDER", str(folder)).split()) == 2
    assert "leave it out with --clear" in capsys.readouterr().err


def test_a_comparison_is_with_the_member(folder: Path) -> None:
    camera, time = Camera.allsky(LAT, LON, size=64), np.datetime64("2024-06-21T12:00", "ms")
    liquid = [
        skies_of(str(folder / "model.nc"), "fast", None, None, member=member).scene(camera, time).data.liquid_content
        for member in (3, 8)
    ]
    assert liquid[0].any()
    assert not liquid[1].any()
