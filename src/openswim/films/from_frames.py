"""What is drawn of all frames of a film at once: the trails of stars, and curves of irradiance."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

F32 = NDArray[np.float32]
NIGHT_DEG = -8.0  # altitude of the sun below which there are stars enough for trails
FORMATS = (".csv", ".nc")
_UNITS = {"_w_m2": "W m-2", "_lx": "lx", "_m": "m"}  # by the end of a name; others are angles


class StarTrails:
    """The brightest of each pixel, in linear light, among the frames of a night: those that want at least half of the
    longest exposure, lest dusk outshine the stars."""

    def __init__(self, facts: Sequence[dict[str, Any]]) -> None:
        """``facts``: of all frames."""
        self._least = 0.5 * max(float(each["exposure"]) for each in facts)
        self._brightest = np.zeros((), np.float32)
        self._exposures: list[float] = []

    def add(self, light: F32, facts: dict[str, Any], exposure: float) -> None:
        """One frame: linear light (y, x, 3) at the exposure of its facts, shown at another; none of dusk counts."""
        if facts["exposure"] < self._least:
            return
        self._brightest = np.maximum(self._brightest, light / np.float32(facts["exposure"]))
        self._exposures.append(exposure)

    def picture(self) -> NDArray[np.uint8]:
        """(y, x, 3), at the mean exposure of its frames."""
        from openswim.colour.rgb import developed

        return np.asarray(developed(self._brightest, float(np.exp(np.mean(np.log(self._exposures))))))


def series_of(facts: Sequence[dict[str, Any]]) -> dict[str, NDArray[np.float64]]:
    """Numbers of frames that make curves: irradiance (W m-2), the sun's place, and the camera's (degrees, m)."""
    names = [
        name for name in facts[0]
        if name.endswith(("_w_m2", "_lx")) or name.startswith("sun_a") or name in ("latitude", "longitude", "height_m")
    ]  # fmt: skip
    return {
        name: np.array([float(each[name]) for each in facts]) for name in names if all(name in each for each in facts)
    }


def times_of(facts: Sequence[dict[str, Any]]) -> dict[str, NDArray[np.datetime64]]:
    """The times of frames, of their weather and of their light, to the millisecond, as far as all frames have them."""
    return {
        name: np.array([np.datetime64(str(each[name]).rstrip("Z"), "ms") for each in facts])
        for name in ("time", "valid_time", "light_time") if all(each.get(name) for each in facts)
    }  # fmt: skip


def curves_of(facts: Sequence[dict[str, Any]]) -> xr.Dataset:
    """The numbers by frame, and the times of each."""
    times = {name: ("frame", values.astype("datetime64[ns]")) for name, values in times_of(facts).items()}
    series = {name: ("frame", values) for name, values in series_of(facts).items()}
    data = xr.Dataset(times | series)
    for name in series:
        found = [unit for end, unit in _UNITS.items() if name.endswith(end)]
        data[name].attrs["units"] = found[0] if found else "degree"
    return data.assign_attrs(Conventions="CF-1.11", title="Irradiance at the camera of an OpenSWIm film")
