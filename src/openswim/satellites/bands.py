"""Bands of imagers as few wavelengths and weights (tools/make_satellite_bands.py)."""

from __future__ import annotations

import json
from dataclasses import dataclass
from functools import cache
from importlib.resources import files
from typing import Any

import numpy as np
from numpy.typing import NDArray

from openswim.arguments import shown
from openswim.errors import UserError

F64 = NDArray[np.float64]

# Where lines of gases take more than some per cent of what a band sees: only the light that they leave is not told.
_VAPOUR_NM = ((890.0, 990.0), (1080.0, 1180.0), (1300.0, 1500.0))


@dataclass(frozen=True)
class Band:
    """A band of an imager: reflectance over it is the weighted mean of that at its wavelengths.

    error : the worst relative error of this mean for smooth spectra of sky, sea, land and snow.
    """

    imager: str
    name: str
    centre_nm: float
    wavelength_nm: F64
    weight: F64
    error: float
    source: str

    @property
    def in_vapour(self) -> bool:
        """Whether lines of water vapour take much of the band's light."""
        return any(low < self.centre_nm < high for low, high in _VAPOUR_NM)


@cache
def _tables() -> dict[str, Any]:
    text = (files("openswim.satellites") / "data" / "bands.json").read_text("utf-8")
    found: dict[str, Any] = json.loads(text)
    return found


def imagers() -> dict[str, list[str]]:
    """Names of imagers with those of their bands."""
    return {name: list(one["bands"]) for name, one in _tables().items()}


def band(imager: str, name: str) -> Band:
    """A band by name, such as band("goes-16 abi", "C02")."""
    tables = _tables()
    if imager not in tables:
        raise UserError(f"imager {shown(imager)} is unknown; known: {', '.join(tables)}")
    bands = tables[imager]["bands"]
    if name not in bands:
        raise UserError(f"band {shown(name)} of {imager} is unknown; known: {', '.join(bands)}")
    one = bands[name]
    return Band(
        imager, name, one["centre_nm"], np.array(one["wavelength_nm"]), np.array(one["weight"]), one["error"],
        tables[imager]["source"],
    )  # fmt: skip
