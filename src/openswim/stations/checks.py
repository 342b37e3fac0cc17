"""Which measured values can be right: the limits of the Baseline Surface Radiation Network.

Long and Dutton (2002), "BSRN Global Network recommended QC tests, V2.0". S is the solar constant over the square of the
sun's distance, mu0 the cosine of its zenith angle (0 at night).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from openswim.errors import UserError
from openswim.lights import SOLAR_CONSTANT_W_M2, SunTrack, sun_track
from openswim.stations.clear_sky import minutes_apart

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
_HIGH_DEG = 10.0  # sun by which global and direct light are told apart
_DIM_W_M2 = 50.0  # below it parts are not compared
_BEAM_W_M2, _MOST_BEAMS, _FEWEST_BEAMS = 200.0, 60, 12  # values of direct light that tell where the sun is
_MOST_BOUNDS, _BEYOND, _MOST_SHARE = 400, 0.05, 1.15  # values; share of them beyond a bound; of direct light in global
_MINUTES_STEP = 10
_MINUTES = np.arange(-720, 721, _MINUTES_STEP)  # that a clock may be off
_TOLD_MINUTES = 30  # less is within what instruments disagree by
_TIMES_BETTER, _FAR, _NEAR = 3.0, 0.05, 0.03  # than with the clock as it is; and share of global light
_NIGHT_W_M2, _NIGHT_DEG, _DEG_PER_HOUR = 30.0, -4.0, 15.0
_FEWEST_NIGHTS, _NIGHTS = 5, 0.03  # values by night, and share of all bright ones, that are no faults of an instrument
_ASKED = "are they UTC, and is the longitude counted east?"


def sun_of(station: xr.Dataset, times: NDArray[np.datetime64] | None = None) -> SunTrack:
    """The sun at a station's times, or at others."""
    about, when = station.attrs, station.time.values if times is None else times
    return sun_track(when, about["latitude"], about["longitude"], about["height_m"])


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


def check_clock(station: xr.Dataset) -> None:
    """Raise UserError where a station's light is that of another sun than its times and place have: local time for UTC,
    say, or a longitude of the wrong sign.

    Global less diffuse light over direct light is the sine of the sun's altitude, whatever the sky; and there is little
    light while the sun is well down."""
    if not _tell_by_beam(station):
        _tell_by_night(station)


def told_of_means(station: xr.Dataset) -> str:
    """What is to be told of values that stand for the time before or after theirs, as their light says; a model's are
    of the moment."""
    found, apart = _sun_by_beam(station), minutes_apart(station.time.values)
    if found is None or apart < _TOLD_MINUTES or not found.elsewhere:
        return ""
    if not abs(abs(found.minutes) - apart / 2) <= _MINUTES_STEP:
        return ""
    side = "before" if found.minutes < 0 else "after"
    return (f"values seem to be means over the {apart:g} minutes {side} their times, and a model's are of the moment: "
            f"move the times by {found.minutes:+d} minutes to the middle")  # fmt: skip


def told_of_swap(station: xr.Dataset) -> str:
    """What is to be told of columns of global and direct light that have each other's names, as diffuse light says, or
    without it what cannot be."""
    if not {"ghi", "dni"} <= set(station):
        return ""
    if "dhi" not in station:
        return _told_by_bounds(station)
    ghi, dni, dhi = (station[name].values for name in ("ghi", "dni", "dhi"))
    rows = np.flatnonzero(np.isfinite(ghi + dni + dhi) & (np.maximum(ghi, dni) > _DIM_W_M2))
    if rows.size < _FEWEST_BEAMS:
        return ""
    rows = rows[np.unique(np.linspace(0, rows.size - 1, _MOST_BEAMS).astype(int))]
    altitude = sun_of(station.isel(time=rows)).refracted_altitude_deg
    high = altitude > _HIGH_DEG
    if high.sum() < _FEWEST_BEAMS:
        return ""
    ghi, dni, dhi = (values[rows][high] for values in (ghi, dni, dhi))
    mu0 = np.sin(np.radians(altitude[high]))
    as_it_is, swapped = (
        float(np.median(np.abs(level - dhi - beam * mu0)) / np.median(level + dhi))
        for level, beam in ((ghi, dni), (dni, ghi))
    )
    if as_it_is < _FAR or swapped > _NEAR or as_it_is < _TIMES_BETTER * swapped:
        return ""
    return (
        "ghi and dni agree with dhi and the sun when they are swapped, and not as they are: see which column is which"
    )


