"""Whether humidity can be what a file says it is, in the unit that it says."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from openswim.errors import UserError
from openswim.readers.fields.air import relative_humidity
from openswim.scene.checks import checked_values
from openswim.scene.plausible_air import sampled, times_text
from openswim.scene.variables import Variable

F32 = NDArray[np.float32]

SPECIFIC = Variable("kg kg-1", "", 0.0, 0.06, clip=True, hint="is it in g/kg? 1000 times too large")
RELATIVE = Variable("1", "", 0.0, 3.0, clip=True, hint="is it in percent? 100 times too large")
_KNOWN_K, _KNOWN_PA = 233.0, 2e4  # warmer and lower, where air is never far from saturation
_WARM_K, _NO_VAPOUR, _DRY_SHARE = 250.0, 1e-7, 1e-3  # even sinking air over deserts has 1e-5 kg/kg
_MOIST, _DRY = 2.5, 0.015  # of saturation, in the mean: deserts and polar plateaus have 0.1 and more


def checked_humidity(name: str, values: F32, temperature_k: F32, pressure_pa: NDArray[Any], notes: list[str]) -> F32:
    """Specific humidity or mixing ratio of vapour (kg/kg, levels upward) within what air can hold.

    Noise below zero is clipped, with a note; beyond .06 kg/kg, or above 2.5 times saturation in the mean, it is
    refused; far below saturation everywhere it is told.
    """
    values = checked_values(name, values, SPECIFIC, notes)
    warm, pressure, vapour = (sampled(np.asarray(field)) for field in (temperature_k, pressure_pa, values))
    known = (warm > _KNOWN_K) & (pressure > _KNOWN_PA)
    dry = int((vapour[known & (warm > _WARM_K)] < _NO_VAPOUR).sum())
    if dry > _DRY_SHARE * known.sum():
        notes.append(f"{name} is zero at {dry} of {int(known.sum())} places in warm air: lost, or in another unit?")
    if not known.any() or not vapour.any():
        return values
    share = float(relative_humidity(pressure[known], warm[known], vapour[known]).mean())
    if share > _MOIST:
        smell = times_text(share)
        raise UserError(
            f"{name} is {share:.3g} times what saturated air holds, in the mean{f', {smell}' if smell else ''}: is it "
            "in g/kg, or temperature in another unit?"
        )
    if share < _DRY:
        notes.append(f"{name} is {100 * share:.2g} % of saturation in the mean: is it in the unit that the file says?")
    return values
