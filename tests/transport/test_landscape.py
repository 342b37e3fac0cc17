"""Landscapes: a user's elevation model in view, geometry known; the default Earth's mountains; nothing without."""

import tracemalloc
from dataclasses import replace

import numpy as np
import pytest
from pyproj import CRS
from tests.ground.test_maps import rasterio, write
from tests.transport.scenes import LAT, LON, WAVELENGTH_NM, aimed_at, grid_scene, medium_of, toward

import openswim
from openswim.cameras import Rays
from openswim.ground import Ground, earth
from openswim.ground.surface import surface_of
from openswim.scene import Scene
from openswim.solver import Solver
from openswim.transport.ground_light.landscape import Landscape, Lattice, landscape_of
from openswim.transport.march.march import march_rays
from openswim.transport.march.volume import FAR_M

assert rasterio
RADIUS = 6_371_000.0
METRE = np.degrees(1.0 / RADIUS)  # of latitude, in degrees
BASE_M = 300.0


def scene_with(height: np.ndarray | None, path, half_m: float = 30e3, air: bool = False, terrain_m: float = BASE_M):
    """A level model of 3 km around (LAT, LON), and an elevation model (rows from north) over ``half_m`` each way."""
    scene = grid_scene({}, (11, 31, 31), (3000.0, 3000.0, 1000.0), True, air, terrain_m=np.full((31, 31), terrain_m),
                       surface_albedo=0.3)  # fmt: skip
    if height is None:
        return scene
    north, east = half_m * METRE, half_m * METRE / np.cos(np.radians(LAT))
    bounds = (LON - east, LAT - north, LON + east, LAT + north)
    return replace(scene, ground=openswim.Ground(height=write(path, height[None].astype(np.float32), bounds=bounds)))


def pixels(half_m: float, step_m: float) -> np.ndarray:
    """Metres from the middle of the centres of pixels."""
    count = round(2 * half_m / step_m)
    return (np.arange(count) + 0.5) * step_m - half_m


def landscape(scene: Scene) -> Landscape:
    found = landscape_of(surface_of(scene, WAVELENGTH_NM), medium_of(scene, np.array([WAVELENGTH_NM]), 0.5))
    assert found is not None
    return found


def eye_at(land: Landscape, above_m: float) -> np.ndarray:
    return land.medium.frame.position(LAT, LON, land.ground_m(LAT, LON) + above_m)


def fan(azimuth_deg: float, altitude: np.ndarray) -> np.ndarray:
    azimuth = np.radians(azimuth_deg)
    level = np.cos(altitude)
    return np.stack([level * np.sin(azimuth), level * np.cos(azimuth), np.sin(altitude)], axis=-1)


@pytest.mark.parametrize("azimuth", [0.0, 20.0])
def test_a_ridge_line_stands_where_geometry_has_it(tmp_path, azimuth: float) -> None:
    """A round ridge along a parallel, 9 km north, pixels of 1 mrad: its outline is right to a tenth of a pixel."""
    x, north = pixels(30e3, 30.0), pixels(30e3, 30.0)[::-1]
    ridge = BASE_M + 1200.0 * np.exp(-0.5 * ((north - 9000.0) / 800.0) ** 2)
    scene = scene_with(np.broadcast_to(ridge[:, None], (x.size, x.size)), tmp_path / "dem.tif")
    land = landscape(scene)
    eye = eye_at(land, 2.0)
    altitude = np.arange(0.08, 0.16, 2e-5)
    direction = fan(azimuth, altitude)
    seen = land.seen_from(Rays(eye, direction, 1e-3))
    hit = seen.meet(eye[None], direction) < FAR_M
    assert hit[: hit.sum()].all()
    # the crest, and what the ray sees of its back: the highest angle to any point of the vertical plane
    centre = np.array([0.0, 0.0, RADIUS])
    toward_azimuth = np.array([np.sin(np.radians(azimuth)), np.cos(np.radians(azimuth)), 0.0])
    angle = np.arange(6000.0, 12e3, 1.0) / RADIUS
    up = np.sin(angle)[:, None] * toward_azimuth + np.cos(angle)[:, None] * np.array([0.0, 0.0, 1.0])
    lat, _, _ = land.medium.frame.latlon(up * RADIUS - centre)
    height = BASE_M + 1200.0 * np.exp(-0.5 * (((lat - LAT) / METRE - 9000.0) / 800.0) ** 2)
    sight = up * (RADIUS + height)[:, None] - centre - eye
    expected = np.arcsin(sight[:, 2] / np.linalg.norm(sight, axis=-1)).max()
    assert altitude[hit].max() == pytest.approx(expected, abs=1e-4)


