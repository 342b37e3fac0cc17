"""Kernels and their twins on grids of 4 x 5 x 6 nodes: {what: (of the kernel, of the twin)}.

As a program: all of them with the kernels that the environment asks for (`openswim.transport.engine.types`), and what
these say to elements beyond an array; prints how far apart kernels and twins are, as JSON.
"""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace

import numpy as np
from numba import njit
from tests.transport.twins import march as twin_march
from tests.transport.twins import sun as twin_sun
from tests.transport.twins import sweep as twin_sweep

from openswim.transport.beam.direct import direct_beam
from openswim.transport.beam.sun_sweep import inside, sun_sweep, weighted
from openswim.transport.diffuse.moments import Moments, nothing_coarser
from openswim.transport.diffuse.optical_grid import optical_grid
from openswim.transport.diffuse.ordinate_transform import BLOCK
from openswim.transport.diffuse.sweep import share_ordinates
from openswim.transport.diffuse.sweeper import Sweeper
from openswim.transport.engine.eye_ways import Eye, wide
from openswim.transport.engine.ordinates import Ordinates, double_gauss, lebedev
from openswim.transport.engine.pack import PACK, read, write
from openswim.transport.engine.scratch import Pool
from openswim.transport.engine.threads import in_threads
from openswim.transport.engine.types import BUILD, FLOAT
from openswim.transport.march.march import march_rays
from openswim.transport.march.sample import SOURCE_AZIMUTHS, SOURCE_ZENITHS
from openswim.transport.march.volume import AIR_DEGREE, DEGREE, PEAK_COSINES, Shells, Volume, blank_fields, tidy
from openswim.transport.march.walk import BATCH, COUNT, GOING, PLACE, STATE, WALK, start_walk, walk_on
from openswim.transport.medium.delta_scaled import Coefficients
from openswim.transport.medium.scatterers import Scatterers
from openswim.transport.view.source_function import FieldAt, view_source

SHAPE = NZ, NY, NX = 4, 5, 6
CELL_M = np.array([100.0, 125.0])
LEVELS_M = np.array([0.0, 100.0, 250.0, 400.0])
RADIUS_M = 6.371e6
SUN = np.array([0.5, 0.3, 0.66**0.5])
Pairs = dict[str, tuple[np.ndarray, np.ndarray]]


def _uniform(rng: np.random.Generator, low: float, high: float, *shape: int) -> np.ndarray:
    """Random numbers as the kernels get them."""
    return rng.uniform(low, high, shape).astype(FLOAT)


def _lookup() -> tuple[float, float, np.ndarray]:
    """Fractional levels by height, every metre, so that the levels are among the entries."""
    return 0.0, 1.0, np.interp(np.arange(LEVELS_M[-1] + 1), LEVELS_M, np.arange(float(NZ)))


def shells(rng: np.random.Generator) -> Shells:
    """A low atmosphere of four levels."""
    levels = np.array([0.0, 300.0, 1000.0, 3000.0])
    heights = np.arange(0.0, levels[-1] + 100, 100.0)
    horizon = -np.sqrt(levels * (2 * RADIUS_M + levels)) / (RADIUS_M + levels)
    falling = np.linspace(1, 0.1, 4)[:, None]
    phase = _uniform(rng, 0.1, 0.3, 2, AIR_DEGREE, PACK) * FLOAT(0.8) ** np.arange(AIR_DEGREE, dtype=FLOAT)[:, None]
    phase[:, 0] = 1.0
    return tidy(Shells(
        RADIUS_M, 0.0, 3000.0, np.interp(heights, levels, np.arange(4.0)), np.full(len(heights), 700.0),
        (_uniform(rng, 1e-5, 1e-4, 4, 4 * PACK) * falling).astype(FLOAT), phase,
        (_uniform(rng, 0.1, 0.2, 4, 7, 2 * PACK) * falling[..., None]).astype(FLOAT), horizon,
        np.interp(np.linspace(-1, 1, 41), [0.0, 0.6, 1.0], np.arange(3.0)), np.zeros((1, 3, 1, PACK), FLOAT),
        _uniform(rng, 1e-5, 2e-5, 4, 3, SOURCE_ZENITHS, SOURCE_AZIMUTHS, PACK), np.ones((3, PACK), FLOAT),
        np.full(PACK, 0.2, FLOAT),
    ))  # fmt: skip


