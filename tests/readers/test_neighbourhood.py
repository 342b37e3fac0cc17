"""Parts of domains: cut across the date line, resampled round the poles; fields stay where they lie on Earth."""

from __future__ import annotations

import numpy as np
import pytest
from pyproj import CRS

from openswim import Scene
from openswim.errors import UserError
from openswim.readers.domain.beyond import with_beyond
from openswim.readers.domain.cutting import LARGE_COLUMNS, is_large, part_of, select
from openswim.readers.domain.mesh import Mesh
from openswim.readers.domain.neighbourhood import WIDER_SIDE, Neighbourhood, far_m, reach_m
from openswim.scene.grid import great_circle_m

SPHERE = CRS.from_proj4("+proj=longlat +R=6371000 +no_defs")


def _globe(step=1.0, first=0.0):
    return Mesh(first + np.arange(0.0, 360.0, step), np.linspace(-90.0, 90.0, round(180 / step) + 1), SPHERE)


def _sphere(lon, lat):
    """A field that is smooth everywhere on the sphere, poles and date line included."""
    lon, lat = np.radians(lon), np.radians(lat)
    x, y, z = np.cos(lat) * np.cos(lon), np.cos(lat) * np.sin(lon), np.sin(lat)
    return 100 * x + 40 * y * z + 70 * z + 30 * x * y


def _field(mesh):
    return _sphere(*np.meshgrid(mesh.x, mesh.y)).astype(np.float32)


def _truth(part):
    grid = part.grid(np.array([0.0, 1.0]))
    return _sphere(*grid.lonlat(np.arange(part.x.size), np.arange(part.y.size)[:, None]))


@pytest.mark.parametrize("first", [0.0, -180.0])
@pytest.mark.parametrize("place", [(10, 0.2), (10, 179.9), (10, -179.9), (-12, 359.8), (0, -0.2), (3, 77)])
def test_cut_is_the_field_itself_wherever_the_seam_is(place, first):
    part = select(_globe(first=first), Neighbourhood(*place, radius_m=8e5))
    assert not part.nodes
    grid = part.grid(np.array([0.0, 1.0]))
    ix, iy = grid.index(place[1], place[0])
    assert abs(ix - grid.centre_index[0]) <= 1
    assert abs(iy - grid.centre_index[1]) <= 1
    np.testing.assert_allclose(part.take(_field(_globe(first=first))), _truth(part), atol=1e-4)


@pytest.mark.parametrize("place", [(90, 0), (-90, 10), (88, 179), (-85, -90), (60, 180), (47, 8)])
def test_resampled_where_cells_narrow(place):
    mesh = _globe()
    part = select(mesh, Neighbourhood(*place, radius_m=1.5e6))
    assert part.nodes
    grid = part.grid(np.array([0.0, 1.0]))
    assert grid.spacing_m() == pytest.approx((111195, 111195), rel=0.01)
    centre = grid.lonlat(*grid.centre_index)
    assert great_circle_m([float(centre[0]), place[1]], [float(centre[1]), place[0]], 6.371e6) < 1000
    # linear interpolation over a degree: f'' h^2 / 8
    np.testing.assert_allclose(part.take(_field(mesh)), _truth(part), atol=0.03)


def test_a_hemisphere_is_averaged_on_wider_cells_and_keeps_its_mean():
    mesh = _globe(step=0.25)
    rng = np.random.default_rng(1)
    noise = rng.uniform(0, 1, mesh.shape).astype(np.float32)
    part = select(mesh, Neighbourhood(40.0, -100.0, radius_m=9e6))
    assert max(part.shape) <= 421
    coarse = part.take(noise)
    assert float(coarse.mean()) == pytest.approx(0.5, abs=0.01)


@pytest.mark.parametrize("step", [0.25, 1.0, 2.5])
@pytest.mark.parametrize("lat", [0.0, 40.0, -90.0])
def test_the_widest_part_is_what_transport_takes(step, lat):
    part = select(_globe(step), Neighbourhood(lat, -100.0, radius_m=3e7)).grid(np.array([0.0, 1.0]))
    middle = (part.y.size - 1) / 2
    lon, lat = part.lonlat([0, part.x.size - 1], [middle, middle])
    assert np.isfinite(lon).all()
    assert 6.371e6 * np.radians(174) < great_circle_m(lon, lat, 6.371e6) < 6.371e6 * np.radians(180)


