"""The moon's disc as a camera sees it: its lit part with the maria, turned as it stands, and its dark part."""

from __future__ import annotations

from functools import cache
from importlib import resources

import numpy as np
from numpy.typing import NDArray

from openswim.cameras import Camera
from openswim.cameras.pixels import Pixels
from openswim.ground.fields import bilinear
from openswim.heavens.bent_rays import Refraction
from openswim.heavens.points import Drawn, gathered
from openswim.heavens.sun_disc import Disc, Through, across, nearest, pixels_of
from openswim.lights import moon_irradiance
from openswim.lights.eclipses.lunar import shadow, shadow_light
from openswim.lights.moon import Moon
from openswim.lights.moonlight import MEAN_DISTANCE_KM, MEAN_SOLID_ANGLE_SR, disc_reflectance, earthshine
from openswim.lights.spectrum import solar_irradiance
from openswim.scene.frame import horizon_vector
from openswim.scene.times import Time
from openswim.srgb import from_srgb

F64 = NDArray[np.float64]

_PALER = 0.65  # power of the map's grey, which has more contrast than the moon
_FEWEST, _MOST, _PER_PIXEL, _RAYS = 4096, 800_000, 48, 160
_EVEN, _WITHIN = 20_000, 2  # places by which the disc is summed; across a small pixel
_AT_ONCE = 200_000  # small pixels
_FULL_DEG = 7.0  # phase angle at which the Earth's light comes back to it, but for the surge
_GOLDEN = (5**0.5 - 1) / 2


@cache
def _albedo_map() -> F64:
    """Relative albedo (360, 722), rows from the north pole, columns from longitude -180, one more on both sides."""
    from PIL import Image

    with resources.files("openswim.lights").joinpath("data/moon.jpg").open("rb") as stream:
        grey = np.asarray(Image.open(stream).convert("L"), float) / 255
    return np.pad(np.maximum(from_srgb(grey), 1e-3) ** _PALER, ((0, 0), (1, 1)), "wrap")


def albedo(lon_deg: F64, lat_deg: F64) -> F64:
    """Relative albedo at selenographic places, bilinear between the middles of half degrees."""
    return bilinear(_albedo_map(), 0.5 + 2 * ((lon_deg + 180) % 360), 2 * (90 - lat_deg) - 0.5)


def even_places(count: int) -> F64:
    """Places (n, 2) on a disc in its radii, right and up, each for as much of its area."""
    n = np.arange(count)
    radius, turn = np.sqrt((n + 0.5) / count), 2 * np.pi * _GOLDEN * n
    return np.stack([radius * np.cos(turn), radius * np.sin(turn)], axis=-1)


def on_the_moon(moon: Moon, place: F64) -> F64:
    """Unit vectors (n, 3) in the moon's axes of places (n, 2) on its disc, right and up (the zenith)."""
    lon, lat = np.radians(moon.sub_observer_lonlat_deg)
    toward = np.array([np.cos(lat) * np.cos(lon), np.cos(lat) * np.sin(lon), np.sin(lat)])
    east = np.array([-np.sin(lon), np.cos(lon), 0.0])
    north = np.cross(toward, east)
    turn = np.radians(moon.axis_from_zenith_deg)
    x = place[:, 0] * np.cos(turn) + place[:, 1] * np.sin(turn)
    y = -place[:, 0] * np.sin(turn) + place[:, 1] * np.cos(turn)
    z = np.sqrt(np.maximum(1 - x**2 - y**2, 0))
    return np.asarray(x[:, None] * east + y[:, None] * north + z[:, None] * toward)


def disc_light(
    moon: Moon, place: F64, wavelengths_nm: F64, time: Time | None = None, even: F64 | None = None
) -> F64:  # fmt: skip
    """Irradiance (n, nw), W m-2 nm-1 outside of the air, of each of even places (n, 2) on the moon's disc.

    even : these are even, and a place has the light of such a one where it is."""
    grey, lit = _shades(moon, place)
    all_grey, all_lit = (each.sum() for each in (_shades(moon, even) if even is not None else (grey, lit)))
    of_sun = moon_irradiance(moon, wavelengths_nm)
    light = lit[:, None] / max(all_lit, 1e-12) * of_sun
    if time is not None:
        light = light * _in_shadow(moon, place, wavelengths_nm, time)
    solid_angle = MEAN_SOLID_ANGLE_SR * (MEAN_DISTANCE_KM / moon.distance_km) ** 2
    back = disc_reflectance(wavelengths_nm, _FULL_DEG) * solid_angle / np.pi * solar_irradiance(wavelengths_nm)
    ash = earthshine(moon.phase_angle_deg, moon.distance_km) / moon.sun_distance_au**2
    return np.asarray(light + (grey / all_grey)[:, None] * (ash * back))


