"""Detail below the grid: means stay, nothing is negative; from afar, or where it is not asked for, nothing changes."""

import numba
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from tests.transport.scenes import WAVELENGTH_NM, box, changed, grid_scene, toward

from openswim.cameras import Rays
from openswim.scene.procedural import demo_scene
from openswim.solver import Solver
from openswim.transport import Field
from openswim.transport.engine.pack import PACK, lane
from openswim.transport.march.cloud_detail import (
    SCRATCH,
    Detail,
    detail_of,
    noise_at,
    normal_share,
    place_octaves,
    seen_octaves,
    sunward,
    thickened,
)
from openswim.transport.march.detail_step import widest_m
from openswim.transport.march.march import march_rays
from openswim.transport.view.viewer import Viewer

CELL_M = 100.0
SUN = toward(240.0, 45.0)


@numba.njit(error_model="numpy")
def _looked_up(detail, blur_m, place, share):
    """Noise, factor on the extinction and slope at places (n, 3) of a share (n,)."""
    out = np.zeros((3, place.shape[0]))
    scratch = np.zeros(SCRATCH, np.float32)
    edge = seen_octaves(detail, blur_m, scratch)
    for n in range(place.shape[0]):
        place_octaves(detail, blur_m, place[n, 0], place[n, 1], place[n, 2], 0.0, 0.0, 0.0, scratch)
        found = noise_at(detail, np.float32(0.0), scratch)
        out[0, n] = lane(found, 0)
        out[1, n] = thickened(lane(found, 0), edge, np.float32(share[n]), detail.quantile)
        out[2, n] = lane(found, 1) + lane(found, 2) + lane(found, 3)
    return out


@numba.njit(error_model="numpy")
def _brightness(slope, depth):
    out = np.zeros(slope.size)
    for n in range(slope.size):
        out[n] = sunward(np.float32(slope[n]), np.float32(depth))
    return out


@numba.njit
def _normal_share(x):
    return normal_share(np.float32(x))


def detail() -> Detail:
    return detail_of(np.full((4, 4, 4), 0.03, np.float32), np.ones(1, np.float32), CELL_M, SUN)


def anywhere(count: int) -> np.ndarray:
    return np.random.default_rng(5).uniform(-3e5, 3e5, (count, 3))


def test_normal_distribution() -> None:
    from scipy.special import ndtr

    for x in np.linspace(-5, 5, 41):
        assert _normal_share(x) == pytest.approx(ndtr(x), abs=3e-4)


@settings(max_examples=25, deadline=None)
@given(share=st.floats(0.02, 0.95), blur_m=st.floats(1.0, 140.0))
def test_extinction_keeps_its_mean_however_much_is_seen(share: float, blur_m: float) -> None:
    """Also times the beam, which the slope changes."""
    place = anywhere(60_000)
    _, factor, slope = _looked_up(detail(), blur_m, place, np.full(len(place), share))
    assert factor.min() >= 0
    error = factor.std() / np.sqrt(len(place))
    assert factor.mean() == pytest.approx(1, abs=0.02 + 3 * error)
    bright = _brightness(slope, 1.5)
    assert bright.min() > 0
    assert (factor * bright).mean() == pytest.approx(factor.mean(), abs=0.01 + 3 * error)


@pytest.mark.parametrize("cell_m", [100.0, 500.0, 9000.0])
def test_an_even_deck_lets_no_sky_through(cell_m: float) -> None:
    """Straight through 600 m of it hardly a place has less than a third of the mean, however wide the lumps are."""
    one = detail_of(np.full((4, 4, 4), 0.03, np.float32), np.ones(1, np.float32), cell_m, SUN)
    foot = anywhere(4000)
    depth = np.zeros(len(foot))
    for height in np.arange(0.0, 600.0, 30.0):
        place = foot + np.array([0.0, 0.0, height])
        depth += _looked_up(one, 50.0, place, np.full(len(place), 0.03 / one.in_cloud.max()))[1] / 20
    assert depth.mean() == pytest.approx(1, abs=0.0027)
    assert (depth < 1 / 3).mean() < 0.01


def test_where_nothing_is_seen_nothing_changes() -> None:
    one, place = detail(), anywhere(100)
    _, factor, slope = _looked_up(one, one.wavelength_m[0], place, np.linspace(0, 1, 100))
    np.testing.assert_array_equal(factor, 1)
    np.testing.assert_array_equal(slope, 0)


