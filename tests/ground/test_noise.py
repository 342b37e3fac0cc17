"""Noise of places: normal, the same in every picture, honest about what is not seen; and shares laid out by it."""

import numpy as np
import pytest

from openswim.ground.noise import fractal_lumps, fractal_noise, fractal_slope, resolved_share


@pytest.mark.parametrize("fraction", [0.0, 0.05, 0.2, 0.5, 0.9, 1.0])
def test_cover_adds_up_to_the_fraction(fraction):
    """However it is spread, there is as much snow as the model has: the mean over a standard normal favour."""
    favour = np.random.default_rng(0).standard_normal(200_000)
    cover = resolved_share(np.full(favour.size, fraction), favour, np.zeros(1))
    assert cover.mean() == pytest.approx(fraction, abs=0.003)
    assert ((cover >= 0) & (cover <= 1)).all()
    assert (np.diff(cover[np.argsort(favour)]) >= 0).all()
    if 0.1 < fraction < 0.95:  # and it is mostly either there or not
        assert ((cover < 0.2) | (cover > 0.8)).mean() > 0.6


def test_noise_is_standard_normal_smooth_and_the_same_everywhere():
    rng = np.random.default_rng(1)
    lat, lon = np.degrees(np.arcsin(rng.uniform(-1, 1, 100_000))), rng.uniform(-180, 180, 100_000)
    noise = fractal_noise(lat, lon, 30e3, 0.0)[0]
    assert noise.mean() == pytest.approx(0, abs=0.02)
    assert noise.std() == pytest.approx(1, abs=0.03)
    np.testing.assert_allclose([(noise > q).mean() for q in (-1, 0, 1)], [0.841, 0.5, 0.159], atol=0.015)
    step = fractal_noise(lat + 1e-5, lon, 30e3, 0.0)[0] - noise
    assert np.abs(step).max() < 0.05  # a metre apart
    np.testing.assert_allclose(fractal_noise(lat[:9], lon[:9] + 360, 30e3, 0.0)[0], noise[:9], atol=1e-6)


def test_noise_finer_than_a_pixel_is_left_out():
    lat = np.linspace(46.0, 46.2, 3000)
    lon = np.full(lat.size, 8.0)
    coarse, unseen = fractal_noise(lat, lon, 30e3, 40e3)
    assert not coarse.any()
    assert (unseen == 1).all()
    (some, unseen), (every, nothing) = (fractal_noise(lat, lon, 30e3, shortest) for shortest in (10e3, 0.0))
    assert 0 < np.abs(np.diff(some, 2)).max() < 0.2 * np.abs(np.diff(every, 2)).max()
    assert ((unseen > 0.1) & (unseen < 0.9)).all()
    np.testing.assert_allclose(nothing, 0, atol=1e-12)


def test_noise_has_the_variance_that_is_said_to_be_seen():
    """Wherever it begins and ends, and the same at a place whatever other places are asked with it."""
    rng = np.random.default_rng(2)
    lat, lon = np.degrees(np.arcsin(rng.uniform(-1, 1, 200_000))), rng.uniform(-180, 180, 200_000)
    longest, shortest = 10 ** rng.uniform(2, 4.5, lat.size), 10 ** rng.uniform(0, 4, lat.size)
    noise, unseen = fractal_noise(lat, lon, longest, shortest, power=0.6)
    for some in np.array_split(np.argsort(unseen), 8):
        assert noise[some].mean() == pytest.approx(0, abs=0.03)
        assert noise[some].var() == pytest.approx(1 - unseen[some].mean(), abs=0.03)
    alone = [fractal_noise(lat[n : n + 1], lon[n : n + 1], longest[n], shortest[n], power=0.6)[0] for n in range(20)]
    np.testing.assert_allclose(np.concatenate(alone), noise[:20], atol=1e-5)


@pytest.mark.parametrize("fraction", [0.0, 0.03, 0.3, 0.8, 1.0])
def test_a_share_is_kept_whatever_is_seen_of_where_it_lies(fraction):
    rng = np.random.default_rng(3)
    for unseen in (0.0, 0.3, 0.9, 1.0):
        favour = np.sqrt(1 - unseen) * rng.standard_normal(200_000)
        share = resolved_share(np.full(favour.size, fraction), favour, np.full(favour.size, unseen))
        assert share.mean() == pytest.approx(fraction, abs=0.003)
        if unseen == 1 or fraction in (0, 1):
            np.testing.assert_allclose(share, fraction, atol=1e-9)


def northward(lat, lon):
    """Unit vectors (n, 3) in Earth-centred axes."""
    la, lo = np.radians(lat), np.radians(lon)
    return np.stack([-np.sin(la) * np.cos(lo), -np.sin(la) * np.sin(lo), np.cos(la)], axis=-1)


def test_slopes_are_of_ridges():
    """One octave: the slope is that of -|noise|, worked out from heights on either side."""
    rng = np.random.default_rng(5)
    lat, lon = 45 + rng.uniform(0, 0.5, 20_000), 5 + rng.uniform(0, 0.5, 20_000)
    along = northward(lat, lon)
    slope, unseen = fractal_slope(lat, lon, along, 4096.0, 0.0, 1, 0.0)
    step = np.degrees(0.2 * 4096.0 / 6_371_000.0)
    high, low = (-np.abs(fractal_noise(lat + way, lon, 4096.0, 0.0, 1)[0]) for way in (step, -step))
    assert np.corrcoef(slope, high - low)[0, 1] > 0.99
    assert slope.std() == pytest.approx(1, abs=0.05)
    np.testing.assert_allclose(unseen, 0, atol=1e-12)


def test_lumps_and_series():
    """Lumps are |noise| of their series: mean 0, variance 1, narrow and dark between; series are strangers."""
    rng = np.random.default_rng(6)
    lat, lon = 45 + rng.uniform(0, 2, 100_000), 5 + rng.uniform(0, 2, 100_000)
    one, other = (fractal_noise(lat, lon, 64.0, 0.0, 3, 0.0, series)[0] for series in (0, 1))
    assert abs(np.corrcoef(one, other)[0, 1]) < 0.01
    lumps = fractal_lumps(lat, lon, 64.0, 0.0, 1, 0.0, 1)
    assert (lumps.mean(), lumps.std()) == pytest.approx((0, 1), abs=0.03)
    single = fractal_noise(lat, lon, 64.0, 0.0, 1, 0.0, 1)[0]
    assert np.corrcoef(np.abs(single), lumps)[0, 1] > 0.999
    assert lumps.min() == pytest.approx(-np.sqrt(2 / np.pi) / np.sqrt(1 - 2 / np.pi), abs=0.01)
