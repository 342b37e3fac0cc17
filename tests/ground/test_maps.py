"""The user's own maps: any projection, any resolution, streamed."""

import sys
import warnings
from types import SimpleNamespace

import numpy as np
import pytest
import xarray as xr

import openswim
from openswim.errors import UserError
from openswim.ground.albedo import surface_properties
from openswim.ground.maps import AlbedoMap, HeightMap, maps_of
from openswim.ground.raster import Raster
from openswim.scene.grid import Grid

rasterio = pytest.importorskip("rasterio")

WAVELENGTHS = (645.0, 555.0, 469.0)
LAT, LON = 46.0, 8.0


def write(path, data, crs="EPSG:4326", bounds=(7.0, 45.0, 9.0, 47.0), **options):
    """A GeoTIFF of data (bands, rows, columns), north up."""
    bands, rows, columns = data.shape
    west, south, east, north = bounds
    transform = rasterio.Affine((east - west) / columns, 0.0, west, 0.0, (south - north) / rows, north)
    if crs is None:
        transform = rasterio.Affine.identity()
    scale = options.pop("scale", None)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", rasterio.errors.NotGeoreferencedWarning)
        with rasterio.open(
            path, "w", driver=options.pop("driver", "GTiff"), count=bands, height=rows, width=columns,
            dtype=data.dtype, crs=crs, transform=transform, **options,
        ) as file:  # fmt: skip
            file.write(data)
            if scale:
                file.scales = (scale,) * bands
    return path


def lonlat_scene(ground, time=None, **fields):
    from pyproj import CRS

    y, x = np.arange(45.5, 46.51, 0.1), np.arange(7.5, 8.51, 0.1)
    grid = Grid(x, y, np.array([0.0, 1e4]), CRS.from_proj4("+proj=longlat +R=6371000"))
    data = xr.Dataset({k: (("y", "x"), np.broadcast_to(v, (y.size, x.size))) for k, v in fields.items()})
    return SimpleNamespace(grid=grid, data=data, ground=ground, time=time)


def ramp(rows, columns):
    """Values that tell row and column: 0 to .5, linear in both."""
    y, x = np.mgrid[0:rows, 0:columns]
    return (0.25 * (x + 0.5) / columns + 0.25 * (y + 0.5) / rows).astype(np.float32)[None]


@pytest.mark.parametrize("level", [0, 3])
@pytest.mark.parametrize("crs", ["EPSG:4326", "EPSG:32632", "EPSG:3035", "EPSG:3857"])
def test_places_are_found_in_any_projection(tmp_path, crs, level):
    from pyproj import Transformer

    to_map = Transformer.from_crs("EPSG:4326", crs, always_xy=True)
    x, y = to_map.transform([7.0, 9.0], [45.0, 47.0])
    bounds = (min(x), min(y), max(x), max(y))
    raster = Raster(write(tmp_path / "a.tif", ramp(700, 900), crs, bounds))
    lat, lon = np.random.default_rng(0).uniform([[45.6], [7.6]], [[46.4], [8.4]], (2, 300))
    px, py = to_map.transform(lon, lat)
    expected = 0.25 * (px - bounds[0]) / (bounds[2] - bounds[0]) + 0.25 * (bounds[3] - py) / (bounds[3] - bounds[1])
    values, known = raster.sample(lat, lon, raster.pixel_m * 2**level)
    np.testing.assert_allclose(known, 1)
    np.testing.assert_allclose(values[:, 0], expected, atol=1e-4)  # a linear image, however decimated


def test_pixel_size_on_the_ground(tmp_path):
    assert Raster(write(tmp_path / "a.tif", ramp(100, 100))).pixel_m == pytest.approx(
        np.sqrt(0.02 * 111_195 * 0.02 * 111_195 * np.cos(np.radians(46))), rel=2e-3
    )
    utm = write(tmp_path / "b.tif", ramp(10, 10), "EPSG:32632", (4e5, 5.1e6, 4e5 + 7, 5.1e6 + 7))
    assert Raster(utm).pixel_m == pytest.approx(0.7, rel=2e-3)


