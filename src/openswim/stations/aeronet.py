"""AERONET's sun photometers: files of version 3, direct sun (depth, water vapour) and inversions, as an aerosol."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from openswim.arguments import paths, shown
from openswim.errors import UserError
from openswim.optics.spheres import Sizes, SphereOptics, scattering_by_spheres
from openswim.scene.aerosol import AerosolProfile
from openswim.scene.phase import PhaseFunction, TablePhase
from openswim.scene.times import Time, parse_time
from openswim.stations.text import PLACES, rows_of

F64 = NDArray[np.float64]

_LACKING = -900.0  # values below it stand for none
_NEAR = np.timedelta64(6, "h")
_MOST_CHARACTERS = 1_000_000_000
_RADII = 200  # into which the 22 of an inversion are divided
_SPECTRAL = {  # wavelength in nm is the first group
    "depth": r"AOD_(\d+)nm",
    "inverted_depth": r"AOD_Extinction-Total\[(\d+)nm\]",
    "albedo": r"Single_Scattering_Albedo\[(\d+)nm\]",
    "real": r"Refractive_Index-Real_Part\[(\d+)nm\]",
    "imaginary": r"Refractive_Index-Imaginary_Part\[(\d+)nm\]",
}
_SINGLE = {
    "water_vapour_cm": ("Precipitable_Water(cm)",),
    "ozone_du": ("Ozone(Dobson)",),
    "sphericity_percent": ("Sphericity_Factor(%)",),
    "latitude": ("Site_Latitude(Degrees)", "Latitude(Degrees)"),
    "longitude": ("Site_Longitude(Degrees)", "Longitude(Degrees)"),
    "height_m": ("Site_Elevation(m)", "Elevation(m)"),
}
_PLACE = (*_SINGLE["latitude"], *_SINGLE["longitude"])
_ONE_SITE_DEG = 0.1
_RADIUS, _ANGLE = r"\d+\.\d{6}", r"(\d+\.\d+)\[(\d+)nm\]"


@dataclass(frozen=True)
class Sunphotometer:
    """What AERONET files say: by wavelength (nm) optical depth, single-scattering albedo, refractive index and phase
    function; the volume size distribution dV/dlnr (any unit) at radii in um; of the column water vapour and ozone."""

    depth: dict[float, float]
    albedo: dict[float, float] = field(default_factory=dict)
    index: dict[float, complex] = field(default_factory=dict)
    phase: dict[float, PhaseFunction] = field(default_factory=dict)
    radius_um: F64 = field(default_factory=lambda: np.zeros(0))
    volume: F64 = field(default_factory=lambda: np.zeros(0))
    single: dict[str, float] = field(default_factory=dict)

    @property
    def spherical(self) -> float:
        """Share of the particles that are spheres, by the inversion; 1 where it does not say."""
        return self.single.get("sphericity_percent", 100.0) / 100.0

    def depth_at(self, wavelength_nm: float) -> float:
        """Optical depth, by a power law between the nearest wavelengths."""
        known = sorted(self.depth)
        logs = np.log([self.depth[wl] for wl in known])
        return float(np.exp(np.interp(np.log(wavelength_nm), np.log(known), logs)))

    def particles(self, wavelength_nm: float) -> SphereOptics:
        """Bulk optics of the size distribution and index, by Mie theory; the share that is no spheres as irregular
        particles (docs/optics.md), since no table of spheroids is at hand."""
        if not self.radius_um.size or not self.index:
            raise UserError(
                "no size distribution and refractive index in the AERONET files: give an inversion of both "
                "(-999 is none; level 2.0 has an index in thick aerosol only, level 1.5 more often)"
            )
        sizes, known = self._sizes(), sorted(self.index)
        index = complex(*(np.interp(wavelength_nm, known, [part(self.index[wl]) for wl in known])
                          for part in (np.real, np.imag)))  # fmt: skip
        round_ones = scattering_by_spheres(sizes, index, wavelength_nm)
        if self.spherical >= 1:
            return round_ones
        rough = scattering_by_spheres(sizes, index, wavelength_nm, irregular=True)
        share = np.array([self.spherical, 1 - self.spherical])
        efficiency = np.array([round_ones.efficiency, rough.efficiency])
        scattered = share * efficiency * [round_ones.single_scattering_albedo, rough.single_scattering_albedo]
        value = (scattered[0] * round_ones.value + scattered[1] * rough.value) / scattered.sum()
        lost = float(share @ efficiency)
        return SphereOptics(round_ones.angle_deg, value, float(scattered.sum() / lost), lost)

    def _sizes(self) -> Sizes:
        log_radius = np.log(self.radius_um)
        fine = np.linspace(log_radius[0], log_radius[-1], _RADII)
        volume = np.interp(fine, log_radius, self.volume)
        radius = np.exp(fine)
        number = volume / radius**3
        return Sizes(radius, number / number.max())

    def aerosol(self, height_m: float | None = None) -> AerosolProfile:
        """An aerosol above a height (m above sea level; None: the site's): depth by wavelength, albedo, and phase
        functions as they were retrieved, else of the size distribution, else of the default aerosol."""
        height = self.single.get("height_m", 0.0) if height_m is None else height_m
        at_550 = self.depth_at(550.0)
        given: dict[str, Any] = {"optical_depth": at_550, "base_height_m": height}
        if len(self.depth) > 1:
            given["relative_extinction"] = {wl: value / at_550 for wl, value in sorted(self.depth.items())}
        if self.albedo:
            given["single_scattering_albedo"] = dict(self.albedo)
        if self.phase:
            given["phase"] = dict(self.phase)
        elif self.index and self.radius_um.size:
            given["phase"] = {wl: self.particles(wl).phase for wl in sorted(self.index)}
        return AerosolProfile(**given)


def read_aeronet(files: Any, time: Time = None, until: Time = None) -> Sunphotometer:
    """AERONET files of version 3 as their site's download has them: .lev10, .lev15, .lev20 of the direct sun, .all of
    inversions, or single products (.aod, .ssa, .rin, .siz, .pfn). Several files together make one aerosol.

    time : UTC; the row nearest to it of each file, within six hours. None: the mean of all rows.
    until : UTC; the mean of each file's rows from ``time`` to it, or where there are none, the row nearest to either.
    """
    first, last = parse_time(time), parse_time(until)
    if last is not None and (first is None or last < first):
        raise UserError(f"AERONET: until = {last} needs a time before it")
    rows = [_row(Path(path), first, last) for path in paths("files", files)]
    for names in (_SINGLE["latitude"], _SINGLE["longitude"]):
        if degrees := [row[name] for row in rows for name in names if name in row]:
            _check_one_site("AERONET files", degrees)
    found = {key: value for row in rows for key, value in row.items()}
    spectral = {name: _by_wavelength(found, pattern) for name, pattern in _SPECTRAL.items()}
    depth = spectral["depth"] or spectral["inverted_depth"]
    depth = {wl: value for wl, value in depth.items() if value > 0}
    if not depth:
        raise UserError("no optical depth in the AERONET files: give one of the direct sun, or an inversion with AOD")
    index = {wl: complex(real, spectral["imaginary"][wl]) for wl, real in spectral["real"].items()
             if wl in spectral["imaginary"]}  # fmt: skip
    sizes = sorted((float(name), value) for name, value in found.items() if re.fullmatch(_RADIUS, name))
    radius, volume = np.array(sizes).T if len(sizes) > 2 else (np.zeros(0), np.zeros(0))
    single = {ours: found[name] for ours, names in _SINGLE.items() for name in names if name in found}
    for name, (low, high) in PLACES.items():
        if not low <= single.get(name, 0.0) <= high:
            raise UserError(f"AERONET: {name} = {single[name]:g} is none: mend the file")
    return Sunphotometer(depth, spectral["albedo"], index, _phases(found), radius, volume, single)


def _by_wavelength(found: dict[str, float], pattern: str) -> dict[float, float]:
    matched = ((re.fullmatch(pattern, name), value) for name, value in found.items())
    return {float(match.group(1)): value for match, value in matched if match}


def _phases(found: dict[str, float]) -> dict[float, PhaseFunction]:
    """Phase functions of a .pfn file: a column per angle and wavelength."""
    tables: dict[float, list[tuple[float, float]]] = {}
    for name, value in found.items():
        if match := re.fullmatch(_ANGLE, name):
            tables.setdefault(float(match.group(2)), []).append((float(match.group(1)), value))
    out: dict[float, PhaseFunction] = {}
    for wavelength, rows in tables.items():
        angle, value = np.array(sorted(rows)).T
        if angle.size > 2 and angle[0] == 0 and angle[-1] == 180:
            out[wavelength] = TablePhase(angle, value)
    return out


def _row(path: Path, time: np.datetime64 | None, until: np.datetime64 | None) -> dict[str, float]:
    """Numbers by column: of the row nearest to a time, or the mean of the rows of a period, or of all."""
    lines = rows_of(path, _MOST_CHARACTERS, "latin-1")
    start = next((line for line in lines if any(re.match(r"Date[_(]", name) for name in line)), None)
    if start is None:
        raise UserError(f"{path}: no AERONET file of version 3: no line of column names with Date(dd:mm:yyyy)")
    header = [name.strip() for name in start]
    every = (line for line in lines if len(line) >= len(header) - 1)
    rows = list(every) if time is None else _of_period(path, header, every, time, time if until is None else until)
    if not rows:
        raise UserError(f"{path}: no rows")
    out = {}
    for number, name in enumerate(header):
        values = [_number(row[number]) for row in rows if number < len(row)]
        known = [value for value in values if value is not None]
        if known and name in _PLACE:
            _check_one_site(str(path), known)
        if known:
            out[name] = float(np.mean(known))
    return out


def _check_one_site(where: str, degrees: Sequence[float]) -> None:
    """Raise UserError where latitudes or longitudes are not those of one place."""
    low, high = min(degrees), max(degrees)
    if high - low > _ONE_SITE_DEG:
        raise UserError(f"{where}: rows of several sites, {low:g} and {high:g} degrees among them: give those of one")


def _of_period(
    path: Path, header: Sequence[str], every: Iterable[Sequence[str]], time: np.datetime64, last: np.datetime64
) -> list[Sequence[str]]:
    """The rows of a period, or where there are none, the row nearest to it: whole files may have decades of them."""
    places = [next((n for n, name in enumerate(header) if name.startswith(word)), None) for word in ("Date", "Time")]
    date, clock = places
    if date is None or clock is None:
        raise UserError(f"{path}: no columns Date(dd:mm:yyyy) and Time(hh:mm:ss)")
    within: list[Sequence[str]] = []
    nearest: tuple[np.timedelta64, np.datetime64, Sequence[str]] | None = None
    for row in every:
        stamp = _stamp(path, row[date], row[clock])
        apart = max(time - stamp, stamp - last, np.timedelta64(0, "ms"))
        if not apart:
            within.append(row)
        elif nearest is None or apart < nearest[0]:
            nearest = apart, stamp, row
    if within or nearest is None:
        return within
    if nearest[0] > _NEAR:
        when = time if time == last else f"{time} to {last}"
        raise UserError(f"{path}: nothing within six hours of {when}; the nearest row is of {nearest[1]}")
    return [nearest[2]]


def _stamp(path: Path, date: str, clock: str) -> np.datetime64:
    found = re.fullmatch(r"\s*(\d\d?)[:-](\d\d?)[:-](\d{4})\s*", date)
    hours = re.fullmatch(r"\s*\d\d:\d\d:\d\d\s*", clock)
    try:
        if found is None or hours is None:
            raise ValueError
        day, month, year = map(int, found.groups())
        return np.datetime64(f"{year:04d}-{month:02d}-{day:02d}T{clock.strip()}", "ms")
    except ValueError:
        raise UserError(f"{path}: {shown(date)} {shown(clock)} is no date and time") from None


def _number(text: str) -> float | None:
    try:
        value = float(text)
    except ValueError:
        return None
    return value if np.isfinite(value) and value > _LACKING else None
