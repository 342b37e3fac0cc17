"""`openswim analyse` on a twin with a plain core: what is refused, and when, and what comes of Ctrl-C."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest
import xarray as xr
from tests.assimilation.test_analysing import CAMERAS, POINTS, twin
from tests.assimilation.test_writing_back import wrf

from openswim import UserError, save_camera
from openswim.assimilation import Operator, configured
from openswim.assimilation.config import _image, read_config
from openswim.cli.main import run

HEAD = """openswim_analysis = 1
model = "model.nc"
sun = [140.0, 50.0]
[observe]
wavelengths_nm = [550]
controls = ["extinction_cloud", "albedo"]
[background]
length_m = 70
[analyse]
iterations = 12
"""


@pytest.fixture
def config(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Its operator is the twin's, whose files lie beside it."""
    op, observed, _ = twin()
    op.scene.to_netcdf(tmp_path / "model.nc")
    text = HEAD
    for n, (camera, image) in enumerate(zip(CAMERAS, op.pictures(observed["value"]), strict=True)):
        save_camera(camera, tmp_path / f"camera{n}.toml")
        image.to_dataset(name="radiance").to_netcdf(tmp_path / f"seen{n}.nc")
        text += f'[[camera]]\nfile = "camera{n}.toml"\nimage = "seen{n}.nc"\n'
    for (y, x), watts in zip(POINTS, op.irradiance_w_m2(observed["value"]), strict=True):
        text += f"[[pyranometer]]\nx_m = {x}\ny_m = {y}\nw_m2 = {watts}\n"
    path = tmp_path / "analysis.toml"
    path.write_text(text)
    monkeypatch.setattr("openswim.assimilation.configured.operator_of", lambda config: op)
    return path


def operator(config: Path) -> Operator:
    return configured.operator_of(read_config(config))


def test_an_interrupted_analysis_writes_what_there_is_and_ends_as_interrupted(
    config: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    core, calls = operator(config).core, [0]
    forward = core.forward

    def stopped(*given: object) -> object:
        calls[0] += 1
        if calls[0] == 6:
            raise KeyboardInterrupt
        return forward(*given)  # type: ignore[arg-type]

    monkeypatch.setattr(core, "forward", lambda extinction, albedo, start=None: stopped(extinction, albedo, start))
    target = config.with_name("found.nc")
    asked = ["analyse", str(config), "-o", str(target)]
    assert run(asked) == 130
    said = capsys.readouterr()
    assert "the same command goes on from" in said.err
    assert said.err.strip().endswith("interrupted")
    assert target.is_file()
    assert target.with_suffix(".html").is_file()
    assert list(config.parent.glob(".*.npz"))
    assert run(asked) == 0
    assert "12 iterations" in capsys.readouterr().out
    assert not list(config.parent.glob(".*.npz"))


@pytest.mark.parametrize(
    ("was", "now", "match"),
    [
        ("iterations = 12", 'departures = "faster"', "analysis.toml: unknown solver 'faster'"),
        ("iterations = 12", 'departures = "swim"\nouter = 2', "farther off"),
        ("iterations = 12", "signal = -2", "signal must be 0"),
        ("iterations = 12", 'method = "newton"', "method 'newton' is unknown"),
        ("iterations = 12", 'transform = "cube"', "transform 'cube' is unknown"),
        ("length_m = 70", "length_m = { albedo = 70 }", "names no extinction_cloud"),
        ("[analyse]", "[observations]\nsaturated = 1e-9\n[analyse]", "no pixel of camera 0"),
        ('image = "seen1.nc"', 'image = "red.nc"', "is at .615.0. nm, not at .550.0."),
        ('image = "seen1.nc"', 'image = "nowhere.nc"', "is at .nan. nm, not at .550.0."),
        ('image = "seen1.nc"', 'image = "warm.nc"', "warm.nc: radiance is in 'K': give it in W m-2 sr-1 nm-1"),
        ('image = "seen1.nc"', 'image = "black.nc"', "image 1 has no light"),
        ("[background]", "[observations]\nirradiance_noise = 0\n[background]", "irradiance_noise is 0"),
        ("w_m2 = ", "w_m2 = -", "irradiance in W m-2 lies"),
        ("w_m2 = ", "w_m2 = inf  # ", "irradiance in W m-2 lies"),
    ],
)
def test_check_refuses_what_an_analysis_would(
    config: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], was: str, now: str, match: str
) -> None:
    """Both before any light is solved, and in the same words."""

    def solved(*given: object, **named: object) -> None:
        raise AssertionError("light was solved")

    monkeypatch.setattr(operator(config).core, "forward", solved)
    seen = xr.open_dataset(config.with_name("seen1.nc"))
    seen.assign_coords(wavelength=[615.0]).to_netcdf(config.with_name("red.nc"))
    seen.assign_coords(wavelength=[np.nan]).to_netcdf(config.with_name("nowhere.nc"))
    (0 * seen).to_netcdf(config.with_name("black.nc"))
    seen["radiance"].assign_attrs(units="K").to_dataset(name="radiance").to_netcdf(config.with_name("warm.nc"))
    text = config.read_text()
    assert was in text
    config.write_text(text.replace(was, now))
    said = []
    for more in (["--check"], ["-o", str(config.with_name("found.nc"))]):
        assert run(["analyse", str(config), *more]) == 2
        said.append(capsys.readouterr().err.splitlines()[-1])
    assert said[0] == said[1]
    assert re.search(match, said[0])


