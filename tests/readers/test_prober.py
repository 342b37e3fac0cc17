"""HDF5 files are opened by forks of one process before this one opens them: nothing outlives whoever asks."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable
from pathlib import Path

import netCDF4
import numpy as np
import pytest

from openswim.errors import UserError
from openswim.readers import states_of
from openswim.readers.common import probe, prober
from openswim.scene.procedural import demo_scene

_ASK = """
import signal, sys
signal.signal(signal.SIGINT, signal.default_int_handler)  # which shells have what runs in the background ignore
from openswim.readers.common.prober import prober
with prober() as own:
    own.verdict(sys.argv[1])
"""
_AT_ONCE_S = 5.0  # on a busy machine

pytestmark = pytest.mark.skipif(not Path("/proc/self/maps").exists(), reason="nobody tells which libraries are loaded")


@pytest.fixture(scope="module", autouse=True)
def one_prober() -> None:
    """None: tests here are about how each is started and ends."""


@pytest.fixture
def started(monkeypatch) -> list[subprocess.Popen]:
    """The processes that are started to look at files."""
    found: list[subprocess.Popen] = []
    start = prober._started

    def counted(libraries):
        found.append(start(libraries))
        return found[-1]

    monkeypatch.setattr(prober, "_started", counted)
    return found


@pytest.fixture
def series(tmp_path: Path) -> list[Path]:
    """Scenes of some times."""
    scene, paths = demo_scene(16, 16, 16), [tmp_path / f"{n}.nc" for n in range(4)]
    for path in paths:
        scene.to_netcdf(path)
        scene.time += np.timedelta64(5, "m")
    return paths


def _pointing(path: Path) -> None:
    """A file whose data lies in another one."""
    h5py = pytest.importorskip("h5py")
    with h5py.File(path, "w") as file:
        file.create_dataset("clwc", shape=(64,), dtype="u1", external=[("/etc/passwd", 0, 64)])


def _descendants(pid: int) -> list[int]:
    children = [int(each) for each in Path(f"/proc/{pid}/task/{pid}/children").read_text().split()]
    return [*children, *(each for child in children for each in _descendants(child))]


def _within(seconds: float, true: Callable[[], bool]) -> bool:
    until = time.monotonic() + seconds
    while not true() and time.monotonic() < until:
        time.sleep(0.02)
    return true()


def _gone(pid: int) -> bool:
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] == "Z"  # its heir may be slow
    except (OSError, IndexError):
        return True


@pytest.fixture
def waiting(tmp_path: Path):
    """Whoever asks, and those two that look, at a file that never opens."""
    os.mkfifo(tmp_path / "pipe")
    asks = subprocess.Popen([sys.executable, "-c", _ASK, str(tmp_path / "pipe")], stderr=subprocess.DEVNULL)
    try:
        assert _within(60, lambda: len(_descendants(asks.pid)) == 2)
        yield asks, _descendants(asks.pid)
    finally:
        asks.kill()
        asks.wait()


def test_many_files_take_one_process(series, started):
    assert [files for _, files in states_of(series)] == [[path] for path in series]
    assert len(started) == 1
    assert started[0].returncode == 0  # it has ended, and is buried


def test_one_that_points_elsewhere_is_named_and_costs_no_other(series, started):
    _pointing(series[1])
    with pytest.raises(UserError, match=r"1\.nc: its data lies in other files"):
        states_of(series)
    assert len(states_of([series[0], *series[2:]])) == 3
    assert len(started) == 1


def _with(monkeypatch: pytest.MonkeyPatch, folder: Path, written: str, instead: str) -> None:
    """A copy of the probe that is asked in its place."""
    source = Path(probe.__file__).read_text("utf-8")
    assert written in source
    (folder / "hasty.py").write_text(source.replace(written, instead), "utf-8")
    monkeypatch.setattr(probe, "__file__", str(folder / "hasty.py"))


def test_one_that_never_ends_costs_no_other(series, tmp_path, monkeypatch):
    """It has a second, by a copy: `test_bounds.py` has such a file, too, in the time that users' files have."""
    _with(monkeypatch, tmp_path, "CPU_S, ADDRESSES = 5,", "CPU_S, ADDRESSES = 1,")
    path = Path(os.environ.get("OPENSWIM_SHARED", "../shared")) / "data/hostile/flipped_hdf5.nc"
    if not path.is_file():
        pytest.skip("no reference data")
    with pytest.raises(UserError, match=r"flipped_hdf5\.nc: truncated or damaged"):
        states_of([series[0], path, *series[1:]])
    with prober.prober() as own:
        verdicts = [own.verdict(str(each)) for each in (series[0], path, *series[1:])]
    assert verdicts == [probe.SAFE, probe.DAMAGED, *3 * [probe.SAFE]]


