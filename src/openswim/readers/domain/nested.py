"""Nested domains as one scene in wider ones: near the eye the finest domain, and round it the others to the horizon."""

from __future__ import annotations

from collections.abc import Sequence
from copy import copy
from dataclasses import replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from openswim.errors import UserError
from openswim.readers.domain.blended import cell_m, levels_of, on_one_grid, size_text, width_m
from openswim.readers.domain.cutting import part_of
from openswim.readers.domain.mesh import cut_out, equal_area_map, mesh_of, within
from openswim.readers.domain.neighbourhood import FARTHER, WIDER_SIDE, Neighbourhood
from openswim.scene import Grid, Scene
from openswim.scene.grid import extent_text
from openswim.scene.rims import CORE_RIM, rim_m

F64 = NDArray[np.float64]

_MOST_WIDER, _RATIO = 3, 12.0  # wider grids at most, and how much wider than the one inside
_ASIDE = 0.12  # of a domain, that its grid may reach beyond it
_HIGH = 0.8  # of the widest domain's top: a domain that needs none of its clouds above


def merged(scenes: Sequence[Scene], around: Neighbourhood | None) -> Scene:
    """One scene of several whose domains overlap, in cells of the finest around the eye (of the finest domain, seen
    from space), which lies in up to three wider ones of the same domains in coarser cells, as far as the eye sees.

    Contents, extinctions and cover are blended linearly across the rims and the top of each finer domain; effective
    radii so that extinction is. What a finer file lacks altogether comes from the coarser.
    """
    if any(scene.grid is None or scene.grid.crs is None for scene in scenes):
        raise UserError("nested domains need a place on Earth: give around=(latitude, longitude)")
    order = sorted(scenes, key=cell_m)
    around = around or Neighbourhood(*order[0].place)
    over = [n for n, scene in enumerate(order) if mesh_of(scene).covers(*mesh_of(scene).index(around.lon, around.lat))]
    if over:
        order = order[: over[-1] + 1]
    elif not around.from_space:
        raise UserError(f"the observer is outside all the domains: {extent_text(mesh_of(order[-1]).grid())}")
    beyond = [scene.levels[-1] for scene in order]
    reach = min(0.5 * _diagonal_m(beyond[-1]), max(around.radius_m, around.far_m))
    found = [_innermost([scene.alone() for scene in order], around, reach)]
    for scene in beyond:
        while (wider := _wider(beyond, scene, found, around, reach)) is not None:
            found.append(wider)
    found[0].notes += [f"beyond, {size_text(scene)}" for scene in found[1:]]
    for inner, wider in pairwise(found):
        inner.wider = wider
    return found[0]


def _innermost(order: Sequence[Scene], around: Neighbourhood, reach: float) -> Scene:
    """The finest domain near an eye, or that an eye in space sees, and what lies around it."""
    for scene in order:
        cell = cell_m(scene)
        if around.from_space:
            place = replace(around, lat=scene.place[0], lon=scene.place[1])
            radius = (1 + 2 * _ASIDE) * _half_m(scene)
        else:
            place = around
            radius = min(around.radius_m, 0.5 * (around.most_side - 1) * cell)
        place = replace(place, radius_m=min(reach, radius))
        around_it = _target(order[-1], place, cell)
        if around_it is not None and _meets(scene, around_it):
            break
    else:
        raise UserError("the observer is at the edge of all the domains: choose a place farther inside")
    assert scene.grid is not None
    there = [one for one in order if _meets(one, around_it)]
    alike = reach <= FARTHER * place.radius_m or scene.grid.earth_radius_m == around_it.earth_radius_m
    if alike and (len(there) == 1 or (_covers(scene, around_it) and _top_m(scene) > _HIGH * _top_m(order[-1]))):
        part = part_of(scene, place)
        return copy(part) if part is scene else part
    target = _target(order[-1], place, cell, order[order.index(scene) :]) or around_it
    return on_one_grid([one for one in order if _meets(one, target)], target, levels_of(there))


