"""From coarse grids to fine ones: each begins from the one 2x2-coarser, and asks it what will follow from a change
(docs/decisions/0009-wavelengths-alike.md)."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from openswim.transport.diffuse.earlier import LEAST_RATIO, MOST_RATIO, Start
from openswim.transport.diffuse.moments import Coarser, Moments, prolong, restrict
from openswim.transport.diffuse.optical_grid import total_extinction, twice_as_fine_plane
from openswim.transport.diffuse.sweeper import DARK, Sweeper
from openswim.transport.engine.threads import in_threads
from openswim.transport.engine.types import FLOAT

F32 = NDArray[np.float32]

_LEAST_COARSE = 12  # nodes that a coarse grid must have each way
_FEW_BLOCKS = 4096  # as many as a cache holds
_PARTS = 32  # of a grid's rows, which differ in what they keep
_WHOLE = 2  # from the third grid on the moments of all that scatters are kept
_LOOSE = 3  # sooner done where a grid is nothing but a start for a finer one
_CLOSE = 0.5  # later where it is also what lights the rest, and cheap
_ENDLESS = 0.1  # and in periods, where light goes on until it finds the top or the ground
ALIKE = 9  # moments that tell what one grid adds to a coarser one, l < 3: those of a blue sky


class Trace(NamedTuple):
    """How a grid before its last sweep differs from the coarser one: ``defect`` from the ``start`` that that gave.

    Before the last: another wavelength takes that sweep too, and what it leaves undone is the same, without a tint.
    """

    kept: NDArray[np.bool_]  # (nz, ny, blocks)
    start: F32  # (blocks, 1, BLOCK), l = 0 only
    defect: F32  # (blocks, ALIKE, BLOCK), of the first moments; the others follow in one sweep
    ratio: F32 | None  # see `Solution`


class Solution(NamedTuple):
    """Moments of one wavelength, the field that lights what they leave out, the sweeps each grid took, how each grid's
    moments came about, from the coarsest but one on; fluxes (2, ny, nx) down to the ground and up through the top; the
    ratio (blocks, BLOCK) of the moments to the nodes' own, unless they are these; and what the coarser grid had told of
    moments and fluxes, if that is wanted: the first ones (blocks, ALIKE, BLOCK), and all fluxes."""

    moments: Moments
    coarser: Coarser
    sweeps: list[int]
    traces: list[Trace]
    fluxes: F32
    ratio: F32 | None
    told: tuple[F32, F32] | None = None


class Begun(NamedTuple):
    """A grid to be solved, ``level``, the coarser one, ``base``, and its solution ``below``, which is where the moments
    ``values`` begin."""

    level: Sweeper
    base: Sweeper
    below: Solution
    values: F32

    def told_fluxes(self) -> F32:
        """See `Solution`."""
        return twice_as_fine_plane(self.below.fluxes, self.level.ground_albedo.shape)


def by_blocks(work: Callable[[slice], object], count: int) -> None:
    """``work`` on slices of so many blocks, in threads."""

    def share(part: int, parts: int) -> None:
        for at in range(part * _FEW_BLOCKS, count, parts * _FEW_BLOCKS):
            work(slice(at, at + _FEW_BLOCKS))

    in_threads(share)


def copied(values: F32) -> F32:
    """A copy, in threads."""
    out = np.empty(values.shape, values.dtype)
    by_blocks(lambda some: np.copyto(out[some], values[some]), len(values))
    return out


def told_ratio(told: F32, told_there: F32) -> F32:
    """Of what a coarse grid tells at two wavelengths, within bounds."""
    return np.clip(told / np.maximum(told_there, DARK), LEAST_RATIO, MOST_RATIO)


def begin_from_coarse(
    fine: Sweeper, tolerance: float, most: int, like: list[Trace] | None, finer: int, start: Start | None,
    wavelength: int,
) -> Begun:  # fmt: skip
    """What the 2x2-coarse grid tells, see `coarse_to_fine`."""
    base = fine.coarsened()
    below = coarse_to_fine(base, tolerance, most, like, finer + 1, start=start, wavelength=wavelength)
    if finer >= _WHOLE or fine.grid.periodic:
        level = fine
    else:
        whole = below.coarser  # the base's own, or the base itself
        if whole.factor:
            whole = whole._replace(factor=2 * whole.factor)
        else:
            whole = base.as_coarser(below.moments.values, below.ratio)
        level = fine.over(whole, like[len(below.sweeps) - 1].kept if like else None)
    values = np.empty(level.shape, FLOAT)
    in_threads(
        prolong, below.moments, base.grid.ground_node.shape[1], below.coarser, level.place,
        level.grid.ground_node.shape[1], values, False, parts=_PARTS,
    )  # fmt: skip
    return Begun(level, base, below, values)


def coarse_to_fine(
    fine: Sweeper, tolerance: float, most: int, like: list[Trace] | None = None, finer: int = 0, tell: bool = False,
    start: Start | None = None, wavelength: int = 0,
) -> Solution:  # fmt: skip
    """Solve on the 2x2-coarse grid, then on the full one, from the coarse field.

    Between sweeps of the full grid the coarse one tells what will follow from their change (two-grid acceleration).
    finer: grids that this one is but a start for. Below two of them the moments of all that scatters are kept; the two
    keep those of what is thick, and leave the rest to the grid that keeps all. In periods all grids keep all: between a
    coarse grid's last node and its first nothing is interpolated, which a start and a correction bear.
    like: the traces of another wavelength; its light is distributed alike, up to what the coarse grid knows.
    tell: leave what other wavelengths need to be told (see `spectral.py`). start: what a like scene's solve has left;
    wavelength: its number there.
    """
    if min(fine.grid.ground_node.shape) < 2 * _LEAST_COARSE:
        # without a coarser grid to help, the change of one sweep is a small part of what is yet to come
        # (nor does another wavelength's light help: what differs changes least of all)
        first = fine.nothing() if start is None else start.coarsest(fine, wavelength)
        values, _, n = fine.solve(first, 0.05 * tolerance, most)
        if start is not None:
            start.leave_coarsest(fine, wavelength, values)
        return Solution(Moments(fine.place, values), fine.coarser, [n], [], fine.fluxes(), fine.ratio)
    begun = begin_from_coarse(fine, tolerance, most, like, finer, start, wavelength)
    level, below = begun.level, begun.below
    first = begun.values[:, :ALIKE]
    told = (copied(first), begun.told_fluxes()) if tell else None
    if like:
        trace = like[len(below.sweeps) - 1]
        level.amends, level.ratio = False, trace.ratio

        def add_defect(some: slice) -> None:
            first[some] += trace.defect[some] * told_ratio(first[some, :1], trace.start[some])

        by_blocks(add_defect, len(first))
    else:
        begins, first = first, copied(first) if told is None else told[0]
        if start is not None:
            start.add_defects(level, begins)
    # the last sweep of that other wavelength, and what the guess adds
    enough = (2 if like else 1) * tolerance
    if finer:
        enough *= _CLOSE if finer == _WHOLE else _LOOSE
    elif fine.grid.periodic:
        enough = _ENDLESS * tolerance
    values, before, n = level.solve(begun.values, enough, most, correct=_Correction(level, begun.base))
    traces = []
    if not like:
        mean, defect = first[:, :1].copy(), np.empty_like(first)
        by_blocks(lambda some: np.subtract(before[some, :ALIKE], first[some], out=defect[some]), len(first))
        traces = [*below.traces, Trace(level.place >= 0, mean, defect, level.ratio)]
        if start is not None:
            start.leave(level, mean, defect)
    return Solution(
        Moments(level.place, values), level.coarser, [*below.sweeps, n], traces, level.fluxes(), level.ratio, told
    )  # fmt: skip


class _Correction:
    """What will follow from the change of a sweep of the full grid, as the 2x2-coarse grid sees it."""

    def __init__(self, fine: Sweeper, base: Sweeper):
        self.fine = fine
        kept = np.flatnonzero((fine.place >= 0).any(axis=(1, 2)))
        self.levels = slice(int(kept[0]), int(kept[-1]) + 1) if kept.size else slice(0, 1)
        self.dark = base.unlit(self.levels)
        self.weight = total_extinction(fine.grid)[self.levels]

    def __call__(self, before: F32, image: F32, lasting: bool) -> None:
        means = self.dark.pool.take("means", *self.dark.shape)
        if not means.size:
            return
        place = np.ascontiguousarray(self.fine.place[self.levels])
        nx = self.fine.grid.ground_node.shape[1]
        in_threads(restrict, place, before, image, self.weight, nx, self.dark.place, means, parts=_PARTS)
        follows = Moments(self.dark.place, self.dark.answer(means, lasting))
        in_threads(
            prolong, follows, self.dark.grid.ground_node.shape[1], self.dark.coarser, place, nx, image, True,
            parts=_PARTS,
        )  # fmt: skip
