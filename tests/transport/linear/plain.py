"""A linear core from a plain description: a flat grid under an even sky, without air around it."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from openswim.scene.rays import Rays
from openswim.transport.engine.ordinates import lebedev
from openswim.transport.linear.operator import LinearCore
from openswim.transport.linear.optics import Scatterer
from openswim.transport.linear.rays import View, view_of, ways_of
from openswim.transport.linear.world import World

F64 = NDArray[np.float64]


def plain_world(
    levels_m: ArrayLike, cell_m: tuple[float, float], columns: tuple[int, int], sun: ArrayLike, terms: int = 1,
    sky: float = 0.0, below: float = 0.0,
) -> World:  # fmt: skip
    """A flat grid of columns (ny, nx) whose first node lies at x = y = 0; sun (x, y, z): toward it.

    sky: L' that enters from above, at the top and the sides, below: at the sides from below.
    """
    levels, (ny, nx) = np.asarray(levels_m, float), columns
    rule = lebedev(50)
    y, x = np.meshgrid(cell_m[1] * np.arange(ny), cell_m[0] * np.arange(nx), indexing="ij")
    place = np.stack([x, y, 0 * x], axis=-1).astype(float)
    axes = np.broadcast_to(np.eye(3), (ny, nx, 3, 3)).copy()
    order = np.argsort(rule.direction[:, 2] < -1e-9, kind="stable")
    enters = np.where(rule.direction[order, 2] >= -1e-9, sky, below)
    inflow = np.repeat(np.repeat(enters[None, :, None], len(levels), axis=2), terms, axis=0)
    return World(
        levels, cell_m, axes, place, np.asarray(sun, float), np.zeros((ny, nx), np.int64), rule, 5,
        np.ascontiguousarray(inflow), np.zeros((terms, len(levels))),
    )  # fmt: skip


def locate_in(world: World) -> Callable[[F64], tuple[F64, F64, F64]]:
    """Height, and fractional row and column of places (n, 3) in a flat world."""
    x0, y0 = world.place[0, 0, :2]

    def locate(places: F64) -> tuple[F64, F64, F64]:
        return places[:, 2], (places[:, 1] - y0) / world.cell_m[1], (places[:, 0] - x0) / world.cell_m[0]

    return locate


def plain_view(world: World, rays: Rays, back: float) -> View:
    """Rays in a flat world, before ``back`` where they do not end on its ground."""
    ways = ways_of(world, rays, locate_in(world), lambda row, _: np.full_like(row, world.levels_m[0]),
                   world.levels_m[-1], 1.0)  # fmt: skip
    shape = (len(world.inflow), len(rays))
    return view_of(world, rays, ways, np.zeros(shape), np.ones(shape), np.full(shape, back))


def plain_core(
    levels_m: ArrayLike, cell_m: tuple[float, float], columns: tuple[int, int], sun: ArrayLike,
    scatterers: Sequence[Scatterer], views: Sequence[Rays] = (), points: ArrayLike | None = None, *, sky: float = 0.0,
    below: float = 0.0, **settings: Any,
) -> LinearCore:  # fmt: skip
    """`LinearCore` over flat ground; views: rays in metres, see `plain_world`; points (n, 2): row and column."""
    terms = len(np.atleast_1d(scatterers[0].single_scattering_albedo))
    world = plain_world(levels_m, cell_m, columns, sun, terms, sky, below)
    eyes = [plain_view(world, rays, sky) for rays in views]
    return LinearCore(world, scatterers, eyes, None if points is None else np.asarray(points, float), **settings)
