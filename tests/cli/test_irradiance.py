"""`openswim irradiance` and `openswim satellite`: files written, what is said, one line per mistake."""

from __future__ import annotations

import csv
from pathlib import Path

import pytest
import xarray as xr

from openswim.cli.main import run

CLEAR = ["irradiance", "--clear", "--lat", "46.8", "--lon", "6.9", "--start", "2016-06-23T11:40"]


@pytest.mark.slow
def test_a_clear_sky_as_csv_and_netcdf(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    aeronet = tmp_path / "made.lev15"
    aeronet.write_text("Date(dd:mm:yyyy),Time(hh:mm:ss),AOD_440nm,AOD_870nm,Precipitable_Water(cm),Ozone(Dobson)\n"
                       "23:06:2016,11:00:00,0.15,0.06,3.0,320\n")  # fmt: skip
    target = tmp_path / "light.csv"
    assert run([*CLEAR, "--plane", "30,180", "--aeronet", str(aeronet), "-o", str(target)]) == 0
    assert "1 times" in capsys.readouterr().out
    with target.open(newline="") as file:
        (row,) = csv.DictReader(file)
    assert row["utc"] == "2016-06-23T11:40:00Z"
    assert 880 < float(row["ghi"]) < 960
    assert float(row["poa_global_30_180"]) > float(row["ghi"])
    assert float(row["water_vapour"]) == pytest.approx(3.0, rel=2e-3)
    assert float(row["ozone"]) == pytest.approx(320, abs=2)
    assert run([*CLEAR, "-o", str(tmp_path / "light.nc")]) == 0
    with xr.open_dataset(tmp_path / "light.nc") as data:
        assert data.ghi.attrs["standard_name"] == "surface_downwelling_shortwave_flux_in_air"


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (["irradiance", "-o", "a.csv"], "FILES, or --clear"),
        (["irradiance", "--clear", "x.nc", "-o", "a.csv"], "FILES, or --clear"),
        (["irradiance", "--clear", "--lat", "3", "-o", "a.csv"], "--lat and --lon"),
        ([*CLEAR], "--output missing"),
        ([*CLEAR, "-o", "a.png"], "use .nc or .csv"),
        ([*CLEAR, "--end", "2016-06-22", "-o", "a.csv"], "end after the start"),
        ([*CLEAR, "--every", "0", "-o", "a.csv"], "above 0"),
        ([*CLEAR, "--plane", "30", "-o", "a.csv"], "2 numbers"),
        ([*CLEAR, "--fit", "beam", "-o", "a.csv"], "need a --station"),
        (["irradiance", "x.nc", "--aod", "0.1", "--lat", "1", "--lon", "1", "-o", "a.csv"], "of a clear sky"),
        ([*CLEAR, "--aod", "0.1", "--aeronet", "x", "-o", "a.csv"], "--aeronet or --aod"),
        (["irradiance", "--clear", "--station", "none.dat"], "none.dat"),
        (["satellite", "x.nc", "--like", "y.tif", "--imager", "sputnik"], "sputnik"),
        (["satellite", "x.nc", "--like", "y.tif"], "--band missing"),
        (["satellite", "x.nc", "--like", "y.tif", "--band", "C02", "-o", "a.png"], "use .nc or .tif"),
        (["satellite", "x.nc", "--like", "y.tif", "--band", "C02"], "y.tif"),
    ],
)
def test_mistakes_are_one_line(
    arguments: list[str], says: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    assert run(arguments) == 2
    said = capsys.readouterr().err.strip().splitlines()
    assert len(said) == 1
    assert says in said[0]
