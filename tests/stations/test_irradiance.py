"""`openswim.irradiance`: against `render`, between solved suns, between model times, on tilted planes."""

from __future__ import annotations

import numpy as np
import pytest
import xarray as xr

import openswim
from openswim.errors import UserError
from openswim.lights import sun_position, sun_track
from openswim.scene import Scene
from openswim.scene.atmosphere import AerosolProfile, Atmosphere
from openswim.stations import Series
from openswim.stations.light import beam_through_time
from openswim.stations.through_time import solves

RGB = (615, 546, 450)
LAT, LON = 46.8, 6.9
CLEAR = Scene.clear(LAT, LON, Atmosphere.us_standard(aerosol=AerosolProfile(0.1)), 0.2, water_vapour_cm=2.0)
DAY = np.arange("2016-06-23T03:00", "2016-06-23T20:00", 20, dtype="datetime64[m]")


@pytest.fixture(scope="module")
def day():
    return openswim.irradiance(CLEAR, LAT, LON, DAY, planes=[(0, 0), (90, 180)], wavelengths_nm=RGB)


@pytest.mark.slow
@pytest.mark.parametrize("time", ["2016-06-23T04:00", "2016-06-23T11:40"])
def test_a_day_from_few_solves_is_what_pictures_say_at_each_time(day, time):
    found = day.sel(time=time)
    image = openswim.render(CLEAR, openswim.Camera.allsky(LAT, LON, size=2), time=time).attrs
    assert day.attrs["solves"] <= 8
    assert found.dhi == pytest.approx(image["diffuse_horizontal_irradiance_w_m2"], abs=0.5)
    assert found.dni == pytest.approx(image["direct_normal_irradiance_w_m2"], abs=0.5)
    spectral = image["diffuse_horizontal_spectral_irradiance_w_m2_nm"]
    np.testing.assert_allclose(found.spectral_dhi, spectral, rtol=0.0146)  # measured 1.1 % at 4 degrees


@pytest.mark.slow
def test_parts_add_up_and_planes_that_lie_flat_have_the_horizontal(day):
    up = np.maximum(np.sin(np.radians(day.sun_altitude)), 0)
    np.testing.assert_allclose(day.ghi, day.dhi + day.dni * up, rtol=1e-12)
    np.testing.assert_allclose(day.poa_global[:, 0], day.ghi, rtol=2e-3, atol=0.1)
    lit = day.sun_altitude > 5
    assert (day.dhi[lit] > 15).all()
    assert 0 < float(day.ghi[-1]) < 5  # after sunset


def test_the_sun_sinks_as_evenly_as_the_ephemeris_has_it_and_stands_where_pictures_have_it():
    """Through dusk: refraction lifts it by .6 degrees at the horizon and its twilight by .2, without a leap between."""
    dusk = np.arange("2016-06-23T19:10", "2016-06-23T20:30", 2, dtype="datetime64[m]")
    bare = Scene.clear(LAT, LON, None, 0.2)  # light of the air, which is dear, moves no sun
    found = openswim.irradiance(bare, LAT, LON, dusk, wavelengths_nm=(550,), solver="swim").sun_altitude.values
    true = np.array([sun_position(time, LAT, LON).altitude_deg for time in dusk])
    assert found[0] > 2 > -6 > found[-1]
    seen = 2.34  # cot(h + 7.31 / (h + 4.4)) minutes of arc (Bennett 1982)
    assert found[0] - true[0] == pytest.approx(1 / 60 / np.tan(np.radians(seen + 7.31 / (seen + 4.4))), abs=0.005)
    assert found[-1] - true[-1] == pytest.approx(0.2, abs=0.005)
    assert np.abs(np.diff(found - true)).max() < 0.09  # it fades by a third of what the sun sinks, .27 degrees a step
    for time in dusk[5:20:14]:
        image = openswim.render(bare, openswim.Camera.allsky(LAT, LON, size=2), "swim", time=time)
        assert image.attrs["sun_altitude_deg"] == pytest.approx(found[dusk == time][0], abs=0.005)


