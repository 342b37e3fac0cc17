"""The standard atmosphere against the standard's own numbers and the AFGL profile."""

import json
import os
from pathlib import Path

import numpy as np
import pytest

from openswim.errors import UserError
from openswim.optics.aerosol import aerosol_profile
from openswim.scene.aerosol import AerosolProfile
from openswim.scene.atmosphere import Atmosphere, us_standard_pressure_temperature

SHARED = Path(os.environ.get("OPENSWIM_SHARED", Path(__file__).parents[3] / "shared"))


@pytest.mark.parametrize(
    ("height_m", "pressure_pa", "temperature_k"),
    # US Standard Atmosphere 1976, Table I.
    [
        (0, 101325, 288.150),
        (5000, 54048, 255.676),
        (11000, 22700, 216.774),
        (20000, 5529.3, 216.650),
        (32000, 889.06, 228.490),
        (50000, 79.779, 270.650),
        (70000, 5.2209, 219.585),
    ],
)
def test_standard_tables(height_m, pressure_pa, temperature_k):
    pressure, temperature = us_standard_pressure_temperature(height_m)
    assert pressure == pytest.approx(pressure_pa, rel=3e-4)
    assert temperature == pytest.approx(temperature_k, abs=0.01)


def test_agrees_with_afgl():
    path = SHARED / "data" / "optics" / "afglus.dat"
    if not path.exists():
        pytest.skip(f"no {path}")
    z_km, p_hpa, t_k, _, o3_per_cm3 = np.loadtxt(path)[:, :5].T
    atmosphere = Atmosphere.us_standard(ozone_du=300.0)
    low = z_km <= 80
    pressure, temperature, ozone = atmosphere.at(z_km * 1e3)
    np.testing.assert_allclose(pressure[low], p_hpa[low] * 100, rtol=0.01)
    np.testing.assert_allclose(temperature[low], t_k[low], atol=0.2)
    up_to_100 = z_km <= 100
    np.testing.assert_allclose(pressure[up_to_100], p_hpa[up_to_100] * 100, rtol=0.01)
    # AFGL rounds the standard's ozone; both scaled to the same column.
    order = np.argsort(z_km)
    column_du = np.trapezoid(o3_per_cm3[order] * 1e6, z_km[order] * 1e3) / 2.6868e20
    bulk = (z_km >= 5) & (z_km <= 50)
    np.testing.assert_allclose(ozone[bulk], (o3_per_cm3 * 1e6 * 300 / column_du)[bulk], rtol=0.12)
    peak_m = atmosphere.height_m[np.argmax(atmosphere.ozone_per_m3)]
    assert abs(peak_m / 1e3 - z_km[np.argmax(o3_per_cm3)]) <= 1.0


def test_ozone_column_is_what_was_asked():
    assert Atmosphere.us_standard(ozone_du=275.0).ozone_column_du() == pytest.approx(275.0, rel=1e-6)


def test_hydrostatic_balance():
    """dp/dz = -rho g, apart from how p is made."""
    atmosphere = Atmosphere.us_standard()
    z = np.arange(250.0, 85_000, 500.0)
    pressure, temperature, _ = atmosphere.at(z)
    above, below = atmosphere.at(z + 50)[0], atmosphere.at(z - 50)[0]
    gravity = 9.80665 * (6356766 / (6356766 + z)) ** 2
    density = pressure * 0.0289644 / (8.31432 * temperature)
    np.testing.assert_allclose((below - above) / 100, density * gravity, rtol=0.01)


def test_gas_ends_at_the_top_and_goes_on_below_sea_level():
    pressure, _, ozone = Atmosphere.us_standard().at([-430.0, 0.0, 100_001.0])
    assert pressure[0] == pytest.approx(106_600, rel=0.003)  # Dead Sea
    assert pressure[2] == ozone[2] == 0


def test_aerosol_profile():
    profile = AerosolProfile(optical_depth=0.2, scale_height_m=2000, base_height_m=1500)
    z = np.arange(1500.0, 30_001, 10)
    column = np.trapezoid(profile.extinction_per_m(z, [550.0, 450.0]), z, axis=1)
    np.testing.assert_allclose(column, [0.2, 0.2 * (450 / 550) ** -1.3], rtol=1e-4)
    low, base, high = profile.extinction_per_m([0.0, 1500.0, 3500.0], 550.0)[0]
    assert low == base
    assert high == pytest.approx(base / np.e)
    assert (profile.extinction_per_m([30_001.0], 550.0) == 0).all()


def test_saves_as_json():
    atmosphere = Atmosphere.us_standard(aerosol=aerosol_profile("colorado_dust", optical_depth=0.3))
    again = Atmosphere.from_dict(json.loads(json.dumps(atmosphere.to_dict())))
    assert again.aerosol == atmosphere.aerosol
    np.testing.assert_array_equal(again.pressure_pa, atmosphere.pressure_pa)


@pytest.mark.parametrize(
    "bad",
    [
        {"optical_depth": -0.1}, {"optical_depth": np.nan}, {"scale_height_m": 0.0}, {"scale_height_m": np.inf},
        {"base_height_m": 4e4}, {"base_height_m": -np.inf}, {"angstrom_exponent": None}, {"angstrom_exponent": np.nan},
        {"single_scattering_albedo": {}}, {"single_scattering_albedo": 3.0}, {"single_scattering_albedo": {550.0: 3.0}},
        {"single_scattering_albedo": {0.55: 0.9}}, {"phase": {}}, {"phase": {550.0: 0.7}}, {"phase": 0.7},
        {"reference_nm": -550.0}, {"reference_nm": 0.55},
    ],
)
def test_refuses_nonsense_aerosol(bad):
    with pytest.raises(UserError, match=f"aerosol {next(iter(bad))}"):
        AerosolProfile(**bad)


def test_refuses_unsorted_heights():
    with pytest.raises(UserError, match="ascending"):
        Atmosphere(np.array([0.0, 0.0]), np.ones(2), np.ones(2), np.ones(2))


def test_aerosol_of_another_depth_keeps_each_layers_share() -> None:
    low, high = AerosolProfile(0.06, angstrom_exponent=1.3), AerosolProfile(0.02, angstrom_exponent=0.0)
    air = Atmosphere.us_standard(aerosol=[low, high]).with_aerosol_depth(0.4, 450.0)
    one, other = (float(layer.optical_depth_at(450.0)) for layer in air.layers)
    assert float(air.aerosol_depth_at(450.0)) == pytest.approx(0.4)
    assert one / other == pytest.approx(3.0 * (550 / 450) ** 1.3)
    bare = Atmosphere.us_standard(aerosol=None).with_aerosol_depth(0.1)
    assert float(bare.aerosol_depth_at(550.0)) == pytest.approx(0.1)
