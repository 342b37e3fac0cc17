"""`openswim irradiance` and `openswim satellite`: files written, what is said, one line per mistake."""

from __future__ import annotations

import csv
from pathlib import Path

import numpy as np
import pytest
import xarray as xr

import openswim
from openswim.cli.irradiance import IrradianceRequest, _times
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


def clear_day(scene, lat, lon, times, **options) -> xr.Dataset:
    """In place of `openswim.irradiance`: light that is smooth in time."""
    minutes = (np.asarray(times) - np.datetime64("2016-06-23T12:00")) / np.timedelta64(1, "m")
    shape = 0.5 + 0.5 * np.cos(minutes / 400)
    parts = {"ghi": 900.0, "dni": 850.0, "dhi": 90.0}
    return xr.Dataset({name: ("time", top * shape) for name, top in parts.items()}, {"time": times}, {"solves": 1})


@pytest.fixture
def station(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Measured every minute from 9 to 15 UTC at Payerne, without a cloud until 14:00, and under many then."""
    monkeypatch.setattr(openswim, "irradiance", clear_day)
    times = np.datetime64("2016-06-23T09:00") + np.arange(361) * np.timedelta64(1, "m")
    light = clear_day(None, 0, 0, times)
    veiled = np.where((times < np.datetime64("2016-06-23T14:00")) | (np.arange(361) % 7 < 4), 1.0, 0.5)
    table = np.stack([light[name].values * veiled for name in ("ghi", "dni", "dhi")], axis=-1)
    rows = [f"{time}Z,{','.join(f'{value:.1f}' for value in row)}" for time, row in zip(times, table, strict=True)]
    (tmp_path / "a.csv").write_text("\n".join(["utc,ghi,dni,dhi", *rows]) + "\n")
    return tmp_path / "a.csv"


BESIDE = ["irradiance", "--clear", "--lat", "46.8", "--lon", "6.9", "--ground", "490"]


def test_measured_aerosol_is_not_replaced(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    aerosol = tmp_path / "aod.csv"
    aerosol.write_text("measured")
    assert run(["irradiance", "--clear", "--aeronet", str(aerosol), "-o", str(aerosol)]) == 2
    assert "which is needed" in capsys.readouterr().err
    assert aerosol.read_text() == "measured"


@pytest.mark.parametrize("minutes", [1, 10, 15])
def test_clear_times_are_told_before_times_are_left_out(
    minutes: int, station: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "out.csv"
    assert run([*BESIDE, "--station", str(station), "--every", f"{minutes}min", "-o", str(out)]) == 0
    total, clear = 360 // minutes + 1, len(range(0, 295, minutes))  # 5 minutes before the first cloud
    assert f"clear sky at {clear} of {total} times" in capsys.readouterr().out
    assert len(out.read_text().splitlines()) == 1 + total


def test_a_row_that_is_there_twice_counts_once_and_two_values_of_one_time_are_refused(
    station: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    header, first, *rest = station.read_text().splitlines()
    every_ten = [*BESIDE, "--station", str(station), "--every", "10min", "-o", str(tmp_path / "out.csv")]
    assert run(every_ten) == 0
    once = (tmp_path / "out.csv").read_text()
    station.write_text("\n".join([header, first, first, *rest]) + "\n")
    assert run(every_ten) == 0
    assert (tmp_path / "out.csv").read_text() == once
    last = first.split(",")[-1]
    other = first.removesuffix(last) + str(float(last) + 1)
    station.write_text("\n".join([header, first, other, *rest]) + "\n")
    assert run(every_ten) == 2
    assert "there twice for 2016-06-23T09:00:00Z, with two values" in capsys.readouterr().err


def test_a_plot_that_fails_leaves_the_values(
    station: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    pytest.importorskip("matplotlib")
    from openswim.stations import comparison

    def fails(*arguments: object) -> None:
        raise OSError("disc full")

    monkeypatch.setattr(comparison, "plot", fails)
    picture = str(tmp_path / "a.png")
    assert run([*BESIDE, "--station", str(station), "--plot", picture, "-o", str(tmp_path / "out.csv")]) == 1
    assert len((tmp_path / "out.csv").read_text().splitlines()) == 362


@pytest.mark.parametrize(("given", "expected"), [([], (40.0, -3.5, 1200.0)), (["--ground", "5"], (40.0, -3.5, 5.0))])
def test_an_aeronet_file_says_where_it_stands(
    given: list[str], expected: tuple[float, ...], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "made.lev15").write_text(
        "Date(dd:mm:yyyy),Time(hh:mm:ss),AOD_440nm,AOD_870nm,Site_Latitude(Degrees),Site_Longitude(Degrees),"
        "Site_Elevation(m)\n23:06:2016,11:00:00,0.15,0.06,40.0,-3.5,1200\n"
    )
    found = []

    def seen(scene, lat, lon, times, **options) -> xr.Dataset:
        found.append((lat, lon, float(scene.data.surface_altitude), scene.atmosphere.layers[0].base_height_m))
        return clear_day(scene, lat, lon, times)

    monkeypatch.setattr(openswim, "irradiance", seen)
    assert run(["irradiance", "--clear", "--aeronet", str(tmp_path / "made.lev15"), "--start", "2016-06-23T11:00",
                *given, "-o", str(tmp_path / "a.csv")]) == 0  # fmt: skip
    assert found == [(*expected, expected[2])]


@pytest.mark.parametrize(
    ("options", "count"),
    [({}, 3), ({"every": "30min"}, 13), ({"every": "1800s"}, 13), ({"every": "1h", "start": "2016-06-23T11:00"}, 1)],
)
def test_times_are_from_the_first_of_the_model_to_its_last(options: dict[str, str], count: int) -> None:
    model = np.array(["2016-06-23T09:00", "2016-06-23T12:00", "2016-06-23T15:00"], "datetime64[ms]")
    times = _times(IrradianceRequest((Path("x.nc"),), **options), model)
    assert len(times) == count
    if "start" not in options:
        assert times[0] == model[0]
        assert times[-1] == model[-1]


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (["irradiance", "-o", "a.csv"], "FILES, or --clear"),
        (["irradiance", "--clear", "x.nc", "-o", "a.csv"], "FILES, or --clear"),
        (["irradiance", "--clear", "--lat", "3", "-o", "a.csv"], "--lat and --lon"),
        ([*CLEAR], "--output missing"),
        ([*CLEAR, "-o", "a.png"], "use .nc or .csv"),
        ([*CLEAR, "--end", "2016-06-22", "-o", "a.csv"], "end after the start"),
        ([*CLEAR, "--every", "0", "-o", "a.csv"], "such as 5min"),
        ([*CLEAR, "--end", "2016-06-24", "--every", "0.001s", "-o", "a.csv"], "44400001 times from"),
        ([*CLEAR, "--every", "7", "-o", "a.csv"], "such as 5min"),
        ([*CLEAR, "--plane", "30", "-o", "a.csv"], "2 numbers"),
        ([*CLEAR, "--plane=-0,1e300", "-o", "a.csv"], "tilt within 0..180, azimuth within -360..360"),
        ([*CLEAR, "--fit", "beam", "-o", "a.csv"], "need a --station"),
        (["irradiance", "x.nc", "--aod", "0.1", "--lat", "1", "--lon", "1", "-o", "a.csv"], "of a clear sky"),
        (["irradiance", "--clear", "--station", "a.csv", "--plot", "a.doc"], "use .png"),
        ([*CLEAR, "--aod", "0.1", "--aeronet", "x", "-o", "a.csv"], "--aeronet or --aod"),
        (["irradiance", "--clear", "--station", "none.dat"], "none.dat"),
        (["satellite", "x.nc", "--like", "y.tif", "--imager", "sputnik"], "sputnik"),
        (["satellite", "x.nc", "--like", "y.tif"], "--band missing"),
        (["satellite", "x.nc", "--like", "y.tif", "--band", "C02", "-o", "a.png"], "use .nc or .tif"),
        (["satellite", "x.nc", "--like", "y.tif", "--band", "C02"], "y.tif"),
        (["satellite", "x.nc", "--band", "C02"], "which pixels"),
        (["satellite", "x.nc", "--band", "C02", "--grid", "full", "--like", "y.tif"], "which pixels"),
        (["satellite", "x.nc", "--band", "C02", "--grid", "full"], "--output missing"),
        (["satellite", "x.nc", "--band", "C02", "--like", "y.tif", "--every", "2"], "--every belongs to --grid"),
        (
            ["satellite", "x.nc", "--band", "C02", "--disc", "nan", "0", "1.5e6", "-o", "a.nc"],
            "--disc nan 0 1.5e+06: give",
        ),
        (["satellite", "x.nc", "--band", "C02", "--disc", "0", "0", "inf", "-o", "a.nc"], "--disc 0 0 inf: give"),
        (["satellite", "x.nc", "--band", "C02", "--grid", "meso", "-o", "a.nc"], "has full and conus"),
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


def test_hourly_values_do_not_tell_a_steady_sky(station: Path, capsys: pytest.CaptureFixture[str]) -> None:
    lines = station.read_text().splitlines()
    station.write_text("\n".join([lines[0], *lines[1::60]]) + "\n")
    assert run([*BESIDE, "--station", str(station)]) == 2
    said = capsys.readouterr().err
    assert "values are 60 minutes apart: that it is steady is told by several within ten" in said


def test_beside_an_overcast_day_the_clear_sky_is_written_and_checks_are_in_words(
    station: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    head, *rows = station.read_text().splitlines()
    station.write_text("\n".join([head, *(f"{row.split(',')[0]},100,0,140" for row in rows)]) + "\n")
    command = [*BESIDE, "--station", str(station), "--start", "2016-06-23T10:00"]
    assert run([*command, "-o", str(tmp_path / "out.csv")]) == 0
    said = capsys.readouterr()
    assert len((tmp_path / "out.csv").read_text().splitlines()) == 302
    assert "parts: 301 of 301 values where global and its parts disagree" in said.err  # of the chosen times
    assert f"note: {station}: clear sky at no time: nothing to compare with a clear sky; what" in said.err
    assert run([*command, "--every", "10min", "-o", str(tmp_path / "out.csv")]) == 0  # told by all that was measured
    assert "minutes apart" not in capsys.readouterr().err
    assert run([*command, "--fit", "beam", "-o", str(tmp_path / "fit.csv")]) == 2
    assert not (tmp_path / "fit.csv").exists()


def test_rows_that_were_left_out_are_told(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(openswim, "irradiance", clear_day)
    rows = [f"2016,175,{100 * hour},{50 * hour}" for hour in range(6, 18)]
    table = tmp_path / "midc.txt"
    table.write_text("\n".join(["Year,DOY,UTC,Global PSP [W/m^2]", *rows, "2016,175,18"]) + "\n")
    assert run([*BESIDE, "--station", str(table), "-o", str(tmp_path / "out.csv")]) == 0
    said = capsys.readouterr().err.splitlines()
    assert f"note: {table}: 1 of 13 rows have not as many columns as there are names: left out" in said


def test_an_imager_is_told_what_was_assumed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """The notes that `openswim render` prints, once each, and among them that the file knows no place."""
    rows = [f"{i} {j} {k} {0.1 * (k == 1):.2f} 10.0" for i in range(4) for j in range(4) for k in range(4)]
    file = tmp_path / "les.txt"
    file.write_text("\n".join(["# a cloud", "4 4 4", "2.0 2.0 0.1 0.2 0.3 0.4", *rows]) + "\n")

    def stopped(*_: object, **__: object) -> None:
        raise openswim.UserError("seen enough")

    monkeypatch.setattr("openswim.satellites.picture.reflectance", stopped)
    assert run(["satellite", str(file), "--band", "C02", "--grid", "full", "-o", str(tmp_path / "a.nc")]) == 2
    said = capsys.readouterr().err
    place = "no place in the file: its centre is laid at 0, -75"
    assert said.count(f"note: {place}\n") == 1
    notes = openswim.open_scene(file, around=(0.0, -75.0)).notes
    assert place in notes
    assert all(f"note: {note}\n" in said for note in notes)


def test_a_model_of_one_time_is_asked_at_that_time(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys) -> None:
    """As --help says; under a sun of other hours its clouds are those of that time, which is told."""
    monkeypatch.setattr(openswim, "irradiance", clear_day)
    axis, z = np.arange(4) * 1000.0, np.array([0.0, 1000.0, 2000.0])
    scene = openswim.Scene.from_arrays(np.full((3, 4, 4), 1e-3), axis, axis, z, place=(47.0, 11.0),
                                       time=np.datetime64("2024-06-01T12:00"))  # fmt: skip
    scene.to_netcdf(tmp_path / "one.nc")
    line = ["irradiance", str(tmp_path / "one.nc"), "--lat", "47", "--lon", "11", "-o", str(tmp_path / "light.csv")]
    assert run(line) == 0
    assert (tmp_path / "light.csv").read_text().splitlines()[1].startswith("2024-06-01T12:00:00Z,")
    assert "clouds do not move" not in capsys.readouterr().err
    assert run([*line, "--start", "2024-06-01T18:00", "--end", "2024-06-01T18:00:01", "--every", "0.5s"]) == 0
    assert "light of 2024-06-01T18:00:01Z, 6.0 hours after it: clouds do not move" in capsys.readouterr().err
    rows = (tmp_path / "light.csv").read_text().splitlines()[1:]
    assert [row.partition(",")[0] for row in rows] == [f"2024-06-01T18:00:0{s}Z" for s in ("0.000", "0.500", "1.000")]


def test_a_flat_model_without_a_place_is_lit_at_the_one_that_is_asked_for(tmp_path, monkeypatch, capsys) -> None:
    monkeypatch.setattr(openswim, "irradiance", clear_day)
    axis, z = np.arange(4) * 1000.0, np.array([0.0, 1000.0, 2000.0])
    openswim.Scene.from_arrays(np.full((3, 4, 4), 1e-3), axis, axis, z).to_netcdf(tmp_path / "flat.nc")
    line = ["irradiance", str(tmp_path / "flat.nc"), "--lat", "47", "--lon", "11", "--start", "2024-06-01T12:00"]
    assert run([*line, "-o", str(tmp_path / "light.csv")]) == 0, capsys.readouterr().err
    assert "light is solved 1 time" in capsys.readouterr().err


def _cloud(path: Path, **options) -> Path:
    axis, z = np.arange(4) * 0.1, np.array([0.0, 1000.0, 2000.0])
    scene = openswim.Scene.from_arrays(np.full((3, 4, 4), 1e-3), axis - 75.0, axis, z, crs="EPSG:4326",
                                       time=np.datetime64("2016-06-23T12:00"))  # fmt: skip
    scene.to_netcdf(path)
    return path


def test_pixels_of_an_imager_that_cannot_be_are_told_with_the_remedy(tmp_path: Path, capsys) -> None:
    curved, axis = _cloud(tmp_path / "curved.nc"), np.arange(4) * 1000.0
    flat = tmp_path / "flat.nc"
    openswim.Scene.from_arrays(np.full((3, 4, 4), 1e-3), axis, axis, axis[:3], time="2016-06-23T12:00").to_netcdf(flat)
    line = ["--band", "C02", "--grid", "full", "-o", str(tmp_path / "a.nc")]
    for file, more, says in (
        (flat, [], "a flat scene has no place on Earth for a satellite to look at: give it a crs"),
        (curved, ["--every", "50"], "--every 50: leaves less than two of the"),
        (curved, ["--every", "1" + "0" * 20], "leaves less than two of the"),
    ):
        assert run(["satellite", str(file), *line, *more]) == 2
        assert says in capsys.readouterr().err


def test_times_that_are_left_are_told_by_the_clock_and_not_by_rows(station: Path, tmp_path: Path) -> None:
    """Its second row comes an hour after the first."""
    lines = station.read_text().splitlines()
    station.write_text("\n".join([*lines[:2], *lines[62:]]) + "\n")
    out = tmp_path / "out.csv"
    assert run([*BESIDE, "--station", str(station), "--every", "10min", "-o", str(out)]) == 0
    assert len(out.read_text().splitlines()) == 1 + 1 + 30 + 1  # names, the first, and from ten to three


def test_values_by_night_are_no_part_of_the_differences(tmp_path: Path, monkeypatch, capsys) -> None:
    """Three hours of them, before the sun is up at about 10:55 UTC."""
    monkeypatch.setattr(openswim, "irradiance", clear_day)
    times = np.datetime64("2016-06-23T08:00") + np.arange(0, 361, 10).astype("timedelta64[m]")
    rows = [f"{time}Z,{0.5 + 80.0 * (time > np.datetime64('2016-06-23T11:00')):.1f}" for time in times]
    (tmp_path / "a.csv").write_text("\n".join(["utc,ghi", *rows]) + "\n")
    place = ["--lat", "0", "--lon", "-75", "--ground", "0", "--start", "2016-06-23T08:00"]
    line = ["irradiance", str(_cloud(tmp_path / "one.nc")), *place, "--station", str(tmp_path / "a.csv")]
    assert run([*line, "-o", str(tmp_path / "b.csv")]) == 0, capsys.readouterr().err
    said = capsys.readouterr().out
    assert "(sun above the horizon)" in said
    assert f"n = {(times > np.datetime64('2016-06-23T10:55')).sum()}" in said
