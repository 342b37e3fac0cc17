"""A climatology of aerosol: optical depth by place and day of the year, from the Linke turbidity of clear skies.

The map (SoDa; Remund et al. 2003, monthly means on 1/12 degree) comes with pvlib, an optional dependency. Turbidity
holds aerosol and water vapour; Ineichen (2008, Solar Energy 82, 1095, Eq. 11) tells them apart:

    T_L = 3.91 exp(0.689 p0/p) tau_550 + 0.376 ln w + 2 + 0.54 p0/p - 0.5 (p0/p)^2 + 0.16 (p0/p)^3

with the pressure p at the ground, p0 at sea level, and w, precipitable water in cm. That is not in the map: it is taken
from the columns of the five AFGL model atmospheres (Anderson et al. 1986) by latitude and season, thinning with the
height of the ground by 1/e in 2 km. Half as much or twice as much water shifts tau_550 by .03 at sea level.
"""

from __future__ import annotations

import warnings
from typing import Any

import numpy as np

from openswim.errors import UserError
from openswim.scene.atmosphere import us_standard_pressure_temperature

LEAST_DEPTH = 0.01  # cleaner skies are within the error of the relation
_LATITUDES = (15.0, 45.0, 60.0)  # of the AFGL atmospheres: tropical, mid-latitude, subarctic
_WATER_CM = {"summer": (4.12, 2.93, 2.08), "winter": (4.12, 0.85, 0.42)}
_WARMEST_DAY = 201  # 20 July, in the north
_WATER_SCALE_M = 2000.0
SCALE_M = 1500.0  # of aerosol on mountains that the map is too coarse for


def climatological_depth(lat: float, lon: float, time: Any, ground_m: float = 0.0) -> float:
    """Aerosol optical depth at 550 nm above the ground of a place (degrees) on a day of the year."""
    day = np.datetime64(time, "D")
    linke, map_m = _linke_turbidity(lat, lon, day)
    depth = depth_of_turbidity(linke, water_column_cm(lat, day, map_m), map_m)
    return float(depth * np.exp(-max(ground_m - map_m, 0.0) / SCALE_M))


def depth_of_turbidity(linke: float, water_cm: float, ground_m: float) -> float:
    """Aerosol optical depth at 550 nm of a Linke turbidity (Ineichen 2008, Eq. 11), `LEAST_DEPTH` at least."""
    p0, p = (float(us_standard_pressure_temperature(z)[0]) for z in (0.0, ground_m))
    r = p0 / p
    clean = 0.376 * np.log(water_cm) + 2 + 0.54 * r - 0.5 * r**2 + 0.16 * r**3
    return float(max((linke - clean) / (3.91 * np.exp(0.689 * r)), LEAST_DEPTH))


def water_column_cm(lat: float, day: np.datetime64, ground_m: float) -> float:
    """Precipitable water (cm) of the AFGL atmosphere of a latitude and season, above the ground."""
    of_year = (day - day.astype("datetime64[Y]")).astype(int) + 1
    season = np.cos(2 * np.pi * (of_year - _WARMEST_DAY) / 365.25) * (1 if lat >= 0 else -1)
    summer, winter = (float(np.exp(np.interp(abs(lat), _LATITUDES, np.log(_WATER_CM[s])))) for s in _WATER_CM)
    column = winter + (summer - winter) * 0.5 * (1 + season)
    return float(column * np.exp(-max(ground_m, 0.0) / _WATER_SCALE_M))


def _linke_turbidity(lat: float, lon: float, day: np.datetime64) -> tuple[float, float]:
    """Linke turbidity, and the height of the ground (m) where it is known."""
    try:
        import pandas as pd
        from pvlib.clearsky import lookup_linke_turbidity
        from pvlib.location import lookup_altitude
    except ImportError as error:
        raise UserError(
            "the climatology of aerosol needs the package pvlib: pip install 'openswim[relief]', or give --aod a number"
        ) from error
    when = pd.DatetimeIndex([pd.Timestamp(str(day))])
    east = (lon + 180.0) % 360.0 - 180.0
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # what pvlib and pandas tell each other of is nothing that users can mend
        return float(lookup_linke_turbidity(when, lat, east).iloc[0]), float(lookup_altitude(lat, east))