def test_a_pixel_of_the_picture_sees_the_mean_of_what_it_covers(tmp_path):
    rng = np.random.default_rng(3)
    noise = rng.uniform(0, 0.4, (1, 1024, 1024)).astype(np.float32)
    raster = Raster(write(tmp_path / "a.tif", noise))
    lat, lon = rng.uniform(45.7, 46.3, 500), rng.uniform(7.7, 8.3, 500)
    spread = [raster.sample(lat, lon, raster.pixel_m * f)[0].std() for f in (1, 4, 16, 64)]
    assert (np.diff(np.log(spread)) < -0.9).all()  # white noise: by 4 for each factor of 4, at least 2.5
    assert raster.sample(lat, lon, 1e5)[0].mean() == pytest.approx(0.2, abs=0.002)


def test_overviews_are_read_instead_of_the_whole(tmp_path):
    path = write(tmp_path / "a.tif", ramp(4096, 4096), tiled=True)
    with rasterio.open(path, "r+") as file:
        file.build_overviews([2, 4, 8, 16, 32], rasterio.enums.Resampling.average)
    raster = Raster(path)
    raster.sample([46.0], [8.0], raster.pixel_m * 16)
    assert sum(v.size for v, _ in raster._tiles.values()) <= 4 * 256**2
    raster.sample([46.0], [8.0], 0.0)
    assert sum(v.size for v, _ in raster._tiles.values()) <= 8 * 256**2


def test_memory_stays_bounded(tmp_path, monkeypatch):
    monkeypatch.setattr("openswim.ground.raster._CACHE_BYTES", 1_000_000)
    raster = Raster(write(tmp_path / "a.tif", ramp(2048, 2048), tiled=True))
    lat, lon = np.random.default_rng(0).uniform([[45.0], [7.0]], [[47.0], [9.0]], (2, 3000))
    values, _ = raster.sample(lat, lon)
    assert raster._bytes <= 1_000_000
    np.testing.assert_allclose(values[:, 0], 0.125 * (lon - 7) + 0.125 * (47 - lat), atol=2e-4)


def test_no_data_is_not_ground(tmp_path):
    data = np.full((1, 64, 64), 0.3, np.float32)
    data[:, :, 32:] = -9999
    raster = Raster(write(tmp_path / "a.tif", data, nodata=-9999))
    values, known = raster.sample([46.0, 46.0, 46.0, 50.0], [7.5, 8.5, 7.96, 8.0], [0, 0, 3e4, 0])
    np.testing.assert_array_equal(known[[0, 1, 3]], [1, 0, 0])
    assert values[0] == pytest.approx(0.3)
    assert values[2] == pytest.approx(0.3)


def test_a_world_image_has_no_seam(tmp_path):
    path = write(tmp_path / "world.tif", np.full((3, 180, 360), 128, np.uint8), bounds=(-180, -90, 180, 90))
    values, known = Raster(path).sample(np.zeros(101), np.linspace(179, 181, 101))
    np.testing.assert_allclose(values, 128)
    np.testing.assert_allclose(known, 1)


def test_blue_marble_tiles_know_their_place(tmp_path):
    """Tile C1 is 0 to 90 E, 0 to 90 N (NASA's naming); the same month's tiles come together."""
    data = np.zeros((3, 90, 90), np.uint8)
    data[:, 40:50, 5:12] = 200  # 40 to 50 N, 5 to 12 E
    path = write(tmp_path / "world.200407.3x21600x21600.C1.png", data, None, driver="PNG")
    raster = Raster(path)
    values, known = raster.sample([46.0, 46.0, 46.0], [8.0, 20.0, -8.0])
    np.testing.assert_array_equal(known, [1, 1, 0])
    assert values[0, 0] == pytest.approx(200)
    assert values[1, 0] == pytest.approx(0)


