"""Smooth plates of ice that float level, nearly: sundogs, circumzenithal arc, parhelic circle, pillars and subsun.

How they scatter depends on the sun's altitude, so rays are traced for each. Half of what plates scatter is diffracted,
as other ice has it; here is the other half, but for what goes straight on.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

from openswim.optics.displays.crystals import phase_function, refractive_index
from openswim.scene.phase import Mixture
from openswim.transport.ice.prisms import MOST_WAYS, even, through_disc, trace

F64 = NDArray[np.float64]

LENGTH_OVER_WIDTH = 0.2
TILT_DEG = 1.0  # standard deviation of each of two tilts: pillars are some degrees high
ALTITUDES, AZIMUTHS = 450, 450  # of a map, in steps of .4 degrees
_SOLAR_RADIUS = math.radians(0.2665)
_RAYS = 1_500_000


@njit(cache=True, error_model="numpy")
def scattered(index, half_length, sun_altitude, tilt, rays, altitudes, azimuths):
    """Shares (altitudes, azimuths) of the light on level prisms by where it is seen: the altitude from straight down to
    straight up, and the azimuth from the sun's to the opposite, both sides together, in even bins. What goes straight
    on is left out. The sun is a disc."""
    out, ways, hits = np.zeros((altitudes, azimuths)), np.zeros((MOST_WAYS + 1, 4)), 0
    radius = math.sqrt(1.0 + half_length * half_length)
    for ray in range(rays):
        # where in the disc the light comes from: the way that it goes
        r, turn = _SOLAR_RADIUS * math.sqrt(even(ray, 0)), 2.0 * math.pi * even(ray, 1)
        up, aside = sun_altitude + r * math.sin(turn), r * math.cos(turn)
        x, y, z = -math.cos(up) * math.cos(aside), -math.cos(up) * math.sin(aside), -math.sin(up)
        # axes of the prism: c upright but for the tilt, a and b turned around it
        r, turn = tilt * math.sqrt(-2.0 * math.log(max(even(ray, 2), 1e-12))), 2.0 * math.pi * even(ray, 3)
        cx, cy = math.sin(r) * math.cos(turn), math.sin(r) * math.sin(turn)
        cz = math.cos(r)
        turn = even(ray, 4) * math.pi / 3
        ax, ay = math.cos(turn), math.sin(turn)
        az = -(ax * cx + ay * cy) / cz
        size = math.sqrt(1.0 + az * az)
        ax, ay, az = ax / size, ay / size, az / size
        bx, by, bz = cy * az - cz * ay, cz * ax - cx * az, cx * ay - cy * ax
        dx, dy, dz = x * ax + y * ay + z * az, x * bx + y * by + z * bz, x * cx + y * cy + z * cz
        px, py, pz = through_disc(dx, dy, dz, radius, even(ray, 5), even(ray, 6))
        count = trace(px, py, pz, dx, dy, dz, index, half_length, ways)
        hits += min(count, 1)
        for n in range(count):
            p, q, w = ways[n, 0], ways[n, 1], ways[n, 2]
            if dx * p + dy * q + dz * w > 1.0 - 1e-9:
                continue
            x, y, z = p * ax + q * bx + w * cx, p * ay + q * by + w * cy, p * az + q * bz + w * cz
            i = int((math.asin(min(max(-z, -1.0), 1.0)) / math.pi + 0.5) * altitudes)
            j = int(math.atan2(abs(y), -x) / math.pi * azimuths)
            out[min(i, altitudes - 1), min(j, azimuths - 1)] += ways[n, 3]
    return out / max(hits, 1)


def phase_map(wavelength_nm: float, sun_altitude_deg: float, rays: int = _RAYS) -> F64:
    """P (ALTITUDES, AZIMUTHS) of level plates at the middles of a map's bins, but for diffraction and what goes
    straight on."""
    shares = scattered(
        refractive_index(wavelength_nm), LENGTH_OVER_WIDTH, math.radians(sun_altitude_deg), math.radians(TILT_DEG),
        rays, ALTITUDES, AZIMUTHS,
    )  # fmt: skip
    altitude = np.linspace(-np.pi / 2, np.pi / 2, ALTITUDES + 1)
    sphere = 0.5 * np.diff(np.sin(altitude)) / AZIMUTHS  # share of it in a bin and its mirror image
    return np.asarray(0.5 * shares / sphere[:, None])


def beyond_means(wavelengths_nm: F64, sun_altitude_deg: float) -> F64:
    """`beyond_mean` (ALTITUDES, AZIMUTHS, nw) of wavelengths, of which some may be alike."""
    maps = {w: beyond_mean(w, sun_altitude_deg) for w in dict.fromkeys(wavelengths_nm.tolist())}
    return np.stack([maps[w] for w in wavelengths_nm.tolist()], axis=-1)


def beyond_mean(wavelength_nm: float, sun_altitude_deg: float) -> F64:
    """`phase_map` less what the same plates scatter there when they lie in all orientations."""
    mean = phase_function(wavelength_nm, ("plate",))
    assert isinstance(mean, Mixture)
    altitude = np.pi * ((np.arange(ALTITUDES) + 0.5) / ALTITUDES - 0.5)[:, None]
    azimuth = np.pi * (np.arange(AZIMUTHS) + 0.5) / AZIMUTHS
    sun = math.radians(sun_altitude_deg)
    cosine = np.sin(altitude) * np.sin(sun) + np.cos(altitude) * np.cos(sun) * np.cos(azimuth)
    return np.asarray(phase_map(wavelength_nm, sun_altitude_deg) - mean.weights[1] * mean.phases[1].value(cosine))
