"""A folder in which clear skies arrive, rendered in this process."""

import json
import os
import re
from datetime import UTC, datetime
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from tests.batches.one_process import outcomes

from openswim import Scene, UserError
from openswim.batches import arrivals, processes, read_plan, tasks, watching
from openswim.batches.arrivals import Arrivals
from openswim.batches.index_page import page_of, write_index
from openswim.batches.records import Record, Records
from openswim.batches.watching import watch
from openswim.batches.working import Outcome
from openswim.cli.main import run

PLAN = """openswim_batch = 1
files = "sky_*.nc"
output = "web"
solver = "swim"
sun = [200, 40]

[[camera]]
name = "roof"
x_m = 1500
y_m = 1500
size = 4
"""


@pytest.fixture
def plan(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setattr(processes, "outcomes", outcomes)
    (tmp_path / "in").mkdir()
    (tmp_path / "plan.toml").write_text(PLAN)
    return tmp_path / "plan.toml"


def _arrives(plan: Path, hour: int, name: str = "") -> Path:
    axis, height = np.arange(4) * 1000.0, np.array([0.0, 1000.0, 2000.0])
    scene = Scene.from_arrays(np.full((3, 4, 4), 1e-4), axis, axis, height,
                              time=np.datetime64(f"2026-07-10T{hour:02d}:00", "ms"))  # fmt: skip
    path = plan.parent / "in" / (name or f"sky_{hour:02d}.nc")
    scene.to_netcdf(path)
    return path


def test_what_arrives_is_rendered_shown_and_pruned(plan: Path) -> None:
    told: list[Outcome] = []
    settled = Arrivals(plan.parent / "in", ["sky_*.nc"], settled_s=0.0)

    def looks(keep: int) -> set[str]:
        watch(read_plan(plan, watched=True), settled, keep=keep, every_s=0.0, looks=1, tell=told.append)
        return {path.name for path in (plan.parent / "web").iterdir() if not path.name.startswith(".")}

    rest = {"index.html", "style.css"}
    assert looks(3) == rest
    assert "No picture yet" in (plan.parent / "web/index.html").read_text()
    first = _arrives(plan, 6)
    _arrives(plan, 7)
    (plan.parent / "in/sky_bad.nc").write_bytes(b"CDF\x01<script>")
    pictures = {"roof_20260710T060000.png", "roof_20260710T070000.png"}
    assert looks(3) == rest | pictures | {"manifest.jsonl"}
    assert [(one.task[-6:], bool(one.failure)) for one in told] == [("060000", False), ("070000", False),
                                                                    ("bad.nc", True)]
    page = (plan.parent / "web/index.html").read_text()
    assert page.count("<img") == 1  # the newest
    assert 'src="roof_20260710T070000.png"' in page
    assert 'href="roof_20260710T060000.png"' in page
    assert "sky_bad.nc" in page
    # what is gone from the folder stays until it is too old; what is older than that is not even made
    first.unlink()
    _arrives(plan, 5)
    _arrives(plan, 8)
    assert looks(3) - rest == pictures | {"roof_20260710T080000.png", "manifest.jsonl"}
    assert [one.task[-6:] for one in told[3:]] == ["080000", "bad.nc"]  # a new watch tells it once
    assert looks(1) - rest == {"roof_20260710T080000.png", "manifest.jsonl"}
    assert len([one for one in told if not one.failure]) == 3


def test_files_that_are_old_or_bad_are_looked_at_once(plan: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Of a folder that fills, what is opened at each look does not grow."""
    opened: list[list[str]] = []
    states_of = tasks.states_of

    def counted(files: list[Path], allow_references: bool) -> object:
        opened.append([path.stem[4:] for path in files])
        return states_of(files, allow_references)

    monkeypatch.setattr(tasks, "states_of", counted)
    hours = iter((7, 8, 9))

    def sleep(seconds: float) -> None:
        opened.append([])
        _arrives(plan, next(hours))

    monkeypatch.setattr(watching, "clock", SimpleNamespace(sleep=sleep))
    _arrives(plan, 6)
    (plan.parent / "in/sky_bad.nc").write_bytes(b"CDF\x01")
    told: list[Outcome] = []
    watch(read_plan(plan, watched=True), Arrivals(plan.parent / "in", ["sky_*.nc"], settled_s=0.0), keep=1, looks=4,
          tell=told.append)  # fmt: skip
    assert opened == [["06", "bad"], ["06"], ["bad"], ["06"], [], ["06", "07"], [], ["07", "08"], [], ["08", "09"]]
    assert [one.task for one in told if one.failure] == ["sky_bad.nc"]
    assert "sky_bad.nc" in (plan.parent / "web/index.html").read_text()
    assert [path.name for path in (plan.parent / "web").glob("*.png")] == ["roof_20260710T090000.png"]


def test_files_that_grow_wait(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    now = [1000.0]
    monkeypatch.setattr(arrivals.clock, "monotonic", lambda: now[0])
    (tmp_path / "old.nc").write_text("long there")
    os.utime(tmp_path / "old.nc", (1, 1))
    seen = Arrivals(tmp_path, ["*.nc"], settled_s=20)
    assert [path.name for path, *_ in seen.whole()] == ["old.nc"]
    growing = tmp_path / "growing.nc"
    for _ in range(4):
        with growing.open("a") as file:
            file.write("more")
        assert [path.name for path, *_ in seen.whole()] == ["old.nc"]
        now[0] += 15
    assert [path.name for path, *_ in seen.whole()] == ["old.nc"]  # 15 s unchanged
    now[0] += 6
    assert [path.name for path, *_ in seen.whole()] == ["growing.nc", "old.nc"]
    (tmp_path / "empty.nc").touch()
    (tmp_path / ".hidden.nc").write_text("a download")
    (tmp_path / "link.nc").symlink_to("/etc/hostname")  # ends nothing
    (tmp_path / "loop.nc").symlink_to(tmp_path / "loop.nc")
    os.mkfifo(tmp_path / "pipe.nc")
    now[0] += 60
    seen.whole()
    now[0] += 60
    assert [path.name for path, *_ in seen.whole()] == ["growing.nc", "old.nc"]


def test_a_zarr_folder_is_whole_when_its_last_chunk_is(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Chunks deep inside change neither the folder's own size nor its time."""
    now = [1000.0]
    monkeypatch.setattr(arrivals.clock, "monotonic", lambda: now[0])
    chunks = tmp_path / "run.zarr/cloud/c"
    chunks.mkdir(parents=True)
    seen = Arrivals(tmp_path, ["*"], settled_s=20)
    for n in range(4):
        (chunks / str(n)).write_bytes(b"light")
        assert seen.whole() == []
        now[0] += 15
    now[0] += 6
    assert [path.name for path, *_ in seen.whole()] == ["run.zarr"]


def test_pages_escape_what_others_wrote(tmp_path: Path) -> None:
    nasty = '"><script>alert(1)</script>&'
    record = Record(Path("x"), nasty, nasty, nasty, {nasty: {f"{nasty}.png": 1}})
    write_index(SimpleNamespace(folder=tmp_path), [record], {"sky\udcff.nc": "x"})  # type: ignore[arg-type]
    assert "sky\\udcff.nc" in (tmp_path / "index.html").read_text("utf-8")
    page = page_of([record], {nasty: nasty}, datetime(2026, 7, 10, tzinfo=UTC))
    assert "<script" not in page
    assert not re.search(r"style=|<style|javascript:|\son\w+=", page)
    assert set(re.findall(r'(?:src|href)="([^"]*)"', page)) == {
        "style.css", "%22%3E%3Cscript%3Ealert%281%29%3C/script%3E%26.png"
    }  # fmt: skip


def test_only_what_was_made_is_removed(plan: Path) -> None:
    """Neither what no batch calls like that, nor links, nor what has changed since, nor what lies in a store."""
    folder, store = plan.parent / "web", plan.parent / "web/a_x.zarr"
    for made in (folder / ".batch", store):
        made.mkdir(parents=True)
    others = ("thesis.txt", "a.png", "a_y.png", "b_x.png", "a_x.txt")
    for file in (*others, "a_x.png", "a_x_mean.png", "a_x.nc", "a_x.zarr/zarr.json", "a_x.zarr/notes.txt"):
        (folder / file).write_text("x")
    (folder / "a_x.tif").symlink_to(plan)
    files = {"../plan.toml": plan.stat().st_size, "a/../../plan.toml": plan.stat().st_size, str(plan): 1,
             "a_x.tif": plan.stat().st_size, "a_x.nc": 2, "a_x.zarr": -1}  # fmt: skip
    files |= dict.fromkeys((*others, "a_x.png", "a_x_mean.png"), 1)
    (folder / ".batch/x.json").write_text(
        json.dumps({"task": "y", "weather": "", "time": "None", "cameras": {"a": {"files": files}}})
    )
    records = Records(folder)
    (record,) = records.standing()
    assert set(record.files["a"]) == {"a_x.tif", "a_x.png", "a_x_mean.png", "a_x.nc", "a_x.zarr"}
    records.remove(record)
    assert plan.exists()
    assert {path.name for path in folder.iterdir()} == {".batch", "a_x.tif", "a_x.nc", "a_x.zarr", *others}
    assert records.standing() == []
    (store / "notes.txt").unlink()
    records.remove(record)
    assert not store.exists()


def test_nothing_is_removed_where_a_link_leads_out_of_the_folder(plan: Path) -> None:
    folder, elsewhere = plan.parent / "web", plan.parent / "elsewhere"
    (folder / ".batch/run").mkdir(parents=True)
    elsewhere.mkdir()
    (folder / "run").symlink_to(elsewhere)
    (elsewhere / "a_x.png").write_text("x")
    (folder / ".batch/run/x.json").write_text(json.dumps(
        {"task": "run/x", "weather": "run", "time": "None", "cameras": {"a": {"files": {"run/a_x.png": 1}}}}
    ))  # fmt: skip
    records = Records(folder)
    (record,) = records.standing()
    assert set(record.files["a"]) == {"run/a_x.png"}
    records.remove(record)
    assert (elsewhere / "a_x.png").exists()


def test_pictures_that_lie_in_the_watched_folder_are_no_weather(plan: Path) -> None:
    inside = plan.parent / "in"
    plan.write_text(PLAN.replace('"web"', '"in/web"').replace("sky_*.nc", "*"))
    _arrives(plan, 6)
    told: list[Outcome] = []
    for _ in range(2):
        watch(read_plan(plan, watched=True), Arrivals(inside, ["*"], settled_s=0.0), every_s=0.0, looks=1,
              tell=told.append)  # fmt: skip
    assert [(one.task, one.failure) for one in told] == [("20260710T060000", "")]
    with pytest.raises(UserError, match="where pictures are written"):
        watch(read_plan(plan, output=inside, watched=True), Arrivals(inside, ["*"]), looks=0)


def test_files_of_others_are_not_replaced(plan: Path) -> None:
    web = plan.parent / "web"
    web.mkdir()
    arrivals_ = Arrivals(plan.parent / "in", ["*"], settled_s=0.0)
    for name in ("style.css", "manifest.jsonl"):
        (web / name).write_text("mine")
        _arrives(plan, 6)
        with pytest.raises(UserError, match=name):
            watch(read_plan(plan, watched=True), arrivals_, every_s=0.0, looks=1)
        (web / name).unlink()
    (web / "index.html").mkdir()
    with pytest.raises(UserError, match=r"index\.html"):
        watch(read_plan(plan, watched=True), arrivals_, every_s=0.0, looks=1)


def test_what_cannot_be_watched_is_said(plan: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (plan.parent / "web").mkdir()
    (plan.parent / "web/index.html").write_text("<html>my own page")
    for line, says in (
        (["--watch", str(plan.parent / "none")], "no such folder"),
        (["--watch", str(plan.parent / "in")], "not of OpenSWIm"),
        (["--watch", str(plan.parent / "in"), "--part", "1/2"], "neither"),
        (["--keep", "3"], "belongs to --watch"),
        (["--watch", str(plan.parent / "in")], "of one run"),
    ):
        if says == "of one run":
            plan.write_text(PLAN.replace('files = "sky_*.nc"', "") + '[[weather]]\nname = "a"\nfiles = "*"\n')
        assert run(["batch", str(plan), *line]) == 2
        assert says in capsys.readouterr().err
    plan.write_text(PLAN)
    with pytest.raises(UserError, match="1 time or more"):
        watch(read_plan(plan, watched=True), Arrivals(plan.parent / "in", ["*"]), keep=0)
