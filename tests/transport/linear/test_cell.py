"""Slopes of every formula against differences of its value, and values against those that `fast` computes with."""

import itertools
import math

import numpy as np
import pytest
from numba import njit

from openswim.transport.diffuse.step import step_weights as step_weights_of_fast
from openswim.transport.linear import cell

DEPTHS = (1e-6, 1e-3, 0.019, 0.021, 0.3, 3.0, 30.0)
RATIOS = (0.0, 0.3, 1.0)


def _difference(value, at, n, h):
    """Fourth-order central difference of a function of several numbers by the n-th."""

    def moved(by):
        where = list(at)
        where[n] += by
        return np.array(value(*where))

    return (8 * (moved(h) - moved(-h)) - (moved(2 * h) - moved(-2 * h))) / (12 * h)


@pytest.mark.parametrize(("depth", "ratio"), list(itertools.product(DEPTHS, RATIOS)))
def test_slopes_of_a_step(depth, ratio):
    near, far, ds = 2 * depth * ratio / (1 + ratio) / 40, 2 * depth / (1 + ratio) / 40, 40.0
    slopes = np.array(cell.step_slopes.py_func(near, far, ds)).reshape(3, 2)
    h = 1e-3 * max(depth, 1e-2) / ds
    found = np.stack([_difference(cell.step_weights.py_func, (near, far, ds), n, h) for n in (0, 1)], axis=1)
    assert np.abs(found - slopes).max() < 1e-9 * np.abs(slopes).max()


@pytest.mark.parametrize("depth", [0.0, 1e-9, *DEPTHS, 43.9, 44.1, 200.0, 1e6])
def test_what_a_step_lets_through(depth):
    """Against the library's functions; beyond a depth of 44 there is no light that one could tell from none."""
    trans, mean = cell.through.py_func(depth)
    assert trans == pytest.approx(math.exp(-depth), rel=2e-14, abs=1e-19)
    assert mean == pytest.approx(-math.expm1(-depth) / depth if depth else 1.0, rel=2e-15, abs=0)


def test_the_slope_of_the_mean_meets_its_series():
    below, above = cell.SMALL * (1 - 1e-13), cell.SMALL * (1 + 1e-13)
    assert np.allclose(cell.through_slope.py_func(below), cell.through_slope.py_func(above), rtol=1e-12, atol=0)


@pytest.mark.parametrize("depth", [1e-4, 0.01, 0.2, 0.9, 4.0])
def test_slopes_of_a_peak(depth):
    row = np.exp(-np.linspace(0, 3, 32)) * (2 + np.sin(5 * np.linspace(0, 3, 32)))
    found = _difference(lambda d: cell.peak.py_func(row, d), (depth,), 0, 1e-5 * depth)
    assert found == pytest.approx(cell.peak_slope.py_func(row, depth), rel=1e-7)
    knot = 7 / 24  # depth at which depth/(1 + depth) = 7/31
    sides = [cell.peak_slope.py_func(row, knot * (1 + s)) for s in (-1e-9, 1e-9)]
    assert sides[0] == pytest.approx(sides[1], rel=1e-6)  # a straight line's would jump by 9 %
    assert cell.peak.py_func(row, knot) == pytest.approx(row[7], rel=1e-12)


def test_slopes_of_an_amendment():
    given = np.array([0.4, 0.7, 0.02, 0.03, 0.012, 0.006])
    both, ds = cell.trusted.py_func(0.012, 0.02, 40.0), 40.0
    a = cell.amendment.py_func(*given, both, ds)
    slopes = np.array([-(2 / ds + given[4]), 2 / ds, 1, 1, -given[0], -1]) / both
    found = [_difference(lambda *v: cell.amendment.py_func(*v, both, ds), given, n, 1e-4) for n in range(6)]
    assert np.allclose(found, slopes, rtol=1e-9)
    by_both = _difference(lambda b: cell.amendment.py_func(*given, b, ds), (both,), 0, 1e-6)
    assert by_both == pytest.approx(-a / both, rel=1e-8)


@pytest.mark.parametrize("depth", [0.0, 1e-3, 0.2, 1.5, 12.0, 90.0])
@pytest.mark.parametrize("asked", [-30.0, -1.3, -0.2, 0.0, 0.3, 2.1, 40.0])
def test_slopes_of_a_bend(depth, asked):
    """Where what is asked for is met, and where bounds hold it; the mean is half of the greatest rise."""
    given = (asked * max(depth, 1e-2), 0.5 * depth, depth**4 + 1e-9)
    slopes = cell.bend_slopes.py_func(*given)
    for n, size in enumerate((abs(given[0]) + given[2] ** 0.25, given[1] + 0.1, given[2])):
        found = _difference(cell.bend.py_func, given, n, 2e-4 * size)
        assert found == pytest.approx(slopes[n], rel=1e-7, abs=1e-9 / size), n


@pytest.mark.parametrize("bent", [-1.1, 0.0, 0.4, 7.0])
def test_slopes_of_the_beam(bent):
    beam, share = cell.beam_of.py_func(0.7, bent)
    by_root = _difference(lambda r: cell.beam_of.py_func(r, bent)[0], (0.7,), 0, 1e-3)
    by_bent = _difference(lambda b: cell.beam_of.py_func(0.7, b)[0], (bent,), 0, 1e-3)
    assert (by_root, by_bent) == pytest.approx((2 * 0.7 * share, -beam), rel=1e-9)


@njit
def _of_fast(near, far, ds):
    return step_weights_of_fast(near, far, ds)


@pytest.mark.parametrize(("depth", "ratio"), list(itertools.product(DEPTHS, RATIOS)))
def test_steps_are_those_of_fast(depth, ratio):
    """A formula that is changed in one of the two and not in the other is found here."""
    near, far, ds = 2 * depth * ratio / (1 + ratio) / 40, 2 * depth / (1 + ratio) / 40, 40.0
    theirs = np.array(_of_fast(*np.array([near, far, ds], np.float32)))
    own = np.array(cell.step_weights.py_func(near, far, ds))
    assert np.abs(theirs - own).max() < 4e-6 * np.abs(own).max()  # its own error, at depth .3
    assert abs(theirs[0] - own[0]) < 3e-6  # single precision: its transmission is e^-(tau/16) to the 16th
