"""Kernels are compiled anew when what they were compiled from has changed, not only their own file."""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

from openswim.transport.engine import kernel_cache
from openswim.transport.engine.kernel_cache import drop_stale

CALLED = "from numba import njit\n\n@njit(cache=True)\ndef called(x):\n    return x + {}\n"
CALLS = """
from numba import njit
from kernels.deep.called import called

@njit(cache=True)
def calls(x):
    return 10 * called(x)

@njit(cache=True)
def alone(x):
    return x
"""
OTHER = "from numba import njit\n\n@njit(cache=True)\ndef other(x):\n    return x\n"
RUN = """
from kernels.far.calls import calls
from kernels.far.other import other
from openswim.transport.engine.kernel_cache import drop_stale
drop_stale("kernels")
print(calls(1), sum(calls.stats.cache_hits.values()), other(1), sum(other.stats.cache_hits.values()))
"""


def _fill(folder: Path) -> None:
    for module in ("march", "walk"):
        for name in (f"{module}.share-1.py312.nbi", f"{module}.share-1.py312.1.nbc", f"{module}.cpython-312.pyc"):
            (folder / name).touch()


def _kept(folder: Path) -> set[str]:
    return {file.name.split(".")[0] + file.suffix for file in folder.iterdir()} - {"openswim-sources.json"}


ALL = {f"{module}{suffix}" for module in ("march", "walk") for suffix in (".nbi", ".nbc", ".pyc")}


def test_only_what_other_sources_were_compiled_to_is_removed(tmp_path: Path) -> None:
    _fill(tmp_path)
    kernel_cache._drop(tmp_path, {"march": "1", "walk": "1"})  # filled before anybody wrote from what
    assert _kept(tmp_path) == {"march.pyc", "walk.pyc"}
    _fill(tmp_path)
    kernel_cache._drop(tmp_path, {"march": "1", "walk": "1"})
    assert _kept(tmp_path) == ALL
    kernel_cache._drop(tmp_path, {"march": "2", "walk": "1"})
    assert _kept(tmp_path) == ALL - {"march.nbi", "march.nbc"}
    kernel_cache._drop(tmp_path, {"march": "2"})  # a module that is no more
    assert _kept(tmp_path) == {"march.pyc", "walk.pyc"}


def test_kernels_are_kept_whatever_else_a_process_has_imported() -> None:
    """Each program once compiled those anew that it shares with another which had imported more before them."""
    run = """
import openswim.transport
from openswim.transport.engine import kernel_cache
digests = kernel_cache._Digests()
for name in sorted({kernel.__module__ for kernel in kernel_cache._kernels("openswim.transport")}):
    print(name, digests.of(name))
"""
    more = "import openswim.cli.main, openswim.films.making, openswim.satellites, openswim.scene.procedural\n"
    alone, after_more = (
        dict(line.split() for line in subprocess.run(
            [sys.executable, "-c", before + run], check=True, capture_output=True, text=True
        ).stdout.splitlines())
        for before in ("", more)
    )  # fmt: skip
    assert len(alone) > 40
    assert {name: after_more[name] for name in alone} == alone


def test_kernels_of_a_room_that_is_imported_late_are_looked_at(tmp_path: Path) -> None:
    """Those of the linear core once stayed as they were when `cell.py`, which they inline, had changed."""
    run = "import openswim.transport.linear.operator as o; print(o.__file__)"
    env = os.environ | {"NUMBA_CACHE_DIR": str(tmp_path)}
    done = subprocess.run([sys.executable, "-c", run], env=env, check=True, capture_output=True, text=True)
    room = Path(done.stdout.strip()).parent
    with_kernels = {file.stem for file in room.glob("*.py") if re.search("^@(kernel|part)", file.read_text(), re.M)}
    stamps = [stamp for stamp in tmp_path.rglob("openswim-sources.json") if stamp.parent.name.startswith("linear_")]
    assert {name for stamp in stamps for name in json.loads(stamp.read_text())} == with_kernels
    marches = [stamp for stamp in tmp_path.rglob("openswim-sources.json") if stamp.parent.name.startswith("march_")]
    assert "sample" in json.loads(marches[0].read_text())  # other rooms' are as `transport` left them


def test_nothing_is_done_where_nothing_may_be_written(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    drop_stale("no_such_package")
    kernel_cache._drop(tmp_path / "none", {"march": "1"})
    assert not (tmp_path / "none").exists()

    def refuse(*_: object, **__: object) -> None:
        raise PermissionError(13, "Permission denied")

    _fill(tmp_path)
    monkeypatch.setattr(Path, "unlink", refuse)
    kernel_cache._drop(tmp_path, {"march": "1", "walk": "1"})
    assert _kept(tmp_path) == ALL
    monkeypatch.undo()
    kernel_cache._drop(tmp_path, {"march": "1", "walk": "1"})  # not taken for done
    assert _kept(tmp_path) == {"march.pyc", "walk.pyc"}


def test_numba_does_not_run_an_older_callee_of_another_folder(tmp_path: Path) -> None:
    for folder in ("", "far", "deep"):
        (tmp_path / "kernels" / folder).mkdir()
        (tmp_path / "kernels" / folder / "__init__.py").touch()
    (tmp_path / "kernels" / "far" / "calls.py").write_text(CALLS)
    (tmp_path / "kernels" / "far" / "other.py").write_text(OTHER)
    environment = {**os.environ, "NUMBA_CACHE_DIR": str(tmp_path / "cache"), "PYTHONDONTWRITEBYTECODE": "1"}
    environment["PYTHONPATH"] = os.pathsep.join([str(tmp_path), *sys.path])
    printed = []
    for added in (1, 1, 2):
        (tmp_path / "kernels" / "deep" / "called.py").write_text(CALLED.format(added))
        done = subprocess.run(
            [sys.executable, "-c", RUN], cwd=tmp_path, env=environment, capture_output=True, text=True, timeout=300
        )
        assert done.returncode == 0, done.stderr
        printed.append(done.stdout.split())
    # the file beside it, which imports nothing that changed, is not compiled again
    assert printed == [["20", "0", "1", "0"], ["20", "1", "1", "1"], ["30", "0", "1", "1"]]


def test_importing_the_package_stamps_every_folder_of_its_kernels(tmp_path: Path) -> None:
    code = """
import sys
from pathlib import Path
import openswim.transport
kernels = [k for name, m in sys.modules.items() if name.startswith("openswim.transport.") for k in vars(m).values()]
folders = {k.stats.cache_path for k in kernels if getattr(getattr(k, "stats", None), "cache_path", None)}
assert len(folders) > 5
assert all((Path(folder) / "openswim-sources.json").is_file() for folder in folders)
"""
    environment = {**os.environ, "NUMBA_CACHE_DIR": str(tmp_path)}
    done = subprocess.run([sys.executable, "-c", code], env=environment, capture_output=True, text=True, timeout=120)
    assert done.returncode == 0, done.stderr
