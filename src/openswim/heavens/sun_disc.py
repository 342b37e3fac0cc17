"""The sun's disc as an eye sees it: how much of its light is in sight, and on which pixels of a picture it falls."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from openswim.cameras import Camera
from openswim.cameras.pixels import Pixels
from openswim.lights import disc_points, disc_profile
from openswim.lights.eclipses import MoonShadow
from openswim.scene.frame import azimuth_altitude, horizon_vector

F64 = NDArray[np.float64]

RAYS = 256  # to places on the disc, by which the beam on an observer is summed: above a horizon right to .3 %
_MOST_RAYS = 16_384  # in a picture: one for each pixel of the disc, up to here
_FEWEST, _MOST, _PER_PIXEL = 4096, 1 << 18, 64  # places on the disc that fall on pixels
_MIDDLE_AND_LIMB = np.array([[0.0, 0.0], [0.0, 1.0], [0.0, -1.0], [1.0, 0.0], [-1.0, 0.0]])
_EVEN_DEG = 3.0  # from this height on the disc's middle stands for all of it
_LIFTS_DEG = np.append(0.0, np.geomspace(0.02, 90.0, 31))  # above a hidden sun, to where sky is seen

# Transmittance (n, nw) of all there is along directions (n, 3) in the horizon frame, as rays so wide (rad) see it, and
# whether they end on the ground (n,)
Through = Callable[[F64, float], tuple[NDArray[np.floating], NDArray[np.bool_]]]


def across(azimuth_deg: float, altitude_deg: float) -> F64:
    """Unit vectors (3, 2) to the right and up about a direction in the horizon frame."""
    right = horizon_vector(azimuth_deg + 90, 0.0)
    return np.stack([right, np.cross(right, horizon_vector(azimuth_deg, altitude_deg))], axis=-1)


@dataclass(frozen=True, eq=False)
class Bite:
    """The moon before the sun: where its middle is on the disc, right and up, and how wide it is, in radii of the sun.
    left (nw,): what of the sun's light it leaves."""

    right: float
    up: float
    radius: float
    left: F64

    @classmethod
    def of(cls, shadow: MoonShadow, origin_m: F64, axes: F64, left: F64) -> Bite:
        """As seen from a place in the scene frame, ``axes`` (3, 3) its east, north and up."""
        toward = []
        for body in (shadow.to_sun_m, shadow.to_moon_m):
            away = axes @ (body - origin_m)
            toward.append(away / np.linalg.norm(away))
        at = shadow.discs(origin_m[None])
        right, up = across(*azimuth_altitude(toward[0])).T
        sun = np.radians(at.sun_deg[0])
        return cls(
            float(toward[1] @ right / sun), float(toward[1] @ up / sun), float(at.moon_deg[0] / at.sun_deg[0]), left
        )

    def free(self, place: F64) -> NDArray[np.bool_]:
        """Which of places (n, 2) in radii of the sun it does not hide."""
        return np.asarray(np.hypot(place[:, 0] - self.right, place[:, 1] - self.up) > self.radius)


@dataclass(frozen=True)
class Disc:
    """The sun in the sky of an observer; angles in degrees. ``bite``: the moon, where it is before it."""

    azimuth_deg: float
    altitude_deg: float
    radius_deg: float
    wavelengths_nm: F64
    bite: Bite | None = None

    @property
    def left(self) -> F64:
        """What the moon leaves of its light (nw,)."""
        return np.ones(len(self.wavelengths_nm)) if self.bite is None else self.bite.left

    def free(self, place: F64) -> NDArray[np.bool_]:
        """Which of places (n, 2) on the disc the moon does not hide."""
        return np.ones(len(place), bool) if self.bite is None else self.bite.free(place)

    def directions(self, place: F64) -> F64:
        """Unit vectors (n, 3), east, north, up, of places (n, 2) on the disc in its radii, right and up."""
        at = self.azimuth_deg, self.altitude_deg
        away = horizon_vector(*at) + np.radians(self.radius_deg) * place @ across(*at).T
        return np.asarray(away / np.linalg.norm(away, axis=-1, keepdims=True))


