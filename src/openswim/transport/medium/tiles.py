"""The medium of a domain of very many columns, and of parts of it, on levels that all parts share."""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from openswim.optics.cover import LEAST_COVER
from openswim.optics.matter import Matter
from openswim.optics.species import OpticalSpecies
from openswim.transport.engine.compiled import kernel
from openswim.transport.engine.threads import in_threads
from openswim.transport.engine.types import FLOAT
from openswim.transport.medium.chart import chart_of, columns_on
from openswim.transport.medium.cloud_cover import cloud_under_cover
from openswim.transport.medium.medium import Medium, air_of, outside_ground_m
from openswim.transport.medium.plan import MediumPlan
from openswim.transport.medium.surface import Surface

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]

@kernel()
def _spread(t, threads, values, heights, levels, out):
    """Fields linear between heights (nz, ny, nx) on levels (n,) so that no column's sum changes: every level gets what
    lies around it, weighted by how near it is."""
    nz, ny, nx = values.shape
    n = levels.shape[0]
    for j in range(t, ny, threads):
        for i in range(nx):
            k = 0
            for s in range(-1, nz - 1):
                low_value, value = values[max(s, 0), j, i], values[s + 1, j, i]
                if low_value == 0.0 and value == 0.0:
                    continue
                a, b = (levels[0] if s < 0 else np.float64(heights[s, j, i])), np.float64(heights[s + 1, j, i])
                if b <= a:
                    continue
                while k > 0 and levels[k] > a:
                    k -= 1
                while k < n - 2 and levels[k + 1] <= a:
                    k += 1
                p = max(a, levels[0])
                slope = (value - low_value) / (b - a)
                while p < b and k < n - 1:
                    q = min(b, levels[k + 1])
                    if q > p:
                        step = levels[k + 1] - levels[k]
                        middle = 0.5 * (p + q)
                        f0, f2 = low_value + slope * (p - a), low_value + slope * (q - a)
                        f1 = 0.5 * (f0 + f2)
                        u0, u1, u2 = (p - levels[k]) / step, (middle - levels[k]) / step, (q - levels[k]) / step
                        whole = (q - p) * (f0 + 4.0 * f1 + f2) / 6.0
                        upper = (q - p) * (f0 * u0 + 4.0 * f1 * u1 + f2 * u2) / 6.0
                        out[k, j, i] += whole - upper
                        out[k + 1, j, i] += upper
                    p = q
                    if p < b:
                        k += 1
                k = min(k, n - 2)
            for m in range(n):
                below, above = levels[max(m - 1, 0)], levels[min(m + 1, n - 1)]
                out[m, j, i] /= 0.5 * (above - below)


def spread_on_levels(values: F32, heights: NDArray, levels: F64) -> F32:
    """A field (nz, ny, nx) at heights (nz,) or (nz, ny, nx) on levels (n,): its columns hold what they held."""
    if heights.ndim == 1:
        heights = np.broadcast_to(heights.astype(FLOAT)[:, None, None], values.shape)
    out = np.zeros((len(levels), *values.shape[1:]), FLOAT)
    in_threads(_spread, values, heights, levels, out)
    return out


def large_medium(plan: MediumPlan, matter: Matter, surface: Surface) -> tuple[Medium, F32 | None]:
    """The medium of a whole large domain, without axes and places of its columns (`part_of_medium` adds them), and
    what share of its cells is cloud (nz, ny, nx), if that is known."""
    grid = matter.grid
    assert grid is not None
    _, ny, nx = grid.shape
    terrain = surface.terrain_m
    heights = grid.height_m
    levels = plan.own_levels_m
    species: list[OpticalSpecies] = []
    fields: list[F32] = []
    nothing = np.zeros((0, 0, 0), FLOAT)
    for one in matter.species:
        fields.append(spread_on_levels(one.extinction_per_m, heights, levels))
        species.append(replace(one, extinction_per_m=nothing))
    thickness = np.gradient(levels)
    extinction = np.empty((len(fields), len(levels), ny, nx), FLOAT)
    for n in range(len(fields)):
        extinction[n] = fields[n]
        fields[n] = nothing
    for k, z in enumerate(levels):
        extinction[:, k, z < terrain - 1.5 * thickness[k]] = 0
    cover = matter.cover
    if cover is not None:
        cover = np.clip(spread_on_levels(cover, heights, levels), LEAST_COVER, 1)
    ground_m = outside_ground_m(terrain)
    medium = Medium(
        matter.frame, grid, matter.wavelengths_nm, species, extinction, levels, grid.spacing_m(), terrain,
        np.zeros((0, 0, 3, 3), FLOAT), np.zeros((0, 0, 3)), False, *chart_of(grid, matter.frame), ground_m,
        air_of(matter.air, ground_m),
    )  # fmt: skip
    return medium, cover


class Window(NamedTuple):
    """Columns of a domain: x from ``west`` to before ``east``, y from ``south`` to before ``north``."""

    west: int
    east: int
    south: int
    north: int

    def grown(self, x: tuple[int, int], y: tuple[int, int], shape: tuple[int, ...]) -> Window:
        """With more columns below and above, as far as there are."""
        ny, nx = shape
        return Window(max(self.west - x[0], 0), min(self.east + x[1], nx), max(self.south - y[0], 0),
                      min(self.north + y[1], ny))  # fmt: skip

    @property
    def slices(self) -> tuple[slice, slice]:
        return slice(self.south, self.north), slice(self.west, self.east)


def part_of_medium(medium: Medium, cover: F32 | None, window: Window) -> Medium:
    """The columns of a window, in the whole's frame and on its levels; cloud that covers parts of cells is thinned to
    what reflects as much."""
    rows, columns = window.slices
    axes, place = columns_on(medium.grid, medium.frame, window.slices)
    extinction = np.ascontiguousarray(medium.extinction[:, :, rows, columns])
    if cover is not None:
        extinction = cloud_under_cover(
            list(extinction), medium.species, cover[:, rows, columns], medium.levels_m, place, min(medium.cell_m), 1
        )
    return replace(
        medium, extinction=extinction,
        terrain_m=np.ascontiguousarray(medium.terrain_m[rows, columns]), axes=axes, place=place,
        chart=medium.chart - np.array([window.west, window.south], float), first=(window.west, window.south),
    )  # fmt: skip
