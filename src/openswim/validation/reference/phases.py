"""Phase functions as reference files name them, in attributes, columns and tables."""

import re
from typing import Any

import numpy as np

from openswim.errors import UserError
from openswim.scene.phase import AlbersDHG, HenyeyGreenstein, Mixture, PhaseFunction, Rayleigh, TablePhase
from openswim.validation.reference.files import Reference

_NUMBER = r"([-+]?\d*\.?\d+)"
_LOBE = re.compile(_NUMBER + r"\s*\*?\s*(D?HG)\(\s*" + _NUMBER + r"\s*\)")


def phase_of_attributes(attributes: dict[str, Any], where: str) -> PhaseFunction:
    """The phase function that `phase_function` (and `asymmetry_parameter`) describe.

    Read are: Henyey-Greenstein; Rayleigh; sums such as ".12 DHG(.900) + .88 HG(.600), f_b .550".
    """
    text = str(attributes.get("phase_function", "Henyey-Greenstein"))
    if _LOBE.search(text):
        return lobes(text, text)
    if "rayleigh" in text.lower():
        return Rayleigh(float(attributes.get("depolarisation", 0.0)))
    if re.fullmatch(r"(?i)henyey[- ]greenstein|hg", text.strip()) and "asymmetry_parameter" in attributes:
        return HenyeyGreenstein(float(attributes["asymmetry_parameter"]))
    raise UserError(f"{where}: attribute phase_function = {text!r} is not understood")


def named_phases(text: str) -> dict[str, PhaseFunction]:
    """The phase functions of a text "a = .12 DHG(.9) + .88 DHG(.6), f_b .55; b = weights exchanged; ...".

    DHG is Eq. 27 of Albers et al. 2020 (corrected), HG Henyey-Greenstein; "weights exchanged" refers to the
    definition before it.
    """
    found: dict[str, PhaseFunction] = {}
    before = ""
    for part in text.split(";"):
        match = re.search(r"(\w+)\s*=\s*(.+)", part)
        if not match:
            continue
        name, definition = match.groups()
        if "exchanged" in definition and before:
            found[name] = lobes(before, text, exchanged=True)
        elif _LOBE.search(definition):
            found[name] = lobes(definition, text)
            before = definition
    return found


def lobes(definition: str, where: str, exchanged: bool = False) -> PhaseFunction:
    """A weighted sum of lobes, as in ".12 DHG(.900) + .88 DHG(.600), f_b .550"."""
    terms = _LOBE.findall(definition)
    weights = [float(weight) for weight, _, _ in terms]
    backward = re.search(r"f_b\s*=?\s*" + _NUMBER, definition)
    if any(kind == "DHG" for _, kind, _ in terms) and not backward:
        raise UserError(f"phase function {where!r}: DHG without f_b")
    f_b = float(backward.group(1)) if backward else 0.0
    phases: list[PhaseFunction] = [
        AlbersDHG(float(g), f_b) if kind == "DHG" else HenyeyGreenstein(float(g)) for _, kind, g in terms
    ]
    return Mixture(weights[::-1] if exchanged else weights, phases)


class PhaseTables:
    """Tabulated phase functions of all the files with columns `case`, `scat_angle_deg`, `P`."""

    def __init__(self, references: list[Reference]) -> None:
        self._tables: dict[str, PhaseFunction] = {}
        for reference in references:
            if is_phase_table(reference):
                self.add(reference)

    def add(self, reference: Reference) -> None:
        """Take the tables of a file in."""
        case = reference.column("case")
        for name in dict.fromkeys(case.tolist()):
            own = case == name
            angle, value = (reference.column(c)[own] for c in ("scat_angle_deg", "P"))
            order = np.argsort(angle)
            self._tables[str(name)] = TablePhase(angle[order], value[order])

    def find(self, label: str) -> PhaseFunction:
        """What a label means: `hg086` is HG with g = .86, `mie_r10` the table cloud_r10_*."""
        henyey = re.fullmatch(r"hg_?0?\.?(\d+)", label.lower())
        if henyey:
            return HenyeyGreenstein(float("0." + henyey.group(1)))
        radius = re.search(r"r(?:_eff)?[ _]?(\d+)(?![\d.])", label.lower())
        for name, phase in self._tables.items():
            if name == label or (radius and re.search(rf"cloud_r{radius.group(1)}(?!\d)", name)):
                return phase
        raise UserError(
            f"no phase function {label!r}: put a table with columns case, scat_angle_deg, P beside it"
        )


def is_phase_table(reference: Reference) -> bool:
    return reference.is_table and reference.has("case", "scat_angle_deg", "P")
