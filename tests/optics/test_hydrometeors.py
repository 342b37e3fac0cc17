"""Extinction of cloud and precipitation against hand-made numbers and measured relations."""

import os
from pathlib import Path

import numpy as np
import pytest
import xarray as xr
from hypothesis import given
from hypothesis import strategies as st

from openswim.errors import UserError
from openswim.optics.hydrometeors import (
    HYDROMETEORS,
    default_effective_radius_m,
    effective_radius_from_number_m,
    extinction_per_m,
    phase_function,
    single_scattering_albedo,
)

SHARED = Path(os.environ.get("OPENSWIM_SHARED", Path(__file__).parents[3] / "shared"))
CONTENT = st.one_of(st.just(0.0), st.floats(1e-20, 0.05))


@pytest.mark.parametrize(
    ("kind", "content", "radius", "extinction"),
    [
        ("liquid", 1e-3, 11e-6, 1.5e-3 / (11e-6 * 1000)),
        ("ice", 1.66e-6, 34e-6, 1.5 * 1.66e-6 / (34e-6 * 917)),
        ("rain", 1e-3, 750e-6, 2e-3),
        ("snow", 1e-3, 4e-3, 1.5e-3 / (4e-3 * 70)),
        ("graupel", 1e-3, 10e-3, 3e-4),
    ],
)
def test_defaults_of_the_errata(kind, content, radius, extinction):
    assert default_effective_radius_m(kind, content) == pytest.approx(radius)
    assert extinction_per_m(kind, content) == pytest.approx(extinction)


def test_own_radius_then_number_then_default():
    content = np.full(3, 1e-4)
    radius = np.array([20e-6, 0.0, np.nan])
    number = np.array([1e8, 1e8, 0.0])
    own = extinction_per_m("liquid", content, radius, number)
    assert own[0] == pytest.approx(1.5e-4 / (20e-6 * 1000))
    assert own[1] == extinction_per_m("liquid", 1e-4, None, 1e8)
    assert own[2] == extinction_per_m("liquid", 1e-4)


@pytest.mark.parametrize(("kind", "power"), [("rain", 0.0), ("liquid", 7.0)])
def test_number_against_a_size_distribution(kind, power):
    """Integrate n(r) = r^power exp(-r/b) directly: content, number and extinction 2 pi r^2 n."""
    scale = 300e-6 if kind == "rain" else 1e-6
    r = np.linspace(0, 40 * scale, 200_001)
    n = (r / scale) ** power * np.exp(-r / scale)
    number, volume, area = (np.trapezoid(n * f, r) for f in (1.0, 4 / 3 * np.pi * r**3, 2 * np.pi * r**2))
    per_m3 = 1e3 / number
    ours = extinction_per_m(kind, 1000 * volume * per_m3, number_per_m3=number * per_m3)
    assert ours == pytest.approx(area * per_m3, rel=0.01)


@given(
    st.sampled_from(list(HYDROMETEORS)),
    CONTENT,
    st.floats(0, 1e10),
    st.floats(0, 0.01),
)
def test_finite_and_not_negative(kind, content, number, radius):
    value = extinction_per_m(kind, content, radius, number)
    assert np.isfinite(value)
    assert value >= 0
    assert (value > 0) == (content > 0)


def test_negative_and_missing_content_is_none():
    assert not extinction_per_m("rain", np.array([-1e-6, np.nan, 0.0])).any()


def test_large_fields_stay_single_precision():
    content = np.full((2, 2), 1e-4, np.float32)
    for kind in HYDROMETEORS:
        assert extinction_per_m(kind, content, content * 0.1, content * 1e12).dtype == np.float32


def test_snow_of_known_size_like_measured_visibility():
    """Snow of .1 g/m3 lets one see 1-2 km (Koschmieder 3.9/beta), whatever the size the model says."""
    visibility_m = 3.9 / extinction_per_m("snow", np.full(2, 1e-4), np.array([200e-6, 800e-6]))
    assert ((visibility_m > 800) & (visibility_m < 2500)).all()


def test_no_radius_from_no_number():
    assert np.isnan(effective_radius_from_number_m("ice", [1e-5, 0.0], [0.0, 1e4])).all()


def test_droplets_against_ecrad_mie():
    """Mass extinction and asymmetry of the ecRad Mie tables at 550 nm."""
    path = SHARED / "data" / "optics" / "mie_droplet_scattering.nc"
    if not path.exists():
        pytest.skip(f"no {path}")
    with xr.open_dataset(path) as data:
        i = int(np.abs(data.wavelength.values - data.wavelength.dtype.type(550e-9)).argmin())
        row = data.isel(wavenumber=i).sel(effective_radius=[5e-6, 10e-6, 20e-6], method="nearest").load()
    ours = [float(extinction_per_m("liquid", 1e-3, r)) for r in row.effective_radius.values]
    np.testing.assert_allclose(ours, row.mass_extinction_coefficient.values * 1e-3, rtol=0.08)
    assert phase_function("liquid", 550.0).asymmetry == pytest.approx(
        float(row.asymmetry_factor[1]), abs=0.002
    )


def test_ice_against_baum_habit_mixture():
    path = SHARED / "data" / "optics" / "baum-general-habit-mixture_ice_scattering.nc"
    if not path.exists():
        pytest.skip(f"no {path}")
    with xr.open_dataset(path) as data:
        i = int(np.abs(data.wavelength.values - data.wavelength.dtype.type(550e-9)).argmin())
        rows = data.isel(wavenumber=i).sel(effective_radius=[5e-6, 15e-6, 35e-6, 60e-6], method="nearest").load()
    for radius, g in zip(rows.effective_radius.values, rows.asymmetry_factor.values, strict=True):
        assert phase_function("ice", 550.0, float(radius)).asymmetry == pytest.approx(float(g), abs=0.006)
    row = rows.isel(effective_radius=2)
    ours = float(extinction_per_m("ice", 1e-3, float(row.effective_radius)))
    assert ours == pytest.approx(float(row.mass_extinction_coefficient) * 1e-3, rel=0.12)


@pytest.mark.parametrize(
    ("kind", "low", "high"),
    # Josset et al. (2012): cirrus 33 +- 5; Pinnick et al. (1983), O'Connor et al. (2004): water clouds 18.5 +- 2
    [("ice", 28, 38), ("liquid", 16, 21)],
)
def test_lidar_ratios(kind, low, high):
    """Extinction over backscatter at 532 nm, sr."""
    assert low < 4 * np.pi / phase_function(kind, 532.0).value(-1.0) < high


def test_ice_has_no_bow():
    """Side and back are smooth and flat within a factor of three, as roughened crystals are (Baum et al. 2014)."""
    value = phase_function("ice", 550.0).value(np.cos(np.radians(np.arange(90, 176, 1.0))))
    assert value.max() < 3 * value.min()
    assert (np.diff(np.sign(np.diff(value))) != 0).sum() <= 1


def test_water_hardly_absorbs():
    for kind in HYDROMETEORS:
        albedo = single_scattering_albedo(kind, [450, 546, 615])
        assert albedo.shape == (3,)
        assert ((albedo > 0.9997) & (albedo <= 1)).all()


def test_unknown_kind():
    with pytest.raises(UserError, match="hail"):
        extinction_per_m("hail", 1e-3)
