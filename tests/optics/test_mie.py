"""The shipped Mie tables against an independent Mie code and the optics of bows."""

import csv
import os
from pathlib import Path

import numpy as np
import pytest
import xarray as xr

from openswim.errors import UserError
from openswim.optics import mie

SHARED = Path(os.environ.get("OPENSWIM_SHARED", Path(__file__).parents[3] / "shared"))


def test_droplets_against_reference():
    path = SHARED / "reference" / "clearsky" / "mie_phase.csv"
    if not path.exists():
        pytest.skip(f"no {path}")
    pytest.importorskip("miepython")
    from openswim.optics.spheres import gamma_sizes, scattering_by_spheres

    with path.open() as file:
        rows = [(r["scat_angle_deg"], r["P"]) for r in csv.DictReader(file) if r["case"] == "cloud_r10_546"]
    angle, reference = np.array(rows, float).T[:, ::4]
    sizes = gamma_sizes(10.0, 0.1, 3.0, 30.0, 700)
    mu = np.cos(np.radians(angle))
    # with the reference's own index of water, sharply at the front; ours is 1.3352, which moves bow and glory a little
    same = scattering_by_spheres(sizes, 1.3335 - 1.9e-9j, 546.0, angle).value / reference
    assert np.abs(same - 1)[angle <= 10].max() < 0.01
    table = mie.phase_function("liquid", 546.0)
    ours = scattering_by_spheres(sizes, 1.33525 - 2.4e-9j, 546.0, angle).value
    assert np.abs(table.value(mu) / ours - 1)[angle <= 10].max() < 0.01
    ratio = table.value(mu) / reference
    assert np.abs(ratio - 1)[(angle > 10) & (angle < 125)].max() < 0.15
    assert np.sqrt(np.mean((ratio - 1)[angle > 10] ** 2)) < 0.05
    assert table.asymmetry == pytest.approx(0.8633, abs=6e-4)


def bow_angle(kind, wavelength_nm):
    angle = np.arange(136.0, 145.0, 0.05)
    return angle[np.argmax(mie.phase_function(kind, wavelength_nm).value(np.cos(np.radians(angle))))]


def test_primary_rainbow():
    """Geometric optics: 42.2 (red, n = 1.332) and 41.1 degrees (blue, 1.340) from the antisolar point."""
    red, blue = bow_angle("rain", 650.0), bow_angle("rain", 450.0)
    assert 137.5 < red < 138.6
    assert 138.9 < blue < 140.3
    assert blue > red


def test_secondary_bow_and_alexanders_band():
    value = lambda a: mie.phase_function("rain", 615.0).value(np.cos(np.radians(a)))  # noqa: E731
    assert value(138.5) > 5 * value(134)
    assert value(128.5) > 1.2 * value(134)


def test_droplets_show_cloudbow_and_glory():
    value = mie.phase_function("liquid", 546.0).value(np.cos(np.radians([120, 142, 165, 178, 180])))
    assert value[1] > 5 * value[0]
    assert value[3] > 2.5 * value[2]


def test_between_wavelengths_and_beyond():
    g = [mie.phase_function("liquid", wl).asymmetry for wl in (546.0, 563.0, 580.0)]
    assert min(g[0], g[2]) - 1e-4 < g[1] < max(g[0], g[2]) + 1e-4
    assert mie.phase_function("rain", 800.0) == mie.phase_function("rain", 700.0)
    albedo = mie.single_scattering_albedo("rain", [400, 615, 700])
    assert albedo[0] > albedo[1] > albedo[2] > 0.999


def test_small_and_known():
    from importlib.resources import files

    assert len((files("openswim.optics") / "data" / "mie_water.npz").read_bytes()) < 500_000
    with pytest.raises(UserError, match="ice"):
        mie.phase_function("ice", 550.0)


@pytest.mark.parametrize("radius_m", [5e-6, 12e-6, 30e-6])
def test_glory_shrinks_with_the_droplets(radius_m):
    """Its first bright ring keeps its place in units of 1/x (van de Hulst 1957, Sect. 17.42)."""
    x = 2 * np.pi * radius_m / 546e-9
    angle = np.linspace(0.0, 14 / x * 2, 2000)
    value = mie.phase_function("liquid", 546.0, radius_m).value(-np.cos(angle))
    dip = int(np.argmax(np.diff(value) > 0))
    ring = angle[dip + int(np.argmax(value[dip:]))]
    assert 2.5 < ring * x < 5.0


def test_corona_shrinks_with_the_droplets():
    """The angle at which the peak has fallen to half is 1.62/x, Airy's, for the sizes that make the peak (r^4 n)."""
    for radius_m in (6e-6, 14e-6, 28e-6):
        angle = np.linspace(0, np.radians(6), 4000)
        value = mie.phase_function("liquid", 546.0, radius_m).value(np.cos(angle))
        half = angle[np.argmax(value < 0.5 * value[0])]
        weighted = radius_m * 1.18  # sqrt of the mean r^2 weighted with r^4 n, at a variance of .1
        assert half * 2 * np.pi * weighted / 546e-9 == pytest.approx(1.62, rel=0.06)


def test_bow_nears_the_rainbow_as_drops_grow():
    angle = np.arange(132.0, 152.0, 0.05)
    peaks = []
    for radius_m in (6e-6, 10e-6, 20e-6, 40e-6):
        value = mie.phase_function("liquid", 546.0, radius_m).value(np.cos(np.radians(angle)))
        peaks.append(angle[np.argmax(value)])
    assert peaks == sorted(peaks, reverse=True)
    assert 138.5 < peaks[-1] < 142.5  # geometric optics: 138.5


def test_between_radii():
    """A radius between two tables against Mie theory itself."""
    pytest.importorskip("miepython")
    from openswim.optics.spheres import gamma_sizes, scattering_by_spheres

    found = scattering_by_spheres(gamma_sizes(9.0, 0.1, 2.5, 27.0, 700), 1.33525 - 2.4e-9j, 546.0)
    table = mie.phase_function("liquid", 546.0, 9e-6)
    mu = np.cos(np.radians(np.concatenate([np.arange(0, 10, 0.5), np.arange(10, 181, 1.0)])))
    assert table.asymmetry == pytest.approx(found.phase.asymmetry, abs=1e-3)
    assert np.sqrt(np.mean(np.log(table.value(mu) / found.phase.value(mu)) ** 2)) < 0.05
    assert mie.extinction_efficiency("liquid", 546.0, 9e-6) == pytest.approx(found.efficiency, rel=1e-3)


def test_efficiency_against_ecrad():
    """Mass extinction of the ecRad tables, whose distributions are a little wider, over 1.5 / (r density)."""
    path = SHARED / "data" / "optics" / "mie_droplet_scattering.nc"
    if not path.exists():
        pytest.skip(f"no {path}")
    with xr.open_dataset(path) as data:
        i = int(np.abs(data.wavelength.values - data.wavelength.dtype.type(550e-9)).argmin())
        row = data.isel(wavenumber=i).sel(effective_radius=[4e-6, 8e-6, 14e-6, 30e-6], method="nearest").load()
    radius = row.effective_radius.values.astype(float)
    theirs = 2 * row.mass_extinction_coefficient.values * radius * 1000 / 1.5
    np.testing.assert_allclose(mie.extinction_efficiency("liquid", 550.0, radius), theirs, rtol=0.01)
    for r, g in zip(radius, row.asymmetry_factor.values, strict=True):
        assert mie.phase_function("liquid", 550.0, float(r)).asymmetry == pytest.approx(float(g), abs=0.004)
