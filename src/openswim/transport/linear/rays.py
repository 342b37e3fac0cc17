"""Rays through the grid: where they have their places, decided once."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from openswim.scene.rays import Rays
from openswim.transport.linear.march import Sent
from openswim.transport.linear.world import World
from openswim.transport.march.volume import PEAK_COSINES

F64 = NDArray[np.float64]
I64 = NDArray[np.int64]
Locate = Callable[[F64], tuple[F64, F64, F64]]

_CLOUD_STEP = 0.75  # of a cell, as rays of `fast` step in cloud
_MOST_PLACES = 4000  # of a ray
_BISECTIONS = 40


@dataclass(frozen=True, eq=False)
class View:
    """Rays (n) of one eye: see `march.Sent`, but front, dim and back (nt, n) are those of all terms; eye (3,): its
    place, or the direction of parallel rays."""

    first: I64
    place: F64
    cosine: F64
    share: F64
    ground_hit: NDArray[np.bool_]
    front: F64
    dim: F64
    back: F64
    eye: F64
    parallel: bool

    def __len__(self) -> int:
        return len(self.cosine)

    def sent(self, term: int) -> Sent:
        """As kernels have them."""
        return Sent(
            self.first, self.place, self.cosine, self.share, self.ground_hit, self.front[term], self.dim[term],
            self.back[term],
        )  # fmt: skip


@dataclass(frozen=True, eq=False)
class Ways:
    """Where rays (n) are in the grid: from ``enter`` to ``leave`` (n,) m, equal where they pass it by."""

    first: I64
    place: F64
    enter: F64
    leave: F64
    ground_hit: NDArray[np.bool_]


def view_of(world: World, rays: Rays, ways: Ways, front: F64, dim: F64, back: F64) -> View:
    """A view whose rays go these ways."""
    direction = rays.directions()
    cosine = np.clip(direction @ (world.sun / np.linalg.norm(world.sun)), -1, 1)
    inner, outer = PEAK_COSINES
    x = np.clip((cosine - outer) / (inner - outer), 0, 1)
    parallel = rays.direction.ndim == 1 or bool(np.allclose(direction, direction[:1], atol=1e-9))
    eye = direction[0] if parallel else np.broadcast_to(rays.origin_m, direction.shape)[0]
    return View(
        ways.first, ways.place, cosine, x * x * (3 - 2 * x), ways.ground_hit, front, dim, back, np.array(eye, float),
        parallel,
    )  # fmt: skip


def ways_of(
    world: World, rays: Rays, locate: Locate, ground_m: Callable[[F64, F64], F64], finest_m: float, step: float = 1.0
) -> Ways:
    """Places of rays through a grid, `_CLOUD_STEP` times ``step`` cells apart below the height ``finest_m``, half a
    layer above it.

    locate: height, and fractional row and column (n,) of places (n, 3); ground_m: height of the ground there.
    """
    origin, direction = rays.origins(), rays.directions()
    n = len(direction)
    enter, leave, ground_hit = _within(world, origin, direction, locate, ground_m)
    at, alive = enter.copy(), leave > enter
    levels, dz = world.levels_m, np.diff(world.levels_m)
    rows: list[tuple[I64, F64]] = []
    now = np.flatnonzero(alive)
    for _ in range(_MOST_PLACES):
        height, row, column = locate(origin[now] + at[now, None] * direction[now])
        level = np.interp(height, levels, np.arange(len(levels)))
        rows.append((now, np.column_stack([level, row, column, at[now]])))
        on = at[now] < leave[now]
        now, height = now[on], height[on]
        if not now.size:
            break
        layer = dz[np.clip(np.searchsorted(levels, height, "right") - 1, 0, len(dz) - 1)]
        pace = np.where(height < finest_m, _CLOUD_STEP * step * np.minimum(layer, min(world.cell_m)), 0.5 * layer)
        left = leave[now] - at[now]
        # the last two places share what is left
        at[now] += np.where(left < 1.2 * pace, left, np.minimum(pace, 0.6 * left))
        at[now] = np.where(left < 1.2 * pace, leave[now], at[now])
    which = np.concatenate([w for w, _ in rows]) if rows else np.zeros(0, np.int64)
    places = np.concatenate([p for _, p in rows]) if rows else np.zeros((0, 4))
    order = np.argsort(which, kind="stable")
    first = np.concatenate([[0], np.cumsum(np.bincount(which, minlength=n))]).astype(np.int64)
    return Ways(first, np.ascontiguousarray(places[order]), enter, leave, ground_hit)


def _within(
    world: World, origin: F64, direction: F64, locate: Locate, ground_m: Callable[[F64, F64], F64]
) -> tuple[F64, F64, NDArray[np.bool_]]:
    """Distances at which rays enter and leave the grid, and whether they leave it into the ground."""
    _, ny, nx = world.shape
    low, top = world.levels_m[0], world.levels_m[-1]
    pace = 0.7 * min(world.cell_m)
    enter, leave = _around_grid(world, origin, direction)
    ground_hit = np.zeros(len(direction), bool)

    def state(s: F64, some: I64) -> NDArray[np.int8]:
        """0 outside, 1 in the grid, 2 below the ground."""
        height, row, column = locate(origin[some] + s[:, None] * direction[some])
        beside = (row < -1e-6) | (column < -1e-6) | (row > ny - 1 + 1e-6) | (column > nx - 1 + 1e-6)
        floor = np.maximum(ground_m(np.clip(row, 0, ny - 1), np.clip(column, 0, nx - 1)), low)
        return np.where(beside | (height > top + 1e-6), 0, np.where(height < floor, 2, 1)).astype(np.int8)

    def between(a: F64, b: F64, some: I64, kind: NDArray[np.int8]) -> F64:
        """Where the state stops being ``kind``: it is at a, and is not at b."""
        for _ in range(_BISECTIONS):
            middle = 0.5 * (a + b)
            same = state(middle, some) == kind
            a, b = np.where(same, middle, a), np.where(same, b, middle)
        return np.asarray(a)

    now = np.flatnonzero(leave > enter)
    end, at = leave.copy(), enter.copy()
    leave = enter.copy()
    before = state(at[now], now)
    while now.size:
        ahead = np.minimum(at[now] + pace, end[now])
        found = state(ahead, now)
        entering = (before != 1) & (found == 1)
        some = now[entering]
        enter[some] = between(at[some], ahead[entering], some, before[entering])
        leaving = (before == 1) & (found != 1)
        some = now[leaving]
        leave[some] = between(at[some], ahead[leaving], some, np.ones(some.size, np.int8))
        ground_hit[some] = found[leaving] == 2
        at[now] = ahead
        ended = ~leaving & (ahead >= end[now]) & (found == 1)
        leave[now[ended]] = end[now[ended]]
        on = ~leaving & ~ended & (ahead < end[now]) & (found != 2)
        now, before = now[on], found[on]
    return np.minimum(enter, leave), leave, ground_hit & (leave > enter)


def _around_grid(world: World, origin: F64, direction: F64) -> tuple[F64, F64]:
    """Distances between which rays may be in the grid: within a box around it."""
    up = world.axes[..., 2, :].reshape(-1, 3)
    foot = world.place.reshape(-1, 3)
    corners = np.concatenate([foot + h * up for h in (world.levels_m[0] - 1.0, world.levels_m[-1])])
    lowest, highest = corners.min(axis=0) - 1e-3, corners.max(axis=0) + 1e-3
    with np.errstate(divide="ignore", invalid="ignore"):
        one, two = (lowest - origin) / direction, (highest - origin) / direction
    inside = (origin >= lowest) & (origin <= highest)
    level = direction == 0
    first = np.where(level, np.where(inside, -np.inf, np.inf), np.minimum(one, two)).max(axis=1)
    last = np.where(level, np.inf, np.maximum(one, two)).min(axis=1)
    first = np.maximum(first, 0.0)
    return np.minimum(first, 1e12), np.maximum(np.minimum(last, 1e12), np.minimum(first, 1e12))
