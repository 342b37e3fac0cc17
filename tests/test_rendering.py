"""From scene and camera to a labelled image: where the sun stands, what the numbers are called."""

from __future__ import annotations

import dataclasses
import re
from contextlib import nullcontext
from pathlib import Path

import numpy as np
import pytest
import xarray as xr
from pyproj import CRS
from tests.transport.scenes import LAT, LON, box, grid_scene

import openswim
from openswim import Camera, Scene, UserError
from openswim.lighting import daylight, light
from openswim.lights import SOLAR_CONSTANT_W_M2, solar_irradiance, sun_position
from openswim.pictures import viewpoint
from openswim.pictures.observer import check_observer
from openswim.readers.domain.cutting import part_of
from openswim.readers.domain.neighbourhood import Neighbourhood, far_m, reach_m
from openswim.scene.procedural import demo_scene
from openswim.solver import Solver

TIME = np.datetime64("2024-05-04T09:30")
SUN = (130.0, 40.0)


@pytest.fixture(scope="module")
def clear():
    return light(Scene.clear(LAT, LON, time=TIME), time=TIME)


@pytest.fixture(scope="module")
def allsky(clear) -> xr.Dataset:
    return openswim.render(clear, Camera.allsky(LAT, LON, size=90))


@pytest.fixture(scope="module")
def cloudy():
    shape = (12, 21, 21)
    cloud = box(shape, (slice(4, 8), slice(3, 9), slice(6, 15)), 0.004)
    return light(grid_scene(cloud, shape, (500.0, 500.0, 250.0), curved=True, air=True), sun=SUN)


def separation_deg(image: xr.Dataset, azimuth: float, altitude: float) -> np.ndarray:
    az, alt = np.radians(image.azimuth), np.radians(image.altitude)
    a0, h0 = np.radians([azimuth, altitude])
    cosine = np.sin(alt) * np.sin(h0) + np.cos(alt) * np.cos(h0) * np.cos(az - a0)
    return np.degrees(np.arccos(np.clip(cosine, -1, 1))).values


def test_one_time_in_two_spellings(clear):
    for spelling in ("20240504T0930", "2024-05-04T09:30Z"):
        again = light(clear.scene, time=spelling)
        assert again.time == clear.time
        assert again.daylight.direction == pytest.approx(clear.daylight.direction)


def test_the_brightest_pixel_is_the_sun_of_the_ephemeris(allsky: xr.Dataset) -> None:
    sun = sun_position(TIME, LAT, LON)
    brightest = np.unravel_index(np.nanargmax(allsky.radiance.sum("wavelength").values), allsky.azimuth.shape)
    away = separation_deg(allsky, sun.azimuth_deg, sun.refracted_altitude_deg)
    assert away[brightest] < 1.5 * 180.0 / 90  # a pixel is 2 degrees wide, its diagonal half as much again
    assert allsky.attrs["sun_azimuth_deg"] == pytest.approx(sun.azimuth_deg, abs=0.01)
    assert allsky.attrs["sun_altitude_deg"] == pytest.approx(sun.refracted_altitude_deg, abs=0.01)


@pytest.mark.parametrize("sun", [(75.0, 30.0), (250.0, 55.0)])
def test_a_given_sun_is_where_it_was_put(sun: tuple[float, float]) -> None:
    camera = Camera.panorama(LAT, LON, size=(90, 180), altitude_range_deg=(0.0, 90.0))
    image = openswim.render(Scene.clear(LAT, LON), camera, sun=sun)
    brightest = np.unravel_index(image.radiance.sum("wavelength").values.argmax(), image.azimuth.shape)
    assert separation_deg(image, *sun)[brightest] < 1.5
    assert "light_time" not in image.attrs


def test_a_given_sun_stands_over_the_camera_not_over_the_middle_of_the_scene() -> None:
    camera = Camera.allsky(LAT - 2.0, LON + 3.0, size=8)
    image = openswim.render(Scene.clear(LAT, LON), camera, sun=(280.0, 2.0))
    assert image.attrs["sun_azimuth_deg"] == pytest.approx(280.0, abs=1e-6)
    assert image.attrs["sun_altitude_deg"] == pytest.approx(2.0, abs=1e-6)


