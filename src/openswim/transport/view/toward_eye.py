"""The light of a grid turned toward an eye: the sources that its rays find at the nodes."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from openswim.transport.beam.lit_volume import with_fields
from openswim.transport.engine.eye_ways import Eye
from openswim.transport.engine.ordinates import harmonic_matrix, lebedev
from openswim.transport.engine.pack import PACK
from openswim.transport.engine.threads import in_threads
from openswim.transport.engine.types import FLOAT
from openswim.transport.lit.lit_grid import GridLight, LitGrid
from openswim.transport.march.empty_space import beside
from openswim.transport.march.volume import DEGREE, Volume
from openswim.transport.medium.medium import Medium
from openswim.transport.medium.scatterers import Scatterers
from openswim.transport.view.source_function import FieldAt, thickest_around, view_source

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]
Part = Sequence[tuple[int, int]]  # first level, row and column, and those after the last

_TOLD = 4096  # nodes whose harmonics are told together
_AROUND, _BESIDE = 6, 3  # cells from an eye at which nodes have it in their rays' direction; at which cloud matters


def aimed(lit: LitGrid, eye: F64, parallel: bool) -> Volume:
    """The volume that rays to an eye (3,) march through, or, where they are ``parallel``, along a direction.

    In a period, where an eye sees a node at many places, and around an eye that is in or beside cloud, nodes hold their
    sources toward every direction, and rays read them in their own.
    """
    light = lit.light
    if light is None or lit.channels is None:
        return lit.volume
    volume = with_fields(lit.volume, light.medium, lit.channels)
    eye = np.array(eye, float)
    if light.layers is not None and parallel:  # else a viewer aims at each direction by itself
        for w, layers in enumerate(light.layers):
            volume.fields[:, 0, 0, PACK + w] = layers.source(eye)
    if light.moments is None and light.columns is None:
        return volume
    if volume.periodic and not parallel:
        rows, row = lit.once("turning", lambda: _turning_everywhere(lit, volume))
        return volume._replace(turning=rows, turning_row=row)
    if not parallel:
        part = _part_around(light.medium, volume, eye)
        if part is not None:  # the next eye of a film is most often in the same cell
            near = np.ones([end - first for first, end in part], bool)
            rows, row = lit.once.last("turning", part, lambda: _turning(lit, volume, part, near))
            volume = volume._replace(turning=rows, turning_row=row)
    _put_sources(lit, light, volume, eye, parallel, [(0, n) for n in light.medium.shape])
    return volume


def _put_sources(lit: LitGrid, light: GridLight, volume: Volume, eye: F64, parallel: bool, part: Part) -> None:
    """Fill the source channels of a part of the grid: see `view_source` and `column_light`."""
    if light.columns is not None:
        light.columns.aim(volume.fields, eye, parallel, part[1:])
    if light.moments is None:
        return
    m = light.medium
    scatterers = Scatterers.of(m, light.coefficients)
    stands_for = lit.once(
        "stands for", lambda: lit.decide("stands for", lambda: thickest_around(scatterers.extinction, m.periodic))
    )
    in_threads(
        view_source, scatterers, stands_for, FieldAt.of(light.moments, light.coarser),
        Eye.of(m.axes, m.place, eye, parallel), light.count, np.array(part, np.int64), volume.fields,
    )  # fmt: skip


def _turning_everywhere(lit: LitGrid, volume: Volume) -> tuple[F32, NDArray[np.int32]]:
    """Sources toward every direction at all nodes that scatter, or have one beside them that does."""
    near = beside(volume.fields[..., volume.cloud_channel] > 0, volume.periodic)
    near |= volume.air[:, 0, None, None] > 0
    return _turning(lit, volume, [(0, n) for n in near.shape], near)


def _part_around(m: Medium, volume: Volume, eye: F64) -> Part | None:
    """Levels, rows and columns within `_AROUND` cells of an eye, if there is cloud within `_BESIDE` of it."""
    up = m.axes[..., 2, :].astype(float)
    height = np.sum((eye - m.place) * up, axis=-1)
    away = np.linalg.norm(eye - m.place - height[..., None] * up, axis=-1)
    row, column = np.unravel_index(np.argmin(away), away.shape)
    cell_m = max(m.cell_m)
    parts = []
    for cells in (_BESIDE, _AROUND):
        near = np.flatnonzero(np.abs(m.levels_m - height[row, column]) <= cells * cell_m)
        if away[row, column] > cells * cell_m or not near.size or height[row, column] < m.levels_m[0] - cell_m:
            return None  # far away, or what water mirrors
        parts.append(
            [(int(near[0]), int(near[-1]) + 1)]
            + [(max(int(n) - cells, 0), min(int(n) + cells + 1, size))
               for n, size in zip((row, column), m.shape[1:], strict=True)]
        )  # fmt: skip
    levels, rows, columns = (slice(*bounds) for bounds in parts[0])
    cloud = volume.fields[levels, rows, columns, volume.cloud_channel]
    return parts[1] if (cloud > 0).any() else None


def _turning(lit: LitGrid, volume: Volume, part: Part, near: NDArray[np.bool_]) -> tuple[F32, NDArray[np.int32]]:
    """`Volume.turning` and its rows, of the nodes that are ``near`` in a part of the grid; its fields are scratch.

    Sources toward one direction are harmonics of it, below DEGREE: as many directions tell them.
    """
    light = lit.light
    assert light is not None
    where = tuple(slice(*bounds) for bounds in part)
    count = np.count_nonzero(near)
    row = np.zeros(light.medium.shape, np.int32)
    row[where][near] = np.arange(1, count + 1)
    directions = lebedev(50).direction
    told = np.linalg.pinv(harmonic_matrix(directions, DEGREE)).astype(FLOAT)
    rows = np.zeros((count + 1, DEGREE * DEGREE, PACK), FLOAT)
    for some in np.split(np.arange(len(directions)), 10):
        sources = np.empty((len(some), count, PACK), FLOAT)
        for source, n in zip(sources, some, strict=True):
            _put_sources(lit, light, volume, directions[n], True, part)
            source[:] = volume.fields[where][..., PACK : 2 * PACK][near]
        for a in range(1, len(rows), _TOLD):
            of_part = sources[:, a - 1 : a - 1 + _TOLD].reshape(len(some), -1)
            harmonics = (told[:, some] @ of_part).reshape(DEGREE * DEGREE, -1, PACK)
            rows[a : a + _TOLD] += np.moveaxis(harmonics, 0, 1)
    return rows, row
