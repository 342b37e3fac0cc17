"""Where moon, planets and stars stand, and when eclipses happen, against tables by other programs."""

from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from openswim.lights import moon_position, planet_position, star_positions, sun_position
from openswim.lights.eclipses import lunar_eclipse, obscuration, solar_eclipse
from openswim.lights.eclipses.solar import discs
from openswim.scene.frame import horizon_vector
from openswim.validation.reference import Reference, Row, Solver, Stopwatch, groups
from openswim.validation.reference.metrics import in_marks, score
from openswim.validation.reference.phases import PhaseTables

Array = NDArray[np.float64]

PLACE_DEG, LIMB_DEG, CONTACT_S, DURATION_S, UMBRA_S, COVERED = 0.02, 0.2, 3.0, 4.0, 30.0, 0.003  # what is asked for
_WHERE = ("lat", "lon", "height_m")


def is_star_table(reference: Reference) -> bool:
    return reference.is_table and reference.has("hr", "azimuth_deg", "altitude_geometric_deg", *_WHERE)


def compare_stars(reference: Reference, solver: Solver, phases: PhaseTables) -> Iterator[Row]:
    """Geometric places, and the refracted altitude where the table has it, in marks of .02 degrees."""
    watch, apart, lift = Stopwatch(), [], []
    columns = [reference.column(name) for name in ("utc", *_WHERE)]
    with watch.running():
        for (time, lat, lon, height_m), rows in groups(*columns):
            stars = star_positions(time, lat, lon, height_m, above_deg=-90)
            number = stars.catalogue.number.tolist()
            at = [number.index(int(n)) for n in reference.column("hr")[rows]]
            true = (reference.column("azimuth_deg")[rows], reference.column("altitude_geometric_deg")[rows])
            apart += list(_apart_deg(stars.azimuth_deg[at], stars.altitude_deg[at], *true))
            lift += list(stars.refracted_altitude_deg[at] - reference.column("altitude_refracted_deg", np.nan)[rows])
    cpu = watch.lap()
    yield reference.row("ephemeris", "star places, in marks of .02 degrees", in_marks(apart, PLACE_DEG), cpu)
    yield reference.row("ephemeris", "refracted altitudes, in marks of .02 degrees", in_marks(lift, PLACE_DEG), cpu)


def is_planet_table(reference: Reference) -> bool:
    return reference.is_table and reference.has("body", "azimuth_ephem_deg", "altitude_ephem_deg", *_WHERE)


def compare_planets(reference: Reference, solver: Solver, phases: PhaseTables) -> Iterator[Row]:
    watch = Stopwatch()
    columns = [reference.column(name) for name in ("body", "utc", *_WHERE)]
    special: dict[str, Callable[..., Any]] = {"moon": moon_position, "sun": sun_position}
    with watch.running():
        found: list[Any] = [
            special[body](str(time), *place) if body in special else planet_position(str(body), str(time), *place)
            for body, time, *place in zip(*columns, strict=True)
        ]
    apart = _apart_deg(
        [each.azimuth_deg for each in found], [each.altitude_deg for each in found],
        reference.column("azimuth_ephem_deg"), reference.column("altitude_ephem_deg"),
    )  # fmt: skip
    cpu = watch.lap()
    yield reference.row("ephemeris", "places, in marks of .02 degrees", in_marks(apart, PLACE_DEG), cpu)
    magnitude = np.array([getattr(each, "magnitude", np.nan) for each in found])
    off = magnitude - reference.column("magnitude_mallama_hilton", np.nan)
    yield reference.row("ephemeris", "magnitudes, in marks of .15", in_marks(off, 0.15), cpu)


def is_orientation_table(reference: Reference) -> bool:
    return reference.is_table and reference.has("sub_observer_lon_deg", "bright_limb_from_zenith_deg", *_WHERE)


def compare_orientation(reference: Reference, solver: Solver, phases: PhaseTables) -> Iterator[Row]:
    watch = Stopwatch()
    columns = [reference.column(name) for name in ("utc", *_WHERE)]
    with watch.running():
        moons = [moon_position(str(time), *place) for time, *place in zip(*columns, strict=True)]
    cpu = watch.lap()
    names = ("sub_observer_lon_deg", "sub_observer_lat_deg", "sub_solar_lon_deg", "sub_solar_lat_deg")
    places = np.array([(*m.sub_observer_lonlat_deg, *m.subsolar_lonlat_deg) for m in moons])
    off = _turn(places - np.stack([reference.column(name) for name in names], axis=-1))
    yield reference.row("ephemeris", "libration and sun, in marks of .02 degrees", in_marks(off, PLACE_DEG), cpu)
    for name, mark in (("axis_from_zenith_deg", PLACE_DEG), ("bright_limb_from_zenith_deg", LIMB_DEG)):
        off = _turn(np.array([getattr(m, name) for m in moons]) - reference.column(name))
        words = name.removesuffix("_deg").replace("_", " ")
        yield reference.row("ephemeris", f"{words}, in marks of {mark:g} degrees", in_marks(off, mark), cpu)