def test_the_disc_carries_the_direct_sun(clear) -> None:
    """Radiance times solid angle, summed over the disc, is the direct irradiance of the attributes."""
    sun = sun_position(TIME, LAT, LON)
    fov, n = 1.0, 80
    camera = Camera.perspective(LAT, LON, 2.0, sun.azimuth_deg, sun.refracted_altitude_deg, fov, (n, n))
    image = openswim.render(clear, camera)
    away = separation_deg(image, sun.azimuth_deg, sun.refracted_altitude_deg)
    sky = image.radiance.values[away > 0.4].mean(axis=0)  # the aureole, about .1 % of the disc
    direct = ((image.radiance.values - sky) * image.solid_angle.values[..., None]).sum(axis=(0, 1))
    up = np.sin(np.radians(image.attrs["sun_altitude_deg"]))
    expected = np.array(image.attrs["direct_horizontal_spectral_irradiance_w_m2_nm"]) / up
    np.testing.assert_allclose(direct, expected, rtol=0.002)


@pytest.mark.parametrize("sun", [(200.0, 50.0), (200.0, 88.0), (200.0, 0.1)])
@pytest.mark.parametrize("camera", [
    Camera.allsky(LAT, LON, size=40), Camera.allsky(LAT, LON, size=300), Camera.sphere(LAT, LON, size=90),
    Camera.panorama(LAT, LON, size=600, azimuth_deg=20.1),
])  # fmt: skip
def test_the_disc_is_whole_however_coarse_the_picture(camera: Camera, sun: tuple[float, float]) -> None:
    """Without air, over black ground, L' times solid angle is 4 pi times the beam on the observer, also while the sun
    rises."""
    image = openswim.render(Scene.clear(LAT, LON, None, surface_albedo=0.0), camera, sun=sun)
    shown = (image.solar_relative_radiance * image.solid_angle).sum(("y", "x")) / (4 * np.pi)
    beam = image.attrs["direct_normal_irradiance_w_m2"] / (0.986 * SOLAR_CONSTANT_W_M2)
    risen = sun[1] > 1
    assert beam == pytest.approx(1.0, rel=0.003) if risen else 0.7 < beam < 0.9
    if risen or camera.view == "panorama":  # an all-sky picture ends at the horizon
        assert float(shown.mean()) == pytest.approx(1.0 if risen else beam, rel=1e-5 if risen else 0.005)


def test_light_from_above_and_from_below_has_its_standard_name(clear, allsky: xr.Dataset) -> None:
    below = openswim.render(clear, Camera.satellite(LAT, LON, 800e3, fov_deg=1.0, size=(4, 4)))
    both = openswim.render(clear, Camera.panorama(LAT, LON, size=(4, 8)))
    names = [image.radiance.attrs.get("standard_name") for image in (allsky, below, both)]
    rest = "radiance_per_unit_wavelength_in_air"
    assert names == [f"downwelling_{rest}", f"upwelling_{rest}", None]


def test_dimensions_names_and_units(allsky: xr.Dataset) -> None:
    assert allsky.radiance.dims == ("y", "x", "wavelength")
    assert dict(allsky.sizes) == {"y": 90, "x": 90, "wavelength": 3}
    np.testing.assert_array_equal(allsky.wavelength, [615.0, 546.0, 450.0])
    units = {name: allsky[name].attrs["units"] for name in allsky.variables}
    assert units == {
        "radiance": "W m-2 sr-1 nm-1",
        "solar_relative_radiance": "1",
        "solid_angle": "sr",
        "azimuth": "degree",
        "altitude": "degree",
        "solar_irradiance": "W m-2 nm-1",
        "latitude": "degrees_north",
        "longitude": "degrees_east",
        "wavelength": "nm",
    }
    assert {"azimuth", "altitude", "latitude", "longitude"} <= set(allsky.radiance.coords)  # CF's `coordinates`
    assert re.fullmatch(r"\d{4}-\d\d-\d\dT\d\d:\d\d:\d\dZ: openswim .*", allsky.attrs["history"])
    assert allsky.attrs["solver"] == "fast"
    assert allsky.attrs["valid_time"] == allsky.attrs["light_time"] == "2024-05-04T09:30:00Z"
    assert (allsky.attrs["latitude"], allsky.attrs["longitude"]) == (LAT, LON)


