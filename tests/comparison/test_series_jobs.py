"""A series by two processes: the numbers of one, also after Ctrl-C, which ends it soon."""

import os
import signal
import subprocess
import sys
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import xarray as xr
from tests.comparison.skies import clear_radiance, small_camera, write_frame

from openswim.cameras.files import write_camera
from openswim.cli.main import run
from openswim.comparison.into_folder import in_shares
from openswim.scene.procedural import demo_scene

PROGRAM = """
import signal, sys
signal.signal(signal.SIGINT, signal.default_int_handler)  # shells ignore it for what they run in the background
from openswim.cli.main import run
if __name__ == "__main__":
    sys.exit(run(sys.argv[1:]))
"""
TIMES = ("0758", "0801", "0803", "0807", "0809")


@pytest.fixture(scope="module")
def day(tmp_path_factory):
    """A folder with a model of two times, frames of three lights, and the camera's file."""
    folder = tmp_path_factory.mktemp("day")
    scene = demo_scene(16, 16, 16, spacing_m=2000.0)
    content = small_camera(48)
    content = replace(content, camera=replace(content.camera, lat=scene.place[0], lon=scene.place[1]))
    write_camera(content, folder / "camera.toml")
    for when in ("08:00", "08:05"):
        replace(scene, time=np.datetime64(f"2024-06-20T{when}", "ms")).to_netcdf(folder / f"run_{when[3:]}.nc")
    sky = clear_radiance(content.camera)
    for number, when in enumerate(TIMES):
        write_frame(folder / f"sky_20240620_{when}00.png", sky * (1 + 0.1 * number))
    return folder


def frames(day):
    return sorted(day.glob("sky*.png"))


def options(day, output, jobs):
    return ["compare", str(day / "run_*.nc"), *map(str, frames(day)), "--camera", str(day / "camera.toml"), "--quality",
            "preview", "--size", "48", "--jobs", str(jobs), "-o", str(output)]  # fmt: skip


def files(folder):
    return {path.name: path for path in Path(folder).iterdir()}


def lives(group):
    """Whether there is a process of a group; if so, after a while."""
    try:
        os.killpg(group, 0)
    except ProcessLookupError:
        return False
    time.sleep(0.1)
    return True


def test_what_shares_light_is_one_share(day):
    content = small_camera(48)
    shares = [[path.stem[-6:-2] for path in share] for share in in_shares(frames(day), content)]
    assert shares == [["0758", "0801"], ["0803", "0807"], ["0809"]]


def test_two_processes_interrupted_make_what_one_makes(day, tmp_path, capsys):
    alone = tmp_path / "alone"
    assert run(options(day, alone, 1)) == 0
    script, output = tmp_path / "program.py", tmp_path / "output"
    script.write_text(PROGRAM)
    command = [sys.executable, str(script), *options(day, output, 2)]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, process_group=0) as one:
        assert one.stdout is not None
        assert "sky_" in one.stdout.readline()
        began = time.monotonic()
        one.send_signal(signal.SIGINT)
        one.communicate(timeout=60)
        assert time.monotonic() - began < 2.0 * 1.3  # on a busy machine
    assert one.returncode == 130
    assert any(not lives(one.pid) for _ in range(100)), "a worker lives on"
    made = {name: path.stat().st_mtime_ns for name, path in files(output).items() if name.endswith(".nc")}
    assert 1 <= len(made) < len(TIMES)
    capsys.readouterr()
    assert run(options(day, output, 1)) == 0  # goes on, in one process: what two have made before is as good
    assert capsys.readouterr().out.count(".png: ") == len(TIMES) - len(made)
    assert files(output).keys() == files(alone).keys()
    for name, path in files(alone).items():
        if path.suffix == ".nc":
            with xr.open_dataset(path) as by_one, xr.open_dataset(output / name) as by_two:
                assert by_one.identical(by_two)
        else:
            assert path.read_text("utf-8") == (output / name).read_text("utf-8")
    assert all((output / name).stat().st_mtime_ns == when for name, when in made.items())
