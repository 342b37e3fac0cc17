"""Aerosol types against published retrievals and tables, and on their way through files."""

import json
import os
import sys
from pathlib import Path

import numpy as np
import pytest
import xarray as xr

import openswim
from openswim.errors import UserError
from openswim.optics import aerosol_optics, aerosol_profile, aerosol_type, fit_double_hg
from openswim.optics.aerosol import NAMES, described_profile, spectral_albedo, spectral_phase
from openswim.optics.species import background, scene_optics
from openswim.scene import Grid
from openswim.scene.aerosol import AerosolProfile
from openswim.scene.atmosphere import Atmosphere
from openswim.scene.phase import AerosolPhase, phase_from_dict
from openswim.scene.phase.tables import TABULATED

ROOT = Path(__file__).parents[2]
SHARED = Path(os.environ.get("OPENSWIM_SHARED", ROOT.parent / "shared"))


@pytest.mark.parametrize(
    ("name", "albedo", "asymmetry", "exponent"),
    [
        # Dubovik et al. (2002), Table 1, interpolated to 450 and 615 nm; spread of the retrievals
        ("dust", ((0.92, 0.95), 0.03), ((0.69, 0.665), 0.03), (0.1, 0.9)),
        ("smoke", ((0.94, 0.935), 0.02), ((0.68, 0.62), 0.04), (1.0, 2.3)),
        ("pollution", ((0.90, 0.88), 0.02), ((0.67, 0.62), 0.04), (1.0, 2.3)),
        # OPAC (Hess et al. 1998), clean maritime at 80 % humidity; ammonium sulphate of Bozzo et al. (2020)
        ("sea_salt", ((1.0, 1.0), 0.005), ((0.78, 0.77), 0.02), (-0.3, 0.3)),
        ("sulphate", ((1.0, 1.0), 0.002), ((0.715, 0.68), 0.025), (1.0, 1.9)),
    ],
)
def test_published_ranges(name, albedo, asymmetry, exponent):
    kind = aerosol_type(name)
    np.testing.assert_allclose(spectral_albedo(kind, [450, 615]), albedo[0], atol=albedo[1])
    found = [one.asymmetry for one in spectral_phase(kind, [450, 615])]
    np.testing.assert_allclose(found, asymmetry[0], atol=asymmetry[1])
    assert exponent[0] < kind.angstrom_exponent < exponent[1]


@pytest.mark.parametrize(
    ("name", "low", "high"),
    [("dust", 40, 70), ("smoke", 45, 90), ("pollution", 40, 80), ("sea_salt", 15, 30), ("sulphate", 40, 80)],
)
def test_lidar_ratios(name, low, high):
    """Extinction over backscatter at 532 nm: Mueller et al. (2007), Burton et al. (2012)."""
    kind = aerosol_type(name)
    (one,) = spectral_phase(kind, 532.0)
    assert low < 4 * np.pi / (one.value(-1.0) * spectral_albedo(kind, 532.0)[0]) < high


def test_sulphate_against_the_cams_tables():
    path = SHARED / "data" / "optics" / "aerosol_ifs_49R1.nc"
    if not path.exists():
        pytest.skip(f"no {path}")
    with xr.open_dataset(path) as data:
        i = int(np.abs(data.wavelength.values - data.wavelength.dtype.type(550e-9)).argmin())
        row = data.isel(wavenumber=i, hydrophilic=4, relative_humidity=7).load()
    assert aerosol_type("sulphate").phase[550.0].asymmetry == pytest.approx(
        float(row.asymmetry_hydrophilic), abs=0.015
    )
    assert 4 * np.pi / aerosol_type("sulphate").phase[550.0].value(-1.0) == pytest.approx(
        float(row.lidar_ratio_hydrophilic), rel=0.1
    )


@pytest.mark.parametrize("name", TABULATED)
@pytest.mark.parametrize("wavelength_nm", [380.0, 450.0, 532.0, 615.0, 760.0])
def test_mean_and_moments(name, wavelength_nm):
    (one,) = spectral_phase(aerosol_type(name), wavelength_nm)
    theta = np.concatenate([[0], np.geomspace(1e-6, np.pi, 200_000)])
    weighted = 0.5 * one.value(np.cos(theta)) * np.sin(theta)
    chi = one.moments(3)
    assert (one.value(np.cos(theta[::100])) > 0).all()
    for n, polynomial in enumerate((1.0, np.cos(theta), 1.5 * np.cos(theta) ** 2 - 0.5)):
        assert np.trapezoid(weighted * polynomial, theta) == pytest.approx(chi[n], abs=2e-5)