def test_radiance_is_solar_relative_radiance_in_watts(allsky: xr.Dataset) -> None:
    """Eq. 2: L = L' E_TOA/(4 pi), with the sun's distance of the day."""
    toa = solar_irradiance(allsky.wavelength.values) / sun_position(TIME, LAT, LON).distance_au ** 2
    np.testing.assert_allclose(allsky.solar_irradiance, toa, rtol=1e-6)
    np.testing.assert_allclose(
        allsky.radiance, allsky.solar_relative_radiance * toa / (4 * np.pi), rtol=1e-5
    )


def test_corners_outside_the_disc_are_empty(allsky: xr.Dataset) -> None:
    assert np.isnan(allsky.radiance[0, 0]).all()
    inside = np.isfinite(allsky.altitude.values)
    assert np.isfinite(allsky.radiance.values[inside]).all()
    assert inside.mean() == pytest.approx(np.pi / 4, abs=0.01)


def test_panorama_has_no_seam(cloudy) -> None:
    """Over the ends of the panorama radiance changes as it does between any two neighbours nearby."""
    camera = Camera.panorama(LAT, LON, size=(60, 240), altitude_range_deg=(-30.0, 90.0), azimuth_deg=300.0)
    columns = openswim.render(cloudy, camera).solar_relative_radiance.values
    across = np.abs(columns[:, 0] - columns[:, -1])
    near = np.abs(np.diff(np.concatenate([columns[:, -9:], columns[:, :9]], axis=1), axis=1))
    usual = np.delete(near, 8, axis=1)
    assert near[:, 8] == pytest.approx(across)
    assert across.mean() < 1.5 * usual.mean() + 1e-4
    assert across.max() < 2.0 * usual.max() + 1e-3


def test_ground_pixels_know_their_place(cloudy) -> None:
    image = openswim.render(cloudy, Camera.allsky(LAT, LON, 2000.0, size=41, centre="nadir", fov_deg=120.0))
    assert float(image.latitude[20, 20]) == pytest.approx(LAT, abs=1e-3)
    assert float(image.longitude[20, 20]) == pytest.approx(LON, abs=1e-3)
    # north on top, east on the right, as on a map; 2000 m tan 54 degrees off at the 37th pixel of 3 degrees each
    assert image.latitude[2, 20] > LAT
    assert image.longitude[20, 38] > LON
    metres = np.radians(float(image.latitude[2, 20]) - LAT) * 6_371_000.0
    zenith = np.radians(float(image.altitude[2, 20]) + 90.0)
    assert metres == pytest.approx(2000.0 * np.tan(zenith), rel=0.01)


@pytest.mark.parametrize("zenith", [25.0, 45.0, 65.0])
def test_clear_sky_irradiance_is_haurwitzs(zenith: float) -> None:
    """GHI = 1098 mu exp(-.057/mu) W/m2 (Haurwitz 1945), a fit to clear skies: within 10 %."""
    camera = Camera.allsky(LAT, LON, size=8)
    attrs = openswim.render(Scene.clear(LAT, LON), camera, sun=(180.0, 90.0 - zenith)).attrs
    mu = np.cos(np.radians(zenith))
    ghi = attrs["global_horizontal_irradiance_w_m2"]
    assert 0.9 < ghi / (1098 * mu * np.exp(-0.057 / mu)) < 1.1
    direct, diffuse = attrs["direct_horizontal_irradiance_w_m2"], attrs["diffuse_horizontal_irradiance_w_m2"]
    assert direct + diffuse == pytest.approx(ghi, abs=0.02)
    assert direct == pytest.approx(mu * attrs["direct_normal_irradiance_w_m2"], rel=1e-3)
    parts = [np.array(attrs[f"{p}_horizontal_spectral_irradiance_w_m2_nm"]) for p in ("direct", "diffuse", "global")]
    np.testing.assert_allclose(parts[0] + parts[1], parts[2], rtol=1e-5)


