"""The procedural demo scene: physics, statistics and absence of grid artefacts."""

from __future__ import annotations

import numpy as np
import pytest

from openswim.errors import UserError
from openswim.scene import Scene
from openswim.scene.procedural import demo_levels, demo_scene, summer_sounding
from openswim.scene.procedural.cirrus import cirrus_field
from openswim.scene.procedural.cumulus import adiabatic_content_gradient, cumulus_field
from openswim.scene.procedural.noise import blur, fractal_noise, lattice_noise, sample, spline_weights


@pytest.fixture(scope="module")
def scene() -> Scene:
    return demo_scene()


def optical_depth(scene: Scene, species: str, density: float) -> np.ndarray:
    """Column optical depth in the geometric limit, 1.5 CWC / (r_e rho), by the trapezoidal rule."""
    content = scene.data[f"{species}_content"].values.astype(float)
    extinction = 1.5 * content / (scene.data[f"{species}_effective_radius"].values * density)
    return np.trapezoid(extinction, scene.data["height"].values, axis=0)


@pytest.fixture(scope="module")
def cumulus_depth(scene: Scene) -> np.ndarray:
    return optical_depth(scene, "liquid", 1000.0)


@pytest.fixture(scope="module")
def cirrus_depth(scene: Scene) -> np.ndarray:
    return optical_depth(scene, "ice", 917.0)


def adiabatic_content(pressure: np.ndarray, temperature_base: float, height: np.ndarray) -> np.ndarray:
    """Condensed water (kg m-3) of a parcel lifted from height[0], from conserved moist static energy."""

    def saturation(t: float, p: float) -> float:
        e = 610.94 * np.exp(17.625 * (t - 273.15) / (t - 30.11))  # Alduchov and Eskridge 1996
        return 0.622 * e / (p - e)

    def latent(t: float) -> float:
        return 2.501e6 - 2361.0 * (t - 273.15)

    q0 = saturation(temperature_base, pressure[0])
    energy = 1005.0 * temperature_base + 9.81 * height[0] + latent(temperature_base) * q0
    content = []
    for p, z in zip(pressure, height, strict=True):
        low, high = 200.0, 310.0
        for _ in range(60):
            t = 0.5 * (low + high)
            too_warm = 1005.0 * t + 9.81 * z + latent(t) * saturation(t, p) > energy
            low, high = (low, t) if too_warm else (t, high)
        content.append((q0 - saturation(t, p)) * p / (287.05 * t))
    return np.array(content)


def test_adiabatic_gradient_matches_a_lifted_parcel() -> None:
    height = np.linspace(2150.0, 2350.0, 5)
    pressure, temperature = summer_sounding(height)
    gradient = adiabatic_content_gradient(float(pressure[0]), float(temperature[0]))
    content = adiabatic_content(pressure, float(temperature[0]), height)
    assert gradient == pytest.approx(content[-1] / 200.0, rel=0.04)
    assert 1.5e-6 < gradient < 2.5e-6


def test_sounding_is_hydrostatic_and_close_to_the_standard_aloft() -> None:
    height = np.arange(0.0, 15_001.0, 10.0)
    pressure, temperature = summer_sounding(height)
    density = pressure / (287.05 * temperature)
    np.testing.assert_allclose(-np.gradient(pressure, height)[1:-1], (9.80665 * density)[1:-1], rtol=2e-4)
    assert np.interp(5500.0, height, pressure) == pytest.approx(50_500.0, rel=0.05)  # US standard 1976


def test_grid_lies_on_the_sphere_where_asked(scene: Scene) -> None:
    grid = scene.grid
    assert grid is not None
    assert grid.curved
    assert grid.shape == (64, 256, 256)
    lon, lat = grid.lonlat(127.5, 127.5)
    assert (float(lon), float(lat)) == pytest.approx((11.2, 47.7), abs=1e-6)
    assert grid.spacing_m() == pytest.approx((100.0, 100.0), rel=1e-4)
    assert scene.time == np.datetime64("2026-07-10T14:00")