def test_the_observer_stands_on_the_elevation_model(tmp_path) -> None:
    """In a narrow valley that the model does not have."""
    x = pixels(30e3, 60.0)
    valley = np.broadcast_to(1500.0 - 1200.0 * np.exp(-0.5 * (x / 300.0) ** 2), (x.size, x.size))
    land = landscape(scene_with(valley, tmp_path / "dem.tif"))
    assert land.ground_m(LAT, LON) == pytest.approx(valley[0].min(), abs=10.0)
    eye = eye_at(land, 2.0)
    down = np.array([[0.0, 0.0, -1.0]])
    assert land.seen_from(Rays(eye, down, 1e-3)).meet(eye[None], down)[0] == pytest.approx(2.0, abs=1e-3)


def test_steps_are_as_fine_as_pixels_where_one_looks(tmp_path) -> None:
    land = landscape(scene_with(np.zeros((600, 600)), tmp_path / "dem.tif"))
    eye, direction = eye_at(land, 2.0), fan(0.0, np.linspace(-0.3, 0.3, 50))
    for width in (3e-3, 1e-3):
        fields = land.seen_from(Rays(eye, direction, width)).fields
        assert fields[0].step_m == pytest.approx(100.0, rel=0.01)
        for f in fields[:-1]:
            reach = f.origin_m[1] + (f.height_m.shape[0] - 1) * f.step_m
            assert f.step_m == pytest.approx(width * reach, rel=0.2)
    fields = land.seen_from(Rays(eye_at(land, 50e3), direction, 1e-2)).fields
    assert fields[0].step_m == pytest.approx(500.0, rel=0.01)  # of what an eye 50 km up can tell apart
    assert land.seen_from(Rays(eye_at(land, 2e5), direction, 1e-2)) is None


def test_shadow_on_the_ground_of_a_picture(tmp_path) -> None:
    """A wall of 200 m, the sun 30 degrees high behind it: seen from above, dark for 200/tan 30 = 346 m."""
    x = pixels(3e3, 8.0)
    wall = np.broadcast_to(BASE_M + 200.0 * (np.abs(x) < 40.0), (x.size, x.size))
    scene = scene_with(wall, tmp_path / "dem.tif", 3e3)
    field = Solver("swim").solve(scene, toward(270.0, 30.0), [WAVELENGTH_NM])
    eye = field.frame.position(LAT, LON, BASE_M + 3000.0)
    across = np.arange(-600.0, 800.0, 10.0)
    target = np.stack([across, 0 * across + 7.0, 0 * across + BASE_M], axis=-1)
    direction = (target - eye) / np.linalg.norm(target - eye, axis=-1, keepdims=True)
    view = field.view(Rays(eye, direction, 1e-3))
    light = view.radiance[:, 0] / np.median(view.radiance[across < -200.0, 0])
    np.testing.assert_allclose(light[across < -100.0], 1.0, atol=0.02)
    shaded = across[(light < 0.5) & (across > 70.0)]
    edge = 36.0  # centre of the wall's last pixel: within one, the ground falls away
    assert shaded.max() == pytest.approx(edge + 200.0 / np.tan(np.radians(30.0)), abs=15.0)
    assert light[(across > 80.0) & (across < 340.0)].max() < 0.05  # there is no air to light it
    np.testing.assert_allclose(light[across > 450.0], 1.0, atol=0.02)


