"""The examples of docs/cameras.md do what the page says."""

import re
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from openswim.cameras.files import load_camera, read_camera
from openswim.cameras.lenses import MODELS

PAGE = (Path(__file__).parents[2] / "docs" / "cameras.md").read_text()


def blocks(language):
    return re.findall(rf"```{language}\n(.*?)```", PAGE, re.S)


def test_the_python_example_runs(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (code,) = blocks("python")
    for whole, tenth in (("(2832, 2832)", "(283, 283)"), ("1020.0", "102.0"), ("(1447.0, 1420.0)", "(144, 142)")):
        code = code.replace(whole, tenth)
    names: dict = {}
    exec(code, names)
    assert names["same"] == names["roof"]
    assert (names["azimuth_deg"], names["altitude_deg"]) == (pytest.approx(180), pytest.approx(30))


def test_the_files_are_read(tmp_path):
    lens, mapped = blocks("toml")
    (tmp_path / "roof.toml").write_text(lens)
    read = read_camera(tmp_path / "roof.toml")
    assert read.camera.lens_optics.lens.model == "equisolid"
    assert read.frames.time_pattern == "%d%m%y_%H%M%S"
    assert len(read.camera.horizon_deg) == 3
    for name in ("azimuth", "zenith"):
        counts = np.arange(12, dtype=np.uint16).reshape(3, 4) * 5000
        Image.fromarray(counts).save(tmp_path / f"{name}_visible.jp2")
    (tmp_path / "map.toml").write_text(mapped)
    assert load_camera(tmp_path / "map.toml").shape == (3, 4)


def test_every_lens_is_listed():
    assert set(re.findall(r"^\| `([a-z-]+)` \|", PAGE, re.M)) == set(MODELS)
