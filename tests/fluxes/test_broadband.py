import csv

import numpy as np
import pytest

from openswim.fluxes import broadband, gases_above
from openswim.fluxes.gases import airmass, gas_transmittance, liquid_transmittance, ozone_optical_depth
from openswim.lights import SOLAR_CONSTANT_W_M2
from openswim.lights.spectrum import solar_bins
from openswim.scene.atmosphere import Atmosphere

THREE = np.array([615.0, 546.0, 450.0])
BODHAINE = np.array([0.0615, 0.0999, 0.2209])  # Rayleigh: Bodhaine et al. (1999)
CHAPPUIS = np.array([4.43e-21, 3.27e-21, 1.89e-22]) * 8.07e18  # ozone depth at THREE, 300 DU (cm2 x cm-2)


def clear_sky(altitude_deg, aod):
    """Direct transmittance and diffuse light over E_TOA: half of what air scatters, 70 % of haze's."""
    slant, sine = airmass(altitude_deg), np.sin(np.radians(altitude_deg))
    air, haze = BODHAINE * slant, aod * (550 / THREE) ** 1.3 * slant
    ozone = np.exp(-CHAPPUIS * slant)
    diffuse = (1 - np.exp(-air)) / 2 + 0.7 * np.exp(-1.5 * air) * (1 - np.exp(-haze))
    return np.exp(-air - haze) * ozone, sine * diffuse * ozone


@pytest.fixture
def grid(shared):
    """Four published clear-sky models (pvlib) over sun, aerosol, water vapour and height."""
    lines = (shared / "reference/clearsky/ghi_models_grid.csv").read_text().splitlines()
    return [{key: float(value) for key, value in row.items()} for row in csv.DictReader(lines)]


@pytest.mark.parametrize("sza", [0, 30, 50, 70])
def test_three_wavelengths_tell_the_integral_of_a_spectral_model(grid, sza):
    """Fed with SPECTRL2's own light at three wavelengths, we come to its own integral."""
    rows = [row for row in grid if row["sza"] == sza]
    assert len(rows) == 42
    cosine = np.cos(np.radians(sza))
    for row in rows:
        top, total, diffuse = (
            np.array([row[f"spectrl2_{kind}_{nm}"] for nm in (615, 546, 450)])
            for kind in ("ext", "glob", "dif")
        )
        found = broadband(
            (total - diffuse) / top / cosine,
            diffuse / top,
            THREE,
            90 - sza,
            water_vapour_cm=row["pw_cm"],
            pressure_pa=101_325 * np.exp(-row["elev_m"] / 8434),
        )
        assert found.global_horizontal == pytest.approx(row["spectrl2_ghi"], rel=0.03)
        # The reference prints its spectra to .01, some per cent of a dim beam.
        rounding = 0.015 / (total - diffuse).min()
        assert found.direct_normal == pytest.approx(row["spectrl2_dni"], rel=0.015 + rounding)


@pytest.mark.parametrize("aod", [0.02, 0.05, 0.1, 0.2])
@pytest.mark.parametrize("sza", [0, 30, 50, 70])
def test_a_simple_sky_lies_in_the_band_of_four_models(grid, sza, aod):
    direct, diffuse = clear_sky(90 - sza, aod)
    rows = [r for r in grid if r["sza"] == sza and r["aod550"] == aod and r["elev_m"] == 0]
    assert len(rows) == 3
    for row in rows:
        found = broadband(direct, diffuse, THREE, 90 - sza, water_vapour_cm=row["pw_cm"])
        assert 0.99 * row["band_lo"] < found.global_horizontal < 1.01 * row["band_hi"]


@pytest.mark.parametrize("sza", [0, 30, 60, 75])
def test_broadband_over_green_is_that_of_the_errata(sza):
    direct, diffuse = clear_sky(90 - sza, 0.05)
    found = broadband(direct, diffuse, THREE, 90 - sza, water_vapour_cm=1.5)
    green = direct[1] * np.cos(np.radians(sza)) + diffuse[1]
    assert 0.865 < found.global_horizontal / (SOLAR_CONSTANT_W_M2 * green) < 0.915


def test_without_an_atmosphere_the_suns_own_irradiance_comes_out():
    # No air, no gases; the integral ends at 280 and 4000 nm.
    found = broadband(
        np.ones(3),
        np.zeros(3),
        THREE,
        90.0,
        water_vapour_cm=0.0,
        ozone_du=0.0,
        pressure_pa=0.0,
        distance_au=2.0,
    )
    assert found.direct_normal == pytest.approx(0.9867 * SOLAR_CONSTANT_W_M2 / 4, rel=1e-3)
    assert found.diffuse_horizontal == 0
    assert found.global_horizontal == found.direct_horizontal


def test_parts_add_up_and_follow_the_suns_distance():
    direct, diffuse = clear_sky(40.0, 0.1)
    near = broadband(direct, diffuse, THREE, 40.0)
    far = broadband(direct, diffuse, THREE, 40.0, distance_au=1.0167)
    assert near.global_horizontal == pytest.approx(near.direct_horizontal + near.diffuse_horizontal)
    assert near.direct_horizontal == pytest.approx(near.direct_normal * np.sin(np.radians(40)))
    assert far.global_horizontal == pytest.approx(near.global_horizontal / 1.0167**2)


