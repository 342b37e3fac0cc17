"""AERONET files: made ones of known particles, in the layout of version 3."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from openswim.errors import UserError
from openswim.stations.aeronet import read_aeronet

RADII = np.geomspace(0.05, 15.0, 22)
HEAD = ["AERONET Version 3;", "Made", "Version 3: AOD Level 1.5", "The following data are made up.",
        "Contact: none", "All Points,UNITS can be found at,,, the site"]  # fmt: skip


def _file(path: Path, head: list[str], columns: dict[str, list[object]]) -> Path:
    rows = zip(*columns.values(), strict=True)
    lines = [*head, ",".join(columns), *(",".join(map(str, row)) for row in rows)]
    path.write_text("\n".join(lines) + "\n")
    return path


@pytest.fixture
def direct(tmp_path: Path) -> Path:
    depth = {wl: 0.2 * (wl / 550) ** -1.4 for wl in (380, 440, 675, 870, 1020)}
    columns: dict[str, list[object]] = {"Date(dd:mm:yyyy)": ["27:05:2013"] * 2}
    columns |= {"Time(hh:mm:ss)": ["11:19:04", "19:00:00"]}
    columns |= {f"AOD_{wl}nm": [value, 2 * value] for wl, value in depth.items()} | {"AOD_1640nm": [-999.0] * 2}
    columns |= {"Precipitable_Water(cm)": [1.8, 2.2], "Ozone(Dobson)": [330, 330], "Site_Elevation(m)": [264] * 2}
    return _file(tmp_path / "made.lev15", HEAD, columns)


def _inversion(tmp_path: Path, sphericity: float) -> Path:
    """A lognormal mode of volume: median .3 um, standard deviation 1.8; index 1.45 + .004 i."""
    volume = np.exp(-0.5 * (np.log(RADII / 0.3) / np.log(1.8)) ** 2)
    columns: dict[str, list[object]] = {"Site": ["Made"], "Date(dd:mm:yyyy)": ["27:05:2013"]}
    columns |= {"Time(hh:mm:ss)": ["11:20:00"]}
    for wl in (440, 675, 870, 1020):
        columns |= {f"Refractive_Index-Real_Part[{wl}nm]": [1.45], f"Refractive_Index-Imaginary_Part[{wl}nm]": [0.004],
                    f"Single_Scattering_Albedo[{wl}nm]": [0.95], f"AOD_Extinction-Total[{wl}nm]": [0.2]}  # fmt: skip
    columns |= {"Sphericity_Factor(%)": [sphericity]} | {f"{r:.6f}": [v] for r, v in zip(RADII, volume, strict=True)}
    return _file(tmp_path / f"made{sphericity:g}.all", HEAD[:6], columns)


def test_depth_by_wavelength_and_time(direct: Path) -> None:
    found = read_aeronet(direct, time="2013-05-27T12:00")
    aerosol = found.aerosol()
    assert aerosol.base_height_m == 264
    for wl in (440, 500, 615, 870):
        assert float(aerosol.optical_depth_at(wl)) == pytest.approx(0.2 * (wl / 550) ** -1.4, rel=0.003)
    assert found.single["water_vapour_cm"] == 1.8
    assert read_aeronet(direct).depth_at(550) == pytest.approx(0.3, rel=1e-3)  # the mean of both rows
    with pytest.raises(UserError, match="six hours"):
        read_aeronet(direct, time="2013-06-27")


def test_of_a_period_its_own_rows_count(direct: Path) -> None:
    def depth(*period: str) -> float:
        return read_aeronet(direct, *period).depth_at(550)

    assert depth("2013-05-27T11:00", "2013-05-27T12:00") == pytest.approx(0.2, rel=1e-3)
    assert depth("2013-05-27T12:00", "2013-05-28") == pytest.approx(0.4, rel=1e-3)
    assert depth("2013-05-27", "2013-05-28") == pytest.approx(0.3, rel=1e-3)
    assert depth("2013-05-27T20:00", "2013-05-28") == pytest.approx(0.4, rel=1e-3)  # none within: the nearest
    with pytest.raises(UserError, match="six hours of 2013-05-28"):
        depth("2013-05-28T12:00", "2013-05-29")
    with pytest.raises(UserError, match="before it"):
        depth("2013-05-29", "2013-05-28")


def test_sizes_and_index_scatter_as_the_modes_they_are_of(tmp_path: Path, direct: Path) -> None:
    pytest.importorskip("miepython")
    from openswim.optics.spheres import Mode, lognormal_sizes, scattering_by_spheres

    found = read_aeronet([direct, _inversion(tmp_path, 100.0)], time="2013-05-27T11:00")
    exact = scattering_by_spheres(lognormal_sizes([Mode(0.3, 1.8, by="volume")], 200), 1.45 + 0.004j, 550.0)
    ours = found.particles(550.0)
    assert ours.single_scattering_albedo == pytest.approx(exact.single_scattering_albedo, abs=0.003)
    assert ours.phase.asymmetry == pytest.approx(exact.phase.asymmetry, abs=0.005)
    side = np.cos(np.radians([5, 30, 90, 150]))
    np.testing.assert_allclose(ours.phase.value(side), exact.phase.value(side), rtol=0.04)
    assert found.depth[440] == pytest.approx(0.2 * (440 / 550) ** -1.4)  # the direct sun's comes first
    assert dict(found.aerosol().single_scattering_albedo) == {440: 0.95, 675: 0.95, 870: 0.95, 1020: 0.95}  # type: ignore[arg-type]


def test_what_is_no_sphere_is_rough(tmp_path: Path) -> None:
    pytest.importorskip("miepython")
    round_ones = read_aeronet(_inversion(tmp_path, 100.0)).particles(440.0).phase
    mixed = read_aeronet(_inversion(tmp_path, 40.0))
    assert mixed.spherical == pytest.approx(0.4)
    glory = np.cos(np.radians([178.0]))
    assert mixed.particles(440.0).phase.value(glory) < round_ones.value(glory)


def test_retrieved_phase_functions_are_taken_as_they_are(tmp_path: Path) -> None:
    angles = [0.0, 3.0, 10.0, 30.0, 60.0, 90.0, 120.0, 150.0, 180.0]
    value = [40.0, 12.0, 6.0, 2.0, 0.5, 0.2, 0.15, 0.2, 0.3]
    columns: dict[str, list[object]] = {"Date(dd:mm:yyyy)": ["27:05:2013"], "Time(hh:mm:ss)": ["11:20:00"],
                                        "AOD_Extinction-Total[440nm]": [0.3]}  # fmt: skip
    columns |= {f"{a:.6f}[440nm]": [v] for a, v in zip(angles, value, strict=True)}
    found = read_aeronet(_file(tmp_path / "made.pfn", HEAD, columns))
    ratio = found.phase[440.0].value(np.cos(np.radians(angles))) / value
    np.testing.assert_allclose(ratio, ratio[0], rtol=1e-6)  # scaled to a mean of one, else the same


@pytest.mark.parametrize("text", ["", "a,b\n1,2\n", "Date(dd:mm:yyyy),Time(hh:mm:ss),AOD_500nm\n",
                                  "Date(dd:mm:yyyy),Time(hh:mm:ss),AOD_500nm\n27:05:2013,11:00:00,-999\n"])  # fmt: skip
def test_what_is_no_aeronet_file_is_refused(tmp_path: Path, text: str) -> None:
    (tmp_path / "x.lev15").write_text(text)
    with pytest.raises(UserError):
        read_aeronet(tmp_path / "x.lev15")


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("Time(hh:mm:ss)", "Tame", "made.lev15: no columns Date"),
        ("11:19:04", "11:19:04+02:00", "is no date and time"),
        ("264", "1e9", "height_m = 1e.09 is none"),
    ],
)
def test_damaged_tables_are_refused(direct: Path, old: str, new: str, message: str) -> None:
    direct.write_text(direct.read_text().replace(old, new))
    with pytest.raises(UserError, match=message):
        read_aeronet(direct, "2013-05-27T11:00")


def test_rows_of_several_sites_are_no_aerosol(direct: Path, tmp_path: Path) -> None:
    """Within a file, as those of all sites of a day are, and in files that are given together."""
    text = direct.read_text()
    files = []
    for name, places in (("one", (47.0, 47.0)), ("other", (-33.0, -33.0)), ("both", (47.0, -33.0))):
        first, second, third = text.splitlines()[-3:]
        rows = f"{first},Site_Latitude(Degrees)", f"{second},{places[0]}", f"{third},{places[1]}"
        files.append(tmp_path / f"{name}.lev15")
        files[-1].write_text("\n".join([*HEAD, *rows]) + "\n")
    assert read_aeronet(files[0]).single["latitude"] == 47
    for several in (files[:2], files[2]):
        with pytest.raises(UserError, match="rows of several sites, -33 and 47 degrees"):
            read_aeronet(several)


def test_a_row_that_was_cut_is_told_and_rows_that_are_there_twice_count_once(direct: Path) -> None:
    text = direct.read_text()
    last = text.splitlines()[-1]
    for more, depth, told in (
        (f"{last}\n{last}\n", 0.3, None), (last[:50], 0.3, "1 of 3 rows have not as many"), (last, 0.3, "no end"),
        (last.rpartition(",")[0] + "\n", 0.3, "1 of 3 rows have not as many"),
    ):  # fmt: skip
        direct.write_text(text + more)
        found = read_aeronet(direct)
        assert found.depth_at(550) == pytest.approx(depth, rel=1e-3)
        assert len(found.notes) == (told is not None)
        assert told is None or (told in found.notes[0] and str(direct) in found.notes[0])


def test_pages_of_the_web_service_are_read(direct: Path) -> None:
    """Each line has its end in HTML; the height would be lost, which is last."""
    head, *rest = direct.read_text().splitlines()
    direct.write_text("<br>\n".join([f"<html>{head}", *rest, "</body></html>"]) + "\n")
    found = read_aeronet(direct)
    assert found.single["height_m"] == 264
    assert not found.notes


def test_ozone_of_2017_is_in_atmospheres_times_centimetres(direct: Path) -> None:
    direct.write_text(direct.read_text().replace(",330,", ",0.330,"))
    assert read_aeronet(direct).single["ozone_du"] == pytest.approx(330)


@pytest.mark.parametrize(("old", "new", "message"), [
    ("AOD_440nm", "AOD_380nm", "'AOD_380nm' is there twice"), ("(cm)", "(mm)", "which has Precipitable_Water.cm."),
    (",1.8,", ",18,", "Precipitable_Water.cm. = 18, where"), (",1.8,", ",1.8x,", "'1.8x' in the column 'Precipitable"),
    ("Date(dd:mm:yyyy)", "A,B,Date(dd:mm:yyyy)", "2 of 2 rows have not as many"), (",AOD_675nm,", ",", "2 of 2 rows"),
    ("AOD_", "AOT_", "no optical depth .* of version 2"), ("27:05", "99:05", "'99:05:2013' '11:19:04' is no date"),
])  # fmt: skip
def test_columns_that_cannot_be_right_are_refused(direct: Path, old: str, new: str, message: str) -> None:
    direct.write_text(direct.read_text().replace(old, new))
    with pytest.raises(UserError, match=rf"made\.lev15: .*{message}"):
        read_aeronet(direct)


def test_sites_are_told_apart_by_their_names(direct: Path) -> None:
    *head, names, first, second = direct.read_text().splitlines()
    direct.write_text("\n".join([*head, f"AERONET_Site,{names}", f"One,{first}", f"Other,{second}"]) + "\n")
    with pytest.raises(UserError, match="rows of several sites, 'One' and 'Other'"):
        read_aeronet(direct)


def test_inversions_that_cannot_be_right_are_refused(tmp_path: Path) -> None:
    path = _inversion(tmp_path, 100.0)
    text = path.read_text()
    *_, smallest = text.partition(",100.0,")
    for old, new, message in (
        (",0.95,", ",95,", "Single_Scattering_Albedo.440nm. = 95"), (",100.0,", ",140,", "Sphericity_Factor.%. = 140"),
        (smallest.split(",")[0], "-999", "no value for a radius of 0.050000 um"),
    ):  # fmt: skip
        path.write_text(text.replace(old, new))
        with pytest.raises(UserError, match=message):
            read_aeronet(path)