def sun_sweep_pairs() -> Pairs:
    """Nodes that follow their rays, and nodes that read what a level above has found; open and periodic."""
    rng = np.random.default_rng(1)
    extinction = _uniform(rng, 5e-4, 1e-2, *SHAPE)
    out = {}
    for name, exact in (("rays", np.ones(SHAPE, bool)), ("levels", rng.uniform(size=SHAPE) < 0.3)):
        exact[0] = True  # as below any layer of cloud
        for periodic in (False, True):
            fields = weighted(extinction[None], np.ones((1, 1), FLOAT), periodic)
            sun = np.tile(SUN, (NY, NX, 1))
            depth = sun_sweep(fields, exact, sun, LEVELS_M, _lookup(), CELL_M, RADIUS_M, periodic)
            twin = twin_sun.depths_to_sun(extinction, exact, SUN, LEVELS_M, CELL_M, RADIUS_M, periodic)
            out[f"{name}, {'periodic' if periodic else 'open'}"] = inside(depth)[0], twin
    return out


def beam_pairs() -> Pairs:
    """Behind a ridge, in air and cloud, at the nodes and at the ground."""
    rng = np.random.default_rng(2)
    air = shells(rng)
    depth = weighted(_uniform(rng, 0, 3, 2, *SHAPE), np.eye(2, dtype=FLOAT), False)
    sun = rng.normal(SUN, 0.05, (NY, NX, 3))
    sun /= np.linalg.norm(sun, axis=-1, keepdims=True)
    sun[0, 0] = [1.0, 0.0, -0.001]  # setting
    terrain = _uniform(rng, 0, 150, NY, NX)
    shadow, distance = rng.uniform(-100, 300, (NY, NX)), rng.uniform(0, 3e4, (NY, NX))
    factors = np.array([[1, 0, 0.3, 1.1], [0, 1, 0.8, 0]], FLOAT)
    beams, surface = np.empty((PACK, *SHAPE), FLOAT), np.empty((PACK, NY, NX), FLOAT)
    in_threads(
        direct_beam, depth, factors, sun, LEVELS_M, terrain, shadow, distance, PACK, air, beams, surface,
        blank_fields(SHAPE, 2 * PACK),
    )  # fmt: skip
    at = (sun, LEVELS_M, shadow, distance, air)
    tau = np.einsum("nw,nkji->wkji", factors.astype(float), inside(depth))
    nodes = np.stack([twin_sun.beam(own, *at, w) for w, own in enumerate(tau)])
    return {
        "depth at nodes": (-np.log(beams), -np.log(nodes)),
        "at the ground": (surface, np.stack([
            twin_sun.beam_at_ground(own, sun, LEVELS_M, terrain, shadow, distance, air, w) for w, own in enumerate(tau)
        ])),
    }  # fmt: skip


def sweep_pairs() -> Pairs:
    """Along ordinates of which none is level, and of which some are, in grids that cloud goes on beyond, or not at two
    of the four sides."""
    out: Pairs = {}
    for of_sides, ends in (("", np.full((2, 2), False)), (", open", np.array([[True, False], [False, True]]))):
        for of_level, ordinates in (("", double_gauss(4, 9)), (", level", lebedev(14))):
            found = _sweep_pairs(ordinates, ends)
            out |= {f"{name}{of_sides}{of_level}": pair for name, pair in found.items()}
    return out


