"""The parts of the Monte Carlo solver: chances, phase functions, majorants, ground, air."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from numba import njit

from openswim.ground import SurfaceSample, bidirectional_reflectance
from openswim.ground.surface import surface_of
from openswim.optics import mie
from openswim.optics.matter import matter_of
from openswim.scene import Scene
from openswim.scene.atmosphere import Atmosphere
from openswim.scene.phase import HenyeyGreenstein, PhaseFunction, Rayleigh
from openswim.transport.montecarlo.ground import mirrored, mirrored_density, reflected, seen_ground
from openswim.transport.montecarlo.phase import (
    drawn_q,
    exponential,
    phase_place,
    phases_of,
    start_stream,
    turned,
    uniform,
    unit_circle,
)
from openswim.transport.montecarlo.track import FAR, _face_m, air_beam
from openswim.transport.montecarlo.world import BLOCK, block_majorants, build_world, empty_blocks

PHASES = [HenyeyGreenstein(0.85), HenyeyGreenstein(-0.3), Rayleigh(), mie.phase_function("liquid", 546.0)]


@njit
def _numbers(seed, ray, path, n):
    rng, out = np.zeros(1, np.uint64), np.zeros(n)
    start_stream(rng, seed, ray, path)
    for i in range(n):
        out[i] = uniform(rng)
    return out


@njit
def _depths(n):
    rng, out = np.zeros(1, np.uint64), np.zeros(n)
    start_stream(rng, 7, 8, 9)
    for i in range(n):
        out[i] = exponential(rng)
    return out


@njit
def _angles(n, nodes, value, chance, guide):
    rng, out = np.zeros(1, np.uint64), np.zeros(n)
    start_stream(rng, 1, 2, 3)
    for i in range(n):
        out[i], _ = drawn_q(uniform(rng), nodes, value, chance, guide)
    return out


@njit
def _values(q, nodes, value):
    out = np.zeros(q.size)
    for n in range(q.size):
        i, f = phase_place(q[n], nodes)
        out[n] = value[i] + f * (value[i + 1] - value[i])
    return out


@njit
def _turns(n, x, y, z, q):
    rng, out = np.zeros(1, np.uint64), np.zeros((n, 3))
    start_stream(rng, 4, 5, 6)
    for i in range(n):
        c, s = unit_circle(rng)
        out[i] = turned(x, y, z, q, c, s)
    return out


def test_numbers_are_even_and_streams_apart() -> None:
    """Mean, variance and lag correlation of 1e5 numbers, to 4 sigma; neighbouring streams do not correlate."""
    a, b, c = _numbers(0, 0, 0, 100_000), _numbers(0, 0, 1, 100_000), _numbers(0, 1, 0, 100_000)
    assert a.min() >= 0
    assert a.max() < 1
    assert abs(a.mean() - 0.5) < 4 / np.sqrt(12e5)
    assert abs(a.var() - 1 / 12) < 4 * np.sqrt(1 / 180 / 1e5)
    for x, y in ((a, b), (a, c), (b, c), (a[1:], a[:-1])):
        assert abs(np.corrcoef(x, y)[0, 1]) < 4 / np.sqrt(1e5)


def test_depths_are_exponential() -> None:
    """Counts of a million in 60 bins of equal chance, and in the tail beyond the ziggurat's layers, to 4 sigma."""
    n = 1_000_000
    x = _depths(n)
    counts, _ = np.histogram(np.exp(-x), np.linspace(0, 1, 61))
    assert ((counts - n / 60) ** 2 / (n / 60)).sum() < 59 + 4 * np.sqrt(118)
    tail = x[x > 7.7]
    assert abs(len(tail) - n * np.exp(-7.7)) < 4 * np.sqrt(n * np.exp(-7.7))
    assert abs(tail.mean() - 8.7) < 4 / np.sqrt(len(tail))


@pytest.mark.parametrize("phase", PHASES, ids=["hg", "backward", "rayleigh", "mie"])
def test_phase_tables_are_the_functions(phase: PhaseFunction) -> None:
    tables = phases_of([[phase]], [[phase]])
    q = 2 * np.linspace(0, 1, 4001)[1:-1] ** 3
    np.testing.assert_allclose(_values(q, tables.q, tables.value[0]), phase.value(1 - q), rtol=4e-3)


