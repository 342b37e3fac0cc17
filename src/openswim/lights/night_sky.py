"""The sky behind the sun and the moon: faint stars, zodiacal light and airglow over a place at a time."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from openswim.lights.airglow import airglow_radiance, solar_flux_sfu
from openswim.lights.ephemeris import bodies, skyfield_time
from openswim.lights.milky_way import starlight_radiance
from openswim.lights.stars import catalogue
from openswim.lights.units import ARCSEC2_PER_SR, S10_W_M2_SR_NM, sunlike
from openswim.lights.zodiacal import zodiacal_radiance
from openswim.scene.grid import EARTH_RADIUS_M
from openswim.scene.times import Time

F64 = NDArray[np.float64]

_RULE = 12  # cosines of the rule that adds up the sky


@dataclass(frozen=True, eq=False)
class NightSky:
    """What shines above a place at a time, in the scene's axes.

    to_icrs (3, 3): the scene's axes, as columns, in ICRS; to_ecliptic (3, 3): the same in axes of the ecliptic of date
    whose first points at the sun's longitude. up (3,): in the scene's axes. flux_sfu: of the sun at 10.7 cm.
    """

    to_icrs: F64
    to_ecliptic: F64
    up: F64
    flux_sfu: float

    @classmethod
    def at(cls, time: Time, lat: float, lon: float, axes: F64, flux_sfu: float | None = None) -> NightSky:
        """Over a place, where ``axes`` (3, 3) are east, north and up in the scene's axes."""
        from skyfield.framelib import ecliptic_frame, itrs

        t = skyfield_time(time)
        p, q = np.radians([lat, lon])
        east = np.array([-np.sin(q), np.cos(q), 0.0])
        up = np.array([np.cos(p) * np.cos(q), np.cos(p) * np.sin(q), np.sin(p)])
        of_earth = np.stack([east, np.cross(up, east), up])  # in the Earth's axes
        to_icrs = itrs.rotation_at(t).T @ of_earth.T @ axes
        _, longitude, _ = bodies()["earth"].at(t).observe(bodies()["sun"]).apparent().frame_latlon(ecliptic_frame)
        cosine, sine = np.cos(longitude.radians), np.sin(longitude.radians)
        turn = np.array([[cosine, sine, 0.0], [-sine, cosine, 0.0], [0.0, 0.0, 1.0]])
        flux = solar_flux_sfu(time) if flux_sfu is None else flux_sfu
        return cls(to_icrs, turn @ ecliptic_frame.rotation_at(t) @ to_icrs, axes[2], flux)

    def beyond_air(self, direction: F64, wavelengths_nm: ArrayLike) -> F64:
        """W m-2 sr-1 nm-1 (n, nw) of zodiacal light and faint stars toward unit vectors (n, 3)."""
        x, y, z = (direction @ self.to_ecliptic.T).T
        lon, lat = np.degrees(np.arctan2(y, x)), np.degrees(np.arcsin(np.clip(z, -1, 1)))
        return zodiacal_radiance(lon, lat, wavelengths_nm) + starlight_radiance(
            direction @ self.to_icrs.T, wavelengths_nm
        )

    def airglow(self, height_m: float, direction: F64, wavelengths_nm: ArrayLike) -> F64:
        """W m-2 sr-1 nm-1 (n, nw) of the air's own light, seen from a height above sea level."""
        return airglow_radiance((EARTH_RADIUS_M + height_m) * self.up, direction, wavelengths_nm, self.flux_sfu)

    def mean(self, wavelengths_nm: ArrayLike) -> F64:
        """Radiance (nw,) of an even sky that sends as much down on the top of the clouds, bright stars included."""
        nodes, weights = np.polynomial.legendre.leggauss(_RULE)
        mu = np.repeat((nodes + 1) / 2, 2 * _RULE)
        turn = np.tile(np.arange(2 * _RULE) * np.pi / _RULE, _RULE)
        across = np.linalg.svd(self.up[None])[2][1:]
        sine = np.sqrt(1 - mu**2)[:, None]
        ring = np.cos(turn)[:, None] * across[0] + np.sin(turn)[:, None] * across[1]
        direction = mu[:, None] * self.up + sine * ring
        share = np.repeat(weights / 2, 2 * _RULE) * mu
        sky = self.beyond_air(direction, wavelengths_nm) + self.airglow(0.0, direction, wavelengths_nm)
        return np.asarray(share @ sky / share.sum() + bright_stars_radiance(wavelengths_nm))


def bright_stars_radiance(wavelengths_nm: ArrayLike) -> F64:
    """Stars to V = 6.5, spread evenly over the sky."""
    tenths = (10 ** (-0.4 * (catalogue().magnitude - 10.0))).sum() / (4 * np.pi * ARCSEC2_PER_SR / 3600.0**2)
    return np.asarray(tenths * S10_W_M2_SR_NM * sunlike(wavelengths_nm, 500.0))