def _sweep_pairs(ordinates: Ordinates, ends: np.ndarray) -> Pairs:
    """Cloud of two species over clear air and bright ground."""
    rng = np.random.default_rng(3)
    extinction = _uniform(rng, 1e-3, 2e-2, 2, *SHAPE)
    extinction[:, :2] = 0  # where cloud is on the ground, its nodes stand for half a layer
    falling = 0.8 ** np.arange(DEGREE)
    c = Coefficients(
        np.array([0.7, 0.5], FLOAT), (np.array([[0.6], [0.4]]) * falling).astype(FLOAT), _uniform(rng, 1e-5, 1e-4, NZ),
        (_uniform(rng, 1e-5, 5e-5, NZ, 1) * falling).astype(FLOAT),
    )  # fmt: skip
    beam = _uniform(rng, 0.1, 0.9, *SHAPE)
    sunward = twin_sweep.harmonics(SUN[None], DEGREE)[0].astype(FLOAT)
    grid = optical_grid(
        extinction, np.tile(sunward[:, None], (NY, 1, NX)), LEVELS_M, CELL_M, False, ends,
        np.zeros((NY, NX), int), c, beam,
    )  # fmt: skip
    inflow = _uniform(rng, 0.1, 0.3, len(ordinates.weight), NZ)
    albedo, direct = _uniform(rng, 0.1, 0.9, NY, NX), _uniform(rng, 0.1, 0.5, NY, NX)
    sweeper = replace(Sweeper.of(grid, inflow, albedo, direct, ordinates, Pool()), amends=False)
    before = _uniform(rng, -0.1, 0.1, DEGREE**2, *SHAPE)
    before[0] += 1
    values = np.zeros((NZ * NY, DEGREE**2, BLOCK), FLOAT)
    values[..., :NX] = np.moveaxis(before, 0, 2).reshape(NZ * NY, DEGREE**2, NX)
    after = sweeper.sweep(values)[..., :NX].reshape(NZ, NY, DEGREE**2, NX)
    scattering = np.einsum("sl,skji->lkji", c.scattering.astype(float), extinction)
    scattering += c.air_scattering.T[:, :, None, None]
    new, down, up = twin_sweep.sweep(
        before.astype(float), np.tensordot(c.scaled.astype(float), extinction, 1) + c.air_extinction[:, None, None],
        scattering, beam, SUN, ordinates, inflow, albedo, direct, LEVELS_M, CELL_M, ends,
    )  # fmt: skip
    fluxes = sweeper.fluxes()
    return {
        "moments": (np.moveaxis(after, 2, 0), new), "flux down": (fluxes[0], down), "flux up": (fluxes[1], up),
    }


def source_pairs() -> Pairs:
    """Toward an eye far away, and one some kilometres off."""
    rng = np.random.default_rng(4)
    extinction = _uniform(rng, 1e-3, 2e-2, 2, *SHAPE)
    before = _uniform(rng, -0.1, 0.1, PACK, DEGREE**2, *SHAPE)
    before[:, 0] += 1
    place_of_block = np.arange(NZ * NY, dtype=np.int32).reshape(NZ, NY, 1)
    moments = []
    for w in range(PACK):
        values = np.zeros((NZ * NY, DEGREE**2, BLOCK), FLOAT)
        values[..., :NX] = np.moveaxis(before[w], 0, 2).reshape(NZ * NY, DEGREE**2, NX)
        moments.append(Moments(place_of_block, values))
    scaled, scattering = _uniform(rng, 0.5, 1, PACK, 2), _uniform(rng, 0.1, 0.5, PACK, 2, DEGREE)
    air, air_scattering = _uniform(rng, 1e-5, 1e-4, PACK, NZ), _uniform(rng, 1e-6, 1e-5, PACK, NZ, DEGREE)
    axes = np.linalg.qr(np.eye(3) + rng.normal(0, 0.05, (NY, NX, 3, 3)))[0].astype(FLOAT)
    place = rng.uniform(-300, 300, (NY, NX, 3))
    whole = wide(extinction)
    stands_for = np.arange(whole[0].size, dtype=np.int32).reshape(whole.shape[1:])  # every node for itself
    out = {}
    for name, eye, parallel in (
        ("far", np.array([0.6, -0.48, 0.64]), True), ("near", np.array([2e3, -1e3, 4e3]), False)
    ):  # fmt: skip
        fields = blank_fields(SHAPE, 2 * PACK)
        in_threads(
            view_source, Scatterers(whole, LEVELS_M, scaled, scattering, air, air_scattering), stands_for,
            FieldAt.of(moments, [nothing_coarser(DEGREE)] * PACK), Eye.of(axes, place, eye, parallel), PACK,
            np.array([(0, n) for n in SHAPE]), fields,
        )  # fmt: skip
        away = (place - eye).astype(FLOAT).astype(float)
        views = away + LEVELS_M[:, None, None, None] * axes[..., 2, :].astype(float)
        views = np.broadcast_to(eye, views.shape) if parallel else views / np.linalg.norm(views, axis=-1)[..., None]
        local = np.einsum("jiab,kjib->kjia", axes.astype(float), views)
        twins = [
            twin_sweep.source_toward_eye(
                before[w], np.tensordot(scaled[w].astype(float), extinction, 1) + air[w][:, None, None],
                np.tensordot(scattering[w].astype(float).T, extinction, 1) + air_scattering[w].T[:, :, None, None],
                local,
            )
            for w in range(PACK)
        ]  # fmt: skip
        out[name] = fields[..., PACK : 2 * PACK], np.stack(twins, axis=-1)
    return out


