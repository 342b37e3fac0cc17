"""Light of towns beyond the scene's domain: domes on the horizon, of what clear air scatters once on the way to an eye.

Within the domain the transport has the towns' light itself. Beyond, sources stand in rings around the eye, to 150 km.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from openswim.ground.cities import city_radiance, lamp_spectrum
from openswim.heavens.seen import Heavens
from openswim.scene import Scene
from openswim.scene.around import Around, directions_around
from openswim.scene.frame import Frame
from openswim.scene.ground import Ground
from openswim.transport import Field
from openswim.transport.air.shells import fractional_index, shell_levels
from openswim.transport.engine.pack import PACK

F64 = NDArray[np.float64]

HIGHEST_EYE_M = 2e4
_RINGS_M = np.geomspace(4e3, 150e3, 11)
_AROUND, _INSIDE = 24, 3  # sources in a ring; places that each stands for, along and across
_AZIMUTHS = 24
_ALTITUDE_DEG = np.array([-0.5, 0.5, 1.5, 3.0, 5.0, 8.0, 12.0, 18.0, 26.0, 36.0, 50.0, 70.0, 90.0])
_SAMPLES, _FARTHEST_M, _THIN_M = 14, 2.5e5, 3e4  # along a ray; its end: so far, or where the air is thin
_LOW = 0.049  # of z^4 beside cos z in what towns send up at a zenith angle z: 15 % of their light (Garstang 1986)
# Of light scattered forward, what is not lost. No physics but one number for all that is scattered more than once: it
# makes green domes of towns 20 to 60 km away .6 to 1.35 times as bright as the transport's in a haze of .15 (optical
# depth at 550 nm). The same number gives .97 to 1.55 in one of .03, and .2 to .9 in one of .4.
_STAYS = 0.3
_POINTS = np.polynomial.legendre.leggauss(4)


@dataclass(frozen=True, eq=False)
class Air:
    """Clear air on heights (n,) above its ground: what is lost (n, nw), scattering of molecules and aerosol (n, nw),
    1/m; asymmetry (nw,) of the latter. radius_m: of the ground.

    Of light that is scattered into the forward half of all directions some arrives nonetheless, and is not lost.
    """

    height_m: F64
    lost: F64
    molecules: F64
    aerosol: F64
    asymmetry: F64
    radius_m: float

    @classmethod
    def of(cls, field: Field) -> Air:
        """That of the shells, without what delta scaling does."""
        rows = [pack.shells.rows for pack in field.lit]

        def of_terms(first: int) -> F64:
            part = slice(first * PACK, (first + 1) * PACK)
            every = [each[:, part][:, : pack.count] for each, pack in zip(rows, field.lit, strict=True)]
            return np.asarray(field.terms.mean(np.concatenate(every, axis=1).astype(float)))

        shells = field.lit[0].shells
        first = [pack.shells.phase[1, 1, : pack.count].astype(float) for pack in field.lit]
        scaled = field.terms.mean(np.concatenate(first)[None])[0]
        taken, aerosol = of_terms(3), of_terms(2)
        share = taken.sum(axis=0) / np.maximum(aerosol.sum(axis=0), 1e-30)
        asymmetry, molecules = np.clip(scaled + share, 0.0, 0.95), of_terms(1)
        lost = of_terms(0) + taken - _STAYS * (0.5 * molecules + 0.5 * (1 + asymmetry) * aerosol)
        return cls(
            shell_levels(), lost, molecules, aerosol, asymmetry,
            shells.radius_m + shells.ground_m,
        )  # fmt: skip


def far_sources(
    frame: Frame, lat: float, lon: float, within: Callable[[F64, F64], NDArray[np.bool_]], ground: Ground | None
) -> tuple[F64, F64]:
    """Latitudes and longitudes (n, 2) of sources around a place, and nW cm-2 sr-1 times their areas (n,), m2, of what
    is not ``within`` the domain."""
    turn = (np.arange(_AROUND * _INSIDE) + 0.5) / (_AROUND * _INSIDE) * 2 * np.pi
    edges = np.geomspace(_RINGS_M[0], _RINGS_M[-1], _INSIDE * (len(_RINGS_M) - 1) + 1)
    away, azimuth = np.meshgrid(np.sqrt(edges[1:] * edges[:-1]), turn, indexing="ij")
    area = (0.5 * np.diff(edges**2) * (turn[1] - turn[0]))[:, None]
    north = np.degrees(away * np.cos(azimuth) / frame.radius_m)
    there = np.clip(lat + north, -89.9, 89.9)
    east = np.degrees(away * np.sin(azimuth) / frame.radius_m) / np.cos(np.radians(there))
    light = city_radiance(there, lon + east, ground, np.sqrt(area)) * area * ~within(there, lon + east)

    def gathered(values: F64) -> F64:
        return values.reshape(len(_RINGS_M) - 1, _INSIDE, _AROUND, _INSIDE).sum(axis=(1, 3)).ravel()

    total = gathered(light)
    weight = np.maximum(total, 1e-30)
    place = np.stack([gathered(light * there) / weight, gathered(light * (lon + east)) / weight], axis=-1)
    shining = np.flatnonzero(total > 1e-3 * total.max(initial=0.0))
    return place[shining], total[shining]


def domes_beyond(scene: Scene, sky: Field, heavens: Heavens) -> Around | None:
    """Of towns beyond a scene's domain, above an eye below its night sky; None where there is nothing beyond, and from
    where they are not seen."""
    grid, frame = scene.levels[-1].grid, sky.frame
    if grid is None or not grid.curved or heavens.height_m > HIGHEST_EYE_M:
        return None
    _, ny, nx = grid.shape

    def within(lat: F64, lon: F64) -> NDArray[np.bool_]:
        column, row = (np.nan_to_num(each, nan=-9.0) for each in grid.index(lon, lat))
        return np.asarray((column > -0.5) & (column < nx - 0.5) & (row > -0.5) & (row < ny - 0.5))

    sources = far_sources(frame, *heavens.place, within, scene.ground)
    domes = domes_of(
        Air.of(sky), frame, *heavens.place, heavens.height_m, sky.ground_m, heavens.wavelengths_nm, sources
    )
    night = heavens.lamps.night.mean(heavens.wavelengths_nm)
    return replace(domes, values=domes.values * (heavens.lamps.in_field / night))


def domes_of(
    air: Air, frame: Frame, lat: float, lon: float, height_m: float, ground_m: float, wavelengths_nm: F64,
    sources: tuple[F64, F64],
) -> Around:  # fmt: skip
    """What an eye sees of `far_sources`, whose ground is as high as the scene's: radiance, W m-2 sr-1 nm-1."""
    axes = frame.enu(lat, lon)
    way = directions_around(_ALTITUDE_DEG, _AZIMUTHS, axes)
    place, light = sources
    if not len(light):
        return Around(np.zeros((*way.shape[:2], len(wavelengths_nm))), _ALTITUDE_DEG, axes)
    centre = np.array([0.0, 0.0, frame.radius_m])
    eye = frame.position(lat, lon, height_m) + centre
    source = frame.position(place[:, 0], place[:, 1], ground_m) + centre
    up = source / np.linalg.norm(source, axis=1)[:, None]
    power = light[:, None] * lamp_spectrum(wavelengths_nm)
    rows = []
    for altitude, row in zip(_ALTITUDE_DEG, way, strict=True):
        end = min(_FARTHEST_M, _THIN_M / max(np.sin(np.radians(altitude)), 1e-9))
        edges = np.concatenate([[0.0], np.geomspace(0.01 * end, end, _SAMPLES)])
        middle, length = 0.5 * (edges[1:] + edges[:-1]), np.diff(edges)
        rows.append(_scattered(air, eye + middle[:, None, None] * row, row, source, up, power, length, eye))
    return Around(np.stack(rows), _ALTITUDE_DEG, axes)