def test_noise_is_normal_and_without_direction() -> None:
    one, place = detail(), anywhere(100_000)
    noise, _, _ = _looked_up(one, 1.0, place, np.full(len(place), 0.5))
    assert noise.mean() == pytest.approx(0, abs=0.02)
    assert noise.var() == pytest.approx((one.weight**2).sum(), rel=0.02)
    structure = [np.mean((_looked_up(one, 1.0, place + step, place[:, 0])[0] - noise) ** 2) for step in 20 * np.eye(3)]
    assert np.ptp(structure) < 0.03 * np.mean(structure)
    # k^-5/3: between the shortest and the longest octave differences squared grow as distance^(2/3)
    near, far = (
        np.mean((_looked_up(one, 1.0, place + d * np.eye(3)[0], place[:, 0])[0] - noise) ** 2) for d in (12.0, 48.0)
    )
    assert np.log(far / near) / np.log(4) == pytest.approx(2 / 3, abs=0.12)


@pytest.mark.parametrize(("cells", "spread"), [(1, 0.33), (2, 0.15)])
def test_what_cells_hold_is_moved_about_within_them(cells: int, spread: float) -> None:
    """Of half full ones the mean is kept over many; over each of them, or two each way, so well."""
    one = detail()
    rng = np.random.default_rng(1)
    corner = CELL_M * rng.integers(-300, 300, (200, 3))
    place = corner[:, None] + rng.uniform(0, cells * CELL_M, (200, 2000, 3))
    factor = _looked_up(one, 10.0, place.reshape(-1, 3), np.full(400_000, 0.5))[1].reshape(200, -1)
    assert np.median(factor.std(axis=1)) > 0.5
    assert factor.mean(axis=1).std() < spread
    assert factor.mean() == pytest.approx(1, abs=0.04)


def looking(width_rad: float, step_deg: float = 1.5) -> Rays:
    azimuth, altitude = np.meshgrid(np.arange(0, 60, step_deg), np.arange(5, 60, step_deg))
    direction = np.stack([toward(a, h) for a, h in zip(azimuth.ravel(), altitude.ravel(), strict=True)])
    return Rays(np.array([0.0, 0.0, 1500.0]), direction, width_rad)


@pytest.fixture(scope="module")
def cumulus() -> Field:
    scene = demo_scene(64, 64, 48, cloud_cover=0.5)
    return Solver(tolerance=0.3).solve(scene, SUN, [WAVELENGTH_NM])


def without(field: Field, rays: Rays) -> np.ndarray:
    """The same rays as if they were of no width, which sees the grid as it is."""
    return field.view(Rays(rays.origin_m, rays.direction)).radiance


def test_near_clouds_have_detail_and_keep_their_light(cumulus: Field) -> None:
    rays = looking(2e-3, 0.4)
    plain, seen = without(cumulus, rays), cumulus.view(rays).radiance
    assert (seen >= 0).all()
    assert np.abs(seen / plain - 1).std() > 0.03
    assert seen.mean() == pytest.approx(plain.mean(), rel=0.02)


def test_wide_rays_see_the_grid_as_it_is(cumulus: Field) -> None:
    wide = widest_m(1.4 * CELL_M) / 600.0  # at the nearest cloud
    rays = looking(wide)
    np.testing.assert_array_equal(cumulus.view(rays).radiance, without(cumulus, rays))
    assert not np.array_equal(cumulus.view(looking(0.05 * wide)).radiance, without(cumulus, rays))


def test_rays_know_how_wide_they_have_become(cumulus: Field) -> None:
    """Begun on their way with the width that they have there, they see the same."""
    rays = looking(2e-3, 6.0)
    pack = Viewer.of(cumulus.lit[0], rays, None).grid
    world = pack.lit.sun, pack.table, pack.sky, pack.volume, 1.0
    o, d, n = rays.origins(), rays.directions(), len(rays)
    whole = march_rays(o, d, *world, cone=np.tile([0.0, 2e-3], (n, 1)), detail=pack.detail)
    later = march_rays(o - 400.0 * d, d, *world, cone=np.tile([-400.0 * 2e-3, 2e-3], (n, 1)), detail=pack.detail)
    clear = march_rays(o - 400.0 * d, d, *world, ends=np.full(n, -400.0)).scaled
    bright = whole.full[:, 0] < 0.98
    off = (later.scaled / clear)[bright] - whole.scaled[bright]
    assert np.sqrt((off**2).mean()) < 4e-4  # measured 3.1e-4; parts of steps end elsewhere
    assert np.abs(off).max() < 0.0022  # one ray in a hundred .0017


