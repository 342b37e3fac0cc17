"""Kernels are compiled anew when any of the package's kernels has changed, not only their own file."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from openswim.transport.stale import drop_stale

CALLED = "from numba import njit\n\n@njit(cache=True)\ndef called(x):\n    return x + {}\n"
CALLS = """
from numba import njit
from kernels.called import called

@njit(cache=True)
def calls(x):
    return 10 * called(x)
"""
RUN = """
from pathlib import Path
from kernels.calls import calls
from openswim.transport.stale import drop_stale
drop_stale(calls.stats.cache_path, Path("kernels"))
print(calls(1), sum(calls.stats.cache_hits.values()))
"""


@pytest.fixture
def folders(tmp_path: Path) -> tuple[Path, Path]:
    sources, cache = tmp_path / "sources", tmp_path / "cache"
    for folder in (sources, cache):
        folder.mkdir()
    (sources / "walk.py").write_text("a = 1\n")
    (sources / "march.py").write_text("from walk import a\n")
    return sources, cache


def _fill(cache: Path) -> None:
    for name in ("march.share-1.py312.nbi", "march.share-1.py312.1.nbc", "march.cpython-312.pyc"):
        (cache / name).touch()


def _kept(cache: Path) -> set[str]:
    return {file.suffix for file in cache.iterdir()} - {""}


def test_only_what_other_sources_were_compiled_to_is_removed(folders: tuple[Path, Path]) -> None:
    sources, cache = folders
    _fill(cache)
    drop_stale(str(cache), sources)  # filled before anybody wrote from what
    assert _kept(cache) == {".pyc"}
    _fill(cache)
    os.utime(sources / "walk.py", (1, 1))  # as by a checkout there and back
    drop_stale(str(cache), sources)
    assert _kept(cache) == {".pyc", ".nbi", ".nbc"}
    (sources / "walk.py").write_text("a = 2\n")  # as long as before
    drop_stale(str(cache), sources)
    assert _kept(cache) == {".pyc"}
    _fill(cache)
    (sources / "walk.py").rename(sources / "stride.py")
    drop_stale(str(cache), sources)
    assert _kept(cache) == {".pyc"}


def test_a_folder_that_cannot_be_written_or_is_not_there_is_left_alone(
    folders: tuple[Path, Path], monkeypatch: pytest.MonkeyPatch
) -> None:
    sources, cache = folders
    drop_stale(None, sources)
    drop_stale(str(cache / "none"), sources)
    assert not (cache / "none").exists()

    def refuse(*_: object, **__: object) -> None:
        raise PermissionError(13, "Permission denied")

    _fill(cache)
    monkeypatch.setattr(Path, "unlink", refuse)
    drop_stale(str(cache), sources)
    assert _kept(cache) == {".pyc", ".nbi", ".nbc"}
    monkeypatch.undo()
    drop_stale(str(cache), sources)  # not taken for done
    assert _kept(cache) == {".pyc"}


def test_numba_does_not_run_an_older_callee(tmp_path: Path) -> None:
    kernels = tmp_path / "kernels"
    kernels.mkdir()
    (kernels / "__init__.py").touch()
    (kernels / "calls.py").write_text(CALLS)
    environment = {**os.environ, "NUMBA_CACHE_DIR": str(tmp_path / "cache"), "PYTHONDONTWRITEBYTECODE": "1"}
    environment["PYTHONPATH"] = os.pathsep.join([str(tmp_path), *sys.path])
    printed = []
    for added in (1, 1, 2):
        (kernels / "called.py").write_text(CALLED.format(added))
        done = subprocess.run(
            [sys.executable, "-c", RUN], cwd=tmp_path, env=environment, capture_output=True, text=True, timeout=300
        )
        assert done.returncode == 0, done.stderr
        printed.append(done.stdout.split())
    assert printed == [["20", "0"], ["20", "1"], ["30", "0"]]


def test_importing_the_package_stamps_the_folder_its_kernels_are_in(tmp_path: Path) -> None:
    code = """
from pathlib import Path
from openswim.transport import march, pack, stale, sweep, walk
folders = {k.stats.cache_path for k in (march._march_share, sweep.share_ordinates, walk.walk_on)}
assert len(folders) == 1
folder = Path(folders.pop())
assert (folder / stale._STAMP).read_text() == stale._digest(Path(stale.__file__).parent)
"""
    environment = {**os.environ, "NUMBA_CACHE_DIR": str(tmp_path)}
    done = subprocess.run([sys.executable, "-c", code], env=environment, capture_output=True, text=True, timeout=120)
    assert done.returncode == 0, done.stderr
