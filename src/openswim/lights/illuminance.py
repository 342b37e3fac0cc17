"""How much light sun, moon and the night's sky send to level ground under a clear sky, roughly: what to solve."""

import numpy as np

from openswim.lights.moon import Moon
from openswim.scene.interpolation import smooth_step

# log10 of lux by powers of altitude/90 (Seidelmann, Explanatory Supplement to the Astronomical Almanac, natural
# illumination), from each altitude (degrees) up
_SUN = (
    (20.0, (3.74, 3.97, -4.07, 1.47)), (5.0, (3.05, 13.28, -45.98, 64.33)), (-0.8, (2.88, 22.26, -207.64, 1034.30)),
    (-5.0, (2.88, 21.81, -258.11, -858.36)), (-12.0, (2.70, 12.17, -431.69, -1899.83)),
    (-18.0, (13.84, 262.72, 1447.42, 2797.93)),
)  # fmt: skip
_MOON = (
    (20.0, (-1.95, 4.06, -4.24, 1.56)), (5.0, (-2.58, 12.58, -42.58, 59.06)), (-0.8, (-2.79, 24.27, -252.95, 1321.29)),
)  # fmt: skip
_FADES_DEG = 1.2  # below the last altitude of a table: tenfold darker in so many degrees
NIGHT_SKY_LX = 8e-4  # of stars, airglow and zodiacal light together
LEAST, FULL = 0.003, 0.01  # shares of all light between which one is faded out


def _lux(altitude_deg: float, table: tuple[tuple[float, tuple[float, ...]], ...]) -> float:
    lowest = table[-1][0]
    held = max(altitude_deg, lowest)
    coefficients = next(c for start, c in table if held >= start)
    x = held / 90.0
    log = sum(c * x**n for n, c in enumerate(coefficients))
    return float(10 ** (log - max(lowest - altitude_deg, 0.0) / _FADES_DEG))


def sun_lux(altitude_deg: float) -> float:
    """Of the sun at a refracted altitude; from -18 degrees on, where the table's is the night sky's, falling on."""
    return _lux(altitude_deg, _SUN)


def moon_lux(moon: Moon) -> float:
    """Of the moon at its phase and distance."""
    f = moon.phase_angle_deg
    faint = 10 ** (-8.68e-3 * f - 2.2e-9 * f**4)
    near = (np.degrees(6378.14 / moon.distance_km) / 0.951) ** 2
    return float(_lux(moon.altitude_deg, _MOON) * faint * near)


def shares(lux: dict[str, float]) -> dict[str, float]:
    """Of each light, by name, how much of it is solved for: 1 where it is a hundredth of all, 0 at a third of that,
    smooth between, so that no light is switched."""
    total = sum(lux.values())
    found = {}
    for name, own in lux.items():
        part = np.log(max(own / total, 1e-30) / LEAST) / np.log(FULL / LEAST)
        found[name] = float(smooth_step(part))
    return found
