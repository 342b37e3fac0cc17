"""The ensemble filter: against the Kalman filter where that is exact, and on a twin."""

from __future__ import annotations

import numpy as np
import pytest
import xarray as xr
from tests.assimilation.test_analysing import BELIEF, error, twin

from openswim import UserError
from openswim.assimilation.ensemble import _mixed, _nearness, _relaxed, _segments, ensemble_filter, ensemble_of


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


@pytest.mark.parametrize(("inflation", "share"), [(1.0, 0.0), (1.3, 0.0), (1.0, 0.6), (1.3, 0.6), (1.0, 1.0)])
def test_inflation_and_relaxation_of_one_number(inflation: float, share: float) -> None:
    """Its variance after is 1/(1/(inflation b^2) + 1/r^2); its spread is drawn to b by a share of what is lost."""
    x = np.random.default_rng(1).standard_normal(12)
    b, r, y = x.std(ddof=1), 0.8, 1.7
    mixed = _mixed((x - x.mean())[:, None] / r, np.array([y - x.mean()]) / r, np.ones(1), inflation).T @ x
    after = _relaxed(x, mixed, share)
    variance = 1 / (1 / (inflation * b**2) + 1 / r**2)
    assert after.mean() == pytest.approx(x.mean() + variance / r**2 * (y - x.mean()), rel=1e-12)
    assert after.std(ddof=1) == pytest.approx((1 - share) * np.sqrt(variance) + share * b, rel=1e-12)
    unseen = _mixed((x - x.mean())[:, None] / r, np.array([9.0]), np.zeros(1), inflation).T @ x
    assert np.allclose(unseen, x.mean() + np.sqrt(inflation) * (x - x.mean()), rtol=1e-12)
    assert np.allclose(_relaxed(x, unseen, 1.0), x, rtol=1e-12)
    assert (_relaxed(np.ones(4), np.ones(4), 0.5) == 1).all()


def test_the_filter_relaxes_to_the_spread_before() -> None:
    op, observed, _ = twin()
    states = ensemble_of(op, BELIEF, 5)
    seen = op.ensemble(states)
    found = {share: ensemble_filter(op, observed, states, 120.0, 1.0, seen=seen, relaxation=share)
             for share in (0.0, 0.5, 1.0)}  # fmt: skip
    albedo = {share: np.stack([each["surface_albedo"] for each in after]) for share, after in found.items()}
    before = np.stack([each["surface_albedo"] for each in states])
    spread = {share: values.std(axis=0) for share, values in albedo.items()}
    assert spread[0.0].mean() < 0.9 * before.std(axis=0).mean()
    assert np.allclose(spread[0.5], 0.5 * (spread[0.0] + before.std(axis=0)), rtol=1e-9)
    assert np.allclose(spread[1.0], before.std(axis=0), rtol=1e-9)
    assert np.allclose(albedo[1.0].mean(axis=0), albedo[0.0].mean(axis=0), rtol=1e-9)
    plain = ensemble_filter(op, observed, states, 120.0, 1.0, seen=seen.values.tolist(), relaxation=0.5)
    assert all(one.equals(other) for one, other in zip(plain, found[0.5], strict=True))
    for wrong in ("much", seen.values[:, 1:], np.full(seen.shape, np.nan)):
        with pytest.raises(UserError, match=r"ensemble_filter: seen (must be numbers|has shape|must be finite)"):
            ensemble_filter(op, observed, states, 100.0, seen=wrong)
    for wrong in (-0.1, 1.5, np.nan, "much"):
        with pytest.raises(UserError, match="relaxation must be"):
            ensemble_filter(op, observed, states, 100.0, seen=seen, relaxation=wrong)  # type: ignore[arg-type]


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


def test_members_may_be_one_dataset() -> None:
    """What ensembles in files are, and what `op.ensemble` gives."""
    op, observed, _ = twin()
    states = ensemble_of(op, BELIEF, 3)
    together = xr.concat(states, "member")
    seen = op.ensemble(states)
    np.testing.assert_array_equal(op.ensemble(together), seen)
    one, other = (ensemble_filter(op, observed, each, 120.0, seen=seen) for each in (iter(states), together))
    for mine, theirs in zip(one, other, strict=True):
        xr.testing.assert_equal(mine, theirs)
    for wrong in (states[0], None):
        with pytest.raises(UserError, match="give a list of states, or one Dataset along member"):
            ensemble_filter(op, observed, wrong, 120.0)  # type: ignore[arg-type]
    with pytest.raises(UserError, match="a single state"):
        op.ensemble(states[0])
