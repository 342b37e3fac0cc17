"""Observations of several times, whose cloud the wind carries."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray as xr
from tests.assimilation.toy import flat_scene

from openswim import Background, Camera, Scene, Solver, UserError, analyse, observe, open_scene, save_camera
from openswim.assimilation import Operator, observe_window
from openswim.assimilation.config import read_config
from openswim.assimilation.departures import seen_by
from openswim.assimilation.observing.carrying import Carrier, motion_of
from openswim.cli.main import run

START = np.datetime64("2024-06-21T12:00:00", "ms")
CELL_M, WIND = 50.0, (10.0, -5.0)  # m/s: two cells to the east and one to the south in ten seconds
TIMES = [START + np.timedelta64(s, "s") for s in (0, 10, 20)]
SHAPE = (9, 14, 16)
CAMERAS = [Camera.allsky(x_m=250.0, y_m=250.0, size=12, fov_deg=150.0),
           Camera.allsky(x_m=520.0, y_m=400.0, size=12, fov_deg=150.0)]  # fmt: skip
KNOWN: dict[str, Any] = dict(sun=(140.0, 50.0), controls=("extinction_cloud",), lean=True)


def cumulus(east_m: float = 300.0, north_m: float = 420.0, thick: float = 0.02) -> np.ndarray:
    """Two puffs (nz, ny, nx), 1/m, clear at the sides."""
    z, y, x = (CELL_M * np.arange(n) for n in SHAPE)
    out = np.zeros(SHAPE)
    for de, dn, height, wide in ((0.0, 0.0, 220.0, 70.0), (-80.0, -90.0, 280.0, 50.0)):
        far = (((z[:, None, None] - height) / 60) ** 2 + ((y[:, None] - north_m - dn) / wide) ** 2
               + ((x - east_m - de) / wide) ** 2)  # fmt: skip
        out += thick * np.exp(-far)
    return np.where(out < 0.05 * thick, 0.0, out)


def scene(field: np.ndarray, **more: object) -> Scene:
    return flat_scene(field, CELL_M, time=START, atmosphere=None, **more)


def error(state: xr.Dataset, truth: np.ndarray) -> tuple[float, float]:
    """Of nodes and of columns."""
    found = np.where(state["extinction_cloud"].values > 2.1e-5, state["extinction_cloud"].values, 0.0)
    both = [(found, truth), (found.sum(axis=0), truth.sum(axis=0))]
    nodes, columns = (float(np.abs(a - b).sum() / b.sum()) for a, b in both)
    return nodes, columns


def test_what_is_carried_by_whole_cells_is_shifted() -> None:
    field = cumulus()
    carrier = Carrier.of(motion_of(scene(field), WIND), SHAPE, 20.0)
    assert np.allclose(carrier(field), np.roll(field, (-2, 4), (1, 2)), atol=1e-8)
    assert np.allclose(carrier.way, [4, -2], atol=1e-6)


def test_carrying_and_its_transpose_belong_together() -> None:
    """A wind that turns with height and shears; what is carried neither grows nor shrinks while it is inside."""
    rng = np.random.default_rng(0)
    given = cumulus()
    wind = {"wind_east": 8 + rng.standard_normal(SHAPE), "wind_north": np.linspace(-4, 4, SHAPE[0])[:, None, None]
            + rng.standard_normal(SHAPE)}  # fmt: skip
    carrier = Carrier.of(motion_of(scene(given, fields=wind)), SHAPE, 13.0)
    a, b = rng.standard_normal((2, *SHAPE))
    products = carrier(a) * b
    assert abs(products.sum() - (a * carrier.transposed(b)).sum()) < 1e-13 * np.abs(products).sum()
    assert carrier(np.ones(SHAPE)) == pytest.approx(1.0, abs=1e-14)
    steady = Carrier.of(motion_of(scene(given), (8.0, -3.0)), SHAPE, 13.0)
    assert steady(given).sum() == pytest.approx(given.sum(), rel=1e-6)


@pytest.fixture(scope="module")
def drifting() -> tuple[Operator, xr.Dataset, np.ndarray]:
    """A window about a first guess that is displaced and too thin, what is seen of the truth, and the truth: pictures
    are of shifted arrays, by operators of one time."""
    truth, guess = cumulus(), cumulus(350.0, 380.0, 0.014)
    op = observe_window(scene(guess), dict.fromkeys(TIMES, CAMERAS), wind=WIND, **KNOWN)
    images = []
    for n in range(3):
        there = observe(scene(np.roll(truth, (-n, 2 * n), (1, 2))), CAMERAS, **KNOWN)
        images += [image.to_dataset(name="radiance") for image in there.pictures(there(there.first()))]
    return op, op.observations(images, noise=0.03), truth


@pytest.mark.slow
def test_a_window_is_linearised() -> None:
    """Between nodes, with pyranometers of one of the times, and an albedo that all times share."""
    settings = KNOWN | {"controls": ("extinction_cloud", "albedo"), "tolerance": 1e-11}
    irradiance = {TIMES[0]: [(200.0, 300.0)], TIMES[2]: [(400.0, 300.0), (300.0, 200.0)]}
    seen = {TIMES[0]: CAMERAS[0], TIMES[1] + np.timedelta64(2, "s"): CAMERAS}
    op = observe_window(scene(cumulus()), seen, irradiance, wind=(9.0, -2.0), **settings)
    assert [part.shape[1] for part in op.parts] == [*[op.instruments[0].rays] * 3, 3]
    found = op.linearize(op.first()).check()
    assert found.zero == 0
    assert found.linear < 1e-10  # the tolerance of the light
    assert found.dot < 1e-11
    assert found.remainder[1] < 0.12 * found.remainder[0]
    assert found.remainder[2] < 0.12 * found.remainder[1]


@pytest.mark.slow
def test_drifting_cumulus_is_found(drifting: tuple[Operator, xr.Dataset, np.ndarray]) -> None:
    """Nearer than the guess, than the same pictures taken as if of one time, and than the first time's alone."""
    op, observed, truth = drifting
    believed: dict[str, Any] = {"background": Background(80.0), "iterations": 40}
    found = analyse(op, observed, **believed)
    at_once = analyse(observe(op.scene, CAMERAS * 3, **KNOWN), observed, **believed)
    start = observe(op.scene, CAMERAS, **KNOWN)
    alone = analyse(start, observed.isel(observation=slice(0, start.size)), **believed)
    nodes, columns = error(found.state, truth)
    assert nodes < 1.3 * 0.226
    assert columns < 1.3 * 0.123
    for other, least in ((found.first, (3.3, 6.0)), (at_once.state, (3.3, 5.7)), (alone.state, (1.2, 1.2))):
        assert error(other, truth)[0] > least[0] * nodes  # 4.3, 4.2 and 1.31 times
        assert error(other, truth)[1] > least[1] * columns  # 7.8, 7.3 and 1.28
    assert max(found.rms(found.after)) < 0.15 * min(at_once.rms(at_once.after))  # 1.1 of 9.7 errors


