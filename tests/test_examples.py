"""Python blocks of the README and of pages in docs run as pasted, on a small file of ours."""

from __future__ import annotations

import inspect
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from tests.readers.conftest import WRFSpec, write_wrf

import openswim

ROOT = Path(__file__).parents[1]
SMALL = {1440: 24, 800: 16}  # pixels of a picture whose size is not said


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Where examples run: it has the weather file that they name, around 24.5 N, 90 W; cameras make small pictures."""
    around = {"TRUELAT1": 24.5, "TRUELAT2": 24.5, "STAND_LON": -89.72, "MOAD_CEN_LAT": 24.31}  # cells of 3 km
    thin = {"QCLOUD": lambda content: 0.01 * content}  # what is thick takes longer
    write_wrf(tmp_path / "wrfout_d01_...", WRFSpec(times=("2005-08-28_18:00:00",), attributes=around, change=thin))
    monkeypatch.chdir(tmp_path)
    for name in ("panorama", "allsky"):
        made = inspect.unwrap(getattr(openswim.Camera, name).__func__)
        monkeypatch.setattr(made, "__defaults__", tuple(SMALL.get(value, value) for value in made.__defaults__))
    return tmp_path


def run(page: str, module: str = "") -> dict[str, Any]:
    """What is defined after all Python blocks of a page, one after the other."""
    blocks = re.findall(r"^```python\n(.*?)^```", (ROOT / page).read_text("utf-8"), re.MULTILINE | re.DOTALL)
    assert blocks
    names: dict[str, Any] = {"__name__": module} if module else {}
    for block in blocks:
        exec(compile(block, page, "exec"), names)
    return names


def test_the_readme_shows_a_sky(folder: Path) -> None:
    image = run("README.md")["image"]
    assert image.radiance.dims == ("y", "x", "wavelength")
    assert image.attrs["valid_time"] == "2005-08-28T18:00:00Z"
    assert (image.attrs["latitude"], image.attrs["longitude"]) == (24.5, -90)
    assert np.isfinite(image.radiance).all()
    assert image.radiance.min() > 0  # at noon nothing is black


def test_one_solve_serves_many_cameras(folder: Path) -> None:
    found = run("docs/light.md")
    image = found["image"]
    assert found["corner"].radiance.equals(image.radiance[:8, :12])
    np.testing.assert_array_equal(found["whole"], image.radiance)
    assert found["sky"].shape == (4, 3)
    assert found["evening"].viewpoint(found["camera"]).sun == pytest.approx((280, 5), abs=0.2)
    for lit in (found["lit"], found["again"]):
        assert openswim.render(lit, found["viewpoint"].camera).radiance.equals(image.radiance)


def test_irradiance_of_a_model_and_of_a_clear_sky(folder: Path) -> None:
    found = run("docs/irradiance.md")
    assert found["light"].poa_global.shape == (2, 1)
    assert found["both"].ghi.shape == (1,)
    east, noon = found["day"].ghi.values
    assert 250 < east < 400  # a clear June morning and noon
    assert 850 < noon < 1000


def test_reflectance_of_an_imager(folder: Path) -> None:
    found = run("docs/satellites.md")
    picture = found["picture"]
    known = np.isfinite(picture.reflectance_factor.values[0])
    assert known.any()
    assert (picture.reflectance_factor.values[0][known] > 0.005).all()
    assert found["red"].error < 0.003


def test_rays_and_spectra(folder: Path) -> None:
    found = run("docs/running.md")
    assert found["radiance"].shape == (3, 1)
    assert found["reflected"].shape == (2, 1)
    assert found["zenith"].shape == (7,)
    assert (found["radiance"] > 0).all()
    irradiance = found["spectrum"].attrs["global_horizontal_spectral_irradiance_w_m2_nm"]
    np.testing.assert_allclose(found["sky"], irradiance, rtol=0.0035)  # .0027


def test_what_a_pixel_shows(folder: Path) -> None:
    found = run("docs/layers.md")
    image = found["image"]
    assert np.isfinite(image.distance.values[image.altitude.values < -1]).all()  # the sea
    sight = found["sight"]
    assert np.isnan(sight.distance_m[0]) == (sight.names[sight.kind[0]] == "sky")


def test_the_linear_core_and_its_adjoint(folder: Path) -> None:
    found = run("docs/linear.md")
    change, core = found["change"], found["core"]
    squares = sum(float((each**2).sum()) for each in (*change.radiance, change.ghi))
    assert squares > 0
    assert float((0.01 * core.extinction * found["extinction_bar"]).sum()) == pytest.approx(squares, rel=1e-4)  # 4e-5


def test_a_plan_is_carried_out(folder: Path) -> None:
    """The plan of docs/batch.md, of small pictures, by the Python block below it."""
    page = (ROOT / "docs/batch.md").read_text("utf-8")
    (plan,) = re.findall(r"^```toml\n(openswim_batch.*?)^```", page, re.MULTILINE | re.DOTALL)[:1]
    text = plan.replace("size = 400", "size = 16").replace("900x600", "24x16")
    (folder / "plan.toml").write_text(text.replace("\n\n", '\nsolver = "swim"\n', 1))
    report = run("docs/batch.md", "__main__")["report"]
    assert (len(report.made), report.standing, report.failed) == (1, 0, ())
    names = {path.name for path in (folder / "pictures").iterdir() if not path.name.startswith(".")}
    stem = "20050828T180000"
    assert names == {f"roof_{stem}.png", f"harbour_{stem}.jpg", f"harbour_{stem}.nc", "manifest.jsonl"}
