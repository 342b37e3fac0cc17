"""The sun's corona around the moon in a total eclipse, a millionth as bright as the sun."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from openswim.cameras import Camera
from openswim.cameras.pixels import Pixels
from openswim.heavens.points import Drawn, gathered
from openswim.heavens.sun_disc import Disc, Through, across, pixels_of
from openswim.scene.frame import horizon_vector
from openswim.scene.interpolation import smooth_step

F64 = NDArray[np.float64]

FARTHEST, _FADES = 12.0, 7.0  # radii of the sun; from where it fades, so that it has no edge in a dark sky
MOST_SUN = 0.02  # share of the sun's light beside which none of it is seen
_POLE_ICRS_DEG = (286.13, 63.87)  # right ascension and declination of the sun's north pole (Carrington's elements)
_FLATTER = (0.28, 0.06)  # R_equator / R_pole - 1 of its isophotes at the sun's least activity, and at its most
_LEAST_SFU, _MOST_SFU = 70.0, 180.0
_PLACES, _SMALL = 200_000, 1.5  # samples; radii of the sun under which pixels are looked at one by one ...
_WITHIN, _PER_RADIUS = 3, 12  # ... at least so many times each way, and so many to a radius: near the limb it is steep


def brightness(radius: F64, from_pole: F64, flattening: float = 0.0) -> F64:
    """Over the mean of the sun's disc (n,), at distances from its middle in radii and at angles from its pole (cosine).

    Baumbach 1937 with the light that dust scatters; 1.1e-6 of the sun's light beyond its limb. From 7 radii on it fades
    to nothing at 12, where dust has 1e-10 and shines on as the light of the zodiac.
    """
    r = np.maximum(radius * (1 + flattening * (from_pole**2 - 0.5)), 1.0)
    near = smooth_step(np.log(FARTHEST / np.maximum(radius, 1.0)) / np.log(FARTHEST / _FADES))
    return np.asarray(near * 1e-6 * (2.565 * r**-17.0 + 1.425 * r**-7.0 + 0.0532 * r**-2.5))


def flattening(flux_sfu: float) -> float:
    """Of a quiet sun the corona reaches farther along the equator, of an active one it is nearly round."""
    part = np.clip((flux_sfu - _LEAST_SFU) / (_MOST_SFU - _LEAST_SFU), 0, 1)
    return float(_FLATTER[0] + part * (_FLATTER[1] - _FLATTER[0]))


def pole_direction(to_icrs: F64) -> F64:
    """Of the sun's north (3,), in the axes that ``to_icrs`` (3, 3) turns to ICRS."""
    a, d = np.radians(_POLE_ICRS_DEG)
    return np.asarray(np.array([np.cos(d) * np.cos(a), np.cos(d) * np.sin(a), np.sin(d)]) @ to_icrs)


def drawn_corona(
    disc: Disc, pole: F64, flat: float, camera: Camera, pixels: Pixels, through: Through
) -> Drawn:  # fmt: skip
    """On the pixels of a picture, but for what the moon hides; ``pole`` (3,) of the sun in the horizon frame."""
    none = Drawn(np.zeros(0, int), np.zeros(0, int), np.zeros((0, len(disc.wavelengths_nm))))
    place, area = _spread(_PLACES // 20)
    row, column = pixels_of(camera, pixels, disc.directions(place))
    known = row >= 0
    if not known.any():
        return none
    width = float(np.sqrt(np.nanmedian(pixels.solid_angle_sr[row[known], column[known]])))
    ahead, sideways = horizon_vector(disc.azimuth_deg, disc.altitude_deg), across(disc.azimuth_deg, disc.altitude_deg)
    north = pole @ sideways
    north = north / max(float(np.linalg.norm(north)), 1e-9)
    mean = 4 / np.radians(disc.radius_deg) ** 2  # L' of the sun's disc

    def light(at: F64) -> F64:
        radius = np.hypot(*at.T)
        shown = (radius >= 1) & (radius < FARTHEST) & disc.free(at)
        return np.where(shown, mean * brightness(radius, (at @ north) / np.maximum(radius, 1), flat), 0.0)

    if width < _SMALL * np.radians(disc.radius_deg):
        rows, columns = (v.ravel() for v in np.mgrid[
            max(row[known].min() - 2, 0) : min(row[known].max() + 3, pixels.inside.shape[0]),
            max(column[known].min() - 2, 0) : min(column[known].max() + 3, pixels.inside.shape[1]),
        ])  # fmt: skip
        own = pixels.inside[rows, columns]
        rows, columns = rows[own], columns[own]
        found, within = np.zeros(len(rows)), max(_WITHIN, round(_PER_RADIUS * width / np.radians(disc.radius_deg)))
        for down, over in np.ndindex(within, within):
            part = ((down, over) - np.array(0.5 * (within - 1))) / within
            toward = horizon_vector(*camera.direction_of(rows + part[0], columns + part[1]))
            off = np.where((toward @ ahead > 0)[:, None], toward @ sideways, 1.0) / np.radians(disc.radius_deg)
            found += np.nan_to_num(light(off)) / within**2
        lit = np.flatnonzero(found)
        ways = pixels.direction[rows[lit], columns[lit]]
        transmittance, hit = through(ways, width)
        radiance = found[lit, None] * np.asarray(transmittance, float) * ~hit[:, None]
        return Drawn(rows[lit], columns[lit], radiance)

    place, area = _spread(_PLACES)
    row, column = pixels_of(camera, pixels, disc.directions(place))
    shine = light(place) * area * np.radians(disc.radius_deg) ** 2
    lit = np.flatnonzero((row >= 0) & (shine > 0))
    number, which = np.unique(row[lit] * pixels.inside.shape[1] + column[lit], return_inverse=True)
    ways = pixels.direction.reshape(-1, 3)[number]
    transmittance, hit = through(ways, width)
    arrives = shine[lit, None] * (np.asarray(transmittance, float) * ~hit[:, None])[which]
    per_sr = 1 / pixels.solid_angle_sr.ravel()[number[which]]
    return gathered(number[which], pixels.inside.shape[1], arrives * per_sr[:, None])


def _spread(count: int) -> tuple[F64, F64]:
    """Places (n, 2) around the sun in its radii, closer together near it, and the area (n,) that each stands for."""
    n = np.arange(count)
    log = np.log(FARTHEST)
    radius, turn = np.exp((n + 0.5) / count * log), 2 * np.pi * ((5**0.5 - 1) / 2) * n
    place = np.stack([radius * np.cos(turn), radius * np.sin(turn)], axis=-1)
    return place, 2 * np.pi * radius**2 * log / count
