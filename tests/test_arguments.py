"""What is called with something else than it takes says so in one line that names it."""

import inspect
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray as xr

import openswim
from openswim import Background, Camera, Ground, Scene, Solver, UserError, open_scene, render, save_camera, to_rgb
from openswim.assimilation.settings import Settings
from openswim.cameras.files import FrameSettings, write_camera
from openswim.films import CameraPath
from openswim.ground.maps import maps_of
from openswim.observations import read_frame
from openswim.observations.calibration import calibrate
from openswim.pictures.viewpoint import Viewpoint
from openswim.scene.frame import scene_frame
from openswim.system.side_by_side import jobs_of

FIELD, AXIS, LEVELS = np.zeros((5, 4, 4)), np.arange(4.0), np.arange(5.0)
TIMES = np.array(["2024-06-21T12:00", "2024-06-21T12:01"], "datetime64[ms]")
CAMERA, CLEAR = Camera.allsky(46, 8, size=8), Scene.clear(46, 8)
NAN = float("nan")
IMAGE = xr.DataArray(np.ones((4, 4, 3)), {"wavelength": [615.0, 546.0, 450.0]}, ("y", "x", "wavelength"))


def arrays(**wrong: Any) -> Scene:
    """A scene from arrays, some of them wrong."""
    given: dict[str, Any] = {"extinction_per_m": FIELD, "x_m": AXIS, "y_m": AXIS, "z_m": LEVELS}
    return Scene.from_arrays(**given | wrong)


