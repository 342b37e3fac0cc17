"""Smooth crystals of ice that float level, nearly: plates show sundogs, circumzenithal arc, parhelic circle, pillars
and subsun, columns tangent arcs, the circumscribed halo, and arcs beside the halo of 46 degrees.

How they scatter depends on the sun's altitude, so rays are traced for each. Half of what crystals scatter is
diffracted, as other ice has it; here is the other half, but for what goes straight on.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from openswim.optics.displays.crystals import LENGTH_OVER_WIDTH, phase_function, refractive_index
from openswim.scene.phase import Mixture
from openswim.transport.engine.compiled import kernel
from openswim.transport.ice.prisms import MOST_WAYS, even, through_disc, trace

F64 = NDArray[np.float64]
Shares = tuple[tuple[str, float], ...]  # names of shapes, and how much of each

LEAN_DEG = {"plate": 0.0, "column": 90.0}  # of a prism's axis from upright
TILT_DEG = 1.0  # standard deviation of each of two tilts: pillars are some degrees high
ALTITUDES, AZIMUTHS = 900, 900  # of a map, in steps of .2 degrees
_SOLAR_RADIUS = math.radians(0.2665)
_RAYS = 1_500_000
_FEW_BINS = 5  # over how many each way a mean is taken where bins differ by chance only


@kernel()
def scattered(index, half_length, lean, sun_altitude, tilt, rays, altitudes, azimuths):
    """Shares (altitudes, azimuths) of the light on prisms whose axes lean from upright by an angle, to any side, by
    where it is seen: the altitude from straight down to straight up, and the azimuth from the sun's to the opposite,
    both sides together, in even bins; and the variances that they have by chance. What goes straight on is left out.
    The sun is a disc."""
    out, chance = np.zeros((altitudes, azimuths)), np.zeros((altitudes, azimuths))
    ways, hits = np.zeros((MOST_WAYS + 1, 4)), 0
    radius = math.sqrt(1.0 + half_length * half_length)
    for ray in range(rays):
        # where in the disc the light comes from: the way that it goes
        r, turn = _SOLAR_RADIUS * math.sqrt(even(ray, 0)), 2.0 * math.pi * even(ray, 1)
        up, aside = sun_altitude + r * math.sin(turn), r * math.cos(turn)
        x, y, z = -math.cos(up) * math.cos(aside), -math.cos(up) * math.sin(aside), -math.sin(up)
        # axes of the prism: c along it, but for the tilt; a and b turned around it
        side = 2.0 * math.pi * even(ray, 4)
        ex, ey, ez = math.cos(lean) * math.cos(side), math.cos(lean) * math.sin(side), -math.sin(lean)
        fx, fy = -math.sin(side), math.cos(side)
        r, turn = tilt * math.sqrt(-2.0 * math.log(max(even(ray, 2), 1e-12))), 2.0 * math.pi * even(ray, 3)
        p, q, w = math.sin(r) * math.cos(turn), math.sin(r) * math.sin(turn), math.cos(r)
        cx = w * math.sin(lean) * math.cos(side) + p * ex + q * fx
        cy = w * math.sin(lean) * math.sin(side) + p * ey + q * fy
        cz = w * math.cos(lean) + p * ez
        along = fx * cx + fy * cy
        ux, uy, uz = fx - along * cx, fy - along * cy, -along * cz
        size = math.sqrt(1.0 - along * along)
        ux, uy, uz = ux / size, uy / size, uz / size
        turn = even(ray, 7) * math.pi / 3
        p, q = math.cos(turn), math.sin(turn)
        ax = p * ux + q * (cy * uz - cz * uy)
        ay = p * uy + q * (cz * ux - cx * uz)
        az = p * uz + q * (cx * uy - cy * ux)
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
            i, j = min(i, altitudes - 1), min(j, azimuths - 1)
            out[i, j] += ways[n, 3]
            chance[i, j] += ways[n, 3] ** 2
    hits = max(hits, 1)
    return out / hits, chance / (1.0 * hits * hits)


def phase_map(
    wavelength_nm: float, sun_altitude_deg: float, rays: int = _RAYS, shape: str = "plate", tilt_deg: float = TILT_DEG
) -> F64:
    """P (ALTITUDES, AZIMUTHS) of level crystals of a shape ("plate", "column") at the middles of a map's bins, but for
    diffraction and what goes straight on; means over a degree where bins differ no more than by chance."""
    shares, chance = scattered(
        refractive_index(wavelength_nm), LENGTH_OVER_WIDTH[shape], math.radians(LEAN_DEG[shape]),
        math.radians(sun_altitude_deg), math.radians(tilt_deg), rays, ALTITUDES, AZIMUTHS,
    )  # fmt: skip
    altitude = np.linspace(-np.pi / 2, np.pi / 2, ALTITUDES + 1)
    sphere = 0.5 * np.diff(np.sin(altitude)) / AZIMUTHS  # share of it in a bin and its mirror image
    return np.asarray(0.5 * _less_chance(shares, chance) / sphere[:, None])


def _less_chance(shares: F64, chance: F64) -> F64:
    """Values moved toward the means of those around them, by how much of the variance there is chance (the local
    linear filter of least error; Lee 1980)."""
    from scipy.ndimage import uniform_filter

    around = uniform_filter(shares, _FEW_BINS, mode="reflect")
    variance = uniform_filter((shares - around) ** 2, _FEW_BINS, mode="reflect")
    by_chance = np.maximum(uniform_filter(chance, _FEW_BINS, mode="reflect"), 1e-30)  # running sums have rounding
    real = 1 - by_chance / np.maximum(variance, by_chance)
    return np.asarray(around + real * (shares - around))


def beyond_means(wavelengths_nm: F64, sun_altitude_deg: float, shapes: Shares) -> F64:
    """`beyond_mean` (ALTITUDES, AZIMUTHS, nw) of wavelengths, of which some may be alike."""
    maps = {w: beyond_mean(w, sun_altitude_deg, shapes) for w in dict.fromkeys(wavelengths_nm.tolist())}
    return np.stack([maps[w] for w in wavelengths_nm.tolist()], axis=-1)


def beyond_mean(wavelength_nm: float, sun_altitude_deg: float, shapes: Shares = (("plate", 1.0),)) -> F64:
    """`phase_map` less what the same crystals scatter there when they lie in all orientations; of several shapes as
    much as their shares say."""
    altitude = np.pi * ((np.arange(ALTITUDES) + 0.5) / ALTITUDES - 0.5)[:, None]
    azimuth = np.pi * (np.arange(AZIMUTHS) + 0.5) / AZIMUTHS
    sun = math.radians(sun_altitude_deg)
    cosine = np.sin(altitude) * np.sin(sun) + np.cos(altitude) * np.cos(sun) * np.cos(azimuth)
    out = np.zeros((ALTITUDES, AZIMUTHS))
    for shape, share in shapes:
        mean = phase_function(wavelength_nm, (shape,))
        assert isinstance(mean, Mixture)
        own = phase_map(wavelength_nm, sun_altitude_deg, shape=shape)
        out += share * (own - mean.weights[1] * mean.phases[1].value(cosine))
    return out
