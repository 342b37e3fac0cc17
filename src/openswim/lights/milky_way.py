"""The Milky Way: light of stars that the eye cannot tell apart, and what dust scatters of it."""

from functools import cache
from importlib import resources

import numpy as np
from numpy.typing import ArrayLike, NDArray

from openswim.lights.units import S10_W_M2_SR_NM, sunlike

F64 = NDArray[np.float64]

DUST_SHARE = 0.25  # diffuse galactic light over starlight
_LEAST_S10, _RANGE = 10.0, 256.0  # what grey levels 0 and 255 mean: 10 and 2560
# ICRS to galactic axes (the Hipparcos catalogue, ESA 1997, vol. 1, Eq. 1.5.11)
TO_GALACTIC = np.array([
    [-0.0548755604, -0.8734370902, -0.4838350155],
    [0.4941094279, -0.4448296300, 0.7469822445],
    [-0.8676661490, -0.1980763734, 0.4559837762],
])  # fmt: skip


@cache
def _map() -> F64:
    """ln of S10 (360, 720): rows from the north galactic pole, columns from longitude 0."""
    from PIL import Image

    with resources.files("openswim.lights").joinpath("data/milky_way.png").open("rb") as stream:
        grey = np.asarray(Image.open(stream), float)
    return np.log(_LEAST_S10) + np.log(_RANGE) * grey / 255.0


def starlight_s10(longitude_deg: ArrayLike, latitude_deg: ArrayLike) -> F64:
    """Stars fainter than V = 6.5 at galactic places, S10 outside of the air; half a degree sharp, to 30 %.

    From sums of Gaia's stars (credit: ESA/Gaia/DPAC); see docs/night.md for how the map was made.
    """
    grid = _map()
    rows, columns = grid.shape
    row = np.clip((90.0 - np.asarray(latitude_deg, float)) * rows / 180.0 - 0.5, 0, rows - 1.0)
    column = np.asarray(longitude_deg, float) % 360.0 * columns / 360.0 - 0.5
    i, j = np.minimum(row.astype(int), rows - 2), np.floor(column).astype(int)
    u, v = row - i, column - j
    left, right = j % columns, (j + 1) % columns
    upper = grid[i, left] * (1 - v) + grid[i, right] * v
    lower = grid[i + 1, left] * (1 - v) + grid[i + 1, right] * v
    return np.asarray(np.exp(upper * (1 - u) + lower * u))


def starlight_radiance(direction: F64, wavelengths_nm: ArrayLike) -> F64:
    """W m-2 sr-1 nm-1 (n, nw) of faint stars and of the dust between them toward unit vectors (n, 3) in ICRS.

    About the sun's colour (B - V = .7).
    """
    x, y, z = (direction @ TO_GALACTIC.T).T
    s10 = starlight_s10(np.degrees(np.arctan2(y, x)), np.degrees(np.arcsin(np.clip(z, -1, 1))))
    return np.asarray((1 + DUST_SHARE) * s10[:, None] * S10_W_M2_SR_NM * sunlike(wavelengths_nm, 500.0))