@pytest.mark.parametrize("altitude", [5.0, 30.0])
def test_irradiance_grows_with_height_to_the_suns_own(altitude: float) -> None:
    """Above the air the beam is the solar constant, but for the 1.4 % beyond 280-4000 nm, and nothing is diffuse."""
    lit = light(Scene.clear(LAT, LON), sun=(180.0, altitude))
    heights = (2.0, 3e3, 9e3, 25e3, 99e3)
    views = [openswim.render(lit, Camera.allsky(LAT, LON, height, size=4)).attrs for height in heights]
    parts = ("direct_normal", "diffuse_horizontal")
    normal, diffuse = (np.array([view[f"{part}_irradiance_w_m2"] for view in views]) for part in parts)
    assert (np.diff(normal) > 0).all()
    assert (np.diff(diffuse) < 0).all()
    assert normal[-1] == pytest.approx(0.986 * SOLAR_CONSTANT_W_M2, rel=0.003)
    assert diffuse[-1] < 0.1


def test_irradiance_is_reckoned_once_an_observer(clear) -> None:
    """Two cameras at a place have the same, as a field that is lit anew; another height has its own."""
    lit = dataclasses.replace(clear, irradiances={})
    wide, above = Camera.panorama(LAT, LON, size=(16, 8)), Camera.allsky(LAT, LON, 3e3, size=8)
    low, beside, high = (openswim.render(lit, c).attrs for c in (Camera.allsky(LAT, LON, size=8), wide, above))
    name = "direct_normal_irradiance_w_m2"
    assert low[name] == beside[name] < high[name]
    assert len(lit.irradiances) == 2
    anew = dataclasses.replace(clear, irradiances={})
    assert openswim.render(anew, wide).attrs[name] == low[name]


def test_diffuse_irradiance_under_broken_clouds(monkeypatch) -> None:
    """At ten places below cumulus and cirrus, as 64 altitudes of twice as many directions tell it (.12 % RMS)."""
    scene = demo_scene(64, 64, 40)
    dry = scene.data.assign(land_area_fraction=xr.ones_like(scene.data.land_area_fraction))  # what mirrors is dear
    lit, usual = light(dataclasses.replace(scene, data=dry)), viewpoint._QUADRATURE
    grid = lit.scene.grid
    lon, lat = grid.lonlat(*(np.random.default_rng(1).uniform(0.15, 0.85, (2, 10)) * 63))
    found = []
    for place in zip(lat, lon, strict=True):
        eye = lit.viewpoint(Camera.allsky(*place, size=8))  # what it sees by is the dear part
        for places in (usual, 64):
            monkeypatch.setattr(viewpoint, "_QUADRATURE", places)
            found.append(eye._irradiance()["diffuse_horizontal_spectral_irradiance_w_m2_nm"])
    error = np.array(found[::2]) / np.array(found[1::2]) - 1
    assert np.sqrt((error**2).mean()) < 0.0015


def test_spectral_irradiance_is_that_of_the_field(clear, allsky: xr.Dataset) -> None:
    """The hemisphere seen by the quadrature of directions against the solver's own fluxes."""
    fluxes = clear.field.fluxes()
    expected = (fluxes["down_bottom"] + fluxes["direct_bottom"]) * allsky.solar_irradiance.values
    ours = allsky.attrs["global_horizontal_spectral_irradiance_w_m2_nm"]
    np.testing.assert_allclose(ours, expected, rtol=0.02)


def test_one_solve_serves_many_cameras(cloudy) -> None:
    camera = Camera.allsky(LAT, LON, size=16)
    again = openswim.render(cloudy.scene, camera, sun=SUN)
    np.testing.assert_allclose(openswim.render(cloudy, camera).radiance, again.radiance, rtol=1e-5)


def test_options_that_solved_light_has_not_are_refused(clear) -> None:
    camera = Camera.allsky(LAT + 1.0, LON, size=4)
    turned = light(clear.scene, "swim", sun=SUN)
    kept = {"solver": Solver("fast"), "wavelengths_nm": [615, 546, 450], "time": "2024-05-04T09:30Z"}
    middle = openswim.render(turned, camera, "swim", sun=SUN)
    over_camera = turned.viewpoint(camera).sun
    same = [openswim.render(turned, camera), openswim.render(turned, camera, sun=over_camera)]
    assert all(each.radiance.equals(middle.radiance) for each in same)
    assert openswim.render(clear, camera, **kept).radiance.equals(openswim.render(clear, camera).radiance)
    for lit, wrong, named in (
        (clear, {"wavelengths_nm": [865]}, r"wavelengths_nm = \[865\]: .* solved with wavelengths_nm = \[615.0, 546"),
        (clear, {"solver": "reference"}, "solver = 'reference': .* solved with a Solver of name = 'fast'; leave it"),
        (clear, {"solver": Solver(quality="high")}, "solved with a Solver of quality = 'standard'"),
        (clear, {"sun": SUN}, r"sun = \(130.0, 40.0\): .* solved with time = 2024-05-04T.*light\(scene, sun="),
        (clear, {"time": "2024-05-04T09:31"}, "solved with time = 2024-05-04T09:30"),
        (turned, {"time": TIME}, r"solved with sun = \(130.00, 40.00\)"),
        (turned, {"sun": (130.0, 41.0)}, r"solved with sun = \(130.00, 40.00\)"),
        (turned, {"solver": Solver("fast")}, "solved with a Solver of name = 'swim'"),
    ):  # fmt: skip
        with pytest.raises(UserError, match=named):
            openswim.render(lit, camera, **wrong)


