"""From radiance at three wavelengths to XYZ and RGB, against colours integrated over whole spectra."""

import re
from collections.abc import Callable, Iterator

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from openswim.colour import to_xyz
from openswim.colour.rgb import rgb_matrix
from openswim.optics.rayleigh import rayleigh_cross_section_m2
from openswim.validation.reference import Reference, Row, Solver, Stopwatch
from openswim.validation.reference.metrics import score
from openswim.validation.reference.phases import PhaseTables

Array = NDArray[np.float64]

_WAVELENGTHS_NM = np.array([615.0, 546.0, 450.0])
_AIR_PER_M2 = 2.148e29  # molecules above 1013.25 hPa
_NUMBER = r"([-+]?\d*\.?\d+)"


def matches(reference: Reference) -> bool:
    return reference.is_table and reference.has("name", "X", "Y", "Z", "r_lin", "g_lin", "b_lin")


def compare(reference: Reference, solver: Solver, phases: PhaseTables) -> Iterator[Row]:
    """XYZ through three wavelengths where the name is a formula; Eq. 36 on the reference's XYZ."""
    watch = Stopwatch()
    xyz = np.stack([reference.column(c) for c in "XYZ"], axis=-1)
    rgb = np.stack([reference.column(c) for c in ("r_lin", "g_lin", "b_lin")], axis=-1)
    for name, truth in zip(reference.column("name"), xyz, strict=True):
        reflectance = spectrum_of(str(name))
        if reflectance is not None:
            with watch.running():
                light = xr.DataArray(
                    reflectance(_WAVELENGTHS_NM)[None],
                    dims=("pixel", "wavelength"),
                    coords={"wavelength": _WAVELENGTHS_NM},
                )
                model = to_xyz(light)[0]
            yield reference.row("colour", f"XYZ, {name}", score(model, truth), watch.lap())
    yield reference.row("colour", "linear RGB by Eq. 36", score(xyz @ rgb_matrix("paper").T, rgb), 0.0)


def spectrum_of(name: str) -> Callable[[Array], Array] | None:
    """Reflectance over wavelength (nm) from "white x1", "l^-4 (550->0.2)" or "exp(-20*tauR)"; else None."""
    power = re.search(rf"l\^{_NUMBER}\s*\({_NUMBER}\s*->\s*{_NUMBER}\)", name)
    if power:
        exponent, reference_nm, value = (float(n) for n in power.groups())
        return lambda wavelength: value * (wavelength / reference_nm) ** exponent
    reddened = re.search(rf"exp\(\s*-{_NUMBER}\s*\*\s*tauR\s*\)", name)
    if reddened:
        path = float(reddened.group(1))
        return lambda wavelength: np.exp(-path * _AIR_PER_M2 * rayleigh_cross_section_m2(wavelength))
    white = re.search(rf"white.*x\s*{_NUMBER}$", name)
    if white:
        return lambda wavelength: np.full(wavelength.shape, float(white.group(1)))
    return None