@pytest.mark.parametrize("nz", [40, 64, 100])
def test_levels_ascend_and_are_finest_in_cumulus(nz: int) -> None:
    height = demo_levels(nz)
    step = np.diff(height)
    assert height[0] == 400.0
    assert height[-1] == pytest.approx(12_000.0)
    assert (step > 0).all()
    assert np.interp(3000.0, height[1:], step) < 0.35 * step.max()
    assert (np.maximum(step[1:] / step[:-1], step[:-1] / step[1:]) < 2.2).all()


def test_same_seed_same_scene_other_seed_other_scene() -> None:
    one, same, other = (demo_scene(48, 40, 32, seed=seed) for seed in (3, 3, 4))
    for name in one.data:
        np.testing.assert_array_equal(one.data[name].values, same.data[name].values)
    for name in ("liquid_content", "ice_content", "surface_altitude", "surface_albedo"):
        assert not np.allclose(one.data[name].values, other.data[name].values)


@pytest.mark.parametrize("cover", [0.15, 0.35, 0.6])
def test_cloud_cover_is_what_was_asked_for(cover: float) -> None:
    depth = optical_depth(demo_scene(160, 160, 48, cloud_cover=cover), "liquid", 1000.0)
    assert (depth > 1).mean() == pytest.approx(cover, abs=0.04)


def test_liquid_is_at_most_adiabatic_and_starts_at_one_level(scene: Scene) -> None:
    height, content = scene.data["height"].values, scene.data["liquid_content"].values
    assert not content[height < 2085.0].any()  # bases undulate by 60 m about 2150 m
    assert not content[height > 4600.0].any()
    cloud = (height > 2085.0) & (height < 4600.0)
    levels = np.concatenate([[2085.0], height[cloud]])
    pressure, temperature = summer_sounding(levels)
    limit = adiabatic_content(pressure, float(temperature[0]), levels)[1:]
    assert (content[cloud].max(axis=(1, 2)) <= limit).all()
    assert 0.7e-3 < content.max() < 1.6e-3


def test_droplets_grow_with_height(scene: Scene) -> None:
    radius = scene.data["liquid_effective_radius"].values
    assert radius.min() >= 4.99e-6
    assert radius.max() <= 14.01e-6
    assert (np.diff(radius[:, 0, 0]) >= 0).all()
    assert radius[-1, 0, 0] > 2 * radius[0, 0, 0]


def test_clouds_have_fair_weather_optical_depths(cumulus_depth: np.ndarray) -> None:
    cloudy = cumulus_depth[cumulus_depth > 1]
    assert 8 < np.median(cloudy) < 40
    assert cloudy.max() < 300


def test_clouds_come_in_all_sizes_with_many_small_ones(cumulus_depth: np.ndarray) -> None:
    sizes = component_sizes(cumulus_depth > 1)
    diameter_m = 100.0 * np.sqrt(4 * sizes / np.pi)
    assert len(sizes) > 60
    assert (diameter_m < 1000.0).mean() > 0.6
    assert (diameter_m > 2500.0).sum() >= 3
    assert sizes.max() < 0.45 * sizes.sum()


def component_sizes(mask: np.ndarray) -> np.ndarray:
    """Cells in each 4-connected component, by spreading the highest label until nothing changes."""
    label = np.where(mask, np.arange(1, mask.size + 1).reshape(mask.shape), 0)
    while True:
        padded = np.pad(label, 1)
        neighbours = [padded[1:-1, :-2], padded[1:-1, 2:], padded[:-2, 1:-1], padded[2:, 1:-1]]
        spread = np.where(mask, np.maximum.reduce([label, *neighbours]), 0)
        if (spread == label).all():
            return np.unique(label[mask], return_counts=True)[1]
        label = spread


def test_cloud_edges_do_not_follow_the_grid(cumulus_depth: np.ndarray) -> None:
    opacity = 1 - np.exp(-0.1 * cumulus_depth)
    gradient_y, gradient_x = np.gradient(opacity)
    weight, angle = np.hypot(gradient_x, gradient_y), np.arctan2(gradient_y, gradient_x)
    assert abs((weight * np.exp(4j * angle)).sum()) / weight.sum() < 0.08


