"""The diffuse field of `fast`: ordinates swept through the grid until the source they carry no longer changes."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numba import config, get_num_threads, set_num_threads
from numpy.typing import NDArray

from openswim.transport.diffuse.anderson import Anderson
from openswim.transport.diffuse.diffusion import Diffusion
from openswim.transport.diffuse.moments import (
    Coarser,
    nothing_coarser,
    places,
    scale,
    squares,
    weighted_change,
)
from openswim.transport.diffuse.optical_grid import (
    OpticalGrid,
    coarsen,
    coarser_grid,
    thick_blocks,
    total_extinction,
    unlit_grid,
    with_ghosts,
)
from openswim.transport.diffuse.ordinate_transform import BLOCK, Groups, in_groups
from openswim.transport.diffuse.sweep import Half, Hemisphere, Room, half_sweep
from openswim.transport.engine.decisions import Decisions
from openswim.transport.engine.ordinates import LEVEL, Ordinates, double_gauss, lebedev
from openswim.transport.engine.pack import LANES
from openswim.transport.engine.scratch import Pool
from openswim.transport.engine.threads import in_threads
from openswim.transport.engine.types import FLOAT

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]

_FEW_COLUMNS = 500  # fewer than these are swept by one thread
_MOST_CORRECTIONS = 30  # where the coarse grid has not told the rest by then, it is misleading
_SETTLED = 12  # sweeps after which light no longer grows: each change was told by the light it began with
_LEAST_GROUP = 10  # ordinates that share a pass over the moments
_STRIP = 32  # rows of a plane that an ordinate crosses together
_LEAVES = 2.0  # tolerances that what leaves may change by: decks of 100 to 3000 do by 28 where light lacks, else by 1.3
_SLOW = 1.6  # change over what follows it, where a sweep leaves two fifths
_FOLLOWED = 8  # coarse sweeps between two fine ones
_LASTING = 0.04  # share of what follows that the last of them adds, above which there is more to come
_FALLING = 0.5  # of a change at most is the next, where what corrections tell can be trusted as it is
_GROWN = 4.0  # times the least change, or as much half-way, at which diffusion is seen to mislead,
_ASTRAY = 0.05  # if it is more than this of the light: mixed changes go up and down
_ANSWERED = 3  # degrees of the moments that they mend
DARK = 1e-12  # light of a node that nothing is made of
_LEAST_RATIO = FLOAT(0.05)  # of light that steps take to that at a node


@dataclass
class Sweeper:
    """Everything one grid needs to sweep one wavelength; `sweep` maps moments to moments."""

    grid: OpticalGrid
    inflow: F32  # (ordinates, nz), in the order of `ordinates`
    sides: F32 | None  # (ordinates, nz, 4, nodes) in its place at the sides, see `sides.py`
    ground_albedo: F32
    direct_flux: F32
    ordinates: Ordinates
    halves: tuple[tuple[Half, Groups], tuple[Half, Groups]]
    coarser: Coarser
    place: NDArray[np.int32]
    extinction: F32  # of grid and ghosts, 1/m, and planes for what cloud on the ground is to each thread
    pool: Pool
    decide: Decisions  # what is kept, and the course of the iteration
    on_ground: bool = True  # whether its lowest level may be the ground's
    amends: bool = True  # moments are of the light that the steps around a node take (decision 15), not of its own
    ratio: F32 | None = None  # (blocks, BLOCK) of these two in the last sweep, or what is given for them

    @classmethod
    def of(
        cls, grid: OpticalGrid, inflow: F32, ground_albedo: F32, direct_flux: F32, ordinates: Ordinates, pool: Pool,
        sides: F32 | None = None, decide: Decisions | None = None,
    ) -> Sweeper:  # fmt: skip
        """A sweeper that keeps every block that scatters. ``pool`` may be shared: one sweeps at a time."""
        decide = decide or Decisions()
        directions, weights = ordinates.direction, ordinates.weight
        nz, (ny, nx) = len(grid.levels_m), grid.ground_node.shape
        degree = grid.air_scattering.shape[1]
        down = directions[:, 2] >= 0
        halves = []
        for half in (down, ~down):
            group = in_groups(directions[half], weights[half].astype(FLOAT), degree, _LEAST_GROUP)
            here = np.flatnonzero(half)
            if sides is not None:
                edges = np.ascontiguousarray(sides[here])
            else:
                known = (nz, 4, max(nx, ny)) if grid.periodic else (1, 4, 0)
                edges = np.zeros((len(here), *known), FLOAT)
            halves.append(
                (Half(directions[here], weights[here].astype(FLOAT), np.ascontiguousarray(inflow[here].T), edges),
                 group)
            )  # fmt: skip
        extinction = with_ghosts(total_extinction(grid), nx, grid.periodic)
        shared = 2 * config.NUMBA_NUM_THREADS if _cloud_on_ground(grid) else 0  # type: ignore[attr-defined]
        kept = decide("kept", lambda: grid.cloudy | (grid.air_scattering[:, 0] > 0)[:, None, None])
        return cls(
            grid, inflow, sides, ground_albedo, direct_flux, ordinates, (halves[0], halves[1]), nothing_coarser(degree),
            places(kept), np.pad(extinction, [(0, shared), (0, 0), (0, 0)]) if shared else extinction, pool,
            decide,
        )  # fmt: skip

    def __post_init__(self) -> None:
        up, _ = self.halves[1]
        # discrete flux of unit radiance, so that the ground gives back what it takes
        self.unit_flux = float((up.weight * np.abs(up.direction[:, 2])).sum() / (4 * np.pi))
        self.down_flux = np.zeros(self.grid.ground_node.shape, FLOAT)
        self.up_flux = np.zeros(self.grid.ground_node.shape, FLOAT)

    def as_coarser(self, values: F32, ratio: F32 | None) -> Coarser:
        """What its solution, moments and their ratio to the nodes' own, is to a grid of twice the columns each way."""
        grid, values = self.grid, values.copy()
        of_nodes(values, ratio)
        beam = np.minimum(grid.beam, 1)  # what is thin has no cloud's part in it
        return Coarser(
            2, grid.ground_node.shape[1], self.place, values,
            np.ones((len(values), BLOCK), FLOAT) if ratio is None else ratio,
            beam, grid.sun_harmonics, grid.extinction,
        )  # fmt: skip

    def over(self, coarser: Coarser, kept: NDArray[np.bool_] | None = None) -> Sweeper:
        """The same, keeping moments where it is thick, or what is told, over a coarser field."""
        kept = self.decide("thick", lambda: thick_blocks(self.grid)) if kept is None else kept
        return replace(self, coarser=coarser, place=places(kept))

    def coarsened(self) -> Sweeper:
        """The same on 2x2 columns."""
        decide = self.decide.within("coarser")
        return Sweeper.of(
            coarser_grid(self.grid).decided(decide), self.inflow, coarsen(self.ground_albedo),
            coarsen(self.direct_flux), self.ordinates, self.pool, None if self.sides is None else pairs(self.sides),
            decide,
        )  # fmt: skip

    def unlit(self, levels: slice) -> Sweeper:
        """The thick part of the medium between some levels, with no light of its own."""
        cut = unlit_grid(self.grid, levels)
        on_ground = FLOAT(levels.start == 0)
        # a few ordinates answer as well, which tell three degrees apart; level ones are not for flat cells
        level = (np.abs(self.ordinates.direction[:, 2]) < LEVEL).any()
        few = lebedev(14) if level else double_gauss(3, 5)
        cut = cut._replace(
            scattering=np.ascontiguousarray(cut.scattering[:, :_ANSWERED]),
            air_scattering=np.ascontiguousarray(cut.air_scattering[:, :_ANSWERED]),
        )  # fmt: skip
        dark = Sweeper.of(
            cut, np.zeros((len(few.direction), len(cut.levels_m)), FLOAT), on_ground * self.ground_albedo,
            0 * self.direct_flux, few, self.pool, decide=self.decide.within("unlit"),
        )  # fmt: skip
        extinction = dark.extinction if levels.start == 0 else dark.extinction[: len(cut.levels_m)]
        kept = dark.decide("thick", lambda: thick_blocks(cut))
        return replace(
            dark, place=places(kept), extinction=extinction, on_ground=levels.start == 0, amends=False, ratio=None
        )

    def answer(self, change: F32, lasting: bool) -> F32:
        """What follows from a ``change`` of the moments in the `unlit` medium: of the next `_FOLLOWED` sweeps and, if
        ``lasting``, what diffusion tells of the rest."""
        lit = self.pool.take("lit", *change.shape)
        image = self.sweep(change, self.pool.take("answer", *change.shape))
        for _ in range(_FOLLOWED - 1):
            image = self.sweep(np.add(image, change, out=lit), image)
        if lasting:
            last = image[:, 0] - (lit[:, 0] - change[:, 0])
            if self.decide("lasts", lambda: bool(np.linalg.norm(last) > _LASTING * np.linalg.norm(image[:, 0]))):
                self.diffusion.add(self.place, last, image)
        return image

    @cached_property
    def diffusion(self) -> Diffusion:
        """How light goes on when sweeps have long been done."""
        return Diffusion(self.grid, self.ground_albedo, self.on_ground, self.decide)

    @cached_property
    def _going_round(self) -> list[F32]:
        """Light that a sweep leaves at the sides of a period, for the next one to begin from."""
        return [half.edges for half, _ in self.halves] if self.grid.periodic else []

    @cached_property
    def shape(self) -> tuple[int, int, int]:
        """Of the moments."""
        return int(self.place.max()) + 1, self.grid.air_scattering.shape[1] ** 2, BLOCK

    def nothing(self) -> F32:
        """Moments of darkness."""
        return np.zeros(self.shape, FLOAT)

    def fluxes(self) -> F32:
        """Of the last sweep (2, ny, nx): down to the ground, up through the top."""
        return np.stack([self.down_flux, self.up_flux])

    def sweep(self, values: F32, out: F32 | None = None) -> F32:
        """One pass over all ordinates; ``out``, an earlier result of a like sweep, is written over."""
        new = np.empty_like(values) if out is None else out
        threads = get_num_threads()
        if self.ground_albedo.size < _FEW_COLUMNS:  # meeting would take longer than the sweep
            set_num_threads(1)
        try:
            self._sweep_halves(values, new)
        finally:
            set_num_threads(threads)
        return new

    def _sweep_halves(self, values: F32, new: F32) -> None:
        """Down, then up from the ground that the first half has lit."""
        radiance = np.zeros_like(self.ground_albedo)
        room = self.room(get_num_threads())
        down, up = self.halves
        self.down_flux = half_sweep(self.hemisphere(True, radiance, room), down[1], values, new)
        arriving = self.ground_albedo * (self.direct_flux + self.down_flux)
        radiance = np.asarray(arriving / FLOAT(self.unit_flux), FLOAT)
        self.up_flux = half_sweep(self.hemisphere(False, radiance, room), up[1], values, new)
        if self.amends:
            first = new[:, 0]
            more = room.more.sum(axis=0)
            part = np.divide(more, first, out=np.zeros_like(more), where=first > DARK)
            self.ratio = np.maximum(1 + part, _LEAST_RATIO)
        if self.ratio is not None:
            in_threads(scale, new, self.ratio)

    def hemisphere(self, downward: bool, ground_radiance: F32, room: Room) -> Hemisphere:
        """What its ordinates are carried through; ``ground_radiance`` (ny, nx) rises from below."""
        half, _ = self.halves[0 if downward else 1]
        highest = int(self.grid.ground_node.max())
        return Hemisphere(downward, self.grid, half, self.place, self.coarser, ground_radiance, highest, room)

    @cached_property
    def _layout(self) -> tuple[NDArray[np.int64], int, NDArray[np.int64], NDArray[np.int64]]:
        """See `Room`: ``row``, how many rows of ``thin``, ``thin_level``, ``near_cloud``."""
        grid, coarser = self.grid, self.coarser
        rows = coarser.beam.shape[1]
        wanted = np.stack([grid.present[:, 0], grid.present[:, 1:].any(axis=1)], axis=-1) & (coarser.factor > 0)
        thin_level = np.where(wanted, rows * (np.cumsum(wanted).reshape(-1, 2) - 1), -1)
        row = np.concatenate([[0], (self.place >= 0).sum(axis=2).ravel()]).cumsum()
        return row, int(wanted.sum()) * rows, thin_level.astype(np.int64), _near_cloud(grid)

    def room(self, threads: int) -> Room:
        """Scratch for sweeps by so many threads."""
        grid = self.grid
        nz, ny, columns = grid.beam.shape
        most = max(int(np.diff(group.first).max()) for _, group in self.halves)
        degree = grid.air_scattering.shape[1]
        row, thin_rows, thin_level, near_cloud = self._layout
        height = ny if grid.periodic else min(ny, _STRIP)
        ends = columns + 2
        f32 = self.pool.take
        return Room(
            self.extinction, f32("emission", most, self.shape[0], BLOCK), row,
            f32("thin", thin_rows, most, self.coarser.beam.shape[2] + LANES), thin_level,
            f32("light", threads, 2, height + 2, ends), f32("emitted", threads, 2, height + 2, ends),
            f32("amended", threads, 2, (height + 2) * self.amends, ends),
            f32("more", threads, self.shape[0] * self.amends, BLOCK), near_cloud,
            f32("front", threads, 2, nz, ends), f32("work", threads, 2, ends),
            f32("flux", threads, ny, grid.ground_node.shape[1]), f32("amounts", threads, 1 + len(grid.scaled), BLOCK),
            f32("terms", threads, degree**2, BLOCK),
        )  # fmt: skip

    def solve(
        self, values: F32, tolerance: float, most: int, memory: int = 3,
        correct: Callable[[F32, F32, bool], None] | None = None,
    ) -> tuple[F32, F32, int]:  # fmt: skip
        """Fixed point by Anderson acceleration over the last ``memory`` sweeps; inner products over l < 2.

        correct(before, image, lasting) adds to a sweep's result what is yet to follow from its change; the first
        `_MOST_CORRECTIONS` sweeps begin from that as it is, or mixed where it does not settle. Without it diffusion
        tells what follows, and with it what lasts; where changes grow, all begins anew from darkness without diffusion,
        and where they grow then, too, as between undivided cells of depths of hundreds, without what steps amend.
        Levels count by their change relative to their light, since little light under a thick cloud is seen too. The
        last change is within the tolerance, or, with corrections, what follows it by the rate of the last two; in
        periods that of what leaves has settled too, for of thick decks 3 % of it hide in a change of .1 %.
        Returns the moments, those before the last sweep, and how many sweeps there were; ``values`` is written over.
        """
        course = self.decide.within("course")

        def decide(name: str, now: bool) -> bool:
            return course(name, lambda: bool(now))

        level = np.nonzero(self.place >= 0)[0]
        recent = Anderson(memory)
        threads = get_num_threads()
        change = np.zeros(threads)
        before, least, began, lasting = 0.0, np.inf, np.inf, True
        leaves = np.inf
        spare = None
        for n in range(1, most + 1):
            image = self.sweep(values, recent.spare() if spare is None else spare)
            corrected = correct is not None and n <= _MOST_CORRECTIONS
            if corrected and correct is not None:
                correct(values, image, lasting)
            elif correct is None and lasting:
                self.diffusion.add(self.place, image[:, 0] - values[:, 0], image)
            size = np.zeros((threads, len(self.place)))
            in_threads(squares, values, image, level, change, size)
            size = size.sum(axis=0)
            changed = float(np.sqrt(change.sum() / max(size.sum(), 1e-30)))
            # without corrections a sweep may change little of what it has to
            follows = changed * changed / (before - changed) if correct is not None and before > changed else np.inf
            settled = min(changed, _SLOW * follows) <= tolerance
            if self.grid.periodic:
                left, leaves = leaves, float(self.fluxes().sum())
                settled &= abs(leaves - left) <= _LEAVES * tolerance * leaves
            enough = n == most or settled
            if decide("done", enough):
                break
            moved = float(np.sqrt(change.sum()))  # of light itself, not its share: that does not grow where both do
            began = moved if before == 0.0 else began  # what one sweep brings into the dark
            earlier, before, least = before, changed, min(least, moved)
            far = not changed <= _ASTRAY
            grown = far and not moved <= _GROWN * (least if lasting else began)
            anew = decide("astray", lasting and (grown or (far and n == most // 2)))
            if decide("adrift", grown and not lasting and self.amends):
                anew, self.amends, self.ratio = True, False, None
            if anew:
                for light in (values, *self._going_round):
                    light.fill(0.0)
                lasting, before, spare, recent = False, 0.0, image, Anderson(memory)
                continue
            if decide("falling", corrected and (n == 1 or changed < _FALLING * earlier)):
                values, spare, recent = image, values, Anderson(memory)
                continue
            spare = None
            weight = 1 / np.sqrt(np.maximum(size, 1e-12 * size.max(initial=0.0) + 1e-30))
            residual = np.empty((len(image), 4, BLOCK), FLOAT)
            in_threads(weighted_change, values, image, level, weight.astype(FLOAT), residual)
            if n > _SETTLED:  # all by the same light, or the greatest would seem to be nearest to its end
                recent.reweigh(weight, level)
            recent.mix(image, residual, weight, values, self._going_round)
        return image, values, n


def _near_cloud(grid: OpticalGrid) -> NDArray[np.int64]:
    """See `Room`."""
    cloudy = grid.cloudy.any(axis=(1, 2))
    beside = np.pad(cloudy, 1)
    return np.where(cloudy, 1, np.where(beside[:-2] | beside[2:], 2, 0))


def _cloud_on_ground(grid: OpticalGrid) -> bool:
    """Whether there is some at, or next to, a node on the ground."""
    j, i = np.indices(grid.ground_node.shape)
    return bool(grid.cloudy[grid.ground_node, j, i // BLOCK].any())


def of_nodes(values: F32, ratio: F32 | None) -> None:
    """Turn moments of the light around nodes (see `Sweeper.amends`) into those of the light at them."""
    if ratio is not None:
        in_threads(scale, values, 1 / ratio)


def pairs(sides: F32) -> F32:
    """Means of two nodes along the sides (the last one stands alone where their number is odd; short ones are filled
    with it)."""
    even = np.concatenate([sides, sides[..., -1:]], axis=-1) if sides.shape[-1] % 2 else sides
    return np.ascontiguousarray(0.5 * (even[..., ::2] + even[..., 1::2]))
