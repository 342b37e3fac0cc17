"""Functions of one step and one place against closed forms and brute force."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from openswim.transport.engine import scalar

F = np.float32
STEP_M = F(100.0)


def emission(depth: float, near: float, far: float, skew: float = 0.0) -> float:
    """step_emission over 100 m whose extinction falls from (1 + skew) to (1 - skew) of its mean."""
    mean = depth / float(STEP_M)
    ends = F(mean * (1 + skew)), F(mean * (1 - skew))
    return float(scalar.step_emission(F(depth), F(np.exp(-depth)), STEP_M, F(near), F(far), *ends))


def brute_force(depth: float, near: float, far: float, skew: float) -> float:
    """The same integral by quadrature: extinction and source linear along the step."""
    s = (np.arange(200_000) + 0.5) / 200_000
    passed = depth * ((1 + skew) * s - skew * s**2)
    return float(STEP_M) * float(np.mean((near + (far - near) * s) * np.exp(-passed)))


def test_transmission_is_the_exponential() -> None:
    depth = np.concatenate([np.linspace(0, 40, 4001), np.geomspace(1e-6, 1.0, 200)]).astype(F)
    ours = np.array([scalar.transmission(d) for d in depth])
    true = np.exp(-depth.astype(float))
    assert np.abs(ours - true).max() < 3e-7  # the errors its docstring promises
    assert np.abs(ours / true - 1).max() < 5e-6  # measured 3.8e-6: the last digit of the depth
    assert ours[0] == 1.0
    less = np.linspace(-3, 0, 301).astype(F)
    assert np.abs([scalar.transmission(d) / np.exp(-float(d)) - 1 for d in less]).max() < 5e-4


@pytest.mark.parametrize("depth", [100.0, 1e4, 1e7])
def test_transmission_of_a_wall_is_nothing(depth: float) -> None:
    assert 0.0 <= float(scalar.transmission(F(depth))) < 1e-9


@settings(max_examples=200, deadline=None)
@given(depth=st.floats(1e-6, 60.0), function=st.floats(0.01, 10.0), skew=st.floats(-0.99, 0.99))
def test_emission_of_a_constant_source_function_is_exact(depth: float, function: float, skew: float) -> None:
    # S = J beta with the same J at both ends: J (1 - e^-tau), however beta varies
    mean = depth / float(STEP_M)
    near, far = function * mean * (1 + skew), function * mean * (1 - skew)
    # float32: (1 - t)/tau keeps 1e-7/.01 of its digits just above the switch to the series
    assert emission(depth, near, far, skew) == pytest.approx(-function * math.expm1(-depth), rel=3e-5)


@pytest.mark.parametrize(("near", "far"), [(1.0, 1.0), (2.0, 0.5), (0.0, 1.0)])
def test_emission_of_a_thin_step_is_the_mean_source(near: float, far: float) -> None:
    assert emission(1e-5, near, far) == pytest.approx(0.5 * (near + far) * float(STEP_M), rel=2e-5)


@pytest.mark.parametrize(("near", "far"), [(1.0, 1.0), (2.0, 0.5), (0.5, 1.0)])
def test_emission_of_a_thick_step_is_the_source_function_at_its_near_end(near: float, far: float) -> None:
    depth = 5000.0
    # what lies one mean free path (1/5000 of the step) further in is all that can differ
    assert emission(depth, near, far) == pytest.approx(near / (depth / float(STEP_M)), rel=2e-3)


@pytest.mark.parametrize("depth", [0.003, 0.1, 0.25, 0.5])
@pytest.mark.parametrize(("near", "far", "skew"), [(1.0, 0.2, 0.0), (0.2, 1.0, 0.5), (1.0, 0.0, -0.5)])
def test_emission_between_the_limits(depth: float, near: float, far: float, skew: float) -> None:
    # an error of second order in the depth; rays march in depths of .25, where it is below .5 %
    exact = brute_force(depth, near, far, skew)
    assert emission(depth, near, far, skew) == pytest.approx(exact, rel=0.06 * depth**2 + 1e-4)


@pytest.mark.parametrize("radius_m", [6.371e6, 1e12])
def test_height_over_a_sphere_loses_no_digits(radius_m: float) -> None:
    assert scalar.height_m(0.0, 0.0, 1234.5, radius_m) == pytest.approx(1234.5, abs=1e-6)
    far = 50_000.0
    sagitta = far**2 / (2 * radius_m) * (1 - far**2 / (4 * radius_m**2))
    assert scalar.height_m(far, 0.0, 0.0, radius_m) == pytest.approx(sagitta, abs=1e-5)


def test_setting_sun_loses_the_area_behind_the_horizon() -> None:
    x, y = np.meshgrid(np.linspace(-1, 1, 1001), np.linspace(-1, 1, 1001))
    disc = x**2 + y**2 <= 1
    radius = 0.00465
    for offset in (-1.2, -0.6, 0.0, 0.3, 0.9, 1.5):
        seen = (disc & (y > -offset)).sum() / disc.sum()
        assert scalar.shadow_fraction(offset * radius, 0.0, radius) == pytest.approx(seen, abs=2e-3)


def test_table_index_inverts_uneven_nodes() -> None:
    nodes = np.array([0.0, 1.0, 4.0, 10.0])
    table = np.interp(np.linspace(0, 10, 101), nodes, np.arange(4.0))
    assert scalar.table_index(2.5, 0.0, 10.0, table) == pytest.approx(1.5)
    assert scalar.table_index(-3.0, 0.0, 10.0, table) == 0.0
    assert scalar.table_index(11.0, 0.0, 10.0, table) == 3.0


def test_smoothstep_joins_smoothly() -> None:
    assert [scalar.smoothstep(v) for v in (-1.0, 0.0, 0.5, 1.0, 2.0)] == [0.0, 0.0, 0.5, 1.0, 1.0]
    slope = (scalar.smoothstep(1e-4) - scalar.smoothstep(0.0)) / 1e-4
    assert slope < 1e-3


def test_symmetric_harmonics_are_the_full_ones_off_the_plane_of_the_sun() -> None:
    mu, azimuth = 0.3, 1.1
    sine = math.sqrt(1 - mu**2)
    full, even = np.empty(25), np.empty(15)
    scalar.harmonics(sine * math.cos(azimuth), sine * math.sin(azimuth), mu, 5, full)
    scalar.harmonics_symmetric(mu, math.cos(azimuth), 5, even)
    for ell in range(5):
        for m in range(ell + 1):
            assert even[ell * (ell + 1) // 2 + m] == pytest.approx(full[ell * ell + ell + m], abs=1e-12)