def test_only_the_needed_part_is_asked_for():
    mesh = _globe(step=0.25)
    whole, asked = _field(mesh), []

    def get(rows, columns):
        asked.append((rows.stop - rows.start) * (columns.stop - columns.start))
        return whole[rows, columns]

    part = select(mesh, Neighbourhood(10.0, 180.0))
    np.testing.assert_allclose(part.read(get), _truth(part), atol=1e-4)
    assert sum(asked) < 400


def test_stacks_and_gaps():
    mesh = _globe()
    field = _field(mesh)
    part = select(mesh, Neighbourhood(80.0, 0.0, radius_m=6e5))
    np.testing.assert_array_equal(part.take(np.stack([field, 2 * field]))[1], 2 * part.take(field))
    field[-8:, 40:] = np.nan
    taken = part.take(field)
    assert np.isnan(taken).any()
    assert np.isfinite(taken).any()
    kept = np.isfinite(taken)
    np.testing.assert_allclose(taken[kept], _truth(part)[kept], atol=2.5)  # within a cell of the gap's edge


def test_a_region_is_cut_at_its_edges_and_refuses_what_lies_outside():
    crs = CRS.from_proj4("+proj=lcc +lat_1=38.5 +lat_2=38.5 +lat_0=38.5 +lon_0=-97.5 +R=6371229")
    mesh = Mesh(3000.0 * np.arange(1799) - 2.7e6, 3000.0 * np.arange(1059) - 1.6e6, crs, 6371229.0)
    assert is_large(mesh)
    part = select(mesh, Neighbourhood(40.0, -105.0, if_large=True))
    assert set(part.shape) <= {135, 136}  # 200 km to each side
    edge = select(mesh, Neighbourhood(*(float(v) for v in reversed(mesh.grid().lonlat(3, 500)))))
    assert edge.columns[0].start == 0
    with pytest.raises(UserError, match="outside the domain: it covers about latitude 2"):
        select(mesh, Neighbourhood(50.0, 10.0))


def test_corners_are_of_the_domain():
    """Also where rounding puts them a little beside it."""
    mesh = Mesh(np.linspace(0.0, 30.0, 361), np.linspace(40.0, 50.0, 121), SPHERE)
    for lat, lon in ((50.0, 0.0), (50.0, 30.0), (40.0, 0.0), (40.0, 30.0)):
        for rounding in (-1e-9, 1e-9):
            part = select(mesh, Neighbourhood(lat + rounding, lon + rounding))
            assert np.isfinite(part.take(_field(mesh))).all()
    with pytest.raises(UserError, match="outside the domain"):
        select(mesh, Neighbourhood(50.001, 0.0))


def test_a_large_domain_seen_whole_is_averaged_and_no_farther_than_it_reaches():
    crs = CRS.from_proj4("+proj=lcc +lat_1=38.5 +lat_2=38.5 +lat_0=38.5 +lon_0=-97.5 +R=6371229")
    mesh = Mesh(3000.0 * np.arange(1799) - 2.7e6, 3000.0 * np.arange(1059) - 1.6e6, crs, 6371229.0)
    part = select(mesh, Neighbourhood(38.0, -97.0, reach_m(35_786_000.0), if_large=True, in_parts=False))
    assert max(part.shape) <= 421
    assert part.x[1] - part.x[0] < 16_000  # 5400 km by 3200 km
    assert part.x[-1] - part.x[0] > 5.2e6


def test_small_domains_stay_whole_unless_asked():
    mesh = Mesh(0.04 * np.arange(300), 40 + 0.04 * np.arange(300), SPHERE)
    assert mesh.x.size * mesh.y.size < LARGE_COLUMNS
    assert select(mesh, Neighbourhood(47.0, 8.0, if_large=True)).shape == mesh.shape
    assert max(select(mesh, Neighbourhood(47.0, 8.0)).shape) < 140


def test_small_domains_of_wide_cells_are_cut_so_that_their_clouds_can_be_drawn_fine():
    mesh = Mesh(np.arange(0.0, 20.0, 0.25), np.arange(35.0, 60.0, 0.25), SPHERE)
    assert max(select(mesh, Neighbourhood(47.0, 8.0, if_large=True)).shape) < 40
    assert select(mesh, Neighbourhood(47.0, 8.0, radius_m=4e6, if_large=True)).shape == mesh.shape


def test_reach_grows_with_height():
    assert reach_m(2.0) == pytest.approx(205e3, rel=0.01)
    assert reach_m(10_000.0) == pytest.approx(200e3 + 357e3, rel=0.01)
    assert reach_m(35_786_000.0) == pytest.approx(9.24e6, rel=0.01)
    assert reach_m(1.5e9) == 1e7


