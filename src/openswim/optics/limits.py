"""At which wavelengths light can be solved for, and what is to be said of them."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from openswim.errors import UserError
from openswim.optics.gas_bands import WIDTH_NM, banded

if TYPE_CHECKING:
    from openswim.scene.atmosphere import Atmosphere

SHORTEST_NM, LONGEST_NM = 280.0, 1700.0
_TABLES_FROM_NM = 400.0  # droplets, aerosol types, land and snow


def check_wavelengths(wavelengths_nm: NDArray[np.float64]) -> None:
    """Refuse wavelengths (nwl,) of which what air, cloud and ground do is not known."""
    if wavelengths_nm.ndim != 1 or wavelengths_nm.size == 0 or not np.isfinite(wavelengths_nm).all():
        raise UserError("wavelengths: give one or more numbers in nm, such as 615,546,450")
    if wavelengths_nm.max() > LONGEST_NM:
        raise UserError(
            f"wavelength {wavelengths_nm.max():g} nm: the bands of gases, the ground and the heat radiation of air and "
            f"cloud are not known here beyond {LONGEST_NM:g} nm: give {SHORTEST_NM:g} to {LONGEST_NM:g} nm"
        )
    if wavelengths_nm.min() < SHORTEST_NM:
        raise UserError(
            f"wavelength {wavelengths_nm.min():g} nm: the absorption of ozone is not known below {SHORTEST_NM:g} nm, "
            f"where it ends all sunlight: give {SHORTEST_NM:g} to {LONGEST_NM:g} nm"
        )


def stated(wavelengths_nm: NDArray[np.float64], atmosphere: Atmosphere | None = None) -> list[str]:
    """What is taken for granted at wavelengths (nwl,), for a picture's assumptions."""
    found = []
    short = [f"{w:g}" for w in wavelengths_nm if w < _TABLES_FROM_NM]
    if short:
        found.append(f"{', '.join(short)} nm: droplets, aerosol types and ground as at {_TABLES_FROM_NM:g} nm")
    bands = [f"{w:g}" for w in banded(wavelengths_nm)]
    if bands and atmosphere is not None:
        found.append(
            f"{', '.join(bands)} nm: means over {WIDTH_NM:g} nm, in which gases absorb; water vapour the same all "
            f"over, {atmosphere.precipitable_water_cm():.2f} cm above sea level"
        )
    return found
