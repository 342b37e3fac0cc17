"""How matter is drawn on a grid of its own: decided once, from matter and ground, and not from how they are lit.

What `build_medium` then makes is a function of this plan and of the values, smooth where the optics are.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from openswim.errors import UserError
from openswim.optics.matter import Matter
from openswim.optics.species import OpticalSpecies
from openswim.scene.grid import Grid
from openswim.scene.interpolation import on_levels
from openswim.transport.engine.pack import LANES
from openswim.transport.medium.chart import check_span
from openswim.transport.medium.levels import (
    halvings_for,
    highest_cloud_m,
    large_levels,
    layer_levels,
    levels_above,
    own_levels,
    refined_levels,
    without_traces,
)
from openswim.transport.medium.subdivision import halved

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]

LARGE_COLUMNS = 320_000  # a little more than what readers cut from larger domains
LIGHT_OF_COLUMNS = (
    f"more than {LARGE_COLUMNS} columns: each column's diffuse light is solved by itself, whatever the quality, and "
    "the picture made part by part"
)
_BROKEN_CELL_M = 5000.0  # wider cells are broken into clouds where their cover is known
_MOST_FINER_NODES = 3_000_000
_MOST_HALVED_NODES = 10_000_000
# Of clouds broken by their cover, swept: up to 18 CPU s; where they are to be halved, up to 40 by what 3.4 million take
# (37); and without sweeps
_MOST_CLOUD_NODES, _MOST_HALVED_CLOUD_NODES, _MOST_PLAIN_NODES = 2_000_000, 4_500_000, 8_000_000
# Of such clouds in wide cells, each column lit by itself: up to 14 CPU s; and where they are to be halved, up to 24
_MOST_WIDE_NODES, _MOST_HALVED_WIDE_NODES = 9_500_000, 15_000_000
WIDE_CELL_M = 1200.0  # cells that share less light than sweeps would smear between them
_CELL_M, _CLOUD_CELL_M = 1500.0, 750.0  # wider cells are divided; where they are broken into clouds
_WITHOUT_SIDES_M = 1e8


@dataclass(frozen=True)
class Fineness:
    """What is asked of a medium. refine: divide levels that are too thick for sweeps, and drop those that have but
    traces of cloud; divide: columns too, up to
    `MOST_RESOLVED_NODES`, unless each is to be lit by itself or its clouds are broken by their cover; halve: columns
    once in any case, if that has not been done, those that are lit each by themselves if they are few enough then;
    extend: let cloud fade out above the highest level, and air go on."""

    refine: bool = True
    divide: bool = True
    halve: bool = False
    extend: bool = False


@dataclass(frozen=True, eq=False)
class MediumPlan:
    """How matter is drawn.

    own_levels_m (nz,): before columns are halved; columns (ny, nx) and cell_m (dx, dy): in the end. fineness: nodes per
    node of the grid each way, before any halving; halvings: of columns, whether of layers too. sideless: one column
    stands for all. layered: and is lit as layers are. soft_top: cloud fades out above the highest level. above_m:
    levels of air above all others. parts: lit part by part, on columns of the grid itself. species: their names.
    """

    own_levels_m: F64
    columns: tuple[int, int]
    cell_m: tuple[float, float]
    periodic: bool
    species: tuple[str, ...]
    fineness: int = 1
    halvings: tuple[bool, ...] = ()
    sideless: bool = False
    layered: bool = False
    soft_top: bool = False
    above_m: F64 | None = None
    parts: bool = False

    @property
    def halved_levels_m(self) -> F64:
        """Levels between which all is linear as it was drawn, or half-way between."""
        levels = self.own_levels_m
        for layers_too in self.halvings:
            levels = halved(levels, 0) if layers_too else levels
        return levels

    @property
    def drawn_shape(self) -> tuple[int, int, int]:
        """Nodes (nz, ny, nx) of the grid's own heights."""
        return (len(self.halved_levels_m), *self.columns)

    @property
    def divided(self) -> bool:
        """Whether columns are halved."""
        return bool(self.halvings)

    @property
    def stands_alone(self) -> bool:
        """Whether cells are so wide that columns are lit each by itself."""
        return stand_alone(self.periodic, min(self.cell_m), self.columns[1])

    def check(self, species: list[OpticalSpecies]) -> None:
        """Refuse matter that the plan is not of."""
        if self.species != tuple(one.name for one in species):
            raise UserError(
                f"the plan is of {', '.join(self.species) or 'clear air'}, the scene has "
                f"{', '.join(one.name for one in species) or 'none'}: solve without this plan"
            )

    def check_top(self, grid: Grid, species: Sequence[OpticalSpecies]) -> None:
        """Refuse cloud above the plan's levels, which end above that of the scene that they were made for."""
        top_m = float(self.own_levels_m[-1])
        if not species or top_m >= grid.height_m[-1].min():  # levels as high as the grid hold any cloud
            return
        cloud_m = highest_cloud_m(grid.height_m, np.sum([s.extinction_per_m for s in species], axis=0))
        if cloud_m > top_m:
            raise UserError(
                f"the plan's levels end {top_m / 1e3:.1f} km high, the scene has cloud up to {cloud_m / 1e3:.1f} km: "
                "solve without this plan"
            )


