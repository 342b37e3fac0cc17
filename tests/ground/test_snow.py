"""Snow: how bright it is, and where a fraction of a cell lies."""

import numpy as np
import pytest

from openswim.ground import snow
from openswim.ground.fields import filled, normal_noise


@pytest.mark.parametrize("fraction", [0.0, 0.05, 0.2, 0.5, 0.9, 1.0])
def test_cover_adds_up_to_the_fraction(fraction):
    """However it is spread, there is as much snow as the model has: the mean over a standard normal favour."""
    favour = np.random.default_rng(0).standard_normal(200_000)
    cover = snow.resolved_cover(np.full(favour.size, fraction), favour)
    assert cover.mean() == pytest.approx(fraction, abs=0.012)  # of which .01 is the logistic for the normal
    assert ((cover >= 0) & (cover <= 1)).all()
    assert (np.diff(cover[np.argsort(favour)]) >= 0).all()
    if 0.1 < fraction < 0.95:  # and it is mostly either there or not
        assert ((cover < 0.2) | (cover > 0.8)).mean() > 0.6


def test_noise_is_standard_normal_smooth_and_the_same_everywhere():
    rng = np.random.default_rng(1)
    lat, lon = np.degrees(np.arcsin(rng.uniform(-1, 1, 100_000))), rng.uniform(-180, 180, 100_000)
    noise = normal_noise(lat, lon, 30e3, np.zeros(lat.size))
    assert noise.mean() == pytest.approx(0, abs=0.02)
    assert noise.std() == pytest.approx(1, abs=0.03)
    np.testing.assert_allclose([(noise > q).mean() for q in (-1, 0, 1)], [0.841, 0.5, 0.159], atol=0.015)
    step = normal_noise(lat + 1e-5, lon, 30e3, np.zeros(lat.size)) - noise
    assert np.abs(step).max() < 0.05  # a metre apart
    np.testing.assert_allclose(normal_noise(lat[:9], lon[:9] + 360, 30e3, np.zeros(9)), noise[:9], atol=1e-6)


def test_noise_finer_than_a_pixel_is_left_out():
    lat = np.linspace(46.0, 46.2, 3000)
    lon = np.full(lat.size, 8.0)
    coarse = normal_noise(lat, lon, 30e3, np.full(lat.size, 40e3))
    assert not coarse.any()
    some = normal_noise(lat, lon, 30e3, np.full(lat.size, 10e3))
    assert 0 < np.abs(np.diff(some, 2)).max() < 0.2 * np.abs(np.diff(normal_noise(lat, lon, 30e3, 0 * lat), 2)).max()


def test_snow_albedo_by_age():
    """Fresh snow .9 and more in the visible (Wiscombe & Warren 1980), darker and redder with age, never negative."""
    days = np.array([0.0, 3.0, 10.0, 100.0])
    albedo = snow.snow_albedo([450.0, 550.0, 650.0], days)
    assert (albedo[0] > 0.9).all()
    assert (np.diff(albedo, axis=0) < 0).all()
    assert ((albedo > 0.5) & (albedo < 1)).all()
    assert (albedo[:, 2] < albedo[:, 0]).all()


def test_gaps_are_filled_from_near_by_and_edges_do_not_streak():
    values = np.zeros((32, 32))
    values[:, 31] = np.arange(32) % 2  # a stripe of single cells along the edge
    valid = np.ones((32, 32), bool)
    valid[10:20, 10:20] = False
    x, y = np.full(200, 31.0), np.linspace(4, 28, 200)
    at_edge, _ = filled(values, valid, x, y, np.zeros(200))
    far, known = filled(values, valid, x + 12, y, np.full(200, 12.0))
    assert np.ptp(at_edge) > 0.9
    assert np.ptp(far) < 0.3
    assert (known > 0.9).all()
    middle, known = filled(np.full((32, 32), 0.3), valid, np.array([15.0]), np.array([15.0]), np.zeros(1))
    assert known > 0.9
    assert middle == pytest.approx(0.3)
