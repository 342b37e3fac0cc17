"""What most need is compiled by several processes, once; whatever befalls them, kernels run."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import NamedTuple

import numba
import numpy as np
import pytest

from openswim.system import first_start, side_by_side
from openswim.system.first_start import read, written
from openswim.system.machine import cores

COUNT = 9
KERNELS = "from numba import njit\n" + "".join(
    f"\n@njit(cache=True)\ndef times{n}(x):\n    return {n} * x\n" for n in range(COUNT)
)
IN_WORKERS = """
import os, sys, time
if sys.argv[0].endswith("first_start.py"):
    open(f"worker-{os.getpid()}", "w").close()
    time.sleep(SECONDS)
"""
RUN = """
import signal
signal.signal(signal.SIGINT, signal.default_int_handler)  # which a shell's background jobs are started without
import kernels
from pathlib import Path
from openswim.progress import spoken
from openswim.system.compiling import heal
from openswim.system.first_start import compile_together
heal(vars(kernels).values())
compile_together("kernels", Path("list.json"))
with spoken():
    print(*(kernels.times1(21), kernels.times8(2), sum(kernels.times8.stats.cache_hits.values())))
"""
BY_TWO = "note: kernels are compiled for this machine, once, by 2 processes: about 5 s\n"


class Two(NamedTuple):
    one: np.ndarray
    other: float


@pytest.fixture
def package(tmp_path):
    (tmp_path / "kernels.py").write_text(KERNELS)
    _list(tmp_path, "int64")
    return tmp_path


def _list(folder: Path, kind: str) -> None:
    entries = [{"name": f"kernels:times{n}", "seconds": 0.1, "kinds": [kind]} for n in range(COUNT)]
    (folder / "list.json").write_text(json.dumps(entries))


def _started(folder: Path, threads: int = 2, **options: object) -> subprocess.Popen[str]:
    environment = {name: value for name, value in os.environ.items() if name != "NUMBA_CACHE_DIR"}
    environment |= {"NUMBA_NUM_THREADS": str(threads)}
    return subprocess.Popen(
        [sys.executable, "-c", RUN], cwd=folder, env=environment, text=True, stdout=subprocess.PIPE,
        stderr=subprocess.PIPE, **options,
    )  # type: ignore[call-overload, no-any-return]  # fmt: skip


def _run(folder: Path, threads: int = 2) -> tuple[str, str]:
    """What is printed (of the last: whether it was found on disk) and what is said."""
    process = _started(folder, threads)
    out, said = process.communicate(timeout=120)
    assert process.returncode == 0, said
    return out.strip(), said


needs_two_cores = pytest.mark.skipif(cores() < 2, reason="one core compiles alone")


@needs_two_cores
def test_all_of_a_list_is_compiled_once(package):
    assert _run(package) == ("21 16 1", BY_TWO)
    assert len(list((package / "__pycache__").glob("*.nbi"))) == COUNT
    assert _run(package) == ("21 16 1", "")
    for file in (package / "__pycache__").glob("kernels.times8*"):
        file.unlink()
    assert _run(package) == ("21 16 0", "")  # one is not worth processes


def test_memory_that_no_system_tells_of_holds_all(monkeypatch):
    """Windows has neither of the files and calls that tell of it."""
    monkeypatch.setattr(first_start, "cores", lambda: 64)
    monkeypatch.setattr(first_start._settings, "NUMBA_NUM_THREADS", 64)
    for module in (first_start, side_by_side):
        monkeypatch.setattr(module, "free_memory", lambda: float("inf"))
    assert first_start._processes() == 4
    assert side_by_side.fitting(8, 1, 1e9) == 8
    monkeypatch.setattr(first_start, "free_memory", lambda: 2.5e9)
    assert first_start._processes() == 2
    monkeypatch.setattr(sys, "executable", "/opt/qgis/bin/qgis")
    assert first_start._processes() == 1


def test_one_thread_compiles_what_it_calls(package):
    assert _run(package, threads=1) == ("21 16 0", "")
    assert len(list((package / "__pycache__").glob("*.nbi"))) == 2


@needs_two_cores
def test_what_workers_cannot_compile_is_compiled_where_it_is_called(package):
    _list(package, "nonsense")
    assert _run(package) == ("21 16 0", BY_TWO)


@needs_two_cores
def test_workers_that_die_are_done_without(package):
    (package / "kernels.py").write_text(IN_WORKERS.replace("time.sleep(SECONDS)", "os._exit(3)") + KERNELS)
    assert _run(package) == ("21 16 0", BY_TWO)


@needs_two_cores
def test_where_no_process_can_be_started_there_is_one(package):
    """As at the limit of a user's processes, which Linux says by EAGAIN."""
    refused = "import errno, subprocess\ndef refuse(*_, **__): raise BlockingIOError(errno.EAGAIN, 'no more')\n"
    (package / "kernels.py").write_text(f"{refused}subprocess.Popen = refuse\n{KERNELS}")
    assert _run(package) == ("21 16 0", BY_TWO)


