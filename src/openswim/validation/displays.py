"""Where bows, coronas, glories and halos stand by the phase functions of rain, droplets and ice, against tables."""

from collections.abc import Iterator

import numpy as np
from numpy.typing import ArrayLike, NDArray

from openswim.optics import mie
from openswim.optics.displays import crystals, droplets
from openswim.scene.phase import Mixture, PhaseFunction
from openswim.validation.reference import Reference, Row, Solver, Stopwatch
from openswim.validation.reference.metrics import in_marks, score
from openswim.validation.reference.phases import PhaseTables

Array = NDArray[np.float64]

# Between which radii, degrees from the point opposite of the sun, the brightest is looked for
BOWS = {
    "primary rainbow, radius of the maximum": (38.0, 44.0),
    "secondary rainbow, radius of the maximum": (48.5, 58.0),
}
_DROPS = "radius 500 um"  # ours are of all sizes, and of this mean where bows are made
# From the sun (1) or the point opposite (-1), dark (0) or bright (1), which of them
RINGS = {
    "corona, first minimum": (1, 0, 0),
    "corona, second maximum (first ring)": (1, 1, 0),
    "corona, second minimum": (1, 0, 1),
    "corona, third maximum (second ring)": (1, 1, 1),
    "glory, first dark ring radius": (-1, 0, 0),
    "glory, first ring radius": (-1, 1, 0),
    "glory, second ring radius": (-1, 1, 1),
}
NARROW = 0.01  # effective variance: of wider spectra the rings are flat, or none
_HALOS = {"22 degree halo, inner edge": 60.0, "46 degree halo, inner edge": 90.0}  # by the prism's angle
_AT = "scattering_angle_deg_or_quantity"


def is_rainbow_table(reference: Reference) -> bool:
    bows = set(BOWS) & set(_text(reference, "quantity"))
    return reference.is_table and reference.has("case", "value") and bool(bows)


def compare_rainbow(reference: Reference, solver: Solver, phases: PhaseTables) -> Iterator[Row]:
    """A row for each bow: the radius of its maximum, in marks of .3 degrees."""
    quantity, case = _text(reference, "quantity"), _text(reference, "case")
    for name, ends in BOWS.items():
        watch = Stopwatch()
        off = []
        with watch.running():
            for n in _rows([q == name and _DROPS in c for q, c in zip(quantity, case, strict=True)]):
                off.append(bow_deg(_number(reference, "wavelength_nm", n), ends) - _number(reference, "value", n))
        yield reference.row("optics", f"{name}, in marks of .3", in_marks(off, 0.3), watch.lap())


def is_ring_table(reference: Reference) -> bool:
    return reference.is_table and reference.has("r_eff_um", "v_eff", "value", "quantity")


def compare_rings(reference: Reference, solver: Solver, phases: PhaseTables) -> Iterator[Row]:
    """A row for each ring of droplets that are nearly alike, in marks of .15 degrees."""
    quantity = _text(reference, "quantity")
    angle = np.arange(0.0, 25.0, 0.05)
    for name, (side, bright, which) in RINGS.items():
        watch = Stopwatch()
        off = []
        with watch.running():
            for n in _rows(quantity == name):
                true = _number(reference, "value", n)
                radius_um = _number(reference, "r_eff_um", n)
                if _number(reference, "v_eff", n) > NARROW or not np.isfinite(true) or blurred(name, radius_um):
                    continue
                phase = droplets.phase_function(
                    _number(reference, "wavelength_nm", n), 1e-6 * radius_um, NARROW
                )
                found = rings(angle, phase.value(side * np.cos(np.radians(angle))))[bright]
                off.append(found[which] - true if which < found.size else np.inf)
        yield reference.row("optics", f"{name}, in marks of .15", in_marks(off, 0.15), watch.lap())


def is_halo_table(reference: Reference) -> bool:
    return reference.is_table and bool(set(_HALOS) & set(_text(reference, "quantity")))


