"""Spectral irradiance on a horizontal plane from the radiance of the sky."""

from dataclasses import dataclass

import numpy as np
import xarray as xr

from openswim.lights.spectrum import solar_irradiance
from openswim.scene.frame import horizon_vector

PATCH_DEG = 40.0  # radius of the finer rule about the sun


@dataclass(frozen=True)
class Quadrature:
    """Directions (n,) over the upper hemisphere, degrees, and their solid angles (n,).

    sum(solid_angle_sr * L * sin(altitude)) is the irradiance of a sky of radiance L on a horizontal plane.
    """

    azimuth_deg: np.ndarray
    altitude_deg: np.ndarray
    solid_angle_sr: np.ndarray

    def __len__(self) -> int:
        return len(self.solid_angle_sr)


def quadrature_directions(
    n: int = 12, sun_azimuth_deg: float | None = None, sun_altitude_deg: float = 0.0
) -> Quadrature:
    """Where to look to integrate the sky: n Gauss-Legendre altitudes x 2n azimuths, finer about the sun.

    The share cos^4 of each radiance within 40 degrees of the sun goes to a rule in polar coordinates about
    the sun (n distances, dense near it, x 2n position angles), the remainder to the rule about the zenith:
    both then see smooth functions, and a forward peak of any width is resolved.  Directions below the horizon
    are left out.  About 4 n^2 directions with the sun up.
    Accuracy for n = 12: 1e-4 for a uniform sky, .4 % for Henyey-Greenstein skies up to g = .95 at any sun.
    """
    altitude, azimuth, solid_angle = _hemisphere_rule(n)
    if sun_azimuth_deg is None:
        return Quadrature(azimuth, altitude, solid_angle)
    sun = horizon_vector(sun_azimuth_deg, sun_altitude_deg)
    cosine = horizon_vector(azimuth, altitude) @ sun
    solid_angle = solid_angle * (1 - _patch_share(np.arccos(np.clip(cosine, -1, 1))))

    distance, position, patch_angle = _patch_rule(n)
    patch_angle = patch_angle * _patch_share(distance)
    vectors = _about(sun_azimuth_deg, sun_altitude_deg, distance, position)
    visible = vectors[:, 2] > 0
    vectors, patch_angle = vectors[visible], patch_angle[visible]
    patch_azimuth = np.degrees(np.arctan2(vectors[:, 0], vectors[:, 1])) % 360
    patch_altitude = np.degrees(np.arcsin(np.clip(vectors[:, 2], 0, 1)))
    return Quadrature(
        np.concatenate([azimuth, patch_azimuth]),
        np.concatenate([altitude, patch_altitude]),
        np.concatenate([solid_angle, patch_angle]),
    )


def _hemisphere_rule(n: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Altitude, azimuth (degrees) and solid angle of n x 2n directions; rows are staggered."""
    nodes, weights = np.polynomial.legendre.leggauss(n)
    mu = (nodes + 1) / 2
    azimuth = (np.arange(2 * n) + 0.5 * (np.arange(n) % 2)[:, None]) * (180.0 / n)
    altitude = np.broadcast_to(np.degrees(np.arcsin(mu))[:, None], azimuth.shape)
    solid_angle = np.broadcast_to((weights / 2 * np.pi / n)[:, None], azimuth.shape)
    return altitude.ravel(), azimuth.ravel(), solid_angle.ravel()


def _patch_rule(n: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Distance from the sun, position angle (radians) and solid angle; nodes crowd toward the sun."""
    nodes, weights = np.polynomial.legendre.leggauss(n)
    root = (nodes + 1) / 2
    distance = np.radians(PATCH_DEG) * root**2
    ring = np.sin(distance) * np.radians(PATCH_DEG) * root * weights * np.pi / n
    position = (np.arange(2 * n) + 0.5 * (np.arange(n) % 2)[:, None]) * (np.pi / n)
    spread = np.broadcast_to(distance[:, None], position.shape)
    return spread.ravel(), position.ravel(), np.broadcast_to(ring[:, None], position.shape).ravel()


def _patch_share(distance: np.ndarray) -> np.ndarray:
    """Share of the radiance that the rule about the sun takes: 1 at the sun, smoothly 0 at its edge."""
    return np.where(
        distance < np.radians(PATCH_DEG), np.cos(distance / np.radians(PATCH_DEG) * np.pi / 2) ** 4, 0
    )


def _about(azimuth_deg: float, altitude_deg: float, distance: np.ndarray, position: np.ndarray) -> np.ndarray:
    """Unit vectors (n, 3) at `distance` (radians) from a direction, at position angle `position`."""
    forward = horizon_vector(azimuth_deg, altitude_deg)
    right = horizon_vector(azimuth_deg + 90, 0.0)
    up = np.cross(right, forward)
    around = np.cos(position)[:, None] * right + np.sin(position)[:, None] * up
    return np.cos(distance)[:, None] * forward + np.sin(distance)[:, None] * around


def spectral_irradiance(
    radiance: np.ndarray,
    quadrature: Quadrature,
    direct_transmittance: np.ndarray,
    sun_altitude_deg: float,
    wavelengths_nm: np.ndarray,
    distance_au: float = 1.0,
) -> xr.Dataset:
    """Global, direct and diffuse horizontal, and direct normal spectral irradiance, W m-2 nm-1 (wavelength).

    `radiance` (n, nwl): solar-relative radiance L' of the sky in the quadrature's directions, without the
    sun's disc; `direct_transmittance` (nwl,): of the beam from space to the plane, 0 where ground hides the
    sun.  E = E_TOA / (4 pi) sum w
    L' sin h (Albers et al. 2020, Eq. 2 and Sect. 3.1).  `relative_*` are the same over E_TOA.
    """
    wavelengths = np.atleast_1d(np.asarray(wavelengths_nm, dtype=float))
    sine = np.sin(np.radians(quadrature.altitude_deg))
    diffuse = (quadrature.solid_angle_sr * sine) @ np.asarray(radiance, dtype=float) / (4 * np.pi)
    direct = np.asarray(direct_transmittance, dtype=float)
    horizontal = direct * max(np.sin(np.radians(sun_altitude_deg)), 0.0)
    top = solar_irradiance(wavelengths) / distance_au**2
    result = xr.Dataset(coords={"wavelength": ("wavelength", wavelengths, {"units": "nm"})})
    for name, relative in {
        "global_horizontal": horizontal + diffuse,
        "direct_horizontal": horizontal,
        "diffuse_horizontal": diffuse,
        "direct_normal": direct,
    }.items():
        words = name.replace("_", " ")
        result[name] = (
            "wavelength",
            relative * top,
            {"units": "W m-2 nm-1", "long_name": f"{words} irradiance"},
        )
        result[f"relative_{name}"] = (
            "wavelength",
            relative,
            {"units": "1", "long_name": f"{words} over solar"},
        )
    return result