def test_the_disc_sets_in_three_minutes():
    """What is left of it is a segment of a circle, but for its darker limb; from 2 m the horizon lies .045 deg low."""
    times = np.arange("2016-06-23T19:26", "2016-06-23T19:36", 20, dtype="datetime64[s]")
    track, lit = sun_track(times, LAT, LON), openswim.light(CLEAR, "swim", RGB, sun=(0.0, 1.0))
    viewpoint = lit.viewpoint(openswim.Camera.allsky(LAT, LON, size=2))
    beam, visible, _, _ = beam_through_time(viewpoint, track, np.arange(30))
    x = np.clip((track.lit_altitude_deg + 0.045) / 0.262, -1, 1)
    np.testing.assert_allclose(visible, (np.arccos(-x) + x * np.sqrt(1 - x**2)) / np.pi, atol=0.04)
    assert ((visible > 0.05) & (visible < 0.95)).sum() >= 7  # of 20 seconds
    assert np.abs(np.diff(beam[:, 0])).max() < 0.25 * beam[0, 0]


@pytest.mark.parametrize("gridded", [False, True])
def test_a_night_through_asks_for_no_light_of_the_night(gridded, monkeypatch):
    from openswim.stations import light as module

    asked, light = [], module.light

    def seen(*arguments, **options):
        asked.append(options)
        return light(*arguments, **options)

    monkeypatch.setattr(module, "light", seen)
    axis = np.arange(3) * 5e3
    block = Scene.from_arrays(np.zeros((2, 3, 3)), axis, axis, np.array([500.0, 1500.0]), place=(LAT, LON))
    found = openswim.irradiance(block if gridded else CLEAR, LAT, LON, ["2016-12-23T00:00", "2016-12-23T01:00"])
    assert asked == [{"sun": (0.0, 10.0)}]
    assert float(abs(found.ghi).max()) == 0
    assert gridded or (found.ozone > 250).all()  # the block has no air


@pytest.fixture(scope="module")
def usual():
    return openswim.irradiance(CLEAR, LAT, LON, DAY[12:27:7], wavelengths_nm=RGB, solver="swim")


@pytest.mark.parametrize("wavelengths", [(700, 500), (690,), (630, 500)])
def test_bands_of_gases_are_not_taken_for_haze(usual, wavelengths):
    found = openswim.irradiance(CLEAR, LAT, LON, DAY[12:27:7], wavelengths_nm=wavelengths, solver="swim")
    np.testing.assert_allclose(found.ghi, usual.ghi, rtol=0.02)
    np.testing.assert_allclose(found.dni, usual.dni, rtol=0.02)


def test_without_air_there_is_no_diffuse_light():
    bare = Scene.clear(LAT, LON, None, 0.4)
    found = openswim.irradiance(bare, LAT, LON, "2016-06-23T11:40")
    up = np.sin(np.radians(float(found.sun_altitude[0])))
    assert float(found.dhi[0]) == pytest.approx(0, abs=1e-3)
    np.testing.assert_allclose(found.spectral_dni, found.spectral_ghi / up, rtol=1e-6)


@pytest.mark.slow
def test_a_wall_sees_half_of_what_an_even_ground_sends_up(day):
    """Facing down, a plane has albedo times global; a wall half of it, and half of the sky's."""
    planes = [(180, 0), *((90, azimuth) for azimuth in range(0, 360, 45))]
    noon = openswim.irradiance(CLEAR, LAT, LON, "2016-06-23T11:40", planes=planes)
    down, walls = float(noon.poa_diffuse[0, 0]), float(noon.poa_diffuse[0, 1:].mean())
    assert down == pytest.approx(0.2 * float(noon.ghi[0]), rel=0.04)  # by the light of three wavelengths
    assert walls > down / 2 + 0.3 * float(noon.dhi[0])


