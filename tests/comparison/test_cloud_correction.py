"""Clouds cleared and added by what a camera sees: geometry, edits, and a truth that was displaced."""

import re
from dataclasses import replace

import numpy as np
import pytest
from tests.comparison.skies import write_frame

import openswim
from openswim import Camera, Scene, Solver, light
from openswim.cameras.files import CameraFile, FrameSettings, ResponseSettings, write_camera
from openswim.cli.main import run
from openswim.comparison.cloud_edit import edited, extinction, typical_layer
from openswim.comparison.cloud_rays import crossings
from openswim.errors import UserError
from openswim.scene.frame import horizon_vector
from openswim.scene.procedural import demo_scene

FAST = Solver("fast", quality="preview")


def blocks(cloud=None):
    """A flat scene of 21 x 21 x 6 nodes, 200 m apart, levels 500 to 1500 m."""
    extinctions = np.zeros((6, 21, 21)) if cloud is None else cloud
    axis = np.arange(21) * 200.0
    return Scene.from_arrays(extinctions, axis, axis, np.arange(500.0, 1501.0, 200.0), place=(47, 8))


def test_rays_cross_the_cells_that_lie_on_them():
    camera = Camera.allsky(x_m=2000.0, y_m=2000.0, height_m=0.0, size=4)
    up, slanted = horizon_vector([0.0, 90.0], [90.0, 45.0])
    found = crossings(blocks(), camera, np.stack([up, slanted]), slice(0, 6))
    first = found.votes(np.array([True, False]))
    assert first[:, 10, 10].sum() == pytest.approx(first.sum())
    second = found.votes(np.array([False, True]))
    # toward the east, 45 degrees: 500 m up is 500 m away, node 12.5
    np.testing.assert_allclose(found.index[1][0], (0, 10, 12.5), atol=1e-4)
    assert second[:, :10].sum() + second[:, 11:].sum() == pytest.approx(0, abs=1e-9)
    assert found.column_at(900.0).tolist() == [10 * 21 + 10, 10 * 21 + 14]
    wall = np.zeros((6, 21, 21), bool)
    wall[:, :, 14:16] = True
    assert found.touches(wall).tolist() == [False, True]


def test_rays_on_the_curved_earth_agree_with_its_own_geometry():
    scene = demo_scene(16, 16, 16, spacing_m=2000.0)
    camera = Camera.allsky(*scene.place, size=4)
    direction = horizon_vector([30.0], [8.0])
    found = crossings(scene, camera, direction, slice(0, 16))
    k, j, i = found.index[0][np.isfinite(found.index[0][:, 0])][-1]
    lon, lat = scene.grid.lonlat(i, j)
    frame = openswim.scene.frame.scene_frame(scene)
    ground_m = float(scene.data.surface_altitude[7:9, 7:9].mean())
    eye = frame.position(*scene.place, ground_m + 2)
    away = frame.position(lat, lon, np.interp(k, np.arange(16), scene.grid.height_m)) - eye
    seen = away / np.linalg.norm(away) @ frame.enu(*scene.place).T
    assert np.degrees(np.arccos(seen @ direction[0])) < 0.02


def test_edits_take_and_add_and_leave_the_rest():
    cloud = np.zeros((6, 21, 21))
    cloud[1:3, 5:9, 5:9] = 0.05
    scene = blocks(cloud)
    layer = typical_layer(scene)
    assert layer.middle_m == pytest.approx(800.0)
    np.testing.assert_allclose(layer.amounts["extinction_cloud"], [0, 0.05, 0.05, 0, 0, 0])
    clear, add = np.zeros((2, *cloud.shape), bool)
    clear[:, 5, 5] = add[:, 15, 15] = True
    found = extinction(edited(scene, clear, add, layer))
    assert found[:, 5, 5].max() == 0
    np.testing.assert_allclose(found[:, 15, 15], [0, 0.05, 0.05, 0, 0, 0])
    same = ~(clear | add)
    np.testing.assert_allclose(found[same], cloud[same], rtol=1e-6)
    with pytest.raises(UserError, match="--base"):
        typical_layer(blocks())