@pytest.mark.parametrize("phase", PHASES, ids=["hg", "backward", "rayleigh", "mie"])
def test_angles_are_drawn_from_the_phase_function(phase: PhaseFunction) -> None:
    """Counts in 40 bins of equal chance: chi^2 of 39 within its 4-sigma range; and the asymmetry."""
    tables = phases_of([[phase]], [[phase]])
    n = 100_000
    q = _angles(n, tables.q, tables.value[0], tables.chance[0], tables.guide[0])
    edges = np.interp(np.linspace(0, 1, 41), tables.chance[0], tables.q)
    counts, _ = np.histogram(q, edges)
    # an edge between nodes is placed linearly, the density is not quite even there
    assert ((counts - n / 40) ** 2 / (n / 40)).sum() < 39 + 4 * np.sqrt(78) + 10
    assert 1 - q.mean() == pytest.approx(phase.asymmetry, abs=4 * q.std() / np.sqrt(n) + 2e-4)


@pytest.mark.parametrize("axis", [(0, 0, 1.0), (0, 0, -1.0), (0.6, 0.0, -0.8), (0.48, -0.64, 0.6)])
def test_turns_keep_the_angle_and_go_round(axis: tuple[float, float, float]) -> None:
    out = _turns(4000, *map(float, axis), 0.3)
    np.testing.assert_allclose(out @ np.array(axis), 0.7, atol=1e-12)
    np.testing.assert_allclose(np.linalg.norm(out, axis=1), 1.0, atol=1e-12)
    across = out - 0.7 * np.array(axis)
    assert np.linalg.norm(across.mean(axis=0)) < 4 / np.sqrt(4000)


@pytest.mark.parametrize("beyond", [0, 1])
@pytest.mark.parametrize("periodic", [True, False])
def test_majorants_hold_the_cells_of_their_blocks(periodic: bool, beyond: int) -> None:
    """And those beyond their faces that are asked for; no more than these, but for rounding."""
    field = np.random.default_rng(1).random((11, 10, 9)).astype(np.float32) ** 8
    bound = block_majorants(field, periodic, beyond)
    truth = np.zeros_like(bound)
    cells = np.array(field.shape) - 1 + np.array([0, periodic, periodic])
    for block in np.ndindex(bound.shape):
        first = np.array(block) * BLOCK
        ranges = [range(a - beyond, min(a + BLOCK, n) + 1 + beyond) for a, n in zip(first, cells, strict=True)]
        for place in itertools.product(*ranges):
            k, j, i = (p % n if periodic and axis else p for axis, (p, n) in enumerate(zip(place, cells, strict=True)))
            if 0 <= k < field.shape[0] and 0 <= j < field.shape[1] and 0 <= i < field.shape[2]:
                truth[block] = max(truth[block], field[k, j, i])
    assert (bound >= truth).all()
    np.testing.assert_allclose(bound, truth, rtol=2e-5)


@pytest.mark.parametrize("periodic", [True, False])
def test_jumps_end_before_cloud(periodic: bool) -> None:
    """No block of the cubes around has cloud; larger ones have."""
    full = np.random.default_rng(2).random((9, 8, 7)) < 0.01
    free = empty_blocks(full.astype(np.float32), periodic)
    assert (free > 1).mean() > 0.2

    def cloud(place: tuple[int, ...], n: int) -> bool:
        index = [p + np.arange(-n, n + 1) for p in place]
        for axis, size in enumerate(full.shape):
            keep = (index[axis] >= 0) & (index[axis] < size)
            index[axis] = index[axis] % size if periodic and axis > 0 else index[axis][keep]
        return bool(full[np.ix_(*index)].any())

    for place in np.ndindex(full.shape):
        if not full[place]:
            assert not cloud(place, int(free[place]))
            assert cloud(place, int(free[place]) + 1)
    assert (free[full] == 0).all()
    assert (empty_blocks(np.zeros_like(free), periodic) > 9).all()


