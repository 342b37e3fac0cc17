"""Where the sun stands, against a table of apparent topocentric positions."""

from collections.abc import Iterator

import numpy as np
from numpy.typing import ArrayLike

from openswim.lights import sun_position
from openswim.scene.frame import horizon_vector
from openswim.validation.reference import Reference, Row, Solver, Stopwatch
from openswim.validation.reference.metrics import Score, score
from openswim.validation.reference.phases import PhaseTables

_COLUMNS = ("lat", "lon", "elev_m", "utc", "sun_alt_geom", "sun_az", "sun_alt_refracted", "sun_dist_au")


def matches(reference: Reference) -> bool:
    return reference.is_table and reference.has(*_COLUMNS)


def compare(reference: Reference, solver: Solver, phases: PhaseTables) -> Iterator[Row]:
    """Geometric and refracted position, errors in diameters of the sun; distance and diameter, relative."""
    watch = Stopwatch()
    lat, lon, height, time = (reference.column(name) for name in ("lat", "lon", "elev_m", "utc"))
    with watch.running():
        suns = [sun_position(str(t), *place) for t, *place in zip(time, lat, lon, height, strict=True)]
    cpu = watch.lap()
    azimuth = [sun.azimuth_deg for sun in suns]
    diameter = np.array([2 * sun.angular_radius_deg for sun in suns])
    true_azimuth = reference.column("sun_az")
    for quantity, altitude, column in (
        ("sun position, in its diameters", [sun.altitude_deg for sun in suns], "sun_alt_geom"),
        (
            "refracted sun position, in its diameters",
            [sun.refracted_altitude_deg for sun in suns],
            "sun_alt_refracted",
        ),
    ):
        found = position_score(altitude, azimuth, reference.column(column), true_azimuth, diameter)
        yield reference.row("ephemeris", quantity, found, cpu)
    distance = score([sun.distance_au for sun in suns], reference.column("sun_dist_au"))
    yield reference.row("ephemeris", "sun distance", distance, cpu)
    if "sun_diam_deg" in reference.data:
        yield reference.row(
            "ephemeris", "sun diameter", score(diameter, reference.column("sun_diam_deg")), cpu
        )


def position_score(
    altitude_deg: ArrayLike,
    azimuth_deg: ArrayLike,
    true_altitude_deg: ArrayLike,
    true_azimuth_deg: ArrayLike,
    diameter_deg: ArrayLike,
) -> Score:
    """Angular distance of two directions (rms) and difference in altitude (bias), in solar diameters."""
    here, there = horizon_vector(azimuth_deg, altitude_deg), horizon_vector(true_azimuth_deg, true_altitude_deg)
    apart = np.degrees(2 * np.arcsin(np.clip(np.linalg.norm(here - there, axis=-1) / 2, 0, 1)))
    lift = np.asarray(altitude_deg, float) - np.asarray(true_altitude_deg, float)
    diameter = np.asarray(diameter_deg, float)
    correlation = score(altitude_deg, true_altitude_deg).correlation
    rms = float(np.sqrt(np.mean((apart / diameter) ** 2)))
    return Score(rms, float(np.mean(lift / diameter)), correlation, apart.size)
