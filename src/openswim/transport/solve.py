"""From matter, ground and a sun to a field of light, which serves every camera.

`Field.view` turns it into what rays see; only that repeats from camera to camera.
"""

from __future__ import annotations

import time
import warnings

import numpy as np
from numpy.typing import NDArray

from openswim.lights.eclipses import MoonShadow
from openswim.optics.matter import Matter
from openswim.options import Options
from openswim.transport.air.dimmed import eclipse_of
from openswim.transport.air.shells import build_shells, no_volume
from openswim.transport.diffuse.earlier import EarlierLight
from openswim.transport.engine.pack import PACK
from openswim.transport.field import Field
from openswim.transport.ground_light.fluxes import Lighting
from openswim.transport.lit.lit_grid import CLEAR_REACH_DEG, CLEAR_STEP, LitGrid
from openswim.transport.medium.coefficients import aerosol_peaks
from openswim.transport.medium.medium import air_of
from openswim.transport.medium.surface import Surface
from openswim.transport.montecarlo.reference import ReferenceField, solve_reference
from openswim.transport.plan import Plan, plan_of
from openswim.transport.solve_grid import light_of_grid, sun_range
from openswim.transport.tiled import LitDomain, solve_large

F64 = NDArray[np.float64]


def solve(
    options: Options, matter: Matter, surface: Surface, sun: F64, plan: Plan | None = None,
    shadow: MoonShadow | None = None, earlier: EarlierLight | None = None, light: str = "sun",
) -> Field | ReferenceField:  # fmt: skip
    """Solve the field of light of ``matter`` over ``surface``, at their wavelengths, lit from ``sun`` (3,).

    plan: what has been decided, see `Plan`; what it lacks is decided now, and added to it. shadow: the moon's, in
    an eclipse of the sun. earlier: what the last solve of a scene like this by the same ``light`` has left, for `fast`
    to begin from; it then holds what this one leaves.
    """
    sun = sun / np.linalg.norm(sun)
    if plan is None:
        plan = plan_of(options, matter, surface, sun)
    else:
        plan.check(options, matter)
    if options.name == "reference":
        if matter.wider is not None:
            warnings.warn("solver reference sees the innermost of nested grids alone", stacklevel=3)
        return solve_reference(options, plan.medium, matter, surface, sun, shadow)
    packs: list[LitGrid | LitDomain] = []
    for pack, first in enumerate(range(0, matter.wavelengths_nm.size, PACK)):
        which = np.minimum(np.arange(first, first + PACK), matter.wavelengths_nm.size - 1)
        of_pack, ground, count = matter.at(which), surface.at_wavelengths(which), len(np.unique(which))
        if plan.medium is None:
            packs.append(_clear_light(options, of_pack, ground, sun, count, shadow))
        elif plan.medium.parts:
            packs.append(solve_large(options, plan, of_pack, ground, sun, count, shadow))
        else:
            name = f"{light} {pack}"
            packs.append(_nested_light(options, plan, pack, of_pack, ground, sun, count, shadow, earlier, name))
    return Field(packs, matter.terms, plan)


def _clear_light(
    options: Options, matter: Matter, surface: Surface, sun: F64, count: int, shadow: MoonShadow | None
) -> LitGrid:
    """Light without a grid: the shells are all."""
    started = time.perf_counter()
    frame = matter.frame
    lighting = Lighting.of_clear_sky(surface, frame)
    air = air_of(matter.air, lighting.ground_m)
    shells = build_shells(
        air, sun_range(sun, CLEAR_REACH_DEG), frame.radius_m, lighting.ground_m, lighting.mean_albedo,
        lighting.ground_m + 1e5, 1.5 * CLEAR_STEP,
    )  # fmt: skip
    eclipse = eclipse_of(shadow, sun, matter.wavelengths_nm, shells, air)
    shells = shells if eclipse is None else eclipse.dimmed.of(shells)
    lighting.light_clear(shells, sun)
    return LitGrid(
        options, surface, matter.air, frame, sun, matter.wavelengths_nm, count, shells, no_volume(), aerosol_peaks(air),
        lighting, timings={"sun": 0.0, "diffuse": time.perf_counter() - started}, eclipse=eclipse,
    )  # fmt: skip


def _nested_light(
    options: Options, plan: Plan, pack: int, matter: Matter, surface: Surface, sun: F64, count: int,
    shadow: MoonShadow | None, earlier: EarlierLight | None, name: str,
) -> LitGrid:  # fmt: skip
    """Light of a grid, and of the wider ones around it, the widest first."""
    levels = [(plan, matter, surface)]
    while matter.wider is not None and surface.wider is not None and plan.wider is not None:
        plan, matter, surface = plan.wider, matter.wider, surface.wider
        levels.append((plan, matter, surface))
    found = None
    for number, (of_level, filled, ground) in reversed(list(enumerate(levels))):
        found = light_of_grid(
            options, of_level, pack, filled, ground, sun, count, found, shadow, earlier, f"{name} {number}"
        )
    assert found is not None
    return found.lit
