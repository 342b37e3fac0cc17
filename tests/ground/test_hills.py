"""Sunlight on slopes that no model knows: it is moved about, not made."""

import numpy as np
import pytest
from scipy.special import ndtr

from openswim.ground.hills import steepness_below, sunlight_on_slopes


def places(n, extent_deg=5.0):
    rng = np.random.default_rng(5)
    return 45 + rng.uniform(0, extent_deg, n), 5 + rng.uniform(0, extent_deg, n)


def toward(lat, lon, azimuth_deg):
    """Horizontal unit vectors (n, 3) in Earth-centred axes."""
    la, lo, azimuth = np.radians(lat), np.radians(lon), np.radians(azimuth_deg)
    east = np.stack([-np.sin(lo), np.cos(lo), 0 * lo], axis=-1)
    north = np.stack([-np.sin(la) * np.cos(lo), -np.sin(la) * np.sin(lo), np.cos(la)], axis=-1)
    return np.sin(azimuth) * east + np.cos(azimuth) * north


def light(altitude_deg, azimuth_deg=120.0, steepness=0.4, footprint_m=0.0, n=100_000, cell_m=3000.0):
    lat, lon = places(n)
    sun = np.cos(np.radians(altitude_deg)) * toward(lat, lon, azimuth_deg)
    mu, steep, footprint = (np.full(n, v) for v in (np.sin(np.radians(altitude_deg)), steepness, footprint_m))
    return sunlight_on_slopes(lat, lon, sun, mu, steep, cell_m, footprint)


@pytest.mark.parametrize("altitude", [1.0, 20.0, 85.0])
@pytest.mark.parametrize("footprint", [0.0, 300.0, 1500.0])
def test_the_ground_gets_as_much_light(altitude, footprint):
    factor = light(altitude, footprint_m=footprint)
    assert factor.mean() == pytest.approx(1, abs=0.02)
    assert (factor >= 0).all()


def test_slopes_turned_away_are_dark():
    """As many as a normal distribution of slopes has."""
    for altitude, steepness in ((5.0, 0.4), (15.0, 0.4), (15.0, 0.1)):
        spread = steepness / np.sqrt(2) / np.tan(np.radians(altitude))
        assert (light(altitude, steepness=steepness) == 0).mean() == pytest.approx(ndtr(-1 / spread), abs=0.02)


def test_the_sun_of_the_other_side_lights_the_other_slopes():
    assert np.corrcoef(light(30.0, 100.0), light(30.0, 280.0))[0, 1] < -0.95


def test_level_land_and_wide_pixels_see_no_slopes():
    np.testing.assert_allclose(light(30.0, steepness=0.0, n=100), 1, rtol=1e-9)
    np.testing.assert_allclose(light(30.0, footprint_m=6000.0, n=100), 1, rtol=1e-6)


def test_steepness_grows_with_what_cells_hide():
    cells = [50.0, 100.0, 300.0, 3000.0]
    below = [float(steepness_below(np.array(0.01), cell)) for cell in cells]
    assert below[:2] == [0, 0]
    assert 0 < below[2] < below[3] < 0.6
    assert steepness_below(np.array(1.0), 3000.0) == pytest.approx(0.6)
    assert steepness_below(np.array(0.0), 3000.0) == 0
