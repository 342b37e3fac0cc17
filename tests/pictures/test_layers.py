"""Layers of images: what pixels show, in data and files, beside a picture that they leave as it is."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import xarray as xr

import openswim
from openswim import Camera, Solver, UserError
from openswim.cli.main import run
from openswim.colour import save
from openswim.lighting import light
from openswim.pictures.viewpoint import LitScene
from openswim.scene.procedural import demo_scene

LAYERS = ("seen", "distance", "height", "optical_depth")


@pytest.fixture(scope="module")
def lit() -> LitScene:
    return light(demo_scene(48, 48, 20), Solver("swim"))


@pytest.fixture(scope="module")
def camera(lit: LitScene) -> Camera:
    return Camera.allsky(*lit.scene.place, height_m=2500.0, size=40, centre="nadir")


@pytest.fixture(scope="module")
def image(lit: LitScene, camera: Camera) -> xr.Dataset:
    return openswim.render(lit, camera, layers=True)


def test_the_picture_is_the_same_with_layers_and_without(lit: LitScene, camera: Camera, image: xr.Dataset) -> None:
    plain = openswim.render(lit, camera)
    assert not set(LAYERS) & set(plain)
    np.testing.assert_array_equal(plain["radiance"], image["radiance"])


def test_tiles_have_the_layers_of_the_whole(lit: LitScene, camera: Camera, image: xr.Dataset) -> None:
    tile = lit.viewpoint(camera).tile(slice(5, 17), slice(20, 40), layers=True)
    for name in LAYERS:
        np.testing.assert_array_equal(tile[name], image[name][..., 5:17, 20:40])


def test_flags_name_what_is_there(image: xr.Dataset, lit: LitScene) -> None:
    names = image["seen"].attrs["flag_meanings"].split()
    assert names == ["no_pixel", "sky", "land", "water", *image["species"].values]
    kinds = dict(zip(names, image["seen"].attrs["flag_values"], strict=True))
    seen = image["seen"].values
    np.testing.assert_array_equal(seen == kinds["no_pixel"], np.isnan(image["solid_angle"]))
    assert {int(kinds[name]) for name in ("no_pixel", "land", "liquid")} <= set(np.unique(seen))
    ground = (seen == kinds["land"]) | (seen == kinds["water"])
    terrain = lit.scene.data["surface_altitude"].values
    assert image["height"].values[ground].min() > terrain.min() - 60.0
    assert image["height"].values[ground].max() < terrain.max() + 60.0
    cloud = seen == kinds["liquid"]
    height = image["height"].values[cloud]
    levels = np.flatnonzero(lit.scene.data["liquid_content"].values.max(axis=(1, 2)) > 0)
    z = lit.scene.grid.height_m  # type: ignore[union-attr]
    assert height.min() > z[levels[0]].min() - 200.0
    assert height.max() < z[levels[-1]].max() + 200.0


def test_directions_see_what_pixels_see(lit: LitScene, camera: Camera, image: xr.Dataset) -> None:
    row, column = np.divmod(np.arange(0, 1600, 37), 40)
    inside = np.isfinite(image["solid_angle"].values[row, column])
    at = row[inside], column[inside]
    found = lit.viewpoint(camera).sight(image["azimuth"].values[at], image["altitude"].values[at])
    assert (found.kind == image["seen"].values[at]).mean() > 0.95  # azimuth and altitude are in single precision
    np.testing.assert_allclose(found.depth.T, image["optical_depth"].values[:, *at], rtol=1e-2, atol=1e-2)


@pytest.mark.parametrize("suffix", [".nc", ".zarr"])
def test_files_keep_layers(image: xr.Dataset, tmp_path: Path, suffix: str) -> None:
    path = tmp_path / f"sky{suffix}"
    save(image, path)
    with (xr.open_dataset(path) if suffix == ".nc" else xr.open_zarr(path)) as found:
        for name in LAYERS:
            np.testing.assert_array_equal(found[name], image[name])
        assert list(found["species"].values) == list(image["species"].values)
        assert found["seen"].attrs["flag_meanings"] == image["seen"].attrs["flag_meanings"]


def test_exr_has_the_distance_as_z(image: xr.Dataset, tmp_path: Path) -> None:
    library = pytest.importorskip("OpenEXR")
    save(image, tmp_path / "sky.exr")
    with library.File(str(tmp_path / "sky.exr"), separate_channels=True) as file:
        found = np.array(file.channels()["Z"].pixels)
    distance = image["distance"].values
    np.testing.assert_array_equal(found, np.where(np.isnan(distance), np.inf, distance))


def test_the_reference_has_none_and_pictures_hold_none(
    lit: LitScene, camera: Camera, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(UserError, match="use fast or swim"):
        openswim.render(lit.scene, camera, "reference", layers=True)
    scene = tmp_path / "scene.nc"
    scene.touch()
    place = ["--lat", "47", "--lon", "11", "--layers"]
    assert run(["render", str(scene), *place, "-o", str(tmp_path / "sky.png")]) == 2
    assert "--layers are written to .nc, .zarr, .exr" in capsys.readouterr().err
