"""What a camera sees of moon, stars and the night's sky: all of their light, at their places, through the air."""

import numpy as np
import pytest

import openswim
from openswim.cameras import Camera
from openswim.colour.cie import solar_illuminance_lx
from openswim.colour.photometry import luminance_cd_m2
from openswim.heavens.bent_rays import LongerWay, Refraction
from openswim.heavens.moon_disc import disc_light, drawn_moon, even_places, on_the_moon
from openswim.heavens.points import Points, drawn_points
from openswim.lights import moon_irradiance, moon_position
from openswim.lights.units import V0_W_M2_NM, magnitude_of_luminance
from openswim.scene.atmosphere import Atmosphere

PLACE = (40.0, 10.0)


def open_to(direction, width):
    return np.ones((len(direction), 2)), np.zeros(len(direction), bool)


def test_the_moons_disc_holds_its_light_and_faces_the_sun():
    moon = moon_position("2024-03-17T20:00", *PLACE)  # at first quarter
    place = even_places(8000)
    light = disc_light(moon, place, np.array([450.0, 550.0]))
    assert light.sum(axis=0) == pytest.approx(moon_irradiance(moon, [450.0, 550.0]), rel=1e-3)
    bright = (light[:, 1:] * place).sum(axis=0)
    turned = np.degrees(np.arctan2(-bright[0], bright[1])) % 360
    assert turned == pytest.approx(moon.bright_limb_from_zenith_deg, abs=8.0)
    # the middle of the disc is the place under the observer, the pole lies where the axis points
    axis = np.radians(moon.axis_from_zenith_deg)
    middle, pole = on_the_moon(moon, np.array([[0.0, 0.0], [-np.sin(axis), np.cos(axis)]]))
    lon, lat = moon.sub_observer_lonlat_deg
    assert np.degrees(np.arcsin(middle[2])) == pytest.approx(lat, abs=1e-6)
    assert np.degrees(np.arctan2(middle[1], middle[0])) == pytest.approx(lon, abs=1e-6)
    assert np.degrees(np.arcsin(pole[2])) == pytest.approx(90 - abs(lat), abs=1e-6)


@pytest.mark.parametrize("fov_deg", [0.1, 0.03, 0.002])
@pytest.mark.parametrize("size", [(1, 1), (30, 50)])
def test_within_the_moon_a_narrow_view_is_full_of_it(fov_deg, size):
    """As bright as the whole disc is where it looks, but for the seas."""
    moon = moon_position("2024-06-21T22:00", *PLACE)
    wavelengths = np.array([450.0, 550.0])

    def mean(fov_deg, size):
        camera = Camera.perspective(
            *PLACE, azimuth_deg=moon.azimuth_deg, altitude_deg=moon.altitude_deg, fov_deg=fov_deg, size=size
        )
        given = camera, camera.pixels(), wavelengths, np.ones(2), open_to, None
        return drawn_moon(moon, "2024-06-21T22:00", *given).radiance

    found = mean(fov_deg, size)
    assert len(found) == size[0] * size[1]
    np.testing.assert_allclose(found.mean(axis=0), mean(0.15, (1, 1))[0], rtol=0.2)
    assert found.min() > 0.5 * found.mean()


def test_seas_are_dark_where_they_are():
    """Mare Crisium (17 N, 59 E) against the land around Tycho (43 S, 11 W)."""
    from openswim.heavens.moon_disc import albedo

    assert albedo(np.array([59.0]), np.array([17.0]))[0] < 0.75 * albedo(np.array([-11.0]), np.array([-43.0]))[0]


def test_the_moons_face_has_no_steps():
    """In a step of a hundredth of a degree the grey changes by a fiftieth of what it does in half a degree: along a
    meridian, a parallel, across the far side's 180 degrees, and at a pole."""
    from openswim.heavens.moon_disc import albedo

    n = np.arange(-0.25, 20.25, 0.01)  # from one middle of the map to another
    for lon, lat in [(np.full_like(n, 20.0), n), (n, np.full_like(n, 10.0)), (170 + n, 0 * n), (0 * n, 70 + n)]:
        grey = albedo((lon + 180) % 360 - 180, lat)
        assert np.abs(np.diff(grey)).max() < 0.021 * np.abs(grey[50:] - grey[:-50]).max() + 1e-12
    assert albedo(np.array([-180.0]), np.array([5.0])) == pytest.approx(
        albedo(np.array([179.9999]), np.array([5.0])), rel=1e-3
    )