def test_what_instruments_show_is_taken(config: Path) -> None:
    """Pictures in units that can be converted; a pyranometer below zero, as by night."""
    op, seen = operator(config), xr.open_dataset(config.with_name("seen1.nc"))
    other = (1e3 * seen["radiance"]).assign_attrs(units="W/(m2 sr um)").assign_coords(wavelength=[0.55])
    other["wavelength"].attrs["units"] = "um"
    other.to_dataset(name="radiance").to_netcdf(config.with_name("other.nc"))
    found = _image(config.with_name("other.nc"))
    np.testing.assert_allclose(found["wavelength"], seen["wavelength"])
    np.testing.assert_allclose(found["radiance"], seen["radiance"], rtol=1e-6)
    shown = np.full(len(POINTS), 300.0)
    shown[0] = -2.0
    observed = op.observations([xr.open_dataset(config.with_name(f"seen{n}.nc")) for n in range(len(CAMERAS))], shown)
    assert observed["use"].values[-len(POINTS):].all()


def test_check_looks_at_the_files_that_it_is_given(config: Path, capsys: pytest.CaptureFixture[str]) -> None:
    asked = ["analyse", str(config), "--check"]
    assert run([*asked, "-o", str(config.with_name("seen0.nc"))]) == 2
    assert "would replace" in capsys.readouterr().err
    assert run([*asked, "-o", str(config.with_name("found.nc"))]) == 0
    assert "dot product" in capsys.readouterr().out
    assert not config.with_name("found.nc").exists()


def test_cloud_cover_can_be_left_out(
    config: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    scene = operator(config).scene
    scene.data["cloud_area_fraction"] = (0.5 + 0 * scene.data["extinction_cloud"]).assign_attrs(units="1")
    scene.to_netcdf(config.with_name("model.nc"))
    monkeypatch.undo()
    assert run(["analyse", str(config), "--check"]) == 2
    assert "leave it out, so that clouds fill their cells, by cover = false in its file" in capsys.readouterr().err
    text = config.read_text()
    config.write_text("cover = false\n" + text)
    opened = operator(config).scene
    assert "cloud_area_fraction" not in opened.data
    assert any("clouds fill their cells" in note for note in opened.notes)
    config.write_text("cover = 0\n" + text)
    with pytest.raises(UserError, match="cover is 0: write true or false"):
        read_config(config)


@pytest.mark.parametrize("value", ['"false"', "0.1", "1"])
def test_lean_is_true_or_false(config: Path, value: str) -> None:
    config.write_text(config.read_text().replace("[observe]", f"[observe]\nlean = {value}"))
    with pytest.raises(UserError, match=r"analysis\.toml: \[observe\] lean is .*: write true or false"):
        read_config(config)


def test_a_time_that_the_model_has_not_names_no_option(
    config: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    wrf(config.parent)
    monkeypatch.undo()
    text = config.read_text().replace('"model.nc"', '"wrfout_d01_test"\ntime = "2005-08-28T03:00"')
    config.write_text(text)
    assert run(["analyse", str(config), "--check"]) == 2
    said = capsys.readouterr().err
    assert "choose one of these times" in said
    assert "--time" not in said
