"""The night's reference tables: every one is told by its content, and the marks that need no transport are met."""

import os
from pathlib import Path

import pytest
from tests.validation.fakes import FakeSolver, single_scattering

from openswim.validation import level_crystals
from openswim.validation.reference import read_reference
from openswim.validation.reference.phases import PhaseTables
from openswim.validation.walk import FAMILIES

NIGHT = Path(os.environ.get("OPENSWIM_SHARED", Path(__file__).parents[3] / "shared")) / "reference" / "night"


def rows(name):
    if not (NIGHT / f"{name}.csv").exists():
        pytest.skip(f"reference data not found: {NIGHT / name}")
    reference = read_reference(NIGHT / f"{name}.csv")
    (family,) = [each for each in FAMILIES if each.matches(reference)]
    found = {row.quantity: row for row in family.compare(reference, FakeSolver(single_scattering), PhaseTables([]))}
    assert found
    assert all(row.n > 0 and row.case == name for row in found.values())
    return found


@pytest.mark.parametrize("name", ["zodiacal_light", "milky_way", "refraction_airmass", "moon_orientation"])
def test_marks_are_met(name):
    assert max(row.relative_rmse for row in rows(name).values()) < 0.13


def test_bows_rings_and_halos():
    """In marks: of .3 degrees for bows and halos, of .15 for rings."""
    most = {"rainbow": 0.26, "corona_glory": 0.39, "halo_profile": 0.022}
    assert {name: max(row.relative_rmse for row in rows(name).values()) < bound for name, bound in most.items()} == {
        name: True for name in most
    }


def test_halos_and_level_crystals(monkeypatch):
    """In marks of .3 degrees, by half of the rays; the sun's disc moves the edge of a sundog by half of one."""
    monkeypatch.setattr(level_crystals, "_RAYS", 200_000)
    found = rows("halos")
    most = {"parhelion (sun dog)": 0.65, "circumzenithal arc": 0.087, "circumhorizontal arc": 0.23, "subsun": 0.006}
    for name, row in found.items():
        assert row.relative_rmse < most.get(name.removesuffix(", in marks of .3"), 0.039)
    assert len(found) == 2 + len(most)


def test_moonlight_and_airglow():
    found = rows("lunar_irradiance")
    assert found["moonlight over LIME's, 5-95 degrees"].relative_rmse < 0.043
    assert found["moonlight over Miller's, 95-150 degrees"].relative_rmse < 0.073
    assert max(row.relative_rmse for row in rows("airglow").values()) < 0.003


def test_eclipses():
    """Contacts after 2016 are 5 s before the table's: see docs/validation.md."""
    found = rows("solar_eclipses")
    assert found["1999-08-11, contacts, in marks of 3 s"].relative_rmse < 0.013
    assert all(row.relative_rmse < 0.013 for name, row in found.items() if "contacts" not in name)
    assert all(3 * row.bias == pytest.approx(-5.0, abs=0.03) for name, row in found.items() if "contacts" in name
               and "1999" not in name)  # fmt: skip
    assert rows("lunar_eclipses")["umbral contacts, in marks of 30 s"].relative_rmse < 0.22