def volume(rng: np.random.Generator) -> Volume:
    """A square of cloud with a hole, its sources per extinction, and the beam bent within its cells."""
    fields = blank_fields(SHAPE, 2 * PACK + 5)
    fields[..., :PACK] = rng.uniform(0.3, 0.9, (*SHAPE, PACK))
    fields[..., PACK : 2 * PACK] = rng.uniform(0.1, 1, (*SHAPE, PACK))
    fields[..., 2 * PACK : 2 * PACK + 2] = rng.uniform(1e-3, 8e-3, (*SHAPE, 2))
    fields[:, :3, 2:4, 2 * PACK : 2 * PACK + 2] = 0
    fields[..., 2 * PACK + 2] = rng.uniform(0, 2, SHAPE)
    fields[..., 2 * PACK + 3] = fields[::-1, ..., 2 * PACK + 2]
    fields[..., 2 * PACK + 4] = fields[..., 2 * PACK : 2 * PACK + 2].sum(axis=-1)
    bend = _uniform(rng, -0.3, 0.5, *SHAPE, PACK)
    bend[:, :2, 2] = 0
    told = _uniform(rng, 0.8, 1, PACK)
    corner = np.array([[[0.0, 0.0], [NX - 1.0, 0.0]], [[0.0, NY - 1.0], [NX - 1.0, NY - 1.0]]])
    levels = np.append(LEVELS_M, 550.0)
    return tidy(Volume(
        -250.0, 1 / 500.0, corner, np.array([-250.0, 250.0, -250.0, 250.0]), *_lookup(), 400.0, CELL_M.astype(FLOAT),
        levels.astype(FLOAT), False, True, *PEAK_COSINES, 2, 2 * PACK + 4, np.zeros(SHAPE, np.uint32), fields,
        _uniform(rng, 0.5, 0.9, 2, PACK), _uniform(rng, 0.1, 0.4, 2, PACK), _uniform(rng, 0.1, 0.3, 2, DEGREE, PACK),
        0.5 * np.stack([told, told[::-1]]), bend, True,
        np.zeros((0, DEGREE**2, PACK), FLOAT), np.zeros((1, 1, 1), np.int32), _uniform(rng, 1e-6, 1e-4, NZ, 4 * PACK),
        _uniform(rng, 0.1, 0.3, NZ, PACK), np.zeros((NY, NX), FLOAT), np.zeros((NY, NX), FLOAT),
    ))  # fmt: skip


