"""Stars and planets as a camera sees them: points of light, spread over the pixels around."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from openswim.cameras import Camera
from openswim.cameras.pixels import Pixels
from openswim.heavens.bent_rays import Refraction
from openswim.heavens.sun_disc import Through
from openswim.lights import PLANETS, planet_position, star_positions
from openswim.lights.units import V0_W_M2_NM
from openswim.scene.frame import horizon_vector
from openswim.scene.times import Time

F64 = NDArray[np.float64]

FAINTEST = 6.5  # magnitude, to which the catalogue goes
SPREAD_PIXELS = 0.65  # sigma of the image of a point
_REACH = 2  # pixels on each side
# B - V of the planets' discs (Mallama et al. 2017)
_COLOURS = {"mercury": 0.97, "venus": 0.82, "mars": 1.36, "jupiter": 0.83, "saturn": 1.04, "uranus": 0.56,
            "neptune": 0.41}  # fmt: skip
_USUAL_COLOUR = 0.6
_SECOND_RADIATION_NM_K = 1.438777e7


@dataclass(frozen=True, eq=False)
class Drawn:
    """Rows and columns (n,) of pixels, and solar-relative radiance (n, nw) that is added to each."""

    row: NDArray[np.integer]
    column: NDArray[np.integer]
    radiance: F64

    def part(self, top: int, bottom: int, left: int, right: int) -> Drawn:
        """What falls on some rows and columns, counted from their first."""
        here = (self.row >= top) & (self.row < bottom) & (self.column >= left) & (self.column < right)
        return Drawn(self.row[here] - top, self.column[here] - left, self.radiance[here])


@dataclass(frozen=True, eq=False)
class Points:
    """Points of light over a place: apparent altitude and azimuth, V magnitude outside of the air, B - V, each (n,)."""

    altitude_deg: F64
    azimuth_deg: F64
    magnitude: F64
    colour: F64

    def irradiance(self, wavelengths_nm: F64) -> F64:
        """W m-2 nm-1 (n, nw) outside of the air: black bodies as hot as B - V tells (Ballesteros 2012)."""
        tint = np.clip(np.where(np.isfinite(self.colour), self.colour, _USUAL_COLOUR), -0.4, 2.0)
        kelvin = 4600 * (1 / (0.92 * tint + 1.7) + 1 / (0.92 * tint + 0.62))

        def planck(wavelength: F64) -> F64:
            return np.asarray(wavelength**-5 / np.expm1(_SECOND_RADIATION_NM_K / (wavelength * kelvin[:, None])))

        colour = planck(np.asarray(wavelengths_nm, float)[None]) / planck(np.array([[550.0]]))
        return np.asarray(V0_W_M2_NM * 10 ** (-0.4 * self.magnitude)[:, None] * colour)


def points_over(
    time: Time, lat: float, lon: float, height_m: float, refraction: Refraction | None, horizon_deg: float = 0.0
) -> Points:
    """Stars and planets above an apparent horizon; without ``refraction`` where they stand."""
    stars = star_positions(time, lat, lon, height_m, FAINTEST, above_deg=horizon_deg - 2.0)
    planets = [planet_position(name, time, lat, lon, height_m) for name in PLANETS]
    seen = [p for p in planets if p.altitude_deg > horizon_deg - 2.0 and p.magnitude < FAINTEST]
    true = np.concatenate([stars.altitude_deg, [p.altitude_deg for p in seen]])
    altitude = true if refraction is None else refraction.apparent_altitude_deg(true)
    up = np.flatnonzero(altitude > horizon_deg)
    azimuth = np.concatenate([stars.azimuth_deg, [p.azimuth_deg for p in seen]])
    magnitude = np.concatenate([stars.catalogue.magnitude, [p.magnitude for p in seen]])
    colour = np.concatenate([stars.catalogue.colour, [_COLOURS[p.name] for p in seen]])
    return Points(altitude[up], azimuth[up], magnitude[up], colour[up])


def drawn_points(
    points: Points, camera: Camera, pixels: Pixels, wavelengths_nm: F64, toa: F64, through: Through
) -> Drawn:
    """The points on the pixels of a picture: all light of each falls on a few pixels about its place."""
    ny, nx = pixels.inside.shape
    row, column = (np.asarray(v, float) for v in camera.pixel_of(points.azimuth_deg, points.altitude_deg))
    with np.errstate(invalid="ignore"):
        near = np.flatnonzero((row > -1) & (row < ny) & (column > -1) & (column < nx))
    none = np.zeros(0, int)
    if near.size == 0:
        return Drawn(none, none, np.zeros((0, len(wavelengths_nm))))
    row, column = row[near], column[near]
    light, hidden = through(horizon_vector(points.azimuth_deg[near], points.altitude_deg[near]), 0.0)
    arrives = points.irradiance(wavelengths_nm)[near] * np.asarray(light, float) * ~hidden[:, None]
    steps = np.arange(-_REACH, _REACH + 1)
    j, i = (np.rint(v).astype(np.int64)[:, None] + steps for v in (row, column))
    shape = [np.exp(-0.5 * ((at - v[:, None]) / SPREAD_PIXELS) ** 2) for at, v in ((j, row), (i, column))]
    weight = shape[0][:, :, None] * shape[1][:, None, :]
    weight /= weight.sum(axis=(1, 2), keepdims=True)
    rows, columns = np.broadcast_arrays(j[:, :, None], i[:, None, :])
    which = np.broadcast_to(np.arange(len(near))[:, None, None], rows.shape)
    within = (rows >= 0) & (rows < ny) & (columns >= 0) & (columns < nx)
    rows, columns, which, weight = rows[within], columns[within], which[within], weight[within]
    within = pixels.inside[rows, columns]
    rows, columns, which, weight = rows[within], columns[within], which[within], weight[within]
    per_sr = weight / pixels.solid_angle_sr[rows, columns]
    return gathered(rows * nx + columns, nx, 4 * np.pi * arrives[which] * per_sr[:, None] / toa)


def gathered(number: NDArray[np.integer], nx: int, radiance: F64) -> Drawn:
    """Radiance (n, nw) that falls on numbered pixels, each named once."""
    pixel, place = np.unique(number, return_inverse=True)
    total = np.stack([np.bincount(place, each, len(pixel)) for each in radiance.T], axis=-1)
    return Drawn(pixel // nx, pixel % nx, np.asarray(total, float))
