"""Values around a place are given back where they were given, and are linear in between, all around."""

import numpy as np
import pytest

from openswim.scene.around import Around, directions_around
from openswim.scene.frame import Frame, azimuth_altitude, horizon_vector

ALTITUDE = np.array([-5.0, 10.0, 90.0])


def test_between_directions_values_are_linear_also_across_the_north():
    axes = Frame(6.371e6, 40.0, 10.0).enu(43.0, 14.0)
    values = np.random.default_rng(1).random((3, 8, 2))
    around = Around(values, ALTITUDE, axes)
    assert around.toward(directions_around(ALTITUDE[:2], 8, axes).reshape(-1, 3)) == pytest.approx(
        values[:2].reshape(-1, 2), abs=1e-9
    )
    north_west = 0.75 * values[0, 7] + 0.25 * values[0, 0]
    low, middle = around.toward(horizon_vector(326.25, [-40.0, 2.5]) @ axes)
    assert low == pytest.approx(north_west)
    assert middle == pytest.approx(0.5 * (north_west + 0.75 * values[1, 7] + 0.25 * values[1, 0]))


def test_angles_are_those_of_the_vector():
    for azimuth, altitude in ((0.0, 0.0), (200.0, -30.0), (359.0, 89.0)):
        assert azimuth_altitude(horizon_vector(azimuth, altitude)) == pytest.approx((azimuth, altitude))
