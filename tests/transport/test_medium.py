"""From a scene to levels, columns and a chart: nothing is lost or moved on the way."""

from typing import Any

import numpy as np
import pytest
from tests.transport.scenes import LAT, LON, box, grid_scene, medium_of, slab

from openswim.cameras import Rays
from openswim.errors import UserError
from openswim.ground.surface import surface_of
from openswim.optics.matter import matter_of
from openswim.scene import Scene
from openswim.scene.frame import scene_frame
from openswim.solver import Solver
from openswim.transport.air.shells import no_volume
from openswim.transport.march.volume import grid_index
from openswim.transport.medium.levels import own_levels
from openswim.transport.medium.plan import Fineness, plan_medium
from openswim.transport.medium.subdivision import finer_cloud, subdivided

WL = np.array([615.0, 546.0, 450.0])
SHAPE = (9, 7, 6)


def columns_m(extinction: np.ndarray, height_m: np.ndarray) -> np.ndarray:
    """Vertical optical depth of every column."""
    return np.trapezoid(extinction.astype(float), height_m, axis=0)


def lumps(seed: int = 0) -> np.ndarray:
    field = np.random.default_rng(seed).random(SHAPE, np.float32) ** 3 * 0.05
    field[[0, -1]] = 0
    return field


def test_levels_come_before_columns() -> None:
    """Where nodes are too many to divide both, thick layers are divided and wide cells are not."""
    shape = (16, 30, 30)
    medium = medium_of(grid_scene(np.full(shape, 100 / 375), shape, (999.0, 999.0, 25.0)), WL, 0.8)
    assert len(medium.levels_m) > 45  # of an optical depth of .9 each, scaled
    assert medium.extinction.size < 5e6


def test_levels_are_divided_without_changing_the_cloud() -> None:
    scene = grid_scene(lumps(), SHAPE)
    medium = medium_of(scene, WL, 0.8)
    assert len(medium.levels_m) > SHAPE[0]  # five optical depths a cell are too many
    assert set(np.round(scene.grid.height_m, 6)) <= set(np.round(medium.levels_m, 6))
    f = medium.fineness
    assert f > 1  # across, too
    ours = columns_m(medium.extinction[0], medium.levels_m)
    np.testing.assert_allclose(ours[::f, ::f], columns_m(lumps(), scene.grid.height_m), rtol=1e-5)


def test_air_under_a_cloud_is_not_divided_as_cloud() -> None:
    """A deck that begins with the lowest level of its file: only its own layers are thick."""
    x, z = 50.0 * np.arange(8), 438.0 + 25.0 * np.arange(8)
    deck = np.full((8, 8, 8), 0.1, np.float32)
    medium = medium_of(Scene.from_arrays(deck, x, x, z), WL, 0.8)
    below, within = (np.diff(medium.levels_m[part]) for part in (medium.levels_m <= 437, medium.levels_m >= 438))
    assert below.min() > 100.0
    assert within.max() < 25.0


@pytest.mark.parametrize(("columns", "more"), [(12, True), (5, False)], ids=["overcast", "broken"])
def test_a_low_sun_divides_what_it_meets_from_above(columns: int, more: bool) -> None:
    """Where cloud covers under half of the columns, they are lit from their sides."""
    shape = (12, 12, 12)
    cloud = box(shape, (slice(4, 8), slice(0, 12), slice(0, columns)), 0.01)
    cloud[:, 0] *= 0.9  # not plane-parallel
    scene = grid_scene(cloud, shape)
    low, high = (len(medium_of(scene, WL, np.cos(np.radians(zenith))).levels_m) for zenith in (75.0, 60.0))
    assert low > high if more else low == high


def test_without_refinement_the_levels_are_the_scenes_own() -> None:
    scene = grid_scene(lumps(), SHAPE)
    medium = medium_of(scene, WL, 0.8, refine=False)
    np.testing.assert_allclose(medium.levels_m, scene.grid.height_m)
    np.testing.assert_array_equal(medium.extinction[0], lumps())


def test_clear_air_goes_on_above_a_low_model() -> None:
    scene = grid_scene(lumps(), SHAPE, air=True)
    own, medium = (medium_of(scene, WL, 0.8, extend=extend) for extend in (False, True))
    nz, top = len(own.levels_m), own.levels_m[-1]
    assert top < 1000 < 18e3 < medium.levels_m[-1]
    np.testing.assert_array_equal(medium.levels_m[:nz], own.levels_m)
    np.testing.assert_array_equal(medium.extinction[:, :nz], own.extinction)
    assert not medium.extinction[:, nz:].any()
    above = np.diff(medium.levels_m[nz - 1 :])
    assert above.size < 20
    assert (np.diff(above) >= 0).all()
    assert 0 < above.max() <= 2000
    assert medium.cloud_top_m == own.cloud_top_m <= top
    airless = grid_scene(lumps(), SHAPE)
    own, medium = (medium_of(airless, WL, 0.8, extend=extend) for extend in (False, True))
    np.testing.assert_array_equal(medium.levels_m, own.levels_m)