@pytest.mark.parametrize(
    ("call", "named"),
    [
        (lambda: to_rgb(np.ones((3, 3, 3))), "image"),
        (lambda: to_rgb(IMAGE.isel(x=0)), r"\(y, wavelength\)"),
        (lambda: to_rgb(IMAGE, matrix=np.eye(3)), "matrix"),
        (lambda: open_scene(None), "path is None"),
        (lambda: open_scene([3]), "path is 3"),
        (lambda: open_scene(__file__, ground="a.tif"), "ground"),
        (lambda: open_scene(__file__, around="here"), "around"),
        (lambda: render(CLEAR, "cam"), "camera is 'cam'"),
        (lambda: render(None, CAMERA), "scene is None"),
        (lambda: render(CLEAR, CAMERA, solver=None), "solver is None: give text or a Solver"),
        (lambda: Camera.allsky(x_m="a", y_m=0), "x_m"),
        (lambda: Camera.allsky(np.array([1, 2]), 0), "lat"),
        (lambda: Camera.allsky(1, 1, None), "height_m"),
        (lambda: Camera.panorama(1, 1, altitude_range_deg=3), "altitude range"),
        (lambda: Camera.satellite(1, 1, height_m="high"), "height"),
        (lambda: Camera("fish", (3, 3), 1, 1), "allsky, panorama, perspective"),
        (lambda: arrays(z_m=[[1, 2], [3]]), "z_m"),
        (lambda: arrays(x_m="a"), "x_m must be numbers"),
        (lambda: arrays(extinction_per_m=np.ma.array(FIELD, mask=FIELD == 0)), "extinction_cloud has masked values"),
        (lambda: arrays(x_m=np.ma.array(AXIS, mask=AXIS > 2)), "x_m has masked values"),
        (lambda: arrays(kind="liqiud"), "kind 'liqiud'"),
        (lambda: arrays(periodic="no"), "periodic"),
        (lambda: arrays(atmosphere="us"), "atmosphere"),
        (lambda: arrays(earth_radius_m="a"), "earth_radius_m"),
        (lambda: arrays(fields="a"), "fields"),
        (lambda: arrays(surface_albedo="a"), "surface_albedo"),
        (lambda: Scene.clear(1, 1, terrain_m="a"), "terrain_m"),
        (lambda: Scene.clear(1, 1, atmosphere="us"), "atmosphere"),
        (lambda: CLEAR.to_netcdf(None), "output"),
        (lambda: Solver(tolerance="a"), "tolerance"),
        (lambda: Solver("reference", seed=1.5), "seed"),
        (lambda: maps_of(Ground(albedo=3)), "albedo"),
        (lambda: Ground(chlorophyll_mg_m3="much"), "chlorophyll_mg_m3 must be a number"),
        (lambda: Background(80, filter=np.zeros((3, 3))), "filter array"),
        (lambda: Settings(method=np.zeros((3, 3))), "method array"),
        (lambda: Settings(transform=np.zeros((3, 3))), "transform array"),
        (lambda: open_scene(np.array("x")), "path is array"),
        (lambda: openswim.light(CLEAR, wavelengths_nm=10**400), "wavelengths_nm"),
        (lambda: save_camera(CAMERA, "\0"), "no file can have this name"),
        (lambda: save_camera(CAMERA, "\ud800.toml"), "is not UTF-8"),
        (lambda: CLEAR.to_netcdf(b"x.nc"), "give a file's name"),
        (lambda: CAMERA.rays(CLEAR), r"frame is <Scene.*scene_frame\(scene\)"),
        (lambda: CAMERA.rays(scene_frame(CLEAR), "high"), "ground_height_m is 'high': give a number"),
        (lambda: CAMERA.height_above_sea_m(None), "ground_height_m is None"),
        (lambda: Camera.perspective(46, 8, fov_deg=1e-9), "field of view 1e-09 degrees is too narrow for 900 columns"),
        (lambda: render(CLEAR, CAMERA, wavelengths_nm=[[1], [2, 3]]), "wavelengths_nm"),
        (lambda: render(CLEAR, CAMERA, wavelengths_nm=np.full(99, 1.0)), "wavelengths_nm"),
        (lambda: FrameSettings(utc_offset_h="one"), "utc_offset_h must be a number"),
        (lambda: calibrate("a.jpg", 46, 8, settings={}), "settings is {}: give FrameSettings"),
        (lambda: calibrate("a.jpg", 46, 8, mask=3), "mask is 3: give a file's name"),
        (lambda: calibrate("a.jpg", 46, 8, by=FIELD), "by is ndarray"),
        (lambda: calibrate("a.jpg", 46, 8, name="\udcff"), r"name '.udcff' is no text in UTF-8"),
        (lambda: read_frame("a.jpg", settings=3), "settings is 3: give FrameSettings"),
        (lambda: write_camera(CAMERA, "a.toml"), "content is Camera.*give CameraFile"),
        (lambda: openswim.compare(None, "a.jpg", CAMERA, encoding=FIELD), "encoding must be a number"),
        (lambda: jobs_of(1, 100_000), "threads 100000: give 1 to 1024"),
        (lambda: CameraPath.read(None), "path is None: give a file's name"),
        (lambda: CameraPath("a", FIELD, FIELD), "time is 'a'"),
        (lambda: CameraPath(TIMES, np.zeros((2, 2)), FIELD), r"place has shape \(2, 2\): it must be \(2, 3\)"),
        (lambda: CameraPath(TIMES, np.zeros((2, 3)), 3), r"attitude has shape \(\): it must be \(2, 4\)"),
    ],
)  # fmt: skip
def test_wrong_arguments_are_named(call: Callable[[], Any], named: str):
    """Never an error of numpy or xarray."""
    with pytest.raises(UserError, match=named) as caught:
        call()
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("call", "named"),
    [
        (lambda: render(CLEAR, CAMERA, layers=FIELD), "layers is .*array.*give True or False"),
        (lambda: to_rgb(IMAGE, gamma=AXIS), "gamma is array"),
        (lambda: to_rgb(IMAGE, dither=AXIS), "dither is array"),
        (lambda: openswim.film(CLEAR, CAMERA, None), "output is None: give a file's name"),
        (lambda: openswim.film(CLEAR, CAMERA, "a.mp4", path=3), "path is 3: give CameraPath or a file's name"),
        (lambda: openswim.film(CLEAR, CAMERA, "a.mp4", keogram=True), "keogram is True: give a file's name"),
        (lambda: openswim.film(CLEAR, CAMERA, "a.mp4", wavelengths_nm=["a"]), "wavelengths_nm = .'a'.: give a list"),
        (lambda: openswim.open_light("there", 3), "scene is 3: give a Scene: open_scene"),
        (lambda: openswim.compare(None, 3, CAMERA), "frames is 3"),
        (lambda: openswim.correct_clouds(CLEAR, None, [CAMERA]), "frames is None: give a list"),
        (lambda: openswim.correct_clouds(CLEAR, ["a"], [CAMERA], passes="two"), "passes is 'two': give a whole number"),
        (lambda: openswim.irradiance(CLEAR, 46, 8, "2024-06-01", planes=None), "planes is None: give a list"),
        (lambda: openswim.observe(arrays(), [CAMERA], core=3), "core is 3: give Core"),
        (lambda: openswim.analyse(3, xr.Dataset()), "op is 3: give an operator"),
        (lambda: openswim.write_observations("a.nc", None, xr.Dataset()), "op is None: give an operator"),
        (lambda: openswim.batch("a.toml", jobs="two"), "jobs is 'two': give a whole number"),
        (lambda: openswim.save(IMAGE, None), "path is None: give a file's name"),
        (lambda: openswim.save(3, "a.png"), "image is 3"),
        (lambda: openswim.save(IMAGE, "a.nc"), "image is .*: give a.nc the whole Dataset"),
        (lambda: openswim.save(IMAGE, "a.png", caption=AXIS), "caption is array"),
        (lambda: openswim.save(IMAGE, "a.png", bits="many"), "bits is 'many'"),
        (lambda: arrays(phase=AXIS), "phase is array.*give PhaseFunction or a dict"),
        (lambda: arrays(atmosphere=AXIS), "atmosphere is array"),
        (lambda: arrays(crs=AXIS), "crs = array.* is no projection"),
        (lambda: Scene.clear(10**400, 8), "lat is int 1"),
        (lambda: Scene(None, CLEAR.data, notes=[3]), "a note is 3"),
        (lambda: Scene(None, CLEAR.data, wider=3), "wider is 3"),
        (lambda: Camera.allsky(46, 8, size=np.array(3.5)), "size"),
        (lambda: Camera.panorama(46, 8, size=10**400), "size is int 1"),
        (lambda: Camera.satellite(46, 8, earth_radius_m=1e300), "no radius of an Earth"),
        (lambda: Camera.fisheye(46, 8, fov_deg=None), "fov_deg is None: give a number"),
        (lambda: Camera.fisheye(46, 8, centre=3), r"centre 3: give \(row, column\)"),
        (lambda: Camera.pinhole(46, 8, focal_px=9, affine=3), "affine .3.0,. must be three numbers"),
        (lambda: Camera(AXIS, (3, 3), 1, 1), "camera view array.* is unknown"),
        (lambda: Camera("allsky", (3, 3), 1, 1, above=AXIS), "above array.* is unknown"),
    ],
)  # fmt: skip
def test_kinds_are_those_that_annotations_name(call: Callable[[], Any], named: str):
    test_wrong_arguments_are_named(call, named)


