"""Cameras in TOML files: what is written is read, and what is hostile is refused in one line."""

import os

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from PIL import Image

from openswim.cameras import Camera, Lens, Optics
from openswim.cameras.files import (
    CameraFile,
    FrameSettings,
    load_camera,
    read_camera,
    save_camera,
    write_camera,
)
from openswim.cameras.obstacles import Mask
from openswim.errors import UserError

CAMERAS = [
    Camera.allsky(47.5, 11.25, size=300),
    Camera.allsky(47.5, 11.25, size=300, centre="nadir", fov_deg=160, height_m=3000),
    Camera.panorama(47.5, 11.25, size=(100, 400), altitude_range_deg=(-10, 50)),
    Camera.sphere(47.5, 11.25),
    Camera.perspective(x_m=10.0, y_m=-20.0, azimuth_deg=33, roll_deg=3),
    Camera.satellite(30, -90, 8e5, fov_deg=30),
    Camera.geostationary(-75.2),
    Camera.fisheye(78.2, 15.7, lens="kannala-brandt", focal_px=210, coefficients=(0.01, -0.002), size=(480, 640),
                   centre=(250.2, 310.7), rotation_deg=-15, tilt_deg=3, tilt_azimuth_deg=200, mirrored=True,
                   affine=(1.1, 0.01, 0.0)),
    Camera.pinhole(40, -100, focal_px=700, coefficients=(-0.1, 0.02, 1e-3, 1e-4), azimuth_deg=30, altitude_deg=12),
    Camera(**(vars(Camera.allsky(47.5, 11.25, size=300)) | {"horizon_deg": ((10.0, 5.0), (200.0, 12.5))})),
]  # fmt: skip

GOOD = """openswim_camera = 1
name = "roof"
[place]
lat = 47.5
lon = 11.25
[frame]
rows = 100
columns = 120
[view]
kind = "fisheye"
lens = "equisolid"
focal_px = 36.0
"""


@pytest.mark.parametrize("camera", CAMERAS)
def test_what_is_written_is_read(camera, tmp_path):
    save_camera(camera, tmp_path / "camera.toml")
    assert load_camera(tmp_path / "camera.toml") == camera


def test_a_map_and_a_mask_lie_beside_their_file(tmp_path):
    fisheye = Camera.fisheye(10, 20, size=40, tilt_deg=5)
    pixels = fisheye.pixels()
    camera = Camera.from_map(pixels.azimuth_deg, 90 - pixels.altitude_deg, 10, 20)
    camera = Camera(**(vars(camera) | {"mask": Mask(pixels.azimuth_deg > 300)}))
    save_camera(camera, tmp_path / "camera.toml")
    with Image.open(tmp_path / "camera_mask.png") as mask:
        np.testing.assert_array_equal(np.asarray(mask) == 0, pixels.azimuth_deg > 300)
    read = load_camera(tmp_path / "camera.toml")
    np.testing.assert_allclose(read.pixels().direction, pixels.direction, atol=1e-6)
    np.testing.assert_array_equal(read.mask.hidden, camera.mask.hidden)
    with pytest.raises(UserError, match="free rays"):
        save_camera(Camera.from_rays([[0, 0, 1]], 0, 0), tmp_path / "rays.toml")


def test_maps_are_pictures_of_counts(tmp_path):
    """As EUROCONTROL's: 16 bits of azimuth and zenith distance, 65535 outside."""
    pixels = Camera.fisheye(10, 20, size=60).pixels()
    for name, angle, scale in (("azimuth", pixels.azimuth_deg, 360), ("zenith", 90 - pixels.altitude_deg, 90)):
        counts = np.where(np.isnan(angle), 65535, angle * 64000 / scale)
        Image.fromarray(np.round(np.nan_to_num(counts)).astype(np.uint16)).save(tmp_path / f"{name}.png")
    text = GOOD.split("[frame]")[0] + (
        '[view]\nkind = "map"\nazimuth = "azimuth.png"\nzenith = "zenith.png"\nazimuth_deg_per_count = 0.005625\n'
        "zenith_deg_per_count = 0.00140625\noutside_count = 65535\n"
    )
    (tmp_path / "camera.toml").write_text(text)
    read = load_camera(tmp_path / "camera.toml").pixels()
    np.testing.assert_array_equal(read.inside, pixels.inside)
    np.testing.assert_allclose(read.direction, pixels.direction, atol=6e-5)


def test_the_camera_of_bretigny(shared, tmp_path):
    """Its map tiles the upper hemisphere: the solid angles add up."""
    folder = shared / "data/sky/bretigny"
    (tmp_path / "camera.toml").write_text(
        f'openswim_camera = 1\n[place]\nlat = 48.6005\nlon = 2.3468\n[view]\nkind = "map"\n'
        f'azimuth = "{folder}/azimuth_visible.jp2"\nzenith = "{folder}/zenith_visible.jp2"\n'
        "azimuth_deg_per_count = 0.005625\nzenith_deg_per_count = 0.00140625\noutside_count = 65535\n"
    )
    camera = load_camera(tmp_path / "camera.toml")
    assert camera.shape == (2056, 2464)
    assert np.nansum(camera.pixels().solid_angle_sr) == pytest.approx(2 * np.pi, rel=1e-4)