def _told_by_bounds(station: xr.Dataset) -> str:
    """Global light is no less than direct light's share of it, below clouds above all, and has a bound, near which it
    would be while the sun is low and clear."""
    ghi, dni = station.ghi.values, station.dni.values
    rows = np.flatnonzero(np.isfinite(ghi + dni) & (np.maximum(ghi, dni) > _DIM_W_M2))
    rows = rows[np.unique(np.linspace(0, rows.size - 1, _MOST_BOUNDS).astype(int))] if rows.size else rows
    if rows.size < _FEWEST_BEAMS:
        return ""
    track = sun_of(station.isel(time=rows))
    mu0 = np.maximum(np.sin(np.radians(track.refracted_altitude_deg)), 0.0)
    _, factor, power, more = POSSIBLE["ghi"]
    most = factor * SOLAR_CONSTANT_W_M2 / track.distance_au**2 * mu0**power + more
    as_it_is, swapped = (
        int(((level > most) | (beam * mu0 > _MOST_SHARE * level + _DIM_W_M2))[mu0 > 0].sum())
        for level, beam in ((ghi[rows], dni[rows]), (dni[rows], ghi[rows]))
    )
    by_night = int((track.altitude_deg < _NIGHT_DEG).sum())
    if by_night > _NIGHTS * rows.size:  # the clock is off
        return ""
    if as_it_is < max(_FEWEST_BEAMS, _BEYOND * rows.size) or as_it_is < _TIMES_BETTER**2 * swapped:
        return ""
    return "ghi and dni are possible beside the sun when they are swapped, not as they are: see which column is which"


class _SunByBeam(NamedTuple):
    """By how many minutes the sun of the light is off; by what share of global light its parts disagree there, and with
    the sun of the times."""

    minutes: int
    least: float
    as_it_is: float

    @property
    def elsewhere(self) -> bool:
        return self.least <= _NEAR and self.as_it_is > _TIMES_BETTER * self.least


def _sun_by_beam(station: xr.Dataset) -> _SunByBeam | None:
    """Global less diffuse light over direct light is the sine of the sun's altitude; None: too little direct light."""
    if not {"ghi", "dni", "dhi"} <= set(station):
        return None
    ghi, dni, dhi = (station[name].values for name in ("ghi", "dni", "dhi"))
    rows = np.flatnonzero((dni > _BEAM_W_M2) & np.isfinite(ghi) & np.isfinite(dhi))
    if rows.size < _FEWEST_BEAMS:
        return None
    rows = rows[np.unique(np.linspace(0, rows.size - 1, _MOST_BEAMS).astype(int))]
    times = station.time.values[rows].astype("datetime64[s]") + _MINUTES[:, None].astype("timedelta64[m]")
    altitude = sun_of(station.isel(time=rows), times.ravel()).refracted_altitude_deg.reshape(times.shape)
    beam = dni[rows] * np.maximum(np.sin(np.radians(altitude)), 0.0)
    off = np.median(np.abs(ghi[rows] - dhi[rows] - beam), axis=1) / np.median(ghi[rows])
    near = np.flatnonzero(off <= 1.2 * off.min())  # morning and afternoon may do as well
    return _SunByBeam(int(min(_MINUTES[near], key=abs)), float(off.min()), float(off[_MINUTES == 0][0]))


def _tell_by_beam(station: xr.Dataset) -> bool:
    """Whether direct light tells that the clock is right; raises UserError where it tells that it is not."""
    found = _sun_by_beam(station)
    if found is None:
        return False
    minutes = found.minutes
    if not found.elsewhere or found.as_it_is < _FAR:
        return found.as_it_is < _FAR
    if abs(minutes) < max(_TOLD_MINUTES, minutes_apart(station.time.values) + 1):  # means of the time before, or after
        return False
    raise UserError(f"global, direct and diffuse light agree with the sun {abs(minutes) / 60:.1f} hours "
                    f"{'before' if minutes < 0 else 'after'} its times, and not at them: {_ASKED}")  # fmt: skip


def _tell_by_night(station: xr.Dataset) -> None:
    light = station["ghi" if "ghi" in station else "dhi"]
    bright = light.isel(time=np.flatnonzero(light.values > _NIGHT_W_M2))
    if not bright.size:
        return
    altitude = sun_of(station, bright.time.values).altitude_deg
    down = altitude < _NIGHT_DEG - _DEG_PER_HOUR * minutes_apart(station.time.values) / 60
    if down.sum() >= max(_FEWEST_NIGHTS, _NIGHTS * bright.size):
        worst = int(np.argmax(np.where(down, bright.values, 0.0)))
        when, most = np.datetime_as_string(bright.time.values[worst], "m"), float(bright.values[worst])
        raise UserError(f"{most:.0f} W/m2 at {when}Z, when the sun is {-altitude[worst]:.0f} degrees down, and more "
                        f"such: {_ASKED}")  # fmt: skip