def test_cloud_edges_are_soft_over_more_than_a_cell(scene: Scene) -> None:
    content = scene.data["liquid_content"].values
    extinction = 1.5 * content / (scene.data["liquid_effective_radius"].values * 1000.0)
    jump = np.abs(np.diff(extinction, axis=2))
    scale = np.quantile(extinction[extinction > 1e-3], 0.9)
    assert np.quantile(jump[jump > 1e-3 * scale], 0.99) < 0.7 * scale


@pytest.mark.parametrize("name", ["liquid_content", "ice_content"])
def test_no_cloud_is_cut_off_at_the_sides(scene: Scene, name: str) -> None:
    content = scene.data[name].values
    inner = content[:, 16:-16, 16:-16].max()
    for side in (content[:, 0], content[:, -1], content[:, :, 0], content[:, :, -1]):
        assert side.max() < 0.02 * inner
    for side in (content[:, 1], content[:, -2], content[:, :, 1], content[:, :, -2]):
        assert side.max() < 0.25 * inner


def test_cirrus_is_thin_and_covers_part_of_the_sky(scene: Scene, cirrus_depth: np.ndarray) -> None:
    cloudy = cirrus_depth > 0.03
    assert 0.1 < cloudy.mean() < 0.7
    assert cirrus_depth[cloudy].mean() == pytest.approx(0.15, rel=0.08)
    assert cirrus_depth.max() <= 0.41
    height, content = scene.data["height"].values, scene.data["ice_content"].values
    assert not content[(height < 9500.0) | (height > 10_800.0)].any()
    assert 1e-6 < np.median(content[content > 1e-6]) < 1e-5
    radius = scene.data["ice_effective_radius"].values
    assert (radius.min(), radius.max()) == pytest.approx((25e-6, 40e-6), rel=1e-3)


@pytest.mark.parametrize("wind_from_deg", [180.0, 270.0])
def test_cirrus_fibres_lie_along_the_wind(wind_from_deg: float) -> None:
    axis = np.arange(160) * 100.0
    content, _ = cirrus_field(axis, axis, demo_levels(64), seed=5, wind_from_deg=wind_from_deg)
    column = content.sum(axis=0)[24:-24, 24:-24]
    along, across = (0, 1) if wind_from_deg == 180.0 else (1, 0)
    change = [float((np.diff(column, axis=axis) ** 2).mean()) for axis in (along, across)]
    assert change[1] > 5 * change[0]


def test_lake_is_flat_and_below_its_shores(scene: Scene) -> None:
    altitude, land = scene.data["surface_altitude"].values, scene.data["land_area_fraction"].values
    assert (altitude[land == 0] == 560.0).all()
    assert 0.02 < (land < 0.5).mean() < 0.1
    near = (blur((land == 0).astype(np.float32), (2.0, 2.0)) > 0.05) & (land == 1)
    assert altitude[near].min() >= 560.0
    assert altitude[near].max() < 620.0
    rows, columns = np.nonzero(land == 0)
    assert rows.mean() < 127.5  # south
    assert columns.mean() < 127.5  # west
    assert ((land > 0) & (land < 1)).any()


def test_hills_have_plausible_heights_and_slopes(scene: Scene) -> None:
    altitude = scene.data["surface_altitude"].values
    assert altitude.min() >= 500.0
    assert altitude.max() == pytest.approx(1100.0, abs=1.0)
    slope = np.degrees(np.arctan(np.hypot(*np.gradient(altitude, 100.0))))
    assert 2.0 < slope.mean() < 15.0
    assert slope.max() < 50.0


def test_land_is_green_and_dark_as_summer_land_is(scene: Scene) -> None:
    albedo, land = scene.data["surface_albedo"], scene.data["land_area_fraction"].values
    blue, green, red = (albedo.sel(wavelength=w).values[land == 1] for w in (450.0, 546.0, 615.0))
    assert 0.04 < green.mean() < 0.09
    assert green.mean() > red.mean() > blue.mean()
    assert (green > red).mean() > 0.7
    assert float(albedo.min()) > 0.005
    assert float(albedo.max()) < 0.25


