import numpy as np
import pytest

from openswim.fluxes import Quadrature, quadrature_directions, spectral_irradiance
from openswim.lights import solar_irradiance
from openswim.scene.frame import horizon_vector

SUNS = [(200.0, 88.0), (200.0, 60.0), (10.0, 25.0), (359.0, 3.0), (90.0, 0.0), (180.0, -4.0)]


def flux(quadrature, radiance):
    """Irradiance on the horizontal of radiance(azimuth, altitude)."""
    values = radiance(quadrature.azimuth_deg, quadrature.altitude_deg)
    return np.sum(quadrature.solid_angle_sr * np.sin(np.radians(quadrature.altitude_deg)) * values)


def brute_force(radiance, rows=700):
    """The same by half a million directions, each with the same share of the plane's view."""
    sine = np.sqrt((np.arange(rows) + 0.5) / rows)
    azimuth = (np.arange(rows) + 0.5) * 360 / rows
    return np.pi * radiance(azimuth, np.degrees(np.arcsin(sine))[:, None]).mean()


def test_a_uniform_sky_gives_pi_without_a_sun():
    quadrature = quadrature_directions(8)
    assert len(quadrature) == 8 * 16
    assert flux(quadrature, lambda az, h: 1.0) == pytest.approx(np.pi, rel=1e-12)
    assert quadrature.solid_angle_sr.sum() == pytest.approx(2 * np.pi, rel=1e-12)


@pytest.mark.parametrize("sun", SUNS)
def test_a_uniform_sky_gives_pi_wherever_the_sun_stands(sun):
    quadrature = quadrature_directions(12, *sun)
    assert flux(quadrature, lambda az, h: 1.0) == pytest.approx(np.pi, rel=3e-4)
    assert (quadrature.solid_angle_sr >= 0).all()
    assert (quadrature.altitude_deg > 0).all()
    assert (quadrature.altitude_deg <= 90).all()
    assert ((quadrature.azimuth_deg >= 0) & (quadrature.azimuth_deg < 360)).all()


def test_the_overcast_sky_of_moon_and_spencer():
    # (1 + 2 sin h) / 3 of the zenith's radiance: 7 pi / 9.
    found = flux(quadrature_directions(6), lambda az, h: (1 + 2 * np.sin(np.radians(h))) / 3)
    assert found == pytest.approx(7 * np.pi / 9, rel=1e-9)


@pytest.mark.parametrize("sun", SUNS)
@pytest.mark.parametrize("g", [0.65, 0.85, 0.95])
def test_forward_peaks_of_any_width_are_resolved(sun, g):
    toward = horizon_vector(*sun)

    def haze(azimuth, altitude):
        cosine = horizon_vector(azimuth, altitude) @ toward
        slant = 0.3 / np.sin(np.radians(altitude))
        return (1 - g**2) / (1 + g**2 - 2 * g * cosine) ** 1.5 * -np.expm1(-slant)

    assert flux(quadrature_directions(12, *sun), haze) == pytest.approx(brute_force(haze), rel=6e-3)


def test_irradiance_of_a_simple_sky():
    quadrature = quadrature_directions(8)
    wavelengths = np.array([615.0, 546.0, 450.0])
    radiance = np.full((len(quadrature), 3), 0.4)
    transmittance = np.array([0.9, 0.8, 0.6])
    found = spectral_irradiance(radiance, quadrature, transmittance, 30.0, wavelengths, distance_au=1.01)
    top = solar_irradiance(wavelengths) / 1.01**2
    np.testing.assert_allclose(found.diffuse_horizontal, 0.1 * top)  # L' pi / (4 pi)
    np.testing.assert_allclose(found.direct_horizontal, transmittance * top / 2)
    np.testing.assert_allclose(found.direct_normal, transmittance * top)
    np.testing.assert_allclose(found.global_horizontal, (transmittance / 2 + 0.1) * top)
    np.testing.assert_allclose(found.relative_global_horizontal, transmittance / 2 + 0.1)
    assert found.global_horizontal.units == "W m-2 nm-1"


def test_there_is_no_beam_on_the_ground_after_sunset():
    quadrature = Quadrature(np.zeros(1), np.full(1, 90.0), np.ones(1))
    found = spectral_irradiance(np.ones((1, 1)), quadrature, np.ones(1), -2.0, np.array([550.0]))
    assert found.direct_horizontal.item() == 0  # though from high up it may still be seen
    assert found.diffuse_horizontal.item() > 0