def compare_halos(reference: Reference, solver: Solver, phases: PhaseTables) -> Iterator[Row]:
    """A row for each halo: its inner edge, in marks of .3 degrees."""
    quantity = _text(reference, "quantity")
    for name, wedge in _HALOS.items():
        watch = Stopwatch()
        with watch.running():
            off = [
                crystals.halo_deg(crystals.refractive_index(_number(reference, "wavelength_nm", n)), wedge)
                - _number(reference, "value", n)
                for n in _rows(quantity == name)
            ]
        yield reference.row("optics", f"{name}, in marks of .3", in_marks(off, 0.3), watch.lap())


def is_halo_profile(reference: Reference) -> bool:
    return reference.is_table and reference.has("crystal", _AT, "value")


def compare_halo_profile(reference: Reference, solver: Solver, phases: PhaseTables) -> Iterator[Row]:
    """Of smooth prisms: the refracted light between 25 and 170 degrees, and where the 22 degree halo is brightest, in
    marks of .3 degrees."""
    watch = Stopwatch()
    off, found, true = [], [], []
    with watch.running():
        for n, (crystal, what) in enumerate(zip(_text(reference, "crystal"), _text(reference, _AT), strict=True)):
            value = _number(reference, "value", n)
            mixture = crystals.phase_function(_number(reference, "wavelength_nm", n), (crystal.split(",")[0],))
            assert isinstance(mixture, Mixture)
            table = mixture.phases[1]
            angle = np.arange(20.5, 25.0, 0.05)
            if what.startswith("maximum of the 22"):
                off.append(float(angle[np.argmax(_at(table, angle))]) - value)
            elif what.replace(".", "").isdigit() and 25 < float(what) < 170:
                found.append(2 * mixture.weights[1] * float(_at(table, float(what))))
                true.append(value)
    yield reference.row("optics", "22 degree halo, maximum, in marks of .3", in_marks(off, 0.3), watch.lap())
    ratio = np.array(found) / np.array(true)
    yield reference.row("optics", "smooth prisms, 25-170 degrees", score(ratio, np.ones(ratio.size)), watch.lap())


def _rows(chosen: ArrayLike) -> list[int]:
    return [int(n) for n in np.flatnonzero(chosen)]


def _text(reference: Reference, name: str) -> NDArray[np.str_]:
    return reference.column(name).astype(str) if reference.has(name) else np.empty(0, str)


def _number(reference: Reference, name: str, n: int) -> float:
    """NaN where a cell is empty."""
    given = str(reference.column(name)[n]).strip()
    return float(given) if given else np.nan


def _at(phase: PhaseFunction, angle_deg: Array | float) -> Array:
    return phase.value(np.cos(np.radians(angle_deg)))


def bow_deg(wavelength_nm: float, ends: tuple[float, float]) -> float:
    """Radius of the brightest ring of rain between two, from the point opposite of the sun."""
    radius = np.arange(*ends, 0.02)
    return float(radius[np.argmax(_at(mie.phase_function("rain", wavelength_nm), 180 - radius))])


def blurred(name: str, radius_um: float) -> bool:
    """Whether the disc of the sun, over which our phase functions are means, leaves nothing of one of `RINGS`."""
    side, _, which = RINGS[name]
    return side == 1 and which == 1 and radius_um > 10


def rings(angle_deg: Array, value: Array) -> tuple[Array, Array]:
    """Angles of minima and of maxima, each a parabola's through three logarithms."""
    log = np.log(value)
    turns = np.flatnonzero(np.diff(np.sign(np.diff(log)))) + 1
    left, here, right = log[turns - 1], log[turns], log[turns + 1]
    place = angle_deg[turns] + 0.5 * (left - right) / (left - 2 * here + right) * (angle_deg[1] - angle_deg[0])
    dark = right > here
    return place[dark], place[~dark]