def test_cumulus_avoids_the_lake_and_follows_preference() -> None:
    axis = np.arange(128) * 100.0
    west = np.where(axis < axis.mean(), 0.0, -5.0)[None, :] * np.ones((128, 1))
    content, _ = cumulus_field(axis, axis, demo_levels(48), seed=1, cover=0.2, preference=west)
    mass = content.sum(axis=(0, 1))
    assert mass[:64].sum() > 5 * mass[64:].sum()


def test_coarse_and_fine_spacing_give_clouds_too() -> None:
    for spacing_m in (40.0, 500.0):
        depth = optical_depth(demo_scene(64, 80, 40, spacing_m=spacing_m), "liquid", 1000.0)
        assert 0.2 < (depth > 1).mean() < 0.5


@pytest.mark.parametrize(
    "arguments", [{"nx": 8}, {"nz": 4}, {"spacing_m": 1e4}, {"cloud_cover": 0.0}, {"cloud_cover": 1.2}]
)
def test_hopeless_requests_are_refused(arguments: dict[str, float]) -> None:
    with pytest.raises(UserError, match="demo scene"):
        demo_scene(**arguments)  # type: ignore[arg-type]


def test_spline_weights_reproduce_lines() -> None:
    coordinate = np.linspace(30.0, 900.0, 57)
    weights = spline_weights(coordinate, 110.0, 0.3)
    np.testing.assert_allclose(weights.sum(axis=1), 1.0, rtol=1e-6)
    nodes = np.arange(weights.shape[1]) - 1.0
    np.testing.assert_allclose(weights @ nodes, (coordinate - 30.0) / 110.0 + 0.3, atol=1e-5)


def test_lattice_noise_has_unit_variance_and_no_short_waves() -> None:
    axis = np.arange(400) * 50.0
    noise = lattice_noise(np.random.default_rng(2), (axis, axis), 250.0)
    assert noise.mean() == pytest.approx(0.0, abs=0.05)
    assert noise.std() == pytest.approx(1.0, abs=0.05)
    power = np.abs(np.fft.rfft(noise * np.hanning(400), axis=1)).mean(axis=0) ** 2
    frequency = np.fft.rfftfreq(400, 50.0)
    assert power[frequency > 1 / 200.0].sum() < 0.02 * power.sum()


def test_billow_has_creases_on_its_low_side() -> None:
    axis = np.arange(300) * 20.0
    field = fractal_noise(np.random.default_rng(3), (axis, axis), 400.0, 400.0, billow=True)
    curvature = field[:, 2:] - 2 * field[:, 1:-1] + field[:, :-2]
    assert curvature.max() > 3 * -curvature.min()


def test_sample_is_exact_for_multilinear_fields_and_holds_the_edge() -> None:
    z, y, x = np.meshgrid(np.arange(4.0), np.arange(5.0), np.arange(6.0), indexing="ij")
    field = (1 + 2 * z - y + 0.5 * x + 0.25 * x * y * z).astype(np.float32)
    k, j, i = 2.25, np.array([0.0, 1.5, 4.0]), np.array([4.9, 0.1, 5.0])
    expected = 1 + 2 * k - j + 0.5 * i + 0.25 * i * j * k
    np.testing.assert_allclose(sample(field, (np.full(3, k), j, i)), expected, rtol=1e-5)
    assert sample(field, (np.array([-3.0]), np.array([9.0]), np.array([2.0])))[0] == field[0, 4, 2]


def test_blur_keeps_a_constant_and_widens_a_point_by_its_deviation() -> None:
    np.testing.assert_allclose(blur(np.full((20, 30), 3.0), (2.0, 5.0)), 3.0, rtol=1e-6)
    point = np.zeros((41, 41), np.float32)
    point[20, 20] = 1.0
    spread = blur(point, (2.0, 3.0))
    distance = np.arange(41) - 20
    assert (spread.sum(axis=1) * distance**2).sum() == pytest.approx(4.0, rel=0.01)
    assert (spread.sum(axis=0) * distance**2).sum() == pytest.approx(9.0, rel=0.01)
