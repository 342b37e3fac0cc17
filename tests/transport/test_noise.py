"""Noise that belongs to places: no more and no less than its statistics promise."""

import numpy as np
import pytest

from openswim.transport.medium.noise import Octave

RADIUS_M = 6.371e6


def places(count: int = 20_000, seed: int = 1) -> np.ndarray:
    """Points anywhere on the Earth."""
    p = np.random.default_rng(seed).standard_normal((count, 3))
    return RADIUS_M * p / np.linalg.norm(p, axis=1, keepdims=True)


@pytest.mark.parametrize("spacing_m", [1000.0, 16_000.0, 128_000.0])
def test_mean_and_variance(spacing_m: float) -> None:
    for height in (0.0, 1100.0, 9000.0):
        field = Octave(places(), spacing_m, 4000.0).at(height)
        assert abs(field.mean()) < 0.03  # four standard errors of 20 000 independent values
        assert field.var() == pytest.approx(1.0, abs=0.04)


def test_a_place_has_its_value_whoever_asks() -> None:
    everywhere = places(300)
    some = everywhere[40:90]
    field = Octave(everywhere, 2000.0, 2000.0).at(700.0)
    np.testing.assert_array_equal(field[40:90], Octave(some, 2000.0, 2000.0).at(700.0))


def test_it_is_smooth_at_once_and_forgotten_farther_off() -> None:
    here = places()
    field = Octave(here, 8000.0, 4000.0).at(500.0)
    for distance, low, high in ((800.0, 0.97, 1.0), (40_000.0, -0.03, 0.03)):
        step = np.cross(here, np.roll(here, 1, axis=0))
        step *= distance / np.linalg.norm(step, axis=1, keepdims=True)
        assert low < np.corrcoef(field, Octave(here + step, 8000.0, 4000.0).at(500.0))[0, 1] < high


def test_wide_lumps_are_drawn_out_and_small_ones_are_not() -> None:
    """How much the directions of edges agree within a few lumps (coherence of the structure tensor)."""
    from scipy.ndimage import gaussian_filter

    def agreement(spacing_m: float) -> float:
        axis = spacing_m / 8 * np.arange(400)
        y, x = np.meshgrid(axis, axis, indexing="ij")
        here = np.stack([x.ravel(), y.ravel(), np.full(x.size, RADIUS_M)], axis=-1)
        gy, gx = np.gradient(Octave(here, spacing_m, 4000.0).at(500.0).reshape(x.shape))
        xx, yy, xy = (gaussian_filter(v, 12.0) for v in (gx * gx, gy * gy, gx * gy))
        return float((np.hypot(xx - yy, 2 * xy) / (xx + yy)).mean())

    small, wide = (np.mean([agreement(spacing * f) for f in (1.0, 0.97, 1.03)]) for spacing in (2000.0, 64_000.0))
    assert small < 0.25
    assert wide > 1.4 * small


def test_height_is_forgotten_over_its_scale() -> None:
    octave = Octave(places(), 8000.0, 4000.0)
    field = octave.at(0.0)
    assert np.mean(field * octave.at(400.0)) > 0.95
    assert abs(np.mean(field * octave.at(4000.0))) < 0.03
    assert abs(np.mean(field * octave.at(6500.0))) < 0.03


def test_octaves_know_nothing_of_each_other() -> None:
    fields = [Octave(places(), size, 4000.0).at(500.0) for size in (2000.0, 4000.0, 8000.0)]
    assert np.abs(np.corrcoef(fields) - np.eye(3)).max() < 0.03
