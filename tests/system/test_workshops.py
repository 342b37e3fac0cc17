"""Files and stores are there whole or not at all, whoever is killed, and nothing is left; nobody else's is deleted."""

from __future__ import annotations

import os
import resource
import shutil
import signal
import stat
import subprocess
import sys
import time
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest
import xarray as xr
from PIL import Image

from openswim.colour import save
from openswim.errors import UserError
from openswim.films.outputs import _write_pictures, check_output
from openswim.scene.files import check_target, written_whole
from openswim.system import workshops
from openswim.system.inputs import check_ordinary

# Writes ever new values into the same names until it is killed.
WRITER = """
import sys
from pathlib import Path
import numpy as np
import xarray as xr
from openswim.scene.files import written_whole
if sys.argv[2] == "two renames":
    from openswim.system import workshops
    workshops._exchanged = lambda one, other: False
print("ready", flush=True)
for n in range(10**9):
    with written_whole(sys.argv[1] + ".nc") as partial:
        partial.write_bytes(bytes([n % 256]) * 100_000)
    with written_whole(sys.argv[1] + ".zarr") as partial:
        partial.mkdir()
        (partial / ".zgroup").write_text("{}")
        for k in range(3):
            (partial / str(k)).write_text(str(n))
"""


def _hidden(folder: Path) -> list[Path]:
    return [path for path in folder.iterdir() if path.name.startswith(".openswim-")]


@pytest.mark.parametrize("how", ["one step", "two renames"])
def test_killed_writers_leave_old_or_new_and_nothing_else(tmp_path, how):
    """Ten kills of a writer, at times that differ; the next writer of all sweeps what they left."""
    random = np.random.default_rng(3)
    left = 0
    for _ in range(5):
        command = [sys.executable, "-c", WRITER, str(tmp_path / "a"), how]
        with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as writer:
            assert writer.stdout is not None
            assert writer.stdout.readline() == "ready\n"
            while not ((tmp_path / "a.nc").exists() and (tmp_path / "a.zarr").exists()):
                time.sleep(0.01)
            time.sleep(random.uniform(0.0, 0.05))
            writer.send_signal(signal.SIGKILL)
        left += len(_hidden(tmp_path))
        check_ordinary(tmp_path / "a.zarr")  # finds it, wherever it was
        values = (tmp_path / "a.nc").read_bytes()
        assert len(values) == 100_000
        assert len(set(values)) == 1
        numbers = {(tmp_path / "a.zarr" / str(k)).read_text() for k in range(3)}
        assert len(numbers) == 1
        with written_whole(tmp_path / "b.txt") as partial:
            partial.write_text("b")
        assert not _hidden(tmp_path)
    assert left  # or nothing was tried


def test_a_store_that_was_put_aside_is_found_again(tmp_path):
    """As a process leaves it that is killed between the two renames."""
    made = tmp_path / ".openswim-dead"
    (made / ".openswim-aside" / "a.zarr").mkdir(parents=True)
    (made / ".openswim-lock").touch()
    (made / ".openswim-aside" / "a.zarr" / ".zgroup").write_text("{}")
    check_ordinary(tmp_path / "a.zarr")
    assert sorted(path.name for path in tmp_path.iterdir()) == ["a.zarr"]
    assert (tmp_path / "a.zarr" / ".zgroup").read_text() == "{}"


def test_workshops_of_the_living_stay(tmp_path):
    code = "import sys\nfrom pathlib import Path\nfrom openswim.system.workshops import workshop\n"
    code += "with workshop(Path(sys.argv[1])):\n    print('ready', flush=True)\n    sys.stdin.read()\n"
    command, pipe = [sys.executable, "-c", code, str(tmp_path)], subprocess.PIPE
    with subprocess.Popen(command, stdin=pipe, stdout=pipe) as one:
        assert one.stdout is not None
        one.stdout.readline()
        with workshops.workshop(tmp_path) as own:
            workshops.sweep(tmp_path)
            assert own.is_dir()
            assert len(_hidden(tmp_path)) == 2
        one.communicate()
    assert not _hidden(tmp_path)
    (tmp_path / ".openswim-without-lock" / "part").mkdir(parents=True)  # of an earlier version
    workshops.sweep(tmp_path)
    assert _hidden(tmp_path)
    os.utime(tmp_path / ".openswim-without-lock", (0, 0))
    workshops.sweep(tmp_path)
    assert not _hidden(tmp_path)