@pytest.mark.slow
def test_water_vapour_of_the_scene_and_of_the_call(day):
    dry = openswim.irradiance(CLEAR, LAT, LON, DAY[20:22], water_vapour_cm=[0.5, 2.0], wavelengths_nm=RGB)
    np.testing.assert_allclose(dry.water_vapour, [0.5, 2.0])
    np.testing.assert_allclose(day.water_vapour, 2.0, rtol=2e-3)  # from 2 m above the ground
    assert float(dry.ghi[0]) > float(day.ghi[20]) + 15
    assert float(dry.ghi[1]) == pytest.approx(float(day.ghi[21]), abs=0.5)


def _cloudy(time: str, content: float) -> Scene:
    """A wide even deck of cloud water near (46.8 N, 6.9 E)."""
    axis = np.linspace(-15_000, 15_000, 5)
    crs = f"+proj=lcc +lat_1=40 +lat_2=50 +lat_0={LAT} +lon_0={LON} +R=6371000"
    water = np.zeros((6, 5, 5), np.float32)
    water[2:4] = content
    return Scene.from_arrays(
        {}, axis, axis, np.array([0.0, 500, 1000, 1500, 2000, 4000]), crs=crs, time=np.datetime64(time),
        fields={"liquid_content": water}, atmosphere=Atmosphere.us_standard(), surface_albedo=0.2,
    )  # fmt: skip


@pytest.mark.slow
def test_between_model_times_the_light_of_both_is_mixed():
    early, late = _cloudy("2016-06-23T10:00", 0.0), _cloudy("2016-06-23T12:00", 2e-4)
    times = np.array(["2016-06-23T10:30"], "datetime64[m]")
    mixed = openswim.irradiance([early, late], LAT, LON, times, solver="swim")
    assert solves(Series.of([early, late]), LAT, LON, times) == mixed.attrs["solves"] == 2
    alone = [openswim.irradiance(scene, LAT, LON, times, solver="swim") for scene in (early, late)]
    for name in ("ghi", "dni", "dhi", "spectral_dhi"):
        np.testing.assert_allclose(mixed[name], 0.75 * alone[0][name] + 0.25 * alone[1][name], rtol=1e-6)
    assert (alone[1].dni < 1).all()
    with pytest.raises(UserError, match="outside the model times"):
        openswim.irradiance([early, late], LAT, LON, "2016-06-23T13:00")


@pytest.mark.slow
def test_several_places_share_a_solve():
    scene = _cloudy("2016-06-23T10:00", 5e-5)
    found = openswim.irradiance(scene, [LAT, LAT + 0.05], [LON, LON], "2016-06-23T10:00", solver="swim")
    assert found.attrs["solves"] == 1
    assert found.ghi.dims == ("time", "place")
    alone = openswim.irradiance(scene, LAT + 0.05, LON, "2016-06-23T10:00", solver="swim")
    np.testing.assert_allclose(found.ghi[:, 1], alone.ghi, rtol=1e-6)


def _flat(place: tuple[float, float] | None) -> Scene:
    water = np.zeros((4, 5, 5))
    water[1] = 1e-3
    axes = 500.0 * np.arange(5), 500.0 * np.arange(5), 500.0 * np.arange(4)
    air = Atmosphere.us_standard()
    return Scene.from_arrays(water, *axes, place=place, atmosphere=air, surface_albedo=0.2)