def test_places_that_are_none_are_refused():
    with pytest.raises(UserError, match="no place on Earth"):
        Neighbourhood(91.0, 0.0)
    with pytest.raises(UserError, match="radius_km"):
        Neighbourhood(0.0, 0.0, radius_m=-1.0)


def test_part_of_any_scene():
    mesh = _globe(step=2.0)
    field = np.maximum(np.stack([_field(mesh)] * 3), 0) * 1e-6
    scene = Scene.from_arrays({}, mesh.x, mesh.y, [0.0, 1e3, 2e3], crs=SPHERE, fields={"liquid_content": field},
                              surface_albedo=np.stack([np.abs(_field(mesh)) / 300] * 3, axis=-1))  # fmt: skip
    part = part_of(scene, Neighbourhood(5.0, 179.0, radius_m=1e6))
    lon, lat = part.grid.lonlat(np.arange(part.grid.x.size), np.arange(part.grid.y.size)[:, None])
    np.testing.assert_allclose(part.data.liquid_content[1], np.maximum(_sphere(lon, lat), 0) * 1e-6, atol=1e-10)
    np.testing.assert_allclose(part.data.surface_albedo[..., 2], np.abs(_sphere(lon, lat)) / 300, atol=1e-5)
    assert any("neighbourhood" in note for note in part.notes)


def test_part_that_reaches_beyond_the_domain():
    """A wedge of the Earth from far away: no cloud beyond it, and the ground there is as its mean."""
    mesh = Mesh(np.arange(100.0, 171.0, 5.0), np.arange(-80.0, 81.0, 5.0), SPHERE)
    shape = (3, mesh.y.size, mesh.x.size)
    albedo = np.broadcast_to(np.linspace(0.1, 0.5, mesh.x.size), shape[1:])
    scene = Scene.from_arrays({"cloud": np.full(shape, 1e-3)}, mesh.x, mesh.y, [0.0, 1e3, 2e3], crs=SPHERE,
                              fields={"liquid_content": np.full(shape, 1e-4)}, surface_albedo=albedo)  # fmt: skip
    part = part_of(scene, Neighbourhood(0.0, 135.0, reach_m(3.6e7), if_large=True))
    inside = mesh.covers(*mesh.index_of(part.grid))
    assert 0.3 < inside.mean() < 0.9
    for name, amount in (("extinction_cloud", 1e-3), ("liquid_content", 1e-4)):
        np.testing.assert_allclose(part.data[name].values[:, inside], amount, rtol=1e-5)
        assert not part.data[name].values[:, ~inside].any()
    ground = part.data.surface_albedo.values
    assert np.ptp(ground[inside]) > 0.3
    np.testing.assert_allclose(ground[~inside], 0.3, atol=0.02)  # as east as west


HRRR = Mesh(
    3000.0 * (np.arange(1799) - 899), 3000.0 * (np.arange(1059) - 529),
    CRS.from_proj4("+proj=lcc +lat_1=38.5 +lat_2=38.5 +lat_0=38.5 +lon_0=-97.5 +R=6371229"), 6_371_229.0,
)  # fmt: skip


def test_narrow_cells_of_very_large_domains_are_kept_for_an_eye_in_space():
    from_space = Neighbourhood(38.5, -97.5, reach_m(3.6e7), if_large=True)
    whole = select(HRRR, from_space)
    assert whole.shape == HRRR.shape
    assert not whole.nodes
    near = select(HRRR, Neighbourhood(38.5, -97.5, reach_m(2.0), if_large=True))
    assert near.shape[0] < 150
    wide = Mesh(10 * HRRR.x, 10 * HRRR.y, HRRR.crs, 10 * HRRR.earth_radius_m)
    assert select(wide, from_space).nodes


LAMBERT = CRS.from_proj4("+proj=lcc +lat_1=40 +lat_2=55 +lat_0=47 +lon_0=8 +R=6371000")


def _scene_of(mesh):
    content = np.full((3, *mesh.shape), 1e-4, np.float32)
    return Scene.from_arrays({}, mesh.x, mesh.y, np.array([0.0, 2e3, 4e3]), crs=mesh.crs,
                             earth_radius_m=mesh.earth_radius_m, fields={"liquid_content": content})  # fmt: skip