def test_reflectance_is_used_as_it_is(tmp_path):
    data = np.stack([np.full((64, 64), v) for v in (0.3, 0.2, 0.1)])
    for name, stored, options in (
        ("float.tif", data.astype(np.float32), {}),
        ("sentinel.tif", (data * 1e4).astype(np.uint16), {}),
        ("scaled.tif", (data * 1e3).astype(np.int16), {"scale": 1e-3}),
    ):
        ground = openswim.Ground(albedo=write(tmp_path / name, stored, **options))
        scene = lonlat_scene(ground, land_area_fraction=1.0, surface_albedo=0.2)
        sample = surface_properties(scene, [LAT], [LON], WAVELENGTHS)
        np.testing.assert_allclose(sample.albedo[0], [0.3, 0.2, 0.1], atol=2e-3)


def test_the_finest_map_wins_and_the_default_fills_the_rest(tmp_path):
    coarse = write(tmp_path / "a.tif", np.full((1, 50, 50), 0.2, np.float32), bounds=(7.5, 45.5, 8.5, 46.5))
    fine = write(tmp_path / "b.tif", np.full((1, 50, 50), 0.4, np.float32), bounds=(7.9, 45.9, 8.1, 46.1))
    scene = lonlat_scene(openswim.Ground(albedo=[fine, coarse]))
    albedo = surface_properties(scene, [46.0, 46.3, 47.5], [8.0, 8.3, 9.5], WAVELENGTHS).albedo
    np.testing.assert_allclose(albedo[:2, 1], [0.4, 0.2], atol=1e-6)
    default = surface_properties(lonlat_scene(None), [47.5], [9.5], WAVELENGTHS).albedo
    np.testing.assert_allclose(albedo[2], default[0])