def test_terrain_following_levels_keep_the_columns() -> None:
    nz, ny, nx = 21, 7, 6
    x = 1000.0 * np.arange(nx)
    terrain = 200.0 + 60.0 * np.arange(nx) * np.ones((ny, 1))
    heights = terrain + np.linspace(0, 6000, nz)[:, None, None] * (1 - terrain / 20_000)
    cloud = 0.004 * np.exp(-(((heights - 2500) / 700) ** 2)).astype(np.float32)
    scene = Scene.from_arrays({"cloud": cloud}, x, 1000.0 * np.arange(ny), heights, terrain_m=terrain)
    medium = medium_of(scene, WL, 0.8)
    assert (np.diff(medium.levels_m) > 0).all()
    ours = columns_m(medium.extinction[0], medium.levels_m)[:: medium.fineness, :: medium.fineness]
    theirs = np.trapezoid(cloud.astype(float), heights, axis=0)
    # resampling between levels that do not coincide: a few per mil of a smooth profile
    np.testing.assert_allclose(ours, theirs, rtol=0.01)


def test_plane_parallel_scenes_become_one_column() -> None:
    medium = medium_of(slab(5.0), WL, 0.5)
    assert medium.shape[1:] == (1, 1)
    assert medium.layered
    assert columns_m(medium.extinction[0], medium.levels_m)[0, 0] == pytest.approx(5.0, rel=1e-5)


def test_columns_stand_where_the_map_puts_them() -> None:
    scene = grid_scene({}, SHAPE, (4000.0, 5000.0, 500.0), curved=True)
    medium = medium_of(scene, WL, 0.8, refine=False)
    iy, ix = np.mgrid[0 : SHAPE[1], 0 : SHAPE[2]]
    lon, lat = scene.grid.lonlat(ix, iy)
    ours_lat, ours_lon, height = medium.frame.latlon(medium.place)
    np.testing.assert_allclose(ours_lat, lat, atol=1e-9)
    np.testing.assert_allclose(ours_lon, lon, atol=1e-9)
    np.testing.assert_allclose(height, 0.0, atol=1e-3)
    # right-handed orthonormal axes; the first points along the grid
    axes = medium.axes.astype(float)
    np.testing.assert_allclose(axes @ np.swapaxes(axes, -1, -2), np.broadcast_to(np.eye(3), axes.shape), atol=1e-6)
    assert (np.linalg.det(axes) > 0.999).all()
    along = medium.place[:, 1:] - medium.place[:, :-1]
    along /= np.linalg.norm(along, axis=-1, keepdims=True)
    assert ((along * axes[:, :-1, 0]).sum(-1) > 0.99999).all()


def test_frame_of_a_curved_scene_stands_on_its_centre() -> None:
    medium = medium_of(grid_scene({}, SHAPE, curved=True), WL, 0.8)
    assert medium.frame.lat == pytest.approx(LAT, abs=1e-6)
    assert medium.frame.lon == pytest.approx(LON, abs=1e-6)


@pytest.mark.parametrize("fineness", [2, 4])
def test_subdivision_keeps_planes(fineness: int) -> None:
    y, x = np.mgrid[0:5, 0:6].astype(np.float32)
    fine = subdivided(2 + 3 * x - y, fineness)
    assert fine.shape == (4 * fineness + 1, 5 * fineness + 1)
    yy, xx = np.mgrid[0 : fine.shape[0], 0 : fine.shape[1]] / fineness
    np.testing.assert_allclose(fine, 2 + 3 * xx - yy, atol=1e-4)


@pytest.mark.parametrize("fineness", [2, 4])
def test_finer_clouds_hold_as_much_and_stay_where_they_are(fineness: int) -> None:
    coarse = np.zeros((1, 12, 12), np.float32)
    coarse[0, 4:8, 3:7] = [[1, 2, 3, 1], [2, 5, 4, 2], [1, 3, 6, 1], [1, 1, 2, 1]]
    fine = finer_cloud(coarse, fineness)
    assert fine.min() >= 0
    total = fine.sum() / fineness**2
    # the mean of a cell is kept up to the interpolation of the factor that keeps it
    assert total == pytest.approx(coarse.sum(), rel=0.1)
    far = np.ones(fine.shape, bool)
    far[0, 3 * fineness : 8 * fineness + 1, 2 * fineness : 7 * fineness + 1] = False
    assert fine[far].max() < 1e-5 * coarse.max()  # no cloud a cell beyond the last cloudy node


def test_a_uniform_layer_stays_uniform_when_made_finer() -> None:
    np.testing.assert_allclose(finer_cloud(np.full((2, 5, 6), 0.003, np.float32), 4), 0.003, rtol=1e-4)


def test_cloud_under_the_terrain_is_gone() -> None:
    terrain = np.full(SHAPE[1:], 450.0)
    scene = grid_scene(np.full(SHAPE, 0.001, np.float32), SHAPE, curved=True, terrain_m=terrain)
    medium = medium_of(scene, WL, 0.8, refine=False)
    assert not medium.extinction[0, medium.levels_m < 250].any()
    assert medium.extinction[0, medium.levels_m > 450].all()


