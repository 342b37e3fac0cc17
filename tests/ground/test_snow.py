"""Snow: how bright it is; gaps of fields filled."""

import numpy as np
import pytest

from openswim.ground import snow
from openswim.ground.fields import Filled


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
    at_edge, _ = Filled(values, valid).at(x, y, np.zeros(200))
    far, known = Filled(values, valid).at(x + 12, y, np.full(200, 12.0))
    assert np.ptp(at_edge) > 0.9
    assert np.ptp(far) < 0.3
    assert (known > 0.9).all()
    middle, known = Filled(np.full((32, 32), 0.3), valid).at(np.array([15.0]), np.array([15.0]), np.zeros(1))
    assert known > 0.9
    assert middle == pytest.approx(0.3)
