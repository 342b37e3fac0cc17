"""Degrees of freedom for signal against the dense matrix."""

from __future__ import annotations

import numpy as np
import pytest
from tests.assimilation.toy import cloud, flat_scene, toy_core

from openswim import UserError
from openswim.assimilation import Background, analyse, observe
from openswim.assimilation.background import Space
from openswim.assimilation.cost import Cost
from openswim.assimilation.signal import _filtered, signal

POINTS = [(100.0 + 100.0 * j, 100.0 + 100.0 * i) for j in range(4) for i in range(5)]


def test_pyranometers_tell_of_columns_and_hardly_of_heights() -> None:
    scene = flat_scene(cloud())
    op = observe(scene, (), POINTS, sun=(140.0, 50.0), controls="extinction_cloud", core=toy_core(scene, [], POINTS))
    seen = op(op.first())
    observed = op.observations([], op.irradiance_w_m2(seen), irradiance_noise=0.03)
    space = Space(op, op.first(), Background(length_m=70.0))
    cost, v = Cost.of(op, space, observed), np.zeros(space.size)
    rows = np.stack([
        space.adjoint(v, cost.linearized(v).vjp(cost.weight[n] * np.eye(op.size)[n])) for n in range(op.size)
    ])  # fmt: skip
    value = np.linalg.eigvalsh(rows @ rows.T)
    want = float((value / (1 + value)).sum())
    z = np.random.default_rng(1).standard_normal(space.size)
    exact = rows.T @ np.linalg.solve(np.eye(op.size) + rows @ rows.T, rows @ z)
    assert _filtered(cost, v, z, steps=25) == pytest.approx(exact, abs=1e-8 * np.abs(exact).max())
    columns, heights = signal(cost, v, probes=30)
    assert columns.told + heights.told == pytest.approx(want, rel=0.1)
    assert 5 < want < len(POINTS)
    # 12.6 of 80 and 5.6 of 560: light goes by a column's sum, but cloud is thicker at some heights than at others
    assert columns.told / columns.numbers > 12 * heights.told / heights.numbers
    assert columns.numbers + heights.numbers == space.size
    found = analyse(op, observed, background=Background(length_m=70.0), iterations=2, signal=1)
    assert [each.name for each in found.told] == ["extinction_cloud, columns", "extinction_cloud, heights"]
    with pytest.raises(UserError, match="number of probes"):
        analyse(op, observed, background=Background(length_m=70.0), signal=-1)