def test_steep_slopes_see_less_of_the_sky(tmp_path) -> None:
    """Of ripples that the model does not know, in twilight: (1 + cos)/2 of the sky's light, some from each other."""
    x = pixels(6e3, 15.0)
    ripples = BASE_M + 95.0 * np.cos(2 * np.pi * x / 600.0)
    scene = scene_with(np.broadcast_to(ripples, (x.size, x.size)), tmp_path / "dem.tif", 6e3, air=True)
    frame = medium_of(scene, np.array([WAVELENGTH_NM]), 0.5).frame
    field = Solver(detail=False).solve(scene, toward(90.0, -3.0), [WAVELENGTH_NM])
    metre = np.degrees(1 / RADIUS) / np.cos(np.radians(LAT))
    crest, flank = (frame.position(LAT, LON + east * metre, 2000.0) for east in (0.0, 150.0))
    down = -(frame.enu(LAT, LON)[2])
    seen = [float(field.view(Rays(eye, down[None])).radiance[0, 0]) for eye in (crest, flank)]
    steep = 1 / np.sqrt(1 + (95.0 * 2 * np.pi / 600.0) ** 2)
    sky = (1 + steep) / 2
    assert seen[1] / seen[0] == pytest.approx(sky + 0.3 * (1 - sky), abs=0.02)


def test_rays_told_where_the_ground_is_see_what_those_see_that_find_it() -> None:
    """Air light and transmission up to a distance are those up to the ground at that distance."""
    scene = scene_with(None, "", air=True)
    pack = Solver("fast", tolerance=0.5).solve(scene, toward(200.0, 40.0), [WAVELENGTH_NM]).lit[0]
    eye = pack.frame.position(LAT, LON, BASE_M + 1500.0)
    volume = aimed_at(pack, eye).volume
    direction = fan(30.0, np.linspace(-1.2, 0.6, 60))
    own = march_rays(eye, direction, pack.sun, pack.table, pack.shells, volume, 0.5)
    ends = np.where(own.distance_m >= 0, own.distance_m, FAR_M)
    told = march_rays(eye, direction, pack.sun, pack.table, pack.shells, volume, 0.5, ends=ends)
    np.testing.assert_allclose(told.distance_m, own.distance_m, rtol=1e-9)
    np.testing.assert_allclose(told.radiance[:, 0], own.radiance[:, 0], rtol=2e-3)
    np.testing.assert_allclose(told.full[:, 0], own.full[:, 0], rtol=2e-3)
    nearer = march_rays(eye, direction, pack.sun, pack.table, pack.shells, volume, 0.5, ends=0.5 * ends)
    met = own.distance_m >= 0
    assert (nearer.radiance[met, 0] < own.radiance[met, 0]).all()
    assert (nearer.full[met, 0] > own.full[met, 0]).all()


def test_under_the_terrain_of_the_grid_there_is_air(tmp_path) -> None:
    """Into a gorge 800 m deep, which the model fills: more air is looked through, and ever more light added."""
    scene = scene_with(None, "", air=True, terrain_m=1000.0)
    pack = Solver("fast", tolerance=0.5).solve(scene, toward(200.0, 40.0), [WAVELENGTH_NM]).lit[0]
    eye = pack.frame.position(LAT, LON, 1200.0)
    volume = aimed_at(pack, eye).volume
    down = np.array([[0.0, 0.0, -1.0]])
    through = [
        march_rays(eye, down, pack.sun, pack.table, pack.shells, volume, 0.5, ends=np.array([end]))
        for end in (200.0, 600.0, 1000.0)
    ]
    depth = -np.log([t.full[0, 0] for t in through])
    np.testing.assert_allclose(np.diff(depth, prepend=0.0) / [200.0, 400.0, 400.0], depth[0] / 200.0, rtol=0.05)
    light = np.diff([0.0] + [t.radiance[0, 0] for t in through]) / [200.0, 400.0, 400.0]
    np.testing.assert_allclose(light, light[0], rtol=0.25)


