"""Times in every spelling that is one, and lines on those that are none."""

from datetime import UTC, date, datetime, timedelta, timezone

import cftime
import numpy as np
import pandas as pd
import pytest
import xarray as xr

from openswim import Scene
from openswim.errors import UserError
from openswim.readers.common.opening import opened
from openswim.scene.times import interval_s, parse_time, rounded, with_signed_zone

SPELLINGS = [
    "2024-06-01T12:00",
    "2024-06-01_12:00:00",
    " 2024-06-01 12:00Z ",
    "20240601T1200",
    "2024-06-01T14:00+02:00",
    datetime(2024, 6, 1, 12),
    datetime(2024, 6, 1, 12, tzinfo=UTC),
    datetime(2024, 6, 1, 7, tzinfo=timezone(timedelta(hours=-5))),
    np.datetime64("2024-06-01T12"),
    np.datetime64("2024-06-01T12:00:00.000000000"),
    np.array("2024-06-01T12:00", "datetime64[ns]"),
    xr.DataArray(np.array(["2024-06-01T12:00", "2024-06-01T13:00"], "datetime64[ns]"), dims="time")[0],
    xr.DataArray("2024-06-01T12:00Z"),
    pd.Timestamp("2024-06-01T12:00"),
    pd.Period("2024-06-01T12:00", freq="h"),
    pd.period_range("2024-06-01T11:30", periods=3, freq="30min")[1],
]


@pytest.mark.parametrize("time", SPELLINGS)
def test_one_time_in_every_spelling(time):
    found = parse_time(time)
    assert found == np.datetime64("2024-06-01T12:00")
    assert found.dtype == "datetime64[ms]"
    assert Scene.clear(10.0, 20.0, time=time).time == found


@pytest.mark.parametrize("text", ["2024-06-01 12.30", "20240601120", "2024-06-01x12:00", "2024-06-01T25:00", "noon"])
def test_what_could_be_another_time_is_none(text):
    with pytest.raises(UserError, match="is not understood"):
        parse_time(text)


def test_a_leap_second_ends_the_second_before():
    assert parse_time("2016-12-31T23:59:60Z") == np.datetime64("2016-12-31T23:59:59.999")


@pytest.mark.parametrize(
    ("units", "begin"),
    [
        ("seconds since 2019-01-01 17:00:00 0:00", "2019-01-01T17:00"),
        ("hours since 2019-01-01 17 00:00", "2019-01-01T17:00"),
        ("hours since 2019-1-1 17:00:00.0 2:00", "2019-01-01T15:00"),
        ("hours since 2019-01-01 17:00 -5:00", "2019-01-01T22:00"),
        ("days since 2019-01-01 17:00", "2019-01-01T17:00"),
    ],
)
def test_a_zone_without_a_sign_is_not_the_clock(units, begin, tmp_path):
    """UDUNITS writes zones so; files are opened as they mean it."""
    data = xr.Dataset({"time": ("time", [0.0], {"units": with_signed_zone(units)})})
    assert xr.decode_cf(data).time.values[0] == np.datetime64(begin)
    xr.Dataset({"when": ("n", [0.0], {"units": units})}).to_netcdf(tmp_path / "a.nc")
    with opened(tmp_path / "a.nc") as file:
        assert file.when.values[0] == np.datetime64(begin)


def test_lengths_of_time_have_units():
    assert [interval_s("--every", text) for text in ("5min", "30 s", "1.5h")] == [300, 30, 5400]
    for text in ("7", "", "7 parsecs", "-5min", "0s"):
        with pytest.raises(UserError, match="write a length of time, such as 5min, 30s or 1h"):
            interval_s("--every", text)


def test_days_and_no_time():
    assert parse_time(date(2024, 6, 1)) == np.datetime64("2024-06-01T00:00")
    assert parse_time(None) is None


@pytest.mark.parametrize("time", ["yesterday", "2005-13-01", "0001-01-01T00:00+05:00", "", ("2024",)])
def test_what_is_no_time_is_said_in_a_line(time):
    with pytest.raises(UserError, match="is not understood: write it as 2005-08-28T18:00") as caught:
        parse_time(time)
    assert repr(time) in str(caught.value)
    assert "\n" not in str(caught.value)


def test_what_floating_point_leaves_out_is_rounded_to_the_millisecond():
    times = np.array(["2024-06-01T11:59:59.999600", "2024-06-01T12:00:00.000499", "NaT"], "datetime64[us]")
    np.testing.assert_array_equal(rounded(times), np.array(["2024-06-01T12", "2024-06-01T12", "NaT"], "datetime64[ms]"))


@pytest.mark.parametrize("kind", [cftime.DatetimeNoLeap, cftime.Datetime360Day])
def test_dates_of_a_models_calendar_are_told(kind):
    day, real = kind(2005, 8, 28, 18), np.datetime64("2005-08-28T18")
    with pytest.warns(UserWarning, match="2005-08-28T18:00:00 is of the calendar .*: taken for the day of this name"):
        assert parse_time(day) == real
    scene = Scene.clear(46.0, 8.0, time=day)
    assert scene.time == real
    assert any("taken for the day of this name" in note for note in scene.notes)
    assert parse_time(cftime.DatetimeGregorian(2005, 8, 28, 18)) == real  # without a word: warnings are errors
    for lost in (cftime.Datetime360Day(2005, 2, 30), cftime.DatetimeAllLeap(2005, 2, 29)):
        with pytest.raises(UserError, match="no day that the sun knows: give a date of the Gregorian"):
            parse_time(lost)
    with pytest.raises(UserError, match="calendar julian"):  # 13 days off
        parse_time(cftime.DatetimeJulian(2005, 8, 28))