def test_foreign_files_in_a_store_are_not_deleted(tmp_path):
    store = tmp_path / "a.zarr"
    data = xr.Dataset({"x": ("y", np.arange(3.0))})
    save(data, store)
    save(data, store)  # its own pieces may go
    (store / "x" / "notes.txt").write_text("mine")
    with pytest.raises(UserError, match=r"holds x/notes.txt, which is no part of a Zarr store: move it"):
        check_target(store)
    with pytest.raises(UserError, match=r"notes\.txt"):
        save(data, store)
    assert (store / "x" / "notes.txt").read_text() == "mine"
    assert not _hidden(tmp_path)


@contextmanager
def _small_files(most: int):
    """Writing beyond fails, as on a full disk."""
    old = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (most, old[1]))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, old)


def test_a_full_disk_for_folders_of_pictures(tmp_path):
    picture = np.random.default_rng(0).integers(0, 255, (60, 60, 3), np.uint8)
    path = tmp_path / "film"
    with _small_files(2000), pytest.raises(UserError, match=r"film: cannot be written .*: free some space"):
        _write_pictures(path, iter([picture]), "")
    assert not list(tmp_path.iterdir())
    _write_pictures(path, iter([picture] * 2), "")
    _write_pictures(path, iter([picture]), "")
    assert [each.name for each in path.iterdir()] == ["frame_000001.png"]
    path.rename(tmp_path / "elsewhere")
    path.symlink_to("nowhere")
    with pytest.raises(UserError, match="is a link to nowhere"):
        check_output(path)


def test_a_disk_without_room_for_a_lock(tmp_path, monkeypatch):
    """It may have some for the lock's empty file, which is not left."""
    monkeypatch.setattr(workshops, "_host", lambda: b"host" * 50)
    with _small_files(100), pytest.raises(UserError, match="cannot be written"), written_whole(tmp_path / "a"):
        pass
    with _small_files(0), pytest.raises(UserError, match="cannot be written"), written_whole(tmp_path / "a"):
        pass
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("suffix", [".jpg", ".png", ".tif", ".nc"])
def test_a_full_disk(tmp_path, suffix):
    """The old file stays, whatever the format; a JPEG was once cut and called done."""
    values = np.random.default_rng(0).random((120, 120, 3)).astype(np.float32)
    wavelengths = ("wavelength", [615.0, 546.0, 450.0])
    image = xr.Dataset({"solar_relative_radiance": (("y", "x", "wavelength"), values)}, {"wavelength": wavelengths})
    path = tmp_path / f"a{suffix}"
    save(image, path)
    before = path.read_bytes()
    assert len(before) > 12_000
    with _small_files(8192), pytest.raises(UserError, match="cannot be written"):
        save(image, path)
    assert path.read_bytes() == before
    assert [each.name for each in tmp_path.iterdir()] == [path.name]
    if suffix != ".nc":
        with Image.open(path) as whole:
            whole.load()
    shutil.rmtree(tmp_path)


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="the system has no named pipes")
def test_pipes_and_devices_are_not_replaced(tmp_path: Path) -> None:
    pipe = tmp_path / "pipe.nc"
    os.mkfifo(pipe)
    with pytest.raises(UserError, match=r"--observations .*pipe\.nc: is a pipe, device or socket"):
        check_target(pipe, name="--observations")
    with pytest.raises(UserError, match="pipe, device or socket"), written_whole(pipe):
        pass
    link = tmp_path / "link.nc"  # as /dev/stdout is one
    link.symlink_to(pipe)
    with pytest.raises(UserError, match="pipe, device or socket"):
        check_target(link)
    assert stat.S_ISFIFO(pipe.lstat().st_mode)
    assert sorted(tmp_path.iterdir()) == [link, pipe]
