"""Layers: angles and fluxes of the reference files against single scattering written down independently."""

import os
from pathlib import Path

import numpy as np
import pytest
import xarray as xr
from tests.validation.fakes import FakeSolver, single_scattering

from openswim.scene.phase import HenyeyGreenstein
from openswim.validation.reference import Reference, read_reference
from openswim.validation.reference.phases import PhaseTables
from openswim.validation.slab_tables import compare_rayleigh_table
from openswim.validation.slabs import compare_aerosol_file, compare_slab_file, is_slab_file

SHARED = Path(os.environ.get("OPENSWIM_SHARED", Path(__file__).parents[3] / "shared"))
NO_TABLES = PhaseTables([])


def _thin_slab_file(tau: float, sza: float) -> Reference:
    """A reference in the layout of slabs_*.nc, with single scattering in angles, not vectors."""
    zenith, azimuth = np.array([0.0, 20.0, 50.0, 80.0]), np.array([0.0, 45.0, 120.0, 180.0])
    mu0, mu = np.cos(np.radians(sza)), np.cos(np.radians(zenith))[:, None]
    level = np.sin(np.radians(sza)) * np.sin(np.radians(zenith))[:, None] * np.cos(np.radians(azimuth))
    phase = HenyeyGreenstein(0.85)
    # Relative azimuth 0: the light goes on in the direction of the beam, whether up or down.
    down = phase.value(mu0 * mu + level) * mu0 / (mu0 - mu) * (np.exp(-tau / mu0) - np.exp(-tau / mu))
    slant = tau * (1 / mu0 + 1 / mu)
    up = phase.value(-mu0 * mu + level) * mu0 / (mu0 + mu) * (1 - np.exp(-slant)) + 4 * 0.2 * mu0 * np.exp(
        -slant
    )
    angles = ("case", "view_zenith", "relative_azimuth")
    data = xr.Dataset(
        {
            "tau": ("case", [tau]),
            "sza": ("case", [sza]),
            "omega": ("case", [1.0]),
            "albedo": ("case", [0.2]),
            "up_top": (angles, up[None] * np.ones((1, 4, 4))),
            "dn_bot": (angles, down[None]),
            "flux_up_top": ("case", [0.3]),
            "flux_dir_bot": ("case", [0.5]),
            "flux_dif_dn_bot": ("case", [0.1]),
        },
        coords={"view_zenith": zenith, "relative_azimuth": azimuth},
        attrs={"phase_function": "Henyey-Greenstein", "asymmetry_parameter": 0.85},
    )
    return Reference(Path("some_layer.nc"), data)


def test_angles_and_fluxes_of_a_layer() -> None:
    reference = _thin_slab_file(0.1, 35.0)
    assert is_slab_file(reference)
    solver = FakeSolver(
        single_scattering, lambda scene, sun: {"up_top": 0.33, "direct_bottom": 0.5, "down_bottom": 0.13}
    )
    rows = {row.quantity.split(",")[0]: row for row in compare_slab_file(reference, solver, NO_TABLES)}
    assert rows["radiance up"].relative_rmse < 1e-5
    assert rows["radiance down"].relative_rmse < 1e-5
    assert rows["flux up"].bias == pytest.approx(0.1)
    assert rows["flux down"].bias == pytest.approx(0.05)
    assert {row.case for row in rows.values()} == {"some_layer"}


def test_the_layer_has_its_optical_depth_and_repeats_sideways() -> None:
    solver = FakeSolver(
        single_scattering, lambda scene, sun: dict.fromkeys(("up_top", "direct_bottom", "down_bottom"), 0)
    )
    list(compare_slab_file(_thin_slab_file(7.0, 60.0), solver, NO_TABLES))
    (scene,) = solver.scenes
    extinction = scene.data["extinction_cloud"].values[:, 0, 0]
    assert np.trapezoid(extinction, scene.grid.height_m) == pytest.approx(7.0, rel=1e-5)
    assert scene.grid.periodic


def test_thin_layers_of_the_references_are_close_to_single_scattering() -> None:
    path = SHARED / "reference" / "clouds" / "slabs_hg085.nc"
    if not path.exists():
        pytest.skip(f"reference data not found: {path}")
    reference = read_reference(path)
    thin = reference.data.isel(
        case=(reference.data.tau.values == 0.1) & (reference.data.albedo.values == 0.0)
    )
    solver = FakeSolver(
        single_scattering, lambda scene, sun: dict.fromkeys(("up_top", "direct_bottom", "down_bottom"), 0.0)
    )
    rows = list(compare_slab_file(Reference(path, thin), solver, NO_TABLES))
    for row in rows:
        if row.quantity.startswith("radiance"):
            assert row.correlation > 0.97, row
            assert -0.45 < row.bias < 0, row  # multiple scattering is missing, most at grazing angles


def test_the_aerosol_sky_looks_at_the_sun_on_the_right_side() -> None:
    path = SHARED / "reference" / "clouds" / "aerosol_sky.nc"
    if not path.exists():
        pytest.skip(f"reference data not found: {path}")
    reference = read_reference(path)
    thin = reference.data.isel(case=reference.data.tau.values == 0.1)
    solver = FakeSolver(single_scattering, lambda scene, sun: {"down_bottom": 0.0})
    rows = list(compare_aerosol_file(Reference(path, thin), solver, NO_TABLES))
    skies = [row for row in rows if "flux" not in row.quantity]
    assert len(skies) >= 2
    for row in skies:
        assert row.correlation > 0.99, row
        assert row.relative_rmse < 0.35, row


def test_published_rayleigh_layers_are_read_from_their_titles() -> None:
    data = xr.Dataset(
        {
            "case": ("row", np.array(["Somebody2031 tau=.01 albedo=0 mu0=.6; I for F0=pi"] * 2)),
            "R_up_or_T_down": ("row", np.array(["R", "T"])),
            "vza": ("row", [40.0, 40.0]),
            "raa": ("row", [180.0, 0.0]),
            "Lp_4piL_over_E": ("row", [1.0, 1.0]),
        }
    )
    solver = FakeSolver(single_scattering)
    rows = list(compare_rayleigh_table(Reference(Path("p.csv"), data), solver, NO_TABLES))
    mu, mu0, tau = np.cos(np.radians(40.0)), 0.6, 0.01
    forward = 0.75 * (1 + np.cos(np.arccos(mu0) - np.radians(40.0)) ** 2)  # both look along the sun's azimuth
    up = forward * mu0 / (mu0 + mu) * (1 - np.exp(-tau * (1 / mu + 1 / mu0)))
    down = forward * mu0 / (mu0 - mu) * (np.exp(-tau / mu0) - np.exp(-tau / mu))
    assert [row.bias for row in rows] == pytest.approx([up - 1, down - 1], abs=1e-6)
