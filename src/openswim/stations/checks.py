"""Which measured values can be right: the limits of the Baseline Surface Radiation Network.

Long and Dutton (2002), "BSRN Global Network recommended QC tests, V2.0". S is the solar constant over the square of the
sun's distance, mu0 the cosine of its zenith angle (0 at night).
"""

from __future__ import annotations

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from openswim.lights import SOLAR_CONSTANT_W_M2, SunTrack, sun_track

POSSIBLE = {  # lowest value, then a S mu0^b + c
    "ghi": (-4.0, 1.5, 1.2, 100.0),
    "dhi": (-4.0, 0.95, 1.2, 50.0),
    "dni": (-4.0, 1.0, 0.0, 0.0),
}
RARE = {
    "ghi": (-2.0, 1.2, 1.2, 50.0),
    "dhi": (-2.0, 0.75, 1.2, 30.0),
    "dni": (-2.0, 0.95, 0.2, 10.0),
}
_DIM_W_M2 = 50.0  # below it parts are not compared


def sun_of(station: xr.Dataset) -> SunTrack:
    """The sun at a station's times."""
    about = station.attrs
    return sun_track(station.time.values, about["latitude"], about["longitude"], about["height_m"])


def doubts(station: xr.Dataset, track: SunTrack | None = None) -> xr.Dataset:
    """Where values fail: ``<quantity>_impossible``, ``<quantity>_rare``, and ``parts_disagree`` (global against direct
    and diffuse, diffuse against global); each bool on time. Missing values fail nothing."""
    track = sun_of(station) if track is None else track
    zenith = 90.0 - track.altitude_deg
    mu0 = np.maximum(np.cos(np.radians(zenith)), 0.0)
    sun = SOLAR_CONSTANT_W_M2 / track.distance_au**2
    out = xr.Dataset(coords={"time": station.time})
    for word, limits in (("impossible", POSSIBLE), ("rare", RARE)):
        for name, (low, factor, power, more) in limits.items():
            if name in station:
                values = station[name].values
                high = factor * sun * mu0**power + more
                out[f"{name}_{word}"] = ("time", np.isfinite(values) & ~((values > low) & (values < high)))
    if "ghi" in station:
        out["parts_disagree"] = ("time", _disagree(station, zenith, mu0))
    return out


def _disagree(station: xr.Dataset, zenith: NDArray[np.float64], mu0: NDArray[np.float64]) -> NDArray[np.bool_]:
    wrong = np.zeros(zenith.shape, bool)
    if "dhi" not in station:
        return wrong
    with np.errstate(all="ignore"):
        ghi, dhi = station.ghi.values, station.dhi.values
        share, most = dhi / ghi, np.where(zenith < 75, 1.05, 1.10)
        wrong |= (ghi > _DIM_W_M2) & (zenith < 93) & (share > most)
        if "dni" in station:
            total = dhi + station.dni.values * mu0
            off, near = np.abs(ghi / total - 1), np.where(zenith < 75, 0.08, 0.15)
            wrong |= (total > _DIM_W_M2) & (zenith < 93) & (off > near)
    return wrong


def checked(station: xr.Dataset) -> tuple[xr.Dataset, dict[str, int]]:
    """A station's data with impossible values missing, and how many times fail each test."""
    found = doubts(station)
    counts = {str(name): int(values.sum()) for name, values in found.items()}
    out = station.copy()
    for name in POSSIBLE:
        if name in station:
            out[name] = station[name].where(~found[f"{name}_impossible"])
    return out, counts