@needs_two_cores
@pytest.mark.parametrize("how", [signal.SIGKILL, signal.SIGINT])
def test_workers_end_with_who_started_them(package, how):
    (package / "kernels.py").write_text(IN_WORKERS.replace("SECONDS", "600") + KERNELS)
    process = _started(package)
    until = time.monotonic() + 60
    while len(list(package.glob("worker-*"))) < 2 and time.monotonic() < until:
        time.sleep(0.05)
    workers = [int(file.name.partition("-")[2]) for file in package.glob("worker-*")]
    assert len(workers) == 2
    process.send_signal(how)
    process.communicate(timeout=10)
    until = time.monotonic() + 10
    while any(Path(f"/proc/{worker}/cmdline").exists() for worker in workers) and time.monotonic() < until:
        time.sleep(0.05)
    assert not any(Path(f"/proc/{worker}/cmdline").exists() for worker in workers)


@needs_two_cores
def test_who_starts_meanwhile_waits(package):
    (package / "kernels.py").write_text(IN_WORKERS.replace("SECONDS", "2") + KERNELS)
    both = [_started(package), _started(package)]
    results = [process.communicate(timeout=120) for process in both]
    assert {out.strip() for out, _ in results} == {"21 16 1"}
    assert sorted(said for _, said in results) == sorted(
        [BY_TWO, "note: waits for another process, which compiles kernels\n"]
    )
    assert len(list(package.glob("worker-*"))) == 2


@needs_two_cores
def test_workers_import_nothing_that_lies_where_they_are_started(package, tmp_path_factory):
    """A folder of somebody's files may hold a numba.py; the console script does not look there either."""
    elsewhere = tmp_path_factory.mktemp("elsewhere")
    for name in ("numba", "json", "openswim", "kernels"):
        (elsewhere / f"{name}.py").write_text("open('imported', 'w').close()\n")
    script = package / "script.py"
    script.write_text(RUN.replace('"list.json"', repr(str(package / "list.json"))))
    environment = {name: value for name, value in os.environ.items() if name != "NUMBA_CACHE_DIR"}
    done = subprocess.run(
        [sys.executable, script], cwd=elsewhere, env={**environment, "NUMBA_NUM_THREADS": "2"}, capture_output=True,
        text=True, check=True,
    )  # fmt: skip
    assert (done.stdout.strip(), done.stderr) == ("21 16 1", BY_TWO)
    assert not (elsewhere / "imported").exists()


def test_types_are_read_as_they_are_written():
    kept = np.zeros((2, 3))
    fixed = kept.view()
    fixed.flags.writeable = False
    for value in (1, 2.5, True, np.float32(1), kept, kept.T, kept[:, ::2], fixed, fixed[:, ::2], (1, kept), (1, 2),
                  Two(kept, 1.0), Two(1.0, 2.0), ((1,), (Two(kept, 2.0), np.zeros(2, bool)))):  # fmt: skip
        kind = numba.typeof(value)
        assert read(written(kind)) == kind, written(kind)
    for text in ("int64)", "float32[1],int64"):
        with pytest.raises(ValueError, match="left over"):
            read(text)
    with pytest.raises(TypeError, match="numbers, arrays and tuples"):
        written(numba.typeof("text"))
