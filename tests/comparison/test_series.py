"""Many frames: what an interruption leaves is gone on with, and interpolated clear skies are those that are solved."""

import os
import re
import shutil
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import xarray as xr
from PIL import Image
from tests.comparison.skies import clear_radiance, small_camera, write_frame

from openswim.comparison.into_folder import compare_into, fingerprint
from openswim.comparison.settings import Settings, known_camera, skies_of
from openswim.errors import UserError
from openswim.lighting import light
from openswim.scene.procedural import demo_scene

CAMERA = small_camera(64)
TIMES = ("080000", "080400", "100000")


@pytest.fixture(scope="module")
def frames(tmp_path_factory):
    folder = tmp_path_factory.mktemp("frames")
    return [
        write_frame(folder / f"sky_20240620_{t}.png", clear_radiance(CAMERA.camera, f"2024-06-20T{t[:2]}:{t[2:4]}"))
        for t in TIMES
    ]


def run(frames, folder, tell=lambda comparison: None):
    settings = Settings(size=64, aod_range=False)
    skies = skies_of(None, "fast", None, None, table=True)
    known = known_camera(CAMERA, settings, frames[0], "fast", skies)
    return compare_into(skies, frames, CAMERA, settings, known, folder, tell=tell)


def test_a_killed_series_goes_on_where_it_stopped(frames, tmp_path):
    told = []

    def killed(comparison):
        told.append(comparison.attrs["frame"])
        if len(told) == 2:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        run(frames, tmp_path, killed)
    made = {path.name: path.stat().st_mtime_ns for path in tmp_path.glob("sky*.nc")}
    assert len(made) == 2
    (tmp_path / "sky_20240620_100000.nc").write_bytes(b"half of a file")
    page = run(frames, tmp_path, lambda comparison: told.append(comparison.attrs["frame"]))
    assert told == [frame.name for frame in frames]
    assert all((tmp_path / name).stat().st_mtime_ns == when for name, when in made.items())
    with xr.open_dataset(tmp_path / "scores.nc") as scores:
        assert [str(name) for name in scores.frame.values] == told
        assert (np.diff(scores.time) > np.timedelta64(0, "ns")).all()
        at = {"weighting": "solid angle", "sun_mask": 12, "light": "decoded", "score_channel": "mean"}
        assert (scores.r.sel(at) > 0.999).all()
        assert scores.keogram_stored.sizes == {"time": 3, "meridian": 90, "channel": 3}
        ratio = scores.keogram_simulated_as_stored / scores.keogram_stored
        assert float(abs(ratio.where(np.isfinite(ratio)) - 1).median()) < 0.03
    assert page.name == "index.html"
    assert "http" not in page.read_text("utf-8")
    shown = re.findall(r">(\d\d:\d\d)</text>", page.read_text("utf-8"))
    assert shown[:5] == ["08:00", "08:30", "09:00", "09:30", "10:00"]
    again = []
    run(frames, tmp_path, lambda comparison: again.append(comparison))
    assert not again


def test_what_was_made_of_other_frames_cameras_or_times_is_made_anew(frames, tmp_path):
    """Frames replaced under their names, a camera that stands higher, a frame whose time is said otherwise."""
    listed = [Path(shutil.copy2(frame, tmp_path)) for frame in frames[:2]]
    settings, skies = Settings(size=64, aod_range=False), skies_of(None, "swim", None, None, table=True)

    def made(camera=CAMERA, chosen=listed, time=None):
        told = []
        compare_into(skies, chosen, camera, settings, known_camera(camera, settings, None, "swim", skies),
                     tmp_path / "out", time, lambda scores: told.append(scores.attrs["frame"]))  # fmt: skip
        return told

    names = [path.name for path in listed]
    assert (made(), made()) == (names, [])
    shutil.copy2(frames[2], listed[1])
    assert (made(), made()) == (names[1:], [])
    higher = replace(CAMERA, camera=replace(CAMERA.camera, height_m=2500.0, above="sea level"))
    assert made(higher) == names
    assert (made(chosen=listed[:1], time="2024-06-20T09:00"), made(chosen=listed[:1], time="2024-06-20T10:00")) == (
        names[:1], names[:1]
    )  # fmt: skip


@pytest.mark.skipif(sys.platform != "linux", reason="file systems whose names are bytes")
def test_names_that_are_not_utf_8_are_refused(frames, tmp_path):
    settings, skies = Settings(size=64), skies_of(None, "swim", None, None)
    frame = shutil.copy2(frames[0], tmp_path / os.fsdecode(b"\xff_20240620_080000.png"))
    known = known_camera(CAMERA, settings, None, "swim", skies)
    for chosen, folder in ((frame, tmp_path / "out"), (frames[0], tmp_path / os.fsdecode(b"out\xff"))):
        with pytest.raises(UserError, match="this name is not UTF-8: rename it"):
            compare_into(skies, [Path(chosen)], CAMERA, settings, known, folder)


