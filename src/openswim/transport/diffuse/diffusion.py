"""What is yet to follow from a change of the light in thick cloud, by the diffusion that light is there.

A sweep carries light one free path on; through a cloud of optical depth tau it takes some tau^2 of them. Of a sweep's
change d of the mean radiance the sum e of all changes that follow is near to that of diffusion (P1),

    -div(D grad e) + (s - s_0) e = s_0 d,    D = 1/(3 (s - s_1)),

with s the extinction and s_l the moments of scattering. Light leaves through the top, the sides, and the ground that
does not give it back (Marshak: half of e). Synthetic acceleration, see docs/decisions/0021-diffusion.md.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from openswim.transport.diffuse.diffusion_kernels import step_and_clear, turn_and_multiply
from openswim.transport.diffuse.optical_grid import OpticalGrid, coarsen, total_extinction, twice_as_fine_plane
from openswim.transport.diffuse.ordinate_transform import BLOCK
from openswim.transport.engine.decisions import Decisions
from openswim.transport.engine.pack import LANES

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]

_LEAK = 1.0  # what passes between the nodes of thick cells per difference of their light
_ASLANT = 0.5  # cosine that stands for all ways through a side
_CLEAR = 0.02  # optical depth between levels that counts as clear
_CLOSE = 0.03  # of the right-hand side, at which to stop
_MOST = 40  # iterations
_MOST_COLUMNS = 1024  # of more, 2x2 are taken for one


class Diffusion:
    """The medium of a sweep as diffusion sees it: an equation a node, times the height that it stands for.

    What lasts is smooth: large grids are halved until they have few columns. ``ground_albedo`` (ny, nx); on_ground:
    whether the lowest level may be the ground's, else light leaves there.
    """

    def __init__(self, grid: OpticalGrid, ground_albedo: F32, on_ground: bool, decide: Decisions | None = None):
        self.decide = decide or Decisions()
        nx = grid.ground_node.shape[1]
        cloud = grid.extinction[..., :nx]

        def of(species: F32, air: F32) -> F32:
            return np.asarray(np.tensordot(species, cloud, 1) + air[:, None, None], np.float32)

        extinction = total_extinction(grid)[..., :nx]
        scattering = of(grid.scattering[:, 0], grid.air_scattering[:, 0])
        transport = np.maximum(extinction - of(grid.scattering[:, 1], grid.air_scattering[:, 1]), 0)
        ground, cell_m, albedo = grid.ground_node, np.asarray(grid.cell_m, float), np.clip(ground_albedo, 0, 1)
        height = _heights(grid.levels_m)
        absorbed = (extinction - scattering) * height
        level = np.arange(len(height))[:, None, None]
        self.source = np.where(level < ground, 0, scattering * height).astype(np.float32)
        self.halved: list[tuple[int, ...]] = []  # what grids (ny, nx) were before
        while ground.size > _MOST_COLUMNS and min(ground.shape) > 1:
            self.halved.append(ground.shape)
            transport, absorbed, albedo = coarsen(transport), coarsen(absorbed), coarsen(albedo)
            extinction, scattering = coarsen(extinction), coarsen(scattering)
            ground, cell_m = ground[::2, ::2], 2 * cell_m
        self.shape, self.periodic = absorbed.shape, grid.periodic
        under = level < ground
        lost = absorbed + np.where(level == ground, 0.5 * ((1 - albedo) / (1 + albedo) if on_ground else 1), 0)
        lost[-1] += 0.5
        if not grid.periodic:
            for axis, length_m in ((1, cell_m[1]), (2, cell_m[0])):
                if lost.shape[axis] > 1:
                    ends = np.moveaxis(lost, axis, 0)
                    ends[[0, -1]] += 0.5 * height[..., 0] / length_m
        up = _links_up(transport, under, grid.levels_m)
        transport += 1 / max(float(np.ptp(grid.levels_m)), 1.0)  # where it is clear, no farther than the grid is high
        north, east = (
            _links_beside(transport, under, height, length_m, axis, grid.periodic)
            for axis, length_m in ((1, cell_m[1]), (2, cell_m[0]))
        )
        if not grid.periodic:
            for links, axis, length_m in ((north, 1, cell_m[1]), (east, 2, cell_m[0])):
                _tie_sides(links, extinction, scattering * height, length_m, axis)
        own = np.where(under, 1, lost) + up + np.roll(up, -1, 0)
        own += north + np.roll(north, 1, 1) + east + np.roll(east, 1, 2)
        inverse, share = 1 / own, np.zeros_like(own)
        for k in range(1, len(own)):  # elimination within columns
            share[k] = up[k] * inverse[k - 1]
            inverse[k] = 1 / (own[k] - up[k] * share[k])
        self.own, self.up, self.inverse, self.share, self.north, self.east = (
            self._rows(a) for a in (own, up, inverse, share, north, east)
        )
        if grid.periodic:
            self.east[..., 0] = east[..., -1]

    def _rows(self, nodes: NDArray[Any] | float = 0.0) -> F32:
        """Nodes as the kernels want them."""
        nz, ny, nx = self.shape
        width = 2 + nx + -(2 + nx) % LANES
        out = np.zeros(nz * ny * width + 2 * LANES, np.float32)[LANES:-LANES].reshape(nz, ny, width)
        out[..., 1 : 1 + nx] = nodes
        return out

    def follows(self, change: F32) -> F32:
        """e of a change d of the mean radiance, both on the sweep's grid (nz, ny, nx)."""
        given = self.source * change
        for _ in self.halved:
            given = coarsen(given)
        e = self._solved(given)
        for shape in reversed(self.halved):
            e = twice_as_fine_plane(e, shape)
        return e

    def _solved(self, given: F32) -> F32:
        """By conjugate gradients, each residual cleared of what columns do by themselves."""
        nx = self.shape[2]
        residual = self._rows(given)
        e, along, spare, product, cleared = (self._rows() for _ in range(5))
        sums = np.zeros((2, LANES), np.float32)
        goal, past, step = -1.0, np.inf, 0.0
        decide = self.decide.within("diffusion")
        for _ in range(_MOST):
            step_and_clear(np.float32(step), along, product, e, residual, self.inverse, self.share, cleared, sums)
            left, size = sums.sum(axis=1, dtype=float)
            if goal < 0:
                goal = _CLOSE**2 * size
            close = bool(size <= goal or left <= 0)
            if decide("close", lambda close=close: close):  # type: ignore[misc]
                break
            turn_and_multiply(
                np.float32(left / past), along, spare, cleared, self.own, self.up, self.north,
                self.east, nx, self.periodic, product, sums,
            )  # fmt: skip
            along, spare = spare, along
            step = left / max(float(sums[0].sum(dtype=float)), 1e-30)
            past = left
        return e[..., 1 : 1 + nx]

    def add(self, place: NDArray[np.int32], change: F32, out: F32) -> None:
        """What follows a ``change`` (blocks, BLOCK) of the first moment, added to ``out`` (blocks, M^2, BLOCK)."""
        kept = place >= 0
        nz, ny, blocks = place.shape
        wide = np.zeros((nz, ny, blocks, BLOCK), np.float32)
        wide[kept] = change[place[kept]]
        nodes = wide.reshape(nz, ny, -1)[..., : self.source.shape[2]]
        nodes[:] = self.follows(nodes)
        out[place[kept], 0] += wide[kept]


