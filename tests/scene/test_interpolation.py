"""Bilinear interpolation against fields that it must give exactly."""

import numpy as np
import pytest

from openswim.scene.interpolation import corners


@pytest.mark.parametrize("shape", [(2, 2), (5, 7), (1, 3)])
def test_a_saddle_is_exact_and_the_edge_holds(shape):
    """a + b x + c y + d x y is what bilinear interpolation is made of."""
    rng = np.random.default_rng(1)
    y, x = np.mgrid[: shape[0], : shape[1]]
    a, b, c, d = rng.normal(size=4)
    field = a + b * x + c * y + d * x * y
    ix, iy = rng.uniform(-2, shape[1] + 1, 500), rng.uniform(-2, shape[0] + 1, 500)
    ix[:3], iy[:3] = (0, shape[1] - 1, shape[1] - 1), (0, shape[0] - 1, 0)
    rows, columns, weights = corners(ix, iy, shape)
    u, v = np.clip(ix, 0, shape[1] - 1), np.clip(iy, 0, shape[0] - 1)
    np.testing.assert_allclose((field[rows, columns] * weights).sum(axis=0), a + b * u + c * v + d * u * v, atol=1e-12)
    np.testing.assert_allclose(weights.sum(axis=0), 1.0, atol=1e-14)
    assert weights.min() >= 0


def test_columns_close_in_a_circle():
    field = np.array([[0.0, 1.0, 2.0, 3.0]])
    rows, columns, weights = corners(np.array([3.25, -0.75, 7.5, 0.5]), np.zeros(4), (1, 4), all_round=True)
    np.testing.assert_allclose((field[rows, columns] * weights).sum(axis=0), [2.25, 2.25, 1.5, 0.5])