def stand_alone(periodic: bool, cell_m: float, columns: int) -> bool:
    """Whether each column is lit by itself, where there are so many in a row and cells are so wide."""
    return not periodic and cell_m >= WIDE_CELL_M and columns >= LANES


def lit_in_parts(grid: Grid | None, covered: bool) -> bool:
    """Whether a grid has too many columns to be lit at once; covered: whether its clouds' cover is known."""
    if grid is None or grid.shape[1] * grid.shape[2] <= LARGE_COLUMNS:
        return False
    return not grid.periodic and grid.curved and not (covered and min(grid.spacing_m()) > _BROKEN_CELL_M)


def plan_parts(matter: Matter, terrain_m: F32) -> MediumPlan:
    """The plan of a domain that is lit part by part; its species are known once they have been made."""
    grid = matter.grid
    assert grid is not None
    check_span(grid)
    levels = large_levels(grid.height_m, terrain_m, min(grid.spacing_m()), matter.highest_m)
    return MediumPlan(levels, grid.shape[1:], grid.spacing_m(), False, (), parts=True)


def plan_medium(matter: Matter, terrain_m: F32, mu_sun: float, asked: Fineness) -> MediumPlan:
    """How matter over ground ``terrain_m`` (ny, nx) is drawn where the sun's zenith angle has the cosine ``mu_sun``."""
    grid = matter.grid
    if grid is None:
        raise UserError("this scene has no grid")
    check_span(grid)
    species = list(matter.species)
    heights, (_, ny, nx) = grid.height_m, grid.shape
    dx, dy = grid.spacing_m()
    total = np.sum([s.extinction_per_m for s in species], axis=0) if species else None
    cover = matter.cover if species else None
    levels = own_levels(heights, terrain_m, grid.curved)
    fields = [s.extinction_per_m for s in species] + ([] if cover is None else [cover])
    sideless = grid.periodic and not terrain_m.any() and all((field == field[:, :1, :1]).all() for field in fields)
    cell_m, divisions = min(dx, dy), 0
    if sideless:
        # plane-parallel: one column without sides, so that level light need not be chased around the period
        dx = dy = _WITHOUT_SIDES_M
        ny = nx = 1
    layered = asked.refine and sideless and matter.air is None and cover is None
    if asked.refine and total is not None and not sideless:
        levels = without_traces(levels, heights, total)
    if layered and total is not None:
        own_heights = heights.reshape(len(heights), -1)[:, 0]
        levels = layer_levels(levels, np.interp(levels, own_heights, total[:, 0, 0], 0.0, 0.0), mu_sun)
    elif asked.refine:
        sides = not sideless and cover is None and cell_m < WIDE_CELL_M
        if asked.divide and sides:
            divisions = halvings_for(levels, heights, total, cell_m, ny * nx)
        share = 1.0  # on the Earth, where levels do not follow the hour
        if sideless:
            share = 0.35 * max(mu_sun, 0.12)  # of one column, levels cost little
        elif not grid.curved:
            share = float(np.clip(2 * mu_sun, 0.2, 1.0))  # a low sun's beam fades within less height

        def levels_of(alone: bool) -> F64:
            return refined_levels(
                levels, heights, total, min(dx, dy) / 2**divisions, ny * nx * 4**divisions, share, sides, alone
            )

        fewer = levels_of(True)
        parts = 1
        if grid.curved:
            parts = fineness_of((len(fewer), ny, nx), cell_m, cover is not None, True, asked.halve)
        levels = fewer if stand_alone(grid.periodic, cell_m / parts, parts * nx) else levels_of(False)
    fineness = 1
    if grid.curved and (asked.refine or cover is not None):
        fineness = fineness_of((len(levels), ny, nx), cell_m, cover is not None, asked.refine, asked.halve)
    last = 0 if grid.periodic else fineness - 1  # beyond the last node only the next period begins
    plan = MediumPlan(
        levels, (fineness * ny - last, fineness * nx - last), (dx / fineness, dy / fineness), grid.periodic,
        tuple(one.name for one in species), fineness, sideless=sideless, layered=layered,
    )  # fmt: skip
    for _ in range(divisions):
        plan = _halved(plan)
    if asked.halve and not plan.divided and not plan.stands_alone:
        plan = _halved(plan)
    return _extended(plan, matter, species, ny, nx) if asked.extend else plan