def test_without_air_it_is_said_why_there_are_no_scores(tmp_path, capsys):
    """The clear sky is black: no cloud can be told from it, and all of the model's is taken for clear."""
    cloud, axis = np.zeros((4, 21, 21)), np.arange(21) * 500.0
    cloud[1:3, 8:12, 12:16] = 0.01
    scene = Scene.from_arrays(cloud, axis, axis, np.arange(500.0, 2001.0, 500.0), place=(47, 8), surface_albedo=0.15,
                              time="2024-06-20T08:00")  # fmt: skip
    content = CameraFile(Camera.allsky(x_m=5000.0, y_m=5000.0, size=48), response=ResponseSettings(red_blue=0.0))
    write_camera(content, tmp_path / "camera.toml")
    seen = np.random.default_rng(0).uniform(0.1, 0.4, (48, 48, 3))
    noisy, even = (write_frame(tmp_path / f"{name}_20240620_080000.png", radiance, (2.0, 2.0, 2.0))
                   for name, radiance in (("noisy", seen), ("even", np.full_like(seen, 0.2))))  # fmt: skip
    frame = replace(content, frames=FrameSettings(utc_offset_h=0.0))
    _, history = openswim.correct_clouds(scene, [noisy], [frame], passes=1, solver=FAST)
    assert np.isfinite(history.r_used.values).ravel().tolist() == [True, False]
    assert np.isnan(history.cloud_error.values).all()
    assert history.reason.values[0].startswith("without air the clear sky is black")
    scene.to_netcdf(tmp_path / "model.nc")
    asked = ["correct-clouds", str(tmp_path / "model.nc"), str(even), "--camera", str(tmp_path / "camera.toml")]
    asked += ["--utc-offset", "0", "--quality", "preview", "--passes", "1"]
    assert run([*asked, "-o", str(tmp_path / "a.nc")]) == 0
    said, told = capsys.readouterr()
    assert "no edit has raised r" in told
    assert re.search(r"mean r nan, .*; cloud masks are none \(without air .*; a picture has no contrast\)", said)


def displaced(folder, seed, cells, axis, away_m):
    """Cumulus and the same moved by cells along an axis of the grid, with frames of the first by cameras that stand so
    far east and north (m) of its middle."""
    truth = demo_scene(40, 40, 24, seed=seed, spacing_m=300.0, cloud_cover=0.15)
    truth = replace(truth, data=truth.data.drop_vars(["ice_content", "ice_effective_radius"]))
    lat, lon = truth.place
    metres = 111_195 * np.array([np.cos(np.radians(lat)), 1.0])
    lit = light(truth, FAST)
    frames, cameras = [], []
    for number, away in enumerate(np.array(away_m) / metres):
        camera = Camera.fisheye(lat + away[1], lon + away[0], size=96)
        radiance = np.nan_to_num(lit.viewpoint(camera).view().radiance.values)
        frames.append(write_frame(folder / f"sky{number}_20260710_140000.png", radiance, (2.0, 2.0, 2.0)))
        response = ResponseSettings(red_blue=0.0)
        cameras.append(CameraFile(camera, "", FrameSettings(utc_offset_h=0.0), response=response))
    moved = {
        name: (truth.data[name].dims, np.roll(truth.data[name].values, cells, axis=axis))
        for name in ("liquid_content", "liquid_effective_radius")
    }
    return replace(truth, data=truth.data.assign(moved), notes=[]), frames, cameras


@pytest.mark.slow
def test_a_displaced_truth_is_put_right(tmp_path):
    """Cumulus two cells off: mean r from .47 to .75 and more."""
    model, frames, cameras = displaced(tmp_path, 5, 2, 2, [(0, 0)])
    scene, history = openswim.correct_clouds(model, frames, cameras, hold_out=False, lowest_deg=15, passes=1,
                                             solver=FAST)  # fmt: skip
    r = history.r_used.values[:, 0]
    assert r[0] <= 0.47  # measured: .466
    assert r[-1] >= 0.75
    assert history.cloud_error.values[-1] < 0.5 * history.cloud_error.values[0]
    assert "clouds corrected" in scene.notes[-1]
    scene.to_netcdf(tmp_path / "edited.nc")
    again = openswim.open_scene(tmp_path / "edited.nc")
    np.testing.assert_allclose(extinction(again), extinction(scene), rtol=1e-5)


@pytest.mark.slow
def test_several_cameras_put_a_displaced_truth_right_at_once(tmp_path):
    """Three cameras, two kilometres apart: r rises in each of them, also on pixels that the edit has not used."""
    model, frames, cameras = displaced(tmp_path, 6, -2, 1, [(0, 0), (2000, 1000), (-1500, 1500)])
    scene, history = openswim.correct_clouds(model, frames, cameras, lowest_deg=15, passes=1, solver=FAST)
    assert history.r_used.sizes == {"edit": 2, "camera": 3}
    for r in (history.r_used, history.r_unused):
        assert r.values[0].mean() <= 0.45
        assert r.values[1].min() >= 0.75
    assert scene.notes[-1].count("sky") == 3


def test_what_cannot_be_corrected_is_one_line(tmp_path):
    known = CameraFile(Camera.fisheye(47, 8, size=64), "", FrameSettings(utc_offset_h=0.0))
    frame = write_frame(tmp_path / "sky_20240620_080000.png", np.full((64, 64, 3), 0.1))
    with pytest.raises(UserError, match="needs a model"):
        openswim.correct_clouds(None, [frame], [known])
    with pytest.raises(UserError, match="one of each camera"):
        openswim.correct_clouds(blocks(), [frame], [known, known])
    with pytest.raises(UserError, match="1 clear frames of 2 cameras"):
        openswim.correct_clouds(blocks(), [frame] * 2, [known] * 2, clear_frames=[frame])
    with pytest.raises(UserError, match="no grid"):
        openswim.correct_clouds(Scene.clear(47, 8), [frame], [known])