def test_frames_and_calibration_travel_along(tmp_path):
    content = CameraFile(
        CAMERAS[7], 'the "roof" \N{SNOWMAN}', FrameSettings("%d%m%y_%H%M%S", -7.5, 250.0),
        {"lens": {"median_px": 1.18}, "notes": ["one", "two"], "found": True, "n": 3},
    )  # fmt: skip
    write_camera(content, tmp_path / "camera.toml")
    read = read_camera(tmp_path / "camera.toml")
    assert (read.name, read.frames) == (content.name, content.frames)
    assert read.calibration == content.calibration


def test_a_place_given_goes_before_the_files(tmp_path):
    path = tmp_path / "camera.toml"
    path.write_text(GOOD)
    camera = load_camera(path, lat=10.0, height_m=50.0, lon=None)
    assert (camera.lat, camera.lon, camera.height_m) == (10.0, 11.25, 50.0)
    flat = load_camera(path, x_m=5.0, y_m=6.0)
    assert (flat.lat, flat.x_m) == (None, 5.0)
    path.write_text(GOOD.replace("lat = 47.5\nlon = 11.25", ""))
    with pytest.raises(UserError, match="--lat and --lon"):
        load_camera(path)
    assert load_camera(path, lat=1, lon=2).lat == 1


def test_a_file_may_begin_with_the_mark_of_windows_editors(tmp_path):
    save_camera(Camera.allsky(1.0, 2.0, size=8), tmp_path / "camera.toml")
    marked = tmp_path / "marked.toml"
    marked.write_bytes(b"\xef\xbb\xbf" + (tmp_path / "camera.toml").read_bytes())
    assert load_camera(marked) == load_camera(tmp_path / "camera.toml")


def test_pointing_may_be_said_in_two_ways(tmp_path):
    path = tmp_path / "camera.toml"
    path.write_text(GOOD + "azimuth_deg = 200\naltitude_deg = 30\nroll_deg = 5\n")
    expected = Optics.pointing(Lens("equisolid", 36.0), (49.5, 59.5), 200, 30, 5)
    assert load_camera(path).lens_optics == expected


def test_a_mask_is_a_picture(tmp_path):
    hidden = np.zeros((100, 120), bool)
    hidden[:30] = True
    Image.fromarray(np.where(hidden, 0, 255).astype(np.uint8)).save(tmp_path / "mask.png")
    (tmp_path / "camera.toml").write_text(GOOD + '[obstacles]\nmask = "mask.png"\n')
    np.testing.assert_array_equal(load_camera(tmp_path / "camera.toml").mask.hidden, hidden)


