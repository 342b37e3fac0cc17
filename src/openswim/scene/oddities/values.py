"""Values that may be, but that no weather has everywhere: told, since somebody may have meant them."""

from __future__ import annotations

import numpy as np
import xarray as xr
from numpy.typing import NDArray

F32 = NDArray[np.float32]

_FAINT_KG_M3 = {  # the most of a species in a domain that has any: under it is next to nothing
    "liquid": 2e-6, "ice": 1e-8, "rain": 1e-7, "snow": 1e-8, "graupel": 1e-9,
}  # fmt: skip
_MOST_DROPS = 2e10  # in m3, four times as many as in clouds of fires
_FEW_NODES = 16  # so small fields may be even
_UNEVEN = ("_content", "cloud_area_fraction", "_10m", "air_temperature")  # fields that weather makes so
_FEW_ROWS = 4
_UNEVEN_WINDS = 300.0  # times as strong along one axis as along the other
_WHOLE_K = 3.0  # temperatures that spread less may be whole numbers by chance
_ICE_K = 273.15
_ROUNDING_K = 1e-4  # of temperatures in single precision
_NOT_AT = {
    "liquid": (0.0, 235.0, "colder than -38 degC"), "rain": (0.0, 235.0, "colder than -38 degC"),
    "ice": (276.0, 400.0, "warmer than 3 degC"), "snow": (278.0, 400.0, "warmer than 5 degC"),
}  # fmt: skip
# Where the cloud fraction has cloud, and all of it is ice or liquid: means that their content may have. Real files (of
# ERA5, IFS, UM, GFS, WRF) have 5e-6 to 2e-5 of ice, 1e-4 to 3e-4 of liquid
_IN_CLOUD = {"ice": (150.0, 235.0, 2e-7, 7e-4), "liquid": (274.0, 330.0, 2e-6, 3e-3)}  # K, kg m-3
_CLOUDED, _SOME_CLOUD = 0.5, 20  # cloud fraction; nodes that tell a mean
_MISPLACED = 0.03  # of a content; real files (ERA5, GFS, IFS, UM, WRF) have up to 0.003
_FORECASTS_SINCE, _UNTIL = np.datetime64("1800-01-01", "ms"), np.datetime64("2500-01-01", "ms")
# from which NCEP's reanalysis, ERA5 and Unix count their time; -9999 s is a fill value
_CLOCKS_START = np.array(["1800-01-01", "1900-01-01", "1970-01-01"], "datetime64[ms]")
_CLOCKS_FILLED = np.timedelta64(3, "h")


def odd_values(data: xr.Dataset, columns: tuple[int, int]) -> list[str]:
    """Notes on contents that are next to nothing, fields with one value, cut temperatures, winds in two units, and
    strips."""
    notes = []
    for species, faint in _FAINT_KG_M3.items():
        name = f"{species}_content"
        most = float(data[name].max()) if name in data else 0.0
        if 0 < most < faint:
            notes.append(f"{name} is {most:.2g} kg m-3 at most, next to nothing: is it in the unit that the file says?")
    drops = float(data["liquid_number"].max()) if "liquid_number" in data else 0.0
    if drops > _MOST_DROPS:
        notes.append(f"liquid_number is {drops:.2g} m-3 at most; clouds in smoke have 5e9: is it per m3?")
    for field in map(str, data.data_vars):
        if field.endswith(_UNEVEN) and data[field].size > _FEW_NODES:
            low, high = float(data[field].min()), float(data[field].max())
            if low == high != 0 and not (high == 1 and field.endswith("fraction")):
                units = data[field].attrs.get("units", "1")
                value = f"{low:.3g}" if units == "1" else f"{low:.3g} {units}"
                notes.append(f"{field} is {value} everywhere: is it known?")
    if "air_temperature" in data and _whole(data["air_temperature"].values):
        notes.append("air_temperature holds whole degrees alone: were its decimals cut?")
    if "wind_east_10m" in data and "wind_north_10m" in data:
        east, north = (float(np.abs(data[f"wind_{way}_10m"]).mean()) for way in ("east", "north"))
        if max(east, north) > _UNEVEN_WINDS * min(east, north):
            notes.append(f"the wind is {east:.2g} m s-1 along east and {north:.2g} along north: both in the same unit?")
    ny, nx = columns
    if 1 < min(ny, nx) < _FEW_ROWS and max(ny, nx) >= 2 * min(ny, nx):
        notes.append(f"a strip of {nx} x {ny} columns: is it the whole domain?")
    return notes


def odd_phases(temperature_k: F32, contents: dict[str, F32]) -> list[str]:
    """Notes on water that is liquid where all of it freezes, and on ice where it melts, of contents (z, y, x)."""
    notes = []
    for species, content in contents.items():
        total = float(content.sum(dtype=np.float64))
        if species not in _NOT_AT or not total > 0:
            continue
        low_k, high_k, where = _NOT_AT[species]
        there = (temperature_k > low_k) & (temperature_k < high_k)
        share = float(content[there].sum(dtype=np.float64)) / total
        if share > _MISPLACED:
            notes.append(f"{100 * share:.0f} % of {species}_content is in air {where}: is it what it is called?")
    return notes


def odd_clouds(temperature_k: F32, cover: F32, contents: dict[str, F32]) -> list[str]:
    """Notes on contents (z, y, x) [kg m-3] that do not go with the cloud fraction where it has cloud of that kind."""
    notes = []
    for species, (low_k, high_k, least, most) in _IN_CLOUD.items():
        there = (temperature_k > low_k) & (temperature_k < high_k) & (cover > _CLOUDED)
        if species not in contents or there.sum() < _SOME_CLOUD:
            continue
        mean = float(contents[species][there].mean(dtype=np.float64))
        if not least < mean < most:
            much = "next to nothing" if mean < most else "more than any cloud has"
            notes.append(
                f"{species}_content is {mean:.2g} kg m-3 in the mean where the cloud fraction says cloud, {much}: is "
                "it in the unit that the file says?"
            )
    return notes


def _whole(temperature_k: NDArray[np.float32]) -> bool:
    """Whether all temperatures (z, y, x) [K] are whole kelvins, or whole degrees Celsius, and not just one or two."""
    if not np.ptp(temperature_k) >= _WHOLE_K:
        return False
    for zero in (0.0, _ICE_K):
        if all((np.abs((level - zero) - np.rint(level - zero)) < _ROUNDING_K).all() for level in temperature_k):
            return True
    return False


def odd_time(time: np.datetime64 | None) -> list[str]:
    """A note on a time (datetime64[ms], UTC) of no model."""
    if time is None or np.isnat(time):
        return []
    fraction = bool(time != time.astype("datetime64[s]"))
    beginning = bool((abs(time - _CLOCKS_START) < _CLOCKS_FILLED).any())  # where clocks that hold nothing stand
    if fraction or beginning or not _FORECASTS_SINCE < time < _UNTIL:
        return [f"the time {time} is odd for weather: is it what the file means? (--sun lights by another)"]
    return []
