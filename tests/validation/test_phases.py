"""Phase functions as reference files word them: asymmetry and shape against the definitions."""

from pathlib import Path

import numpy as np
import pytest
import xarray as xr

from openswim.errors import UserError
from openswim.scene.phase import HenyeyGreenstein
from openswim.validation.reference import Reference
from openswim.validation.reference.phases import PhaseTables, named_phases, phase_of_attributes

TABLE_3 = (
    "double Henyey-Greenstein (Eq 27), Table 3: colorado_swapped = .12 DHG(.900) + .88 DHG(.600), f_b .550; "
    "colorado_printed = weights exchanged; saudi_printed = .54 DHG(.27) + .46 DHG(.925), f_b .558"
)


def test_the_double_lobes_of_table_3() -> None:
    found = named_phases(TABLE_3)
    assert found["colorado_swapped"].asymmetry == pytest.approx(0.12 * 0.9 + 0.88 * 0.6)
    assert found["colorado_printed"].asymmetry == pytest.approx(0.88 * 0.9 + 0.12 * 0.6)
    assert found["saudi_printed"].asymmetry == pytest.approx(0.54 * 0.27 + 0.46 * 0.925)


def test_attributes_name_a_phase_function() -> None:
    henyey = {"phase_function": "Henyey-Greenstein", "asymmetry_parameter": 0.85}
    assert phase_of_attributes(henyey, "here") == HenyeyGreenstein(0.85)
    mixed = phase_of_attributes({"phase_function": ".7 HG(.9) + .3 HG(-.2)"}, "here")
    assert mixed.asymmetry == pytest.approx(0.57)
    assert phase_of_attributes({"phase_function": "Rayleigh"}, "here").value(1.0) == pytest.approx(1.5)
    with pytest.raises(UserError, match="somebody's"):
        phase_of_attributes({"phase_function": "somebody's own"}, "here")


def test_tables_are_found_by_radius_and_labels_by_asymmetry() -> None:
    angle = np.linspace(0.0, 180.0, 721)
    value = HenyeyGreenstein(0.7).value(np.cos(np.radians(angle)))
    columns = {"case": np.repeat(["cloud_r10_546", "cloud_r6_546"], angle.size)}
    columns["scat_angle_deg"] = np.tile(angle, 2)
    columns["P"] = np.concatenate([value, np.ones_like(value)])
    data = xr.Dataset({name: ("row", values) for name, values in columns.items()})
    tables = PhaseTables([Reference(Path("anything.csv"), data)])
    assert tables.find("mie_r10").asymmetry == pytest.approx(0.7, abs=1e-3)
    assert tables.find("mie_r6").asymmetry == pytest.approx(0.0, abs=1e-6)
    assert tables.find("hg086") == HenyeyGreenstein(0.86)
    with pytest.raises(UserError, match="mie_r12"):
        tables.find("mie_r12")
