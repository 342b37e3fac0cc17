"""With the light of `fast` and its linear core: a small cloud, seen and found again, and the command line."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
import pytest
from tests.assimilation.toy import cloud, flat_scene

from openswim import Background, Camera, Scene, Solver, UserError, analyse, observe, open_scene, save_camera
from openswim.assimilation import Operator, representation_error
from openswim.assimilation.config import read_config
from openswim.assimilation.configured import operator_of
from openswim.assimilation.departures import seen_by
from openswim.assimilation.observing.watts import watts_of
from openswim.cli.main import run
from openswim.lighting import daylight, light
from openswim.lights.spectrum import solar_irradiance
from openswim.scene.atmosphere import Atmosphere

SUN = (140.0, 50.0)
SHAPE = (9, 10, 11)
CAMERAS = [Camera.allsky(x_m=150.0, y_m=200.0, size=11, fov_deg=150.0),
           Camera.allsky(x_m=380.0, y_m=260.0, size=11, fov_deg=150.0)]  # fmt: skip
POINTS = [(150.0, 300.0)]


def thicker(seed: int) -> np.ndarray:
    field = np.zeros(SHAPE)
    field[2:8, 1:-1, 1:-1] = cloud((6, 8, 9), 0.015, seed)
    return field


def scene(field: np.ndarray) -> Scene:
    return flat_scene(field, atmosphere=None)


@pytest.fixture(scope="module")
def operator() -> Operator:
    guess = 0.7 * np.roll(thicker(1), (0, 0, 1), (0, 1, 2))
    return observe(scene(guess), CAMERAS, POINTS, sun=SUN, controls=("extinction_cloud", "albedo"), tolerance=1e-10)


@pytest.mark.slow
def test_the_linear_core_is_linearised(operator: Operator) -> None:
    found = operator.linearize(operator.first()).check()
    assert found.zero == 0
    assert found.linear < 1e-10  # the tolerance of the light
    assert found.dot < 1e-10
    assert found.remainder[1] < 0.12 * found.remainder[0]
    assert found.remainder[2] < 0.12 * found.remainder[1]


@pytest.mark.slow
def test_departures_by_fast_and_an_outer_loop(operator: Operator) -> None:
    """The linear core sees nearly what `fast` sees; what it does not is corrected in each outer loop."""
    truth = operator.first()
    truth["extinction_cloud"].values[:] = thicker(1)
    seen, fine = (seen_by(operator, truth, how) for how in (Solver("fast"), Solver("fast", tolerance=1e-3, step=0.25)))
    own = operator(truth).values
    for part in operator.parts[:2]:
        use = operator.instruments[0].usable if part.start == 0 else operator.instruments[1].usable
        one, other = fine[part.here][use], own[part.here][use]
        assert np.corrcoef(one, other)[0, 1] > 0.99988  # .99991 of the second camera
        assert np.abs(one.mean() / other.mean() - 1) < 0.0044  # .0034 of the first one
    assert operator.irradiance_w_m2(own) == pytest.approx(operator.irradiance_w_m2(seen), rel=0.022)  # .017
    images = [image.values for image in operator.pictures(seen)]
    observed = operator.observations(images, operator.irradiance_w_m2(seen), noise=0.05)
    found = analyse(operator, observed, background=Background(70.0), departures="fast", outer=2, iterations=16)
    assert max(found.rms(found.after)[:2]) < 0.35 * min(found.rms(found.before)[:2])
    shares = representation_error(operator, truth)
    assert shares == pytest.approx([0.236, 0.315], rel=0.2)


@pytest.mark.slow
@pytest.mark.parametrize(("extinction_per_m", "excess"), [(0.0, -0.0049), (0.05, 0.0766)])
def test_watts_by_fixed_weights_beside_the_real_ones(extinction_per_m: float, excess: float) -> None:
    """Weights of a clear sky leave out what cloud absorbs in the near infrared (docs/assimilation.md)."""
    field, wavelengths = np.zeros((14, 16, 16)), np.array([615.0, 546.0, 450.0])
    field[6:10] = extinction_per_m  # an optical depth of 20
    axes = (1000.0 * np.arange(16), 1000.0 * np.arange(16), 100.0 * np.arange(14))
    even = Scene.from_arrays(field, *axes, surface_albedo=0.15, place=(47.0, 8.0), atmosphere=Atmosphere.us_standard())
    day = daylight(even, None, (150.0, 50.0))
    lit = light(even, "fast", wavelengths.tolist(), None, (150.0, 50.0))
    attrs = lit.viewpoint(Camera.allsky(x_m=7500.0, y_m=7500.0, height_m=1.0, size=8)).attrs
    spectral = np.array(attrs["global_horizontal_spectral_irradiance_w_m2_nm"])
    relative = spectral / (solar_irradiance(wavelengths) / day.distance_au**2)
    found = watts_of(even, wavelengths, day) @ relative / attrs["global_horizontal_irradiance_w_m2"] - 1
    assert found == pytest.approx(excess, rel=0.3)


@pytest.mark.slow
def test_the_command_line(operator: Operator, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    truth = operator.first()
    truth["extinction_cloud"].values[:] = thicker(1)
    row = operator(truth)
    operator.scene.to_netcdf(tmp_path / "model.nc")
    entries = []
    for n, (camera, image) in enumerate(zip(CAMERAS, operator.pictures(row), strict=True)):
        save_camera(camera, tmp_path / f"camera{n}.toml")
        image.to_dataset(name="radiance").to_netcdf(tmp_path / f"seen{n}.nc")
        entries.append(f'[[camera]]\nfile = "camera{n}.toml"\nimage = "seen{n}.nc"\n')
    (y, x), watts = POINTS[0], float(operator.irradiance_w_m2(row)[0])
    entries.append(f"[[pyranometer]]\nx_m = {x}\ny_m = {y}\nw_m2 = {watts}\n")
    config = tmp_path / "analysis.toml"
    config.write_text(
        'openswim_analysis = 1\nmodel = "model.nc"\nsun = [140.0, 50.0]\n'
        '[observe]\nwavelengths_nm = [550]\ncontrols = ["extinction_cloud"]\n'
        "[background]\nlength_m = 70\n[background.spread]\nextinction_cloud = 8\n[analyse]\niterations = 6\n"
        + "".join(entries)
    )
    target = tmp_path / "found.nc"
    assert run(["analyse", str(config), "--check"]) == 0
    assert "dot product" in capsys.readouterr().out
    assert run(["analyse", str(config), "-o", str(target)]) == 0
    said = capsys.readouterr().out
    assert "camera 1: departures of" in said
    assert "6 iterations" in said
    assert target.with_suffix(".html").is_file()
    found, first = (open_scene(p).data["extinction_cloud"].values for p in (target, tmp_path / "model.nc"))
    errors = [np.abs(field - thicker(1)).sum() for field in (found, first)]
    assert errors[0] < 0.9 * errors[1]
    assert not list(tmp_path.glob(".*.npz"))


def test_no_file_that_is_read_is_written_to(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    save_camera(CAMERAS[0], tmp_path / "roof.toml")
    for name in ("model.nc", "seen.nc"):
        (tmp_path / name).write_bytes(b"x")
    config = tmp_path / "analysis.toml"
    config.write_text(
        'openswim_analysis = 1\nmodel = "model.nc"\n[background]\nlength_m = 70\n'
        '[[camera]]\nfile = "roof.toml"\nimage = "seen.nc"\n'
    )
    assert run(["analyse", str(config)]) == 2
    assert "name a scene" in capsys.readouterr().err
    for output, more in (
        ("model.nc", []), ("seen.nc", []), ("found.nc", ["--observations", "model.nc"]),
        ("found.nc", ["--observations", "seen.nc"]), ("found.nc", ["--observations", "found.nc"]),
    ):  # fmt: skip
        paths = [str(tmp_path / each) if each.endswith(".nc") else each for each in more]
        assert run(["analyse", str(config), "-o", str(tmp_path / output), *paths]) == 2
        said = capsys.readouterr().err.strip()
        assert "would replace" in said
        assert "\n" not in said
    assert run(["analyse", str(config), "-o", str(tmp_path / "found.nc")]) == 2  # pictures are read before the model
    assert "seen.nc" in capsys.readouterr().err


def test_configurations_that_are_refused(tmp_path: Path) -> None:
    (tmp_path / "model.nc").write_bytes(b"x")
    save_camera(CAMERAS[0], tmp_path / "roof.toml")
    with (tmp_path / "roof.toml").open("a") as roof:
        roof.write('[obstacles]\nmask = "../black.png"\n')
    head = 'openswim_analysis = 1\nmodel = "model.nc"\n[background]\nlength_m = 70\n'
    for text, match in (
        ('model = "model.nc"', "openswim_analysis"),
        (head.replace("= 1", "= true"), "openswim_analysis"),
        (head + "[obsrve]\n", "did you mean observe"),
        (head + "[observe]\ncontrol = 1\n", "did you mean controls"),
        (head.replace("model.nc", "../../etc/passwd"), "leads out of"),
        (head.replace("model.nc", "/dev/zero"), "leads out of"),
        (head.replace("model.nc", "none.nc"), "no such file"),
        (head.replace('"model.nc"', f"{['model.nc'] * 1001}"), "1001 files; 1000 are the most"),
        (head.replace("length_m = 70", ""), "length_m is missing"),
        (head + "[[pyranometer]]\nlat = 1\n", "lon is missing"),
        (head + "[[pyranometer]]\nlat = 'a'\nlon = 1\n", "must be a number"),
        (head + "[[pyranometer]]\nlat = 4\nlon = 1\ny_m = 3\nx_m = 2\n", "either lat and lon, or x_m and y_m"),
        (head + "[[camera]]\nfile = 3\n", "name a file"),
        (head + '[[camera]]\nfile = "roof.toml"\nimage = "model.nc"\n', r"mask '../black.png' leads out of"),
        (head + "[camera]\n", "for each camera"),
        (head + "[analyse]\niterations = 'many'\n", "whole number"),
    ):
        (tmp_path / "a.toml").write_text(text)
        with pytest.raises(UserError, match=match) as error:
            read_config(tmp_path / "a.toml")
        assert "a.toml" in str(error.value)


def test_degrees_are_not_taken_for_metres(tmp_path: Path) -> None:
    scene(thicker(1)).to_netcdf(tmp_path / "model.nc")
    (tmp_path / "a.toml").write_text(
        'openswim_analysis = 1\nmodel = "model.nc"\n[background]\nlength_m = 70\n'
        "[[pyranometer]]\nlat = 47.0\nlon = 8.0\nw_m2 = 500.0\n"
    )
    with pytest.raises(UserError, match=r"a\.toml: .*the model is flat: give x_m and y_m"):
        operator_of(read_config(tmp_path / "a.toml"))


def test_threads_may_share_an_operator() -> None:
    """Bit for bit, values and gradients, from its first call on: nothing that one is asked is another's."""
    made = (observe(scene(thicker(1)), CAMERAS, POINTS, sun=SUN, controls=("extinction_cloud",)) for _ in range(2))
    shared, own = made
    states, ones = [own.first() * share for share in (1.0, 1.3, 0.6, 1.6)], np.ones(own.size)
    with ThreadPoolExecutor(3) as threads:
        rows = list(threads.map(lambda state: shared.ensemble([state]).values[0], states))
        bars = list(threads.map(lambda state: shared.linearize(state).vjp(ones), states))
    assert np.array_equal(rows, own.ensemble(states))
    assert all(bar.identical(own.linearize(state).vjp(ones)) for bar, state in zip(bars, states, strict=True))
