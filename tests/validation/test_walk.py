"""The walk: content decides, bad files are told and skipped, the table is worst first."""

import json
from pathlib import Path

import pytest
from tests.validation.fakes import FakeSolver, single_scattering

from openswim.errors import UserError
from openswim.validation import validate
from openswim.validation.reference import Row
from openswim.validation.report import as_table, write_json

TABLE = "sza,aod550,albedo,wl,vza,Lp\n60,0.0,0.1,450,0,2.5\n60,0.0,0.1,615,0,2.0\n"


def _radiance(scene, sun, origin, direction):
    return 2 + direction @ sun


def test_files_are_known_by_content_and_rubbish_is_skipped(tmp_path: Path) -> None:
    (tmp_path / "below").mkdir()
    (tmp_path / "below" / "no telling name.csv").write_text(TABLE)
    (tmp_path / "notes.csv").write_text("a,b\n1,2\n")
    (tmp_path / "empty.csv").write_text("")
    (tmp_path / "ragged.csv").write_text("a,b\n1\n")
    (tmp_path / "binary.csv").write_bytes(b"\xff\xfe\x00\x01")
    (tmp_path / "truncated.nc").write_bytes(b"\x89HDF\r\n\x1a\n" + bytes(40))
    (tmp_path / "junk.nc").write_text("junk")
    (tmp_path / "readme.md").write_text("not looked at")
    rows, skipped = validate(tmp_path, FakeSolver(_radiance))
    assert [row.case for row in rows] == ["no telling name"] * 2
    assert [row.relative_rmse for row in rows] == pytest.approx([0.25, 0.0])  # worst first
    named = {Path(line.split(":")[0]).name for line in skipped}
    assert all("xarray" not in line for line in skipped)
    assert named == {"notes.csv", "empty.csv", "ragged.csv", "binary.csv", "truncated.nc", "junk.nc"}
    assert all("\n" not in line for line in skipped)


def test_a_failing_solver_is_told_and_does_not_end_the_walk(tmp_path: Path) -> None:
    (tmp_path / "sky.csv").write_text(TABLE)

    def broken(scene, sun, origin, direction):
        raise ZeroDivisionError("by nought")

    rows, skipped = validate(tmp_path, FakeSolver(broken))
    assert rows == []
    assert len(skipped) == 1
    assert "sky.csv: failed in" in skipped[0]
    assert "ZeroDivisionError: by nought" in skipped[0]


@pytest.mark.parametrize("rows", ["a,0,x\na,180,1", "a,10,1\na,180,1"])
def test_a_bad_phase_table_is_told_and_does_not_end_the_walk(tmp_path: Path, rows: str) -> None:
    (tmp_path / "phases.csv").write_text(f"case,scat_angle_deg,P\n{rows}\n")
    (tmp_path / "sky.csv").write_text(TABLE)
    found, skipped = validate(tmp_path, FakeSolver(_radiance))
    assert {row.case for row in found} == {"sky"}
    assert [line.split(":")[0] for line in skipped] == ["phases.csv"]
    assert "\n" not in skipped[0]


def test_a_folder_that_is_none() -> None:
    with pytest.raises(UserError, match="no such folder"):
        validate(Path("/nowhere/at/all"), FakeSolver(single_scattering))


def test_rows_as_json_and_as_a_table(tmp_path: Path) -> None:
    rows = [
        Row("a", "fast", "radiance", 0.0512, -0.01, float("nan"), 7, 1.5),
        Row("b", "fast", "flux", float("nan"), float("nan"), 1.0, 0, 0.0),
    ]
    write_json(rows, tmp_path / "rows.json")
    saved = json.loads((tmp_path / "rows.json").read_text())
    assert list(saved[0]) == [
        "case", "solver", "quantity", "relative_rmse", "bias", "correlation", "n", "cpu_seconds",
    ]  # fmt: skip
    assert saved[0]["relative_rmse"] == 0.0512
    assert saved[0]["correlation"] is None
    assert saved[1]["relative_rmse"] is None
    table = as_table(rows)
    assert table.row_count == 2
    assert list(table.columns[2].cells) == ["5.12", "-"]
