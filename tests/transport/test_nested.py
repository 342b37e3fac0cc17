"""A grid in a wider one: the picture is that of one fine grid, far clouds are there, air counts once."""

from __future__ import annotations

import numpy as np
import pytest
from tests.transport.scenes import (
    LAT,
    LON,
    WAVELENGTH_NM,
    aimed_at,
    down_on,
    grid_scene,
    laid_scene,
    sky_directions,
    sun_at_zenith_angle,
    toward,
)

from openswim.cameras import Camera, Rays
from openswim.errors import UserError
from openswim.lighting import light
from openswim.rendering import render as rendered
from openswim.scene import Scene
from openswim.solver import Solver
from openswim.transport import Field
from openswim.transport.ground_light.fluxes import Lighting
from openswim.transport.march.march import march_rays
from openswim.transport.medium.core import Core

SUN = toward(140.0, 45.0)
CELL, HEIGHT, LEVELS = 1000.0, 400.0, 16
HALF = 24  # cells from the middle to the side of the whole domain
FAST = Solver(tolerance=0.05)


def clear_sky(x, y, z):
    return 0.0


def waves(x, y, z):
    """Soft clouds some kilometres wide, optical depth up to 2.5."""
    cover = np.maximum(np.sin(x / 6e3 + 0.5) * np.cos(y / 7e3), 0) ** 2
    return 2e-3 * cover * np.exp(-(((z - 2400) / 700) ** 2))


def thick_deck(x, y, z):
    return 0.01 * ((z > 1500) & (z < 3000))


def laid(content, cell=CELL, half=HALF, middle=(0, 0), **more) -> Scene:
    """A domain of so many cells of 1 km to each side of its ``middle``, in cells of so many metres."""
    count = round(2 * half * CELL / cell) + 1
    x, y = (cell * (np.arange(count) - (count - 1) / 2) + CELL * at for at in middle)
    z = HEIGHT * np.arange(LEVELS)
    zz, yy, xx = np.meshgrid(z, y, x, indexing="ij")
    return laid_scene(np.float32(content(xx, yy, zz) + 0 * xx), x, y, z, air=True, surface_albedo=0.2, **more)


