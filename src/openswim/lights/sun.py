"""Where the sun stands, from JPL's DE421 as shipped by skyfield-data: offline, 1900 to 2053."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray

from openswim.lights.ephemeris import bodies, observer, observer_at, skyfield_time, skyfield_times
from openswim.lights.refraction import lit_altitude_deg
from openswim.scene.times import Time

SUN_RADIUS_KM = 695_700.0  # IAU 2015 nominal
AU_KM = 149_597_870.7  # IAU 2012


@dataclass(frozen=True)
class Sun:
    """The sun as seen from one place; all of it apparent (light time and aberration included)."""

    altitude_deg: float  # geometric, without refraction
    azimuth_deg: float  # clockwise from north
    refracted_altitude_deg: float
    distance_au: float
    angular_radius_deg: float

    @property
    def lit_altitude_deg(self) -> float:
        """From where its light comes: where it is seen, and once it is down as twilight is lit."""
        return float(_lit_from(self.refracted_altitude_deg, self.altitude_deg))


def sun_position(
    time: Time,
    lat: float,
    lon: float,
    height_m: float = 0.0,
    pressure_pa: float | None = None,
    temperature_k: float = 283.15,
) -> Sun:
    """The apparent sun at a place on the WGS84 ellipsoid.

    Parameters: `time` UTC (before 1972 UT1); `lat`, `lon` geographic, degrees; `height_m` above the ellipsoid;
    `pressure_pa` and `temperature_k` of the air at the observer, for the refraction (None: 1010 hPa at sea level and
    less above; Bennett 1982, about 0.1' above 15 degrees, minutes of arc at the horizon, none below -1 degree).
    Accuracy: about 0.0003 degree (DE421; the limit is UT1, extrapolated after skyfield's built-in table ends).
    """
    apparent = observer_at(time, lat, lon, height_m).observe(bodies()["sun"]).apparent()
    altitude, azimuth, distance = apparent.altaz()
    pressure_mbar = "standard" if pressure_pa is None else pressure_pa / 100
    refracted, _, _ = apparent.altaz(temperature_C=temperature_k - 273.15, pressure_mbar=pressure_mbar)
    return Sun(
        altitude_deg=float(altitude.degrees),
        azimuth_deg=float(azimuth.degrees),
        refracted_altitude_deg=float(refracted.degrees),
        distance_au=float(distance.au),
        angular_radius_deg=float(_angular_radius_deg(distance.km)),
    )


@dataclass(frozen=True)
class SunTrack:
    """The sun at one place at times (n,): the same as `Sun` says, as arrays."""

    altitude_deg: NDArray[np.float64]
    azimuth_deg: NDArray[np.float64]
    refracted_altitude_deg: NDArray[np.float64]
    distance_au: NDArray[np.float64]

    @cached_property
    def angular_radius_deg(self) -> NDArray[np.float64]:
        return _angular_radius_deg(self.distance_au * AU_KM)

    @cached_property
    def lit_altitude_deg(self) -> NDArray[np.float64]:
        """As `Sun` has it."""
        return _lit_from(self.refracted_altitude_deg, self.altitude_deg)


def _angular_radius_deg(distance_km: ArrayLike) -> NDArray[np.float64]:
    return np.degrees(np.arcsin(SUN_RADIUS_KM / np.asarray(distance_km, float)))


def _lit_from(seen_deg: ArrayLike, true_deg: ArrayLike) -> NDArray[np.float64]:
    return np.where(np.asarray(seen_deg) >= 0, seen_deg, lit_altitude_deg(true_deg))


def sun_track(times: NDArray[np.datetime64], lat: float, lon: float, height_m: float = 0.0) -> SunTrack:
    """The apparent sun at many times, as `sun_position` has it at one (2 ms); a day of minutes takes 20 ms."""
    apparent = observer(lat, lon, height_m).at(skyfield_times(times)).observe(bodies()["sun"]).apparent()
    altitude, azimuth, distance = apparent.altaz()
    refracted, _, _ = apparent.altaz(temperature_C=10.0, pressure_mbar="standard")
    high, around, lifted = (np.asarray(each.degrees, float) for each in (altitude, azimuth, refracted))
    return SunTrack(high, around, lifted, np.asarray(distance.au, float))


def subsolar_point(time: Time) -> tuple[float, float]:
    """Latitude and longitude (degrees) of the vertical that points at the apparent sun.

    A model's geographic latitude is the direction of the vertical.  On a sphere with those latitudes, the
    unit vector (cos lat cos lon, cos lat sin lon, sin lat) of this point is the direction toward the sun for
    every observer, and gives the ephemeris azimuth and altitude to .0025 degree, the sun's parallax.
    """
    from skyfield.framelib import itrs

    earth = bodies()["earth"].at(skyfield_time(time))
    apparent = earth.observe(bodies()["sun"]).apparent()
    lat, lon, _ = apparent.frame_latlon(itrs)
    return float(lat.degrees), (float(lon.degrees) + 180.0) % 360.0 - 180.0