@dataclass(frozen=True)
class Beam:
    """The sun's light on an observer.

    ``direct`` (nw,): share of the beam that arrives; ``visible``: share of the disc's light that no ground hides;
    ``open`` (nw,): transmittance toward that part, or toward the lowest sky above a sun that is hidden whole;
    ``altitude_deg``: of the light that arrives, or of that sky.
    """

    direct: F64
    visible: float
    open: F64
    altitude_deg: float


def beam_of(disc: Disc, through: Through) -> Beam:
    """What of the disc is in sight, of its limb the less; smooth while it rises over a horizon or a ridge."""
    place, share = disc_points(RAYS, disc.wavelengths_nm)
    direction = disc.directions(place)
    transmittance, hit = through(direction, 0.0)
    seen = share * ~hit[:, None]
    visible = seen.sum(axis=0)
    if not visible.all():
        return _hidden(disc, through)
    light = seen * transmittance
    direct = light.sum(axis=0)
    weight = light.sum(axis=1) if direct.any() else seen.sum(axis=1)
    sine = float(weight @ np.maximum(direction[:, 2], 0.0) / weight.sum())
    arrives, altitude = direct * disc.left, float(np.degrees(np.arcsin(sine)))
    return Beam(arrives, float((visible * disc.left).mean()), direct / visible, altitude)


def beams_of(discs: Sequence[Disc], through: Through) -> list[Beam]:
    """As `beam_of` of each; of a disc well up and in sight whole by its middle alone, which is one ray and not many."""
    direction = np.concatenate([each.directions(_MIDDLE_AND_LIMB) for each in discs])
    transmittance, hit = through(direction, 0.0)
    whole: NDArray[np.bool_] = ~np.any(hit.reshape(len(discs), -1), axis=1)
    middle = np.asarray(transmittance, float)[:: len(_MIDDLE_AND_LIMB)]
    return [
        Beam(light, 1.0, light, disc.altitude_deg)
        if seen and disc.bite is None and disc.altitude_deg > _EVEN_DEG
        else beam_of(disc, through)
        for disc, seen, light in zip(discs, whole, middle, strict=True)
    ]


def _hidden(disc: Disc, through: Through) -> Beam:
    """Of a disc that is hidden whole: where sky begins above it, found within a thirtieth of a way found roughly."""
    top = disc.altitude_deg + disc.radius_deg
    lift = _LIFTS_DEG
    for _ in range(2):
        altitude = np.minimum(top + lift, 90.0)
        transmittance, hit = through(horizon_vector(np.full(len(lift), disc.azimuth_deg), altitude), 0.0)
        first = int(np.argmin(hit)) if not hit.all() else len(lift) - 1
        lift = np.linspace(lift[max(first - 1, 0)], lift[first], len(lift))
    nothing = np.zeros(len(disc.wavelengths_nm))
    return Beam(nothing, 0.0, np.asarray(transmittance[first], float), float(altitude[first]))


def drawn(camera: Camera, pixels: Pixels, disc: Disc, through: Through) -> tuple[NDArray, NDArray, F64]:
    """Rows, columns (n,) and solar-relative radiance (n, nw; Albers et al. 2020, Eq. 2) of the pixels with sun in them.

    A pixel has the mean over its solid angle. Light falls on pixels place by place of the disc, so that radiance times
    solid angle sums to 4 pi times the beam of what the picture shows, whatever the shape and the size of its pixels.
    """
    some = _found(camera, pixels, disc)
    if not some[0].size:
        return *some, np.zeros((0, len(disc.wavelengths_nm)))
    nx, around = pixels.inside.shape[1], pixels.solid_angle_sr[some]
    area = np.pi * np.radians(disc.radius_deg) ** 2
    count = max(np.unique(some[0] * nx + some[1]).size, int(area / np.median(around)))  # as many were all of it seen

    ray = disc_points(int(np.clip(count, RAYS, _MOST_RAYS)), disc.wavelengths_nm)[0]
    width = float(np.sqrt(around.max()))
    transmittance, hit = through(disc.directions(ray), width)
    lit = np.asarray(transmittance, float) * ~hit[:, None]
    if count > _MOST // _PER_PIXEL and camera.optics is not None:
        return _in_small_pixels(camera, pixels, disc, ray, lit, some)

    place, share = disc_points(int(np.clip(_PER_PIXEL * count, _FEWEST, _MOST)), disc.wavelengths_nm)
    row, column = pixels_of(camera, pixels, disc.directions(place))
    known = row >= 0
    light = share[known] * lit[nearest(ray, place[known])] * disc.free(place[known])[:, None]
    pixel, number = np.unique(row[known] * nx + column[known], return_inverse=True)
    total = np.stack([np.bincount(number, each, len(pixel)) for each in light.T], axis=-1)
    return pixel // nx, pixel % nx, 4 * np.pi * total / pixels.solid_angle_sr.ravel()[pixel][:, None]