def test_water_vapour_takes_what_the_measured_rule_says():
    # Doubling the precipitable water from 1.5 cm costs about 2 % of the light: Lacis and Hansen (1974), their
    # absorptivity 2.9 y / ((1 + 141.5 y)^.635 + 5.925 y) of the solar constant.
    def absorptivity(y):
        return 2.9 * y / ((1 + 141.5 * y) ** 0.635 + 5.925 * y)

    direct, diffuse = clear_sky(90.0, 0.05)
    dry, moist = (
        broadband(direct, diffuse, THREE, 90.0, water_vapour_cm=w).global_horizontal for w in (1.5, 3.0)
    )
    lost = (dry - moist) / SOLAR_CONSTANT_W_M2
    assert lost == pytest.approx(absorptivity(3.0) - absorptivity(1.5), abs=0.01)


@pytest.mark.parametrize("altitude", [30.0, 60.0, 90.0])
def test_an_overcast_sky_has_a_larger_visible_share(altitude):
    # Measured: the visible share is 5-12 % larger under overcast (Jacovides et al. 2003 and others).
    direct, diffuse = clear_sky(altitude, 0.05)
    clear = broadband(direct, diffuse, THREE, altitude)
    sine = np.sin(np.radians(altitude))
    grey = broadband(np.zeros(3), np.full(3, 0.3 * sine), THREE, altitude)
    green = direct[1] * sine + diffuse[1]
    ratio = (clear.global_horizontal / green) / (grey.global_horizontal / (0.3 * sine))
    assert 1.05 < ratio < 1.12
    assert grey.direct_normal < 1e-6


def test_any_number_and_order_of_wavelengths():
    direct, diffuse = clear_sky(50.0, 0.1)
    three = broadband(direct, diffuse, THREE, 50.0)
    assert broadband(direct[::-1], diffuse[::-1], THREE[::-1], 50.0) == three
    one = broadband(direct[1:2], diffuse[1:2], THREE[1:2], 50.0)
    assert one.global_horizontal == pytest.approx(three.global_horizontal, rel=0.015)


@pytest.mark.parametrize("altitude", [-5.0, -0.1])
def test_twilight_has_no_beam_and_little_light(altitude):
    found = broadband(np.full(3, 1e-3), np.full(3, 1e-4), THREE, altitude)
    assert found.direct_normal == 0
    assert found.direct_horizontal == 0
    assert 0 < found.diffuse_horizontal < 1.0


def test_gases_absorb_where_they_should():
    nm = np.array([310.0, 550.0, 600.0, 760.0, 937.0, 1395.0, 2700.0])
    clear = gas_transmittance(nm, 1.0, 1.0, 0.0, 0.0)
    assert (clear[[0, 1, 2, 4]] == 1).all()
    moist = gas_transmittance(nm, 1.5, 1.0, 1.5, 0.3)
    assert moist[0] < 0.4  # ozone's ultraviolet edge
    assert 0.9 < moist[2] < 0.97  # Chappuis
    assert moist[4] < 0.6
    assert moist[5] < 0.1
    assert ozone_optical_depth(THREE, 0.3) == pytest.approx(CHAPPUIS, abs=0.008)
    assert liquid_transmittance(np.array([550.0, 1450.0])) == pytest.approx([1.0, 0.21], abs=0.01)


def test_airmass_is_that_of_the_table():
    # Kasten and Young (1989), Table II.
    assert airmass(90) == pytest.approx(1.0, abs=1e-3)
    assert airmass(30) == pytest.approx(1.9939, abs=2e-3)
    assert airmass(10) == pytest.approx(5.5841, abs=0.02)
    assert airmass(0) == pytest.approx(37.92, abs=0.1)
    assert airmass(-3) == airmass(0)


def test_solar_bins_cover_what_a_pyranometer_sees():
    edges, _ = solar_bins()
    assert edges[0] <= 285
    assert edges[-1] >= 2800


def test_gases_above_a_height_are_the_standards() -> None:
    """US Standard Atmosphere 1976: 540.5 hPa at 5 km, 25.49 hPa at 25 km; about half of the ozone is above 22 km."""
    air = Atmosphere.us_standard(ozone_du=300.0)
    ground, middle, high = (gases_above(air, height) for height in (0.0, 5000.0, 25_000.0))
    assert ground == pytest.approx({"water_vapour_cm": 1.42, "ozone_du": 300.0, "pressure_pa": 101_325.0}, rel=4e-3)
    assert middle["pressure_pa"] == pytest.approx(54_048.0, rel=2e-3)
    assert high["pressure_pa"] == pytest.approx(2549.2, rel=2e-3)
    assert gases_above(air, 22_000.0)["ozone_du"] == pytest.approx(150.0, rel=0.15)
    assert middle["ozone_du"] > 0.95 * ground["ozone_du"]
    assert not any(gases_above(None, 0.0).values())
