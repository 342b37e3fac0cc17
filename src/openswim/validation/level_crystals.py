"""Where sundogs and arcs of level plates stand, traced ray by ray, against the angles of least deviation."""

from collections.abc import Iterator
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from openswim.transport.ice import level
from openswim.validation.reference import Reference, Row, Solver, Stopwatch
from openswim.validation.reference.metrics import in_marks
from openswim.validation.reference.phases import PhaseTables

Array = NDArray[np.float64]

ALTITUDE_DEG = (np.arange(level.ALTITUDES) + 0.5) * 180 / level.ALTITUDES - 90
AZIMUTH_DEG = (np.arange(level.AZIMUTHS) + 0.5) * 180 / level.AZIMUTHS
_RAYS = 400_000
# Suns, degrees, of which all of the disc shows what the row speaks of, and between which altitudes it stands
_SEEN = {
    "parhelion (sun dog), azimuth": (0.0, 50.0, (-90.0, 90.0)),
    "circumzenithal arc, altitude": (5.0, 30.0, (50.0, 90.0)),
    "circumhorizontal arc, altitude": (60.0, 80.0, (0.0, 38.0)),
}
_SUBSUN = "subsun, altitude"


def compare_level_crystals(reference: Reference, solver: Solver, phases: PhaseTables) -> Iterator[Row]:
    """Rows of a table of halos, in marks of .3 degrees: the inner edge of sundogs along a circle around the zenith, and
    where arcs and the subsun are brightest. The table is of plates exactly level, and so are these."""
    quantity = reference.column("quantity").astype(str)
    for name in (*_SEEN, _SUBSUN):
        watch = Stopwatch()
        off = []
        with watch.running():
            for n in np.flatnonzero(np.char.startswith(quantity, name)):
                sun, wavelength, value = (
                    float(reference.column(each)[n]) for each in ("sun_altitude_deg", "wavelength_nm", "value")
                )
                found = place_deg(name, wavelength, sun)
                if found is not None:
                    shrunk = np.cos(np.radians(sun)) if name.startswith("parhelion") else 1.0
                    off.append((found - value) * shrunk)
        if off:
            yield reference.row("optics", f"{name.split(',')[0]}, in marks of .3", in_marks(off, 0.3), watch.lap())


def place_deg(name: str, wavelength_nm: float, sun_deg: float, tilt_deg: float = 0.0) -> float | None:
    """Azimuth from the sun's of a sundog's edge, or altitude of an arc; None where it is not of the whole disc."""
    if name == _SUBSUN:
        return None if sun_deg < 5 else brightest_deg(_map(546.0, sun_deg, tilt_deg), (-90.0, -1.0))
    low, high, between = _SEEN[name]
    if not low <= sun_deg <= high:
        return None
    table = _map(wavelength_nm, sun_deg, tilt_deg)
    return sundog_edge_deg(table, sun_deg) if name.startswith("parhelion") else brightest_deg(table, between)


@lru_cache(maxsize=2)
def _map(wavelength_nm: float, sun_deg: float, tilt_deg: float) -> Array:
    return level.phase_map(wavelength_nm, sun_deg, _RAYS, tilt_deg=tilt_deg)


def sundog_edge_deg(table: Array, sun_deg: float) -> float:
    """Azimuth at which a sundog has half of what it has at most, on the side of the sun."""
    profile = table[np.abs(ALTITUDE_DEG - sun_deg) < 1].mean(axis=0) * ((AZIMUTH_DEG > 15) & (AZIMUTH_DEG < 110))
    return edge_deg(AZIMUTH_DEG, profile)


def edge_deg(angle_deg: Array, profile: Array) -> float:
    """Where a profile first has half of what it has at most."""
    half = 0.5 * profile.max()
    k = int(np.argmax(profile > half))
    return float(np.interp(half, profile[k - 1 : k + 1], angle_deg[k - 1 : k + 1]))


def brightest_deg(table: Array, between_deg: tuple[float, float]) -> float:
    """Altitude of the brightest place above or below the sun, a parabola's through three logarithms."""
    profile = table[:, AZIMUTH_DEG < 6].mean(axis=1)
    profile = profile * ((between_deg[0] < ALTITUDE_DEG) & (between_deg[1] > ALTITUDE_DEG))
    k = int(np.argmax(profile))
    below, here, above = np.log(np.maximum(profile[k - 1 : k + 2], 1e-9))
    step = ALTITUDE_DEG[1] - ALTITUDE_DEG[0]
    return float(ALTITUDE_DEG[k] + 0.5 * step * (below - above) / (below - 2 * here + above))
