import csv
import subprocess
import sys
from datetime import UTC, datetime, timedelta, timezone

import numpy as np
import pytest

from openswim.errors import UserError
from openswim.lights import subsolar_point, sun_position


def altitude_azimuth_on_sphere(time, lat, lon):
    """Where the sun stands for an observer on a sphere, from the subsolar point alone."""
    sun_lat, sun_lon = np.radians(subsolar_point(time))
    sun = np.array([np.cos(sun_lat) * np.cos(sun_lon), np.cos(sun_lat) * np.sin(sun_lon), np.sin(sun_lat)])
    p, q = np.radians([lat, lon])
    east = np.array([-np.sin(q), np.cos(q), 0])
    north = np.array([-np.sin(p) * np.cos(q), -np.sin(p) * np.sin(q), np.cos(p)])
    up = np.array([np.cos(p) * np.cos(q), np.cos(p) * np.sin(q), np.sin(p)])
    return np.degrees(np.arcsin(sun @ up)), np.degrees(np.arctan2(sun @ east, sun @ north)) % 360


def test_agrees_with_the_reference_positions(shared):
    rows = list(
        csv.DictReader((shared / "reference/clearsky/sun_moon_positions.csv").read_text().splitlines())
    )
    assert rows
    for row in rows:
        sun = sun_position(row["utc"], float(row["lat"]), float(row["lon"]), float(row["elev_m"]))
        assert sun.altitude_deg == pytest.approx(float(row["sun_alt_geom"]), abs=1e-4)
        assert sun.azimuth_deg == pytest.approx(float(row["sun_az"]), abs=1e-4)
        assert sun.refracted_altitude_deg == pytest.approx(float(row["sun_alt_refracted"]), abs=1e-3)
        assert sun.distance_au == pytest.approx(float(row["sun_dist_au"]), abs=2e-6)
        assert 2 * sun.angular_radius_deg == pytest.approx(float(row["sun_diam_deg"]), abs=2e-6)


@pytest.mark.parametrize(
    "time", ["2023-03-20T21:24", "2005-08-28T18:00", "1969-07-20T20:17", "2044-12-31T03:00"]
)
def test_one_subsolar_point_serves_every_observer(time):
    random = np.random.default_rng(1)
    for lat, lon in zip(random.uniform(-89, 89, 12), random.uniform(-180, 180, 12), strict=True):
        sun = sun_position(time, lat, lon)
        altitude, azimuth = altitude_azimuth_on_sphere(time, lat, lon)
        assert altitude == pytest.approx(sun.altitude_deg, abs=0.003)
        across = (azimuth - sun.azimuth_deg + 180) % 360 - 180
        assert across * np.cos(np.radians(altitude)) == pytest.approx(0, abs=0.003)


def test_declination_at_solstice_and_equinox():
    # Almanac: June solstice 2023-06-21 14:58, March equinox 2023-03-20 21:24; obliquity of the date 23.436.
    assert subsolar_point("2023-06-21T14:58")[0] == pytest.approx(23.436, abs=0.003)
    assert subsolar_point("2023-03-20T21:24")[0] == pytest.approx(0.0, abs=0.003)


def test_equation_of_time_in_early_november():
    # The sun is 16.4 minutes ahead of the clock on 3 November: over Greenwich's meridian at 11:43:35.
    assert subsolar_point("2023-11-03T12:00")[1] == pytest.approx(-16.42 / 4, abs=0.03)


def test_distance_is_least_at_perihelion():
    perihelion = sun_position("2023-01-04T16:17", 0, 0)
    aphelion = sun_position("2023-07-06T20:07", 0, 0)
    assert perihelion.distance_au == pytest.approx(0.98330, abs=5e-5)
    assert aphelion.distance_au == pytest.approx(1.01668, abs=5e-5)
    assert perihelion.angular_radius_deg > aphelion.angular_radius_deg


def test_refraction_lifts_the_setting_sun_by_its_own_width():
    time = np.datetime64("2023-06-21T20:00")
    setting = min(
        (sun_position(time + np.timedelta64(60 * m, "s"), 50, 0) for m in range(0, 60, 2)),
        key=lambda sun: abs(sun.altitude_deg),
    )
    lift = setting.refracted_altitude_deg - setting.altitude_deg
    assert 0.35 < lift < 0.6
    high = sun_position("2023-06-21T12:00", 50, 0)
    assert 0 < high.refracted_altitude_deg - high.altitude_deg < 0.02


def test_times_are_utc_in_every_form():
    moment = datetime(2019, 8, 12, 17, 0)
    expected = subsolar_point("2019-08-12T17:00")
    east = timezone(timedelta(hours=2))
    for time in (
        "2019-08-12T17:00Z",
        "2019-08-12T19:00+02:00",
        np.datetime64(moment),
        np.datetime64("2019-08-12T17:00:00.000000000"),
        moment,
        moment.replace(tzinfo=UTC),
        datetime(2019, 8, 12, 19, 0, tzinfo=east),
    ):
        assert subsolar_point(time) == pytest.approx(expected, abs=1e-9)


@pytest.mark.parametrize(
    "time",
    ["yesterday", "1850-01-01", "2150-01-01", np.datetime64("NaT", "ms"), "2005-13-01", "0001-01-01T00:00+05:00"],
)
def test_impossible_times_are_refused_in_one_line(time):
    with pytest.raises(UserError, match="time") as caught:
        subsolar_point(time)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("height_m", [1e308, 9.2e18, -1e5, float("nan")])
def test_heights_off_the_earth_are_refused(height_m):
    """Light from the sun would leave the ephemeris on its way."""
    with pytest.raises(UserError, match="height"):
        sun_position("2020-06-01T12:00", 47, 11, height_m)


@pytest.mark.parametrize(("lat", "lon"), [(91, 0), (-90.5, 0), (0, 400), (float("nan"), 0)])
def test_impossible_places_are_refused(lat, lon):
    with pytest.raises(UserError, match="itude"):
        sun_position("2020-01-01", lat, lon)


def test_importing_costs_no_ephemeris():
    code = "import sys, openswim.lights; sys.exit('skyfield' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0
