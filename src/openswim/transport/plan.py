"""What is decided before light is computed, and while it is: with it given, nothing is decided anew.

Levels, halvings, fineness and sizes of droplets are decided from matter and ground alone (`plan_of`); masks of cloud,
blocks whose moments are kept, wavelengths between others, sweeps and when to stop, as light is solved for the first
time. `Field.plan` has them all. Solved again by the same plan light is a function of values, as smooth as float32 is.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from openswim.errors import UserError
from openswim.optics.matter import Matter
from openswim.options import Options
from openswim.transport.engine.decisions import Decisions
from openswim.transport.medium.plan import Fineness, MediumPlan, lit_in_parts, plan_medium, plan_parts
from openswim.transport.medium.surface import Surface

F64 = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Plan:
    """Of one grid, and of the wider ones around it.

    options: what it was made for; shape: of the grid. medium: None where there is no grid. decided: by name, while
    light was solved (`Decisions`).
    """

    options: Options
    shape: tuple[int, ...]
    medium: MediumPlan | None
    wider: Plan | None = None
    decided: dict[str, list[Any]] = field(default_factory=dict)

    def check(self, options: Options, matter: Matter) -> None:
        """Refuse what the plan was not made for."""
        for name in ("name", "quality", "tolerance", "most_sweeps"):
            own, theirs = getattr(self.options, name), getattr(options, name)
            if own != theirs:
                raise UserError(f"the plan was made with {name} = {own}, this solver has {theirs}: solve without it")
        shape = () if matter.grid is None else matter.grid.shape
        if self.shape != shape:
            raise UserError(f"the plan is of a grid of {self.shape} nodes, the scene's has {shape}: solve without it")
        if self.medium is not None and matter.grid is not None and not self.medium.parts:
            self.medium.check_top(matter.grid, list(matter.species))
        if self.wider is not None and matter.wider is not None:
            self.wider.check(options, matter.wider)

    def decisions(self, pack: int) -> Decisions:
        """Those of a pack of wavelengths: the first is 0."""
        return Decisions(self.decided, f"pack {pack}/")

    @property
    def species(self) -> list[Sequence[str] | None]:
        """Names of the species of this grid and of the wider ones around it; None where they are not yet known."""
        own = None if self.medium is None else self.medium.species or None
        own = next(iter(self.decided.get("grid/species", [])), own)
        return [own, *([] if self.wider is None else self.wider.species)]

    def of_all_packs(self) -> Decisions:
        """Those that no wavelength changes."""
        return Decisions(self.decided, "grid/")


def plan_of(options: Options, matter: Matter, surface: Surface, sun: F64) -> Plan:
    """What is decided of matter over ``surface``, lit from ``sun`` (3,), before any light is computed."""
    wider = None
    if matter.wider is not None and surface.wider is not None and options.name != "reference":
        wider = plan_of(options, matter.wider, surface.wider, sun)
    if matter.grid is None:
        return Plan(options, (), None)
    fast, setting = options.name == "fast", options.setting
    if options.name == "reference":
        # the finer cells of coarse models are part of the scene that all solvers share
        asked = Fineness(refine=matter.frame.curved)
    elif lit_in_parts(matter.grid, matter.cover is not None):
        return Plan(options, matter.grid.shape, plan_parts(matter, surface.terrain_m), wider)
    else:
        asked = Fineness(fast, setting.divide, fast and setting.halved, fast)
    mu_sun = float(sun[2] / np.linalg.norm(sun))
    return Plan(options, matter.grid.shape, plan_medium(matter, surface.terrain_m, mu_sun, asked), wider)
