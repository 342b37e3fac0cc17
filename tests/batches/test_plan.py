"""Plans that say what is wanted, and plans that nobody should follow."""

from pathlib import Path

import numpy as np
import pytest

from openswim import UserError
from openswim.batches import read_plan
from openswim.batches.names import stamp_of

HEAD = 'openswim_batch = 1\nfiles = "run_*.nc"\n'
CAMERA = '[[camera]]\nname = "roof"\nlat = 47.0\nlon = 11.0\nsize = 8\n'


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A plan's folder with two files, and others outside of it."""
    inside = tmp_path / "inside"
    inside.mkdir()
    for name in ("run_1.nc", "run_0.nc", "inside/run_1.nc", "inside/run_0.nc"):
        (tmp_path / name).write_text("weather")
    (inside / "link.nc").symlink_to(tmp_path / "run_0.nc")
    (tmp_path / "camera.toml").write_text("openswim_camera = 1\n")
    (inside / "roof.toml").write_text('openswim_camera = 1\n[obstacles]\nmask = "../black.png"\n')
    return inside


def _written(folder: Path, text: str) -> Path:
    (folder / "plan.toml").write_text(text)
    return folder / "plan.toml"


def test_a_plan_says_all(folder: Path) -> None:
    plan = read_plan(_written(folder, '''openswim_batch = 1
output = "skies"
outputs = [".nc", ".png"]
times = ["2024-06-01T12:00", "2024-06-01T06:00Z"]
sun = [200, 30.5]
solver = "fast"
quality = "preview"
wavelengths = [550]
aerosol = "urban"
aod = 0.2

[[weather]]
name = "control"
files = "run_?.nc"

[[weather]]
name = "b"
files = ["run_1.nc", "run_0.nc"]
members = [3, 1]

[picture]
exposure = 2
bits = 16

[[camera]]
name = "roof"
lat = 47.0
lon = 11.0
size = 8

[[camera]]
name = "front"
view = "perspective"
x_m = 0
y_m = 10.0
size = "12x6"
fov_deg = 70
outputs = ".tif"
'''))
    assert plan.folder == folder / "skies"
    assert [[path.name for path in each.files] for each in plan.weathers] == [["run_0.nc", "run_1.nc"],
                                                                              ["run_1.nc", "run_0.nc"]]
    assert [each.members for each in plan.weathers] == [(None,), (3, 1)]
    assert [each.suffixes for each in plan.cameras] == [(".nc", ".png"), (".tif",)]
    assert plan.cameras[1].camera.shape == (6, 12)
    assert plan.times == (np.datetime64("2024-06-01T06:00", "ms"), np.datetime64("2024-06-01T12:00", "ms"))
    assert (plan.solver.quality, plan.wavelengths_nm, plan.sun) == ("preview", (550.0,), (200.0, 30.5))
    assert dict(plan.look) == {"exposure": 2, "bits": 16}


