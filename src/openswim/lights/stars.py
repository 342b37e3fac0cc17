"""The stars that the eye can see, and where they stand."""

import functools
from dataclasses import dataclass
from importlib import resources

import numpy as np
from numpy.typing import NDArray

from openswim.lights.ephemeris import observer_at, standard_pressure_pa
from openswim.lights.refraction import refracted_altitude_deg
from openswim.scene.times import Time

F64 = NDArray[np.float64]
UNKNOWN = -(2**15)  # a colour in the file that nobody has measured


@dataclass(frozen=True)
class Catalogue:
    """Stars, each (n,), brightest first: J2000 places, proper motion per year, and what they look like.

    Bright Star Catalogue, 5th edition (Hoffleit & Warren 1991), to V = 6.5; `tools/make_star_catalogue.py` made the
    file.  Places are kept to 1.5 seconds of arc, which is what the catalogue gives.
    """

    number: NDArray[np.int16]  # HR
    name: NDArray[np.str_]  # Flamsteed and Bayer, such as "19 Eta CMa"; empty for most
    right_ascension_deg: F64
    declination_deg: F64
    proper_motion_ra_mas: F64  # times cos(declination)
    proper_motion_dec_mas: F64
    magnitude: F64  # V
    colour: F64  # B - V; NaN where unknown

    def __len__(self) -> int:
        return len(self.number)

    def brighter(self, magnitude: float) -> "Catalogue":
        """The stars of up to a magnitude."""
        n = int(np.searchsorted(self.magnitude, magnitude, side="right"))
        return Catalogue(*(getattr(self, field)[:n] for field in self.__dataclass_fields__))


@dataclass(frozen=True)
class Stars:
    """Stars above a place, each (n,): their apparent direction, degrees, and the catalogue's lines."""

    altitude_deg: F64  # geometric, without refraction
    azimuth_deg: F64
    refracted_altitude_deg: F64
    catalogue: Catalogue


@functools.cache
def catalogue() -> Catalogue:
    """All stars to V = 6.5: 8404 of them."""
    with resources.files("openswim.lights").joinpath("data/bright_stars.npz").open("rb") as stream:
        kept = dict(np.load(stream))
    colour = np.where(kept["colour_cmag"] == UNKNOWN, np.nan, kept["colour_cmag"] / 100.0)
    return Catalogue(
        number=kept["number"],
        name=kept["name"].astype("U10"),
        right_ascension_deg=kept["right_ascension_ds"] / 10.0 / 240.0,
        declination_deg=kept["declination_arcsec"] / 3600.0,
        proper_motion_ra_mas=kept["proper_motion_ra_mas"].astype(float),
        proper_motion_dec_mas=kept["proper_motion_dec_mas"].astype(float),
        magnitude=kept["magnitude_cmag"] / 100.0,
        colour=colour,
    )


def star_positions(
    time: Time, lat: float, lon: float, height_m: float = 0.0, magnitude: float = 6.5, above_deg: float = -1.0
) -> Stars:
    """Apparent places at a time (UTC; before 1972 UT1) of the stars of up to a magnitude that stand above an altitude.

    Proper motion, precession, nutation, aberration, and refraction for visible light; no parallax (.0002 degrees).
    """
    from skyfield.api import Star

    chosen = catalogue().brighter(magnitude)
    stars = Star(
        ra_hours=chosen.right_ascension_deg / 15.0,
        dec_degrees=chosen.declination_deg,
        ra_mas_per_year=chosen.proper_motion_ra_mas,
        dec_mas_per_year=chosen.proper_motion_dec_mas,
    )
    apparent = observer_at(time, lat, lon, height_m).observe(stars).apparent()
    altitude, azimuth, _ = apparent.altaz()
    refracted = refracted_altitude_deg(altitude.degrees, standard_pressure_pa(height_m))
    up = np.flatnonzero(refracted > above_deg)
    lines = Catalogue(*(getattr(chosen, field)[up] for field in chosen.__dataclass_fields__))
    return Stars(altitude.degrees[up], azimuth.degrees[up], refracted[up], lines)
