"""Rayleigh scattering and ozone against published numbers."""

import os
from pathlib import Path

import numpy as np
import pytest

from openswim.optics.ozone import ozone_cross_section_m2
from openswim.optics.rayleigh import (
    depolarisation_factor,
    king_factor,
    rayleigh_cross_section_m2,
    rayleigh_scattering_per_m,
)
from openswim.optics.species import background
from openswim.scene.aerosol import AerosolProfile
from openswim.scene.atmosphere import Atmosphere

SHARED = Path(os.environ.get("OPENSWIM_SHARED", Path(__file__).parents[3] / "shared"))


def test_rayleigh_optical_depth():
    """.2209/.0999/.0615 at 1013.25 hPa (Bodhaine et al. 1999)."""
    height = np.arange(0.0, 100_001, 100)
    air = background(Atmosphere.us_standard(aerosol=None), [450, 546, 615], height)
    depth = np.trapezoid(air.rayleigh_per_m, height, axis=1)
    np.testing.assert_allclose(depth, [0.2209, 0.0999, 0.0615], rtol=0.003)


@pytest.mark.parametrize("wavelength_nm", [300.0, 400.0, 550.0, 700.0])
def test_bodhaine_fit(wavelength_nm):
    """Against their rational fit (Eq. 29; 360 ppm CO2, 1e-28 cm2), made from the paper's own full
    calculation."""
    square = (wavelength_nm / 1e3) ** 2
    fit = (1.0455996 - 341.29061 / square - 0.90230850 * square) / (
        1 + 0.0027059889 / square - 85.968563 * square
    )
    assert rayleigh_cross_section_m2(wavelength_nm, co2_ppm=360.0) * 1e4 == pytest.approx(
        fit * 1e-28, rel=2e-4
    )


def test_king_factor_and_depolarisation():
    assert king_factor(550.0) == pytest.approx(1.0484, abs=5e-4)
    rho = depolarisation_factor(550.0)
    assert (6 + 3 * rho) / (6 - 7 * rho) == pytest.approx(king_factor(550.0))


def test_scattering_scales_with_number_density():
    one = rayleigh_scattering_per_m([500.0], 1e5, 300.0)
    np.testing.assert_allclose(
        rayleigh_scattering_per_m([500.0], [5e4, 1e5], [300.0, 150.0]), one * [[0.5, 2]]
    )


def test_ozone_cross_section():
    np.testing.assert_allclose(
        ozone_cross_section_m2([450, 546, 615]), np.array([1.89e-22, 3.27e-21, 4.43e-21]) * 1e-4, rtol=0.005
    )
    assert ozone_cross_section_m2(250.0) == ozone_cross_section_m2(900.0) == 0
    assert (ozone_cross_section_m2(np.arange(280, 801)) > 0).all()
    assert 590 < np.arange(450, 700)[np.argmax(ozone_cross_section_m2(np.arange(450, 700)))] < 610


def test_huggins_band_against_paur_and_bass():
    path = SHARED / "data" / "optics" / "crs_o3_pab.dat"
    if not path.exists():
        pytest.skip(f"no {path}")
    wavelength, c0, c1, c2 = np.loadtxt(path)[:, :4].T
    celsius = 228 - 273.15
    measured = (c0 + c1 * celsius + c2 * celsius**2) * 1e-24
    for centre in np.arange(285, 336, 5):
        band = np.abs(wavelength - centre) < 2.5
        ours = ozone_cross_section_m2(wavelength[band]).mean()
        assert ours == pytest.approx(measured[band].mean(), rel=0.05)


def test_background_optical_depths():
    height = np.arange(0.0, 100_001, 100)
    air = background(Atmosphere.us_standard(300.0, AerosolProfile(0.1)), [550.0, 615.0], height)
    np.testing.assert_allclose(np.trapezoid(air.aerosol_per_m, height, axis=1)[0], 0.1, rtol=1e-3)
    np.testing.assert_allclose(
        np.trapezoid(air.absorption_per_m, height, axis=1)[1], 300 * 2.6868e20 * 4.43e-25, rtol=0.005
    )
    assert [p.asymmetry for p in air.aerosol_phase] == [0.65, 0.65]
    np.testing.assert_array_equal(air.aerosol_albedo, 0.95)


def test_vacuum():
    air = background(None, [550.0], [0.0, 1e4])
    for coefficient in (air.rayleigh_per_m, air.absorption_per_m, air.aerosol_per_m):
        assert not coefficient.any()
