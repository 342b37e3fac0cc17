"""AERONET's sun photometers: files of version 3, direct sun (depth, water vapour) and inversions, as an aerosol."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from openswim.arguments import paths, shown, written_number
from openswim.errors import UserError
from openswim.optics.spheres import Sizes, SphereOptics, scattering_by_spheres
from openswim.scene.aerosol import AerosolProfile
from openswim.scene.phase import PhaseFunction, TablePhase
from openswim.scene.times import Time, parse_time
from openswim.stations.text import PLACES, rows_of, told_of_end, told_of_lost

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
_RANGES = {  # of what is possible at all; raw level 1.0 has clouds among the aerosol
    "depth": (-1.0, 30.0), "inverted_depth": (-1.0, 30.0), "albedo": (0.0, 1.0), "real": (1.0, 3.0),
    "imaginary": (-1.0, 1.0), "water_vapour_cm": (-0.1, 12.0), "ozone_du": (50.0, 700.0),
    "sphericity_percent": (0.0, 100.0), "volume": (0.0, np.inf),
}  # fmt: skip
_ATM_CM = 0.05, 0.7  # ozone of files of 2017, which call it Dobson as well
_NONE = frozenset({"", "n/a", "nan", "na"})
_OPEN_END = "Exact_Wavelengths"  # a last name behind which rows have any number of columns
_SITES = ("AERONET_Site_Name", "AERONET_Site", "Site")
_PLACE = (*_SINGLE["latitude"], *_SINGLE["longitude"])
_ONE_SITE_DEG = 0.1
_OLD = re.compile(r"AOT")
_RADIUS, _ANGLE = r"\d+\.\d{6}", r"(\d+\.\d+)\[(\d+)nm\]"


@dataclass(frozen=True)
class Sunphotometer:
    """What AERONET files say: by wavelength (nm) optical depth, single-scattering albedo, refractive index and phase
    function; the volume size distribution dV/dlnr (any unit) at radii in um; of the column water vapour and ozone;
    what is to be told of the files."""

    depth: dict[float, float]
    albedo: dict[float, float] = field(default_factory=dict)
    index: dict[float, complex] = field(default_factory=dict)
    phase: dict[float, PhaseFunction] = field(default_factory=dict)
    radius_um: F64 = field(default_factory=lambda: np.zeros(0))
    volume: F64 = field(default_factory=lambda: np.zeros(0))
    single: dict[str, float] = field(default_factory=dict)
    source: str = "AERONET files"
    notes: tuple[str, ...] = ()

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
                f"{self.source}: no size distribution and refractive index: give an inversion of both "
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
    named = [Path(path) for path in paths("files", files)]
    source, notes = ", ".join(map(str, named)), list[str]()
    rows = [_row(path, first, last, notes) for path in named]
    for names in (_SINGLE["latitude"], _SINGLE["longitude"]):
        if degrees := [row[name] for row in rows for name in names if name in row]:
            _check_one_site("AERONET files", degrees)
    found = {key: value for row in rows for key, value in row.items()}
    spectral = {name: _by_wavelength(found, pattern) for name, pattern in _SPECTRAL.items()}
    depth = spectral["depth"] or spectral["inverted_depth"]
    depth = {wl: value for wl, value in depth.items() if value > 0}
    if not depth:
        old = " (AOT is of version 2: download version 3)" if any(_OLD.match(name) for name in found) else ""
        raise UserError(f"{source}: no optical depth (AOD_...nm, AOD_Extinction-Total[...nm]) above 0{old}: give "
                        "a file of the direct sun, or an inversion with AOD")  # fmt: skip
    index = {wl: complex(real, spectral["imaginary"][wl]) for wl, real in spectral["real"].items()
             if wl in spectral["imaginary"]}  # fmt: skip
    sizes = sorted((float(name), value) for name, value in found.items() if re.fullmatch(_RADIUS, name))
    radius, volume = np.array(sizes).T if len(sizes) > 2 else (np.zeros(0), np.zeros(0))
    single = {ours: found[name] for ours, names in _SINGLE.items() for name in names if name in found}
    for name, (low, high) in PLACES.items():
        if not low <= single.get(name, 0.0) <= high:
            raise UserError(f"{source}: {name} = {single[name]:g} is none: mend the file")
    return Sunphotometer(depth, spectral["albedo"], index, _phases(found), radius, volume, single, source, tuple(notes))


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


def _row(path: Path, time: np.datetime64 | None, until: np.datetime64 | None, notes: list[str]) -> dict[str, float]:
    """Numbers by column: of the row nearest to a time, the mean of the rows of a period, or of all. Adds to notes."""
    lines = rows_of(path, _MOST_CHARACTERS, "latin-1")
    start = next((line for line in lines if any(re.match(r"Date[_(]", name) for name in line)), None)
    if start is None:
        raise UserError(f"{path}: no AERONET file of version 3: no line of column names with Date(dd:mm:yyyy)")
    header = [_plain(name) for name in start]
    _check_names(path, header)
    whole = _Whole(header)
    every = whole.of(lines)
    rows = _of_period(path, header, every, time, time if until is None else until)
    try:
        told = told_of_lost(whole.lost, whole.count) or told_of_end(path)
    except UserError as error:
        raise UserError(f"{path}: {error}") from None
    if not rows:
        raise UserError(f"{path}: no rows")
    notes += [f"{path}: {told}"] if told else []
    rows = [list(row) for row in dict.fromkeys(map(tuple, rows))]  # rows that are there twice count once
    out = {}
    for number, name in enumerate(header):
        texts = [row[number] for row in rows if number < len(row)]
        kind = _kind(name)
        values = [_number(text) if kind is None else _counted(path, name, kind, text) for text in texts]
        known = [value for value in values if value is not None]
        if known and name in _PLACE:
            _check_one_site(str(path), known)
        if known:
            out[name] = float(np.mean(known))
    radii = [name for name in header if re.fullmatch(_RADIUS, name)]
    if (empty := [name for name in radii if name not in out]) and len(empty) < len(radii):
        raise UserError(f"{path}: no value for a radius of {empty[0]} um, though for others: download the file again")
    if not any(name in out for name in _PLACE):
        column = next((header.index(name) for name in _SITES if name in header), None)
        sites = [] if column is None else sorted({row[column] for row in rows})
        if len(sites) > 1:
            raise UserError(f"{path}: rows of several sites, {shown(sites[0])} and {shown(sites[1])} among them: "
                            "give those of one")  # fmt: skip
    return out


class _Whole:
    """Rows of one length, that of the names or one less at the end of all, and how many were of another: one by one, as
    whole files may have decades of them."""

    def __init__(self, header: Sequence[str]) -> None:
        self.names, self.lost, self.count = len(header), 0, 0
        self.is_open = not header[-1] or header[-1].startswith(_OPEN_END)

    def of(self, lines: Iterable[list[str]]) -> Iterator[list[str]]:
        for line in lines:
            if line[0].startswith("<"):  # the end of a web page
                continue
            self.count += 1
            if self.count == 1 and len(line) == self.names - 1:
                self.names -= 1
            if len(line) == self.names or (self.is_open and len(line) > self.names):
                yield [*line[:-1], _plain(line[-1])]
            else:
                self.lost += 1


def _plain(text: str) -> str:
    """Without blanks, and without the ends of lines that web pages have."""
    return text.strip().removesuffix("<br>").strip()


def _kind(name: str) -> str | None:
    """Which of our quantities a column has; None: none that counts."""
    spectral = next((ours for ours, pattern in _SPECTRAL.items() if re.fullmatch(pattern, name)), None)
    if spectral is None and re.fullmatch(_RADIUS, name):
        return "volume"
    return spectral or next((ours for ours, names in _SINGLE.items() if name in names), None)


def _check_names(path: Path, header: Sequence[str]) -> None:
    """Raise UserError where a column that counts is there twice, or has another unit."""
    for number, name in enumerate(header):
        if _kind(name) is not None and name in header[:number]:
            raise UserError(f"{path}: the column {shown(name)} is there twice: remove one")
        stem = name.partition("(")[0]
        known = [theirs for names in _SINGLE.values() for theirs in names if theirs.partition("(")[0] == stem]
        if known and name not in known:
            raise UserError(f"{path}: the column {shown(name)} is none of version 3, which has {known[0]}: download "
                            "it again")  # fmt: skip


def _counted(path: Path, name: str, kind: str, text: str) -> float | None:
    """A number of a column that counts; None where it is said to be missing."""
    value = _number(text)
    if value is None:
        if _number(text, lacking=-np.inf) is None and text.strip().lower() not in _NONE:
            raise UserError(f"{path}: {shown(text)} in the column {shown(name)} is no number: write -999 for none")
        return None
    if kind == "ozone_du" and _ATM_CM[0] <= value <= _ATM_CM[1]:
        return 1000.0 * value
    low, high = _RANGES.get(kind, (-np.inf, np.inf))
    if not low <= value <= high:
        raise UserError(f"{path}: {name} = {value:g}, where {low:g} to {high:g} are possible: is it of another unit?")
    return value


def _check_one_site(where: str, degrees: Sequence[float]) -> None:
    """Raise UserError where latitudes or longitudes are not those of one place."""
    low, high = min(degrees), max(degrees)
    if high - low > _ONE_SITE_DEG:
        raise UserError(f"{where}: rows of several sites, {low:g} and {high:g} degrees among them: give those of one")


def _of_period(
    path: Path, header: Sequence[str], every: Iterable[Sequence[str]],
    time: np.datetime64 | None, last: np.datetime64 | None,
) -> list[Sequence[str]]:  # fmt: skip
    """All rows, or those of a period, or where there are none, the row nearest to it: whole files may have decades."""
    places = [next((n for n, name in enumerate(header) if name.startswith(word)), None) for word in ("Date", "Time")]
    date, clock = places
    if date is None or clock is None:
        if time is None:
            return list(every)
        raise UserError(f"{path}: no columns Date(dd:mm:yyyy) and Time(hh:mm:ss)")
    within: list[Sequence[str]] = []
    nearest: tuple[np.timedelta64, np.datetime64, Sequence[str]] | None = None
    for row in every:
        stamp = _stamp(path, row[date], row[clock])
        if time is None or last is None:
            within.append(row)
            continue
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
        time = parse_time(f"{year:04d}-{month:02d}-{day:02d}T{clock.strip()}")
        assert time is not None
        return time
    except (ValueError, UserError):
        raise UserError(f"{path}: {shown(date)} {shown(clock)} is no date and time") from None


def _number(text: str, lacking: float = _LACKING) -> float | None:
    try:
        value = written_number(text)
    except ValueError:
        return None
    return value if np.isfinite(value) and value > lacking else None