def test_a_stars_light_falls_on_the_picture_whole():
    camera = Camera.perspective(*PLACE, azimuth_deg=180, altitude_deg=40, fov_deg=30, size=(120, 160))
    pixels = camera.pixels()
    stars = Points(np.array([40.0, 33.3]), np.array([180.0, 186.2]), np.array([0.0, 2.5]), np.array([0.65, 1.5]))
    wl, toa = np.array([550.0, 450.0]), np.array([1.86, 2.0])
    drawn = drawn_points(stars, camera, pixels, wl, toa, open_to)
    solid = pixels.solid_angle_sr[drawn.row, drawn.column]
    got = (drawn.radiance * solid[:, None]).sum(axis=0) * toa / (4 * np.pi)
    assert got[0] == pytest.approx(V0_W_M2_NM * (1 + 10**-1.0), rel=1e-6)
    assert got[1] / got[0] == pytest.approx(2.0 / 1.86, rel=0.15)  # the brighter has the sun's colour
    brightest = np.argmax(drawn.radiance[:, 0])
    at = camera.pixel_of(180.0, 40.0)
    assert abs(drawn.row[brightest] - at[0]) <= 0.5
    assert abs(drawn.column[brightest] - at[1]) <= 0.5


def test_bent_rays_go_through_more_air_near_the_horizon():
    """Rayleigh's airmass at the horizon is 38.2, that of straight rays sqrt(pi R / 2 H), 34.3 to 35.7 with heights
    H of 7.9 to 8.5 km; from 20 degrees on next to none is added."""
    way = LongerWay.at(Atmosphere.us_standard(300.0, None), 0.0, np.array([450.0]))
    added = -np.log(way.transmittance([0.0, 2.0, 20.0])[:, 0])
    assert 0.22 * (38.2 - 35.7) < added[0] < 0.22 * (38.2 - 34.3)
    assert added[1] < 0.25 * added[0]
    assert added[2] < 1e-3


@pytest.mark.slow
def test_a_dark_night_over_the_alps():
    """Solar minimum, no moon, away from the Milky Way: a zenith of 21.6 to 22.1, half a millilux to two."""
    scene = openswim.Scene.clear(47.3, 11.4)
    camera = Camera.allsky(47.3, 11.4, size=41)
    lit = openswim.light(scene, time="2019-04-04T23:00")
    assert [light.name for light in lit.lights] == ["sky"]
    image = openswim.render(lit, camera)
    assert image.attrs["lights"] == "sky"
    assert 5e-4 < image.attrs["illuminance_lx"] < 2e-3
    luminance = luminance_cd_m2(image)
    # between the stars
    assert 21.6 < magnitude_of_luminance(np.nanpercentile(luminance[17:24, 17:24], 20)) < 22.1
    assert np.nanmin(image.radiance.values) > 0


def test_the_sun_has_128_klx_outside_of_the_air():
    """133.1 klx by the solar constant of 1361 W/m2 and 98 lm/W (CIE: 127 to 134)."""
    assert 128e3 < solar_illuminance_lx() < 136e3


def test_eyes_below_the_sea_see_refracted_light():
    """At the Dead Sea the air is denser by 4 %, and so is refraction stronger."""
    air = Atmosphere.us_standard()
    low, sea = (Refraction.at(air, height) for height in (-400.0, 0.0))
    bend = [found.apparent_altitude_deg(10.0) - 10.0 for found in (low, sea)]
    assert bend[0] == pytest.approx(1.04 * bend[1], rel=0.0025)


@pytest.mark.slow
def test_from_space_the_lit_limb_shows_around_a_night():
    """Over a place where it is midnight the sun is not solved for; yet the edge of the Earth is as bright as in the
    sun's own field, and the middle as dark as the night."""
    scene = openswim.Scene.clear(10.0, 10.0)
    camera = Camera.geostationary(10.0, size=60)
    lit = openswim.light(scene, time="2024-03-20T23:30")
    assert "sun" not in [light.name for light in lit.lights]
    viewpoint = lit.viewpoint(camera)
    seen = viewpoint.view().solar_relative_radiance.values
    own = openswim.Solver().solve(scene, lit.daylight.direction, lit.field.wavelengths_nm)
    sunlit = np.full(seen.shape, np.nan)
    sunlit[viewpoint.pixels.inside] = own.view(viewpoint.rays).radiance
    ring = np.nan_to_num(sunlit[..., 1]) > 3e-4
    assert ring.sum() > 5
    assert seen[ring] / sunlit[ring] == pytest.approx(1.0, rel=0.02)  # the rest is airglow
    assert seen[30, 30].max() < 1e-5
