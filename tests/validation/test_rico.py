"""RICO cumulus (122 x 106 columns, sun 60 degrees from the zenith) by other people's Monte Carlo, its noise removed."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace

import pytest

from openswim.kept_light import fingerprint
from openswim.solver import Solver
from openswim.validation.cases3d import compare
from openswim.validation.reference import read_reference
from openswim.validation.reference.phases import PhaseTables

# RMSE and the most of it, bias and the most of its size: per cent of 4x4-pixel means, over black ground and albedo .2.
MEASURED = {
    ("standard", "rico_nadir"): ((2.59, 2.7, 0.25, 0.32), (3.10, 3.2, 0.34, 0.44)),
    ("standard", "rico_oblique"): ((3.34, 3.4, 0.18, 0.23), (2.27, 2.9, 0.29, 0.38)),
    ("standard", "rico_ground_shadow"): ((3.23, 3.3, -0.80, 1.04), (3.12, 3.3, -0.65, 0.84)),
    ("standard", "rico_ground_sun"): ((1.81, 1.9, -0.44, 0.57), (1.74, 1.9, -0.14, 0.18)),
    ("preview", "rico_nadir"): ((2.58, 2.7, 0.25, 0.32), (3.01, 3.2, -0.03, 0.10)),
    ("preview", "rico_ground_shadow"): ((3.23, 3.3, -0.80, 1.04), (3.11, 3.3, -0.68, 0.88)),
}


@pytest.fixture(scope="module")
def solvers() -> dict[str, SimpleNamespace]:
    """By quality, those that light what is the same only once: views differ in where they look."""

    def remembering(solver: Solver) -> SimpleNamespace:
        known = {}

        def solve(scene, sun, wavelengths_nm):
            key = fingerprint(scene), sun.tobytes(), wavelengths_nm.tobytes()
            if key not in known:
                known[key] = solver.solve(scene, sun, wavelengths_nm)
            return known[key]

        return SimpleNamespace(name=solver.name, solve=solve)

    return {quality: remembering(Solver(quality=quality)) for quality, _ in MEASURED}


@pytest.mark.slow
@pytest.mark.parametrize(("quality", "view"), MEASURED)
def test_cumulus_by_monte_carlo(quality: str, view: str, shared: Path, solvers) -> None:
    reference = read_reference(shared / "reference" / "clouds" / f"{view}_sza60.nc")
    rows = list(compare(reference, solvers[quality], PhaseTables([])))
    assert [row.quantity for row in rows] == ["radiance, albedo 0", "radiance, albedo 0.2"]
    for row, (_, most, _, most_bias) in zip(rows, MEASURED[quality, view], strict=True):
        assert row.n >= 100
        assert 100 * row.relative_rmse < most, row
        assert 100 * abs(row.bias) < most_bias, row