def test_observers_outside_the_domain_learn_its_extent(cloudy) -> None:
    with pytest.raises(UserError, match=r"outside the domain.*latitude 39.*longitude 9\.9"):
        openswim.render(cloudy, Camera.allsky(LAT + 2.0, LON, size=8))


def test_the_sun_over_a_flat_scene_is_that_of_its_place() -> None:
    scene = grid_scene({}, (4, 5, 6), place=(LAT, LON), time=TIME)
    image = openswim.render(scene, Camera.allsky(x_m=0.0, y_m=0.0, size=8))
    sun = sun_position(TIME, LAT, LON)
    assert image.attrs["sun_azimuth_deg"] == pytest.approx(sun.azimuth_deg, abs=0.01)
    assert image.attrs["sun_altitude_deg"] == pytest.approx(sun.refracted_altitude_deg, abs=0.01)
    with pytest.raises(UserError, match="flat scene without a place: give it latitude"):
        openswim.render(grid_scene({}, (4, 5, 6), time=TIME), Camera.allsky(x_m=0.0, y_m=0.0, size=8))


@pytest.mark.parametrize(("altitude", "curved", "told"), [(-4, False, True), (-20, False, False), (4, False, False),
                                                          (-4, True, False)])  # fmt: skip
def test_a_flat_earth_without_dusk_is_told(monkeypatch, altitude: float, curved: bool, told: bool) -> None:
    """Only where a curved Earth has dusk; warnings are errors here."""
    monkeypatch.setattr(Solver, "solve", lambda *_, **__: None)
    dark = pytest.warns(UserWarning, match=r"4\.0 degrees below .* flat Earth, which has no dusk")
    with dark if told else nullcontext():
        light(grid_scene({}, (4, 5, 6), curved=curved), sun=(180.0, altitude))


def test_observers_outside_a_flat_domain_learn_its_extent() -> None:
    scene = grid_scene({}, (4, 5, 6))
    with pytest.raises(UserError, match=r"x in -250 to 250 m and y in -200 to 200 m"):
        openswim.render(scene, Camera.allsky(x_m=900.0, y_m=0.0, size=8), sun=SUN)


@pytest.mark.parametrize(
    ("flat", "place", "said"),
    [
        (False, {"lat": LAT + 2.0, "lon": LON}, "outside the domain"),
        (False, {"x_m": 0.0, "y_m": 0.0}, "curved Earth: give lat and lon in degrees"),
        (True, {"lat": LAT, "lon": LON}, "flat: give x_m and y_m in metres"),
        (True, {"x_m": 900.0, "y_m": 0.0}, "outside the domain"),
        (None, {"x_m": 0.0, "y_m": 0.0}, "curved Earth: give lat and lon in degrees"),
    ],
)
def test_where_nobody_can_stand_is_known_before_the_light(monkeypatch, flat, place: dict, said: str) -> None:
    monkeypatch.setattr(Solver, "solve", None)
    scene = Scene.clear(LAT, LON) if flat is None else grid_scene({}, (4, 5, 6), curved=not flat)
    with pytest.raises(UserError, match=said):
        openswim.render(scene, Camera.allsky(**place, size=8), sun=SUN)


def test_a_time_and_a_sun_are_not_both_taken(monkeypatch) -> None:
    monkeypatch.setattr(Solver, "solve", None)
    scene = Scene.clear(LAT, LON)
    for call in (lambda **sun: light(scene, **sun),
                 lambda **sun: openswim.render(scene, Camera.allsky(LAT, LON, size=8), **sun)):  # fmt: skip
        with pytest.raises(UserError, match=r"time = '2024-06-21' and sun = \(.*\): give one of them"):
            call(time="2024-06-21", sun=SUN)


