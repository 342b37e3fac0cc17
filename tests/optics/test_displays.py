"""Bows, coronas, glories and halos of single scattering against tables of other codes (skipped without them)."""

import csv
import os
from pathlib import Path

import numpy as np
import pytest

from openswim.errors import UserError
from openswim.optics import hydrometeors, mie
from openswim.optics.displays import crystals, droplets
from openswim.optics.displays.shapes import Shapes, with_shapes
from openswim.validation.displays import BOWS, NARROW, RINGS, blurred, bow_deg, rings

NIGHT = Path(os.environ.get("OPENSWIM_SHARED", Path(__file__).parents[3] / "shared")) / "reference" / "night"
RGB_NM = (615.0, 546.0, 450.0)


def rows(name):
    path = NIGHT / f"{name}.csv"
    if not path.exists():
        pytest.skip(f"no {path}")
    with path.open() as file:
        return list(csv.DictReader(file))


def at(phase, angle_deg):
    return phase.value(np.cos(np.radians(angle_deg)))


def test_rainbows_stand_where_mie_theory_has_them():
    """Monodisperse drops of 500 um; ours are of all sizes, and of this mean where bows are made."""
    seen = 0
    for row in rows("rainbow"):
        if "radius 500 um" in row["case"] and row["quantity"] in BOWS:
            found = bow_deg(float(row["wavelength_nm"]), BOWS[row["quantity"]])
            assert found == pytest.approx(float(row["value"]), abs=0.08)
            seen += 1
    assert seen >= 3


def test_order_of_colours_and_alexanders_band():
    """Red outside the primary and inside the secondary bow; between them it is dark."""
    primary, secondary = ([bow_deg(w, ends) for w in RGB_NM] for ends in BOWS.values())
    assert primary[0] > primary[1] > primary[2]
    assert secondary[0] < secondary[1] < secondary[2]
    for wavelength in RGB_NM:
        phase = mie.phase_function("rain", wavelength)
        inside, band, outside = (np.median(at(phase, np.arange(*ends, 0.05))) for ends in
                                 ((144, 148), (131.5, 136), (112, 117)))  # fmt: skip
        assert inside > 11 * band  # the reference has 12 to 14
        assert 1.1 < outside / band < 1.4


def test_fine_bows_join_the_coarse_table():
    phase = mie.phase_function("rain", 546.0)
    assert phase.angle_deg[np.searchsorted(phase.angle_deg, 130) + 1] - 130 == pytest.approx(0.05, abs=0.002)
    for end in (110.0, 152.0):  # as steep as next to them
        steps = np.diff(np.log(at(phase, end + np.array([-3.0, -1.0, 1.0, 3.0]))))
        assert abs(steps[1] - 0.5 * (steps[0] + steps[2])) < 0.1
    angle = np.radians(np.arange(0, 180.0005, 0.001))
    assert 0.5 * np.trapezoid(phase.value(np.cos(angle)) * np.sin(angle), angle) == pytest.approx(1.0, abs=1e-3)


def test_coronas_and_glories():
    seen = 0
    for row in rows("corona_glory"):
        variance, radius_um = float(row["v_eff"]), float(row["r_eff_um"])
        if row["quantity"] not in RINGS or variance > NARROW or not row["value"] or blurred(row["quantity"], radius_um):
            continue
        side, bright, which = RINGS[row["quantity"]]
        phase = droplets.phase_function(float(row["wavelength_nm"]), radius_um * 1e-6, variance)
        angle = np.arange(0.0, 14.0, 0.05)
        found = rings(angle, phase.value(side * np.cos(np.radians(angle))))[bright][which]
        assert found == pytest.approx(float(row["value"]), abs=0.115), row  # the mark is .15
        seen += 1
    assert seen > 30


def test_glories_of_moderate_spectra():
    seen = 0
    for row in rows("corona_glory"):
        if row["quantity"] == "glory, first ring radius" and float(row["v_eff"]) == 0.05 and row["value"]:
            phase = droplets.phase_function(float(row["wavelength_nm"]), float(row["r_eff_um"]) * 1e-6, 0.05)
            angle = np.arange(0.0, 8.0, 0.05)
            found = rings(angle, phase.value(-np.cos(np.radians(angle))))[1][0]
            assert found == pytest.approx(float(row["value"]), abs=0.06), row
            seen += 1
    assert seen


