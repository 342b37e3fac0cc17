"""Pictures of known cameras: stars, suns and moons where they belong."""

import numpy as np
from PIL import Image

from openswim.cameras import Lens, Optics
from openswim.lights import moon_position, star_positions, sun_position
from openswim.scene.frame import horizon_vector

LAT, LON = 46.5, 8.0


def star_frame(path, optics, time, shape=(700, 720), lat=LAT, lon=LON, seed=0, peaks=None):
    """Stars to magnitude 5, each a spot of 1.2 pixels, on a dim noisy sky in 16 bits; or `peaks` anywhere."""
    random = np.random.default_rng(seed)
    counts = random.normal(2000.0, 12.0, shape)
    stars = star_positions(time, lat, lon, magnitude=5.0, above_deg=4)
    row, column = optics.project(horizon_vector(stars.azimuth_deg, stars.refracted_altitude_deg))
    light = 3000.0 * 10 ** (-0.4 * (stars.catalogue.magnitude - 2.5))
    if peaks is not None:
        row, column = (random.uniform(10, n - 10, peaks) for n in shape)
        light = light[:peaks]
    y, x = np.mgrid[-6:7, -6:7]
    for r, c, amount in zip(row, column, light, strict=True):
        if not (8 <= r < shape[0] - 8 and 8 <= c < shape[1] - 8):
            continue
        i, j = round(r), round(c)
        counts[i - 6 : i + 7, j - 6 : j + 7] += amount * np.exp(-((y - (r - i)) ** 2 + (x - (c - j)) ** 2) / 2 / 1.2**2)
    Image.fromarray(np.clip(counts, 0, 65535).astype(np.uint16)).save(path, compress_level=1)
    return path


def spot_frame(path, optics, time, body="sun", shape=(480, 500), lat=LAT, lon=LON, overcast=False):
    """The sun, or the moon, as a saturated disc with an aureole, on a blue sky; or a grey one."""
    where = (sun_position if body == "sun" else moon_position)(time, lat, lon)
    row, column = optics.project(horizon_vector(where.azimuth_deg, where.refracted_altitude_deg))
    away = np.hypot(*(a - b for a, b in zip(np.indices(shape), (row, column), strict=True)))
    glow = 0 * away if overcast else 700 * np.exp(-away / 12) + 150 * np.exp(-away / 60)
    sky = np.array([170, 172, 175.0]) if overcast else np.array([60, 80, 120.0])
    counts = sky + glow[..., None] + np.random.default_rng(1).normal(0, 2, (*shape, 3))
    Image.fromarray(np.clip(counts, 0, 255).astype(np.uint8)).save(path, compress_level=1)
    return path


def mounted(lens, **options):
    settings = {"centre_row": 340.0, "centre_column": 371.0, "rotation_deg": 77.0, "tilt_deg": 2.0}
    settings |= {"tilt_azimuth_deg": 130.0}
    return Optics(lens, **(settings | options))


EQUISOLID = Lens("equisolid", 245.0)
