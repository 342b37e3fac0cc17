"""Layers as a whole: the two streams, Eqs 24 and 30-31."""

import numpy as np
import pytest

from openswim.transport.swim.layer import (
    absorbed_transmittance,
    diffuse_albedo,
    layer_albedo,
    multiple_scattering_albedo,
    two_stream,
)

TAU = np.geomspace(0.01, 200.0, 30)
MU0 = np.array([0.05, 0.2, 0.5, 0.8, 1.0])


@pytest.mark.parametrize("g", [0.0, 0.65, 0.85, 0.95])
def test_what_is_not_absorbed_is_reflected_or_let_through(g: float) -> None:
    reflected, transmitted = two_stream(1.0, g, TAU[:, None], MU0)
    np.testing.assert_allclose(reflected + transmitted, 1.0, atol=2e-3)


@pytest.mark.parametrize(
    ("tau", "zenith", "reflected", "transmitted"),
    # g = .85, omega = 1 and .95 over black ground, DISORT with 128 streams: up and down over mu0
    [(10.0, 0.0, (0.4223, 0.1818), (0.5777, 0.2526)), (10.0, 60.0, (0.6040, 0.3188), (0.3960, 0.1379))],
)
def test_two_streams_against_disort(
    tau: float, zenith: float, reflected: tuple[float, float], transmitted: tuple[float, float]
) -> None:
    for n, omega in enumerate((1.0, 0.95)):
        r, t = two_stream(omega, 0.85, tau, np.cos(np.radians(zenith)))
        assert float(r) == pytest.approx(reflected[n], abs=0.05)
        assert float(t) == pytest.approx(transmitted[n], abs=0.05)


@pytest.mark.parametrize("omega", [0.8, 0.95])
@pytest.mark.parametrize("mu0", [0.3, 1.0])
def test_thin_layers_lose_the_single_scattering_albedo(omega: float, mu0: float) -> None:
    """Eq. 31 becomes Eq. 30."""
    assert float(multiple_scattering_albedo(omega, 0.6, 1e-4, mu0)) == pytest.approx(omega, rel=2e-3)


def test_absorption_only_takes_away_and_more_where_light_scatters_more_often() -> None:
    for loss in (multiple_scattering_albedo, absorbed_transmittance):
        values = loss(np.array([0.86, 0.92, 0.98, 1.0])[:, None], 0.64, TAU, 0.6)
        assert (values <= 1 + 1e-9).all()
        assert (values >= 0).all()
        assert (np.diff(values, axis=0) >= -1e-9).all()
        assert (np.diff(values, axis=1) <= 1e-6).all()
        np.testing.assert_allclose(values[-1], 1.0, rtol=1e-9)


@pytest.mark.parametrize("omega", [0.92, 0.96])
def test_thick_dust_and_smoke_reflect_a_third_to_a_half(omega: float) -> None:
    """Sect. 3.5.4: a tends to between about .3 and .5."""
    for mu0 in (0.5, 1.0):
        tau = 50.0
        a = multiple_scattering_albedo(omega, 0.63, tau, mu0) * layer_albedo(np.array(0.125 * tau / mu0))
        assert 0.25 < float(a) < 0.6


def test_albedo_of_clouds_by_hand() -> None:
    np.testing.assert_allclose(layer_albedo(np.array([0.06, 6.0])), [0.06 / 1.06, 6 / 7])  # Eq. 24, b = .06
    assert float(diffuse_albedo(np.array(2.0))) == pytest.approx(0.75)
