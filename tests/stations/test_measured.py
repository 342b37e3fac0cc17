"""Station files, their checks, clear sky and aerosol by them: on real files and on made ones."""

from __future__ import annotations

import gzip
import os
from pathlib import Path

import numpy as np
import pytest
import xarray as xr

from openswim.errors import UserError
from openswim.scene.atmosphere import AerosolProfile
from openswim.stations.checks import checked, doubts, sun_of, told_of_swap
from openswim.stations.clear_day import albedo_of, fit_aerosol, scene_over, vapour_of, visible_albedo_of
from openswim.stations.clear_sky import clear_times
from openswim.stations.comparison import differences, plot
from openswim.stations.files import read_station
from openswim.stations.through_time import irradiance

SHARED = Path(os.environ.get("OPENSWIM_SHARED", Path(__file__).parents[3] / "shared"))
RAW, TABLES = SHARED / "data/sky", SHARED / "reference/clearsky"
needs_files = pytest.mark.skipif(not RAW.exists(), reason="no reference data")


@needs_files
@pytest.mark.parametrize(
    ("name", "place", "table"),
    [
        ("bsrn_raw/pay0616_excerpt.dat.gz", {}, "bsrn_payerne_20160623"),
        ("irradiance/sgpsirsE13.b1.20190101.000000.cdf", {}, "arm_sgp_sirs_20190101"),
        ("irradiance/midc_raw_20181018.txt", {"lat": 32.23, "lon": -110.955, "height_m": 786}, None),
    ],
)
def test_files_of_networks_have_what_their_tables_have(name, place, table):
    found = read_station(RAW / name, **place)
    if table is None:  # noon by the sun, so that the clock is right
        track = sun_of(found)
        assert abs(found.time.values[np.nanargmax(found.ghi)] - found.time.values[track.altitude_deg.argmax()]) < (
            np.timedelta64(30, "m")
        )
        return
    same = read_station(TABLES / f"{table}.csv")
    both = np.intersect1d(found.time, same.time)
    assert both.size > 500
    for quantity in same:
        np.testing.assert_allclose(found[quantity].sel(time=both), same[quantity].sel(time=both), rtol=1e-4, atol=0.01)
    for key in ("latitude", "longitude", "height_m"):
        assert found.attrs[key] == pytest.approx(same.attrs[key], abs=1e-3)


@needs_files
@pytest.mark.parametrize(
    ("name", "place"),
    [
        ("bsrn_raw/pay0616_excerpt.dat.gz", {}), ("irradiance/sgpsirsE13.b1.20190101.000000.cdf", {}),
        ("irradiance/midc_raw_20181018.txt", {"lat": 32.23, "lon": -110.955, "height_m": 786}),
    ],
)  # fmt: skip
def test_swapped_columns_are_told_of_each_measured_day_without_diffuse_light(name, place):
    """Clear ones, overcast ones and those between; clocks that are off are no swap, as far as the day is whole."""
    found = read_station(RAW / name, **place).drop_vars("dhi")
    for day in np.unique(found.time.values.astype("datetime64[D]")):
        good = found.sel(time=str(day))
        assert told_of_swap(good) == ""
        assert "see which column is which" in told_of_swap(good.rename(ghi="dni", dni="ghi"))
        if good.sizes["time"] > 1000:
            for hours in (-6, -1, 2, 8):
                assert told_of_swap(good.assign_coords(time=good.time + np.timedelta64(hours, "h"))) == ""


def _table(path: Path, rows: list[str]) -> Path:
    path.write_text("\n".join(["utc,ghi,dni,dhi,uw_solar,temp_air,relative_humidity", *rows]) + "\n")
    return path


