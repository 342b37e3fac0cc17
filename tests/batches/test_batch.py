"""Batches of small skies by the quickest solver."""

import json
import multiprocessing
import os
import signal
import time
from concurrent.futures import Future, ProcessPoolExecutor
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray as xr
from tests.batches.one_process import done, outcomes

import openswim
from openswim import Camera, Scene, UserError
from openswim.batches import Work, processes, read_plan
from openswim.batches import tasks as tasks_module
from openswim.batches.tasks import part_of, tasks_of
from openswim.batches.working import Outcome
from openswim.cli.main import run
from openswim.system import side_by_side
from openswim.system.side_by_side import fitting

PLAN = """openswim_batch = 1
files = "run_*.nc"
output = "out"
solver = "swim"
sun = [200, 40]

[[camera]]
name = "roof"
x_m = 1500
y_m = 1500
size = 12
outputs = [".png", ".nc"]

[[camera]]
name = "around"
view = "panorama"
x_m = 1000
y_m = 1500
size = "24x8"
"""


@pytest.fixture(scope="module")
def weather(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Three hours of weather in three files."""
    folder = tmp_path_factory.mktemp("weather")
    axis, height = np.arange(4) * 1000.0, np.array([0.0, 1000.0, 2000.0])
    for n in range(3):
        cloud = np.zeros((3, 4, 4), np.float32)
        cloud[1, n:] = 2e-3
        scene = Scene.from_arrays(cloud, axis, axis, height, time=f"2026-07-10T1{n}:00")
        scene.to_netcdf(folder / f"run_{n}.nc")
    return folder


@pytest.fixture
def plan(weather: Path, tmp_path: Path) -> Path:
    for file in weather.iterdir():
        os.link(file, tmp_path / file.name)
    (tmp_path / "plan.toml").write_text(PLAN)
    return tmp_path / "plan.toml"


def _files(folder: Path) -> dict[str, int]:
    """Pictures and data with the time of their making."""
    return {path.name: path.stat().st_mtime_ns for path in folder.iterdir() if path.suffix in (".png", ".nc")}


def test_pictures_are_those_of_render_and_are_made_once(plan: Path) -> None:
    work = Work.of(read_plan(plan))
    assert [task.name for task in work.waiting] == [f"20260710T1{n}0000" for n in range(3)]
    assert [Path(task.files[0]).name for task in work.tasks] == ["run_0.nc", "run_1.nc", "run_2.nc"]
    first = done(work)
    assert [one.failure for one in first] == ["", "", ""]
    made = _files(plan.parent / "out")
    assert len(made) == 9
    with xr.open_dataset(plan.parent / "out/roof_20260710T110000.nc") as found:
        scene = openswim.open_scene(plan.parent / "run_1.nc")
        truth = openswim.render(scene, Camera.allsky(x_m=1500, y_m=1500, size=12), "swim", sun=(200, 40))
        np.testing.assert_array_equal(found["radiance"], truth["radiance"])
    assert Work.of(read_plan(plan)).waiting == ()
    # what is another one, gone or damaged is made again, and nothing else
    out = plan.parent / "out"
    (out / "around_20260710T100000.png").unlink()
    (out / "roof_20260710T110000.nc").write_bytes(b"CDF")
    os.utime(plan.parent / "run_2.nc")
    again = Work.of(read_plan(plan))
    assert [task.name[-6:] for task in again.waiting] == ["100000", "110000", "120000"]
    assert [one.made for one in done(again)] == [1, 1, 2]
    kept = {name for name, when in _files(out).items() if made[name] == when}
    assert kept == {"roof_20260710T100000.png", "roof_20260710T100000.nc", "around_20260710T110000.png"}


def test_changes_of_a_plan_make_what_they_touch(plan: Path) -> None:
    marks = [task.mark_of(camera) for task in tasks_of(read_plan(plan)) for camera in read_plan(plan).cameras]

    def after(change: str, to: str) -> list[bool]:
        plan.write_text(PLAN.replace(change, to))
        changed = read_plan(plan)
        return [task.mark_of(camera) not in marks for task in tasks_of(changed) for camera in changed.cameras]

    assert after("size = 12", "size = 13") == [True, False] * 3
    assert after('solver = "swim"', 'solver = "fast"') == [True] * 6
    assert after('output = "out"', 'output = "elsewhere"') == [False] * 6
    assert after('output = "out"', 'times = ["2026-07-10T12:00"]') == [False] * 2


def test_light_for_renderers_is_whole_with_its_companions(plan: Path) -> None:
    """A .hdr of a panorama comes with two more files, without which it does not count as made."""
    plan.write_text(PLAN.replace('"24x8"', '"24x8"\noutputs = ".hdr"').replace("run_*.nc", "run_0.nc"))
    assert [one.made for one in done(Work.of(read_plan(plan)))] == [2]
    stem = plan.parent / "out/around_20260710T100000"
    assert all(stem.with_suffix(suffix).exists() for suffix in (".hdr", ".cal", ".rad"))
    assert Work.of(read_plan(plan)).waiting == ()
    stem.with_suffix(".rad").unlink()
    assert [one.made for one in done(Work.of(read_plan(plan)))] == [1]


def test_parts_share_the_tasks(plan: Path) -> None:
    tasks = tasks_of(read_plan(plan))
    parts = [part_of(tasks, (which, 2)) for which in (1, 2)]
    assert sorted(task.name for part in parts for task in part) == [task.name for task in tasks]
    assert [len(part) for part in parts] == [2, 1]


def test_a_share_without_work_makes_the_folder_all_the_same(plan: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """As of a job array that has more jobs than there are times."""
    assert run(["batch", str(plan), "--part", "9/9"]) == 0, capsys.readouterr().err
    assert len((plan.parent / "out/manifest.jsonl").read_text().splitlines()) == 1


def test_files_without_a_time_that_is_wanted_are_told(plan: Path) -> None:
    plan.write_text(PLAN.replace('output = "out"', 'from = "2030-01-01"'))
    with pytest.raises(UserError, match=r"no time from 2030-01-01T00:00:00 in it.* they have 2026-07-10T10:00:00, "):
        Work.of(read_plan(plan))
    assert not Work.of(read_plan(plan), unreadable={}).tasks  # of a watched folder it may be in time later


def test_times_that_no_file_has_are_told(plan: Path) -> None:
    plan.write_text(PLAN.replace('output = "out"', 'times = ["2026-07-10T10:30"]'))
    with pytest.raises(UserError, match="no time 2026-07-10T10:30"):
        tasks_of(read_plan(plan))
    plan.write_text(PLAN.replace('output = "out"', 'from = "2026-07-10T10:30"\nto = "2026-07-10T11:30"'))
    assert [task.name for task in tasks_of(read_plan(plan))] == ["20260710T110000"]


def test_a_plan_of_very_many_pictures_is_refused_before_they_are_counted(
    plan: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(tasks_module, "MOST_PICTURES", 100)
    plan.write_text(PLAN.replace('output = "out"', f"members = {list(range(5000))}"))
    made: list[object] = []
    monkeypatch.setattr(tasks_module, "Task", lambda *about: made.append(about))
    with pytest.raises(UserError, match="several plans"):
        tasks_of(read_plan(plan))
    assert len(made) == 51  # of two cameras


def test_no_picture_replaces_what_is_read(plan: Path) -> None:
    demo = plan.parent / "run_0.nc"
    demo.rename(plan.parent / "roof_20260710T100000.nc")
    plan.write_text(PLAN.replace("run_*.nc", "*.nc").replace('output = "out"', 'output = "."'))
    with pytest.raises(UserError, match="would replace"):
        tasks_of(read_plan(plan))


def test_no_more_workers_than_memory_holds(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(side_by_side, "free_memory", lambda: 10e9)
    assert fitting(8, 1, 1e9) == 8
    assert fitting(8, 1, 2e9) == 5  # 8 GB may be used: four more
    assert fitting(8, 1, 1e11) == 1


def test_a_killed_worker_costs_its_task_only_and_bad_files_are_listed(
    plan: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """The first worker is killed when it has its second task, which is done again; a file that is none fails alone."""
    (plan.parent / "run_3.nc").write_bytes(b"CDF\x01 and nothing")
    plan.write_text(PLAN.replace('"run_*.nc"', '["run_0.nc", "run_1.nc", "run_3.nc"]'))
    stopped: list[int] = []
    killed: list[int] = []

    def stops(outcome: Outcome) -> None:
        """Lest it be through with the next task before it is killed."""
        if not stopped:
            (worker,) = multiprocessing.active_children()
            stopped.append(worker.pid or 0)
            os.kill(stopped[0], signal.SIGSTOP)

    class Deadly(ProcessPoolExecutor):
        def submit(self, *work: Any) -> Future[Outcome]:
            future = super().submit(*work)
            if stopped and not killed:
                killed.append(stopped[0])
                while not future.running():
                    time.sleep(0.001)
                os.kill(killed[0], signal.SIGKILL)
            return future

    monkeypatch.setattr(side_by_side, "ProcessPoolExecutor", Deadly)
    report = openswim.batch(plan, jobs=1, tell=stops)
    assert killed
    assert (len(report.made), [one.task for one in report.failed]) == (2, ["run_3.nc"])
    lines = [json.loads(line) for line in (plan.parent / "out/manifest.jsonl").read_text().splitlines()]
    assert [line["task"] for line in lines[1:]] == ["20260710T100000", "20260710T110000"]
    assert not [path for path in (plan.parent / "out").iterdir() if path.name.startswith(".openswim")]
    assert len(_files(plan.parent / "out")) == 6
    assert run(["batch", str(plan), "--jobs", "1"]) == 2
    assert "0 made, 2 stood already, 1 failed" in capsys.readouterr().out
    assert run(["batch", str(plan), str(plan.parent / "run_3.nc")]) == 2


def test_failures_are_listed_and_tried_again(
    plan: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(processes, "outcomes", outcomes)
    with xr.open_dataset(plan.parent / "run_1.nc") as held:
        bad = held.load().copy()
    good = (plan.parent / "run_1.nc").read_bytes()
    bad["extinction_cloud"] = bad["extinction_cloud"] * np.nan
    (plan.parent / "run_1.nc").unlink()
    bad.to_netcdf(plan.parent / "run_1.nc")
    assert run(["batch", str(plan), "--dry-run"]) == 0
    assert "3 times and members, 0 of them done; 9 files by" in capsys.readouterr().err
    assert not (plan.parent / "out").exists()
    assert run(["batch", str(plan)]) == 2
    told = capsys.readouterr()
    assert "2 made, 0 stood already, 1 failed" in told.out
    assert "failed: 20260710T110000: " in told.err
    (plan.parent / "run_1.nc").write_bytes(good)
    assert run(["batch", str(plan)]) == 0
    assert "1 made, 2 stood already, 0 failed" in capsys.readouterr().out


def test_where_nothing_can_be_estimated_it_is_said_why(plan: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for path in plan.parent.glob("run_*.nc"):
        with xr.open_dataset(path) as held:
            bad = held.load().copy()
        bad["extinction_cloud"] = bad["extinction_cloud"] * np.nan
        path.unlink()
        bad.to_netcdf(path)
    assert run(["batch", str(plan), "--dry-run"]) == 0
    told = capsys.readouterr().err
    assert "what they take is not told, since the first of them fail: " in told
    assert "extinction_cloud" in told


def test_a_dry_run_names_cameras_that_will_fail(plan: Path, capsys: pytest.CaptureFixture[str]) -> None:
    away = '[[camera]]\nname = "away"\nx_m = 9000\ny_m = 1500\nsize = 12\n'
    plan.write_text(PLAN.replace('[[camera]]\nname = "around"', f'{away}\n[[camera]]\nname = "around"'))
    assert run(["batch", str(plan), "--dry-run"]) == 0
    told = capsys.readouterr().err
    assert "estimated: about" in told
    assert "note: camera away will fail: the observer is outside the domain: " in told
    assert told.count("will fail") == 1


def test_a_camera_that_fails_is_named_and_the_others_are_made_counted_and_listed(
    plan: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """The domain has x of 0 to 3000 m; the cameras before and after the one outside of it are not touched by it."""
    monkeypatch.setattr(processes, "outcomes", outcomes)
    away = '[[camera]]\nname = "away"\nx_m = 9000\ny_m = 1500\nsize = 12\n'
    plan.write_text(PLAN.replace('[[camera]]\nname = "around"', f'{away}\n[[camera]]\nname = "around"'))
    assert run(["batch", str(plan)]) == 2
    told = capsys.readouterr()
    assert "0 made, 0 stood already, 3 failed (3 of them in part: 6 of 9 cameras' pictures made)" in told.out
    assert "failed: 20260710T110000: camera away: the observer is outside the domain" in told.err
    assert len(_files(plan.parent / "out")) == 9
    lines = [json.loads(line) for line in (plan.parent / "out/manifest.jsonl").read_text().splitlines()]
    assert [sorted(line["cameras"]) for line in lines[1:]] == [["around", "roof"]] * 3
    made = _files(plan.parent / "out")
    plan.write_text(plan.read_text().replace("9000", "0"))
    assert run(["batch", str(plan)]) == 0
    told = capsys.readouterr()
    assert "0 of them done; 3 files by" in told.err
    assert "3 made, 0 stood already, 0 failed, " in told.out
    now = _files(plan.parent / "out")
    assert len(now) == 12
    assert {name: now[name] for name in made} == made


def test_weather_that_fails_for_all_cameras_is_told_once(plan: Path) -> None:
    work = Work.of(read_plan(plan, [plan.parent / "run_0.nc"]))
    (plan.parent / "run_0.nc").unlink()
    (one,) = done(work)
    assert one.made == 0
    assert one.failure.startswith("all 2 cameras: ")
    assert one.failure.count("run_0.nc") == 1


def test_dask_workers_make_the_same_and_hand_back_lines(plan: Path) -> None:
    distributed = pytest.importorskip("distributed")
    plan.write_text(PLAN.replace('"run_*.nc"', '["run_0.nc", "run_1.nc"]'))
    work = Work.of(read_plan(plan))
    os.unlink(plan.parent / "run_1.nc")  # so that one fails
    with distributed.LocalCluster(
        n_workers=1, threads_per_worker=1, processes=False, dashboard_address=None
    ) as cluster:
        report = work.run(scheduler=cluster.scheduler_address)
    assert [(one.task, one.made) for one in report.made] == [("20260710T100000", 2)]
    assert [(one.task, one.fault) for one in report.failed] == [("20260710T110000", False)]
    assert len(_files(plan.parent / "out")) == 3


def test_a_scheduler_that_is_none_is_said(plan: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("distributed")
    from openswim.batches import cluster

    monkeypatch.setattr(cluster, "PATIENCE_S", 1)
    with pytest.raises(UserError, match="no Dask scheduler answers there"):
        Work.of(read_plan(plan)).run(scheduler="tcp://127.0.0.1:1")