@pytest.mark.parametrize(("text", "says"), [
    ("", "openswim_batch = 1"),
    ("openswim_batch = true\n", "openswim_batch = 1"),
    ("openswim_batch = [[[[\n", "TOML"),
    ("openswim_batch = 1\n" + CAMERA, "names no files"),
    (HEAD, "no camera"),
    (HEAD + "colour = 1\n" + CAMERA, "unknown 'colour'"),
    (HEAD.replace("1", "7") + CAMERA, "begins with the line openswim_batch = 1, it says 7"),
    (HEAD + CAMERA + CAMERA, "two [[camera]] are called roof: files are called after them"),
    (HEAD + CAMERA + CAMERA.replace("roof", "Roof"), "called Roof and roof, which some disks take for the same name"),
    (HEAD + CAMERA.replace("roof", "../roof"), "letters"),
    (HEAD + CAMERA.replace('"roof"', "3"), "letters"),
    (HEAD + CAMERA.replace("roof", "x" * 65), "letters"),
    (HEAD + CAMERA.replace("47.0", "97.0"), "roof"),
    (HEAD + CAMERA.replace("size = 8", "size = 100000"), "roof"),
    (HEAD + CAMERA + 'view = "x-ray"\n', "x-ray"),
    (HEAD + CAMERA + "roll_deg = 3\n", "roll_deg"),
    (HEAD + CAMERA + 'outputs = [".exe"]\n', ".exe"),
    (HEAD + CAMERA + "outputs = []\n", "outputs"),
    (HEAD + '[[camera]]\nname = "a"\nfile = "../camera.toml"\n', "leads out"),
    (HEAD + '[[camera]]\nname = "a"\nfile = "none.toml"\n', "none.toml"),
    (HEAD + '[[camera]]\nname = "a"\nfile = "roof.toml"\n', "mask '../black.png' leads out"),
    (HEAD.replace("run_*.nc", "../run_*.nc") + CAMERA, "leads out"),
    (HEAD.replace("run_*.nc", "../run_0.nc") + CAMERA, "leads out"),
    (HEAD.replace("run_*.nc", "link.nc") + CAMERA, "leads out"),
    (HEAD.replace("run_*.nc", "*.nc") + CAMERA, "leads out"),
    (HEAD.replace("run_*.nc", "/etc/*") + CAMERA, "leads out"),
    (HEAD.replace("run_*.nc", "**/*.nc") + CAMERA, "every folder"),
    (HEAD.replace("run_*.nc", "run**.nc") + CAMERA, "every folder"),
    (HEAD.replace("run_*.nc", "no_*.nc") + CAMERA, "no file"),
    (HEAD.replace("run_*.nc", "a\\u0000b") + CAMERA, "one line"),
    (HEAD + 'output = "../elsewhere"\n' + CAMERA, "leads out"),
    (HEAD + 'output = "/tmp"\n' + CAMERA, "leads out"),
    (HEAD + "times = 3\n" + CAMERA, "times"),
    (HEAD + 'from = "noon"\n' + CAMERA, "noon"),
    (HEAD + "sun = [1, 2, 3]\n" + CAMERA, "sun"),
    (HEAD + "sun = [nan, 2]\n" + CAMERA, "sun"),
    (HEAD + "members = [1, 1]\n" + CAMERA, "members"),
    (HEAD + "members = [-1]\n" + CAMERA, "members"),
    (HEAD + "members = [true]\n" + CAMERA, "members"),
    (HEAD + 'members = "every"\n' + CAMERA, 'write "all"'),
    (HEAD + 'solver = "reference"\nquality = "high"\n' + CAMERA, "quality"),
    (HEAD + "wavelengths = [550, 550]\n" + CAMERA, "wavelengths"),
    (HEAD + "wavelengths = [nan, 550]\n" + CAMERA, "wavelengths"),
    (HEAD + "wavelengths = [[550], [450]]\n" + CAMERA, "wavelengths"),
    (HEAD + "wavelengths = [-1]\n" + CAMERA, "280"),
    (HEAD + "wavelengths = [true]\n" + CAMERA, "280"),
    (HEAD + "aod = \"much\"\n" + CAMERA, "aod"),
    (HEAD + CAMERA + "[picture]\nexposure = -1\n", "exposure"),
    (HEAD + CAMERA + "[picture]\neye = 1\n", "true or false"),
    (HEAD + CAMERA + "[picture]\nbits = 16\n[[camera]]\nname = 'b'\noutputs = '.jpg'\nlat = 1\nlon = 1\n", "JPEG"),
    (HEAD + CAMERA + "[ensemble]\nsun_w_m2 = 0\n", "ensemble"),
    (HEAD + CAMERA + "[[weather]]\nname = 'a'\nfiles = 'run_0.nc'\n", "either files"),
])  # fmt: skip
def test_a_bad_plan_is_one_line(folder: Path, text: str, says: str) -> None:
    with pytest.raises(UserError) as caught:
        read_plan(_written(folder, text))
    line = str(caught.value)
    assert "plan.toml" in line
    assert says in line, line
    assert "\n" not in line


def test_what_is_trusted_may_lie_anywhere(folder: Path) -> None:
    text = HEAD.replace("run_*.nc", "../run_*.nc") + CAMERA
    path = _written(folder, text)
    assert len(read_plan(path, allow_references=True).weathers[0].files) == 2
    given = [folder.parent / "run_0.nc"]
    plan = read_plan(path, files=given, output=folder.parent / "out")
    assert plan.weathers[0].files == tuple(given)
    assert plan.folder == folder.parent / "out"


def test_folders_may_be_called_as_a_pattern(folder: Path) -> None:
    """Only what the plan says is a pattern, not what its own folder is called."""
    odd = folder.rename(folder.with_name("run [01]*"))
    plan = read_plan(_written(odd, HEAD + CAMERA))
    assert [path.name for path in plan.weathers[0].files] == ["run_0.nc", "run_1.nc"]
    absolute = HEAD.replace("run_*.nc", f"{odd.parent}/run_?.nc") + CAMERA
    assert len(read_plan(_written(odd, absolute), allow_references=True).weathers[0].files) == 2


def test_files_are_called_after_time_and_member() -> None:
    time = np.datetime64("2005-08-28T18:00:00", "ms")
    assert stamp_of(time, None) == "20050828T180000"
    assert stamp_of(time + np.timedelta64(250, "ms"), 7) == "20050828T180000250_m007"
    assert stamp_of(None, 12) == "m012"
    assert stamp_of(None, None) == ""