def test_limits_of_long_and_dutton(tmp_path):
    """By hand for 2016-06-23 11:40 at 46.8 N: mu0 = .917, S = 1361.1/1.0164^2 = 1318."""
    path = _table(tmp_path / "a.csv", [
        "2016-06-23T11:40Z,930,930,80,,20,50", "2016-06-23T11:41Z,1900,1400,80,,20,50",
        "2016-06-23T11:42Z,930,500,80,,20,50", "2016-06-23T11:43Z,100,0,120,,20,50",
        "2016-06-23T11:44Z,,930,80,,20,50",
    ])  # fmt: skip
    station = read_station(path, lat=46.815, lon=6.944, height_m=491)
    found = doubts(station)
    assert found.ghi_impossible.values.tolist() == [False, True, False, False, False]
    assert found.dni_impossible.values.tolist() == [False, True, False, False, False]
    assert found.parts_disagree.values.tolist() == [False, True, True, True, False]
    kept, counts = checked(station)
    assert np.isnan(kept.ghi[1])
    assert counts["dni_rare"] == 1


def test_an_upwelling_column_without_values_is_no_albedo(tmp_path):
    station = read_station(_table(tmp_path / "a.csv", ["2016-06-23T11:40Z,930,930,80,,20,50"]), lat=46.8, lon=6.9)
    assert "up" not in station
    assert albedo_of(station) == 0.2
    visible = visible_albedo_of(station)  # 45 % of sunlight is visible, beyond it land is brighter
    assert 0.45 * visible + 0.55 * (0.22 + 0.75 * visible) == pytest.approx(0.2)
    assert float(scene_over(station).data.surface_albedo) == pytest.approx(visible)
    gueymard = pytest.importorskip("pvlib.atmosphere").gueymard94_pw(20, 50)
    assert vapour_of(station) == pytest.approx(float(gueymard), rel=0.005)


def test_global_light_alone_does_not_make_a_clear_sky():
    time = np.arange("2019-07-05T15:00", "2019-07-05T16:00", dtype="datetime64[m]")
    model = {name: np.full(60, value) for name, value in (("ghi", 800.0), ("dni", 850.0), ("dhi", 90.0))}
    measured = {"ghi": np.full(60, 780.0), "dni": np.full(60, 420.0), "dhi": np.full(60, 380.0)}  # thin cloud
    assert clear_times(time, {"ghi": measured["ghi"]}, model).all()
    assert not clear_times(time, measured, model).any()
    assert clear_times(time, model, model).all()
    flicker = {"ghi": np.where(np.arange(60) % 2, 800.0, 700.0)}
    assert not clear_times(time, flicker, model).any()


@pytest.fixture(scope="module")
def made():
    """A day that the model itself has made, with an optical depth of .12."""
    times = np.arange("2016-06-23T05:00", "2016-06-23T12:00", 20, dtype="datetime64[m]").astype("datetime64[ns]")
    about = {"latitude": 46.8, "longitude": 6.9, "height_m": 491.0, "source": "made"}
    bare = xr.Dataset(coords={"time": times}, attrs=about)
    scene = scene_over(bare, AerosolProfile(0.12, base_height_m=491.0))
    light = irradiance(scene, 46.8, 6.9, times)
    return bare.assign({name: ("time", light[name].values) for name in ("ghi", "dni", "dhi")}), light


@pytest.mark.slow
def test_the_aerosol_that_made_a_beam_is_found(made):
    station, _ = made
    fit = fit_aerosol(station, np.ones(station.time.size, bool), scene_over(station))
    assert fit.optical_depth == pytest.approx(0.12, abs=0.001)
    assert fit.rms_w_m2 < 1
    with pytest.raises(UserError, match="too few"):
        fit_aerosol(station, np.zeros(station.time.size, bool), scene_over(station))


