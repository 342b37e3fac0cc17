"""Times in every spelling that is one, and lines on those that are none."""

from datetime import UTC, date, datetime, timedelta, timezone

import numpy as np
import pytest

from openswim import Scene
from openswim.errors import UserError
from openswim.scene.times import interval_s, parse_time, rounded

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
]


@pytest.mark.parametrize("time", SPELLINGS)
def test_one_time_in_every_spelling(time):
    found = parse_time(time)
    assert found == np.datetime64("2024-06-01T12:00")
    assert found.dtype == "datetime64[ms]"
    assert Scene.clear(10.0, 20.0, time=time).time == found


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
