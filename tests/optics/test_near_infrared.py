"""Droplets and ice beyond 700 nm against independent tables and limits."""

import os
from pathlib import Path

import numpy as np
import pytest
import xarray as xr

from openswim.optics import hydrometeors, ice

SHARED = Path(os.environ.get("OPENSWIM_SHARED", Path(__file__).parents[3] / "shared"))
WAVELENGTHS_NM = [860.0, 1240.0, 1370.0, 1450.0, 1610.0, 1640.0, 1700.0]


def reference(name):
    path = SHARED / "data" / "optics" / f"{name}.nc"
    if not path.exists():
        pytest.skip(f"no {path}")
    return xr.open_dataset(path)


@pytest.mark.parametrize("radius_um", [5.0, 10.0, 20.0])
def test_droplets_against_another_mie_code(radius_um):
    """ecRad's droplets: another index of water (10 % of absorption apart in the windows) and twice the variance."""
    table = reference("mie_droplet_scattering")
    for wavelength in WAVELENGTHS_NM:
        one = table.interp(wavenumber=1e7 / wavelength, effective_radius=radius_um * 1e-6)
        albedo = hydrometeors.single_scattering_albedo("liquid", wavelength, radius_um * 1e-6)[0]
        assert 1 - albedo == pytest.approx(1 - float(one.single_scattering_albedo), rel=0.12, abs=2e-5)
        phase = hydrometeors.phase_function("liquid", wavelength, radius_um * 1e-6)
        assert phase.asymmetry == pytest.approx(float(one.asymmetry_factor), abs=0.009)
        assert phase.value(np.cos(np.radians(140.0))) > 0


@pytest.mark.parametrize("radius_um", [7.5, 25.0, 50.0])
def test_ice_between_the_radii_of_the_table(radius_um):
    table = reference("baum-general-habit-mixture_ice_scattering")
    for wavelength in WAVELENGTHS_NM:
        one = table.interp(wavenumber=1e7 / wavelength, effective_radius=radius_um * 1e-6)
        albedo = hydrometeors.single_scattering_albedo("ice", wavelength, radius_um * 1e-6)[0]
        # the table has four digits
        assert 1 - albedo == pytest.approx(1 - float(one.single_scattering_albedo), rel=0.05, abs=6e-5)
        phase = hydrometeors.phase_function("ice", wavelength, radius_um * 1e-6)
        assert phase.asymmetry == pytest.approx(float(one.asymmetry_factor), abs=0.007)


def test_large_ice_ends_opaque_and_meets_the_table():
    below, above = (ice.coalbedo([1240.0, 1610.0], r) for r in (59.99e-6, 60.01e-6))
    assert below == pytest.approx(above, rel=1e-3)
    assert ice.coalbedo([1500.0], 20e-3)[0] == pytest.approx(0.47, abs=1e-3)
    # weak absorption is proportional to the way through ice
    assert ice.coalbedo([860.0], 600e-6)[0] == pytest.approx(10 * ice.coalbedo([860.0], 60e-6)[0], rel=0.02)


def test_visible_ice_absorbs_nothing():
    for kind in ("ice", "snow", "graupel"):
        assert (hydrometeors.single_scattering_albedo(kind, [400.0, 550.0, 699.0]) == 1).all()
    assert hydrometeors.phase_function("ice", 450.0) == hydrometeors.phase_function("ice", 699.0)