def test_an_elevation_model_of_which_little_is_needed(tmp_path) -> None:
    """1.6 GB of pixels, a view of a valley: memory for what is seen, at the resolution that is seen."""
    side, step = 20_000, 30.0
    half = 0.5 * side * step
    north, east = half * METRE, half * METRE / np.cos(np.radians(LAT))
    path = tmp_path / "big.tif"
    transform = rasterio.Affine(2 * east / side, 0.0, LON - east, 0.0, -2 * north / side, LAT + north)
    with rasterio.open(
        path, "w", driver="GTiff", count=1, height=side, width=side, dtype="float32", crs="EPSG:4326",
        transform=transform, tiled=True, sparse_ok=True,
    ) as file:  # fmt: skip
        window = rasterio.windows.Window(side // 2 - 256, side // 2 - 256, 512, 512)
        file.write(np.full((512, 512), 900.0, np.float32), 1, window=window)
        file.build_overviews([4, 16, 64], rasterio.enums.Resampling.average)
    scene = replace(scene_with(None, ""), ground=openswim.Ground(height=path))
    land = landscape(scene)
    eye = eye_at(land, 2.0)
    direction = fan(0.0, np.linspace(-0.3, 0.3, 50))
    if earth.has_relief():
        earth.relief_m([0.0], [0.0])  # read once a process
    tracemalloc.start()
    try:
        seen = land.seen_from(Rays(eye, direction, 2e-3))
        _, peak = tracemalloc.get_traced_memory()
    finally:
        tracemalloc.stop()
    assert peak < 150e6
    assert sum(f.height_m.size for f in seen.fields) < 3e6
    assert seen.height(eye[None])[0] == pytest.approx(900.0)


def test_edges_of_an_elevation_model_are_no_walls(tmp_path) -> None:
    """900 m above the model around it, it comes down over some kilometres, not within a pixel."""
    land = landscape(scene_with(np.full((400, 400), BASE_M + 900.0), tmp_path / "dem.tif", 8e3))
    eye = eye_at(land, 2.0)
    seen = land.seen_from(Rays(eye, fan(90.0, np.linspace(-0.3, 0.3, 50)), 1e-3))
    x = np.arange(0.0, 20e3, 20.0)
    height = seen.height(np.stack([x, 0 * x, 0 * x], axis=-1))
    assert height[0] == pytest.approx(BASE_M + 900.0, abs=1.0)
    assert height[-1] == pytest.approx(BASE_M, abs=20.0)
    assert np.abs(np.diff(height)).max() < 25.0


def test_a_mosaic_has_no_seams(tmp_path) -> None:
    """Two tiles side by side: no dip where they meet."""
    north, east = 8e3 * METRE, 8e3 * METRE / np.cos(np.radians(LAT))
    high = np.full((1, 400, 200), BASE_M + 900.0, np.float32)
    paths = [
        write(tmp_path / "west.tif", high, bounds=(LON - east, LAT - north, LON, LAT + north)),
        write(tmp_path / "east.tif", high, bounds=(LON, LAT - north, LON + east, LAT + north)),
    ]
    land = landscape(replace(scene_with(None, ""), ground=openswim.Ground(height=paths)))
    seen = land.seen_from(Rays(eye_at(land, 2.0), fan(90.0, np.linspace(-0.3, 0.3, 50)), 1e-3))
    x = np.arange(-3e3, 3e3, 7.0)
    np.testing.assert_allclose(seen.height(np.stack([x, 0 * x, 0 * x], axis=-1)), BASE_M + 900.0, atol=0.5)


def test_no_landscape_where_the_grid_says_it_all(monkeypatch) -> None:
    """Flat scenes, scenes that know no terrain, and all without elevation models where pvlib is missing."""
    flat = grid_scene({}, (5, 5, 5))
    assert landscape_of(surface_of(flat, WAVELENGTH_NM), medium_of(flat, np.array([WAVELENGTH_NM]), 0.5)) is None
    scene = scene_with(None, "")
    medium = medium_of(scene, np.array([WAVELENGTH_NM]), 0.5)
    without = replace(scene, data=scene.data.drop_vars("surface_altitude"))
    assert landscape_of(surface_of(without, WAVELENGTH_NM), medium) is None
    monkeypatch.setattr(earth, "_relief_path", lambda: None)
    assert landscape_of(surface_of(scene, WAVELENGTH_NM), medium) is None


def test_an_uneven_domain_ends_without_a_wall(monkeypatch) -> None:
    """Hills, and no mountains beyond: heights go on over the edge, and come to the median of its rim 20 km out."""
    monkeypatch.setattr(earth, "sea_at_nearest", lambda lat, lon: np.zeros(np.shape(lat), bool))
    x = 3000.0 * (np.arange(31) - 15)
    hills = (400.0 + 200.0 * np.sin(x[:, None] / 9e3) * np.cos(x / 7e3)).astype(np.float32)
    land = landscape(replace(scene_with(None, ""), data=scene_with(None, "").data.assign(
        surface_altitude=(("y", "x"), hills)), ground=Ground(mountains=False)))  # fmt: skip
    frame = land.medium.frame
    rim = np.concatenate([hills[0], hills[-1], hills[:, 0], hills[:, -1]])
    for toward_x, toward_y in ((1, 0.2), (-1, 0.5), (0.3, 1), (-0.4, -1)):
        edge = 45e3 * np.array([toward_x, toward_y])
        heights = []
        for away in (-200.0, 200.0, 25e3):
            place = edge * (1 + away / 45e3)
            lat, lon, _ = frame.latlon(np.array([[*place, 0.0]]))
            heights.append(land.ground_m(float(lat[0]), float(lon[0])))
        assert heights[1] == pytest.approx(heights[0], abs=15.0)
        assert heights[2] == pytest.approx(np.median(rim), abs=1.0)


@pytest.mark.skipif(not earth.has_relief(), reason="needs pvlib's height map: pip install 'openswim[relief]'")
def test_mountains_of_the_default_earth() -> None:
    """Known heights, which 9-km means blunt: Tibet, the Alps, Denver, the Netherlands; the sea."""
    lat = [31.0, 46.0, 39.74, 52.3, 10.0, 0.0]
    lon = [88.0, 7.7, -104.99, 5.0, -40.0, 170.0]
    low, high = [4500, 2200, 1500, 0, 0, 0], [5500, 4000, 1800, 60, 0, 0]
    found = earth.relief_m(lat, lon)
    assert (found >= low).all()
    assert (found <= high).all()


@pytest.mark.skipif(not earth.has_relief(), reason="needs pvlib's height map: pip install 'openswim[relief]'")
def test_far_mountains_stand_beyond_the_domain() -> None:
    """The Alps from a domain in the Po valley 120 km south: up to the angle that their height has there."""
    crs = CRS.from_proj4("+proj=lcc +lat_1=40 +lat_2=50 +lat_0=45.1 +lon_0=8.5 +R=6371000")
    x = 2000.0 * (np.arange(21) - 10)
    scene = Scene.from_arrays({}, x, x, np.linspace(0.0, 10e3, 11), crs=crs, terrain_m=np.full((21, 21), 120.0),
                              atmosphere=None, surface_albedo=0.0)  # fmt: skip
    land = landscape(scene)
    assert landscape_of(surface_of(replace(scene, ground=Ground(mountains=False)), WAVELENGTH_NM), land.medium) is None
    frame = land.medium.frame
    eye = frame.position(45.1, 8.5, 122.0)
    altitude = np.radians(np.arange(-0.5, 4.0, 0.01))
    direction = fan(-20.0, altitude)  # Monte Rosa
    seen = land.seen_from(Rays(eye, direction, 1e-3))
    distance = seen.meet(eye[None], direction)
    top = altitude[distance < FAR_M].max()
    away = np.arange(20e3, 200e3, 1e3) / RADIUS
    azimuth = np.radians(-20.0)
    up = np.stack([np.sin(away) * np.sin(azimuth), np.sin(away) * np.cos(azimuth), np.cos(away)], axis=-1)
    lat, lon, _ = frame.latlon(up * RADIUS - np.array([0.0, 0.0, RADIUS]))
    sight = up * (RADIUS + earth.relief_m(lat, lon))[:, None] - np.array([0.0, 0.0, RADIUS]) - eye
    expected = np.arcsin(sight[:, 2] / np.linalg.norm(sight, axis=-1)).max()
    assert np.degrees(expected) > 0.6
    assert top == pytest.approx(expected, abs=3e-4)
    # the rim of the domain is no wall
    rim = np.stack([0 * x, np.linspace(15e3, 25e3, x.size), 0 * x], axis=-1)
    assert np.abs(np.diff(seen.height(rim))).max() < 60.0


@pytest.mark.parametrize(("lat", "expected"), [(67.0, 550.0), (-30.0, 0.0)])
def test_a_global_elevation_model_is_the_far_field_too(tmp_path, monkeypatch, lat: float, expected: float) -> None:
    """Without the default Earth's: Chukotka, over the seam of the file at 180 degrees; at sea no sea bed."""
    monkeypatch.setattr(earth, "_relief_path", lambda: None)
    crs = CRS.from_proj4(f"+proj=lcc +lat_1={lat - 5} +lat_2={lat + 5} +lat_0={lat} +lon_0=179.9 +R=6371000")
    x = 1000.0 * (np.arange(11) - 5)
    scene = Scene.from_arrays({}, x, x, np.linspace(0.0, 10e3, 11), crs=crs, terrain_m=np.zeros((11, 11)),
                              atmosphere=None, surface_albedo=0.0)  # fmt: skip
    rows = 90.0 - (np.arange(1800) + 0.5) / 10
    height = np.where(rows > 0, 500.0 + 100.0 * (rows - 67.0), -200.0)
    image = np.broadcast_to(height[:, None], (1800, 3600)).astype(np.float32)
    path = write(tmp_path / "earth.tif", image[None], bounds=(-180.0, -90.0, 180.0, 90.0))
    land = landscape(replace(scene, ground=openswim.Ground(height=path)))
    frame = land.medium.frame
    seen = land.seen_from(Rays(frame.position(lat, 179.9, 50.0), fan(90.0, np.linspace(-0.3, 0.3, 50)), 1e-2))
    place = frame.position(np.full(50, lat + 0.5), np.linspace(178.5, 181.5, 50), 0.0)
    np.testing.assert_allclose(seen.height(place), expected, atol=1.0)


def test_a_high_eye_sees_the_terrain_to_its_horizon() -> None:
    """From 60 km up, 870 km away: a wide model's terrain is there too, and ends in no wall."""
    x = 40e3 * (np.arange(61) - 30)
    crs = CRS.from_proj4(f"+proj=laea +lat_0={LAT} +lon_0={LON} +R=6371000")
    terrain = np.broadcast_to(2000.0 + 1500.0 * np.sin(x / 300e3), (61, 61))
    scene = Scene.from_arrays({}, x, x, np.linspace(0.0, 10e3, 11), crs=crs, terrain_m=terrain,
                              atmosphere=None, surface_albedo=0.0)  # fmt: skip
    land = Landscape(surface_of(scene, WAVELENGTH_NM), medium_of(scene, np.array([WAVELENGTH_NM]), 0.5))
    seen = land.seen_from(Rays(eye_at(land, 60e3), fan(90.0, np.linspace(-0.5, 0.1, 50)), 2e-3))
    lon = LON + np.array([-8.0, -4.0, 3.0, 7.5])
    place = land.medium.frame.position(np.full(4, LAT), lon, 0.0)
    ix, _ = scene.grid.index(lon, np.full(4, LAT))
    np.testing.assert_allclose(seen.height(place), np.interp(ix, np.arange(61), terrain[0]), atol=30.0)
    along = land.medium.frame.position(np.full(4000, LAT), LON + np.linspace(0.0, 14.0, 4000), 0.0)
    assert np.abs(np.diff(seen.height(along))).max() < 30.0


def test_between_knots() -> None:
    """What is linear stays so, at any number of nodes."""
    for ny, nx in ((1, 1), (2, 9), (57, 24), (17, 33)):
        lattice = Lattice(ny, nx, 8)
        x, y = np.meshgrid(*lattice.knots)
        j, i = np.mgrid[0:ny, 0:nx]
        np.testing.assert_allclose(lattice.between((3.0 * x - 2.0 * y).ravel())[: ny * nx],
                                   (3.0 * i - 2.0 * j).ravel(), atol=1e-9)  # fmt: skip


def test_terrain_of_nested_grids() -> None:
    """The inner grid's hill within it, the wider's plateau round it, and between them no wall."""
    def of(cell_m, count, height_m):
        return grid_scene({}, (4, count, count), (cell_m, cell_m, 2000.0), True, terrain_m=height_m)

    wider = of(3000.0, 41, np.full((41, 41), 200.0))
    scene = of(500.0, 61, np.full((61, 61), 800.0))
    inner, outer = (
        Landscape(surface_of(one, WAVELENGTH_NM), medium_of(one, WAVELENGTH_NM, 0.5)) for one in (scene, wider)
    )
    inner = replace(inner, wider=outer)
    lon, lat = scene.grid.lonlat(np.linspace(30, 90, 200), 30.0)  # type: ignore[union-attr]
    height = np.array([inner.ground_m(float(b), float(a)) for a, b in zip(lon, lat, strict=True)])
    np.testing.assert_allclose(height[:50], 800.0, atol=0.5)
    np.testing.assert_allclose(height[101:], 200.0, atol=0.5)
    assert np.abs(np.diff(height)).max() < 600 * 0.12
    relief = inner.seen_from(Rays(eye_at(inner, 100.0), fan(90.0, np.radians(np.linspace(-20, 5, 30)))))
    assert relief is not None
    assert relief.ground_m == 200.0
    assert inner.widest is outer


@pytest.mark.parametrize("azimuth_deg", [180.0, 100.0])
def test_terrain_that_ends_at_the_domains_side_is_no_wall(azimuth_deg: float) -> None:
    """A plateau in the west ends over lower ground; the sun stands along the side, or low behind it."""
    terrain = np.zeros((24, 24), np.float32)
    terrain[:, :4] = 900.0
    field = np.zeros((12, 24, 24), np.float32)
    field[10] = 1e-9
    scene = grid_scene(field, field.shape, (500.0, 500.0, 300.0), curved=True, air=True, terrain_m=terrain)
    pack = Solver("swim").solve(scene, toward(azimuth_deg, 12.0), [WAVELENGTH_NM]).lit[0]
    assert pack.lighting.ground_m == 0
    rim = pack.medium.place[8:16, 0].astype(float)
    near, far = rim - np.array([300.0, 0.0, 0.0]), rim - np.array([20e3, 0.0, 0.0])
    for place in (near, far):
        place[:, 2] = np.sqrt(pack.frame.radius_m**2 - (place[:, :2] ** 2).sum(1)) - pack.frame.radius_m
    for place in (near, rim, far):
        np.testing.assert_allclose(aimed_at(pack).through_clouds(place), 1.0, rtol=1e-4)
