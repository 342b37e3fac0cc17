"""Ensembles of slabs of cloud, of which each answer is known."""

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import xarray as xr
from PIL import Image
from tests.batches.one_process import done

from openswim import Scene, UserError
from openswim.batches import Work, ensembles, read_plan
from openswim.batches.ensembles import CLEAR, CLOUDY, cloud_picture, outcomes, together
from openswim.cli.main import run

PEAK_PER_M = {"a": 2e-3, "b": 4e-3, "c": 1e-5, "d": 0.0}  # of slabs 2 km deep, that rise and fall with height evenly
PLAN = """openswim_batch = 1
solver = "swim"
sun = [180, 60]

[[camera]]
name = "roof"
x_m = 1500000
y_m = 1500000
size = 9
outputs = ".png"

[ensemble]
cloud_depth = 0.03
""" + "".join(f'\n[[weather]]\nname = "{name}"\nfiles = "{name}.nc"\n' for name in PEAK_PER_M)


@pytest.fixture(scope="module")
def plan(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A plan whose members are done."""
    folder = tmp_path_factory.mktemp("ensemble")
    axis, height = np.arange(4) * 1e6, np.array([0.0, 1000.0, 2000.0])
    for name, peak in PEAK_PER_M.items():
        cloud = np.zeros((3, 4, 4), np.float32)
        cloud[1] = peak
        scene = Scene.from_arrays(cloud, axis, axis, height, time=np.datetime64("2026-07-10T12:00", "ms"),
                                  atmosphere=None, surface_albedo=0.2)  # fmt: skip
        scene.to_netcdf(folder / f"{name}.nc")
    (folder / "plan.toml").write_text(PLAN)
    work = Work.of(read_plan(folder / "plan.toml"))
    assert not list(outcomes(work.plan, work.tasks))  # no member stands
    assert [one.failure for one in done(work)] == [""] * 4
    return folder / "plan.toml"


def test_probabilities_and_means_are_those_of_the_members(plan: Path) -> None:
    work = Work.of(read_plan(plan))
    (one,) = together(work.plan, work.tasks)
    assert one.name == "ensemble/20260710T120000"
    assert [(out.failure, out.made) for out in outcomes(work.plan, work.tasks)] == [("", 1)]
    out = work.plan.folder
    members = {}
    for name in PEAK_PER_M:
        with xr.open_dataset(out / name / "roof_20260710T120000.nc") as found:
            members[name] = found.load()
    with xr.open_dataset(out / "ensemble/roof_20260710T120000.nc") as found:
        data = found.load()
    up = members["a"]["altitude"].values > 20
    slant = 1 / np.sin(np.radians(members["a"]["altitude"].values[up]))
    for name, peak in PEAK_PER_M.items():  # the depth of a slab is half of peak times height
        np.testing.assert_allclose(members[name]["cloud_optical_depth"].values[up], peak * 1000 * slant, rtol=1e-4)
    # c has .01 upward, which reaches .03 below 19.5 degrees only
    np.testing.assert_array_equal(data["cloud_probability"].values[up], 0.5)
    # e^-2.3 of the beam is over 120 W m-2, e^-4.6 is not
    assert float(data["sun_probability"]) == 0.75
    beam = data["direct_normal_irradiance_w_m2"]
    expected = float(beam[3]) * np.exp(-np.array([2, 4, 0.01, 0]) / np.sin(np.radians(60)))
    np.testing.assert_allclose(beam, expected, atol=0.01)
    mean = np.mean([one["radiance"].values for one in members.values()], axis=0)
    np.testing.assert_allclose(data["radiance"], mean, rtol=1e-6)
    assert [str(name) for name in data["member"].values] == [f"{name}/20260710T120000" for name in PEAK_PER_M]
    assert data.attrs["source"].startswith("mean of 4 members")
    with Image.open(out / "ensemble/roof_20260710T120000_mean.png") as picture:
        assert picture.size == (9, 9)


def test_it_is_made_once_and_anew_for_another_question(plan: Path) -> None:
    work = Work.of(read_plan(plan))
    list(outcomes(work.plan, work.tasks))
    assert not list(outcomes(work.plan, work.tasks))
    plan.write_text(PLAN.replace("0.03", "3"))
    work = Work.of(read_plan(plan))
    assert work.waiting == ()  # the members stay
    assert [out.made for out in outcomes(work.plan, work.tasks)] == [1]
    with xr.open_dataset(work.plan.folder / "ensemble/roof_20260710T120000.nc") as found:
        middle = found["cloud_probability"].values[4, 4]
    assert middle == 0.25  # b alone
    plan.write_text(PLAN)


def test_a_camera_whose_members_fail_keeps_no_other_from_its_ensemble(plan: Path) -> None:
    """The members have no pictures of a camera that has just been added."""
    other = '\n[[camera]]\nname = "other"\nx_m = 1500\ny_m = 1500\nsize = 9\noutputs = [".nc"]\n'
    plan.write_text(PLAN.replace("0.03", "2.8") + other)
    work = Work.of(read_plan(plan))
    assert [(out.failure, out.made) for out in outcomes(work.plan, work.tasks)] == [("", 1)]
    assert not list(outcomes(work.plan, work.tasks))
    plan.write_text(PLAN)


def test_the_command_counts_ensembles_apart(plan: Path, capsys: pytest.CaptureFixture[str]) -> None:
    plan.write_text(PLAN.replace("0.03", "2.9"))
    assert run(["batch", str(plan)]) == 0
    told = capsys.readouterr()
    assert "4 of them done; nothing is left to render" in told.err
    assert "0 made, 4 stood already, 0 failed, 1 ensemble put together" in told.out
    plan.write_text(PLAN)


def test_a_run_that_cannot_be_read_keeps_no_other_from_being_made(
    plan: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """It is told; no ensemble is put together without it until it is whole. Where none can be read nothing is made."""
    for name in PEAK_PER_M:
        (tmp_path / f"{name}.nc").write_bytes(plan.with_name(f"{name}.nc").read_bytes())
    (tmp_path / "plan.toml").write_text(PLAN + '\n[picture]\nexposure = 9.0\n')
    whole = (tmp_path / "b.nc").read_bytes()
    (tmp_path / "b.nc").write_bytes(whole[:2000])
    work = Work.of(read_plan(tmp_path / "plan.toml"))
    assert [task.weather for task in work.waiting] == ["a", "c", "d"]
    report = replace(work, waiting=()).run()
    assert report.failed[0].told == report.failed[0].failure  # which begins with the file's name
    assert "b.nc: " in report.failed[0].failure
    assert [one.failure for one in done(work)] == [""] * 3
    assert not list(outcomes(work.plan, work.tasks, work.incomplete))
    (tmp_path / "b.nc").write_bytes(whole)
    work = Work.of(read_plan(tmp_path / "plan.toml"))
    assert [one.failure for one in done(work)] == [""]
    assert [out.made for out in outcomes(work.plan, work.tasks, work.incomplete)] == [1]
    for name in PEAK_PER_M:
        (tmp_path / f"{name}.nc").write_bytes(whole[:2000])
    assert run(["batch", str(tmp_path / "plan.toml")]) == 2
    assert re.search(r"error: .*a\.nc: ", capsys.readouterr().err)


def test_a_fault_in_one_ends_no_other(plan: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    plan.write_text(PLAN.replace("0.03", "0.3"))
    work = Work.of(read_plan(plan))

    def broken(*_: object) -> xr.Dataset:
        raise ZeroDivisionError("of ours")

    monkeypatch.setattr(ensembles, "joined", broken)
    (one,) = outcomes(work.plan, work.tasks)
    assert (one.failure, one.fault) == ("ZeroDivisionError: of ours", True)
    plan.write_text(PLAN)


def test_what_cannot_be_asked_is_said(plan: Path) -> None:
    bad = plan.with_name("bad.toml")
    for change, to, says in (('"swim"', '"reference"', "reference"), ('name = "a"', 'name = "ensemble"', "folder")):
        bad.write_text(PLAN.replace(change, to))
        with pytest.raises(UserError, match=says):
            read_plan(bad)


def test_cloud_is_white_and_clear_sky_blue() -> None:
    picture = cloud_picture(np.array([[0.0, 1.0, np.nan, 0.5, 1.0]]), np.arange(5)[None] == 4)
    np.testing.assert_array_equal(picture[0, :3], [CLEAR, CLOUDY, (0, 0, 0)])
    assert (picture[0, 3] > np.array(CLEAR)).all()
    assert (picture[0, 4] < np.array(CLOUDY)).all()  # ground


def test_members_of_one_file_are_put_together(plan: Path, tmp_path: Path) -> None:
    """Members 5, 7 and 9 of one file, of which the first alone has cloud."""
    with xr.open_dataset(plan.with_name("a.nc")) as found:
        one = found.load()
    share = xr.DataArray([1.0, 0.0, 0.0], dims="number", coords={"number": [5, 7, 9]})
    one["extinction_cloud"] = (one["extinction_cloud"] * share).assign_attrs(one["extinction_cloud"].attrs)
    one.to_netcdf(tmp_path / "all.nc")
    (tmp_path / "plan.toml").write_text(PLAN.partition("[[weather]]")[0].replace(
        "openswim_batch = 1\n", 'openswim_batch = 1\nfiles = "all.nc"\nmembers = "all"\n'))  # fmt: skip
    work = Work.of(read_plan(tmp_path / "plan.toml"))
    assert [task.name for task in work.waiting] == [f"20260710T120000_m00{n}" for n in (5, 7, 9)]
    assert [one.failure for one in done(work)] == [""] * 3
    assert [out.failure for out in outcomes(work.plan, work.tasks)] == [""]
    with xr.open_dataset(work.plan.folder / "ensemble/roof_20260710T120000.nc") as found:
        assert float(found["cloud_probability"][4, 4]) == pytest.approx(1 / 3)
        assert float(found["sun_probability"]) == 1.0  # e^-2.3 of it is enough
        assert found.sizes["member"] == 3
