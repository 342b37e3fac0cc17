"""Cloud fraction: clouds cover what the model says, hold what it says, and reflect as such clouds do."""

import numpy as np
import pytest
from tests.transport.scenes import grid_scene, medium_of, slab, sun_at_zenith_angle

from openswim.solver import Solver
from openswim.transport.medium.cloud_cover import (
    broken_cloud,
    effective_share,
    octaves,
    reflecting_share,
    spread_in_cloud,
    under_cloud,
)
from openswim.transport.medium.subdivision import around_nodes

WL = np.array([615.0, 546.0, 450.0])
CELL_M, FINENESS, CELLS = 24_000.0, 32, 12
LEVELS = np.array([800.0, 1000.0, 1200.0])


def flat_places(cells: int = CELLS, fineness: int = FINENESS, cell_m: float = CELL_M) -> np.ndarray:
    axis = np.arange(cells * fineness + 1) * cell_m / fineness
    y, x = np.meshgrid(axis, axis, indexing="ij")
    return np.stack([x, y, 0 * x + 6.371e6], axis=-1)


def layer(cover: float | np.ndarray, content: float | np.ndarray = 1e-3) -> tuple[np.ndarray, np.ndarray]:
    shape = (len(LEVELS), CELLS + 1, CELLS + 1)
    return np.broadcast_to(np.float32(content), shape).copy(), np.broadcast_to(np.float32(cover), shape).copy()


def broken(
    cover: float | np.ndarray, content: float | np.ndarray = 1e-3, x_m: float = 0.0
) -> tuple[np.ndarray, np.ndarray, float]:
    field, share = layer(cover, content)
    places = flat_places() + np.array([x_m, 0.0, 0.0])
    out, left, shown = broken_cloud([field], ["liquid"], share, LEVELS, places, CELL_M, FINENESS)
    return out[0], left, shown


@pytest.mark.parametrize("cover", [0.1, 0.4, 0.8])
def test_clouds_cover_what_they_should(cover: float) -> None:
    fine, left, shown = broken(cover)
    assert shown > 0.8  # or the grid could not tell cloud from sky
    assert left.mean() == pytest.approx(cover, rel=0.06)
    # where a node is mostly cloud there is cloud, and nowhere else
    assert (left > 0.5).mean() == pytest.approx(cover, abs=0.06)
    assert fine[left > 0.9].min() > 1e-4
    assert fine[left < 0.01].max() < 0.03 * 1e-3 / cover


@pytest.mark.parametrize("cover", [0.03, 0.1, 0.4, 0.8, 1.0])
def test_water_is_kept(cover: float) -> None:
    content = 1e-3 * (1 + 0.5 * np.sin(np.arange(CELLS + 1)))  # a model's own field
    fine, _, _ = broken(cover, content)
    coarse, _ = layer(cover, content)
    kept = around_nodes(fine, FINENESS)
    np.testing.assert_allclose(kept.sum(axis=(1, 2)), coarse.sum(axis=(1, 2)), rtol=1e-3)
    if cover > 0.05:  # and in each quarter of the domain, some six cells wide
        half = CELLS // 2
        for part in (np.s_[:, :half, :half], np.s_[:, half:, half:], np.s_[:, :half, half:]):
            assert kept[part].sum() == pytest.approx(coarse[part].sum(), rel=0.12)


@pytest.mark.parametrize("wave", [4, 6])
def test_what_the_model_shows_is_still_seen(wave: int) -> None:
    """Bands four and six cells wide, which a file shows by itself, are not lost among the clouds within its cells."""
    cover = 0.45 + 0.4 * np.sin(2 * np.pi * np.arange(CELLS + 1) / wave)
    alike = []
    for x_m in 3e5 * np.arange(6):
        fine, _, _ = broken(cover, 1e-3 * cover, x_m)
        kept = around_nodes(fine, FINENESS)[:, 2:-2, 2:-2]
        alike += [np.corrcoef(row, cover[2:-2])[0, 1] for layer in kept for row in layer]
    assert np.mean(alike) ** 2 > (0.7 if wave == 4 else 0.8)  # of the variance


