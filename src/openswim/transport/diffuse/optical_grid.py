"""The medium as the sweeps see it, on the full grid and on coarser ones."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from openswim.transport.diffuse.ordinate_transform import BLOCK
from openswim.transport.engine.decisions import Decisions
from openswim.transport.engine.threads import in_threads
from openswim.transport.engine.types import FLOAT
from openswim.transport.march.empty_space import beside
from openswim.transport.medium.delta_scaled import Coefficients

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]

_THIN = 0.02  # optical depth of a cell below which a coarser grid tells what it scatters


class OpticalGrid(NamedTuple):
    """The delta-scaled medium of one wavelength on the nodes (nz, ny, nx) of a grid, and the beam that lights it.

    Rows of ``extinction``, ``beam`` and ``sun_harmonics`` are filled with zeros to whole blocks.
    """

    extinction: np.ndarray  # (s, nz, ny, nx) of every species at its reference wavelength, 1/m
    scaled: np.ndarray  # (s,) delta-scaled extinction per reference extinction
    scattering: np.ndarray  # (s, M) Legendre moments of scattering per reference extinction
    air_extinction: np.ndarray  # (nz,) of the air on the levels, 1/m
    air_scattering: np.ndarray  # (nz, M)
    present: np.ndarray  # (nz, 1 + s) whether the air and each species scatter on a level
    beam: np.ndarray  # direct transmission
    sun_harmonics: np.ndarray  # (ny, M*M, nx) harmonics of the direction to the sun in the column's axes
    levels_m: np.ndarray
    cell_m: np.ndarray
    periodic: bool
    ends: np.ndarray  # (2, 2) of x and y, below and above: whether there is no cloud beyond a side, which may cut some
    ground_node: np.ndarray  # (ny, nx) lowest level not under the ground
    cloudy: np.ndarray  # (nz, ny, nb) blocks with cloud in or next to them

    def decided(self, decide: Decisions) -> OpticalGrid:
        """With cloud where it was decided to be."""
        return self._replace(
            present=decide("present", lambda: self.present), cloudy=decide("cloudy", lambda: self.cloudy)
        )


def optical_grid(
    extinction: F32, sun_harmonics: F32, levels_m: F64, cell_m: F64, periodic: bool,
    ends: NDArray[np.bool_], ground_node: NDArray[np.int64], coefficients: Coefficients, beam: F32,
) -> OpticalGrid:  # fmt: skip
    """`OpticalGrid` of arrays as wide as the grid."""
    c = coefficients
    cloud = extinction > 0
    present = np.concatenate([(c.air_scattering[:, :1] > 0).T, cloud.any(axis=(2, 3))]).T
    return OpticalGrid(
        whole_blocks(extinction), c.scaled, c.scattering, c.air_extinction, c.air_scattering,
        np.ascontiguousarray(present), whole_blocks(beam), whole_blocks(sun_harmonics), levels_m, cell_m, periodic,
        ends, ground_node, near_blocks(np.asarray(cloud.any(axis=0)), periodic),
    )  # fmt: skip


def at_another_wavelength(grid: OpticalGrid, coefficients: Coefficients, beam: F32) -> OpticalGrid:
    """The same species in the same places."""
    c = coefficients
    return grid._replace(
        scaled=c.scaled, scattering=c.scattering, air_extinction=c.air_extinction, air_scattering=c.air_scattering,
        beam=whole_blocks(beam),
    )  # fmt: skip


def coarser_grid(grid: OpticalGrid) -> OpticalGrid:
    """The same medium on 2x2 means of its columns, and in cloud the beam of which that takes as much as the four did.

    Their mean beam would be too bright, for it is so where there is little cloud, and the fine grid slow to mend it.
    """
    ny, nx = grid.ground_node.shape
    rows, columns = -(-ny // 2), -(-nx // 2)
    beam = np.zeros((len(grid.beam), rows, columns + -columns % BLOCK), FLOAT)
    extinction = np.zeros((len(grid.extinction), *beam.shape), FLOAT)

    def share(t: int, threads: int) -> None:
        for k in range(t, len(beam), threads):
            light, cloud = grid.beam[k, :, :nx], grid.extinction[:, k, :, :nx]
            beam[k, :, :columns] = coarsen(light)
            if cloud.any():
                extinction[:, k, :, :columns] = coarsen(cloud)
                takes = (grid.scaled[:, None, None] * cloud).sum(axis=0)
                mean = coarsen(takes)
                np.divide(coarsen(takes * light), mean, out=beam[k, :, :columns], where=mean > 0)

    in_threads(share)
    harmonics = np.moveaxis(coarsen(np.moveaxis(grid.sun_harmonics[..., :nx], 0, -2)), -2, 0)
    return grid._replace(
        extinction=extinction, beam=beam,
        sun_harmonics=whole_blocks(harmonics), cell_m=2 * grid.cell_m,
        ground_node=np.ascontiguousarray(grid.ground_node[::2, ::2]),
        cloudy=near_blocks(np.asarray((extinction[..., :columns] > 0).any(axis=0)), grid.periodic),
    )  # fmt: skip


def unlit_grid(grid: OpticalGrid, levels: slice) -> OpticalGrid:
    """What lies between some levels, without a beam."""
    return grid._replace(
        extinction=np.ascontiguousarray(grid.extinction[:, levels]), air_extinction=grid.air_extinction[levels],
        air_scattering=grid.air_scattering[levels], present=grid.present[levels],
        beam=np.zeros_like(grid.beam[levels]), levels_m=grid.levels_m[levels],
        cloudy=np.ascontiguousarray(grid.cloudy[levels]),
        ground_node=np.clip(grid.ground_node - levels.start, 0, levels.stop - levels.start - 1),
    )  # fmt: skip


def total_extinction(grid: OpticalGrid) -> F32:
    """Delta-scaled extinction of species and air (nz, ny, nx), rows filled to whole blocks, 1/m."""
    out = np.empty(grid.beam.shape, FLOAT)

    def share(t: int, threads: int) -> None:
        for k in range(t, len(out), threads):
            out[k] = grid.air_extinction[k]
            for scaled, extinction in zip(grid.scaled, grid.extinction, strict=True):
                out[k] += scaled * extinction[k]

    in_threads(share)
    return out


def with_ghosts(extinction: F32, nx: int, periodic: bool) -> F32:
    """Rows of whole blocks (nz, ny, columns), of which ``nx`` are nodes, with the nodes beyond every side: the other
    side's where periodic, else the edge's own (nz, ny + 2, columns + 2)."""
    out = np.pad(extinction, [(0, 0), (1, 1), (1, 1)], mode="wrap" if periodic else "edge")
    out[..., 0], out[..., nx + 1] = out[..., nx if periodic else 1], out[..., 1 if periodic else nx]
    return out


def thick_blocks(grid: OpticalGrid) -> NDArray[np.bool_]:
    """Blocks (nz, ny, nb) of cloud with cells of more than `_THIN` optical depth in or next to them."""
    extinction = total_extinction(grid)[..., : grid.ground_node.shape[1]]
    thick = near_blocks(extinction * FLOAT(grid.cell_m.max()) > _THIN, grid.periodic)
    return thick & grid.cloudy


def near_blocks(found: NDArray[np.bool_], periodic: bool) -> NDArray[np.bool_]:
    """Blocks (nz, ny, nb) with such nodes (nz, ny, nx) in or next to them."""
    found = beside(found, periodic)
    short = -found.shape[2] % BLOCK
    whole = np.pad(found, [(0, 0), (0, 0), (0, short)])
    return np.asarray(whole.reshape(*whole.shape[:2], -1, BLOCK).any(axis=-1))


def coarsen(field: F32) -> F32:
    """Mean of 2x2 columns (the last row or column stands alone where the count is odd)."""
    for axis in (-2, -1):
        if field.shape[axis] % 2:
            field = np.concatenate([field, field.take([-1], axis)], axis)
    rows = field[..., ::2, :] + field[..., 1::2, :]
    return np.ascontiguousarray(0.25 * (rows[..., ::2] + rows[..., 1::2]), FLOAT)


def twice_as_fine_plane(field: F32, shape: tuple[int, ...]) -> F32:
    """A field (..., y, x) on 2x2-coarse columns, bilinearly at the columns, ``shape`` (ny, nx)."""
    for axis, count in zip((-2, -1), shape, strict=True):
        at = np.clip((np.arange(count) - 0.5) / 2, 0, field.shape[axis] - 1)
        low = np.minimum(at.astype(int), max(field.shape[axis] - 2, 0))
        high = np.minimum(low + 1, field.shape[axis] - 1)
        share = (at - low).astype(FLOAT).reshape(-1, *[1] * (-1 - axis))
        field = field.take(low, axis) * (1 - share) + field.take(high, axis) * share
    return np.ascontiguousarray(field, FLOAT)


def whole_blocks(array: NDArray) -> F32:
    """Rows filled with zeros to whole blocks."""
    short = -array.shape[-1] % BLOCK
    padded = np.pad(array, [(0, 0)] * (array.ndim - 1) + [(0, short)]) if short else array
    return np.ascontiguousarray(padded, FLOAT)
