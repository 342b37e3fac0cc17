"""Means of maps over what pixels cover that look along the ground."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from openswim.ground.footprints import LongFootprints

F64 = NDArray[np.float64]


def _stripes(lat: F64, lon: F64, round_m: F64) -> tuple[F64, F64]:
    """A map of white stripes, 2 of every 10 degrees, averaged over so many; nothing is known north of 45 degrees."""
    ends = lon + np.array([[-0.5], [0.5]]) * round_m
    low, high = 2 * (ends // 10.0) + np.minimum(ends % 10.0, 2.0)
    return np.stack([(high - low) / round_m, np.full(lon.shape, 0.3)], axis=-1), (lat < 45.0).astype(float)


def _long(length: float, toward: tuple[float, float], n: int) -> LongFootprints:
    half = [np.full(n, 0.5 * length * share) for share in toward]
    return LongFootprints(*half, np.ones(n), np.full(n, length))


@pytest.mark.parametrize(("length", "bound"), [(43.0, 0.18), (71.0, 0.1), (90.0, 0.022)])
def test_stripes_across_the_view_become_even_grey(length: float, bound: float) -> None:
    lon = np.linspace(60.0, 80.0, 201)
    long = _long(length, (0.0, 1.0), lon.size)
    values, known = long.mean(_stripes, 0 * lon, lon, np.full(lon.size, length**0.5))
    assert np.abs(values[:, 0] - 0.2).max() < bound  # those seen from above: .8
    assert values[:, 0].mean() == pytest.approx(0.2, abs=0.01)
    np.testing.assert_allclose(values[:, 1], 0.3)
    np.testing.assert_array_equal(known, 1.0)


def test_what_is_seen_from_above_is_seen_as_before() -> None:
    lon = np.linspace(0.0, 30.0, 61)
    round_m = np.full(lon.size, 1.2)
    found = _long(1.5, (0.0, 1.0), lon.size).mean(_stripes, 0 * lon, lon, round_m)
    for one, other in zip(found, _stripes(0 * lon, lon, round_m), strict=True):
        np.testing.assert_array_equal(one, other)


def test_beyond_a_maps_edge_less_is_known() -> None:
    lat = np.array([0.0, 43.0, 45.0, 60.0])
    _, known = _long(20.0, (1.0, 0.0), 4).mean(_stripes, lat, 0 * lat, np.ones(4))
    np.testing.assert_allclose(known, [1.0, 0.625, 0.5, 0.0])
