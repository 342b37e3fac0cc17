"""The light of a grid turned toward an eye."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from openswim.transport.columns.columns import Columns
from openswim.transport.columns.discrete_ordinates import Layers
from openswim.transport.diffuse.moments import Coarser, Moments
from openswim.transport.engine.ordinates import harmonic_matrix, lebedev
from openswim.transport.engine.pack import PACK
from openswim.transport.engine.threads import in_threads
from openswim.transport.march.empty_space import beside
from openswim.transport.march.volume import (
    DEGREE,
    Volume,
)
from openswim.transport.medium.coefficients import Coefficients
from openswim.transport.medium.medium import Medium
from openswim.transport.view.source_function import columns_of, field_at, thickest_around, view_source, wide

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]

_TOLD = 4096  # nodes whose harmonics are told together
_AROUND, _BESIDE = 6, 3  # cells from an eye at which nodes have it in their rays' direction; at which cloud matters
_LEAST_DEPTH = 0.01  # cosine of the angle from the scene's origin at which its grid ends


@dataclass
class GridLight:
    """What the grid knows of the light: per wavelength the beam, the moments and the coefficients."""

    medium: Medium
    beams: list[F32]
    shadow_m: F64
    ridge_m: F64
    coefficients: list[Coefficients]
    local_sun: F64  # (ny, nx, 3)
    sun: F64
    count: int
    moments: list[Moments] | None = None  # of the light at the nodes
    coarser: list[Coarser] = field(default_factory=list)
    ratios: list[F32 | None] = field(default_factory=list)  # of the light scattered around the nodes to `moments`
    layers: list[Layers] | None = None  # instead of moments, in `Medium.layered` scenes
    columns: Columns | None = None  # instead of moments, in very large domains
    _aimed: tuple[bytes, bool] | None = None
    _around: bytes | None = None  # the eye of the last `turning_around`
    _stands_for: NDArray[np.int32] | None = None  # `thickest_around`

    @property
    def sun_harmonics(self) -> F32:
        """Harmonics (M^2, ny, nx) of the direction to the sun in every column's axes."""
        harmonics = harmonic_matrix(self.local_sun.reshape(-1, 3), DEGREE).T
        return np.ascontiguousarray(harmonics.reshape(-1, *self.local_sun.shape[:2]), np.float32)

    def aim(self, volume: Volume, eye: F64, parallel: bool) -> None:
        """Fill the source channels for one eye."""
        key = (np.asarray(eye, float).tobytes(), parallel)
        if key == self._aimed:
            return
        if self.layers is not None:
            for w, layers in enumerate(self.layers):
                volume.fields[:, 0, 0, PACK + w] = layers.source(eye)
        if self.columns is not None or self.moments is not None:
            self._aim_part(volume, np.array(eye, float), parallel, [(0, n) for n in self.medium.shape])
        self._aimed = key

    def _aim_part(self, volume: Volume, eye: F64, parallel: bool, part: Sequence[tuple[int, int]]) -> None:
        """See `view_source` and `column_light`."""
        self._aimed = None
        if self.columns is not None:
            self.columns.aim(volume.fields, eye, parallel, part[1:])
        if self.moments is None:
            return
        m = self.medium
        extinction = wide(m.extinction)
        if self._stands_for is None:
            self._stands_for = thickest_around(extinction, m.periodic)
        in_threads(
            view_source, extinction, self._stands_for, *(
                np.stack([getattr(c, name) for c in self.coefficients])
                for name in ("scaled", "scattering", "air_extinction", "air_scattering")
            ), *field_at(self.moments, self.coarser),
            columns_of(m.axes, m.place, eye, parallel), m.levels_m, eye,
            parallel, self.count, np.array(part, np.int64), volume.fields,
        )  # fmt: skip

    def turning(self, volume: Volume) -> Volume:
        """The volume with sources that rays read in their own direction: in a period a node is seen at many places."""
        near = beside(volume.fields[..., volume.cloud_channel] > 0, volume.periodic)
        near |= volume.air[:, 0, None, None] > 0
        return self._turning(volume, [(0, n) for n in near.shape], near)

    def turning_around(self, volume: Volume, eye: F64) -> Volume:
        """The volume with such sources at the nodes around an eye that is in or beside cloud: they have it in other
        directions than its rays come from."""
        key = np.asarray(eye, float).tobytes()
        if key != self._around:
            self._around = key
            part = self._part_around(volume, np.asarray(eye, float))
            if part is None:
                return volume._replace(turning=np.zeros((0, DEGREE * DEGREE, PACK), np.float32))
            return self._turning(volume, part, np.ones([end - first for first, end in part], bool))
        return volume

    def _part_around(self, volume: Volume, eye: F64) -> list[tuple[int, int]] | None:
        """Levels, rows and columns within `_AROUND` cells of an eye, if there is cloud within `_BESIDE` of it."""
        m = self.medium
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

    def _turning(self, volume: Volume, part: Sequence[tuple[int, int]], near: NDArray[np.bool_]) -> Volume:
        """Sources at the nodes that are ``near``, in a part of the grid, as rays read them in their own direction.

        Sources toward one direction are harmonics of it, below DEGREE: as many directions tell them.
        """
        where = tuple(slice(*bounds) for bounds in part)
        count = np.count_nonzero(near)
        row = np.zeros(self.medium.shape, np.int32)
        row[where][near] = np.arange(1, count + 1)
        directions = lebedev(50).direction
        told = np.linalg.pinv(harmonic_matrix(directions, DEGREE)).astype(np.float32)
        rows = np.zeros((count + 1, DEGREE * DEGREE, PACK), np.float32)
        for some in np.split(np.arange(len(directions)), 10):
            sources = np.empty((len(some), count, PACK), np.float32)
            for source, n in zip(sources, some, strict=True):
                self._aim_part(volume, directions[n], True, part)
                source[:] = volume.fields[where][..., PACK : 2 * PACK][near]
            for a in range(1, len(rows), _TOLD):
                of_part = sources[:, a - 1 : a - 1 + _TOLD].reshape(len(some), -1)
                harmonics = (told[:, some] @ of_part).reshape(DEGREE * DEGREE, -1, PACK)
                rows[a : a + _TOLD] += np.moveaxis(harmonics, 0, 1)
        return volume._replace(turning=rows, turning_row=row)