def _shades(moon: Moon, place: F64) -> tuple[F64, F64]:
    """Of places on the disc the relative albedo, and how bright the sun makes them, each (n,)."""
    point = on_the_moon(moon, place)
    lon, lat = np.radians(moon.subsolar_lonlat_deg)
    sun = np.array([np.cos(lat) * np.cos(lon), np.cos(lat) * np.sin(lon), np.sin(lat)])
    grey = albedo(np.degrees(np.arctan2(point[:, 1], point[:, 0])), np.degrees(np.arcsin(np.clip(point[:, 2], -1, 1))))
    upright = np.sqrt(np.maximum(1 - (place**2).sum(axis=1), 0))
    sunlit = np.maximum(point @ sun, 0)
    # Lommel and Seeliger: the full moon is flat
    return grey, grey * sunlit / np.maximum(sunlit + upright, 1e-6)


def _in_shadow(moon: Moon, place: F64, wavelengths_nm: F64, time: Time) -> F64:
    """Share of sunlight that the Earth's shadow leaves at the places."""
    at = shadow(time)
    if at.separation_deg[0] >= at.penumbra_deg[0] + at.moon_deg[0]:
        return np.ones((len(place), len(wavelengths_nm)))
    # the shadow lies on the other side from the sun; up is 0, counter-clockwise
    away = np.radians(moon.bright_limb_from_zenith_deg + 180.0)
    axis = at.separation_deg[0] * np.array([-np.sin(away), np.cos(away)])
    return shadow_light(at, np.linalg.norm(at.moon_deg[0] * place - axis, axis=-1), wavelengths_nm)


def drawn_moon(
    moon: Moon, time: Time, camera: Camera, pixels: Pixels, wavelengths_nm: F64, toa: F64, through: Through,
    refraction: Refraction | None,
) -> Drawn:  # fmt: skip
    """The moon on the pixels of a picture, lifted and flattened by refraction."""
    nx = pixels.inside.shape[1]
    radius = moon.angular_radius_deg

    def seen(place: F64) -> tuple[F64, F64]:
        """Azimuth and apparent altitude."""
        disc = Disc(moon.azimuth_deg, moon.altitude_deg, radius, wavelengths_nm)
        at = Pixels(disc.directions(place), np.empty(len(place)))
        true = at.altitude_deg
        return at.azimuth_deg, true if refraction is None else refraction.apparent_altitude_deg(true)

    def fallen(place: F64) -> tuple[NDArray[np.int64], NDArray[np.bool_]]:
        row, column = pixels_of(camera, pixels, horizon_vector(*seen(place)))
        return row * nx + column, row >= 0

    area = np.pi * np.radians(radius) ** 2
    rays = even_places(_RAYS)

    def open_to(width: float) -> F64:
        light, hidden = through(horizon_vector(*seen(rays)), width)
        return np.asarray(light, float) * ~hidden[:, None]

    if camera.optics is not None and area > _MOST / _PER_PIXEL * np.nanmedian(pixels.solid_angle_sr):
        open_here = open_to(float(np.sqrt(np.nanmedian(pixels.solid_angle_sr))))
        even, per_place = even_places(_EVEN), _EVEN * 4 * np.pi / area / _WITHIN**2
        parts = []
        inside = np.flatnonzero(pixels.inside)
        for some in np.array_split(inside, 1 + inside.size // _AT_ONCE):
            number, place = _under_pixels(moon, camera, some, nx, refraction)
            light = disc_light(moon, place, wavelengths_nm, time, even) * open_here[nearest(rays, place)]
            parts.append(gathered(number, nx, light * per_place / toa))
        return Drawn(*(np.concatenate([getattr(part, of) for part in parts]) for of in ("row", "column", "radiance")))
    rough, within = fallen(even_places(_FEWEST))
    none = np.zeros(0, np.int64)
    if not within.any():
        return Drawn(none, none, np.zeros((0, len(wavelengths_nm))))
    smallest = float(np.nanmin(pixels.solid_angle_sr.ravel()[rough[within]]))
    place = even_places(int(np.clip(_PER_PIXEL * area / smallest, _FEWEST, _MOST)))
    number, within = fallen(place)
    arrives = disc_light(moon, place, wavelengths_nm, time)[within]
    arrives = arrives * open_to(float(np.sqrt(smallest)))[nearest(rays, place[within])]
    per_sr = 4 * np.pi / pixels.solid_angle_sr.ravel()[number[within]]
    return gathered(number[within], nx, arrives * per_sr[:, None] / toa)


def _under_pixels(
    moon: Moon, camera: Camera, number: NDArray[np.int64], nx: int, refraction: Refraction | None
) -> tuple[NDArray[np.int64], F64]:
    """Of numbered small pixels some places (n, 2) in each that see the moon's disc, and of which pixel each is."""
    found = []
    for down, over in np.ndindex(_WITHIN, _WITHIN):
        aside = (np.array([down, over]) - 0.5 * (_WITHIN - 1)) / _WITHIN
        azimuth, altitude = camera.direction_of(number // nx + aside[0], number % nx + aside[1])
        away = horizon_vector(azimuth, altitude if refraction is None else refraction.true_altitude_deg(altitude))
        place = away @ across(moon.azimuth_deg, moon.altitude_deg) / np.radians(moon.angular_radius_deg)
        on = (np.hypot(*place.T) < 1) & (away @ horizon_vector(moon.azimuth_deg, moon.altitude_deg) > 0)
        found.append((number[on], place[on]))
    numbers, places = (np.concatenate(each) for each in zip(*found, strict=True))
    return numbers, places
