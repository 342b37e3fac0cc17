"""Very large domains: columns against layers of many streams, energy, Monte Carlo; parts without seams."""

from __future__ import annotations

import numpy as np
import pytest
from tests.transport.scenes import LAT, LON, WAVELENGTH_NM, grid_scene, slab

from openswim.cameras import Rays
from openswim.errors import UserError
from openswim.scene import Scene
from openswim.scene.frame import scene_frame
from openswim.solver import Solver
from openswim.transport import tiled as large
from openswim.transport.air.shells import no_volume
from openswim.transport.medium.levels import large_levels
from openswim.transport.medium.tiles import Window, spread_on_levels
from openswim.transport.tiled import LargeViewer

EYE_M = 3.6e7
CELL_M = (3000.0, 3000.0, 400.0)


@pytest.fixture(autouse=True)
def _every_domain_is_large(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("openswim.transport.medium.plan.LARGE_COLUMNS", 0)


def _sun(zenith_deg: float, azimuth_deg: float = 120.0) -> np.ndarray:
    z, a = np.radians([zenith_deg, azimuth_deg])
    return np.array([np.sin(z) * np.sin(a), np.sin(z) * np.cos(a), np.cos(z)])


def _rays(scene: Scene, nx: int, ny: int, south_deg: float = 0.0) -> Rays:
    """From a point in space to as many places at 4 km height, spread over the domain but for its edge."""
    frame, grid = scene_frame(scene), scene.grid
    assert grid is not None
    _, rows, columns = grid.shape
    i, j = np.meshgrid(np.linspace(4, columns - 5, nx), np.linspace(4, rows - 5, ny))
    lon, lat = grid.lonlat(i.ravel(), j.ravel())
    eye = frame.position(frame.lat - south_deg, frame.lon, EYE_M)
    way = frame.position(lat, lon, 4000.0) - eye
    return Rays(eye, way / np.linalg.norm(way, axis=-1, keepdims=True), 1e-4)


def _clouds(ny: int, nx: int, nz: int = 24) -> np.ndarray:
    """Smooth heaps, decks and towers some cells wide (nz, ny, nx), 1/m."""
    rng = np.random.default_rng(8)
    z, y, x = np.mgrid[0:nz, 0:ny, 0:nx]
    field = np.zeros((nz, ny, nx))
    for _ in range(ny * nx // 130):
        cz, cy, cx = rng.uniform(4, 18), rng.uniform(0, ny), rng.uniform(0, nx)
        wide, tall = rng.uniform(3, 7), rng.uniform(1.0, 3.0)
        field += rng.uniform(0.001, 0.006) * np.exp(
            -(((z - cz) / tall) ** 2) - ((y - cy) ** 2 + (x - cx) ** 2) / wide**2
        )
    field[field < 3e-4] = 0
    return field.astype(np.float32)


@pytest.fixture(scope="module")
def clouds() -> Scene:
    return grid_scene(_clouds(64, 96), (24, 64, 96), CELL_M, curved=True, air=True, surface_albedo=0.1)


@pytest.mark.parametrize("finest_m", [50.0, 300.0])
@pytest.mark.parametrize("tau", [0.5, 4.0, 25.0])
@pytest.mark.parametrize("zenith_deg", [20.0, 65.0])
def test_even_cloud_as_layers_of_many_streams(
    tau: float, zenith_deg: float, finest_m: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A deck two cells thick, seen straight down and aslant: 32 streams and their modes tell how bright.

    Five harmonics are 1-3 % off, 6.6 % at worst (back toward a high sun); thick cells no more than thin ones.
    """
    monkeypatch.setattr("openswim.transport.medium.levels._FINEST_M", 50.0)
    monkeypatch.setattr("openswim.transport.medium.levels._COARSEST_M", finest_m)
    sun = _sun(zenith_deg)
    field = np.zeros((6, 24, 24), np.float32)
    field[2:4] = tau / 800.0  # linear to nothing at both sides: two cells' worth in all
    ours = grid_scene(field, (6, 24, 24), CELL_M, curved=True, surface_albedo=0.2)
    truth = slab(tau, albedo=0.2)
    field, truth_field = (Solver().solve(scene, sun, [WAVELENGTH_NM]) for scene in (ours, truth))
    for south_deg in (0.0, 35.0):
        rays = _rays(ours, 3, 3, south_deg)
        seen = field.view(rays).radiance[4, 0]
        down = rays.directions()[4]
        place = np.array([1000.0, 1000.0, 1000.0]) - 3000.0 * down
        expected = truth_field.view(Rays(place, down)).radiance[0, 0]
        assert seen == pytest.approx(expected, rel=0.07)


@pytest.mark.parametrize("zenith_deg", [30.0, 77.0])
def test_clear_air_looks_as_outside_the_domain(zenith_deg: float) -> None:
    """Over black ground, where nothing else shines: there is no frame to see. Between the shells' suns their light is
    linear, that of columns is not."""
    field = np.zeros((30, 24, 24), np.float32)
    field[25] = 1e-9
    scene = grid_scene(field, (30, 24, 24), (3000.0, 3000.0, 500.0), curved=True, air=True)
    clear = Scene.clear(LAT, LON, surface_albedo=0.0)
    fields = [Solver().solve(one, _sun(zenith_deg), [615.0, 450.0]) for one in (scene, clear)]
    for south_deg in (0.0, 35.0):
        rays = _rays(scene, 3, 3, south_deg)
        seen, expected = (field.view(rays).radiance[4] for field in fields)
        np.testing.assert_allclose(seen, expected, rtol=0.007)


@pytest.mark.parametrize("height_m", [-300.0, 1500.0])
def test_high_and_low_ground_looks_as_outside_the_domain(height_m: float) -> None:
    """A plateau, or land below the sea, in air that is the thinner the higher it ends; ground is seen at its height."""
    field = np.zeros((30, 24, 24), np.float32)
    field[25] = 1e-9
    terrain = np.full((24, 24), height_m)
    scene = grid_scene(field, (30, 24, 24), (3000.0, 3000.0, 500.0), curved=True, air=True, surface_albedo=0.3,
                       terrain_m=terrain)  # fmt: skip
    clear = Scene.clear(LAT, LON, surface_albedo=0.3, terrain_m=height_m)
    rays = _rays(scene, 3, 3, 35.0)
    seen, expected = (Solver().solve(one, _sun(40.0), [615.0, 450.0]).view(rays) for one in (scene, clear))
    np.testing.assert_allclose(seen.radiance[4], expected.radiance[4], rtol=1.9e-3)
    assert scene_frame(scene).latlon(seen.position)[2] == pytest.approx(height_m, abs=0.04)


def test_no_light_is_lost() -> None:
    """What comes in goes out at the top or into the ground, where columns are alike and nothing absorbs."""
    for tau, zenith_deg in ((1.0, 30.0), (60.0, 70.0)):
        field = np.zeros((6, 24, 24), np.float32)
        field[2:4] = tau / 800.0
        scene = grid_scene(field, (6, 24, 24), CELL_M, curved=True, surface_albedo=0.3)
        up, down = _fluxes(scene, zenith_deg)
        assert up + 0.7 * down == pytest.approx(np.cos(np.radians(zenith_deg)), rel=0.00019)


def _fluxes(scene: Scene, zenith_deg: float) -> tuple[float, float]:
    """Up at the top and down at the ground, in the middle of a domain."""
    pack = Solver().solve(scene, _sun(zenith_deg), [WAVELENGTH_NM]).packs[0]
    assert isinstance(pack, large.LitDomain)
    part = pack.part(Window(0, 24, 0, 24))
    middle = (slice(10, 14), slice(10, 14))
    down = part.lighting.direct_horizontal(0)[middle] + part.lighting.diffuse[0][middle]
    return float(part.lighting.up_top[0][middle].mean()), float(down.mean())


def test_parts_leave_no_seam(clouds: Scene, monkeypatch: pytest.MonkeyPatch) -> None:
    rays, sun = _rays(clouds, 88, 56, 30.0), _sun(55.0)
    seen = []
    for columns in (10**6, 300):
        monkeypatch.setattr(large, "_PART_COLUMNS", columns)
        field = Solver().solve(clouds, sun, [WAVELENGTH_NM])
        assert len(list(LargeViewer(field.packs[0])._parts(rays))) == (1 if columns > 300 else 24)
        seen.append(field.view(rays))
    # rays set their steps by the cloud around them, as far as the part reaches
    np.testing.assert_allclose(seen[1].radiance, seen[0].radiance, rtol=6e-3)
    assert np.abs(seen[1].radiance - seen[0].radiance).mean() < 3e-4 * seen[0].radiance.mean()
    np.testing.assert_array_equal(seen[1].hit, seen[0].hit)


def test_parts_stay_small_and_show_every_ray_once(clouds: Scene, monkeypatch: pytest.MonkeyPatch) -> None:
    """Memory is that of a part, also when the sun is level."""
    monkeypatch.setattr(large, "_PART_COLUMNS", 300)
    monkeypatch.setattr(large, "_MOST_SLANT", 20)
    rays = _rays(clouds, 40, 30)
    for zenith_deg in (10.0, 89.5, 95.0):
        parts = list(LargeViewer(Solver().solve(clouds, _sun(zenith_deg), [WAVELENGTH_NM]).packs[0])._parts(rays))
        sizes = [(w.east - w.west) * (w.north - w.south) for w, _ in parts]
        assert max(sizes) <= (18 + 2 * 20) ** 2
        assert max(sizes) < 1.7 * 300 or zenith_deg > 80
        np.testing.assert_array_equal(np.sort(np.concatenate([which for _, which in parts])), np.arange(len(rays)))


@pytest.mark.slow
def test_clouds_by_monte_carlo(clouds: Scene) -> None:
    """Clouds some cells wide: measured +1 % bias, 1.5 % RMSE."""
    rays, sun = _rays(clouds, 22, 14, 20.0), _sun(50.0)
    seen = Solver().solve(clouds, sun, [WAVELENGTH_NM]).view(rays).radiance[:, 0]
    truth = Solver("reference", paths=600).solve(clouds, sun, [WAVELENGTH_NM]).view(rays)
    expected, sigma = truth.radiance[:, 0], truth.sigma[:, 0]
    noise = np.sqrt((sigma**2).mean())
    error = np.sqrt(max(((seen - expected) ** 2).mean() - noise**2, 0)) / expected.mean()
    assert seen.mean() == pytest.approx(expected.mean(), rel=0.011)
    assert error < 0.06


def test_cloud_that_covers_part_of_its_cells_reflects_as_much_of_them() -> None:
    content, share = np.zeros((6, 24, 24), np.float32), 0.25
    content[2:4] = 8e-5
    up = {}
    cases = {"clear": (1.0, 0.0), "full": (1.0, 1.0), "within": (1.0, 1 / share), "part": (share, 1.0)}
    for name, (cover, inside) in cases.items():
        fields = {"liquid_content": inside * content}
        if name != "full":
            fields["cloud_area_fraction"] = np.full_like(content, cover)
        scene = grid_scene({}, (6, 24, 24), CELL_M, curved=True, surface_albedo=0.05, fields=fields)
        up[name] = _fluxes(scene, 50.0)[0]
    mixed = share * up["within"] + (1 - share) * up["clear"]
    assert mixed < 0.6 * up["full"]
    assert up["part"] == pytest.approx(mixed, rel=0.091)  # two streams tell the share, less for uneven water


def test_swim_is_seen_in_parts_too(clouds: Scene, monkeypatch: pytest.MonkeyPatch) -> None:
    rays, sun = _rays(clouds, 12, 8), _sun(40.0)
    monkeypatch.setattr(large, "_PART_COLUMNS", 1500)
    parts = Solver("swim").solve(clouds, sun, [WAVELENGTH_NM])
    seen = parts.view(rays).radiance
    assert parts.lit[0].volume.fields.size == no_volume().fields.size  # nothing of the parts is kept
    monkeypatch.setattr("openswim.transport.medium.plan.LARGE_COLUMNS", 10**6)
    whole = Solver("swim").solve(clouds, sun, [WAVELENGTH_NM]).view(rays).radiance
    assert np.sqrt(((seen - whole) ** 2).mean()) < 0.15 * whole.mean()  # levels differ


def test_an_eye_below_space_is_told_what_to_do(clouds: Scene) -> None:
    field = Solver().solve(clouds, _sun(40.0), [WAVELENGTH_NM])
    with pytest.raises(UserError, match="around"):
        field.view(Rays(np.array([0.0, 0.0, 10.0]), np.array([[0.0, 0.0, 1.0]])))


@pytest.mark.parametrize("count", [9, 40, 100])
def test_columns_hold_what_they_held(count: int) -> None:
    rng = np.random.default_rng(2)
    heights = np.cumsum(rng.uniform(50, 700, (30, 5, 7)), axis=0).astype(np.float32)
    values = rng.uniform(0, 1, heights.shape).astype(np.float32)
    values[-1], values[rng.random(values.shape) < 0.5] = 0, 0
    levels = np.linspace(0.0, float(heights.max()), count)
    out = spread_on_levels(values, heights, levels)
    held = np.trapezoid(values, heights, axis=0) + values[0] * heights[0]  # the lowest value down to the ground
    np.testing.assert_allclose(np.trapezoid(out, levels, axis=0), held, rtol=1e-4)


def test_levels_are_no_closer_than_wide_cells_need() -> None:
    heights = np.cumsum(np.geomspace(20, 900, 40))
    levels = large_levels(heights, np.zeros((4, 4), np.float32), 3000.0, 12_000.0)
    assert levels[0] == pytest.approx(0.0)
    assert levels[-1] == pytest.approx(12_000.0)
    assert np.diff(levels).min() > 250
    assert len(large_levels(heights, np.zeros((4, 4), np.float32), 500.0, 12_000.0)) > len(levels)
