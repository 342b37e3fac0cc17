"""Clocks and longitudes of stations that are wrong are told by their light."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest
import xarray as xr

from openswim.cli.main import run
from openswim.errors import UserError
from openswim.stations.checks import check_clock, sun_of, told_of_means, told_of_swap


def station(step_min: int = 5, cloudy: bool = False, hours: tuple[int, int] = (0, 24)) -> xr.Dataset:
    """A day of light as of instruments that agree to a few W/m2, UTC."""
    start = np.datetime64("2024-06-20T00:00", "ns")
    times = start + np.arange(60 * hours[0], 60 * hours[1], step_min).astype("timedelta64[m]")
    out = xr.Dataset(coords={"time": times}, attrs={"latitude": 46.8, "longitude": 6.9, "height_m": 491.0})
    high = np.maximum(np.sin(np.radians(sun_of(out).refracted_altitude_deg)), 0.0)
    noise = np.random.default_rng(2).normal(0.0, 3.0, times.size)
    beam = np.zeros(times.size) if cloudy else 900.0 * high**0.3 * (high > 0)
    out["dni"], out["dhi"] = ("time", beam), ("time", 150.0 * np.sqrt(high))
    out["ghi"] = ("time", out.dhi.values + beam * high + noise)
    return out


@pytest.mark.parametrize("hours", [(0, 24), (4, 11), (12, 21)])
@pytest.mark.parametrize(
    ("ahead_h", "way"), [(-6, "6.0 hours after"), (1, "1.0 hours before"), (2, "2.0 hours before")]
)
def test_local_time_for_utc_is_told_with_its_hours(hours: tuple[int, int], ahead_h: int, way: str) -> None:
    good = station(hours=hours)
    check_clock(good)
    wrong = good.assign_coords(time=good.time + np.timedelta64(ahead_h, "h"))
    with pytest.raises(UserError, match=f"agree with the sun {way} its times.*are they UTC"):
        check_clock(wrong)


def test_a_longitude_of_the_wrong_sign_is_told() -> None:
    with pytest.raises(UserError, match="longitude counted east"):
        check_clock(station().assign_attrs(longitude=-6.9))


@pytest.mark.parametrize("names", [["ghi"], ["ghi", "dni", "dhi"]])
def test_light_by_night_is_told_where_no_beam_tells(names: list[str]) -> None:
    cloudy = station(cloudy=True)[names]
    check_clock(cloudy)
    with pytest.raises(UserError, match="degrees down, and more such"):
        check_clock(cloudy.assign_coords(time=cloudy.time + np.timedelta64(4, "h")))


def test_hours_that_are_labelled_by_their_ends_are_taken() -> None:
    minutes = station(step_min=1)
    hours = minutes.resample(time="1h").mean().assign_attrs(minutes.attrs)
    assert told_of_means(minutes) == ""
    for label_min, told in ((0, "60 minutes after .* by [+]30"), (30, "^$"), (60, "60 minutes before .* by -30")):
        labelled = hours.assign_coords(time=hours.time + np.timedelta64(label_min, "m"))
        check_clock(labelled)
        assert re.search(told, told_of_means(labelled))


def test_light_that_fits_the_sun_to_the_last_bit_is_taken() -> None:
    exact = station()
    exact["ghi"] = exact.dhi + exact.dni * np.sin(np.radians(sun_of(exact).refracted_altitude_deg))
    check_clock(exact)


def test_the_command_refuses_before_it_compares(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    table = station().to_dataframe()[["ghi", "dni", "dhi"]]
    table.index = (table.index + np.timedelta64(2, "h")).strftime("%Y-%m-%dT%H:%MZ")
    table.to_csv(tmp_path / "a.csv", index_label="utc")
    place = ["--lat", "46.8", "--lon", "6.9"]
    assert run(["irradiance", "--clear", "--station", str(tmp_path / "a.csv"), *place]) == 2
    err = capsys.readouterr().err.strip()
    assert "a.csv: global, direct and diffuse light agree with the sun 2.0 hours before" in err
    assert "\n" not in err


@pytest.mark.parametrize("cloudy", [False, True])
def test_global_and_direct_light_with_each_others_names_are_told(cloudy: bool) -> None:
    good = station(cloudy=cloudy)
    assert told_of_swap(good) == ""
    swapped = good.assign(ghi=good.dni, dni=good.ghi)
    check_clock(swapped)  # which says nothing
    assert "agree with dhi and the sun when they are swapped" in told_of_swap(swapped)
    assert told_of_swap(good.drop_vars("dhi")) == ""
    assert "possible beside the sun when they are swapped" in told_of_swap(swapped.drop_vars("dhi"))