def _places(origin: np.ndarray, direction: np.ndarray, air: Shells, grid: Volume) -> list[np.ndarray]:
    """Where a ray looks: distance, step, then level, ix, iy or -1, height, cosine of its zenith angle."""
    w, batch, out = np.zeros(WALK), np.zeros((BATCH + 1) * PLACE), []
    start_walk(w, origin, direction, -1e30, air, grid)
    while w[STATE] == GOING:
        walk_on(w, batch, air, grid, 0.0, 1.0)
        if w[COUNT] > 0:
            out.append(batch[:PLACE].copy())
        w[COUNT] = 0.0
    return out


def march_pairs() -> Pairs:
    """From the air down through cloud to the ground, and out of the cloud toward the sun, where peaks are read out."""
    rng = np.random.default_rng(5)
    air, grid = shells(rng), volume(rng)
    table = _uniform(rng, 0.1, 3, 3, 9, 6, PACK)
    origins = np.array([[-620.0, -600.0, 1600.0], [60.0, 90.0, 10.0]])
    directions = np.array([[0.36, 0.3, -0.8], [-0.2, 0.1, 0.9]])
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    seen = march_rays(origins, directions, SUN, table, air, grid, 1.0)
    out = {}
    for n, (name, origin, direction) in enumerate(zip(("down", "sunward"), origins, directions, strict=True)):
        ray = twin_march.Ray(direction @ SUN, table, air, grid)

        def look(place, ahead, half_step, ray=ray, origin=origin):
            s, _, level, x, y = place
            if level >= 0:
                return twin_march.in_grid(x, y, level, ray, ahead, half_step, grid)
            mu_sun = (origin @ SUN + RADIUS_M * SUN[2] + s * ray.cosine) / (RADIUS_M + x)
            return twin_march.in_air(x, y, mu_sun, ray, ahead, half_step, air, SOURCE_ZENITHS, SOURCE_AZIMUTHS)

        def cloudy(place):
            _, _, level, ix, iy = place
            return level >= 0 and twin_march.between(grid.fields[..., grid.cloud_channel], level, iy, ix) > 0

        places = _places(origin, direction, air, grid)
        levels = np.array([place[2] for place in places])
        assert (levels >= 0).sum() > 6  # in the grid, beside it, and with the peaks where the sun is near
        assert (levels < 0).sum() > 2
        assert 0 < ray.share < 1 or name == "down"
        assert seen.samples[n] == len(places)
        assert seen.scaled[n].min() > 0.01
        radiance, scaled, full = twin_march.march(places, look, cloudy)
        out[f"{name}, radiance"] = seen.radiance[n], radiance
        out[f"{name}, transmission"] = seen.scaled[n], scaled
        out[f"{name}, with peaks"] = seen.full[n], full
    return out


CASES: dict[str, Callable[[], Pairs]] = {
    "sun sweep": sun_sweep_pairs, "beam": beam_pairs, "sweep": sweep_pairs, "source": source_pairs,
    "march": march_pairs,
}  # fmt: skip


def apart(pairs: Pairs) -> dict[str, float]:
    """Greatest difference of each pair, relative to the number itself or to a tenth of the greatest."""
    out = {}
    for name, (kernel, twin) in pairs.items():
        assert kernel.dtype == FLOAT
        assert kernel.shape == twin.shape
        size = np.maximum(np.abs(twin), 0.1 * np.abs(twin).max())
        out[name] = float((np.abs(kernel - twin) / size).max())
    return out


@njit
def _store(array, n, at):
    write(array, at, read(array, n))


def beyond() -> list[str]:
    """What is said to packs read, then written, before an array, beyond its end and across it."""
    said = []
    for places in ((-1, 0), (5, 0), (8, 0), (0, -1), (0, 5), (0, 8), (4, 4)):
        try:
            _store(np.zeros(8, FLOAT), *places)
        except IndexError as error:
            said.append(str(error))
    return said


if __name__ == "__main__":
    kept = share_ordinates.stats.cache_path
    far = {name: apart(pairs()) for name, pairs in CASES.items()}
    print(json.dumps({"build": BUILD, "kept": kept, "beyond": beyond(), "apart": far}))