def test_what_has_changed_is_looked_at_again(series):
    assert len(states_of(series)) == 4
    _pointing(series[2])
    with pytest.raises(UserError, match=r"2\.nc: its data lies in other files"):
        states_of(series)


def test_a_killed_one_is_replaced(series):
    with prober.prober() as own:
        assert own.verdict(str(series[0])) == probe.SAFE
        own._process.kill()
        own._process.wait()
        with pytest.raises(UserError, match=r"1\.nc: the process that looks at files .* was killed"):
            own.verdict(str(series[1]))
        assert own.verdict(str(series[1])) == probe.SAFE


def test_ctrl_c_is_for_whoever_asks_to_hear(series):
    """A terminal tells all; the one that looks would leave those behind that look for it."""
    with prober.prober() as own:
        own.verdict(str(series[0]))
        own._process.send_signal(signal.SIGINT)
        assert own.verdict(str(series[1])) == probe.SAFE


def test_it_ends_though_a_fork_holds_its_input(series, started):
    """As where another thread starts a process of multiprocessing meanwhile."""
    with prober.prober() as own:
        own.verdict(str(series[0]))
        held = os.dup(started[0].stdin.fileno())
        let_go = threading.Timer(20, os.close, [held])
        let_go.start()
    assert let_go.is_alive()
    let_go.cancel()
    os.close(held)


def test_each_file_has_little_time_and_memory(waiting):
    _, (_, looks) = waiting

    def limits() -> dict[str, list[str]]:
        lines = Path(f"/proc/{looks}/limits").read_text().splitlines()
        return {line[:26].strip(): line[26:].split() for line in lines}

    # it may have just begun
    assert _within(_AT_ONCE_S, lambda: limits()["Max address space"][0] == str(probe.ADDRESSES))
    rows = limits()
    assert rows["Max cpu time"][:2] == [str(probe.CPU_S), str(probe.CPU_S + 1)]
    assert rows["Max address space"][:2] == 2 * [str(probe.ADDRESSES)]


@pytest.mark.parametrize("how", [signal.SIGINT, signal.SIGTERM, signal.SIGKILL])
def test_nothing_outlives_whoever_asks(waiting, how):
    asks, (serves, looks) = waiting
    asks.send_signal(how)
    asks.wait(_AT_ONCE_S)
    assert _within(_AT_ONCE_S, lambda: _gone(serves) and _gone(looks))


def test_no_answer_in_time(tmp_path, monkeypatch):
    """By a copy that is in a hurry."""
    os.mkfifo(tmp_path / "pipe")
    _with(monkeypatch, tmp_path, "WALL_S = 120.0", "WALL_S = 0.3")
    netCDF4.Dataset(tmp_path / "a.nc", "w").close()
    with prober.prober() as own:
        with pytest.raises(UserError, match="pipe: could not be looked at within 120 s"):
            own.verdict(str(tmp_path / "pipe"))
        assert own.verdict(str(tmp_path / "a.nc")) == probe.SAFE
