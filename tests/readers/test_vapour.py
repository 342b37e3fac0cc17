"""The background's water vapour is that of the model's air."""

import numpy as np
import pytest

from openswim.readers.fields.air import with_vapour
from openswim.scene.atmosphere import Atmosphere


def test_mean_column_of_the_domain():
    """Exponential profiles of two amounts and a scale height of 2 km, over terrain of 0 and 1 km."""
    terrain = np.array([[0.0, 1000.0]])
    height = np.linspace(0.0, 16_000.0, 60)[:, None, None] + terrain
    vapour = np.array([[5e-3, 10e-3]]) * np.exp(-height / 2000.0)
    air = with_vapour(Atmosphere.us_standard(), height, vapour)
    at = np.array([1500.0, 3000.0, 6000.0])
    assert air.vapour_kg_m3_at(at) == pytest.approx(7.5e-3 * np.exp(-at / 2000.0), rel=0.01)
    assert air.vapour_kg_m3_at(500.0) == pytest.approx(5e-3 * np.exp(-0.25), rel=0.01)  # one column alone reaches down
    assert air.precipitable_water_cm(1000.0) == pytest.approx(0.1 * 7.5e-3 * 2000 * np.exp(-0.5), rel=0.02)


def test_above_a_low_top_is_the_standards():
    height = np.linspace(0.0, 4000.0, 20)
    vapour = np.broadcast_to(8e-3 * np.exp(-height / 2000.0)[:, None, None], (20, 3, 3))
    air, standard = with_vapour(Atmosphere.us_standard(), height, vapour), Atmosphere.us_standard()
    assert air.vapour_kg_m3_at(9000.0) == pytest.approx(standard.vapour_kg_m3_at(9000.0), rel=1e-6)


def test_it_is_kept_in_files():
    air = with_vapour(Atmosphere.us_standard(), np.array([0.0, 5e3]), np.full((2, 2, 2), 2e-3))
    assert Atmosphere.from_dict(air.to_dict()).vapour_kg_m3 == pytest.approx(air.vapour_kg_m3)
