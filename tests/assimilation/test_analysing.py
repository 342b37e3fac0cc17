"""Analyses on a plain core: twins of which the truth is known."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import xarray as xr
from tests.assimilation.toy import cloud, flat_scene, toy_core

from openswim import Camera, UserError, open_scene
from openswim.assimilation import Analysis, Background, Operator, analyse, observe
from openswim.assimilation.background import Space
from openswim.assimilation.cost import Cost

SUN = (140.0, 50.0)
CAMERAS = [Camera.allsky(x_m=150.0, y_m=160.0, size=13, fov_deg=150.0),
           Camera.allsky(x_m=400.0, y_m=320.0, size=13, fov_deg=150.0)]  # fmt: skip
POINTS = [(200.0, 300.0), (250.0, 100.0)]
BELIEF = Background(length_m=70.0)


def twin(seed: int = 1) -> tuple[Operator, xr.Dataset, np.ndarray]:
    """An operator about a first guess that is displaced and too thin, what is seen of the truth, and the truth."""
    truth = cloud(seed=seed)
    guess = flat_scene(0.7 * np.roll(truth, (0, 1, 1), (0, 1, 2)))
    controls = ("extinction_cloud", "albedo")
    op = observe(guess, CAMERAS, POINTS, sun=SUN, controls=controls, core=toy_core(guess, CAMERAS, POINTS))
    state = op.first()
    state["extinction_cloud"].values[:] = truth
    seen = op(state).values
    noisy = seen * (1 + 0.01 * np.random.default_rng(0).standard_normal(seen.size))
    images = [image / 1.0 for image in op.pictures(noisy)]
    images = [image.to_dataset(name="radiance").transpose("y", "x", "wavelength") for image in images]
    return op, op.observations(images, op.irradiance_w_m2(noisy), noise=0.01, irradiance_noise=0.01), truth


def error(found: xr.Dataset, truth: np.ndarray) -> float:
    return float(np.abs(found["extinction_cloud"].values - truth).sum() / truth.sum())


def test_the_gradient_of_the_cost() -> None:
    op, observed, _ = twin()
    space = Space(op, op.first(), BELIEF)
    cost = Cost.of(op, space, observed)
    rng = np.random.default_rng(0)
    v, way = 0.3 * rng.standard_normal((2, space.size))
    _, gradient = cost(v)
    step = 1e-4
    slope = (cost(v + step * way)[0] - cost(v - step * way)[0]) / (2 * step)
    assert slope == pytest.approx(float(gradient @ way), rel=1e-5)
    cost(v)
    a, b = rng.standard_normal((2, space.size))
    assert float(a @ cost.hessian(v, b)) == pytest.approx(float(b @ cost.hessian(v, a)), rel=1e-10)


@pytest.mark.parametrize(("method", "rms"), [("lbfgs", 1.35), ("gauss-newton", 4.8)])
def test_a_twin_is_found(method: str, rms: float) -> None:
    """Three Gauss-Newton steps of 15 products are not yet at the end; 45 of L-BFGS are at the noise."""
    op, observed, truth = twin()
    found = analyse(op, observed, background=BELIEF, iterations=45, method=method)
    assert error(found.state, truth) < 0.75 * error(found.first, truth)  # .466 and .457 of .714
    columns = [np.abs(s["extinction_cloud"].values.sum(axis=0) - truth.sum(axis=0)).sum() for s in
               (found.state, found.first)]  # fmt: skip
    assert columns[0] < 0.48 * columns[1]
    assert max(found.rms(found.after)) < 1.2 * rms
    assert min(found.rms(found.before)) > 25


@pytest.mark.parametrize(("transform", "left"), [("sqrt", 0.67), ("log", 0.82)])
def test_other_transforms(transform: str, left: float) -> None:
    op, observed, truth = twin()
    spread = {"extinction_cloud": {"sqrt": 2.0, "log": 0.7}[transform]}
    found = analyse(op, observed, background=Background(70.0, spread), transform=transform, iterations=40)
    assert error(found.state, truth) < 1.1 * left * error(found.first, truth)
    assert (found.state["extinction_cloud"].values[op.controls.where] > 0).all()


def test_what_was_stopped_goes_on(tmp_path: Path) -> None:
    op, observed, _ = twin()
    at = tmp_path / "way.npz"

    def stop(iteration: int, cost: float) -> None:
        if iteration == 6:
            raise KeyboardInterrupt

    early = analyse(op, observed, background=BELIEF, iterations=20, checkpoint=at, told=stop)
    assert early.interrupted
    assert len(early.costs) == 7
    late = analyse(op, observed, background=BELIEF, iterations=20, checkpoint=at)
    assert not late.interrupted
    assert late.costs[:7].tolist() == early.costs.tolist()
    assert late.costs[-1] < early.costs[-1]
    assert len(late.costs) == 21
    with pytest.raises(UserError, match="another analysis"):
        analyse(op, observed, background=Background(90.0), iterations=20, checkpoint=at)
    with pytest.raises(UserError, match="another analysis"):
        analyse(op, observed, background=BELIEF, iterations=20, checkpoint=at, departures="fast", outer=1)
    np.savez_compressed(at, v=np.zeros(2**22))
    with pytest.raises(UserError, match="bytes of arrays"):  # before so much is unpacked
        analyse(op, observed, background=BELIEF, iterations=20, checkpoint=at)
    at.write_bytes(b"PK\x03\x04 nonsense")
    with pytest.raises(UserError, match="no checkpoint"):
        analyse(op, observed, background=BELIEF, iterations=20, checkpoint=at)
    with pytest.raises(KeyboardInterrupt):
        analyse(op, observed, background=BELIEF, iterations=20, told=stop)


def test_light_is_solved_once_for_each_state(monkeypatch: pytest.MonkeyPatch) -> None:
    op, observed, _ = twin()
    solved, forward = [], op.core.forward

    def counted(extinction: np.ndarray, albedo: np.ndarray, start: object = None) -> object:
        solved.append(extinction.tobytes() + albedo.tobytes())
        return forward(extinction, albedo, start)

    monkeypatch.setattr(op.core, "forward", counted)
    for method, outer in (("lbfgs", 1), ("gauss-newton", 2)):
        solved.clear()
        analyse(op, observed, background=BELIEF, iterations=8, method=method, outer=outer)
        assert len(set(solved)) == len(solved) > 2, method


def test_what_is_stopped_before_anything_is_seen_has_nothing_to_tell(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    op, observed, _ = twin()

    def stop(*given: object, **named: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(op.core, "forward", stop)
    with pytest.raises(KeyboardInterrupt):
        analyse(op, observed, background=BELIEF, iterations=4, checkpoint=tmp_path / "way.npz")


@pytest.fixture(scope="module")
def analysis() -> Analysis:
    op, observed, _ = twin()
    return analyse(op, observed, background=BELIEF, iterations=15)


def test_the_scene_of_an_analysis(analysis: Analysis, tmp_path: Path) -> None:
    scene = analysis.scene
    field = scene.data["extinction_cloud"].values
    assert (field == 0).mean() > 0.37  # .476: what is not above the floor is clear air
    assert np.abs(field - analysis.state["extinction_cloud"].values).max() <= 2.03e-5
    scene.to_netcdf(tmp_path / "analysis.nc")
    again = open_scene(tmp_path / "analysis.nc")
    assert np.array_equal(again.data["extinction_cloud"].values, field)
    assert "analysis of" in " ".join(again.notes)
    rows = analysis.to_dataset()
    assert rows["cost"].size == 16
    assert rows["seen_after"].shape == rows["observed_value"].shape
    of_cameras = rows["instrument"] < 2
    assert np.array_equal(rows["observed_wavelength"].values == 550.0, of_cameras)  # watts have none


def test_the_page_of_an_analysis(analysis: Analysis, tmp_path: Path) -> None:
    analysis.report(tmp_path / "analysis.html")
    page = (tmp_path / "analysis.html").read_text("utf-8")
    assert page.count("<figure>") == 2 * 5 + 4  # of each camera five, of each of two fields two
    assert "http" not in page.replace("http://www.w3.org", "")
    assert "rms before" in page


def test_what_cannot_be_analysed_is_one_line() -> None:
    op, observed, _ = twin()
    for given, match in (
        ({"method": "newton"}, "unknown"),
        ({"transform": "cube"}, "unknown"),
        ({"iterations": 0}, "1 or more"),
        ({"departures": "swim"}, "farther off"),
        ({"background": None}, "Background"),
    ):
        with pytest.raises(UserError, match=match):
            analyse(op, observed, **{"background": BELIEF, **given})
    with pytest.raises(UserError, match="not a row"):
        analyse(op, observed.isel(observation=slice(0, 3)), background=BELIEF)
    with pytest.raises(UserError, match="none may be used"):
        analyse(op, observed.assign(use=observed["use"] & False), background=BELIEF)
    with pytest.raises(UserError, match="images for"):
        op.observations([])
