"""Moonlight, eclipses, the night sky and bent rays: against events as published, other formulas and conservation."""

import numpy as np
import pytest

from openswim.heavens.bent_rays import Refraction, bent_rays
from openswim.lights.airglow import airglow_radiance, airglow_zenith, solar_flux_sfu
from openswim.lights.eclipses import light_left, lunar_eclipse, moonlight_left, obscuration, solar_eclipse
from openswim.lights.eclipses.lunar import shadow, shadow_light
from openswim.lights.eclipses.solar import Discs
from openswim.lights.milky_way import TO_GALACTIC, starlight_s10
from openswim.lights.moon import moon_position
from openswim.lights.moonlight import disc_reflectance, earthshine, moon_irradiance
from openswim.lights.night_sky import NightSky, bright_stars_radiance
from openswim.lights.refraction import refraction_deg
from openswim.lights.units import (
    S10_W_M2_SR_NM,
    V0_W_M2_NM,
    magnitude_of_luminance,
    magnitude_of_radiance,
    radiance_of_rayleighs,
)
from openswim.lights.zodiacal import zodiacal_radiance, zodiacal_s10
from openswim.scene.atmosphere import Atmosphere
from openswim.scene.grid import EARTH_RADIUS_M


def seconds(when, text):
    return float((when - np.datetime64(text)) / np.timedelta64(1, "s"))


def test_units_of_faint_light():
    """22 magnitudes are .171 mcd/m2, one S10 is 27.78 of them, 1 R of green light is 2.8e-10 W m-2 sr-1."""
    assert magnitude_of_luminance(1.71e-4) == pytest.approx(22.0, abs=0.005)
    # of the sun's colour at 550 nm; the constant of Leinert is 3 % off that of Bessell
    assert magnitude_of_radiance(S10_W_M2_SR_NM * 0.97) == pytest.approx(27.78, abs=0.05)
    assert radiance_of_rayleighs(1.0, 557.7) == pytest.approx(2.83e-10, rel=0.002)


def test_the_full_moon_is_as_bright_as_allens():
    """V = -12.73 + .026 g + 4e-9 g^4 (Allen 1973), without the opposition surge: 10 % between 10 and 90 degrees."""
    for phase in (10.0, 30.0, 60.0, 90.0):
        irradiance = disc_reflectance(550.0, phase) * 6.4177e-5 * 1.86 / np.pi
        allen = V0_W_M2_NM * 10 ** (0.4 * (12.73 - 0.026 * phase - 4e-9 * phase**4))
        assert irradiance == pytest.approx(allen, rel=0.11)
    # a surge at the full moon, no jump where one formula follows another, and next to nothing at new moon
    assert disc_reflectance(550.0, 2.0) / disc_reflectance(550.0, 7.0) > 1.2
    assert disc_reflectance(550.0, 95.001) == pytest.approx(disc_reflectance(550.0, 95.0), rel=1e-3)
    assert disc_reflectance(550.0, 180.0) < 5e-3 * disc_reflectance(550.0, 90.0)
    assert earthshine(180.0) == pytest.approx(5.5e-5, rel=0.01)
    assert earthshine(90.0) == pytest.approx(5.5e-5 / np.pi, rel=0.01)


def test_moonlight_goes_with_the_distance():
    """The full moons of 2023-08-31 (357 300 km) and 2023-02-05 (406 000 km), each near the same phase."""
    near, far = moon_position("2023-08-31T06:30", 0, 0), moon_position("2023-02-05T23:30", 0, 0)
    ratio = moon_irradiance(near, [550.0]) / moon_irradiance(far, [550.0])
    reflected = disc_reflectance(550.0, near.phase_angle_deg) / disc_reflectance(550.0, far.phase_angle_deg)
    expected = (far.distance_km / near.distance_km) ** 2 * (far.sun_distance_au / near.sun_distance_au) ** 2
    assert float(ratio[0] / reflected) == pytest.approx(expected, rel=0.04)  # libration and the waxing side


def test_the_eclipse_of_2024_over_dallas_as_published():
    """12:23:18, 1:40:43, 1:44:34 and 3:02:41 p.m. CDT (a newspaper's table, of another place in the city)."""
    found = solar_eclipse("2024-04-08T18:42", 32.7767, -96.797, 131)
    assert found is not None
    assert found.total
    assert found.obscuration == 1.0
    for when, published in ((found.first, "17:23:18"), (found.second, "18:40:43"), (found.third, "18:44:34"),
                            (found.last, "20:02:41")):  # fmt: skip
        assert seconds(when, f"2024-04-08T{published}") == pytest.approx(0, abs=2.0)
    assert solar_eclipse("2024-04-09T18:42", 32.7767, -96.797) is None


