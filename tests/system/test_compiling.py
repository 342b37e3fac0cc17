"""What Numba keeps on disk may be damaged, or have no place; kernels run all the same."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from openswim import progress
from openswim.system import compiling

KERNEL = "from numba import njit\n\n@njit(cache=True)\ndef twice(x):\n    return 2 * x\n"
RUN = """
import kernels
from openswim.system.compiling import heal, tell_first_time
from openswim.progress import spoken
heal(vars(kernels).values())
tell_first_time([kernels.twice])
with spoken():
    print(kernels.twice(21), sum(kernels.twice.stats.cache_hits.values()))
"""


def _run(folder: Path, before: str = "", after: str = "") -> tuple[int, bool, str]:
    """What the kernel gives, whether it was found on disk, and what was said."""
    beside = {name: value for name, value in os.environ.items() if name != "NUMBA_CACHE_DIR"}  # the kernel's source
    done = subprocess.run(
        [sys.executable, "-c", before + RUN + after], cwd=folder, env=beside, capture_output=True, text=True, check=True
    )
    value, hits = map(int, done.stdout.split())
    return value, bool(hits), done.stderr


def test_what_is_damaged_is_made_anew(tmp_path):
    (tmp_path / "kernels.py").write_text(KERNEL)
    value, kept, said = _run(tmp_path)
    assert (value, kept) == (42, False)
    assert said == "note: kernels are compiled for this machine, once: at most about 5 s on an idle core\n"
    assert _run(tmp_path) == (42, True, "")
    for pattern, spoil in (
        ("*.nbi", lambda data: data[: len(data) // 2]),
        ("*.nbc", lambda data: b""),
        ("*.nbc", lambda data: data[:5000] + bytes([data[5000] ^ 4]) + data[5001:]),
    ):
        (file,) = (tmp_path / "__pycache__").glob(pattern)
        file.write_bytes(spoil(file.read_bytes()))
        value, kept, _ = _run(tmp_path)
        assert (value, kept) == (42, False)
    assert _run(tmp_path) == (42, True, "")


def test_of_other_packages_kernels_nothing_is_said(tmp_path):
    """Theirs may be compiled at every start; ours are still told of, after them."""
    (tmp_path / "kernels.py").write_text(KERNEL)
    other = "\nimport numba\ntheirs = numba.njit(lambda x: x + 1)\n"
    before_ours = f"{other}tell_first_time([kernels.twice])\nwith spoken():\n    theirs(1)\n    kernels.twice(1)\n"
    alone = RUN.replace("print(kernels.twice(21), sum(kernels.twice.stats.cache_hits.values()))", "pass") + other
    for run, said in ((f"{alone}with spoken():\n    theirs(1)\n", False), (alone + before_ours, True)):
        done = subprocess.run([sys.executable, "-c", run], cwd=tmp_path, capture_output=True, text=True, check=True)
        assert ("kernels are compiled" in done.stderr) == said


def test_kernels_are_counted_as_they_are_compiled(tmp_path):
    """By whatever shows progress; what ours call of others' is none of them, and what is kept is not compiled."""
    callers = "\n\n@njit(cache=True)\ndef more(x):\n    return twice(x) + len(str(x))\n"
    (tmp_path / "kernels.py").write_text(KERNEL + callers)
    watched = """
import kernels, sys
from openswim import progress
from openswim.system.compiling import tell_first_time

class Shown(progress.Quiet):
    def start(self, label, total): print(label)
    def advance(self, steps=1): print(steps)
    def close(self): print("end")

tell_first_time([kernels.twice, kernels.more])
with progress.use(Shown()):
    kernels.more(2)
    kernels.twice(2.0)
    kernels.more(3)
"""
    for said in ("kernels compiled\n0\n1\n1\nend\nkernels compiled\n2\n1\nend\n", ""):
        done = subprocess.run([sys.executable, "-c", watched], cwd=tmp_path, capture_output=True, text=True, check=True)
        assert done.stdout == said


def test_only_numba_unpickles(tmp_path):
    """So that who watches a process for files that bring programs with them sees none of ours."""
    (tmp_path / "kernels.py").write_text(KERNEL)
    _run(tmp_path)
    watch = (
        "import sys\nseen = set()\nsys.addaudithook(lambda event, _: event == 'pickle.find_class' and seen.add("
        "sys._getframe(1).f_globals['__name__'].partition('.')[0]))"
    )
    assert _run(tmp_path, watch, "sys.stderr.write(' '.join(seen))") == (42, True, "numba")


def test_a_place_for_kernels(tmp_path, monkeypatch):
    """A private folder where nothing else can be written: one that others could write to is not taken."""
    monkeypatch.setattr(compiling.tempfile, "tempdir", str(tmp_path))
    folder = compiling._private_folder()
    assert folder is not None
    assert folder.parent == tmp_path
    assert folder.stat().st_mode & 0o777 == 0o700
    assert compiling._private_folder() == folder
    folder.chmod(0o777)
    other = compiling._private_folder()
    assert other not in (None, folder)
    monkeypatch.setattr(compiling._settings, "CACHE_DIR", "")
    monkeypatch.setattr(compiling, "_writable", lambda folder: tmp_path in folder.parents)
    compiling.provide_cache.__wrapped__()
    assert Path(compiling._settings.CACHE_DIR).parent == tmp_path


def test_no_place_for_kernels(monkeypatch, capsys):
    monkeypatch.setattr(compiling._settings, "CACHE_DIR", "")
    monkeypatch.setattr(compiling._Kernel, "enable_caching", compiling._Kernel.enable_caching)
    monkeypatch.setattr(compiling, "_writable", lambda folder: False)
    monkeypatch.setattr(compiling, "_private_folder", lambda: None)
    with progress.spoken():
        compiling.provide_cache.__wrapped__()
    assert "set NUMBA_CACHE_DIR" in capsys.readouterr().err
    from numba import njit

    assert njit(cache=True)(lambda x: x + 1)(1) == 2


@pytest.mark.parametrize("spoken", [False, True])
def test_lines_are_told_on_the_command_line(monkeypatch, capsys, spoken):
    monkeypatch.setenv("OPENSWIM_PROGRESS", "0")
    if spoken:
        with progress.spoken():
            progress.tell("a line")
    progress.tell("another")
    assert capsys.readouterr().err == ("a line\n" if spoken else "")
