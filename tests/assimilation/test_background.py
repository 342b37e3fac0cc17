"""Filters, transforms, and the space in which an analysis is made."""

from __future__ import annotations

import numpy as np
import pytest
from tests.assimilation.toy import flat_scene, toy_core

from openswim import Camera, UserError
from openswim.assimilation import Background, observe
from openswim.assimilation.background import Space
from openswim.assimilation.filters import Filter, axis_filter
from openswim.assimilation.transforms import Transform

UNEVEN = np.cumsum(np.linspace(30.0, 90.0, 24))


@pytest.mark.parametrize("kind", ["gaussian", "diffusion"])
@pytest.mark.parametrize("places", [40.0 * np.arange(25), UNEVEN])
def test_a_filter_squares_to_a_correlation(kind: str, places: np.ndarray) -> None:
    length = 120.0
    each = axis_filter(places, length, kind)
    n = places.size
    root = each.apply(np.eye(n), 0) / each.norm[:, None]
    assert np.allclose(each.transpose(np.eye(n), 0), each.apply(np.eye(n), 0).T, atol=1e-14)
    square = root @ root.T
    assert np.allclose(np.diag(square), 1.0, rtol=1e-12)
    middle = n // 2
    at = np.interp(places[middle] + length, places[middle:], square[middle, middle:])
    assert at == pytest.approx(np.exp(-0.5), abs=0.03)


def test_a_filter_of_three_axes_and_its_transpose() -> None:
    rng = np.random.default_rng(0)
    each = Filter.of([UNEVEN[:6], 50.0 * np.arange(7), 50.0 * np.arange(8)], [100.0, 80.0, 80.0], "gaussian")
    a, b = rng.standard_normal((2, 6, 7, 8))
    assert float((each.apply(a) * b).sum()) == pytest.approx(float((a * each.transpose(b)).sum()), rel=1e-12)
    draws = np.stack([each.apply(rng.standard_normal(a.shape)) for _ in range(400)])
    assert draws.std(axis=0).mean() == pytest.approx(1.0, abs=0.013)


@pytest.mark.parametrize("name", ["softplus", "sqrt", "log", "linear"])
def test_transforms_go_back_and_have_their_slope(name: str) -> None:
    each = Transform(name, 0.02, 1e-3, 0.02)
    x = np.linspace(0.2, 20.0, 50) if name != "log" else np.linspace(-3, 3, 50)
    assert np.allclose(each.back(each.value(x)), x, rtol=1e-6)
    step = 1e-6
    slope = (each.value(x + step) - each.value(x - step)) / (2 * step)
    assert np.allclose(each.slope(x), slope, rtol=1e-5)
    if name != "linear":
        assert each.value(np.array([-50.0])) >= 0.02


def space(**background: object) -> Space:
    scene, cameras = flat_scene(), [Camera.allsky(x_m=200.0, y_m=260.0, size=7)]
    op = observe(scene, cameras, sun=(140.0, 50.0), controls=("extinction_cloud", "albedo", "scale"),
                 core=toy_core(scene, cameras))  # fmt: skip
    return Space(op, op.first(), Background(**{"length_m": 80.0, **background}))


def test_the_space_of_an_analysis() -> None:
    each, rng = space(), np.random.default_rng(0)
    v, change = rng.standard_normal((2, each.size))
    first = each.state(np.zeros(each.size))
    cloud, guess = first["extinction_cloud"].values, each.first["extinction_cloud"].values
    where = each.rows.controls.where
    assert np.allclose(cloud[where], np.maximum(guess[where], 2e-5), rtol=2e-3)  # the floor at least
    assert np.array_equal(cloud[~where], guess[~where])
    tangent, step = each.tangent(v, change), 1e-6
    up, low = each.state(v + step * change), each.state(v - step * change)
    for name in tangent:
        assert np.allclose((up[name] - low[name]) / (2 * step), tangent[name], rtol=1e-4, atol=1e-9)
    bars = tangent.copy(data={name: rng.standard_normal(field.shape) for name, field in tangent.items()})
    left = sum(float((tangent[name] * bars[name]).sum()) for name in tangent)
    assert left == pytest.approx(float(change @ each.adjoint(v, bars)), rel=1e-12)


def test_spreads_and_lengths_by_control() -> None:
    each = space(length_m={"extinction_cloud": 60.0, "albedo": 500.0, "scale": 1.0}, spread={"albedo": 0.2})
    assert [p.spread for p in each.pieces] == [8.0, 0.2, 0.05]
    with pytest.raises(UserError, match="names no surface_albedo"):
        _ = space(length_m={"extinction_cloud": 60.0}).pieces
    with pytest.raises(UserError, match="positive"):
        Background(length_m=-1.0)
    with pytest.raises(UserError, match="filter"):
        Background(length_m=1.0, filter="box")


@pytest.mark.parametrize("kind", ["gaussian", "diffusion"])
def test_errors_may_be_alike_without_end(kind: str) -> None:
    """A Gaussian of such a width would have more nodes than memory holds."""
    place = 50.0 * np.arange(9)
    root = Filter.of([place], [1e300], kind)
    alike = np.stack([root.apply(each) for each in np.eye(9)], axis=1)
    assert np.allclose(alike @ alike.T, 1, atol=1e-3)


def test_light_is_not_solved_to_less_than_rounding() -> None:
    with pytest.raises(UserError, match="tolerance = 1e-300"):
        observe(flat_scene(), Camera.allsky(x_m=200.0, y_m=250.0, size=9), sun=(150, 50), tolerance=1e-300)