def test_covered_shares_of_the_sun():
    """Equal discs a radius apart cover 2/3 - sqrt(3)/(2 pi); an even sum over rings agrees with areas."""
    discs = Discs(np.array([0.26, 0.6, 0.0, 0.0]), np.full(4, 0.26), np.array([0.26, 0.26, 0.27, 0.13]))
    assert obscuration(discs) == pytest.approx([2 / 3 - np.sqrt(3) / (2 * np.pi), 0, 1, 0.25])
    left = light_left(discs, [450.0, 615.0])
    assert left[1:3] == pytest.approx(np.array([[1, 1], [0, 0]]), abs=1e-9)
    # the middle of the disc holds more than its share, the more so in the blue; what is left is redder
    assert left[3, 0] < left[3, 1] < 0.75
    assert left[0] == pytest.approx(1 - obscuration(discs)[0], abs=0.03)


def test_the_lunar_eclipse_of_2018_as_published():
    """NASA: greatest at 20:21:44 UT, umbral magnitude 1.609, umbra 18:24:27 to 22:19:00 (with a larger umbra)."""
    found = lunar_eclipse("2018-07-27T20:21")
    assert found is not None
    assert found.umbral_magnitude == pytest.approx(1.609, abs=0.005)
    assert seconds(found.greatest, "2018-07-27T20:21:44") == pytest.approx(0, abs=3)
    for when, published in ((found.u1, "18:24:27"), (found.u2, "19:30:15"), (found.u3, "21:13:12"),
                            (found.u4, "22:19:00")):  # fmt: skip
        assert seconds(when, f"2018-07-27T{published}") == pytest.approx(0, abs=30)
    assert lunar_eclipse("2018-07-10T12:00") is None


def test_the_eclipsed_moon_is_dark_and_red():
    left = moonlight_left("2018-07-27T20:21", [450.0, 546.0, 615.0])
    assert 1e-6 < left[0] < left[1] < left[2] < 1e-3
    assert moonlight_left("2018-07-27T12:00", [550.0]) == 1.0
    at = shadow("2018-07-27T20:21")
    light = shadow_light(at, np.linspace(0, float(at.penumbra_deg[0]) + 0.01, 400), [546.0])[:, 0]
    assert (np.diff(light) > -1e-9).all()
    assert light[-1] == pytest.approx(1.0)


def test_zodiacal_light_between_its_nodes():
    """The gegenschein, the cone, and values that do not leap where the table ends."""
    assert zodiacal_s10(180.0, 0.0) == pytest.approx(180, rel=0.01)
    assert zodiacal_s10(-60.0, 0.0) == zodiacal_s10(60.0, -0.0)
    assert zodiacal_s10(37.5, 0.0) == pytest.approx(np.sqrt(zodiacal_s10(35.0, 0.0) * zodiacal_s10(40.0, 0.0)))
    inward = zodiacal_s10(np.linspace(0.0, 20.0, 81), 0.0)
    assert (np.diff(inward) < 0).all()
    colour = zodiacal_radiance(30.0, 0.0, [450.0, 500.0, 615.0]) / S10_W_M2_SR_NM / zodiacal_s10(30.0, 0.0)
    assert colour[1] == pytest.approx(1.0)


def test_the_milky_way_lies_where_it_should():
    """The galactic pole and centre in J2000 (192.859, 27.128; 266.405, -28.936), and a bright Sagittarius."""

    def toward(ascension, declination):
        a, d = np.radians([ascension, declination])
        return TO_GALACTIC @ [np.cos(d) * np.cos(a), np.cos(d) * np.sin(a), np.sin(d)]

    assert toward(192.85948, 27.12825) == pytest.approx([0, 0, 1], abs=1e-5)
    assert toward(266.40510, -28.93617) == pytest.approx([1, 0, 0], abs=1e-5)
    np.testing.assert_allclose(TO_GALACTIC @ TO_GALACTIC.T, np.eye(3), atol=1e-9)
    # Pioneer 10 saw 27 and 33 S10 at the poles, with the dust's light
    cap = np.arange(82.0, 90.0)
    pole = (starlight_s10(*np.meshgrid(np.arange(0, 360, 5.0), cap)).mean(axis=1) @ (90 - cap)) / (90 - cap).sum()
    assert pole == pytest.approx(27, abs=6)
    assert starlight_s10(2.0, -4.0) > 5 * starlight_s10(0.0, 60.0)
    assert starlight_s10(359.999, 0.0) == pytest.approx(starlight_s10(0.001, 0.0), rel=1e-3)