def _found(camera: Camera, pixels: Pixels, disc: Disc) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Row and column of pixels with sun in them: by places on the disc, and by the pixels' own middles where these are
    denser, of which a narrow view may have none of those places."""
    row, column = pixels_of(camera, pixels, disc.directions(disc_points(_FEWEST, disc.wavelengths_nm)[0]))
    known = row >= 0
    row, column = row[known], column[known]
    within = pixels.solid_angle_sr < np.pi * np.radians(disc.radius_deg) ** 2 / _FEWEST
    if within.any():
        toward = horizon_vector(disc.azimuth_deg, disc.altitude_deg)
        away = np.linalg.norm(pixels.direction[within] - toward, axis=-1)
        more = (each[away < np.radians(disc.radius_deg)] for each in np.nonzero(within))
        row, column = (np.append(own, each) for own, each in zip((row, column), more, strict=True))
    return row, column


def pixels_of(camera: Camera, pixels: Pixels, direction: F64) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Row and column of the pixel that a direction (n, 3) falls on; -1 outside of the picture."""
    at = Pixels(direction, np.empty(len(direction)))
    row, column = (np.floor(np.nan_to_num(v, nan=-9.0) + 0.5).astype(int)
                   for v in camera.pixel_of(at.azimuth_deg, at.altitude_deg))  # fmt: skip
    ny, nx = pixels.inside.shape
    within = (row >= 0) & (row < ny) & (column >= 0) & (column < nx)
    within[within] = pixels.inside[row[within], column[within]]
    return np.where(within, row, -1), np.where(within, column, -1)


def nearest(places: F64, wanted: F64) -> NDArray[np.int64]:
    """Which of places (n, 2) lies next to each of those wanted."""
    from scipy.spatial import cKDTree

    return np.asarray(cKDTree(places).query(wanted)[1])


def _in_small_pixels(
    camera: Camera, pixels: Pixels, disc: Disc, ray: F64, lit: F64, some: tuple[NDArray, NDArray]
) -> tuple[NDArray, NDArray, F64]:
    """`drawn` where the disc is a hundred pixels wide and more: by what 4 x 4 places in each pixel see of it."""
    row, column = (
        v.ravel() for v in np.mgrid[tuple(slice(max(a.min() - 2, 0), a.max() + 3) for a in some)]
    )  # fmt: skip
    within = (row < pixels.inside.shape[0]) & (column < pixels.inside.shape[1])
    row, column = row[within], column[within]
    radiance = np.zeros((len(row), len(disc.wavelengths_nm)))
    for down, over in np.ndindex(4, 4):
        at = camera.direction_of(row + (down - 1.5) / 4, column + (over - 1.5) / 4)
        off = horizon_vector(*at) @ across(disc.azimuth_deg, disc.altitude_deg) / np.radians(disc.radius_deg)
        radius = np.nan_to_num(np.hypot(*off.T), nan=2.0)
        near = np.flatnonzero((radius <= 1) & disc.free(off))
        radiance[near] += disc_profile(radius[near], disc.wavelengths_nm) * lit[nearest(ray, off[near])] / 16
    radiance *= 4 / np.radians(disc.radius_deg) ** 2
    there = pixels.inside[row, column] & radiance.any(axis=1)
    return row[there], column[there], radiance[there]