def _wider(
    order: Sequence[Scene], scene: Scene, found: Sequence[Scene], around: Neighbourhood, reach: float
) -> Scene | None:
    """What of a domain reaches beyond the grids that there are, in its cells; at most `_RATIO` times as far as those
    where wider cells or broken clouds ask for it, unless it is the last grid."""
    last, before, cell = scene is order[-1], _half_m(found[-1]), cell_m(scene)
    left = _MOST_WIDER - len(found)  # grids, after this one
    if reach < FARTHER * before or left < (0 if last else 1):
        return None
    far = _RATIO * before
    if "cloud_area_fraction" not in scene.data or not last:
        far = max(far, 0.5 * (WIDER_SIDE - 1) * cell)
    far = reach if last and (left == 0 or reach < 2 * far or around.from_space) else min(reach, far)
    place = replace(around, radius_m=far, most_side=WIDER_SIDE)
    if around.from_space:
        lat, lon = scene.place
        place = Neighbourhood(lat, lon, min(far, _half_m(scene)), most_side=WIDER_SIDE)
        if last:  # the Earth below the eye, or the domain where it is but a part of that
            part = 0.5 * _diagonal_m(scene) < around.radius_m
            place = Neighbourhood(lat, lon, (1 + 2 * _ASIDE) * _half_m(scene)) if part else around
    target = _target(order[-1], place, cell, None if last else order[order.index(scene) :])
    if target is None or 0.5 * max(np.ptp(target.x), np.ptp(target.y)) < FARTHER * before:
        return None
    there = [one for one in order if _meets(one, target)]
    return on_one_grid(there, target, levels_of(there[there.index(scene) :]))


def _top_m(scene: Scene) -> float:
    assert scene.grid is not None
    return float(np.mean(scene.grid.height_m[-1]))


def _half_m(scene: Scene) -> float:
    """Half of a scene's longer side."""
    assert scene.grid is not None
    return 0.5 * max(scene.grid.size_m())


def _diagonal_m(scene: Scene) -> float:
    assert scene.grid is not None
    return float(np.hypot(*scene.grid.size_m()))


def _target(coarsest: Scene, place: Neighbourhood, cell: float, only: Sequence[Scene] | None = None) -> Grid | None:
    """An equal-area map around a place in cells of so many metres or wider ones, within the coarsest domain; where
    domains are given, of the first of them, up to where it fades into the second. None where that is nothing."""
    assert coarsest.grid is not None
    step = max(cell, 2 * place.radius_m / (place.most_side - 1))
    count = 2 * max(2, int(np.ceil(place.radius_m / step - 1e-6))) + 1
    target = equal_area_map(place.lat, place.lon, step, count, coarsest.grid.earth_radius_m)
    if only is not None:
        target = cut_out(target, _of_domain(only, target))
    kept = within(mesh_of(coarsest), target, 0.5)
    return None if kept is None else cut_out(target, kept)


def _of_domain(scenes: Sequence[Scene], target: Grid) -> tuple[slice, slice]:
    """The columns and rows of a target that lie in the first scene's domain, about so that the core of the target
    (`transport.nested`) ends where the domain begins to fade into the next; where it has, if the next shows no fading.
    """
    lon, lat = _outline(scenes[0])
    kept = []
    for at, axis in zip(target.index(lon, lat), (target.x, target.y), strict=True):
        at = at[np.isfinite(at)]
        middle, half = 0.5 * (at.max() + at.min()), 0.5 * (at.max() - at.min())
        if len(scenes) > 1:
            rim = rim_m(cell_m(scenes[1]), width_m(scenes[0]))
            half = (half - (rim > 0.7 * cell_m(scenes[1])) * rim / target.step[0]) / (1 - 2 * CORE_RIM)
        first, last = (int(np.clip(v, 0, axis.size - 1)) for v in (middle - half, middle + half + 1))
        kept.append(slice(first, last + 1) if last >= first + 2 else slice(None))
    return kept[0], kept[1]


def _outline(scene: Scene) -> tuple[F64, F64]:
    """Longitudes and latitudes along the edge of a domain."""
    assert scene.grid is not None
    _, ny, nx = scene.grid.shape
    i, j = np.linspace(0, nx - 1, 50), np.linspace(0, ny - 1, 50)
    return scene.grid.lonlat(
        np.concatenate([i, i, 0 * j, 0 * j + nx - 1]), np.concatenate([0 * i, 0 * i + ny - 1, j, j])
    )


def _inside(scene: Scene, target: Grid) -> NDArray[np.bool_]:
    mesh = mesh_of(scene)
    return mesh.covers(*mesh.index_of(target))


def _meets(scene: Scene, target: Grid) -> bool:
    return bool(_inside(scene, target).any())


def _covers(scene: Scene, target: Grid) -> bool:
    return bool(_inside(scene, target).all())
