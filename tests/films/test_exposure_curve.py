"""One smooth exposure for a film: slow where nothing calls for more, near what each frame wants."""

import numpy as np
import pytest
from numpy.typing import NDArray

from openswim.colour.exposure import SUN_CURVE
from openswim.films.exposure import exposure_curve, slow, taut


def test_exposure_changes_so_slowly_that_nobody_notices() -> None:
    """Down through clouds in a few seconds: in all directions, a tenth of a stop a second is the most."""
    rng = np.random.default_rng(2)
    wanted = np.interp(np.arange(750), [0, 100, 130, 600, 620, 749], [0.3, 0.3, 0.9, 0.9, 0.5, 0.5])
    wanted *= np.exp(0.05 * rng.standard_normal(750))
    curve = np.log2(exposure_curve(wanted, 25.0))
    slope = 25.0 * np.diff(curve)
    assert np.abs(slope).max() <= 0.1 + 1e-9
    assert np.abs(25.0 * np.diff(slope)).max() < 0.3  # stops/s2: no kinks
    assert np.abs(curve - np.log2(wanted)).max() < 1.0
    np.testing.assert_allclose(exposure_curve(np.full(7, 0.4), 25.0), 0.4)
    np.testing.assert_allclose(exposure_curve([0.4], 25.0), 0.4)


def test_exposure_does_not_fall_with_what_passes_by() -> None:
    """Marks of a runway fill the picture's foot in one frame of five, which then wants a third of the light."""
    wanted = np.full(750, 1.5)
    wanted[500::5] = 0.5
    curve = np.log2(exposure_curve(wanted, 25.0))
    assert 25.0 * np.abs(np.diff(curve)).max() <= 0.1 + 1e-9
    assert np.log2(1.5) - curve[-1] < 0.01  # they are no part of what most of the frames want
    assert np.abs(np.diff(curve, 2)).max() < 0.001


@pytest.mark.parametrize("minutes", [1.0, 5.0, 15.0])
def test_exposure_follows_a_twilight(minutes: float) -> None:
    """A day, 23 stops from noon to midnight, in a minute of the film or in four seconds: each frame stays within about
    one of what it wants, and by day the exposure is as slow as ever."""
    hour = (np.arange(0.0, 1440.0, minutes) - 720.0) / 720.0 * np.pi
    altitude = np.degrees(np.arcsin(0.7 * np.cos(hour) + 0.05))
    wanted = np.interp(altitude, *np.transpose([(a, np.log2(e)) for a, e in SUN_CURVE]))
    curve = np.log2(exposure_curve(2.0**wanted, 25.0))
    assert np.abs(curve - wanted).max() < 1.25
    assert np.abs(np.diff(curve)).max() < np.abs(np.diff(wanted)).max() + 1e-9
    if minutes == 1.0:
        assert np.abs(curve - wanted).max() < 1.0 + 1e-9
        assert 25.0 * np.abs(np.diff(curve[altitude > 25])).max() < 0.1 + 1e-9


def test_exposure_follows_a_dusk_that_fills_a_short_film() -> None:
    """15 stops in a second: each frame within the one that it may be off."""
    wanted = np.linspace(1.0, 16.0, 24)
    curve = np.log2(exposure_curve(2.0**wanted, 25.0))
    assert np.abs(curve - wanted).max() < 1.05


@pytest.mark.parametrize("roughness", [0.1, 0.5, 3.0])
def test_exposure_changes_no_more_than_it_must(roughness: float) -> None:
    """A taut string has the least variation and steepness, a slow curve the least error: by linear programmes."""
    from scipy.optimize import linprog

    n, rate = 60, 0.3
    curve = np.cumsum(roughness * np.random.default_rng(5).standard_normal(n))
    step, one, no = np.diff(np.eye(n), axis=0), np.ones((n - 1, 1)), np.zeros((n - 1, 1))

    def least(cost: NDArray, rows: list[NDArray], most: NDArray, bounds: list) -> float:
        return float(linprog(cost, np.concatenate(rows), most, bounds=bounds).fun)

    tube = [(v - 0.7, v + 0.7) for v in curve]
    path = taut(curve - 0.7, curve + 0.7)
    assert np.abs(path - curve).max() <= 0.7 + 1e-9
    last = np.append(np.zeros(n), 1.0)
    steepest = least(last, [np.hstack([step, -one]), np.hstack([-step, -one])], np.zeros(2 * n - 2), [*tube, (0, None)])
    assert np.abs(np.diff(path)).max() == pytest.approx(steepest, abs=1e-7)
    each, sums = np.eye(n - 1), np.append(np.zeros(n), np.ones(n - 1))
    rows, bounds = [np.hstack([step, -each]), np.hstack([-step, -each])], [*tube, *[(0, None)] * (n - 1)]
    variation = least(sums, rows, np.zeros(2 * n - 2), bounds)
    assert np.abs(np.diff(path)).sum() == pytest.approx(variation, abs=1e-7)
    found, off = slow(curve, np.full(n - 1, rate)), -np.ones((n, 1))
    rows = [np.hstack(pair) for pair in ((step, no), (-step, no), (np.eye(n), off), (-np.eye(n), off))]
    most = np.concatenate([np.full(2 * n - 2, rate), curve, -curve])
    assert np.abs(np.diff(found)).max() <= rate + 1e-9
    assert np.abs(found - curve).max() == pytest.approx(least(last, rows, most, [(None, None)] * (n + 1)), abs=1e-7)
