"""The sun's position, colours and clear days."""

import os
from pathlib import Path

import numpy as np
import pytest
from tests.validation.fakes import FakeSolver, single_scattering

from openswim.stations.clear_sky import clear_times
from openswim.validation import colours, sunpos
from openswim.validation.reference import read_reference
from openswim.validation.reference.phases import PhaseTables

CLEARSKY = (
    Path(os.environ.get("OPENSWIM_SHARED", Path(__file__).parents[3] / "shared")) / "reference" / "clearsky"
)
SOLVER = FakeSolver(single_scattering)


def _rows(module, name: str) -> dict:
    if not (CLEARSKY / name).exists():
        pytest.skip(f"reference data not found: {CLEARSKY / name}")
    reference = read_reference(CLEARSKY / name)
    assert module.matches(reference)
    return {row.quantity: row for row in module.compare(reference, SOLVER, PhaseTables([]))}


def test_the_sun_stands_where_skyfield_says() -> None:
    rows = _rows(sunpos, "sun_moon_positions.csv")
    assert len(rows) == 4
    assert max(row.relative_rmse for row in rows.values()) < 0.01  # of a diameter; of the distance


def test_position_errors_are_counted_in_diameters() -> None:
    found = sunpos.position_score([60.0, 0.1], [0.0, 10.0], [60.0, 0.0], [1.0, 10.0], [0.5, 0.5])
    assert found.relative_rmse == pytest.approx(np.sqrt((0.5**2 + 0.1**2) / 2) / 0.5, rel=1e-3)
    assert found.bias == pytest.approx(0.1)


def test_colours_through_three_wavelengths() -> None:
    rows = _rows(colours, "colour_reference.csv")
    assert {name.split(",")[0] for name in rows} == {"XYZ", "linear RGB by Eq. 36"}
    assert rows["linear RGB by Eq. 36"].relative_rmse < 1e-3
    assert rows["XYZ, rayleigh l^-4 (550->0.2)"].relative_rmse < 0.01


@pytest.mark.parametrize(
    ("name", "at_550", "at_450"),
    [("rayleigh l^-4 (550->0.2)", 0.2, 0.2 * (550 / 450) ** 4), ("white reflector x0.5", 0.5, 0.5)],
)
def test_spectra_from_their_names(name: str, at_550: float, at_450: float) -> None:
    spectrum = colours.spectrum_of(name)
    assert spectrum is not None
    assert spectrum(np.array([550.0, 450.0])) == pytest.approx([at_550, at_450])


def test_the_reddened_spectrum_has_rayleighs_optical_depth() -> None:
    spectrum = colours.spectrum_of("sunset exp(-20*tauR)")
    assert spectrum is not None
    assert -np.log(spectrum(np.array([450.0, 546.0, 615.0]))) / 20 == pytest.approx(
        [0.2209, 0.0999, 0.0615], rel=0.005
    )
    assert colours.spectrum_of("dust red ramp") is None


def test_clear_minutes_are_the_steady_ones_near_the_model() -> None:
    rng = np.random.default_rng(5)
    time = np.datetime64("2020-06-01T10:00") + np.arange(120) * np.timedelta64(60, "s")
    ratio = 1.03 + rng.normal(0, 0.002, 120)
    ratio[30:45] = rng.uniform(0.4, 1.2, 15)  # broken cloud
    ratio[70:100] = 0.5  # steady overcast
    kept = clear_times(time, {"ghi": 800 * ratio}, {"ghi": np.full(120, 800.0)})
    assert kept[:25].all()
    assert kept[50:65].all()
    assert not kept[30:45].any()
    assert not kept[70:100].any()
