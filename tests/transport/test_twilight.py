"""Twilight between the suns for which the clear sky is solved: it falls evenly in the logarithm."""

import numpy as np
import pytest

from openswim.solver import Solver
from openswim.validation.clearsky import ClearSky


@pytest.mark.slow
def test_no_sun_stands_out():
    """The zenith at half a degree between solved suns, and where these are two degrees apart: bends, but no steps."""
    zenith = np.array([96.0, 96.5, 97.0, 102.0, 103.0, 104.0])
    light = np.array([
        ClearSky(Solver(), sun, 0.1, 0.1, np.array([546.0])).from_inside(0.0, [0.0], [0.0])[0, 0, 0] for sun in zenith
    ])  # fmt: skip
    assert (np.diff(light) < 0).all()
    for a, b, c in (light[:3], light[3:]):
        assert b / np.sqrt(a * c) == pytest.approx(1.0, abs=0.08)