def _heights(levels_m: F64) -> F32:
    """What each level (nz, 1, 1) stands for."""
    steps = np.diff(levels_m)
    return np.asarray(0.5 * (np.pad(steps, (0, 1)) + np.pad(steps, (1, 0))), np.float32)[:, None, None]


def _conductance(depth: NDArray[Any]) -> NDArray[Any]:
    """Flux per difference of e between nodes so far apart. Thick cells leak: their sweeps do, and less would overdo."""
    return 1 / (3 * depth) + _LEAK * depth / (1 + depth)


def _links_up(transport: F32, under: NDArray[np.bool_], levels_m: F64) -> F64:
    """What goes to each node (nz, ny, nx) from the one below, per difference of e; nothing from under the ground."""
    depth = 0.5 * (transport[1:] + transport[:-1]) * np.diff(levels_m)[:, None, None]
    links = np.where(under[:-1], 0, _conductance(np.maximum(depth, _CLEAR)))
    return np.pad(links, [(1, 0), (0, 0), (0, 0)])


def _links_beside(
    transport: F32, under: NDArray[np.bool_], height: F32, cell_m: float, axis: int, periodic: bool
) -> F64:  # fmt: skip
    """The same from each node to the next along an axis; nothing from the last where sides are open."""
    depth = 0.5 * (transport + np.roll(transport, -1, axis)) * cell_m
    links = np.where(under | np.roll(under, -1, axis), 0, height / cell_m * _conductance(depth))
    if not periodic or links.shape[axis] == 1:
        np.moveaxis(links, axis, 0)[-1] = 0
    return np.asarray(links, float)


def _tie_sides(links: F64, extinction: F32, scattered: NDArray[Any], cell_m: float, axis: int) -> None:
    """Light that enters through an open side takes after that of the node next to it, see `sweep_sides.enter`: half of
    what a node at the side has goes with its neighbour, however wide the cell."""
    along, thick = np.moveaxis(links, axis, 0), np.moveaxis(extinction, axis, 0)
    source = np.moveaxis(scattered, axis, 0)
    for side, beside, link in ((0, 1, 0), (-1, -2, -2)) if len(along) > 1 else ():
        depth = np.maximum(0.5 * (thick[side] + thick[beside]) * cell_m / _ASLANT, 1e-3)
        share = 2 * (-1 / np.expm1(-depth) - 1 / depth) - 1
        along[link] += np.where(along[link] > 0, 0.5 * share * source[side], 0)  # not where the ground is between
