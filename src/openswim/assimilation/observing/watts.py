"""Broadband global irradiance from that at a few wavelengths, as a linear function of it."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from openswim.fluxes import broadband, gases_above
from openswim.lights.daylight import Daylight
from openswim.lights.spectrum import solar_bins
from openswim.scene import Scene

F64 = NDArray[np.float64]

LONGEST_NM = 700.0  # beyond, gases absorb in bands


def watts_of(scene: Scene, wavelengths_nm: F64, day: Daylight) -> F64:
    """W m-2 (w,) of broadband irradiance for each wavelength's global irradiance over E_TOA.

    Each stands for the part of the sun's spectrum that is nearest to it, times what gases let through in a clear sky
    (`openswim.fluxes.broadband`, .77 of the whole at 1.5 cm of water vapour and a high sun). The real function is not
    linear, since cloud absorbs in the near infrared: below an even cloud of optical depth 20 this is 7 to 8 % more, in
    clear air .5 % less (standard atmosphere, sun at 50 degrees). Departures by `fast` take the real one.
    """
    edges, top = solar_bins()
    middle, energy = 0.5 * (edges[1:] + edges[:-1]), top * np.diff(edges) / day.distance_au**2
    usable = np.flatnonzero(wavelengths_nm <= LONGEST_NM)
    known = usable if usable.size else np.arange(wavelengths_nm.size)
    order = known[np.argsort(wavelengths_nm[known])]
    between = 0.5 * (wavelengths_nm[order][1:] + wavelengths_nm[order][:-1])
    share = np.zeros(wavelengths_nm.size)
    np.add.at(share, order[np.searchsorted(between, middle)], energy)
    return share * _clear_share(scene, wavelengths_nm[order], day)


def _clear_share(scene: Scene, wavelengths_nm: F64, day: Daylight) -> float:
    """What of the sun's light is not absorbed by gases in a clear sky, of all that the visible wavelengths let down."""
    if scene.atmosphere is None:
        return 1.0
    altitude = float(np.degrees(np.arcsin(np.clip(day.direction[2], 0.02, 1.0))))
    ground_m = float(np.min(scene.grid.height_m)) if scene.grid is not None else 0.0
    gases = gases_above(scene.atmosphere, max(ground_m, 0.0))
    none = np.ones(wavelengths_nm.size)
    bare = broadband(none, 0 * none, wavelengths_nm, altitude, day.distance_au, 0.0, 0.0, 0.0)
    seen = broadband(none, 0 * none, wavelengths_nm, altitude, day.distance_au, gases["water_vapour_cm"], 0.0, 0.0)
    return seen.direct_normal / bare.direct_normal