def test_usual_droplets_from_rows_of_sizes_are_those_of_the_other_table():
    """Made by different sums over sizes; where the disc of the sun blurs nothing."""
    ours, other = droplets.phase_function(546.0, 10e-6, 0.1), mie.phase_function("liquid", 546.0, 10e-6)
    assert ours.asymmetry == pytest.approx(other.asymmetry, abs=5e-5)
    angle = np.arange(3.0, 176.0, 0.5)
    assert np.sqrt(np.mean(np.log(at(ours, angle) / at(other, angle)) ** 2)) < 0.019


def test_halos_against_other_rays():
    """A ray tracing of another author; both are Monte Carlo."""
    off = []
    for row in rows("halo_profile"):
        mixture = crystals.phase_function(float(row["wavelength_nm"]), (row["crystal"].split(",")[0],))
        table, what, value = mixture.phases[1], row["scattering_angle_deg_or_quantity"], float(row["value"])
        angle = np.arange(20.5, 25.0, 0.05)
        if what.startswith("steepest"):
            assert angle[np.argmax(np.diff(at(table, angle)))] == pytest.approx(value, abs=0.07)
        elif what.startswith("maximum of the 22"):
            assert angle[np.argmax(at(table, angle))] == pytest.approx(value, abs=0.06)  # steps are .05 wide
        elif what.startswith("maximum of P"):
            assert at(table, angle).max() / at(table, np.arange(17, 20, 0.1)).mean() == pytest.approx(value, rel=0.022)
        elif what.startswith("asymmetry"):
            assert 2 * mixture.asymmetry - 0.998 == pytest.approx(value, abs=0.0022)
        elif what.replace(".", "").isdigit() and 25 < float(what) < 170 and not 45 < float(what) < 49:
            off.append(2 * mixture.weights[1] * at(table, float(what)) / value - 1)
    assert np.sqrt(np.mean(np.square(off))) < 0.0225


def test_halos_stand_at_minimum_deviation():
    seen = 0
    for row in rows("halos"):
        for name, wedge in (("22 degree halo, inner edge", 60.0), ("46 degree halo, inner edge", 90.0)):
            if row["quantity"] == name:
                index = crystals.refractive_index(float(row["wavelength_nm"]))
                assert crystals.halo_deg(index, wedge) == pytest.approx(float(row["value"]), abs=0.02)
                seen += 1
    assert seen


@pytest.mark.parametrize("pristine", [0.05, 0.3])
def test_pristine_ice_keeps_its_mean_cosine(pristine):
    smooth = hydrometeors.phase_function("ice", 546.0, 30e-6)
    mixed = hydrometeors.phase_function("ice", 546.0, 30e-6, Shapes(pristine=pristine))
    assert mixed.asymmetry == pytest.approx(smooth.asymmetry, abs=1e-6)
    step = at(mixed, 22.4) / at(mixed, 21.0) / (at(smooth, 22.4) / at(smooth, 21.0))
    assert step > 1 + 2.5 * pristine
    assert 25 < 4 * np.pi / mixed.value(-1.0) < 43  # lidar ratio of cirrus, sr


def test_shapes_are_a_scenes_and_its_files(tmp_path):
    from openswim import open_scene
    from openswim.scene import Scene

    x, z = np.linspace(0, 3e3, 4), np.linspace(0, 3e3, 4)
    content = np.zeros((4, 4, 4))
    content[2] = 1e-4
    scene = Scene.from_arrays(None, x, x, z, fields={"liquid_content": content, "ice_content": content})
    assert Shapes.of(scene) == Shapes()
    told = with_shapes(scene, droplet_variance=0.02, plates=0.25)
    told.to_netcdf(tmp_path / "told.nc")
    read = Shapes.of(open_scene(tmp_path / "told.nc"))
    assert (read.droplet_variance, read.pristine, read.plates) == pytest.approx((0.02, 0.05, 0.25))
    for end in np.array([0.01, 0.1], np.float32):  # a little less and more
        ends = scene.data.assign(liquid_effective_variance=((), end))
        assert Shapes.of(Scene(scene.grid, ends)).droplet_variance == end
    with pytest.raises(UserError, match="droplets must be a number within"):
        with_shapes(scene, droplet_variance=0.3)
    with pytest.raises(UserError, match="more than all"):
        with_shapes(scene, pristine=0.8, plates=0.3)