def is_solar_eclipse_table(reference: Reference) -> bool:
    return reference.is_table and reference.has("C1_utc", "C4_utc", "max_utc", "obscuration", *_WHERE)


def compare_solar_eclipses(reference: Reference, solver: Solver, phases: PhaseTables) -> Iterator[Row]:
    """A row per eclipse: contacts, duration and obscuration, in marks."""
    columns = [reference.column(name) for name in ("eclipse", "max_utc", *_WHERE)]
    lines = list(zip(*columns, strict=True))
    for (day,), rows in groups(columns[0]):
        watch = Stopwatch()
        off, lasts, covered = [], [], []
        for n in rows:
            _, middle, *place = lines[n]
            with watch.running():
                found = solar_eclipse(f"{day}T{str(middle)[:5]}", *place)
            if found is None:
                off.append(np.inf)
                continue
            times = {"C1": found.first, "C2": found.second, "max": found.greatest, "C3": found.third, "C4": found.last}
            late = {name: _late_s(when, day, reference.column(f"{name}_utc")[n]) for name, when in times.items()}
            off += [late[name] for name in ("C1", "C2", "C3", "C4")]
            lasts.append(late["C3"] - late["C2"])
            covered.append(found.obscuration - float(reference.column("obscuration")[n]))
        cpu = watch.lap()
        yield reference.row("ephemeris", f"{day}, contacts, in marks of 3 s", in_marks(off, CONTACT_S), cpu)
        yield reference.row("ephemeris", f"{day}, totality, in marks of 4 s", in_marks(lasts, DURATION_S), cpu)
        yield reference.row("ephemeris", f"{day}, obscuration, in marks of .003", in_marks(covered, COVERED), cpu)


def is_eclipse_course(reference: Reference) -> bool:
    return reference.is_table and reference.has("separation_deg", "obscuration", "utc", *_WHERE)


def compare_eclipse_course(reference: Reference, solver: Solver, phases: PhaseTables) -> Iterator[Row]:
    watch = Stopwatch()
    columns = [reference.column(name) for name in ("eclipse", "utc", *_WHERE)]
    with watch.running():
        share = [float(obscuration(discs(f"{day}T{time}", *place))[0])
                 for day, time, *place in zip(*columns, strict=True)]  # fmt: skip
    off = in_marks(np.array(share) - reference.column("obscuration"), COVERED)
    yield reference.row("ephemeris", "obscuration, in marks of .003", off, watch.lap())


def is_lunar_eclipse_table(reference: Reference) -> bool:
    return reference.is_table and reference.has("shadow", "U1", "U4", "umbral_magnitude")


def compare_lunar_eclipses(reference: Reference, solver: Solver, phases: PhaseTables) -> Iterator[Row]:
    """Contacts with Danjon's umbra, in marks of 30 s."""
    watch = Stopwatch()
    off, magnitude, true = [], [], []
    for n in np.flatnonzero(reference.column("shadow") == "Danjon"):
        day = str(reference.column("eclipse")[n])
        with watch.running():
            found = lunar_eclipse(f"{day}T{str(reference.column('max')[n])[:5]}")
        if found is None:
            off.append(np.inf)
            continue
        contacts = {"U1": found.u1, "U2": found.u2, "U3": found.u3, "U4": found.u4}
        off += [_late_s(when, day, reference.column(name)[n]) for name, when in contacts.items()]
        magnitude.append(found.umbral_magnitude)
        true.append(float(reference.column("umbral_magnitude")[n]))
    cpu = watch.lap()
    yield reference.row("ephemeris", "umbral contacts, in marks of 30 s", in_marks(off, UMBRA_S), cpu)
    yield reference.row("ephemeris", "umbral magnitude", score(magnitude, true), cpu)


def _late_s(when: np.datetime64 | None, day: str, clock: Any) -> float:
    """Seconds after a clock's time of the day; NaN where neither has one, or the clock has none."""
    text = str(clock)
    if text in ("", "nan"):
        return np.nan
    if when is None:
        return np.inf
    late = (when - np.datetime64(f"{day}T{text}")) / np.timedelta64(1, "s")
    return float((late + 43_200) % 86_400 - 43_200)


def _turn(angle_deg: Array) -> Array:
    return np.asarray((angle_deg + 180) % 360 - 180)


def _apart_deg(azimuth: Any, altitude: Any, true_azimuth: Any, true_altitude: Any) -> Array:
    here, there = horizon_vector(azimuth, altitude), horizon_vector(true_azimuth, true_altitude)
    return np.asarray(np.degrees(2 * np.arcsin(np.clip(np.linalg.norm(here - there, axis=-1) / 2, 0, 1))))
