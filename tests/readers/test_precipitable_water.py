"""The column of water vapour of levels."""

from __future__ import annotations

import numpy as np
import pytest

from openswim.readers.fields.air import precipitable_water_kg_m2


def test_a_column_that_thins_exponentially_has_its_integral() -> None:
    """rho H exp(-ground/H); levels below the ground do not count, and below the lowest level vapour is constant."""
    scale, height = 2000.0, np.arange(0.0, 20_001.0, 100.0)
    vapour = 0.010 * np.exp(-height / scale)[:, None, None] * np.ones((1, 1, 2))
    ground = np.array([[0.0, 850.0]])
    found = precipitable_water_kg_m2(vapour, height, ground)
    np.testing.assert_allclose(found, 0.010 * scale * np.exp(-ground / scale), rtol=0.005)
    aloft = precipitable_water_kg_m2(vapour[5:], height[5:], np.zeros((1, 2)))
    below = 500 * vapour[5, 0, 0]
    assert float(aloft[0, 0]) == pytest.approx(below + 0.010 * scale * np.exp(-500 / scale), rel=0.005)
    # heights of each column by itself
    each = precipitable_water_kg_m2(vapour, height[:, None, None] + ground, ground)
    np.testing.assert_allclose(each, 0.010 * scale, rtol=0.005)