def test_a_scene_without_a_grid_has_no_medium() -> None:
    with pytest.raises(UserError, match="no grid"):
        medium_of(Scene.clear(LAT, LON), WL, 0.8)


def test_global_grids_are_refused_with_a_remedy() -> None:
    from pyproj import CRS

    lonlat = CRS.from_proj4("+proj=longlat +R=6371000")
    scene = Scene.from_arrays(
        {}, np.arange(-180.0, 180.0, 10.0), np.arange(-80.0, 81.0, 10.0), np.arange(3) * 1000.0, crs=lonlat
    )
    with pytest.raises(UserError, match="350 degrees"):
        medium_of(scene, WL, 0.8)


def hemisphere(lat: float = 20.0, lon: float = 170.0, half_deg: float = 89.0, nodes: int = 61, **more: Any) -> Scene:
    """The half of the Earth around a place, as `readers.domain` maps it: equal-area, over date line and pole."""
    from pyproj import CRS

    radius = 6.371e6
    axis = np.linspace(-1, 1, nodes) * 2 * radius * np.sin(np.radians(half_deg) / 2)
    crs = CRS.from_proj4(f"+proj=laea +lat_0={lat} +lon_0={lon} +R={radius}")
    return Scene.from_arrays({}, axis, axis, np.arange(5) * 4000.0, crs=crs, earth_radius_m=radius, **more)


def test_chart_finds_places_all_over_a_hemisphere() -> None:
    scene = hemisphere()
    medium = medium_of(scene, WL, 0.8, refine=False)
    up = np.random.default_rng(0).standard_normal((4000, 3))
    up /= np.linalg.norm(up, axis=1, keepdims=True)
    up = up[up[:, 2] > np.cos(np.radians(88))]
    radius = medium.frame.radius_m
    place = up * (radius + 5000.0) - np.array([0, 0, radius])
    volume = no_volume()._replace(
        chart_origin_m=medium.chart_origin_m, chart_per_m=medium.chart_per_m, chart=medium.chart
    )
    ours = np.array([grid_index(*p, radius, volume) for p in place])
    lat, lon, _ = medium.frame.latlon(place)
    np.testing.assert_allclose(ours, np.stack(scene.grid.index(lon, lat), axis=-1), atol=0.02)


def test_a_hemisphere_of_cloud_is_seen_to_the_limb_without_a_hole() -> None:
    shape = (5, 61, 61)
    cloud = np.zeros(shape, np.float32)
    cloud[1:3] = 2e-3  # 16 optical depths
    scene = hemisphere(fields={"liquid_content": 1e-3 * cloud})
    frame = scene_frame(scene)
    eye = np.array([0.0, 0.0, 4e7])
    radius = frame.radius_m
    angle, turn = np.meshgrid(np.linspace(0, 0.985, 24), np.linspace(0, 2 * np.pi, 24, endpoint=False))
    sine = angle * radius / (radius + eye[2])
    rays = np.stack([sine * np.cos(turn), sine * np.sin(turn), -np.sqrt(1 - sine**2)], axis=-1).reshape(-1, 3)
    view = Solver("swim").solve(scene, np.array([0.3, 0.2, 0.9]), WL[:1]).view(Rays(eye, rays))
    assert view.transmittance.max() < 1e-3


@pytest.mark.parametrize(
    ("extinction_per_m", "divide", "halvings"), [(1e-3, True, 0), (0.05, True, 3), (0.05, False, 0)]
)
def test_what_is_planned_of_a_grid_is_what_is_built(extinction_per_m: float, divide: bool, halvings: int) -> None:
    """Nodes and halved cells of a thin and a thick cloud on the Earth, as estimates have them; even ones stay whole."""
    shape = (10, 12, 12)
    lump = box(shape, (slice(3, 7), slice(4, 8), slice(4, 8)), extinction_per_m)
    scene = grid_scene(lump, shape, (200.0, 200.0, 100.0), curved=True)
    medium = medium_of(scene, np.array([550.0]), 0.7, divide=divide)
    terrain = surface_of(scene, 550.0).terrain_m
    plan = plan_medium(matter_of(scene, 550.0), terrain, 0.7, Fineness(divide=divide, extend=True))
    assert medium.halvings == len(plan.halvings) == halvings
    assert plan.cell_m == medium.cell_m
    assert plan.drawn_shape == medium.shape
    even = grid_scene(np.full(shape, extinction_per_m), shape, (200.0, 200.0, 100.0), curved=True)
    assert medium_of(even, np.array([550.0]), 0.7).halvings == 0


def test_a_thin_lowest_layer_does_not_fill_the_air_below_with_its_like():
    """It did, down to the ground: half a minute at ten centimetres."""
    assert len(own_levels(np.array([500.0, 500.1, 1000.0]), np.zeros((1, 1), np.float32), True)) < 200
