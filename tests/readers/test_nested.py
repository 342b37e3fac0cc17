"""Nested domains: the finest grid at each place, nothing lost and no seam at its rim."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from pyproj import CRS
from tests.readers import grib_files as gf

from openswim import Scene
from openswim.errors import UserError
from openswim.readers import Neighbourhood, open_scene
from openswim.readers.domain.nested import merged
from openswim.scene import Grid
from openswim.scene.variables import SURFACE_DIMS

LAT, LON = 47.0, 8.0
CRS_ = CRS.from_proj4(f"+proj=lcc +lat_1=40 +lat_2=55 +lat_0={LAT} +lon_0={LON} +R=6371000")
LEVELS = np.linspace(0.0, 6000.0, 25)


def domain(step_m, nodes, content, levels=LEVELS, fields=None, **more):
    """A square domain around the place; `content(x, y, z)` in kg m-3."""
    axis = (np.arange(nodes) - (nodes - 1) / 2) * step_m
    z, y, x = np.meshgrid(levels, axis, axis, indexing="ij")
    given = {"liquid_content": np.float32(content(x, y, z) + 0 * x)} | (fields or {})
    return Scene.from_arrays({}, axis, axis, levels, crs=CRS_, fields=given, source=f"{step_m:.0f} m", **more)


def smooth(x, y, z):
    return 3e-4 * (1 + 0.5 * np.sin(x / 9e3) * np.cos(y / 12e3)) * np.exp(-(((z - 2500) / 900) ** 2))


def at(scene, lat, lon):
    ix, iy = scene.grid.index(lon, lat)
    return round(float(ix)), round(float(iy))


def shown(scene, lat, lon):
    """The level that rays see at a place, and the place's nodes in it."""
    for level in scene.levels:
        i, j = (float(v) for v in level.grid.index(lon, lat))
        _, ny, nx = level.grid.shape
        if min(i, nx - 1 - i) >= 0.08 * nx and min(j, ny - 1 - j) >= 0.08 * ny:
            break
    return level, round(i), round(j)


def values_at(scene, name, lat, lon):
    level, i, j = shown(scene, lat, lon)
    return level.data[name].values[..., j, i]


def column_mass(scene, name="liquid_content"):
    return np.trapezoid(scene.data[name].values, scene.grid.height_m, axis=0)


NEAR = Neighbourhood(LAT, LON, radius_m=6e4)


def test_each_place_is_from_the_finest_grid():
    outer = domain(3000.0, 81, lambda x, y, z: 1e-4)
    inner = domain(600.0, 61, lambda x, y, z: 3e-4)  # 36 km wide
    scene = merged([outer, inner], NEAR)
    assert scene.grid.spacing_m() == pytest.approx((600.0, 600.0), rel=0.01)
    assert values_at(scene, "liquid_content", LAT, LON)[8] == pytest.approx(3e-4, rel=1e-4)
    lon, lat = outer.grid.lonlat([28, 52, 40, 40], [40, 40, 28, 52])  # 36 km off
    for place in zip(lat, lon, strict=True):
        assert values_at(scene, "liquid_content", *map(float, place))[8] == pytest.approx(1e-4, rel=1e-4)
    assert "finest at each place" in " ".join(scene.notes)
    wider = scene.wider
    assert wider.wider is None
    assert wider.grid.spacing_m() == pytest.approx((3000.0, 3000.0), rel=0.01)