def test_forward_peaks_have_the_detail_that_their_cloud_has(cumulus: Field) -> None:
    """What a ray meets more, or less, of cloud liquid fades its forward peaks as liquid does, 1 : 1 - f: within 1.3 %
    (root mean square) and 5.2 % at worst, since other steps meet a little more or less of the air, too."""
    rays = looking(2e-3)
    pack = Viewer.of(cumulus.lit[0], rays, None).grid
    world = pack.lit.sun, pack.table, pack.sky, pack.volume, 1.0
    seen, plain = (
        march_rays(rays.origins(), rays.directions(), *world, cone=np.tile([0.0, width], (len(rays), 1)),
                   detail=pack.detail)
        for width in (2e-3, 1.0)
    )  # fmt: skip
    scaled, full = (
        -np.log(np.maximum([getattr(m, name)[:, 0] for m in (seen, plain)], 1e-30)) for name in ("scaled", "full")
    )
    moved = (np.abs(scaled[0] - scaled[1]) > 0.1) & (scaled.max(axis=0) < 3)
    assert moved.sum() > 50
    liquid = int(np.argmax(pack.detail.refined))
    share = 1.0 + np.ravel(pack.volume.forward)[liquid * PACK] / np.ravel(pack.volume.scaled)[liquid * PACK]
    off = (full[0] - full[1])[moved] / (share * (scaled[0] - scaled[1])[moved]) - 1
    assert np.sqrt((off**2).mean()) < 0.016
    assert np.abs(off).max() < 0.06


def test_rays_do_not_know_of_each_other_nor_of_threads(cumulus: Field) -> None:
    rays = looking(2e-3)
    together = cumulus.view(rays).radiance
    order = np.random.default_rng(0).permutation(len(rays))
    np.testing.assert_array_equal(cumulus.view(rays[order]).radiance, together[order])
    threads = numba.get_num_threads()
    try:
        numba.set_num_threads(1)
        np.testing.assert_array_equal(cumulus.view(rays).radiance, together)
    finally:
        numba.set_num_threads(threads)


def test_switched_off(cumulus: Field) -> None:
    rays = looking(2e-3)
    plain = without(cumulus, rays)
    without_detail = changed(cumulus, options=Solver(tolerance=0.3, detail=False))
    np.testing.assert_array_equal(without_detail.view(rays).radiance, plain)


@pytest.mark.parametrize("kind", ["other", "liquid"])
def test_extinction_that_is_given_stays_as_given(kind: str) -> None:
    z, y, x = np.mgrid[0:16, 0:20, 0:20]
    cloud = 0.02 * np.exp(-((x - 10) ** 2 + (y - 9) ** 2) / 12 - (z - 9) ** 2 / 6)
    scene = grid_scene(cloud.astype(np.float32), (16, 20, 20), curved=True, air=True, kind=kind)
    field = Solver().solve(scene, SUN, [WAVELENGTH_NM])
    rays = Rays(np.array([120.0, -80.0, 2.0]), looking(0.0).directions(), 1e-3)
    np.testing.assert_array_equal(field.view(rays).radiance, without(field, rays))


def test_there_are_no_stripes_aslant() -> None:
    """Through an even slab of cells of 30 km, 12 degrees above the horizon, invented brightness changes steadily from
    row to row: where a ray's steps begin leaves no lines."""
    shape = (24, 8, 8)
    cloud = {"liquid_content": box(shape, (slice(8, 20), slice(0, 8), slice(0, 8)), 2e-5)}
    scene = grid_scene({}, shape, (30_000.0, 30_000.0, 250.0), curved=True, air=True, fields=cloud)
    field = Solver(tolerance=0.3).solve(scene, SUN, [WAVELENGTH_NM])
    wide = 6e-4
    azimuth, altitude = np.meshgrid(80 + np.degrees(wide) * np.arange(120), 12 + np.degrees(wide) * np.arange(120))
    direction = np.stack([toward(a, h) for a, h in zip(azimuth.ravel(), altitude.ravel(), strict=True)])
    rays = Rays(np.array([0.0, 0.0, 2.0]), direction, wide)
    change = np.log(field.view(rays).radiance / without(field, rays)).reshape(120, 120)
    assert change.std() > 0.03
    assert np.abs(np.diff(change, 2, axis=0)).mean() < 0.00066  # of parts that began where steps do 0.0023
