"""The fit of the paper's double Henyey-Greenstein function."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from openswim.optics.aerosol import double_hg
from openswim.optics.fit import fit_double_hg
from openswim.scene.phase import HenyeyGreenstein, TablePhase


@settings(max_examples=40, deadline=None)
@given(st.floats(0.8, 0.97), st.floats(0.05, 0.6), st.floats(0.1, 0.9), st.floats(0.05, 1.0))
def test_recovers_a_known_one(sharp_g, broad_g, sharp_fraction, f_b):
    found = fit_double_hg(double_hg(sharp_g, broad_g, sharp_fraction, f_b))
    np.testing.assert_allclose(
        [found.sharp_g, found.broad_g, found.sharp_fraction, found.f_b],
        [sharp_g, broad_g, sharp_fraction, f_b],
        atol=2e-3,
    )
    assert found.error < 1e-3


def test_a_single_lobe_needs_no_second():
    found = fit_double_hg(HenyeyGreenstein(0.65))
    mu = np.linspace(-1, 1, 50)
    np.testing.assert_allclose(found.phase.value(mu), HenyeyGreenstein(0.65).value(mu), rtol=1e-3)


def test_error_is_the_distance_in_the_logarithm():
    """A bow of 30 % between 130 and 150 degrees cannot be followed: the error is the bow's own share or less."""
    angle = np.linspace(0, 180, 721)
    smooth = double_hg(0.9, 0.3, 0.5, 0.3).value(np.cos(np.radians(angle)))
    bow = TablePhase(angle, smooth * np.where((angle > 130) & (angle < 150), 1.3, 1.0))
    found = fit_double_hg(bow)
    assert 0.03 < found.error < np.log(1.3) * np.sqrt(20 / 180) + 0.01
    assert found.asymmetry == pytest.approx(bow.asymmetry)
    assert abs(found.asymmetry_error) < 0.005
    assert found.phase.asymmetry == pytest.approx(found.asymmetry + found.asymmetry_error, abs=1e-9)