def test_the_rim_is_no_step():
    """Neither within a grid nor from one to the next."""
    outer, inner = domain(3000.0, 81, lambda x, y, z: 1e-4), domain(600.0, 201, lambda x, y, z: 3e-4)
    scene = merged([inner, outer], Neighbourhood(LAT, LON, radius_m=1.1e5))
    for level in scene.levels:
        content = level.data.liquid_content.values[8]
        jump = max(np.abs(np.diff(content, axis=axis)).max() for axis in (0, 1))
        assert jump < 0.51 * 2e-4  # fades over some three cells of the coarser
    lon, lat = scene.grid.lonlat(np.linspace(0, scene.grid.shape[2] - 1, 200), scene.grid.shape[1] // 2)
    seen = np.array([values_at(scene, "liquid_content", float(a), float(o))[8] for a, o in zip(lat, lon, strict=True)])
    assert shown(scene, float(lat[0]), float(lon[0]))[0] is scene.wider
    assert np.abs(np.diff(seen)).max() < 0.51 * 2e-4


def test_where_domains_agree_their_join_cannot_be_seen():
    outer, inner = domain(1500.0, 101, smooth), domain(500.0, 81, smooth)
    scene = merged([outer, inner], NEAR)
    ny, nx = scene.grid.shape[1:]
    lon, lat = scene.grid.lonlat(np.arange(nx), np.arange(ny)[:, None])
    ix, iy = inner.grid.index(lon, lat)
    x, y = (ix - 40) * 500.0, (iy - 40) * 500.0
    truth = smooth(x, y, scene.grid.height_m[:, None, None])
    # linear interpolation over 1.5 km and 250 m of waves of 9 km and a layer of 900 m
    np.testing.assert_allclose(scene.data.liquid_content, truth, atol=0.05 * truth.max())


def test_water_is_that_of_the_domains():
    outer, inner = domain(1500.0, 101, smooth), domain(500.0, 81, smooth)
    scene = merged([outer, inner], NEAR)
    half = 0.5 * (scene.grid.x[-1] - scene.grid.x[0])
    keep = np.abs((np.arange(101) - 50) * 1500.0) <= half
    expected = column_mass(outer)[np.ix_(keep, keep)].mean()
    assert column_mass(scene).mean() == pytest.approx(expected, rel=0.02)


def test_above_a_low_top_is_the_coarser_domains_cloud():
    high = np.linspace(0.0, 12_000.0, 25)
    outer = domain(3000.0, 61, lambda x, y, z: np.where(z > 8000, 2e-4, 0.0), high)
    inner = domain(500.0, 61, lambda x, y, z: np.where(z < 1500, 3e-4, 0.0), np.linspace(0.0, 3000.0, 31))
    scene = merged([outer, inner], NEAR)
    i, j = at(scene, LAT, LON)
    column, z = scene.data.liquid_content.values[:, j, i], scene.grid.height_m
    np.testing.assert_allclose(column[z < 1300], 3e-4, rtol=1e-3)
    assert not column[(z > 1700) & (z < 7400)].any()
    np.testing.assert_allclose(column[z > 8600], 2e-4, rtol=1e-3)


def test_what_the_finer_lacks_comes_from_the_coarser():
    shape = (25, 61, 61)
    outer = domain(3000.0, 61, smooth, fields={"ice_content": np.full(shape, 5e-5, np.float32)})
    inner = domain(500.0, 61, smooth)
    np.testing.assert_allclose(merged([outer, inner], NEAR).data.ice_content, 5e-5, rtol=1e-4)


def test_ground_that_only_the_finer_tells_of_is_its_own():
    outer, inner = domain(3000.0, 61, smooth), domain(500.0, 61, smooth)
    snow = np.zeros((61, 61), np.float32)
    snow[:, 30:] = 1.0
    inner.data["snow_area_fraction"] = (SURFACE_DIMS, snow)
    scene = merged([outer, inner], NEAR)
    near = scene.data["snow_area_fraction"].values
    assert near[:, 0].max() == 0  # beyond its rim as at it
    assert near[:, -1].min() == pytest.approx(1)
    assert np.isfinite(near).all()


def test_snow_that_only_the_finer_knows_of_has_no_edge():
    """It goes on outside as far as that of a domain alone does (`ground.albedo`): 30 of its cells, 15 km."""
    outer, inner = domain(3000.0, 61, smooth), domain(500.0, 61, smooth)
    inner.data["snow_area_fraction"] = (SURFACE_DIMS, np.ones((61, 61), np.float32))
    scene = merged([outer, inner], NEAR)
    assert len(scene.levels) > 1

    def snow(east_m):
        lon, lat = outer.grid.lonlat(30 + east_m / 3000.0, 30)
        return values_at(scene, "snow_area_fraction", float(lat), float(lon))

    along = [snow(x) for x in np.arange(0.0, 60e3, 3e3)]
    assert along[0] == pytest.approx(1)
    assert max(abs(np.diff(along))) < 0.25
    assert along[-1] < 0.05


def test_light_taken_out_is_blended():
    """Radii of one file, numbers of none: c/r is the mean of both files' c/r."""
    shape = (25, 61, 61)
    outer = domain(3000.0, 61, lambda x, y, z: 2e-4, fields={"liquid_effective_radius": np.full(shape, 20e-6)})
    inner = domain(500.0, 61, lambda x, y, z: 2e-4, fields={"liquid_effective_radius": np.full(shape, 8e-6)})
    scene = merged([outer, inner], NEAR)
    radius = scene.data.liquid_effective_radius.values[5]
    i, j = at(scene, LAT, LON)
    assert radius[j, i] == pytest.approx(8e-6, rel=1e-3)
    assert scene.wider.data.liquid_effective_radius.values[5, 0, 0] == pytest.approx(20e-6, rel=1e-3)
    assert ((radius > 7.99e-6) & (radius < 20.01e-6)).all()


def test_cells_of_the_finer_are_full_where_only_the_coarser_knows_cover():
    outer = domain(20_000.0, 21, smooth, fields={"cloud_area_fraction": np.full((25, 21, 21), 0.3, np.float32)})
    inner = domain(1000.0, 61, smooth)
    scene = merged([outer, inner], NEAR)
    assert values_at(scene, "cloud_area_fraction", LAT, LON)[5] == pytest.approx(1.0, abs=1e-3)
    assert scene.levels[-1].data.cloud_area_fraction.values[5, 0, 0] == pytest.approx(0.3, abs=1e-3)


def test_three_domains_and_their_terrain():
    globe = domain(30_000.0, 41, lambda x, y, z: 0.0, terrain_m=np.full((41, 41), 200.0))
    outer = domain(3000.0, 61, smooth, terrain_m=np.full((61, 61), 400.0))
    inner = domain(500.0, 61, smooth, terrain_m=np.full((61, 61), 600.0))
    scene = merged([globe, inner, outer], Neighbourhood(LAT, LON, radius_m=1e5))
    for level, height in zip(scene.levels, (600.0, 400.0, 200.0), strict=True):
        terrain = level.data.surface_altitude.values
        assert terrain[0, 0] == pytest.approx(200.0 if height == 200.0 else terrain[0, -1], abs=1.0)
        i, j = at(level, LAT, LON)
        assert terrain[j, i] == pytest.approx(600.0, abs=0.1)
    lon, lat = outer.grid.lonlat([30, 45], [30, 30])
    assert values_at(scene, "surface_altitude", float(lat[1]), float(lon[1])) == pytest.approx(400.0, abs=0.1)


def test_only_one_domain_in_reach_stays_as_it_is():
    outer, inner = domain(3000.0, 81, smooth), domain(500.0, 61, smooth)
    near = merged([outer, inner], Neighbourhood(LAT, LON, radius_m=5e3))
    assert near.source == "500 m"
    lon, lat = outer.grid.lonlat(5, 5)
    far = merged([outer, inner], Neighbourhood(float(lat), float(lon), radius_m=1e4))
    assert far.source == "3000 m"
    with pytest.raises(UserError, match="outside all the domains"):
        merged([outer, inner], Neighbourhood(30.0, 60.0))


def test_seen_from_space_each_domain_has_its_cells():
    outer, inner = domain(9000.0, 201, smooth), domain(500.0, 61, smooth)
    lon, lat = outer.grid.lonlat(40, 60)  # the eye is elsewhere
    scene = merged([outer, inner], Neighbourhood(float(lat), float(lon), radius_m=8e6))
    assert scene.grid.spacing_m()[0] == pytest.approx(500.0, rel=0.02)
    i, j = scene.grid.index(LON, LAT)
    assert (2 * i + 1, 2 * j + 1) == pytest.approx(scene.grid.shape[:0:-1], abs=1.1)
    widest = scene.levels[-1]
    assert widest.grid.spacing_m()[0] == pytest.approx(9000.0, rel=0.02)
    assert all(max(level.grid.shape[1:]) <= 421 for level in scene.levels)
    i, j = widest.grid.index(*outer.grid.lonlat([5, 195], [5, 195]))
    assert (i > 0).all()
    assert (j < widest.grid.shape[1] - 1).all()


def test_an_eye_aside_of_all_domains_sees_them_from_space():
    outer, inner = domain(9000.0, 101, smooth), domain(500.0, 61, smooth)
    scene = merged([outer, inner], Neighbourhood(30.0, 20.0, radius_m=8e6))
    assert scene.grid.spacing_m()[0] == pytest.approx(500.0, rel=0.02)
    assert scene.wider is not None


def test_levels_reach_as_far_as_clouds_are_seen_and_no_farther_than_the_domains():
    globe, outer = domain(30_000.0, 81, lambda x, y, z: 1e-5), domain(3000.0, 61, smooth)
    inner = domain(100.0, 61, smooth)
    scene = merged([globe, outer, inner], Neighbourhood(LAT, LON, radius_m=2e5, far_m=4.5e5))
    halves = [0.5 * np.ptp(level.grid.x) for level in scene.levels]
    assert halves[-1] == pytest.approx(4.5e5, rel=0.1)
    assert len(halves) == 3
    assert all(1.25 < b / a < 30 for a, b in pairwise(halves))
    cells = [level.grid.spacing_m()[0] for level in scene.levels]
    assert cells[0] == pytest.approx(100.0, rel=0.01)
    assert cells[1] == pytest.approx(3000.0, rel=0.01)
    assert max(max(level.grid.shape[1:]) for level in scene.levels[1:]) <= 241
    only = merged([outer, inner], Neighbourhood(LAT, LON, radius_m=2e5, far_m=4.5e5))
    assert 0.5 * np.ptp(only.levels[-1].grid.x) <= 9.1e4


def test_an_eye_beside_the_finest_domain_is_in_the_next():
    """The nest lies 60 km to the east."""
    outer, inner = domain(3000.0, 101, smooth), domain(500.0, 61, smooth)
    lon, lat = outer.grid.lonlat(30, 50)
    scene = merged([outer, inner], Neighbourhood(float(lat), float(lon), radius_m=2e5))
    assert scene.grid.spacing_m()[0] == pytest.approx(500.0, rel=0.02)
    i, _ = scene.grid.index(float(lon), float(lat))
    assert i < 0
    i, _ = at(scene.wider, float(lat), float(lon))
    assert 0 < i < scene.wider.grid.shape[2]


def test_earths_of_two_sizes():
    """The scenes lie on the coarser one's, or they could not lie in each other."""
    axis = (np.arange(61) - 30) * 500.0
    crs = CRS.from_proj4(f"+proj=laea +lat_0={LAT} +lon_0={LON} +R=6370000")
    inner = Scene.from_arrays({}, axis, axis, LEVELS, crs=crs, earth_radius_m=6.37e6,
                              fields={"liquid_content": np.full((25, 61, 61), 1e-4, np.float32)})  # fmt: skip
    outer = domain(3000.0, 101, smooth)
    scene = merged([outer, inner], Neighbourhood(LAT, LON, radius_m=1e4, far_m=1e5))
    assert {level.grid.earth_radius_m for level in scene.levels} == {6371000.0}
    with pytest.raises(UserError, match="radius"):
        Scene(inner.grid, inner.data, wider=outer)


def test_a_flat_domain_needs_a_place():
    flat = Scene.from_arrays({}, np.arange(5) * 100.0, np.arange(5) * 100.0, np.arange(4) * 100.0)
    with pytest.raises(UserError, match="place on Earth"):
        merged([flat, domain(3000.0, 21, smooth)], NEAR)


def test_files_of_two_models(tmp_path):
    """A scene file of fine cells in an IFS domain from GRIB."""
    path = gf.write(tmp_path / "ifs", gf.ifs(gf.AROME))
    whole = open_scene(path)
    lat, lon = whole.place
    own = Grid(np.arange(-5000.0, 5001.0, 500.0), np.arange(-5000.0, 5001.0, 500.0), LEVELS,
               CRS.from_proj4(f"+proj=laea +lat_0={lat} +lon_0={lon} +R=6371000"))  # fmt: skip
    fine = Scene.from_arrays(
        {}, own.x, own.y, LEVELS, crs=own.crs, fields={"liquid_content": np.full(own.shape, 7e-4, np.float32)}
    )
    fine.to_netcdf(tmp_path / "fine.nc")
    scene = open_scene([path, tmp_path / "fine.nc"], around=(lat, lon), radius_km=30)
    i, j = at(scene, lat, lon)
    assert scene.data.liquid_content.values[3, j, i] == pytest.approx(7e-4, rel=1e-3)
    assert scene.grid.spacing_m()[0] == pytest.approx(500.0, rel=0.02)
    assert scene.wider.data.liquid_content.values[:, 0, 0].max() < 7e-4
    with pytest.raises(UserError, match="around"):
        open_scene([path, tmp_path / "fine.nc"])


def test_albedo_by_wavelength():
    """Where the finer domain has it; the coarser's is the same at all of them."""
    outer = domain(3000.0, 81, smooth, surface_albedo=0.3)
    inner = domain(500.0, 61, smooth, surface_albedo=np.broadcast_to([0.1, 0.2, 0.05], (61, 61, 3)))
    scene = merged([outer, inner], NEAR)
    i, j = at(scene, LAT, LON)
    np.testing.assert_allclose(scene.data.surface_albedo[j, i], [0.1, 0.2, 0.05], rtol=1e-4)
    np.testing.assert_allclose(scene.levels[-1].data.surface_albedo[0, 0], 0.3, rtol=1e-4)


def test_albedo_at_other_wavelengths_holds_its_ends():
    outer = domain(3000.0, 81, smooth, wavelength_nm=[500, 600],
                   surface_albedo=np.broadcast_to([0.4, 0.2], (81, 81, 2)))  # fmt: skip
    inner = domain(500.0, 61, smooth, surface_albedo=np.broadcast_to([0.1, 0.2, 0.1], (61, 61, 3)))
    scene = merged([outer, inner], NEAR)
    by_wavelength = dict(zip((615.0, 546.0, 450.0), (0.2, 0.4 - 0.2 * 0.46, 0.4), strict=True))
    wider = scene.levels[-1].data.surface_albedo
    for wavelength, albedo in by_wavelength.items():
        np.testing.assert_allclose(wider.sel(wavelength=wavelength)[0, 0], albedo, rtol=1e-4)


def test_files_of_the_scene_layout(tmp_path):
    for step, nodes in ((3000.0, 81), (500.0, 61)):
        domain(step, nodes, smooth, time=np.datetime64("2024-06-21T12:00")).to_netcdf(tmp_path / f"{step:.0f}.nc")
    paths = sorted(tmp_path.glob("*.nc"))
    scene = open_scene(paths, around=NEAR)
    assert scene.grid.spacing_m()[0] == pytest.approx(500.0, rel=0.01)
    assert scene.wider.grid.spacing_m()[0] == pytest.approx(3000.0, rel=0.01)
    again = tmp_path / "again.nc"
    again.write_bytes(paths[0].read_bytes())
    with pytest.raises(UserError, match="same grid"):
        open_scene([paths[0], again], around=NEAR)


def test_wider_cells_are_whole_at_the_edge_of_all_domains():
    """Means over cells that stick out would know nothing."""
    outer = domain(1000.0, 401, lambda x, y, z: 1e-4, terrain_m=np.full((401, 401), 300.0))
    inner = domain(200.0, 61, lambda x, y, z: 1e-4, terrain_m=np.full((61, 61), 300.0))
    scene = merged([outer, inner], Neighbourhood(LAT, LON, radius_m=4e5))
    assert scene.levels[-1].grid.spacing_m()[0] > 1500
    for level in scene.levels:
        np.testing.assert_allclose(level.data.surface_altitude, 300.0, rtol=1e-5)
        np.testing.assert_allclose(level.data.liquid_content, 1e-4, rtol=1e-4)