@pytest.mark.slow
def test_differences_and_their_plot(made, tmp_path):
    station, light = made
    off = station.assign(ghi=station.ghi - 3.0)
    found = differences(light, off, np.ones(station.time.size, bool))
    assert found["ghi"].bias == pytest.approx(3.0)
    assert found["ghi"].rmse == pytest.approx(3.0)
    assert found["dni"].rmse == 0
    plot(light, off, tmp_path / "day.png")
    assert (tmp_path / "day.png").stat().st_size > 10_000
    for other in (station.isel(time=slice(None, None, -1)), station.isel(time=slice(1, None))):
        with pytest.raises(UserError, match=r"different times .*: compare station.sel\(time=model.time\)"):
            differences(light, other, np.ones(light.time.size, bool))
    with pytest.raises(UserError, match="rows must be True or False for each"):
        differences(light, station, np.arange(3))


@pytest.mark.parametrize("text", ["", "a,b\n1,2\n", "utc,ghi\nnoon,3\n", "\x00\x01"])
def test_what_is_no_station_file_is_refused(tmp_path, text):
    (tmp_path / "x.csv").write_text(text)
    with pytest.raises(UserError):
        read_station(tmp_path / "x.csv")


def _day_of(path, more="", place='{"lat": 47.0, "lon": 8.0, "elev_m": 500}'):
    rows = "".join(f"2020-06-01T{hour:02d}:00:00,{50 * hour}\n" for hour in range(4, 20))
    path.write_text(f"utc,ghi\n{rows}{more}")
    path.with_suffix(".json").write_text(place)
    return path


def test_rows_count_once_and_an_instrument_that_fails_is_not_averaged(tmp_path):
    once, twice = (_day_of(tmp_path / f"{n}.csv", more) for n, more in enumerate(("", "2020-06-01T19:00,950\n")))
    assert read_station(twice).ghi.equals(read_station(once).ghi)
    text = "utc,ghi_1,ghi_2\n2020-06-01T11:00,1100,-999\n2020-06-01T12:00,1100,1000\n"
    (tmp_path / "two.csv").write_text(text)
    np.testing.assert_array_equal(read_station(tmp_path / "two.csv", 47.0, 8.0).ghi, [np.nan, 1050])


def test_a_table_and_its_packed_copy_are_the_same(tmp_path):
    plain, packed = _day_of(tmp_path / "x.csv"), tmp_path / "x.csv.gz"
    packed.write_bytes(gzip.compress(plain.read_bytes()))
    assert read_station(packed, 47.0, 8.0).ghi.equals(read_station(plain).ghi)


@pytest.mark.parametrize("place", ["[]", '"a"', '{"lat": [], "lon": 1}', '{"lat": true, "lon": "x"}', "[" * 90_000,
                                   '{"lat": 999, "lon": 1}', '{"lat": NaN, "lon": 1}', "", " " * 200_000])  # fmt: skip
def test_what_is_no_place_beside_a_table_is_refused(tmp_path, place):
    with pytest.raises(UserError, match=r"x\.(json|csv)"):
        read_station(_day_of(tmp_path / "x.csv", place=place))


def test_a_place_that_waits_for_ever_is_refused(tmp_path):
    table = _day_of(tmp_path / "x.csv")
    (tmp_path / "x.json").unlink()
    os.mkfifo(tmp_path / "x.json")
    with pytest.raises(UserError, match=r"x\.json: .*pipe"):
        read_station(table)


@pytest.mark.parametrize(
    ("more", "message"),
    [
        ("noon,3\n", r"x\.csv: time 'noon'"),
        ("2020-06-01T20:00:00\n", r"x\.csv: 1 columns in the row of '2020-06-01T20:00:00', and 2 names"),
        ("1600-06-01T12:00,500\n", r"x\.csv: times of the years 1600 to 2020"),
        ("2500-06-01T12:00,500\n", r"x\.csv: times of the years 2020 to 2500"),
        ("2020-06-01T19:00:00,3\n", r"x\.csv: ghi is there twice for 2020-06-01T19:00:00Z, .*Give UTC"),
        ("1" * 1_100_000, r"x\.csv: is larger"),
        (",\n" * 1_200_000, r"x\.csv: has more than 1100000 lines"),
    ],
)
def test_a_table_names_itself_and_has_an_end(tmp_path, more, message):
    with pytest.raises(UserError, match=message):
        read_station(_day_of(tmp_path / "x.csv", more))