def test_tables_are_what_the_recipes_give(monkeypatch):
    """One row computed again, with other sizes: the distribution is resolved, and the shipped file is the script's."""
    pytest.importorskip("miepython")
    monkeypatch.setattr(sys, "path", [str(ROOT / "tools"), *sys.path])
    import make_aerosol_tables as tool

    from openswim.optics.spheres import lognormal_sizes, scattering_by_spheres

    recipe = tool.RECIPES["smoke"]
    again = scattering_by_spheres(lognormal_sizes(recipe.modes, 250), complex(1.50, 0.0094), 550.0)
    table = aerosol_type("smoke")
    assert again.single_scattering_albedo == pytest.approx(table.single_scattering_albedo[550.0], abs=1e-4)
    mu = np.cos(np.radians(np.arange(0, 181, 3)))
    np.testing.assert_allclose(again.phase.value(mu), table.phase[550.0].value(mu), rtol=0.02)


def test_the_papers_saudi_case_is_near_our_dust():
    """Appendix A gives no numbers to start from; a climatology of the same kind comes close to its Table 3."""
    ours = fit_double_hg(aerosol_type("dust").phase[550.0])
    assert ours.sharp_g == pytest.approx(0.925, abs=0.015)
    assert ours.sharp_fraction == pytest.approx(0.54, abs=0.06)
    (saudi,) = spectral_phase(aerosol_type("saudi_dust_pollution"), 546.0)
    mu = np.cos(np.radians(np.arange(2, 100, 2)))
    ratio = aerosol_type("dust").phase[550.0].value(mu) / saudi.value(mu)
    assert np.sqrt(np.mean(np.log(ratio) ** 2)) < 0.2


@pytest.mark.parametrize("name", NAMES)
def test_types_survive_json(name):
    profile = aerosol_profile(name, 0.3, 2000.0)
    text = json.dumps(profile.to_dict())
    assert AerosolProfile.from_dict(json.loads(text)) == profile
    assert len(text) < 10_000


def test_a_profile_by_name():
    named = described_profile({"aerosol_type": "smoke", "optical_depth": 0.4})
    assert named == aerosol_profile("smoke", 0.4)
    own = described_profile({"aerosol_type": "smoke", "single_scattering_albedo": 0.8})
    assert own.single_scattering_albedo == 0.8
    assert own.angstrom_exponent == aerosol_type("smoke").angstrom_exponent


def test_background_takes_the_type():
    air = background(Atmosphere.us_standard(aerosol=aerosol_profile("smoke", 0.2)), [450.0, 615.0], [0.0, 1000.0])
    np.testing.assert_allclose(air.aerosol_albedo, spectral_albedo(aerosol_type("smoke"), [450.0, 615.0]))
    ratio = air.aerosol_per_m[0, 0] / air.aerosol_per_m[1, 0]
    assert ratio == pytest.approx((615 / 450) ** aerosol_type("smoke").angstrom_exponent)


@pytest.fixture
def two_aerosols():
    grid = Grid(x=np.arange(4) * 1e3, y=np.arange(3) * 1e3, height_m=np.array([0.0, 1000.0]))
    field = np.full((2, 3, 4), 1e-5, np.float32)
    return openswim.Scene(
        grid,
        xr.Dataset({name: (("z", "y", "x"), field) for name in ("extinction_ash", "aerosol_extinction")}),
        optics={"ash": aerosol_optics("dust"), "aerosol": aerosol_optics("smoke")},
    )


def test_species_of_two_types_in_one_scene(two_aerosols):
    smoke, ash = scene_optics(two_aerosols, [450.0, 550.0])
    assert (smoke.name, ash.name) == ("aerosol", "ash")
    for species, name in ((smoke, "smoke"), (ash, "dust")):
        kind = aerosol_type(name)
        np.testing.assert_allclose(species.relative_extinction, [(550 / 450) ** kind.angstrom_exponent, 1])
        np.testing.assert_allclose(species.single_scattering_albedo, spectral_albedo(kind, [450, 550]))
        assert species.phase == [AerosolPhase(name, 450.0), AerosolPhase(name, 550.0)]


def test_types_through_a_file(two_aerosols, tmp_path):
    two_aerosols.to_netcdf(tmp_path / "own.nc")
    back = openswim.open_scene(tmp_path / "own.nc")
    assert back.optics == two_aerosols.optics
    with xr.open_dataset(tmp_path / "own.nc") as saved:
        named = saved.load()
    for name, kind in (("extinction_ash", "dust"), ("aerosol_extinction", "smoke")):
        named[name].attrs = {"units": "m-1", "aerosol_type": kind}
    named["aerosol_background"] = ((), 0, {"aerosol_type": "sea_salt", "optical_depth": 0.1})
    del named.attrs["atmosphere"]
    named.to_netcdf(tmp_path / "named.nc")
    read = openswim.open_scene(tmp_path / "named.nc")
    assert read.optics == two_aerosols.optics
    assert read.atmosphere.aerosol == aerosol_profile("sea_salt", 0.1)


def test_unknown_names():
    with pytest.raises(UserError, match="known: continental, dust"):
        aerosol_type("pollen")
    with pytest.raises(UserError, match="no aerosol table"):
        phase_from_dict({"type": "aerosol", "name": "dust", "wavelength_nm": 551.0})