def _scattered(
    air: Air, x: F64, way: F64, source: F64, up: F64, power: F64, length_m: F64, eye: F64
) -> F64:  # fmt: skip
    """Radiance (azimuth, nw) of light from sources (j, 3) scattered once at places (sample, azimuth, 3)."""
    height = np.linalg.norm(x, axis=-1) - air.radius_m
    v = x[:, :, None] - source
    away = np.maximum(np.linalg.norm(v, axis=-1), 500.0)
    rise = np.clip((v * up).sum(axis=-1) / away, -1, 1)
    sends = np.where(rise > 0, rise + _LOW * np.arccos(rise) ** 4, 0.0) / away**2
    cosine = -(v * way[:, None]).sum(axis=-1) / away  # of the angle by which light is turned toward the eye
    to_eye, to_source = _depth(air, eye, x - eye), _depth(air, source, v)
    out = np.zeros((x.shape[1], power.shape[1]))
    for w, g in enumerate(air.asymmetry):
        through = np.exp(-to_source[w] - to_eye[w][..., None])
        molecules, aerosol = (
            np.interp(height, air.height_m, each[:, w])[..., None] for each in (air.molecules, air.aerosol)
        )
        phase = molecules * 0.75 * (1 + cosine**2) + aerosol * (1 - g**2) / (1 + g**2 - 2 * g * cosine) ** 1.5
        arrives = (sends * through * phase) @ power[:, w] / (4 * np.pi)
        out[:, w] = length_m @ np.where(height > -500.0, arrives, 0.0)
    return out


def _depth(air: Air, start: F64, way: F64) -> F64:
    """Optical depth (nw, ...) of straight ways (..., 3) from a start."""
    length = np.linalg.norm(way, axis=-1)
    low, rise = air.lost[:-1].T, np.diff(air.lost, axis=0).T
    depth = np.zeros((low.shape[0], *length.shape))
    for at, share in zip((_POINTS[0] + 1) / 2, _POINTS[1] / 2, strict=True):
        height = np.linalg.norm(start + at * way, axis=-1) - air.radius_m
        level = fractional_index(air.height_m, np.maximum(height, 0.0))
        k = np.minimum(level.astype(int), low.shape[1] - 1)
        part = level - k
        for of, a, b in zip(depth, low, rise, strict=True):
            of += share * (a[k] + part * b[k])
    return np.asarray(depth * length)