@pytest.mark.slow
def test_departures_of_a_window_are_those_of_its_times(drifting: tuple[Operator, xr.Dataset, np.ndarray]) -> None:
    """By `fast`, each time's picture is that of the shifted clouds."""
    op, _, truth = drifting
    state = op.first().assign(extinction_cloud=(("z", "y", "x"), truth))
    seen = seen_by(op, state, Solver("fast"))
    there = observe(scene(np.roll(truth, (-2, 4), (1, 2))), CAMERAS, **KNOWN)
    want = seen_by(there, there.first(), Solver("fast"))
    part = op.parts[4]
    assert seen[part.here] == pytest.approx(want[there.parts[0].here], rel=1e-3)


def test_what_a_window_cannot_be_is_one_line() -> None:
    still, windy = scene(cumulus()), {"wind": WIND, **KNOWN}
    timeless = flat_scene(cumulus(), CELL_M, atmosphere=None)
    for given, seen, named, match in (
        (still, {START: CAMERAS}, KNOWN, "has no wind"),
        (still, {START: CAMERAS}, windy | {"wind": (1.0,)}, "two numbers"),
        (still, {START: CAMERAS}, windy | {"wind": (1.0, np.zeros(4))}, "9 levels"),
        (still, {START: CAMERAS}, windy | {"time": START}, "for observe"),
        (still, {"yesterday": CAMERAS}, windy, "not understood"),
        (still, {"2024-06-22": CAMERAS}, windy, "180 at most"),
        (still, CAMERAS, windy, "of each time"),
        (still, {}, windy, "neither"),
        (timeless, {START: CAMERAS}, windy, "a time"),
    ):
        with pytest.raises(UserError, match=match):
            observe_window(given, seen, **named)  # type: ignore[arg-type]


@pytest.mark.slow
def test_the_command_line_looks_through_a_window(
    drifting: tuple[Operator, xr.Dataset, np.ndarray], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    op, observed, truth = drifting
    op.scene.to_netcdf(tmp_path / "model.nc")
    for n, image in enumerate(op.pictures(observed["value"])):
        image.to_dataset(name="radiance").to_netcdf(tmp_path / f"seen{n}.nc")
        save_camera(CAMERAS[n % 2], tmp_path / f"camera{n % 2}.toml")
    entries = [f'[[camera]]\nfile = "camera{n % 2}.toml"\nimage = "seen{n}.nc"\n' for n in range(6)]
    times = ["" if n < 2 else f'time = "{TIMES[n // 2]}"\n' for n in range(6)]
    head = (
        'openswim_analysis = 1\nmodel = "model.nc"\ntime = "2024-06-21T12:00"\nsun = [140.0, 50.0]\n'
        '[observe]\nwavelengths_nm = [550]\ncontrols = ["extinction_cloud"]\nlean = true\nwind = [10.0, -5.0]\n'
        "[observations]\nnoise = 0.03\n[background]\nlength_m = 80\n[analyse]\niterations = 2\n"
    )
    config, target = tmp_path / "analysis.toml", tmp_path / "found.nc"
    config.write_text(head + "".join(a + b for a, b in zip(entries, times, strict=True)))
    assert run(["analyse", str(config), "-o", str(target)]) == 0
    assert "camera 5: departures of" in capsys.readouterr().out
    own = analyse(op, observed, background=Background(80.0), iterations=2)
    found = open_scene(target).data["extinction_cloud"].values
    assert np.abs(found - own.scene.data["extinction_cloud"].values).max() < 1e-3 * truth.max()
    for wrong, match in (
        (head + entries[0] + times[4] + entries[1] + times[2], "earlier ones first"),
        (head + entries[0], "but none has one"),
        (head.replace('time = "2024-06-21T12:00"\n', "") + entries[0] + times[4], "give the file one"),
    ):
        config.write_text(wrong)
        with pytest.raises(UserError, match=match):
            read_config(config)