def test_all_light_of_a_flat_scene_is_of_the_sun_that_is_asked_for():
    """Beam and diffuse light of two suns made 376 W/m2 of 662; a scene without a place was refused."""
    given = {"lat": LAT, "lon": LON, "times": "2016-06-23T11:40", "solver": "swim", "wavelengths_nm": RGB}
    here = openswim.irradiance(_flat((LAT, LON)), **given)
    for place in (None, (-60.0, LON)):
        other = openswim.irradiance(_flat(place), **given)
        for name in ("ghi", "dni", "dhi", "spectral_dhi"):
            np.testing.assert_allclose(other[name], here[name], rtol=1e-6)
    for wrong, message in (([LAT, 50.0], "one place in a flat scene"), ([95.0], "no place on Earth")):
        with pytest.raises(UserError, match=message):
            openswim.irradiance(_flat(None), **given | {"lat": wrong, "lon": [LON] * len(wrong)})


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"times": []}, "give one time"),
        ({"times": "noon"}, "not understood"),
        ({"lat": [1, 2]}, "as many of each"),
        ({"planes": [(30,)]}, "give pairs"),
        ({"water_vapour_cm": -1}, "-1 is not within 0 to 20"),
        ({"water_vapour_cm": np.inf}, "inf is not within 0 to 20"),
        ({"x_m": 5.0}, "flat scenes"),
        ({"scene": []}, "no scene"),
        ({"scene": [CLEAR, CLEAR]}, "one has no time"),
    ],
)
def test_what_users_get_wrong(change, message):
    given = {"scene": CLEAR, "lat": LAT, "lon": LON, "times": "2016-06-23T12:00"} | change
    with pytest.raises(UserError, match=message):
        openswim.irradiance(**given)


def test_series_of_one_scene_stands_for_all_times():
    assert [share.tolist() for _, share in Series.of(CLEAR).weights(DAY[:2])] == [[1.0, 1.0]]


@pytest.mark.parametrize(
    ("first", "count", "step_minutes", "expected"),
    [("09:00", 4, 15, 3), ("09:00", 13, 5, 3), ("09:00", 2, 60, 2), ("22:00", 3, 10, 1)],
)
def test_solves_are_told_beforehand(first, count, step_minutes, expected):
    """Half an hour apart at most, by day alone; one where it is dark."""
    times = np.datetime64(f"2016-06-23T{first}") + np.arange(count) * np.timedelta64(step_minutes, "m")
    assert solves(Series.of(_cloudy("2016-06-23T10:00", 5e-5)), LAT, LON, times) == expected


def test_all_times_of_a_models_file_are_a_series(tmp_path):
    from tests.readers.conftest import WRFSpec, write_wrf

    write_wrf(tmp_path / "wrfout_d01", WRFSpec(times=("2005-08-28_18:00:00", "2005-08-28_19:00:00")))
    series = Series.open(tmp_path / "wrfout_d01")
    assert [str(time) for time in series.times] == ["2005-08-28T18:00:00.000", "2005-08-28T19:00:00.000"]
    assert series.scene(1).time == series.times[1]
    quarter = np.array(["2005-08-28T18:15"], "datetime64[m]")
    assert [(which, float(share[0])) for which, share in series.weights(quarter)] == [(0, 0.75), (1, 0.25)]
    vapour = series.scene(0).data.precipitable_water
    assert 0 < float(vapour.min()) < 80


@pytest.mark.parametrize(
    ("given", "named"),
    [
        ({"lat": [[1.0], [2.0, 3.0]]}, "lat"),
        ({"lat": [[1.0, 2.0]]}, "lat has shape"),
        ({"lon": [1.0, 2.0]}, "lon"),
        ({"times": [["2020-06-01T12:00"], ["2020-06-01T12:00", "2020-06-01T13:00"]]}, "times"),
        ({"times": xr.Dataset({"a": ("t", [1.0])})}, "time"),
        ({"lat": xr.Dataset({"a": ("t", [1.0])})}, "lat"),
    ],
)
def test_places_and_times_of_a_wrong_kind_are_named(given, named):
    wanted = {"lat": 47.0, "lon": 11.0, "times": "2020-06-01T12:00"} | given
    with pytest.raises(UserError, match=named):
        openswim.irradiance(Scene.clear(47.0, 11.0), **wanted)