@needs_files
@pytest.mark.parametrize("damage", ["cut", "flipped", "bomb"])
def test_damaged_packed_files_are_refused(tmp_path, damage):
    content = (RAW / "bsrn_raw/pay0616_excerpt.dat.gz").read_bytes()
    middle = len(content) // 2
    (tmp_path / "x.dat.gz").write_bytes({
        "cut": content[:middle], "flipped": content[:middle] + b"\xff" * 9 + content[middle + 9 :],
        "bomb": content + gzip.compress(b"\n" * 2_000_000),
    }[damage])  # fmt: skip
    with pytest.raises(UserError, match=r"x\.dat\.gz"):
        read_station(tmp_path / "x.dat.gz")


def test_a_radiometer_of_endless_size_is_refused(tmp_path):
    """A header that claims more than the file has: xarray would have asked for all that memory."""
    content = bytearray(_radiometer(tmp_path / "good.cdf").read_bytes())
    at = content.index(b"time") + 4
    content[at : at + 4] = (2_000_000_000).to_bytes(4)
    (tmp_path / "x.cdf").write_bytes(content)
    with pytest.raises(UserError, match=r"x\.cdf: truncated"):
        read_station(tmp_path / "x.cdf")


def _radiometer(path):
    times = np.datetime64("2020-06-01", "ns") + np.arange(9) * np.timedelta64(60, "s")
    data = xr.Dataset({"down_short_hemisp": ("time", np.full(9, 5.0)), "lat": 36.0, "lon": -97.0, "alt": 318.0},
                      coords={"time": times})  # fmt: skip
    data.to_netcdf(path, format="NETCDF3_CLASSIC")
    assert read_station(path).attrs["latitude"] == 36
    return path


@needs_files
@pytest.mark.parametrize("change", [lambda m: m[:-1], lambda m: m[1:], lambda m: m[:4] + m[5:], lambda m: [m[0], *m],
                                    lambda m: [m[0].replace("  2 ", " 31 ", 1), *m[1:]]])  # fmt: skip
def test_a_line_of_bsrn_that_is_lost_does_not_turn_global_into_diffuse_light(tmp_path, change):
    packed = (RAW / "bsrn_raw/pay0616_excerpt.dat.gz").read_bytes()
    lines = gzip.decompress(packed).decode("latin-1").splitlines()
    start = lines.index("*U0100") + 1
    (tmp_path / "x.dat").write_text("\n".join(lines[:start] + change(lines[start : start + 10]) + lines[start + 10 :]))
    with pytest.raises(UserError, match=r"x\.dat: line \d+ is not the (first|second) line of a minute"):
        read_station(tmp_path / "x.dat")


@needs_files
def test_sums_beside_global_light_are_not_averaged_with_it():
    """The table's own highest value; half of it came out where its kWhr/m2 were taken for an instrument."""
    found = read_station(RAW / "irradiance/midc_20181014.txt", 39.74, -105.18)
    assert float(found.ghi.max()) == pytest.approx(885.436, abs=0.01)


@pytest.mark.parametrize(("names", "row", "ghi"), [
    ("ghi,ghi_flag,ghi_std,uw_ir", "700,0,9,400", 700), ("ghi,ghi_clear", "700,900", 700),
    ("ghi_1,ghi_2", "700,720", 710), ("ghi [kW/m2]", ".7", 700), ("GHI (W/m^2)", "700", 700),
])  # fmt: skip
def test_columns_count_by_their_names_and_units(tmp_path, names, row, ghi):
    (tmp_path / "x.csv").write_text(f"\ufeffutc,{names}\n2020-06-01T12:00,{row}\n", encoding="utf-8")
    found = read_station(tmp_path / "x.csv", 47.0, 8.0)
    assert float(found.ghi[0]) == pytest.approx(ghi)
    assert set(found) == {"ghi"}


