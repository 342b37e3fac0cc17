"""Smooth ice crystals, which show halos: hexagonal prisms, traced by tools/make_ice_halos.py."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from openswim.scene.phase import HenyeyGreenstein, Mixture, PhaseFunction, TablePhase
from openswim.tables import named_arrays

FloatArray = NDArray[np.float64]

# Real part of the refractive index of ice at -7 C (Warren & Brandt 2008), of wavelengths in nm
_WAVELENGTH_NM = np.array([400.0, 450.0, 500.0, 546.0, 589.0, 615.0, 700.0])
_INDEX = np.array([1.3194, 1.3157, 1.3130, 1.3112, 1.3098, 1.3090, 1.3069])
DIFFRACTION = HenyeyGreenstein(0.998)  # half of what large particles scatter
_CORNERS_DEG = 178.0
RANDOM = ("column", "compact")  # the shapes that lie in all orientations, of each as much
LENGTH_OVER_WIDTH = {"column": 2.0, "compact": 1.0, "plate": 0.2}  # the width is that of the circumscribed circle


def refractive_index(wavelength_nm: float) -> float:
    """Of ice, 400-700 nm, the nearest end beyond."""
    return float(np.interp(wavelength_nm, _WAVELENGTH_NM, _INDEX))


def halo_deg(index: float, wedge_deg: float) -> float:
    """Least deviation by two faces of ice at an angle: 60 degrees for the inner halo, 90 for the outer."""
    half = np.radians(wedge_deg) / 2
    return float(np.degrees(2 * np.arcsin(index * np.sin(half))) - wedge_deg)


@lru_cache(maxsize=64)
def phase_function(wavelength_nm: float, shapes: tuple[str, ...] = RANDOM) -> PhaseFunction:
    """Of smooth prisms of some shapes ("column", "compact", "plate") in all orientations, averaged over the solar disc;
    what goes straight on through opposite faces is as what is diffracted.

    Straight back perfect corners would send a narrow peak, which the lidar ratio of cirrus denies: P there is that of
    178 degrees. Between two traced indices both are stretched to the halos' own radii.
    """
    tables = named_arrays("optics", "ice_prisms")
    index = refractive_index(wavelength_nm)
    known = tables["index"]
    position = float(np.interp(-index, -known, np.arange(known.size)))
    lower = min(int(position), known.size - 2)
    angle = np.concatenate([[0.0], tables["angle_deg"], [180.0]])
    value, straight = np.zeros(angle.size), 0.0
    for shape in shapes:
        row = int(np.argmax(tables["shape"] == shape))
        for n, share in ((lower, 1 - position + lower), (lower + 1, position - lower)):
            theirs = np.interp(angle, _fixed_deg(index), _fixed_deg(float(known[n])))
            logs = np.interp(theirs, tables["angle_deg"], tables["log_value"][row, n].astype(float))
            passed = float(tables["straight"][row, n])
            logs[angle > _CORNERS_DEG] = np.interp(_CORNERS_DEG, angle, logs)
            value += share / len(shapes) * (1 - passed) * np.exp(logs)
            straight += share / len(shapes) * passed
    return Mixture((0.5 + 0.5 * straight, 0.5 - 0.5 * straight), (DIFFRACTION, TablePhase(angle, value)))


def mixed(wavelength_nm: float, shares: tuple[tuple[str, float], ...]) -> PhaseFunction:
    """Of several shapes, each with its share, in all orientations."""
    weights: list[float] = []
    phases: list[PhaseFunction] = []
    for shape, share in shares:
        one = phase_function(wavelength_nm, (shape,))
        assert isinstance(one, Mixture)
        weights += [share * weight for weight in one.weights]
        phases += one.phases
    return Mixture(weights, phases)


def _fixed_deg(index: float) -> list[float]:
    return [0.0, halo_deg(index, 60.0), halo_deg(index, 90.0), 180.0]
