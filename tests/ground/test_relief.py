"""The user's elevation models: heights at the grid's nodes, slopes in between."""

import numpy as np
import pytest
from tests.ground.test_maps import lonlat_scene, rasterio, write

import openswim
from openswim.ground.relief import height_maps, mapped_normals, refined_terrain
from openswim.scene.frame import Frame

assert rasterio
FRAME = Frame(6_371_000.0, 46.0, 8.0)


def plane(east, north, n=600, bounds=(7.0, 45.0, 9.0, 47.0)):
    """A slope of `east`, `north` (metres per metre) about 1000 m at 46 N 8 E, as an elevation model."""
    west, south, right, top = bounds
    lon = west + (right - west) * (np.arange(n) + 0.5) / n
    lat = top - (top - south) * (np.arange(n)[:, None] + 0.5) / n
    metre = np.radians(1.0) * FRAME.radius_m
    rise = east * (lon - 8.0) * metre * np.cos(np.radians(46.0)) + north * (lat - 46.0) * metre
    return (1000.0 + rise + 0 * lat).astype(np.float32)[None]


def test_nodes_take_the_height_of_the_map_where_it_reaches(tmp_path):
    bounds = (7.9, 45.9, 8.1, 46.1)
    ground = openswim.Ground(height=write(tmp_path / "a.tif", plane(0.01, 0.0, 300, bounds), bounds=bounds))
    scene = lonlat_scene(ground)
    ny, nx = scene.grid.shape[1:]
    terrain = refined_terrain(scene, np.full((ny, nx), 300.0, np.float32))
    assert terrain[5, 5] == pytest.approx(1000.0, abs=1.0)
    assert terrain[0, 0] == 300.0
    fine = refined_terrain(scene, np.full((4 * ny - 3, 4 * nx - 3), 300.0, np.float32), 4)
    across = 0.025 * np.radians(1.0) * FRAME.radius_m * np.cos(np.radians(46.0))
    assert fine[20, 21] - fine[20, 20] == pytest.approx(0.01 * across, rel=0.02)


@pytest.mark.parametrize(("east", "north"), [(0.3, 0.0), (0.0, -0.2), (0.1, 0.4)])
@pytest.mark.parametrize("footprint", [0.0, 2000.0])
def test_slopes_of_a_plane(tmp_path, east, north, footprint):
    scene = lonlat_scene(openswim.Ground(height=write(tmp_path / "a.tif", plane(east, north))))
    place = FRAME.position([46.0], [8.0], [1000.0])
    normal, known = mapped_normals(
        height_maps(scene), FRAME, place, np.array([[0.0, 0.0, 1.0]]), np.array([footprint])
    )
    expected = np.array([-east, -north, 1.0]) / np.sqrt(1 + east**2 + north**2)
    np.testing.assert_allclose(normal[0], expected, atol=4e-3)
    assert known == 1


def test_without_maps_the_model_holds(tmp_path):
    scene = lonlat_scene(None)
    terrain = np.random.default_rng(0).uniform(0, 3000, scene.grid.shape[1:]).astype(np.float32)
    assert refined_terrain(scene, terrain) is terrain