def test_no_cloud_where_there_is_none() -> None:
    content = np.zeros(CELLS + 1)
    content[:4] = 1e-3
    fine, _, _ = broken(0.5, content)
    assert not fine[..., 5 * FINENESS :].any()
    assert fine[..., : 3 * FINENESS].any()


def test_clouds_do_not_show_the_cells() -> None:
    """As much water on the model's nodes as between them, over a dozen skies."""
    field, cover = layer(0.4)
    phase = np.arange(CELLS * FINENESS + 1)[FINENESS:-FINENESS] % FINENESS
    near = np.minimum(phase, FINENESS - phase) < FINENESS // 4
    on, between = [], []
    for n in range(12):
        places = flat_places() + np.array([0.0, 0.0, 1e6 * n])
        fine = broken_cloud([field[:1]], ["liquid"], cover[:1], LEVELS[:1], places, CELL_M, FINENESS)[0][0, 0]
        for axis in (0, 1):
            mean = fine.mean(axis=axis)[FINENESS:-FINENESS]
            on.append(mean[near].mean())
            between.append(mean[~near].mean())
    assert np.mean(on) == pytest.approx(np.mean(between), rel=0.05)


def test_touching_layers_overlap_and_distant_ones_do_not() -> None:
    field = np.full((4, CELLS + 1, CELLS + 1), 1e-3, np.float32)
    levels = np.array([1000.0, 1200.0, 8000.0, 8200.0])
    _, left, _ = broken_cloud([field], ["ice"], np.full_like(field, 0.3), levels, flat_places(), CELL_M, FINENESS)
    cloud = left > 0.5
    both = (cloud[0] & cloud[1]).mean() / cloud[0].mean()
    far = (cloud[0] & cloud[2]).mean() / cloud[0].mean()
    assert both > 0.8
    assert far == pytest.approx(0.3, abs=0.08)  # at random: the other's cover


def test_the_same_place_has_the_same_clouds_in_every_cut() -> None:
    places = flat_places()
    field, cover = layer(0.4)
    whole = broken_cloud([field], ["liquid"], cover, LEVELS, places, CELL_M, FINENESS)[1]
    cut = slice(0, 9 * FINENESS + 1)
    part = broken_cloud(
        [field[..., :10]], ["liquid"], cover[..., :10], LEVELS, places[:, cut], CELL_M, FINENESS
    )[1]  # fmt: skip
    inner = slice(FINENESS, 5 * FINENESS)  # three cells from the side that was cut
    np.testing.assert_allclose(part[..., inner], whole[..., inner], atol=0.02)


def test_what_falls_is_as_wide_as_the_widest_cloud_above() -> None:
    np.testing.assert_array_equal(under_cloud(np.array([0.1, 0.5, 0.2, 0.3, 0.0])), [0.5, 0.5, 0.3, 0.3, 0.0])


def test_octaves_end_at_what_the_grid_shows() -> None:
    shown, share = octaves(20_000.0, 1000.0)
    assert shown == [2000.0, 4000.0, 8000.0]
    assert 0.7 < share < 1
    assert octaves(20_000.0, 20_000.0)[0] == []
    assert octaves(4000.0, 100.0) == ([500.0, 1000.0, 2000.0], 1.0)


def test_spread_of_boutle_et_al() -> None:
    """Their figure 7: about .7 in broken cloud and .25 in overcast cells of 20 km; little in a large-eddy model's."""
    half, overcast = spread_in_cloud(np.array([0.5, 1.0]), 20_000.0)
    assert half == pytest.approx(0.65, abs=0.08)
    assert overcast == pytest.approx(0.25, abs=0.05)
    assert spread_in_cloud(np.array([1.0]), 50.0)[0] < 0.05


