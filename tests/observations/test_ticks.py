"""Axes have round numbers within their ranges."""

import numpy as np
import pytest

from openswim.observations.ticks import round_ticks


@pytest.mark.parametrize(
    ("low", "high", "expected"),
    [
        (0, 1, [0, 0.2, 0.4, 0.6, 0.8, 1]),
        (-0.2, 1, [0, 0.5, 1]),
        (0, 0.22, [0, 0.05, 0.1, 0.15, 0.2]),
        (0.0, 0.88, [0, 0.2, 0.4, 0.6, 0.8]),
        (2, 6, [2, 3, 4, 5, 6]),
        (-4.3, 4.3, [-4, -2, 0, 2, 4]),
    ],
)
def test_ticks_are_round(low: float, high: float, expected: list[float]) -> None:
    found = round_ticks(low, high)
    np.testing.assert_allclose(found, expected, atol=1e-12)
    assert not np.signbit(found[found == 0]).any()