def test_corners_of_a_domain_are_inside() -> None:
    """Also where rounding puts them a little beside it."""
    x, y = np.linspace(0.0, 30.0, 7), np.linspace(40.0, 50.0, 5)
    scene = Scene.from_arrays({}, x, y, [0.0, 1e3], crs=CRS.from_proj4("+proj=longlat +R=6371000"))
    corners = [(lat, lon) for lat in (40.0, 50.0) for lon in (0.0, 30.0)]
    for lat, lon in corners:
        check_observer(scene, Camera.allsky(lat, lon, size=4), "fast")
        check_observer(scene, Camera.allsky(lat, lon + 1e-9 * np.sign(lon - 15), size=4), "fast")
        with pytest.raises(UserError, match="outside the domain"):
            check_observer(scene, Camera.allsky(lat + 0.001 * np.sign(lat - 45), lon, size=4), "fast")
    assert np.isfinite(openswim.render(scene, Camera.allsky(50.0, 0.0, size=4), "swim", sun=SUN).radiance[1, 1]).all()


@pytest.mark.parametrize("sun", [(0, np.nan), (np.inf, 10), (0, 100), (0, 1, 2), (0,), 3.0, "noon", ("a", "b")])
def test_a_sun_that_is_nowhere_is_told(sun) -> None:
    with pytest.raises(UserError, match=r"give \(azimuth, altitude\) in degrees"):
        daylight(Scene.clear(LAT, LON), sun=sun)


@pytest.mark.parametrize("wavelengths", [[550, 550], [[550.0, 600.0]], "red", [None, "x"]])
def test_wavelengths_are_numbers_each_once(monkeypatch, wavelengths) -> None:
    monkeypatch.setattr(Solver, "solve", None)
    with pytest.raises(UserError, match=r"wavelengths_nm .*give a list"):
        light(Scene.clear(LAT, LON), wavelengths_nm=wavelengths, sun=SUN)


@pytest.mark.parametrize("scene", ["foo.nc", Path("foo.nc"), None])
def test_files_are_to_be_opened_first(scene) -> None:
    for wrong in (lambda: openswim.render(scene, Camera.allsky(LAT, LON)), lambda: light(scene)):
        with pytest.raises(UserError, match=r"scene is .*: open_scene\(path\) first"):
            wrong()


def test_observers_under_the_ground_are_told(clear) -> None:
    with pytest.raises(UserError, match="height"):
        openswim.render(clear, Camera.allsky(LAT, LON, height_m=-5.0, size=8))


def test_a_scene_without_time_needs_one() -> None:
    with pytest.raises(UserError, match="time"):
        daylight(Scene.clear(LAT, LON))


def test_a_flat_scene_needs_the_sun() -> None:
    with pytest.raises(UserError, match="sun="):
        daylight(grid_scene({}, (4, 5, 6)), TIME)


def test_the_setting_sun_is_lifted_by_refraction() -> None:
    """At the geometric horizon the sun still stands about half a degree high."""
    scene = Scene.clear(0.0, 0.0)
    times = np.arange(np.datetime64("2024-03-20T17:30"), np.datetime64("2024-03-20T18:40"))
    place = [sun_position(t, 0.0, 0.0) for t in times]
    t = int(np.argmin([abs(p.altitude_deg) for p in place]))
    lifted = np.degrees(np.arcsin(daylight(scene, times[t]).direction[2])) - place[t].altitude_deg
    assert lifted == pytest.approx(0.48, abs=0.06)  # Bennett (1982): 29 minutes of arc