@pytest.mark.parametrize("cover", [0.05, 0.3, 0.7, 1.0])
@pytest.mark.parametrize("depth", [0.05, 0.5, 3.0])
@pytest.mark.parametrize("spread", [0.0, 0.5, 0.8])
def test_reflects_as_its_clouds_do(cover: float, depth: float, spread: float) -> None:
    """Against the mean of x/(1 + x) over clear sky and a gamma distribution of clouds."""
    if spread:
        within = np.random.default_rng(0).gamma(1 / spread**2, spread**2 * depth / cover, 200_000)
    else:
        within = np.array([depth / cover])
    truth = cover * (within / (1 + within)).mean()
    even = depth * float(reflecting_share(np.float32(depth), np.float32(cover), spread**2))
    assert even / (1 + even) == pytest.approx(truth, rel=0.06)


def test_columns_overlap() -> None:
    """One deep cloud in many layers is as broken as in one; layers with clear air between fill each other's gaps."""
    x = np.full((4, 1, 1), 0.25, np.float32)
    deep = effective_share(x, np.full_like(x, 0.3), 1000.0, 1.0)
    single = effective_share(x[:1] * 4, np.full_like(x[:1], 0.3), 1000.0, 1.0)
    np.testing.assert_allclose(deep, single, rtol=1e-5)
    apart = np.array([0.5, 0.0, 0.5, 0.0], np.float32)[:, None, None]
    filled = effective_share(apart, np.full_like(x, 0.3), 1000.0, 1.0)
    assert single < filled < 1
    thin = np.array([0.01, 0.0, 1.0, 0.0], np.float32)[:, None, None]
    cirrus = effective_share(thin, np.array([1.0, 0.3, 0.3, 0.3], np.float32)[:, None, None], 1000.0, 1.0)
    np.testing.assert_allclose(cirrus, single, rtol=0.05)  # a veil above does not make broken cloud whole


@pytest.mark.parametrize("tau", [2.0, 10.0])
def test_a_partly_covered_slab_reflects_its_share(tau: float) -> None:
    """Independent columns: half the area bare, half a slab of twice the depth."""
    cover = 0.5
    sun = sun_at_zenith_angle(50.0)
    field = {"cloud_area_fraction": np.full((33, 3, 3), cover, np.float32)}
    ours = Solver("fast").solve(slab(tau, levels=33, kind="liquid", fields=field), sun, WL[:1]).fluxes()["up_top"][0]
    full = Solver("fast").solve(slab(tau / cover, levels=33, kind="liquid"), sun, WL[:1]).fluxes()["up_top"][0]
    even = Solver("fast").solve(slab(tau, levels=33, kind="liquid"), sun, WL[:1]).fluxes()["up_top"][0]
    assert ours == pytest.approx(cover * full, rel=0.12)  # two-stream knows the sun's height only on average
    assert abs(ours - cover * full) < 0.4 * abs(even - cover * full)


def test_a_medium_of_wide_cells_is_broken_with_any_solver() -> None:
    shape = (5, 6, 6)
    cloud = np.zeros(shape, np.float32)
    cloud[1:3] = 2e-3
    cells = (12_000.0, 12_000.0, 500.0)
    scene = grid_scene(
        cloud, shape, cells, curved=True, kind="liquid",
        fields={"cloud_area_fraction": np.full(shape, 0.4, np.float32)},
    )  # fmt: skip
    for refine in (True, False):
        medium = medium_of(scene, WL, 0.8, refine)
        assert medium.fineness >= 8
        depth = np.trapezoid(medium.extinction[0], medium.levels_m, axis=0)
        assert (depth < 0.3).mean() == pytest.approx(0.6, abs=0.15)
        again = medium_of(scene, WL, 0.8, refine)
        np.testing.assert_array_equal(again.extinction, medium.extinction)
