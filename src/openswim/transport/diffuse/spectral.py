"""Wavelengths between others: what the coarse grid does not know of their light is known from both sides.

A full grid costs as much at every wavelength, yet what it adds to a 2x2-coarse one hardly depends on it: clouds are cut
up alike. Where the medium changes smoothly, moments at a wavelength between two that have been swept are

    I = c + (1 - t) (I_a - c_a) r_a + t (I_b - c_b) r_b,    t = (lambda - lambda_a)/(lambda_b - lambda_a),

c being what the coarse grid tells of each and r the ratio of its mean radiances. From the third degree on c is left
out, for a blue sky has no such moments: I = (1 - t) I_a r_a + t I_b r_b. Fluxes are as the first moments.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from openswim.transport.diffuse.earlier import Start
from openswim.transport.diffuse.moments import Moments
from openswim.transport.diffuse.multigrid import ALIKE, Solution, Trace, begin_from_coarse, by_blocks, told_ratio
from openswim.transport.diffuse.sweeper import Sweeper
from openswim.transport.engine.decisions import Decisions
from openswim.transport.engine.types import FLOAT

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]

_WIDEST = 1.5  # ratio of wavelengths that tell of what is between them
# How far a wavelength may lie off the straight line between two others
_SPECIES = 0.02  # in a species' extinction and the moments of its scattering, of its extinction
_ALBEDO = 2e-3  # in its single-scattering albedo, for light is scattered many times
_GROUND = 0.1  # in the mean albedo of the ground
_GASES = 0.02  # in the optical depth of the air's absorption, from the grid's lowest level to its highest


class Known(NamedTuple):
    """A wavelength that has been solved, and its share in another."""

    wavelength_nm: float
    properties: F64  # see `properties_of`
    solution: Solution
    share: float = 1.0

    @property
    def told(self) -> tuple[F32, F32]:
        """See `Solution`."""
        assert self.solution.told is not None
        return self.solution.told


def in_order(wavelengths_nm: F64) -> list[int]:
    """Indices of wavelengths: the shortest and the longest of them first."""
    ends = {int(np.argmin(wavelengths_nm)), int(np.argmax(wavelengths_nm))}
    return [*sorted(ends), *(w for w in range(len(wavelengths_nm)) if w not in ends)]


def properties_of(sweeper: Sweeper) -> F64:
    """Of species, gases and ground at a wavelength, in units of what they may lie off a straight line."""
    grid = sweeper.grid
    extinction = np.maximum(grid.scaled.astype(float), 1e-30)
    lost = 1 - grid.scattering[:, 0] / extinction
    moments = grid.scattering[:, 1:] / extinction[:, None]
    ground = [float(sweeper.ground_albedo.mean()) / _GROUND]
    gases = [float(np.trapezoid(grid.air_extinction - grid.air_scattering[:, 0], grid.levels_m)) / _GASES]
    return np.concatenate([np.log(extinction) / _SPECIES, moments.ravel() / _SPECIES, lost / _ALBEDO, gases, ground])


def on_both_sides(
    wavelength_nm: float, properties: F64, known: Sequence[Known], decide: Decisions | None = None
) -> list[Known]:
    """The nearest of the ``known`` wavelengths on both sides with their shares; none where they do not tell of it."""
    able = [k for k in known if k.solution.told is not None]
    shorter = [k for k in able if k.wavelength_nm <= wavelength_nm]
    longer = [k for k in able if k.wavelength_nm > wavelength_nm]
    if not shorter or not longer:
        return []
    a = max(shorter, key=lambda k: k.wavelength_nm)
    b = min(longer, key=lambda k: k.wavelength_nm)
    t = (wavelength_nm - a.wavelength_nm) / (b.wavelength_nm - a.wavelength_nm)
    decide = decide or Decisions()
    off = np.abs(properties - (1 - t) * a.properties - t * b.properties).max()
    if not decide("between", lambda: bool(off <= 1 and b.wavelength_nm <= _WIDEST * a.wavelength_nm)):
        return []
    return [a._replace(share=1 - t), b._replace(share=t)]


def between(
    fine: Sweeper, tolerance: float, most: int, like: list[Trace] | None, sides: Sequence[Known],
    start: Start | None = None, wavelength: int = 0,
) -> Solution:  # fmt: skip
    """The solution of a wavelength between others, whose moments are of the light at the nodes, as its own are then."""
    begun = begin_from_coarse(fine, tolerance, most, like, 0, start, wavelength)
    values = begun.values

    def amend(some: slice) -> None:
        own, mean = values[some], values[some, :1].copy()
        own[:, ALIKE:] = 0
        for k in sides:
            solved, coarse = k.solution.moments.values[some], k.told[0][some]
            counts = FLOAT(k.share) * told_ratio(mean, coarse[:, :1])
            own[:, :ALIKE] += counts * (solved[:, :ALIKE] - coarse)
            own[:, ALIKE:] += counts * solved[:, ALIKE:]

    by_blocks(amend, len(values))
    told_fluxes = begun.told_fluxes()
    fluxes = told_fluxes.copy()
    for k in sides:
        coarse = k.told[1]
        fluxes += FLOAT(k.share) * told_ratio(told_fluxes, coarse) * (k.solution.fluxes - coarse)
    return Solution(Moments(begun.level.place, values), begun.level.coarser, [*begun.below.sweeps, 0], [], fluxes, None)