def test_of_a_large_domain_opened_whole_a_view_takes_what_it_needs() -> None:
    shape = (3, 600, 600)
    cloud = box(shape, (slice(1, 2), slice(280, 330), slice(290, 296)), 5e-4)
    whole = grid_scene(cloud, shape, (3000.0, 3000.0, 900.0), curved=True, air=True)
    sky = Camera.allsky(LAT, LON, size=12)
    around = Neighbourhood(LAT, LON, reach_m(sky.height_m), far_m=far_m(sky.height_m))
    part = part_of(whole, around)
    assert part.data["extinction_cloud"].shape[1] < 150
    alone = openswim.render(part, sky, solver="swim", sun=SUN)
    part.wider = part_of(whole, around.beyond)
    assert part.wider.data["extinction_cloud"].shape[1] > 290
    seen = openswim.render(whole, sky, solver="swim", sun=SUN)
    expected = openswim.render(part, sky, solver="swim", sun=SUN)
    np.testing.assert_array_equal(seen.radiance, expected.radiance)
    np.testing.assert_allclose(seen.radiance, alone.radiance, rtol=0.05)  # there is nothing far away
    assert whole.wider is None
    from_space = openswim.render(whole, Camera.satellite(LAT, LON, 3.6e7, size=(8, 8), fov_deg=2.5), sun=SUN)
    assert from_space.quality == "standard (columns)"  # what was asked, and that each column is solved by itself
    assert np.isfinite(from_space.radiance).all()


def test_cameras_that_look_alike_see_alike(clear, allsky: xr.Dataset) -> None:
    """A lens, a map and free rays of the directions of `Camera.allsky`; a turned lens sees the same elsewhere."""
    sun = allsky.attrs["sun_azimuth_deg"], allsky.attrs["sun_altitude_deg"]
    moon = allsky.attrs["moon_azimuth_deg"], allsky.attrs["moon_altitude_deg"]
    clear_of_discs = (separation_deg(allsky, *sun) > 15) & (separation_deg(allsky, *moon) > 8)
    pixels = Camera.allsky(LAT, LON, size=90).pixels()
    for camera in (
        Camera.fisheye(LAT, LON, size=90),
        Camera.from_map(pixels.azimuth_deg, 90 - pixels.altitude_deg, LAT, LON),
        Camera.from_rays(pixels.direction, LAT, LON),
    ):
        image = openswim.render(clear, camera)
        assert image.attrs["view"] == camera.view
        inside = np.isfinite(image.radiance.values) & np.isfinite(allsky.radiance.values)
        assert inside.any(axis=-1).sum() >= 0.98 * pixels.inside.sum()
        far = inside & clear_of_discs[..., None]  # discs depend on the pixel's own width
        np.testing.assert_allclose(image.radiance.values[far], allsky.radiance.values[far], rtol=2e-3)
    half = openswim.render(clear, Camera.fisheye(LAT, LON, size=90, rotation_deg=180))
    far = (separation_deg(allsky, *sun) > 15) & np.isfinite(allsky.azimuth.values)
    far &= far[::-1, ::-1]
    turned = half.radiance.values[::-1, ::-1]
    np.testing.assert_allclose(turned[far], allsky.radiance.values[far], rtol=2e-3)


def test_an_eye_on_the_ground_is_not_in_it() -> None:
    """At height 0 a slope shows the same sky as from a centimetre above, wherever one stands."""
    terrain = 300.0 + 200.0 * np.sin(np.arange(6))[:, None] * np.cos(np.arange(6))
    scene = grid_scene({}, (6, 6, 6), (1e3, 1e3, 1e3), curved=True, air=True, terrain_m=terrain, surface_albedo=0.1)
    lit = light(scene, "swim", wavelengths_nm=[550.0], sun=SUN)
    middle = scene.place
    for north, east in ((0.0, 0.0), (0.011, 0.007), (-0.008, 0.013), (0.004, -0.012)):
        place = middle[0] + north, middle[1] + east
        down, up = (
            lit.viewpoint(Camera.allsky(*place, height_m=height, size=8)).view().radiance.values
            for height in (0.0, 0.01)
        )
        np.testing.assert_allclose(down, up, rtol=1e-3)
    with pytest.raises(UserError, match="in the ground"):
        lit.viewpoint(Camera.satellite(*middle, height_m=10.0, size=4))


def test_a_camera_in_the_ground_is_known_before_the_light(monkeypatch) -> None:
    monkeypatch.setattr(Solver, "solve", None)
    scene = grid_scene({}, (4, 5, 6), curved=True, terrain_m=np.full((5, 6), 200.0), surface_albedo=0.1)
    with pytest.raises(UserError, match="in the ground, which lies at 150 m"):
        openswim.render(scene, Camera.satellite(*scene.place, height_m=100.0, size=4), sun=SUN)
