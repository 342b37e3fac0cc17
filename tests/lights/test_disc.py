import numpy as np
import pytest

from openswim.lights import disc_coverage, disc_profile

WAVELENGTHS = np.array([310.0, 378.0, 410.0, 450.0, 546.0, 615.0, 1000.0])


def test_the_mean_over_the_disc_is_one():
    radius = np.sqrt((np.arange(200_000) + 0.5) / 200_000)  # rings of equal area
    np.testing.assert_allclose(disc_profile(radius, WAVELENGTHS).mean(axis=0), 1.0, atol=2e-5)


def test_brightness_falls_toward_the_limb_and_ends_there():
    profile = disc_profile(np.linspace(0, 1, 200), WAVELENGTHS)
    assert (np.diff(profile, axis=0) < 0).all()
    assert (profile > 0).all()
    assert not disc_profile(np.array([1.0001, 3.0]), WAVELENGTHS).any()


# Cox (2000), Allen's Astrophysical Quantities: 1 - u - v + u mu + v mu^2.
@pytest.mark.parametrize(
    ("wavelength", "u", "v"), [(450, 0.98, -0.20), (550, 0.93, -0.23), (800, 0.73, -0.22)]
)
def test_limb_darkening_is_that_of_the_handbook(wavelength, u, v):
    mu = np.array([1.0, 0.8, 0.5, 0.3])
    profile = disc_profile(np.sqrt(1 - mu**2), wavelength)
    np.testing.assert_allclose(profile / profile[0], 1 - u - v + u * mu + v * mu**2, atol=0.025)


def test_the_limb_is_redder_than_the_centre():
    centre, limb = disc_profile(np.array([0.0, 0.95]), np.array([450.0, 615.0]))
    assert limb[0] / limb[1] < 0.9 * centre[0] / centre[1]


@pytest.mark.parametrize("pixel_deg", [0.004, 0.05, 0.225, 0.45, 1.0])
@pytest.mark.parametrize("shift", [0.0, 0.31, 0.5])
def test_the_pixels_together_hold_the_whole_sunbeam(pixel_deg, shift):
    half = int(np.ceil(0.35 / pixel_deg)) + 10
    axis = (np.arange(-half, half + 1) + shift) * pixel_deg
    x, y = np.meshgrid(axis, axis + 0.2 * pixel_deg)
    radiance = disc_coverage(np.hypot(x, y).ravel(), pixel_deg / 2, 0.2666, WAVELENGTHS)
    total = radiance.sum(axis=0) * np.radians(pixel_deg) ** 2
    np.testing.assert_allclose(total, 4 * np.pi, rtol=3e-3)


def test_small_pixels_see_the_disc_itself():
    distance = np.array([0.0, 0.1, 0.2, 0.26, 0.28, 5.0])
    radiance = disc_coverage(distance, np.full(6, 1e-4), 0.2666, np.array([546.0]))[:, 0]
    mean = 4 * np.pi / (np.pi * np.radians(0.2666) ** 2)
    np.testing.assert_allclose(radiance / mean, disc_profile(distance / 0.2666, 546.0), rtol=2e-3)


def test_the_edge_is_smooth():
    distance = np.linspace(0, 0.6, 300)
    radiance = disc_coverage(distance, 0.05, 0.2666, np.array([546.0]))[:, 0]
    assert (np.diff(radiance) <= 0).all()
    assert np.abs(np.diff(radiance)).max() < 0.05 * radiance[0]
