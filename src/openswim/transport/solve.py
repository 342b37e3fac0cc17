"""From matter, ground and a sun to a field of light, which serves every camera.

`Field.view` turns it into what rays see; only that repeats from camera to camera.
"""

from __future__ import annotations

import time
import warnings

import numpy as np
from numpy.typing import NDArray

from openswim.optics.matter import Matter
from openswim.options import Options
from openswim.transport.air.shells import build_shells, no_volume
from openswim.transport.engine.pack import PACK
from openswim.transport.field import Field
from openswim.transport.ground_light.fluxes import Lighting
from openswim.transport.lit.lit_grid import CLEAR_REACH_DEG, CLEAR_STEP, LitGrid
from openswim.transport.march.forward_peak import peak_tables
from openswim.transport.march.volume import DEGREE
from openswim.transport.medium.medium import air_of
from openswim.transport.medium.surface import Surface
from openswim.transport.medium.tiles import lit_in_parts
from openswim.transport.montecarlo.reference import ReferenceField, solve_reference
from openswim.transport.solve_grid import light_of_grid, sun_range
from openswim.transport.tiled import solve_large

F64 = NDArray[np.float64]


def solve(options: Options, matter: Matter, surface: Surface, sun: F64) -> Field | ReferenceField:
    """Solve the field of light of ``matter`` over ``surface``, at their wavelengths, lit from ``sun`` (3,)."""
    sun = sun / np.linalg.norm(sun)
    if options.name == "reference":
        if matter.wider is not None:
            warnings.warn("solver reference sees the innermost of nested grids alone", stacklevel=3)
        return solve_reference(options, matter, surface, sun)
    large = lit_in_parts(matter.grid, matter.cover is not None)
    solve_pack = _clear_light if matter.grid is None else solve_large if large else _nested_light
    packs = []
    for first in range(0, matter.wavelengths_nm.size, PACK):
        which = np.minimum(np.arange(first, first + PACK), matter.wavelengths_nm.size - 1)
        count = len(np.unique(which))
        packs.append(solve_pack(options, matter.at(which), surface.at_wavelengths(which), sun, count))
    return Field(packs)


def _clear_light(options: Options, matter: Matter, surface: Surface, sun: F64, count: int) -> LitGrid:
    """Light without a grid: the shells are all."""
    started = time.perf_counter()
    frame = matter.frame
    lighting = Lighting.of_clear_sky(surface, frame)
    air = air_of(matter.air, lighting.ground_m)
    shells = build_shells(
        air, sun_range(sun, CLEAR_REACH_DEG), frame.radius_m, lighting.ground_m, lighting.mean_albedo, DEGREE,
        lighting.ground_m + 1e5, 1.5 * CLEAR_STEP,
    )  # fmt: skip
    table = peak_tables([air.aerosol_phase], DEGREE) if air else np.zeros((1, 2, 2, PACK), np.float32)
    lighting.light_clear(shells, sun)
    return LitGrid(
        options, surface, matter.air, frame, sun, matter.wavelengths_nm, count, shells, no_volume(), table, lighting,
        timings={"sun": 0.0, "diffuse": time.perf_counter() - started},
    )  # fmt: skip


def _nested_light(options: Options, matter: Matter, surface: Surface, sun: F64, count: int) -> LitGrid:
    """Light of a grid, and of the wider ones around it, the widest first."""
    levels: list[tuple[Matter, Surface]] = [(matter, surface)]
    while (around := levels[-1][0].wider) is not None and (ground := levels[-1][1].wider) is not None:
        levels.append((around, ground))
    found = None
    for level, ground in reversed(levels):
        found = light_of_grid(options, level, ground, sun, count, found)
    assert found is not None
    return found.lit