@njit
def _faces_passed(x: float, per: float, cells: int, most: int) -> int:
    """Steps of a ray of ``per`` metres a cell from index x until it is out of ``cells``, or 1e6 m are behind."""
    gone, n = 0.0, 0
    while n < most and gone < 1e6 and 0.0 <= x <= cells:
        block = min(int(x) // BLOCK, (cells - 1) // BLOCK)
        step = _face_m(x, per, block, np.int64(0), cells) + 0.01
        gone, n = gone + step, n + 1
        x += step / per
    return n


@pytest.mark.parametrize("per", [-1e17, 1e17, -1e9, 1e6, -3000.0, 3000.0, FAR])
@pytest.mark.parametrize("x", [64.0, 63.9999999, 61.5])
def test_rays_that_keep_to_a_face_do_not_stop_at_it(x: float, per: float) -> None:
    """As those along a meridian, which rounding keeps on it: hundreds of kilometres went by in steps of 1 cm."""
    assert _faces_passed(x, per, 128, 1000) <= 2 * 128 / BLOCK


def _ground(n: int) -> SurfaceSample:
    rng = np.random.default_rng(3)
    return SurfaceSample(
        rng.random((n, 2)), rng.random(n), rng.random(n), np.zeros(n), 15 * rng.random(n), rng.random(n)
    )  # fmt: skip


def test_ground_reflects_as_everywhere_else() -> None:
    n, wavelengths = 200, np.array([450.0, 615.0])
    rng = np.random.default_rng(4)
    mu0, mu, azimuth = 0.02 + 0.98 * rng.random(n), 0.02 + 0.98 * rng.random(n), np.pi * rng.random(n)
    sample = _ground(n)
    truth = bidirectional_reflectance(sample, mu0, mu, azimuth, wavelengths)
    cos_angle = mu * mu0 + np.sqrt((1 - mu**2) * (1 - mu0**2)) * np.cos(azimuth)
    seen, out = seen_ground(sample, wavelengths), np.zeros((n, 2))
    for i in range(n):
        reflected(mu0[i], mu[i], cos_angle[i], i, seen, out[i])
    np.testing.assert_allclose(out, truth, rtol=2e-3, atol=1e-6)


def test_beam_through_the_air_is_the_integral() -> None:
    """Straight down the transmission is that of the column; at the horizon it follows shell by shell."""
    scene = Scene.clear(40.0, 10.0, Atmosphere.us_standard())
    for altitude in (90.0, 20.0, 1.0, -1.0):
        a = np.radians(altitude)
        sun = np.array([np.cos(a), 0.0, np.sin(a)])
        world, _, _, _ = build_world(None, matter_of(scene, 450.0), surface_of(scene, 450.0), sun)
        for height in (0.0, 137.0, 15_300.0, 41_000.0):
            beam = np.zeros(1)
            air_beam(0.0, 0.0, height, height, world, beam)
            s = np.concatenate([np.arange(0, 3e6, 50.0)])
            r = np.sqrt((world.radius_m + height) ** 2 + s**2 + 2 * s * (world.radius_m + height) * np.sin(a))
            h = r - world.radius_m
            if h.min() < 0:
                assert beam[0] == 0.0
                continue
            depth = np.trapezoid(np.interp(h, 100.0 * np.arange(1001), world.air[:, 0, 0]) * (h <= 1e5), s)
            assert beam[0] == pytest.approx(np.exp(-depth), rel=2e-3, abs=1e-6)


@njit
def _by_waves(a, n, seen, count):
    """Directions (count, 3) into which waves mirror what comes along a; others, evenly drawn, and their density."""
    rng = np.zeros(1, np.uint64)
    start_stream(rng, 5, 6, 7)
    own, even, density = np.zeros((count, 3)), np.zeros((count, 3)), np.zeros(count)
    for i in range(count):
        own[i] = mirrored(a[0], a[1], a[2], n[0], n[1], n[2], 0, seen, rng)
        z, azimuth = 2 * uniform(rng) - 1, 2 * np.pi * uniform(rng)
        sine = np.sqrt(1 - z * z)
        even[i] = sine * np.cos(azimuth), sine * np.sin(azimuth), z
        density[i] = mirrored_density(
            a[0], a[1], a[2], even[i, 0], even[i, 1], even[i, 2], n[0], n[1], n[2], 0, seen
        )
    return own, even, density


@pytest.mark.parametrize("below_deg", [10.0, 40.0, 90.0])
def test_waves_mirror_with_the_density_that_is_told(below_deg: float) -> None:
    """Above the water it has the same mean, and mean directions and squares, as what is drawn; facets that are seen
    from behind mirror nothing up."""
    one = np.ones(1)
    seen = seen_ground(SurfaceSample(0.1 * np.ones((1, 1)), one, 0 * one, 0 * one, 12 * one, one), np.array([546.0]))
    down = np.radians(below_deg)
    normal = np.array([0.05, -0.1, 1.0]) / np.linalg.norm([0.05, -0.1, 1.0])
    own, even, density = _by_waves(np.array([np.cos(down), 0.0, -np.sin(down)]), normal, seen, 600_000)
    np.testing.assert_allclose(np.linalg.norm(own, axis=-1), 1.0, atol=1e-9)
    up, told = own @ normal > 0, density * (even @ normal > 0)
    assert up.mean() > 0.6
    assert told.mean() == pytest.approx(up.mean(), abs=0.02)
    for power in (1, 2):
        drawn = (up[:, None] * own**power).mean(axis=0)
        np.testing.assert_allclose((told[:, None] * even**power).mean(axis=0), drawn, atol=0.02)
