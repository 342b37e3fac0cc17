"""The local ensemble transform Kalman filter (Hunt et al. 2007) on the same observations, without derivatives."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
import xarray as xr
from numpy.typing import ArrayLike, NDArray

from openswim.arguments import number, numbers, whole
from openswim.assimilation.background import Background, Piece, Space
from openswim.assimilation.observing.observations import check_observed
from openswim.assimilation.observing.operator import Operator, listed
from openswim.assimilation.observing.rows import Rows
from openswim.errors import UserError
from openswim.progress import track
from openswim.scene.frame import scene_frame

F64 = NDArray[np.float64]

_MOST = 2000  # observations of a column; of more, every second, third, ... one counts as much more
_CUT = 2.0  # Gaspari and Cohn's function is nothing beyond twice its length


def ensemble_of(op: Operator, background: Background, members: int, first: xr.Dataset | None = None,
                transform: str = "softplus", seed: int = 0) -> list[xr.Dataset]:  # fmt: skip
    """States as far from a first guess, and as alike, as a background says."""
    if whole("ensemble_of: members", members) < 1:
        raise UserError("ensemble_of: members must be 1 or more")
    space = Space(op, op.controls.lifted(op.first() if first is None else first), background, transform)
    return [space.state(space.sample(seed + n)) for n in range(members)]


def ensemble_filter(
    op: Operator,
    observed: xr.Dataset,
    states: Iterable[xr.Dataset] | xr.Dataset,
    length_m: float,
    inflation: float = 1.05,
    transform: str = "softplus",
    seen: xr.DataArray | ArrayLike | None = None,
    relaxation: float = 0.0,
) -> list[xr.Dataset]:
    """Members after the observations.

    states : of the members before, several or one Dataset along ``member``.
    length_m : of localisation (Gaspari and Cohn 1999), along the ground: an observation counts the less in a column,
    the farther its ray passes by within the layer that may change.
    inflation : of the members' variance before (Hunt et al. 2007, Sect. 4.4), where nothing was observed too.
    relaxation : of the spread after to that before (RTPS, Whitaker and Hamill 2012, Eq. 2), from 0 (none, as befits one
    analysis) to 1 (the spread stays what it was); an ensemble that goes from analysis to analysis needs some.
    transform : in which members are mixed, so that no mix is a negative cloud. seen : H of the members
    (`Operator.ensemble`), where it is known; another model's may be given, as an array (members, observations).
    """
    before = listed(states, "ensemble_filter")
    if len(before) < 3:
        raise UserError("ensemble_filter: give three members or more")
    if not 0 < number("ensemble_filter: length_m", length_m) < np.inf:
        raise UserError("ensemble_filter: length_m must be positive")
    if not 1 <= number("ensemble_filter: inflation", inflation) < np.inf:
        raise UserError("ensemble_filter: inflation must be 1 or more")
    if not 0 <= number("ensemble_filter: relaxation", relaxation) <= 1:
        raise UserError("ensemble_filter: relaxation must be from 0 (none) to 1 (to all of the spread before)")
    check_observed(op, observed)
    lifted = [op.controls.lifted(state) for state in before]
    rows = np.asarray(op.ensemble(lifted)) if seen is None else numbers("ensemble_filter: seen", seen)
    if rows.shape != (len(before), op.size):
        raise UserError(f"ensemble_filter: seen has shape {rows.shape}; give ({len(before)}, {op.size})")
    use = np.flatnonzero(observed["use"].values)
    if not np.isfinite(rows[:, use]).all():
        raise UserError("ensemble_filter: seen must be finite wherever an observation is used")
    mean = rows[:, use].mean(axis=0)
    weight = 1 / observed["error"].values[use]
    changes, departure = (rows[:, use] - mean) * weight, (observed["value"].values[use] - mean) * weight
    space = Space(op, lifted[0], Background(length_m), transform)
    fields = [[_inner(p, state) for state in lifted] for p in space.pieces]
    out = [state.copy(deep=True) for state in lifted]
    ends, places = _segments(op)[use], _columns(op)
    by_column = np.empty((len(places), len(before), len(before)))
    for n in track(range(len(places)), "ensemble"):
        by_column[n] = _mixed(changes, departure, _nearness(places[n], ends, length_m), inflation)
    everywhere = _mixed(changes, departure, np.ones(use.size), inflation)
    for p, members in zip(space.pieces, fields, strict=True):
        stack = np.stack(members)
        if {"y", "x"} <= set(p.first.dims):
            rows_, columns = p.box[-2:]
            inner = by_column.reshape(*op.controls.where.shape[1:], len(before), len(before))[rows_, columns]
            mixed = np.einsum("m...yx,yxmn->n...yx", stack, inner)
        else:
            mixed = np.einsum("m...,mn->n...", stack, everywhere)
        mixed = _relaxed(stack, mixed, relaxation)
        for state, values in zip(out, mixed, strict=True):
            state[p.name] = state[p.name].copy(data=p.whole(p.transform.value(values)))
    return out


def _inner(p: Piece, state: xr.Dataset) -> F64:
    return np.asarray(p.transform.back(state[p.name].values[p.box]), float)


def _mixed(changes: F64, departure: F64, near: F64, inflation: float) -> F64:
    """(m, m): members after from members before, column n of the new member n. near (n,): weights."""
    m = len(changes)
    some = np.flatnonzero(near > 1e-4)
    every = max(1, -(-some.size // _MOST))
    some = some[::every]
    y = changes[:, some] * np.sqrt(near[some] * every)
    value, vector = np.linalg.eigh((m - 1) / inflation * np.eye(m) + y @ y.T)
    ahead = y @ (departure[some] * np.sqrt(near[some] * every))
    to_mean = vector @ ((vector.T @ ahead) / value)
    spread = (vector * np.sqrt((m - 1) / value)) @ vector.T
    about = np.eye(m) - 1 / m
    return np.asarray(1 / m + about @ (to_mean[:, None] + spread @ about))


def _relaxed(before: F64, after: F64, share: float) -> F64:
    """Members (m, ...) about their mean with a spread of (1 - share) of their own and a share of that before
    (Whitaker and Hamill 2012, Eq. 2)."""
    if share == 0:
        return after
    mean, own = after.mean(axis=0), after.std(axis=0, ddof=1)
    wanted = (1 - share) * own + share * before.std(axis=0, ddof=1)
    return np.asarray(mean + (after - mean) * np.where(own > 0, wanted / np.where(own > 0, own, 1.0), 1.0))


def _nearness(place: F64, ends: F64, length_m: float) -> F64:
    """Gaspari and Cohn's function of the distance along the ground from a place (2,) to segments (n, 2, 2)."""
    start, way = ends[:, 0], ends[:, 1] - ends[:, 0]
    along = ((place - start) * way).sum(axis=1) / np.maximum((way**2).sum(axis=1), 1e-12)
    r = np.linalg.norm(start + np.clip(along, 0, 1)[:, None] * way - place, axis=1) / length_m
    r = np.minimum(r, _CUT)
    inner = -(r**5) / 4 + r**4 / 2 + 5 * r**3 / 8 - 5 * r**2 / 3 + 1
    outer = r**5 / 12 - r**4 / 2 + 5 * r**3 / 8 + 5 * r**2 / 3 - 5 * r + 4 - 2 / (3 * np.maximum(r, 0.5))
    return np.maximum(np.where(r <= 1, inner, outer), 0.0)


