"""What is called with something else than it takes says so in one line that names it."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
import xarray as xr

import openswim
from openswim import Background, Camera, Ground, Scene, Solver, UserError, open_scene, render, save_camera, to_rgb
from openswim.assimilation.settings import Settings
from openswim.ground.maps import maps_of

FIELD, AXIS, LEVELS = np.zeros((5, 4, 4)), np.arange(4.0), np.arange(5.0)
CAMERA, CLEAR = Camera.allsky(46, 8, size=8), Scene.clear(46, 8)
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
        (lambda: render(CLEAR, CAMERA, solver=None), "unknown solver None"),
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
    ],
)  # fmt: skip
def test_wrong_arguments_are_named(call: Callable[[], Any], named: str):
    """Never an error of numpy or xarray."""
    with pytest.raises(UserError, match=named) as caught:
        call()
    assert "\n" not in str(caught.value)


def test_messages_hold_nothing_that_a_terminal_obeys():
    assert str(UserError("a\x1b[31m\u202eb\udcff: \u6f22")) == "a\\x1b[31m\\u202eb\\udcff: \u6f22"