def nest(content, inner=HALF // 2, cell=2 * CELL, middle=(0, 0)) -> Scene:
    scene = laid(content, half=inner, middle=middle)
    scene.wider = laid(content, cell=cell)
    return scene


def solved(scene: Scene, solver: Solver = FAST, sun=SUN) -> Field:
    return solver.solve(scene, sun, [WAVELENGTH_NM])


@pytest.fixture(scope="module")
def clouds() -> tuple[Field, Field]:
    """The same clouds on one fine grid, and on a fine one in a coarse one."""
    return solved(laid(waves)), solved(nest(waves))


VIEWS = {
    "ground": Rays(np.array([0.0, 0.0, 2.0]), sky_directions([20, 45, 65, 78, 84, 87], np.arange(0, 360, 15))),
    "aloft": Rays(np.array([0.0, 0.0, 9e3]), sky_directions(np.arange(100, 170, 8), np.arange(0, 360, 15))),
    "space": Rays(np.array([0.0, 0.0, 4e5]), sky_directions(180 - np.linspace(0.1, 2.6, 12), np.arange(0, 360, 10))),
    "aside": Rays(np.array([-16e3, 3e3, 6e3]), sky_directions(np.arange(94, 150, 6), np.arange(60, 121, 5))),
}


def difference(a, b) -> float:
    """Relative RMS."""
    return float(np.sqrt(((a - b) ** 2).mean()) / b.mean())


@pytest.mark.parametrize("name", VIEWS)
def test_one_grid_or_two_show_the_same(clouds, name) -> None:
    whole, two = (field.view(VIEWS[name]) for field in clouds)
    assert difference(two.radiance, whole.radiance) < 0.02
    assert two.radiance.mean() == pytest.approx(whole.radiance.mean(), rel=0.01)
    np.testing.assert_array_equal(two.hit, whole.hit)
    np.testing.assert_allclose(two.distance_m, whole.distance_m, rtol=1e-3, atol=1.0)
    np.testing.assert_allclose(two.transmittance, whole.transmittance, atol=0.05)
    np.testing.assert_allclose(two.species_depth, whole.species_depth, rtol=0.2, atol=0.2)


def test_the_rim_cannot_be_seen_from_above(clouds) -> None:
    """Row after row of places under an eye in space: across the rim no step that one grid does not have."""
    x = np.arange(-20e3, 20.1e3, 400.0)
    for across in range(-8000, 8001, 2000):
        place = np.stack([x, 0 * x + across, 0 * x + 3e3], axis=-1)
        eye = np.array([0.0, 0.0, 4e5])
        toward_place = (place - eye) / np.linalg.norm(place - eye, axis=-1, keepdims=True)
        whole, two = (field.view(Rays(eye, toward_place)).radiance[:, 0] for field in clouds)
        ratio = two / whole
        np.testing.assert_allclose(ratio, 1, atol=0.12)  # cells of 2 km beside cells of 1 km
        rim = np.abs(np.abs(x[1:]) - 10e3) < 2000
        assert np.abs(np.diff(ratio))[rim].max() < 0.05


@pytest.fixture(scope="module", params=[FAST, Solver("swim")], ids=["fast", "swim"])
def clear(request) -> tuple[Field, Field, Field]:
    """Clear sky on one grid, on two, and, of `fast`, without a grid."""
    scene = laid(clear_sky)
    plain = Scene.clear(LAT, LON, scene.atmosphere, surface_albedo=float(scene.data["surface_albedo"].mean()))
    fast = request.param is FAST
    return tuple(solved(one, request.param) for one in (scene, nest(clear_sky), plain if fast else scene))


@pytest.mark.parametrize("name", VIEWS)
def test_clear_air_is_counted_once(clear, name) -> None:
    alone, two, right = (field.view(VIEWS[name]) for field in clear)
    np.testing.assert_allclose(two.transmittance, alone.transmittance, rtol=4e-3)
    most = 0.007 if clear[0].lit[0].options.name == "fast" else 0.025  # swim's steps in haze are long
    assert difference(two.radiance, right.radiance) < most


def test_swim_sees_both_grids() -> None:
    whole, two = (solved(scene, Solver("swim")).view(VIEWS["ground"]) for scene in (laid(waves), nest(waves)))
    assert difference(two.radiance, whole.radiance) < 0.04  # its clouds do not add up piece by piece


def far_cloud(x, y, z):
    return np.where((np.abs(x - 20e3) < 2500) & (np.abs(y) < 8e3) & (z > 1000) & (z < 5000), 5e-3, 0.0)


def test_a_cloud_beyond_the_inner_grid_stands_on_the_horizon() -> None:
    rays = Rays(np.array([0.0, 0.0, 2.0]), toward(90.0, np.degrees(np.arctan(3 / 20)))[None])
    scene = nest(far_cloud, inner=10)
    alone, with_it = solved(scene.alone()), solved(scene)
    assert alone.view(rays).transmittance[0, 0] > 0.25
    assert with_it.view(rays).transmittance[0, 0] < 1e-3
    opposite = Rays(rays.origin_m, toward(270.0, 8.0)[None])
    np.testing.assert_allclose(with_it.view(opposite).radiance, alone.view(opposite).radiance, rtol=0.02)


@pytest.mark.parametrize("name", ["fast", "swim"])
def test_clouds_of_the_wider_grid_shade_the_inner(name) -> None:
    """A low sun behind a bank of cloud: the ground in the inner grid is as dark as on one grid."""
    solver = Solver(name, most_sweeps=1) if name == "fast" else Solver(name)  # of the beam there is no more to know
    sun = sun_at_zenith_angle(80.0)  # over the bank in the east: its top casts 28 km of shadow, its base 6 km
    scene = nest(far_cloud, inner=10)
    direct = {}
    for which, one in (("whole", laid(far_cloud)), ("alone", scene.alone()), ("nest", scene)):
        pack = solved(one, solver, sun).packs[0]
        middle = pack.medium.shape[1] // 2  # type: ignore[union-attr]
        direct[which] = pack.lighting.direct[0, middle, middle - 9 : middle + 10]
    assert direct["alone"].min() > 0.3
    assert direct["whole"].max() < 0.1 * direct["alone"].max()
    np.testing.assert_allclose(direct["nest"], direct["whole"], atol=0.02)


def deck(x, y, z):
    """A sheet of cloud, optical depth 3."""
    return 2.75e-3 * np.exp(-(((z - 2000) / 600) ** 4))


@pytest.mark.parametrize("sun", [SUN, toward(140.0, 15.0)], ids=["high", "low"])
def test_a_small_grid_in_a_sheet_of_cloud_is_lit_through_its_sides(sun) -> None:
    """Clear sky beside it would make it a tenth too dark at the edge of its core."""
    scene = laid(deck, cell=500.0, half=7)
    scene.wider = laid(deck)
    x, y = np.meshgrid(np.arange(-5e3, 5.1e3, 1e3), np.arange(-5e3, 5.1e3, 1e3))
    whole, two = (solved(one, sun=sun) for one in (laid(deck, cell=500.0), scene))
    up = Rays(np.array([0.0, 0.0, 2.0]), sky_directions([10, 30, 50, 65], np.arange(0, 360, 30)))
    for rays in (down_on(x, y, 9e3), up):
        one, other = two.view(rays).radiance, whole.view(rays).radiance
        assert difference(one, other) < 0.02
        np.testing.assert_allclose(one, other, rtol=0.04)


def test_what_is_cut_of_a_sheet_of_cloud_is_lit_as_if_it_went_on() -> None:
    """Nothing is known of what lies beyond: columns along the sides are taken for endless. Under a high sun."""
    sun = toward(0.0, 90.0)
    part = laid(deck, half=7)
    part.cut = True
    x = np.arange(-6e3, 6.1e3, 1e3)
    rays = down_on(x, 0 * x, 9e3)
    whole, cut = (solved(one, sun=sun).view(rays).radiance for one in (laid(deck), part))
    np.testing.assert_allclose(cut, whole, rtol=0.02)


def test_a_grid_in_its_like_is_that_grid() -> None:
    scene = laid(waves, half=12)
    alone = solved(scene).view(VIEWS["ground"])
    scene.wider = laid(waves, half=12)
    twice = solved(scene).view(VIEWS["ground"])
    assert difference(twice.radiance, alone.radiance) < 0.02


def test_an_inner_grid_may_stick_out() -> None:
    """Where there is no wider grid there is clear air."""
    scene = laid(clear_sky, half=12)
    scene.wider = laid(clear_sky, half=8)
    alone = solved(scene.alone()).view(VIEWS["ground"])
    assert difference(solved(scene).view(VIEWS["ground"]).radiance, alone.radiance) < 0.01


def test_three_grids(clouds) -> None:
    scene = nest(waves)
    first = laid(waves, cell=500.0, half=7)
    first.wider = scene
    assert [level.grid.shape[2] for level in first.levels] == [29, 25, 25]
    field = solved(first)
    assert len(field.lit[0].levels) == 3
    for name, rays in VIEWS.items():
        assert difference(field.view(rays).radiance, clouds[0].view(rays).radiance) < 0.05, name


def test_what_water_mirrors_is_in_both_grids() -> None:
    """A calm lake in front of the far bank is darker than one under clear sky is bright: it mirrors cloud."""
    water = {"land_area_fraction": np.zeros((21, 21), np.float32), "wind_east_10m": np.zeros((21, 21), np.float32),
             "wind_north_10m": np.zeros((21, 21), np.float32)}  # fmt: skip
    scene = laid(far_cloud, half=10, fields=water)
    scene.data = scene.data.drop_vars("surface_albedo")
    scene.wider = laid(far_cloud, cell=2 * CELL)
    rays = Rays(np.array([0.0, 0.0, 100.0]), np.stack([toward(a, -8.0) for a in (80, 85, 90, 95, 100)]))
    mirrored, clear = (solved(one).view(rays) for one in (scene, scene.alone()))
    assert mirrored.hit.all()
    assert np.abs(mirrored.radiance / clear.radiance - 1).min() > 0.05


def test_cores_of_rays() -> None:
    """Where rays enter and leave, against steps along them."""
    pack = solved(laid(clear_sky, half=12), Solver("swim")).lit[0]
    assert pack.medium is not None
    core, medium = Core.of(pack.medium), pack.medium
    rng = np.random.default_rng(1)
    origin = rng.uniform([-3e4, -3e4, 10.0], [3e4, 3e4, 9e3], (400, 3))
    direction = rng.normal(size=(400, 3))
    direction[:, 2] *= 0.2
    direction /= np.linalg.norm(direction, axis=-1, keepdims=True)
    enter, leave = core.crossed(origin, direction, pack.shells.top_m)
    s = np.arange(50.0, 60e3, 100.0)
    lat, lon, _ = medium.frame.latlon(origin[:, None] + s[:, None] * direction[:, None])
    ix, iy = (i * medium.fineness for i in medium.grid.index(lon, lat))
    ny, nx = medium.shape[1:]
    rim = max(2, round(0.08 * nx))

    def inside(margin):
        return (np.minimum(ix, nx - 1 - ix) >= margin) & (np.minimum(iy, ny - 1 - iy) >= margin)

    within = (s >= enter[:, None]) & (s <= leave[:, None])
    assert not (within & ~inside(rim - 0.05)).any()
    assert not (~within & inside(rim + 0.05)).any()
    assert (enter == 0).any()
    assert ((enter > 0) & (leave < 1e29)).any()
    assert (enter == 1e30).any()


def test_the_core_from_space() -> None:
    """Rays that come from above enter it at once, and those that pass the Earth by, or see its far side, never."""
    core = Core.of(solved(laid(clear_sky, half=12), Solver("swim")).lit[0].medium)  # type: ignore[arg-type]
    up = np.array([0.0, 0.0, 1.0])
    enter, leave = core.crossed(np.array([[0.0, 0.0, 3.6e7]] * 2), np.stack([-up, up]), 1e5)
    assert enter[0] == 0
    assert leave[0] > 3.6e7
    assert enter[1] == 1e30
    below = np.array([[0.0, 0.0, -2 * 6.371e6 - 4e5]])
    assert core.crossed(below, -up[None], 1e5)[0][0] == 1e30
    aside = np.array([[3.6e7, 0.0, 0.0]])
    assert core.crossed(aside, up[None], 1e5)[0][0] == 1e30


@pytest.mark.parametrize("altitude", [30.0, 2.0, -8.0])
def test_a_way_in_two_pieces(clouds, altitude) -> None:
    """Rays that stop on their way and go on from there see what they see in one go; the ground they find themselves."""
    pack = clouds[0].packs[0]
    o, d = np.array([[100.0, 50.0, 800.0]]), toward(70.0, altitude)[None]
    world = pack.sun, pack.table, pack.shells, aimed_at(pack, o[0]).volume, 0.25
    whole = march_rays(o, d, *world)
    for stop in (900.0, 4321.0, 70e3):
        first = march_rays(o, d, *world, ends=np.array([-stop]))
        if 0 <= whole.distance_m[0] < stop:
            assert first.distance_m[0] == pytest.approx(whole.distance_m[0], abs=1.0)
            np.testing.assert_allclose(first.radiance, whole.radiance, rtol=1e-3)
            continue
        assert first.distance_m[0] == pytest.approx(stop, abs=1e-3)
        second = march_rays(o + stop * d, d, *world)
        np.testing.assert_allclose(first.radiance + first.scaled * second.radiance, whole.radiance, rtol=0.01)
        np.testing.assert_allclose(first.full * second.full, whole.full, rtol=0.01)


def test_a_camera_beside_the_inner_grid_stands_in_the_wider() -> None:
    scene = nest(clear_sky)
    lit = light(scene, Solver("swim"), sun=(140.0, 45.0))
    lon, lat = scene.wider.grid.lonlat(2, 12)  # type: ignore[union-attr]
    seen = rendered(lit, Camera.allsky(float(lat), float(lon), size=8))
    assert np.isfinite(seen.radiance.values[4, 4]).all()
    with pytest.raises(UserError, match="outside the domain"):
        rendered(lit, Camera.allsky(LAT + 3, LON, size=8))


def test_flat_scenes_lie_in_nothing() -> None:
    flat = grid_scene(np.zeros((4, 5, 5)), (4, 5, 5))
    with pytest.raises(UserError, match="place on Earth"):
        Scene(flat.grid, flat.data, optics=flat.optics, wider=laid(clear_sky, half=4))


def test_reference_says_that_it_sees_the_innermost_alone() -> None:
    with pytest.warns(UserWarning, match="innermost"):
        solved(nest(clear_sky, inner=4), Solver("reference", paths=2))


@pytest.fixture(scope="module")
def under_a_deck() -> Lighting:
    """What falls on the ground under a deck that the sides of a grid cut."""
    return solved(laid(thick_deck)).lit[0].lighting


def test_a_nest_as_wide_as_the_domain_around_it_ends_as_that_does(under_a_deck) -> None:
    """It is lit at its sides by clear sky, and not by what is seen at the wider grid's last nodes."""
    alone, two = under_a_deck, solved(nest(thick_deck, HALF)).lit[0].lighting
    np.testing.assert_allclose(two.up_top[0], alone.up_top[0], rtol=1e-3)
    np.testing.assert_allclose(two.diffuse[0], alone.diffuse[0], rtol=1e-3)


@pytest.mark.parametrize("side", [(-1, 0), (1, 0), (0, -1), (0, 1)])
def test_a_nest_ends_at_the_one_side_where_the_domain_around_it_does(under_a_deck, side) -> None:
    """There it is as dark as the whole domain in its cells, and light goes on through the others; corners left out."""
    half = HALF // 2
    got = solved(nest(thick_deck, half, middle=tuple(half * at for at in side))).lit[0].lighting.diffuse[0]
    x, y = (slice(half * (1 + at), half * (3 + at) + 1) for at in side)
    away = np.s_[half // 2 : -(half // 2)]
    inner = np.s_[:, away] if side[1] else np.s_[away, :]
    np.testing.assert_allclose(got[inner], under_a_deck.diffuse[0][y, x][inner], rtol=0.05)