def _columns(op: Rows) -> F64:
    """(ny nx, 2) of the grid's columns, metres along its axes."""
    grid = op.scene.grid
    assert grid is not None
    dx, dy = grid.spacing_m()
    y, x = np.meshgrid(dy * np.arange(grid.shape[1]), dx * np.arange(grid.shape[2]), indexing="ij")
    return np.stack([x.ravel(), y.ravel()], axis=-1)


def _segments(op: Rows) -> F64:
    """(observations, 2, 2): where each ray, of a pyranometer that to the sun, enters and leaves the layer that may
    change; metres along the grid's axes, where the wind had what is there at the time of the state."""
    grid, frame = op.scene.grid, scene_frame(op.scene)
    assert grid is not None
    levels = np.flatnonzero(op.controls.where.any(axis=(1, 2)))
    heights = grid.height_m.reshape(grid.shape[0], -1)[levels]
    low, high = float(heights.min()), float(heights.max())
    parts = iter(op.parts)
    rays, suns = [], []
    for one in op.of_times:
        way: F64 = np.zeros(2)
        if one.carrier is not None:
            way = one.carrier.way[levels].mean(axis=0) * grid.spacing_m()
        for each in one.instruments:
            seen = each.camera.rays(frame)
            ends = _through(op, np.array(seen.origins(), float), np.array(seen.directions(), float), low, high)
            rays.append(np.tile(ends - way, (next(parts).shape[0], 1, 1)))
        if len(one.points):
            ground = frame.position(one.points[:, 0], one.points[:, 1], 0.0)
            sun = np.broadcast_to(one.daylight.direction, ground.shape)
            suns.append(_through(op, ground, sun, low, high) - way)
    return np.concatenate([*rays, *suns])


def _through(op: Rows, origin: F64, direction: F64, low: float, high: float) -> F64:
    grid, frame = op.scene.grid, scene_frame(op.scene)
    assert grid is not None
    dx, dy = grid.spacing_m()
    steep = np.where(np.abs(direction[:, 2]) < 0.02, 0.02, direction[:, 2])
    ends = []
    for height in (low, high):
        place = origin + direction * np.clip((height - origin[:, 2]) / steep, 0, None)[:, None]
        north, east, _ = frame.latlon(place)
        ix, iy = grid.place(east, north)
        ends.append(np.stack([np.clip(ix, -1e3, 1e4) * dx, np.clip(iy, -1e3, 1e4) * dy], axis=-1))
    return np.stack(ends, axis=1)