@pytest.mark.parametrize(("names", "row", "message"), [
    ("ghi,ghi", "700,0", "'ghi' is there twice"), ("ghi", ".7", "are they kW/m2"), ("ghi [MJ/m2]", ".7", "in W/m2"),
    ("ghi", "NA", "'NA' in the column 'ghi' is no number"), ("ghi,pressure [atm]", "700,1", "unit unknown"),
])  # fmt: skip
def test_columns_that_cannot_be_told_are_refused(tmp_path, names, row, message):
    (tmp_path / "x.csv").write_text(f"utc,{names}\n2020-06-01T12:00,{row}\n")
    with pytest.raises(UserError, match=rf"x\.csv: .*{message}"):
        read_station(tmp_path / "x.csv", 47.0, 8.0)


def _surfrad(path, change=lambda row: row, longitude=105.92):
    """Alamosa, whose file counts west; zenith angles by our sun."""
    rows = []
    for hour in (17, 18, 19):
        place = {"latitude": 37.7, "longitude": -105.92, "height_m": 2317}
        times = {"time": np.array([f"2016-01-01T{hour}:00"], "M8[ns]")}
        zenith = 90 - sun_of(xr.Dataset(coords=times, attrs=place)).altitude_deg[0]
        row = ["2016", "1", "1", "1", f"{hour}", "0", f"{hour}.0", f"{zenith:.2f}", *["500.0", "0"] * 20]
        rows.append(" ".join(change(row)))
    path.write_text("\n".join([" Alamosa", f"   37.70  {longitude} 2317 m version 1", *rows]) + "\n")
    return path


def test_files_that_count_longitude_west_are_placed_by_their_sun(tmp_path):
    pytest.importorskip("pvlib")
    for longitude in (105.92, -105.92):
        found = read_station(_surfrad(tmp_path / "x.dat", longitude=longitude))
        assert found.attrs["longitude"] == -105.92
    with pytest.raises(UserError, match=r"x\.dat: the sun is elsewhere"):
        read_station(_surfrad(tmp_path / "x.dat", longitude=30.0))
    with pytest.raises(UserError, match=r"x\.dat: line 3 has 47 columns"):
        read_station(_surfrad(tmp_path / "x.dat", lambda row: row[:12] + row[13:]))
    bad = read_station(_surfrad(tmp_path / "x.dat", lambda row: [*row[:13], "1", *row[14:]]))  # of direct light
    assert "dni" not in bad or not np.isfinite(bad.dni).any()


def test_a_line_of_solrad_that_was_cut_gives_no_smaller_number(tmp_path):
    """It was 51 W/m2 where 517 had been cut, and direct light for global where a column was lost."""
    pytest.importorskip("pvlib")
    widths = [4, 3, 2, 2, 2, 2, 6, 6, *[7, 1] * 5, *[9] * 4]
    place = {"latitude": 40.12, "longitude": -105.24, "height_m": 1689}
    times = {"time": np.array(["2016-01-01T18:00"], "M8[ns]")}
    zenith = 90 - sun_of(xr.Dataset(coords=times, attrs=place)).altitude_deg[0]
    cells = ["2016", "1", "1", "1", "18", "0", "18.0", f"{zenith:.2f}", *["517.3", "0"] * 5, *["1.0"] * 4]
    row = " ".join(cell.rjust(width) for cell, width in zip(cells, widths, strict=True))

    def read(row):
        (tmp_path / "x.dat").write_text(f" Boulder\n  40.12  105.24 1689 -7\n{row}\n")
        return read_station(tmp_path / "x.dat")

    assert float(read(row).ghi[0]) == 517.3
    assert read(row).attrs["longitude"] == -105.24
    for cut in (row[:39], row[:35] + row[45:]):
        with pytest.raises(UserError, match=r"x\.dat: line 3 has \d+ columns, and not 22 or 31"):
            read(cut)