def test_an_aerial_picture_lends_contrast_not_brightness(tmp_path):
    """A chequerboard photograph of 20 m over a model's albedo: the mean stays the model's, the pattern is seen."""
    n = 400
    y, x = np.mgrid[0:n, 0:n]
    board = np.where((y // 20 + x // 20) % 2, 150, 110).astype(np.uint8)
    path = write(tmp_path / "naip.tif", np.stack([board] * 3), "EPSG:32632", (4e5, 5.09e6, 4e5 + 8e3, 5.09e6 + 8e3))
    assert AlbedoMap(path).texture
    from pyproj import Transformer

    to_lonlat = Transformer.from_crs("EPSG:32632", "EPSG:4326", always_xy=True)
    east, north = np.random.default_rng(0).uniform([[4.005e5], [5.0905e6]], [[4.075e5], [5.0975e6]], (2, 20_000))
    lon, lat = to_lonlat.transform(east, north)
    fields = {"land_area_fraction": 1.0, "surface_albedo": 0.25}
    bare = surface_properties(lonlat_scene(None, **fields), lat, lon, WAVELENGTHS).albedo
    near = surface_properties(lonlat_scene(openswim.Ground(albedo=path), **fields), lat, lon, WAVELENGTHS).albedo
    far = surface_properties(lonlat_scene(openswim.Ground(albedo=path), **fields), lat, lon, WAVELENGTHS, 5e3).albedo
    assert near.mean() == pytest.approx(bare.mean(), rel=0.03)  # means are of code values
    light, dark = near[near[:, 1] > bare[:, 1]], near[near[:, 1] < bare[:, 1]]
    assert light.mean() / dark.mean() == pytest.approx((150 / 110) ** 2.2, rel=0.1)  # linear light
    np.testing.assert_allclose(far, bare, rtol=0.1)


def test_the_month_nearest_to_the_scenes_is_taken(tmp_path):
    paths = [
        write(tmp_path / f"world.2004{m:02d}.3x1x1.tif", np.full((3, 9, 9), v, np.uint8))
        for m, v in ((1, 240), (7, 40))
    ]
    ground = openswim.Ground(albedo=paths)
    bright, dark = (
        surface_properties(lonlat_scene(ground, np.datetime64(t)), [LAT], [LON], WAVELENGTHS).albedo.mean()
        for t in ("2023-12-20T12:00", "2023-08-01T12:00")
    )
    assert bright > 3 * dark


def test_height_in_metres(tmp_path):
    dem = HeightMap(write(tmp_path / "dem.tif", 4000 * ramp(200, 200)))
    height, known = dem.height([46.0, 50.0], [8.0, 8.0])
    assert height[0] == pytest.approx(1000.0, abs=1.0)
    np.testing.assert_array_equal(known, [1, 0])


@pytest.mark.parametrize(("west", "lon"), [(239.0, -120.0), (179.0, -179.5), (-181.0, 179.5), (7.0, 8.0)])
def test_longitudes_are_the_same_a_turn_on(tmp_path, west, lon):
    """Of the file (0 to 360 degrees, or beyond the date line) and of the places."""
    path = write(tmp_path / "dem.tif", 4000 * ramp(200, 200), bounds=(west, 45.0, west + 2.0, 47.0))
    dem = HeightMap(path)
    height, known = dem.height([46.0, 46.0, 46.0], [lon, lon + 360.0, lon + 180.0])
    east = (lon - west) % 360.0
    assert height[:2] == pytest.approx(4000 * (0.25 * east / 2 + 0.125), abs=2.0)
    np.testing.assert_array_equal(known, [1, 1, 0])
    assert dem.pixel_m == pytest.approx(0.01 * 111e3 * np.sqrt(np.cos(np.radians(46.0))), rel=0.01)


def test_opposite_the_map_its_columns_have_no_way_through_it(tmp_path):
    """Columns between places may be interpolated."""
    raster = Raster(write(tmp_path / "dem.tif", ramp(20, 20)))
    _, column = raster.pixel(np.full(2, 46.0), [-172.1, -171.9])
    assert not np.isfinite(column.mean())


@pytest.mark.parametrize(
    ("make", "says"),
    [
        (lambda p: p / "none.tif", "no such file"),
        (lambda p: (p / "text.tif").write_text("hello") and p / "text.tif", "not an image"),
        (lambda p: write(p / "a.tif", ramp(30, 50), None), "no georeference"),
        (lambda p: write(p / "b.tif", 100 * ramp(50, 50)), "give 0 to 1"),
    ],
)
def test_what_is_wrong_with_a_map_is_said_in_a_line(tmp_path, make, says):
    path = make(tmp_path)
    with pytest.raises(UserError, match=says) as error:
        surface_properties(lonlat_scene(openswim.Ground(albedo=path)), [LAT], [LON], WAVELENGTHS)
    assert str(path) in str(error.value)
    assert "\n" not in str(error.value)


def test_a_picture_is_no_elevation_model(tmp_path):
    with pytest.raises(UserError, match="8-bit"):
        maps_of(openswim.Ground(height=write(tmp_path / "a.tif", np.zeros((1, 9, 9), np.uint8))))


def test_missing_rasterio_says_what_to_install(tmp_path, monkeypatch):
    path = write(tmp_path / "a.tif", ramp(9, 9))
    monkeypatch.setitem(sys.modules, "rasterio", None)
    with pytest.raises(UserError, match=r"pip install 'openswim\[geotiff\]'"):
        maps_of(openswim.Ground(albedo=path))


def test_data_without_an_image_are_no_map(tmp_path):
    """Such as a model's own netCDF file, which GDAL sees several sets of data in."""
    import netCDF4

    with netCDF4.Dataset(tmp_path / "weather.nc", "w") as file:
        for name in "yx":
            file.createDimension(name, 4)
        for name in "ab":
            file.createVariable(name, "f4", ("y", "x"))[:] = 1.0
    with pytest.raises(UserError, match=r"weather.nc: no image, but several or none within"):
        openswim.open_scene("anything.nc", ground=openswim.Ground(albedo=tmp_path / "weather.nc"))