def test_a_series_replaces_nothing_that_it_reads(frames, tmp_path):
    model = tmp_path / f"{frames[0].stem}.nc"
    demo_scene(16, 16, 16, spacing_m=2000.0).to_netcdf(model)
    before = model.read_bytes()
    settings, skies = Settings(size=64), skies_of(model, "swim", None, None, table=True)
    known = known_camera(CAMERA, settings, None, "swim", skies)
    with pytest.raises(UserError, match=r"would replace .*, which is read: choose another folder with -o"):
        compare_into(skies, frames, CAMERA, settings, known, tmp_path)
    assert model.read_bytes() == before
    called = Path(shutil.copy2(frames[0], tmp_path / "scores.png"))
    with pytest.raises(UserError, match="a frame is called scores, as a file of the whole series: rename it"):
        compare_into(skies, [called, frames[1]], CAMERA, settings, known, tmp_path / "out")


def test_a_grey_and_a_damaged_frame_end_no_series(frames, tmp_path):
    """Grey as by night, stored in three colours; half of a file; and one of another age."""
    with Image.open(frames[2]) as picture:
        picture.convert("L").convert("RGB").save(tmp_path / "grey_20240620_100000.png")
    (tmp_path / "half_20240620_090000.png").write_bytes(frames[0].read_bytes()[:500])
    (tmp_path / "late_20990620_090000.png").write_bytes(frames[0].read_bytes())  # the ephemeris ends before
    listed = [frames[0], *sorted(tmp_path.glob("*.png"))]
    settings, skies = Settings(size=64, aod_range=False), skies_of(None, "fast", None, None, table=True)
    left_out = []

    def tell_failed(path, failure):
        left_out.append(path.name)
        assert str(path) in failure

    plain = known_camera(CAMERA, settings, None, "fast", skies)
    compare_into(skies, listed, CAMERA, settings, plain, tmp_path / "out", tell_failed=tell_failed)
    assert sorted(left_out) == ["half_20240620_090000.png", "late_20990620_090000.png"]
    with xr.open_dataset(tmp_path / "out/scores.nc") as scores:
        r = scores.r.sel(weighting="solid angle", sun_mask=12, light="decoded")
        assert (r.sel(score_channel="mean") > 0.99).all()
        np.testing.assert_array_equal(np.isnan(r.sel(score_channel="red")), [False, True])
        line = scores.keogram_stored.values[1]
        np.testing.assert_array_equal(line, line[:, :1].repeat(3, axis=1))
        assert np.nanmax(line) > 0
    with pytest.raises(UserError, match="cannot be read"):  # not one is left
        compare_into(skies, listed[2:], CAMERA, settings, plain, tmp_path / "none")
    curves = known_camera(CAMERA, settings, frames[0], "fast", skies)
    with pytest.raises(UserError, match="is grey, the clear frame is not"):
        compare_into(skies, listed[1:2], CAMERA, settings, curves, tmp_path / "none")
    assert not (tmp_path / "none").exists()


def test_interpolated_clear_skies_are_those_that_are_solved():
    """Suns between the nodes; all above 3 degrees and beyond the masks of the sun."""
    camera = CAMERA.camera
    pixels = camera.pixels()
    for time in ("2024-06-20T04:20", "2024-06-20T06:10", "2024-06-20T10:40"):
        skies = skies_of(None, "fast", 0.1, None, table=True)
        sun = skies.sun_at(camera, np.datetime64(time))
        away = np.nan_to_num(pixels.angle_to_deg(*sun)) > 10  # pixels are so coarse that the disc is as wide
        there = pixels.inside & (np.nan_to_num(pixels.altitude_deg) > 3) & away
        solved = skies_of(None, "fast", 0.1, None).clear(camera, np.datetime64(time))
        ratio = skies.clear(camera, np.datetime64(time))[there] / solved[there]
        assert abs(ratio - 1).max() < 0.02, (time, abs(ratio - 1).max())
        assert abs(ratio - 1).mean() < 0.0027, (time, abs(ratio - 1).mean())


def test_what_was_compared_with_other_clouds_or_light_is_not_taken_for_done():
    """A scene and its light in one line do not tell these."""
    scene, settings = demo_scene(16, 16, 16), Settings(size=64)
    water = scene.data["liquid_content"]
    other = replace(scene, data=scene.data.assign(liquid_content=water.copy(data=1.1 * water.values)))
    lit = [light(one, "swim", sun=(120.0, altitude)) for one, altitude in ((scene, 40.0), (scene, 50.0), (other, 40.0))]
    marks = []
    for model in (scene, other, *lit):
        skies = skies_of(model, "swim", None, None)
        marks.append(fingerprint(skies, CAMERA, settings, known_camera(CAMERA, settings, None, "swim", skies)))
    assert repr(scene) == repr(other)
    assert len(set(marks)) == len(marks)
    assert all(len(repr(each)) < 500 for each in lit)