@pytest.mark.parametrize(
    ("camera", "path", "says"),
    [(CAMERAS[0], 5, "path is 5: give a file's name"),
     (None, "q.toml", "camera is None: give a Camera, such as")],
)  # fmt: skip
def test_only_cameras_are_written_and_into_files(camera, path, says, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    with pytest.raises(UserError, match=says):
        save_camera(camera, path)
    assert not list(tmp_path.iterdir())


def test_a_map_that_looks_nowhere_is_refused_with_its_file(tmp_path):
    np.save(tmp_path / "same.npy", np.full((2, 4, 5), 30.0))
    (tmp_path / "camera.toml").write_text(GOOD.split("[frame]")[0] + '[view]\nkind = "map"\ndirections = "same.npy"\n')
    with pytest.raises(UserError, match=r"camera\.toml: map: its pixels look all one way"):
        load_camera(tmp_path / "camera.toml")


HOSTILE = {
    "empty": ("", "openswim_camera = 1"),
    "no TOML": ("lens: fisheye", "TOML"),
    "another version": (GOOD.replace("= 1", "= 2", 1), "openswim_camera = 1"),
    "true is no version": (GOOD.replace("= 1", "= true", 1), "openswim_camera = 1"),
    "a slip": (GOOD.replace("focal_px", "focal_pix"), "focal_px"),
    "an unknown table": (GOOD + "[lens]\nf = 2\n", "unknown 'lens'"),
    "no kind": (GOOD.replace('kind = "fisheye"', ""), "kind"),
    "a kind of its own": (GOOD.replace('"fisheye"', '"tilted"'), "choose one of"),
    "a list for a kind": (GOOD.replace('"fisheye"', "[1]"), "choose one of"),
    "no frame": (GOOD.replace("rows = 100", ""), "needs rows"),
    "rows in words": (GOOD.replace("rows = 100", 'rows = "many"'), "rows"),
    "a fraction of rows": (GOOD.replace("rows = 100", "rows = 100.5"), "size"),
    "true is no size": (GOOD.replace("rows = 100", "rows = true"), "size"),
    "too many rows": (GOOD.replace("rows = 100", "rows = 10000000000000"), "size"),
    "no focal length": (GOOD.replace("focal_px = 36.0", "focal_px = 0"), "focal_px"),
    "nan": (GOOD.replace("focal_px = 36.0", "focal_px = nan"), "focal_px"),
    "a text for a number": (GOOD.replace("36.0", '"36"'), "focal_px"),
    "coefficients in words": (GOOD + 'coefficients = "k1"\n', "coefficients"),
    "a number for coefficients": (GOOD + "coefficients = 1\n", "coefficients"),
    "mixed": (GOOD + "rotation_deg = 1\nazimuth_deg = 3\naltitude_deg = 3\n", "azimuth_deg"),
    "a table for a place": (GOOD.replace("lat = 47.5", "lat = {a = 1}"), "lat"),
    "off the Earth": (GOOD.replace("47.5", "147.5"), "latitude"),
    "an unknown above": (GOOD.replace("lat = 47.5", "lat = 47.5\nabove = 3"), "above"),
    "a flat view": (GOOD.replace("[view]", "view = 3\n[other]").split("[other]")[0], "view"),
    "nested without end": ("a = " + "[" * 100_000, "TOML"),
    "dots without end": ("a" + ".a" * 400_000 + " = 1", "endless dots"),
    "digits without end": ("a = " + "9" * 10_000, "TOML"),
    "no file": (GOOD + '[obstacles]\nmask = "nowhere.png"\n', "nowhere.png"),
    "a device": (GOOD + '[obstacles]\nmask = "/dev/zero"\n', "/dev/zero"),
    "a mask in words": (GOOD + "[obstacles]\nmask = 7\n", "mask"),
    "a horizon in words": (GOOD + '[obstacles]\nhorizon_deg = ["low"]\n', "horizon"),
    "a zone in words": (GOOD.replace("[view]", 'utc_offset_h = "CET"\n[view]'), "utc_offset_h"),
    "a far zone": (GOOD.replace("[view]", "utc_offset_h = 99\n[view]"), "utc_offset_h"),
    "a pattern of numbers": (GOOD.replace("[view]", "time_pattern = 5\n[view]"), "time_pattern"),
    "a name of numbers": (GOOD.replace('"roof"', "5"), "name"),
}


@pytest.mark.parametrize("case", HOSTILE)
def test_hostile_files_are_refused_in_one_line(case, tmp_path):
    text, says = HOSTILE[case]
    (tmp_path / "camera.toml").write_text(text)
    with pytest.raises(UserError) as caught:
        load_camera(tmp_path / "camera.toml")
    message = str(caught.value)
    assert says in message
    assert "camera.toml" in message or "/dev/zero" in message or "nowhere" in message
    assert "\n" not in message
    assert len(message) < 400


@pytest.mark.parametrize("make", ["folder", "missing", "latin", "pipe", "large", "npy", "waiting"])
def test_what_is_no_camera_file(make, tmp_path):
    path = tmp_path / "camera.toml"
    if make == "folder":
        path.mkdir()
    elif make == "latin":
        path.write_bytes(GOOD.replace("roof", "D\xe4ch").encode("latin-1"))
    elif make == "pipe":
        os.mkfifo(path)
    elif make == "waiting":
        os.mkfifo(tmp_path / "map.npy")
        path.write_text(GOOD.split("[frame]")[0] + '[view]\nkind = "map"\ndirections = "map.npy"\n')
    elif make == "large":
        path.write_bytes(b"#" * 2_000_000)
    elif make == "npy":
        header = b"{'descr': '<f4', 'fortran_order': False, 'shape': (2, 999999, 999999), }"
        (tmp_path / "big.npy").write_bytes(b"\x93NUMPY\x01\x00v\x00" + header.ljust(118))
        path.write_text(GOOD.split("[frame]")[0] + '[view]\nkind = "map"\ndirections = "big.npy"\n')
    with pytest.raises(UserError) as caught:
        load_camera(path)
    assert "\n" not in str(caught.value)


@settings(max_examples=80, deadline=None)
@given(st.data())
def test_changed_bytes_read_or_are_refused(tmp_path_factory, data):
    """Whatever single change is made to a good file, no other error comes out."""
    path = tmp_path_factory.getbasetemp() / "fuzzed.toml"
    text = GOOD + "rotation_deg = 5\ncoefficients = []\n[obstacles]\nhorizon_deg = [[0, 5], [90, 7]]\n"
    at = data.draw(st.integers(0, len(text) - 1))
    cut = data.draw(st.integers(0, 12))
    put = data.draw(st.sampled_from(["", "0", "-", "[", '"', "nan", "1e400", "{}", "\0"]))
    path.write_text(text[:at] + put + text[at + cut :])
    message = ""
    try:
        load_camera(path).pixels()
    except UserError as error:
        message = str(error)
    assert "\n" not in message