def _halved(plan: MediumPlan) -> MediumPlan:
    """With columns half as wide, and then layers no taller; not if there would be more than `_MOST_HALVED_NODES`, nor
    without sides."""
    nz, ny, nx = plan.drawn_shape
    if ny * nx == 1 or 4 * nz * ny * nx > _MOST_HALVED_NODES:
        return plan
    cell_m = (plan.cell_m[0] / 2, plan.cell_m[1] / 2)
    tall = bool(np.median(np.diff(plan.halved_levels_m)) > 1.2 * min(cell_m)) and 8 * nz * ny * nx <= _MOST_HALVED_NODES
    ends = 0 if plan.periodic else 1
    return replace(
        plan, columns=(2 * ny - ends, 2 * nx - ends), cell_m=cell_m, halvings=(*plan.halvings, tall)
    )  # fmt: skip


def _extended(plan: MediumPlan, matter: Matter, species: list[OpticalSpecies], ny: int, nx: int) -> MediumPlan:
    """With cloud that does not end at the highest level, where sweeps lose light, and on to where little air is left:
    what clouds light there is the medium's to know."""
    assert matter.grid is not None
    heights, levels = matter.grid.height_m, plan.halved_levels_m
    soft = not plan.layered and any(
        on_levels(s.extinction_per_m[:, :ny, :nx], heights, levels[-1:], matter.grid.curved).any() for s in species
    )
    if soft:
        levels = np.append(levels, 2 * levels[-1] - levels[-2])
    above = levels_above(levels) if matter.air is not None else np.zeros(0)
    return replace(plan, soft_top=soft, above_m=above if above.size else None)


def fineness_of(shape: tuple[int, int, int], cell_m: float, broken: bool, refine: bool, halve: bool = False) -> int:
    """Into how many a cell of a grid (nz, ny, nx) is divided each way; ``broken``: into clouds, by their cover;
    ``halve``: see `Fineness`."""
    nz, ny, nx = shape
    most_wide = _MOST_HALVED_WIDE_NODES if halve else _MOST_WIDE_NODES
    most_swept = _MOST_HALVED_CLOUD_NODES if halve else _MOST_CLOUD_NODES
    wanted, most = _CELL_M, _MOST_FINER_NODES
    if broken:
        wanted, most = _CLOUD_CELL_M, most_swept if refine else _MOST_PLAIN_NODES
    fineness = 1
    while cell_m / fineness > wanted:
        wide = broken and refine and cell_m / (2 * fineness) >= WIDE_CELL_M
        if (2 * fineness * ny) * (2 * fineness * nx) >= (most_wide if wide else most) // nz:
            break
        fineness *= 2
    return fineness
