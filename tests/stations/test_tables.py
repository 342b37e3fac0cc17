"""Tables as strangers have them: other separators, names, clocks and units, rows that were cut."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import xarray as xr

from openswim.errors import UserError
from openswim.stations.files import read_station

MIDC = "Year,DOY,MST,Global PSP [W/m^2]\n" + "".join(f"2020,153,{hour}00,{50 * hour}\n" for hour in range(24))


def _read(path: Path, text: str) -> xr.Dataset:
    path.write_bytes(text.encode())
    return read_station(path, 47.0, 8.0)


@pytest.mark.parametrize("text", [
    "utc;ghi\n2020-06-01T12:00;700,25\n", "utc\tghi\n2020-06-01T12:00\t700.25\n",
    "UTC,GHI\r\n2020-06-01 12:00,700.25\r\n",
    '\ufeff"utc";"ghi"\n"2020-06-01 14:00+02:00";"700,25"\n', "# a, b\n\nutc,ghi\n20200601T1200,700.25\n",
    "year;doy;mst;Global PSP [W/m^2]\n2020;153;500;700,25\n",
])  # fmt: skip
def test_tables_of_other_programs_say_the_same(tmp_path: Path, text: str) -> None:
    found = _read(tmp_path / "x.csv", text)
    assert found.time.values == [np.datetime64("2020-06-01T12:00")]
    assert float(found.ghi[0]) == 700.25


@pytest.mark.parametrize(("text", "message"), [
    ("utc;ghi\n2020-06-01T12:00;1,025\n2020-06-01T13:00;700\n", "'1,025' in the column 'ghi' may be 1025 or 1.025"),
    ('utc,ghi\n2020-06-01T12:00,"700,25"\n', "write a decimal point"),
    ("utc,GHI,ghi\n2020-06-01T12:00,1,2\n", "'ghi' is there twice"),
    ("utc,ghi_kw\n2020-06-01T12:00,.7\n", "neither global irradiance"),
    ("utc,ghi_mj_m2\n2020-06-01T12:00,.7\n", "neither global irradiance"),
    ("utc,ghi\n2020-06-01T12:00,3.6\n", "no more than 3.6 W/m2 under a sun .* sums"),  # of an hour, MJ/m2
    ("utc,ghi,rh\n2020-06-01T12:00,700,.5\n2020-06-01T13:00,700,\n", "no more than 0.5 % in the column 'rh'"),
    ("utc,ghi\n2020-06-01 12.30,700\n", "time '2020-06-01 12.30' is not understood"),
    ("utc,ghi\n20200601120,700\n", "time '20200601120' is not understood"),
    ("utc,GHI_pyr,GHI_cs\n2020-06-01T12:00,400,900\n", "'GHI_pyr', 'GHI_cs' are no instruments of one ghi: .* 38 %"),
    ("year,doy,zone,Global PSP [W/m^2]\n2020,153,1200,700\n", "no column of times that its zone names"),
    ("DATE (MM/DD/YYYY),MST,Global PSP [W/m^2]\n06/01/2020,12:00 PM,700\n", "'12:00 PM' in its column MST is no time"),
])  # fmt: skip
def test_what_may_mean_two_things_is_refused(tmp_path: Path, text: str, message: str) -> None:
    with pytest.raises(UserError, match=rf"x\.csv: .*{message}"):
        _read(tmp_path / "x.csv", text)


def test_the_file_is_named_where_it_lies(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The folder is "." here, which stands in many a message."""
    monkeypatch.chdir(tmp_path)
    Path("x.csv").write_text("utc,ghi\n01.06.2020 12:00,700\n")
    with pytest.raises(UserError, match=r"^x\.csv: time '01\.06\.2020 12:00' is not understood"):
        read_station("x.csv", 47.0, 8.0)


def test_units_as_people_write_them(tmp_path: Path) -> None:
    for unit in ("W m⁻²", "W·m−2", "Watts/m²", "watt m**-2"):  # noqa: RUF001
        found = _read(tmp_path / "x.csv", f"utc,ghi [{unit}],dhi ({unit})\n2020-06-01T12:00,700,90\n")
        assert (float(found.ghi[0]), float(found.dhi[0])) == (700.0, 90.0)
        assert "note" not in found.attrs
    found = _read(tmp_path / "x.csv", "utc,ghi (kW m⁻²),dhi [BTU],dni [MJ/m2]\n2020-06-01T12:00,.7,90,3\n")
    assert float(found.ghi[0]) == 700.0
    assert found.attrs["note"].startswith("left out for a unit that is not understood: 'dhi [BTU]'; write W/m2")


def test_direct_and_diffuse_light_are_enough(tmp_path: Path) -> None:
    found = _read(tmp_path / "x.csv", "utc,Diffuse [W/m^2],dni\n2020-06-01T12:00,90,800\n")
    assert (float(found.dhi[0]), float(found.dni[0])) == (90.0, 800.0)
    assert "ghi" not in found


def test_a_leap_second_ends_the_second_before(tmp_path: Path) -> None:
    text = "utc,ghi\n2016-12-31T23:59:59Z,1\n2016-12-31T23:59:60Z,2\n2017-01-01T01:00:00+01:00,3\n"
    found = _read(tmp_path / "x.csv", text)
    assert found.time.values.astype("datetime64[s]").astype(str).tolist() == ["2016-12-31T23:59:59"] * 2 + [
        "2017-01-01T00:00:00"
    ]
    assert found.ghi.values.tolist() == [1, 2, 3]


def test_rows_that_were_cut_are_counted_or_refused(tmp_path: Path) -> None:
    found = _read(tmp_path / "x.txt", MIDC + "2020,154,0")
    assert found.attrs["note"] == "1 of 25 rows have not as many columns as there are names: left out"
    assert found.ghi.values.tolist() == [50.0 * hour for hour in range(24)]
    assert "note" not in _read(tmp_path / "x.txt", MIDC).attrs
    assert "has no end" in _read(tmp_path / "x.txt", MIDC[:-3]).attrs["note"]  # 11 of 1150
    assert "has no end" in _read(tmp_path / "x.csv", "utc,ghi\n2020-06-01T12:00,70").attrs["note"]
    with pytest.raises(UserError, match=r"x\.txt: 2 of 26 rows have not as many columns as .*: mend the file"):
        _read(tmp_path / "x.txt", MIDC + "2020,154,0\n2020,154\n")