def test_airglow_has_the_magnitudes_of_its_spectrum():
    """V = 22.0 at the zenith; from orbit a bright line at 90 km above the limb, nothing beyond it."""
    low, high = airglow_zenith([540.0, 550.0, 560.0])
    assert magnitude_of_radiance((low + high).mean()) == pytest.approx(22.0, abs=0.1)
    eye = np.array([0.0, 0.0, EARTH_RADIUS_M + 400e3])

    def past(height_m):
        sine = (EARTH_RADIUS_M + height_m) / eye[2]
        return airglow_radiance(eye, np.array([[sine, 0.0, -np.sqrt(1 - sine**2)]]), [546.0])[0, 0]

    assert past(86e3) > 30 * low[0]
    assert past(96e3) == 0.0
    assert past(-100e3) < 6 * low[0]
    assert solar_flux_sfu("2019-12-01") < 72 < 150 < solar_flux_sfu("2014-04-01")


def test_the_darkest_sky_before_the_air():
    """Away from Milky Way and ecliptic, solar minimum: some 21.8 (Krisciunas 1997: 21.3 to 21.9 over a cycle)."""
    # over Mauna Kea in the evening: the north galactic pole is high in May
    sky = NightSky.at("2019-05-05T09:00", 19.83, -155.47, np.eye(3), flux_sfu=70.0)
    up = np.array([[0.0, 0.0, 1.0]])
    seen = sky.beyond_air(up, [550.0]) + sky.airglow(0.0, up, [550.0])
    assert 21.6 < magnitude_of_radiance(seen[0, 0]) < 22.1
    assert sky.mean([550.0])[0] > seen[0, 0]  # toward the horizon airglow is brighter
    # the classical sum of starlight is 105 S10, of which bright stars are 20 to 35
    assert 20 < bright_stars_radiance(500.0) / S10_W_M2_SR_NM < 35


def test_stars_stand_where_the_night_sky_has_them():
    """Bright stars' directions through the sky's axes, and by right ascension; aberration and proper motion remain."""
    from openswim.lights.stars import star_positions
    from openswim.scene.frame import horizon_vector

    time, place = "2024-07-01T22:00", (40.0, 10.0)
    stars = star_positions(time, *place, magnitude=1.0)
    sky = NightSky.at(time, *place, np.eye(3))
    toward = horizon_vector(stars.azimuth_deg, stars.altitude_deg) @ sky.to_icrs.T
    a, d = (np.radians(each) for each in (stars.catalogue.right_ascension_deg, stars.catalogue.declination_deg))
    true = np.stack([np.cos(d) * np.cos(a), np.cos(d) * np.sin(a), np.sin(d)], axis=-1)
    assert np.degrees(np.linalg.norm(toward - true, axis=-1)).max() < 0.016  # Arcturus moves by .015


def test_rays_are_bent_as_measured():
    """Two terms in the tangent, with a homogeneous height of 8.43 km (Smart, Spherical Astronomy), high in the sky;
    near the horizon Bennett's formula; the sun on the sea is flattened."""
    air = Atmosphere.us_standard()
    high = np.array([20.0, 45.0, 80.0])
    tangent, excess, height = 1 / np.tan(np.radians(high)), 2.7785e-4, 8.43 / 6371
    expected = excess * ((1 - height) * tangent - (height - excess / 2) * tangent**3)
    assert bent_rays(air, high).refraction_deg == pytest.approx(np.degrees(expected), rel=0.002)
    low = np.array([1.0, 3.0, 10.0])
    assert bent_rays(air, low).refraction_deg == pytest.approx(refraction_deg(low, 101_325, 288.15), rel=0.03)
    refraction = Refraction.at(air)
    lower = refraction.true_altitude_deg(0.0)
    assert lower == pytest.approx(-0.55, abs=0.01)
    assert 0.83 < (refraction.apparent_altitude_deg(lower + 0.533) - 0.0) / 0.533 < 0.86
    assert refraction.apparent_altitude_deg(refraction.true_altitude_deg(7.3)) == pytest.approx(7.3, abs=1e-6)
    blue, red = (bent_rays(air, 0.0, wavelength_nm=wl).refraction_deg for wl in (450.0, 615.0))
    assert float((blue - red)[0]) == pytest.approx(0.008, abs=0.001)
    # from a mountain the horizon lies lower, and rays come from farther below
    above = Refraction.at(air, 4500.0)
    assert -2.2 < above.apparent_deg[0] < -1.9
    assert above.true_deg[0] < above.apparent_deg[0] - 0.8
    assert np.isnan(bent_rays(air, [-5.0], 4500.0).refraction_deg).all()
