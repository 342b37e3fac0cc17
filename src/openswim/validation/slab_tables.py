"""Tables of homogeneous layers: DISORT's water clouds, and published Rayleigh layers."""

import re
from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from openswim.errors import UserError
from openswim.scene.phase import Rayleigh
from openswim.validation.reference import Reference, Row, Solver, Stopwatch, groups
from openswim.validation.reference.metrics import agreement, score
from openswim.validation.reference.phases import PhaseTables
from openswim.validation.slabs import Collected, Slab, flux, radiance

_CASE = ("sza", "tau", "sfc_albedo")


def is_flux_table(reference: Reference) -> bool:
    return reference.is_table and reference.has(*_CASE, "cloud_top_albedo", "transmission_total")


def compare_flux_table(reference: Reference, solver: Solver, phases: PhaseTables) -> Iterator[Row]:
    """Rows per phase function and optical depth: cloud-top albedo and total transmission (of mu0 E_TOA)."""
    watch = Stopwatch()
    labels = _phase_labels(reference)
    keys = [reference.column(name) for name in _CASE]
    for (label, tau), rows in groups(labels, reference.column("tau")):
        phase = phases.find(label)
        found = Collected()
        for row in rows:
            sza, _, albedo = (float(key[row]) for key in keys)
            slab = Slab(float(tau), sza, 1.0, albedo)
            with watch.running():
                solved = slab.solve(solver, phase)
                reflected = flux(solved, "up_top", per=slab.mu0)
                transmitted = flux(solved, "direct_bottom", "down_bottom", per=slab.mu0)
            found.add("albedo", reflected, reference.column("cloud_top_albedo")[row])
            found.add("transmission", transmitted, reference.column("transmission_total")[row])
        yield from found.rows(reference, solver, f"{label}, tau {tau:g}", watch.lap())


def is_radiance_table(reference: Reference) -> bool:
    return reference.is_table and reference.has(*_CASE, "vza", "raa", "Lp_up_toa", "Lp_down_base")


def compare_radiance_table(reference: Reference, solver: Solver, phases: PhaseTables) -> Iterator[Row]:
    """Rows per phase function and optical depth: radiance up and down, all angles and grounds together.

    The light from the sun's own direction has a row of its own: there the forward peak of a cloud's phase function is
    all, and the reference's approximation of it fails (docs/validation.md).
    """
    watch = Stopwatch()
    labels, tau_column = _phase_labels(reference), reference.column("tau")
    for (label, tau), rows in groups(labels, tau_column):
        phase = phases.find(label)
        found = Collected()
        angles = [reference.column(name)[rows] for name in ("sza", "sfc_albedo")]
        for (sza, albedo), part in groups(*angles):
            used = rows[part]
            zenith, azimuth = (reference.column(name)[used] for name in ("vza", "raa"))
            with watch.running():
                solved = Slab(float(tau), sza, 1.0, albedo).solve(solver, phase)
                up, down = (radiance(solved, zenith, azimuth, upward) for upward in (True, False))
            found.add("radiance up", up, reference.column("Lp_up_toa")[used])
            truth, at_sun = reference.column("Lp_down_base")[used], _at_the_sun(sza, zenith, azimuth)
            for name, chosen in (("radiance down", ~at_sun), ("radiance down at the sun", at_sun)):
                if chosen.any():
                    found.add(name, (down[0][chosen], down[1][chosen]), truth[chosen])
        yield from found.rows(reference, solver, f"{label}, tau {tau:g}", watch.lap())


def _at_the_sun(sza_deg: float, zenith_deg: NDArray, azimuth_deg: NDArray) -> NDArray[np.bool_]:
    """Whether lines of sight (n,) point within a degree of the sun."""
    sun, zenith = np.radians(sza_deg), np.radians(zenith_deg)
    cosine = np.cos(sun) * np.cos(zenith) + np.sin(sun) * np.sin(zenith) * np.cos(np.radians(azimuth_deg))
    return np.asarray(cosine > np.cos(np.radians(1.0)))


def _phase_labels(reference: Reference) -> np.ndarray:
    """A label per row: the column `phase`, or the JSON beside the file ("Mie r_eff 10 um ...")."""
    if "phase" in reference.data:
        return reference.column("phase")
    text = str(reference.about.get("phase", ""))
    mie = re.search(r"(?i)mie\s+r_eff\s+(\d+)", text)
    henyey = re.search(r"(?i)\bHG\s+g\s*=\s*0?\.(\d+)", text)
    if mie:
        label = f"mie_r{mie.group(1)}"
    elif henyey:
        label = f"hg0{henyey.group(1)}"
    else:
        raise UserError(
            f"{reference.path.name}: neither a column nor the JSON beside it names the phase function"
        )
    return np.full(reference.data.sizes["row"], label)


def is_rayleigh_table(reference: Reference) -> bool:
    return reference.is_table and reference.has("case", "R_up_or_T_down", "vza", "raa", "Lp_4piL_over_E")


def compare_rayleigh_table(reference: Reference, solver: Solver, phases: PhaseTables) -> Iterator[Row]:
    """Rows per published case and direction. They carry polarisation: a scalar model is -6 to +8 % off."""
    watch = Stopwatch()
    names, side = reference.column("case"), reference.column("R_up_or_T_down")
    zenith, azimuth = reference.column("vza"), reference.column("raa")
    for (name, direction), rows in groups(names, side):
        with watch.running():
            solved = _published_slab(str(name)).solve(solver, Rayleigh(0.0))
            model, sigma = radiance(solved, zenith[rows], azimuth[rows], upward=direction == "R")
        truth = reference.column("Lp_4piL_over_E")[rows]
        quantity = f"radiance {'up' if direction == 'R' else 'down'}, {str(name).split(' ')[0]} (polarised)"
        yield reference.row(
            solver.name, quantity, score(model, truth, sigma), watch.lap(), agreement(model, truth, sigma)
        )


def _published_slab(text: str) -> Slab:
    """The layer of a title such as "Natraj2009 tau=1 albedo=.8 mu0=.6; ..."."""
    found = {key: float(value) for key, value in re.findall(r"(\w+)\s*=\s*(\d*\.?\d+)", text)}
    if "tau" not in found or not {"sza", "mu0"} & set(found):
        raise UserError(f"case {text!r} names no tau and sza or mu0")
    sza = found["sza"] if "sza" in found else float(np.degrees(np.arccos(found["mu0"])))
    return Slab(found["tau"], sza, 1.0, found.get("albedo", 0.0))
