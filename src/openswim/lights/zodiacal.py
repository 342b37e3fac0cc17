"""Zodiacal light: sunlight from the dust between the planets."""

import numpy as np
from numpy.typing import ArrayLike, NDArray

from openswim.lights.units import S10_W_M2_SR_NM, sunlike

F64 = NDArray[np.float64]

# Leinert et al. 1998 (A&AS 127, 1), Table 17: 1e-8 W m-2 sr-1 um-1 at 500 nm, outside of the air; rows: ecliptic
# longitude from the sun's; columns: latitude. Nearer to the sun than 15 degrees nothing is given.
_LONGITUDE_DEG = np.array([0, 5, 10, 15, 20, 25, 30, 35, 40, 45, 60, 75, 90, 105, 120, 135, 150, 165, 180], float)
_LATITUDE_DEG = np.array([0, 5, 10, 15, 20, 25, 30, 45, 60, 75, 90], float)
_NONE = 0.0
_TABLE = np.array([
    [_NONE, _NONE, _NONE, 3140, 1610, 985, 640, 275, 150, 100, 77],
    [_NONE, _NONE, _NONE, 2940, 1540, 945, 625, 271, 150, 100, 77],
    [_NONE, _NONE, 4740, 2470, 1370, 865, 590, 264, 148, 100, 77],
    [11500, 6780, 3440, 1860, 1110, 755, 525, 251, 146, 100, 77],
    [6400, 4480, 2410, 1410, 910, 635, 454, 237, 141, 99, 77],
    [3840, 2830, 1730, 1100, 749, 545, 410, 223, 136, 97, 77],
    [2480, 1870, 1220, 845, 615, 467, 365, 207, 131, 95, 77],
    [1650, 1270, 910, 680, 510, 397, 320, 193, 125, 93, 77],
    [1180, 940, 700, 530, 416, 338, 282, 179, 120, 92, 77],
    [910, 730, 555, 442, 356, 292, 250, 166, 116, 90, 77],
    [505, 442, 352, 292, 243, 209, 183, 134, 104, 86, 77],
    [338, 317, 269, 227, 196, 172, 151, 116, 93, 82, 77],
    [259, 251, 225, 193, 166, 147, 132, 104, 86, 79, 77],
    [212, 210, 197, 170, 150, 133, 119, 96, 82, 77, 77],
    [188, 186, 177, 154, 138, 125, 113, 90, 77, 74, 77],
    [179, 178, 166, 147, 134, 122, 110, 90, 77, 73, 77],
    [179, 178, 165, 148, 137, 127, 116, 96, 79, 72, 77],
    [196, 192, 179, 165, 151, 141, 131, 104, 82, 72, 77],
    [230, 212, 195, 178, 163, 148, 134, 105, 83, 72, 77],
])  # fmt: skip
_NEAR_SUN = -2.3  # power of the elongation with which it grows inward of the table
_S10_OF_TABLE = 1e-11 / S10_W_M2_SR_NM


def zodiacal_s10(longitude_deg: ArrayLike, latitude_deg: ArrayLike) -> F64:
    """Brightness in S10 (tenth-magnitude stars of the sun's colour per square degree) outside of the air.

    longitude_deg: ecliptic, from the sun's; latitude_deg: ecliptic. To 10 %, symmetric in both.
    """
    lon = np.abs((np.asarray(longitude_deg, float) + 180) % 360 - 180)
    lat = np.abs(np.asarray(latitude_deg, float))
    i, j = (np.clip(np.searchsorted(nodes, x, "right") - 1, 0, len(nodes) - 2)
            for nodes, x in ((_LONGITUDE_DEG, lon), (_LATITUDE_DEG, lat)))  # fmt: skip
    u = (lon - _LONGITUDE_DEG[i]) / (_LONGITUDE_DEG[i + 1] - _LONGITUDE_DEG[i])
    v = (lat - _LATITUDE_DEG[j]) / (_LATITUDE_DEG[j + 1] - _LATITUDE_DEG[j])
    log = _LOG_TABLE
    found = (1 - u) * ((1 - v) * log[i, j] + v * log[i, j + 1]) + u * ((1 - v) * log[i + 1, j] + v * log[i + 1, j + 1])
    return np.asarray(np.exp(found) * _S10_OF_TABLE)


def zodiacal_radiance(longitude_deg: ArrayLike, latitude_deg: ArrayLike, wavelengths_nm: ArrayLike) -> F64:
    """W m-2 sr-1 nm-1 (n, nw): the sun's colour, reddened the more the nearer to the sun (Leinert's Eq. 22)."""
    s10 = zodiacal_s10(longitude_deg, latitude_deg)
    lon, lat = (np.radians(np.asarray(x, float)) for x in (longitude_deg, latitude_deg))
    elongation = np.degrees(np.arccos(np.clip(np.cos(lon) * np.cos(lat), -1, 1)))
    far = np.clip((elongation - 30) / 60, 0, 1)[..., None]
    tenfold = np.log10(np.asarray(wavelengths_nm, float) / 500.0)
    slope = np.where(tenfold < 0, 1.2 - 0.3 * far, 0.8 - 0.2 * far)
    return np.asarray(s10[..., None] * S10_W_M2_SR_NM * sunlike(wavelengths_nm, 500.0) * (1 + slope * tenfold))


def _whole_table() -> F64:
    lon, lat = np.radians(_LONGITUDE_DEG)[:, None], np.radians(_LATITUDE_DEG)
    elongation = np.degrees(np.arccos(np.clip(np.cos(lon) * np.cos(lat), -1, 1)))
    inward = _TABLE[3, 0] * (np.maximum(elongation, 2.5) / elongation[3, 0]) ** _NEAR_SUN
    return np.asarray(np.log(np.where(_TABLE > 0, _TABLE, inward)))


_LOG_TABLE = _whole_table()