@pytest.fixture(scope="module")
def viewpoint() -> Viewpoint:
    return openswim.light(CLEAR, "swim", sun=(180, 45)).viewpoint(CAMERA)


@pytest.mark.parametrize(
    ("call", "named"),
    [
        (lambda v: v.look([[0, 90]], [[45, 45]]), r"azimuth_deg has shape \(1, 2\) and altitude_deg \(1, 2\)"),
        (lambda v: v.sight([0, 90.0, 5], [45.0, 2]), r"azimuth_deg has shape \(3,\) and altitude_deg \(2,\)"),
        (lambda v: v.look("n", "up"), "azimuth_deg must be numbers, got 'n'"),
        (lambda v: v.look(0, None), "altitude_deg must be numbers, got None"),
        (lambda v: v.look([0], [100]), "altitude_deg must lie within -90..90"),
        (lambda v: v.sight([0], [NAN]), "altitude_deg must lie within"),
        (lambda v: v.sky([NAN], [5]), "azimuth_deg must be finite"),
        (lambda v: v.tile(0, 0), "rows is 0: give a slice"),
        (lambda v: v.tile(slice(3), [3]), r"columns is \[3\]: give a slice"),
        (lambda v: v.tile(slice("a", 2), slice(3)), r"rows is slice\('a', 2, None\): give a slice of whole numbers"),
    ],
)
def test_directions_and_tiles_are_looked_at(viewpoint: Viewpoint, call: Callable[[Viewpoint], Any], named: str):
    test_wrong_arguments_are_named(lambda: call(viewpoint), named)


def test_directions_may_be_one_number_or_many(viewpoint: Viewpoint):
    both = viewpoint.look([10, 10], [5, 90])
    np.testing.assert_array_equal(viewpoint.look(10, [5, 90]), both)
    np.testing.assert_array_equal(viewpoint.look(10.0, 5), both[:1])
    assert viewpoint.look([], []).shape == (0, 3)


def test_arguments_that_are_missing_are_named_by_python():
    with pytest.raises(TypeError, match="missing 1 required positional argument: 'camera'"):
        render(CLEAR)  # type: ignore[call-arg]


@pytest.mark.parametrize("name", ["a.png", "a.nc", "a.hdr"])
def test_misspelt_options_are_those_of_the_function_that_was_called(name: str, tmp_path: Path):
    with pytest.raises(TypeError, match=r"^save\(\) got an unexpected keyword argument 'exposur'"):
        openswim.save(IMAGE, tmp_path / name, exposur=1)  # type: ignore[call-arg]
    with pytest.raises(TypeError, match=r"^Solver\S* got an unexpected keyword argument 'qualty'"):
        Solver(qualty="high")  # type: ignore[call-arg]


def test_options_of_save_are_those_of_to_rgb():
    of_save, of_rgb = (inspect.signature(each).parameters for each in (openswim.save, to_rgb))
    assert set(of_save) == {*of_rgb, "path", "caption"}
    assert all(of_save[name].default == each.default for name, each in of_rgb.items())


def test_messages_hold_nothing_that_a_terminal_obeys():
    assert str(UserError("a\x1b[31m\u202eb\udcff: \u6f22")) == "a\\x1b[31m\\u202eb\\udcff: \u6f22"
