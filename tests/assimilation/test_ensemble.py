"""The ensemble filter: against the Kalman filter where that is exact, and on a twin."""

from __future__ import annotations

import numpy as np
import pytest
from tests.assimilation.test_analysing import BELIEF, error, twin

from openswim import UserError
from openswim.assimilation.ensemble import _mixed, _nearness, _segments, ensemble_filter, ensemble_of


def test_without_localisation_it_is_the_kalman_filter() -> None:
    rng = np.random.default_rng(0)
    states, h = rng.standard_normal((30, 8)), rng.standard_normal((5, 8))  # members, and a linear operator
    y, sigma = rng.standard_normal(5), np.array([0.5, 1.0, 0.7, 2.0, 0.3])
    seen = states @ h.T
    mean = states.mean(axis=0)
    changes, departure = (seen - seen.mean(axis=0)) / sigma, (y - seen.mean(axis=0)) / sigma
    after = _mixed(changes, departure, np.ones(5), 1.0).T @ states
    p = np.cov(states.T)
    gain = p @ h.T @ np.linalg.inv(h @ p @ h.T + np.diag(sigma**2))
    assert np.allclose(after.mean(axis=0), mean + gain @ (y - h @ mean), atol=1e-12)
    assert np.allclose(np.cov(after.T), (np.eye(8) - gain @ h) @ p, atol=1e-12)


def test_what_is_far_counts_nothing() -> None:
    ends = np.array([[[0.0, 0.0], [100.0, 0.0]], [[50.0, 100.0], [50.0, 100.0]], [[50.0, 400.0], [60.0, 500.0]]])
    near = _nearness(np.array([50.0, 0.0]), ends, 100.0)
    assert near[0] == 1
    assert near[1] == pytest.approx(5 / 24, rel=1e-9)  # Gaspari and Cohn (1999), Eq. 4.10 at one length
    assert near[2] == 0


def test_rays_are_where_they_pass_through_the_cloud() -> None:
    op, _, _ = twin()
    ends = _segments(op)
    assert ends.shape == (op.size, 2, 2)
    camera = op.instruments[0].camera
    up = np.argmax(camera.pixels().altitude_deg[op.instruments[0].inside])
    assert np.allclose(ends[up], [camera.x_m, camera.y_m], atol=1.0)
    toward = op.daylight.direction[:2] / op.daylight.direction[2]
    heights = np.asarray(op.scene.grid.height_m)[op.controls.where.any(axis=(1, 2))]
    assert np.allclose(ends[-1, 1] - ends[-1, 0], toward * np.ptp(heights), rtol=1e-9)


def test_a_twin_comes_nearer() -> None:
    op, observed, truth = twin()
    states = ensemble_of(op, BELIEF, 40)
    after = ensemble_filter(op, observed.assign(error=5 * observed["error"]), states, length_m=120.0)
    mean = op.first()
    for name in mean:
        mean[name] = sum(state[name] for state in after) / len(after)
    before = sum(state["extinction_cloud"] for state in states) / len(states)
    assert error(mean, truth) < 0.75 * error(mean.assign(extinction_cloud=before), truth)  # .62
    misfits = [float(np.mean(((op.ensemble(group).mean("member") - observed["value"]) / observed["error"])
                             .values[observed["use"].values] ** 2)) for group in (states, after)]  # fmt: skip
    assert misfits[1] < 0.145 * misfits[0]  # .115
    assert (after[0]["extinction_cloud"].values[op.controls.where] > 0).all()
    with pytest.raises(UserError, match="three members"):
        ensemble_filter(op, observed, states[:2], 100.0)
    with pytest.raises(UserError, match="positive"):
        ensemble_filter(op, observed, states, -1.0)
    with pytest.raises(UserError, match="not a row"):
        ensemble_filter(op, observed.isel(observation=slice(0, 3)), states, 100.0)
    with pytest.raises(UserError, match="1 or more"):
        ensemble_of(op, BELIEF, 0)
