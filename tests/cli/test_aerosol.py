"""`openswim aerosol`: types listed, fits printed, written and drawn, one line per mistake."""

import json
import re
from pathlib import Path

import numpy as np
import pytest

from openswim.cli.main import run
from openswim.optics.aerosol import NAMES
from openswim.scene.aerosol import AerosolProfile
from openswim.scene.phase import phase_from_dict

SMALL = ["aerosol", "fit", "--mode", "0.05,1.4", "--index", "1.45+0.01i", "--wavelengths", "600,450"]


def test_types(capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["aerosol", "types"]) == 0
    said = capsys.readouterr().out.splitlines()
    assert [line.split()[0] for line in said[1:]] == list(NAMES)
    assert "0.950   0.650      1.30" in said[1]


def test_fit_prints_writes_and_draws(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    pytest.importorskip("miepython")
    outputs = ["--json", str(tmp_path / "fit.json"), "--plot", str(tmp_path / "fit.png")]
    assert run([*SMALL, *outputs]) == 0, capsys.readouterr().err
    said = capsys.readouterr().out
    assert "Angstrom exponent" in said
    assert (tmp_path / "fit.png").read_bytes().startswith(b"\x89PNG")
    found = json.loads((tmp_path / "fit.json").read_text())
    assert found["wavelength_nm"] == [600.0, 450.0]
    # r exp(2.5 s^2)
    assert found["effective_radius_um"] == pytest.approx(0.05 * np.exp(2.5 * np.log(1.4) ** 2), rel=0.01)
    assert found["fits"][0]["asymmetry"] < found["fits"][1]["asymmetry"]  # larger, in wavelengths, in the blue
    profile = AerosolProfile.from_dict(found["aerosol"] | {"optical_depth": 0.2})
    assert profile.angstrom_exponent == found["angstrom_exponent"] > 1
    described = found["aerosol"]["phase"]["spectral"]["450.0"]
    fitted = phase_from_dict(described)
    assert fitted.asymmetry == pytest.approx(
        found["fits"][1]["asymmetry"] + found["fits"][1]["asymmetry_error"], abs=1e-6
    )


def test_either_sign_of_an_index_absorbs(capsys: pytest.CaptureFixture[str]) -> None:
    pytest.importorskip("miepython")
    said = []
    for index in ("1.45+0.01i", "1.45-0.01i", "1.45"):
        assert run([*SMALL[:4], "--index", index, "--wavelengths", "600"]) == 0
        said.append(capsys.readouterr().out.splitlines()[1].split())
    assert said[0] == said[1]
    assert float(said[0][-1]) < 0.99 < float(said[2][-1])  # the single-scattering albedo


def test_an_index_that_is_not_given_for_a_wavelength_is_told(capsys: pytest.CaptureFixture[str]) -> None:
    pytest.importorskip("miepython")
    given = [*SMALL[:4], "--index", "500:1.45+0.01i"]
    assert run([*given, "--wavelengths", "600,500,450"]) == 0
    assert "note: --index says nothing of 600, 450 nm, which lie beyond 500 nm: the nearest" in capsys.readouterr().err
    assert run([*given, "--index", "600:1.45+0.01i", "--wavelengths", "600,550"]) == 0
    assert "note" not in capsys.readouterr().err


def test_fit_of_a_named_type_gives_the_papers_numbers_back(capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["aerosol", "fit", "--type", "colorado_dust", "--wavelengths", "546"]) == 0
    row = capsys.readouterr().out.splitlines()[1].split()
    assert [float(number) for number in row[:5]] == [546, 0.9, 0.6, 0.12, 0.55]


@pytest.mark.parametrize(
    ("options", "line"),
    [
        ([], "at least one --mode"),
        (["--type", "dust", "--irregular"], "either --type, or --mode"),
        (["--type", "dust", "--plot", "x.bmp"], "--plot x.bmp: suffix '.bmp' is unknown"),
        (["--mode", "0.1"], "at least one --mode"),
        (["--mode", "0.1", "--index", "1.5"], "RADIUS,STD"),
        (["--mode", "0.1,big", "--index", "1.5"], "not a list of numbers"),
        (["--mode", "0.1,0.5", "--index", "1.5"], "geometric standard deviation"),
        (["--mode", "0.1,1.5", "--index", "water"], "--index water"),
        (["--mode", "0.1,1.5", "--index", "nan:1.5+0i"], "--index nan:1.5+0i"),
        (["--mode", "0.1,1.5", "--index", "inf"], "--index inf"),
        (["--type", "dust", "--json", "a.png", "--plot", "./a.png"], "--json a.png: suffix '.png' is unknown"),
        (["--mode", "0.1,1.5", "--index", "1.5", "--index", "440:1.4"], "different wavelength"),
        (["--type", "pollen"], "unknown aerosol type"),
        (["--type", "dust", "--mode", "0.1,1.5"], "either --type"),
        (["--type", "dust", "--wavelengths", "0.55"], "nanometres"),
        (["--type", "dust", "--json", "missing/fit.json"], "--json"),
        (["--type", "dust", "--by", "volume"], "--by volume belongs to --mode"),
        (["--type", "dust", "--time", "2020"], "--time 2020 belongs to --aeronet"),
        (["--mode", "0.1,1.5", "--index", "1.5", "--time", "2020"], "--time 2020 belongs to --aeronet"),
        (["--type", "dust", "--json", "curved.nc"], "suffix '.nc' is unknown; use .json"),
        (["--type", "dust", "--plot", "fit.doc"], "--plot fit.doc"),
    ],
)
def test_mistakes_are_one_line(options, line, capsys, tmp_path, monkeypatch) -> None:
    monkeypatch.chdir(tmp_path)
    assert run(["aerosol", "fit", *options]) == 2
    said = capsys.readouterr().err.strip()
    assert line in said
    assert "\n" not in said
    assert not list(tmp_path.iterdir())


def test_the_snippets_of_the_documentation_run(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("miepython")
    monkeypatch.chdir(tmp_path)
    assert run(["aerosol", "fit", "--type", "dust", "--json", "dust.json"]) == 0
    page = (Path(__file__).resolve().parents[2] / "docs" / "optics.md").read_text()
    for snippet in re.findall(r"```python\n(.*?)```", page, re.DOTALL):
        exec(snippet, {})


def test_files_without_an_inversion_are_named_and_cut_ones_told(tmp_path: Path, capsys) -> None:
    path = tmp_path / "a.lev15"
    path.write_text("Date(dd:mm:yyyy),Time(hh:mm:ss),AOD_440nm\n27:05:2013,11:00:00,0.2\n27:05:2013")
    assert run(["aerosol", "fit", "--aeronet", str(path)]) == 2
    note, error = capsys.readouterr().err.splitlines()
    assert note.startswith(f"note: {path}: 1 of 2 rows")
    assert f"{path}: no size distribution and refractive index" in error