def test_beyond_a_part_lies_what_may_be_seen_of_the_rest():
    whole = _scene_of(Mesh(3000.0 * np.arange(601), 3000.0 * np.arange(601), LAMBERT, 6371000.0))
    lon, lat = whole.grid.lonlat(300, 300)
    near = Neighbourhood(float(lat), float(lon), if_large=True, far_m=far_m(2.0))
    part = with_beyond(part_of(whole, near), near, lambda beyond: part_of(whole, beyond))
    halves = [0.5 * np.ptp(level.grid.x) for level in part.levels]
    assert halves == pytest.approx([2e5, far_m(2.0)], rel=0.03)
    assert max(part.wider.grid.shape[1:]) < 350
    assert any("beyond, cells of 3 km" in note for note in part.notes)
    assert not any("nothing beyond" in note for note in part.notes)


def test_beyond_a_part_on_a_map_of_its_own_too():
    whole = _scene_of(_globe(0.5))
    near = Neighbourhood(80.0, 20.0, if_large=True, far_m=far_m(2.0))
    assert select(_globe(0.5), near).nodes
    part = with_beyond(part_of(whole, near), near, lambda beyond: part_of(whole, beyond))
    assert 0.5 * np.ptp(part.wider.grid.x) == pytest.approx(far_m(2.0), rel=0.15)


def test_wide_views_of_narrow_cells_are_averaged():
    whole = _scene_of(Mesh(1000.0 * np.arange(901), 1000.0 * np.arange(901), LAMBERT, 6371000.0))
    lon, lat = whole.grid.lonlat(450, 450)
    near = Neighbourhood(float(lat), float(lon), if_large=True, far_m=far_m(2.0))
    part = with_beyond(part_of(whole, near), near, lambda beyond: part_of(whole, beyond))
    assert part.grid.spacing_m()[0] == pytest.approx(1000.0, rel=0.05)
    assert max(part.wider.grid.shape[1:]) <= WIDER_SIDE
    np.testing.assert_allclose(part.wider.data.liquid_content[1], 1e-4, rtol=1e-4)


@pytest.mark.parametrize(("column", "alone"), [(5, True), (25, True), (40, False), (575, True)])
def test_near_the_end_of_a_domain_a_part_stays_alone(column, alone):
    """Where the domain ends near the eye so does the part, and the border of two grids would be above it."""
    whole = _scene_of(Mesh(3000.0 * np.arange(601), 3000.0 * np.arange(601), LAMBERT, 6371000.0))
    lon, lat = whole.grid.lonlat(column, 300)
    near = Neighbourhood(float(lat), float(lon), if_large=True, far_m=far_m(2.0))
    part = with_beyond(part_of(whole, near), near, lambda beyond: part_of(whole, beyond))
    assert (part.wider is None) == alone


def test_a_domain_that_is_whole_has_nothing_beyond():
    small = _scene_of(Mesh(3000.0 * np.arange(101), 3000.0 * np.arange(101), LAMBERT, 6371000.0))
    lat, lon = small.place
    near = Neighbourhood(lat, lon, if_large=True, far_m=far_m(2.0))

    def never(beyond):
        raise AssertionError("read twice")

    assert with_beyond(part_of(small, near), near, never).wider is None
    assert with_beyond(part_of(small, Neighbourhood(lat, lon, 3e4)), Neighbourhood(lat, lon, 3e4), never).wider is None


def test_far_clouds_stand_above_the_horizon():
    """Their tops, 16 km up, are hidden no farther than that: 450 km on the ground; from an aircraft some 800."""
    assert far_m(0.0) == pytest.approx(np.sqrt(2 * 6.371e6 * 16e3), rel=0.01)
    assert far_m(1e4) == pytest.approx(far_m(0.0) + np.sqrt(2 * 6.371e6 * 1e4), rel=0.01)
    assert far_m(3.6e7) <= 1e7
    assert Neighbourhood(47.0, 8.0, reach_m(4e5), far_m=far_m(4e5)).beyond is None
    assert Neighbourhood(47.0, 8.0, reach_m(1e4), far_m=far_m(1e4)).beyond is not None


@pytest.mark.parametrize("lon", [[8.0, 9.0, 20.0], [179.0, -178.0, -170.0], [0.0, 0.0, 0.0]])
def test_what_is_seen_along_a_way_is_seen_from_each_of_its_places(lon):
    lat, height_m = [47.0, 52.0, 49.0], [500.0, 9000.0, 2000.0]
    whole = Neighbourhood.seen_along(lat, lon, height_m)
    for here in zip(lat, lon, height_m, strict=True):
        own = Neighbourhood.seen_from(*here)
        away_m = great_circle_m([whole.lon, here[1]], [whole.lat, here[0]], 6.371e6)
        assert away_m + own.radius_m <= whole.radius_m + 1.0
        assert away_m + own.far_m <= whole.far_m + 1.0
    assert whole.radius_m < 2e6  # no more than the way is long, and what is seen from its highest place
