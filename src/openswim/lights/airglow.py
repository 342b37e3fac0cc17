"""Airglow: what the air itself shines at night, 90 km and more above the ground."""

import numpy as np
from numpy.typing import ArrayLike, NDArray

from openswim.lights.units import radiance_of_rayleighs
from openswim.scene.grid import EARTH_RADIUS_M
from openswim.scene.times import Time, parse_time

F64 = NDArray[np.float64]

LAYER_M, THICKNESS_M = 90e3, 10e3
RED_LAYER_M, RED_THICKNESS_M = 250e3, 80e3  # of the oxygen's red lines
MEAN_FLUX_SFU = 130.0  # solar radio flux for which the strengths hold
BAND_NM = 70.0  # half width of what one wavelength of a picture stands for: bands reach those beside them

# Paranal, zenith, outside of the air: continuum with the unresolved OH bands, W m-2 sr-1 nm-1 (numbers read from the
# spectrum of ESO's sky model, Noll et al. 2012; it has V 22.0, B 23.1 and R 21.1 magnitudes per square second of arc)
_CONTINUUM_NM = np.array([350.0, 445.0, 505.0, 520.0, 605.0, 615.0, 680.0, 730.0, 780.0, 1000.0])
_CONTINUUM = 1e-9 * np.array([1.5, 1.46, 1.24, 1.39, 1.72, 1.72, 3.0, 4.5, 6.0, 15.0])
_LINES_R = {557.7: 216.0, 589.3: 54.0, 630.0: 165.0, 636.4: 50.0}  # rayleighs
_RED_NM = (630.0, 636.4)
# years of the solar minima, and the typical flux at the maximum after each
_MINIMA = np.array([1901.7, 1913.6, 1923.6, 1933.8, 1944.2, 1954.3, 1964.8, 1976.2, 1986.7, 1996.6, 2008.9, 2019.9,
                    2031.0, 2042.0, 2053.0, 2064.0])  # fmt: skip
_LEAST_SFU, _MOST_SFU, _RISE = 70.0, 180.0, 0.4


def airglow_zenith(wavelengths_nm: ArrayLike, flux_sfu: float = MEAN_FLUX_SFU) -> tuple[F64, F64]:
    """W m-2 sr-1 nm-1 (nw,) of the layers at 90 km and at 250 km seen straight through, lines spread over `BAND_NM`.

    flux_sfu: the sun's radio flux at 10.7 cm, 70 at a minimum to 220; the factor is that of Noll et al. 2012.
    """
    wavelengths = np.asarray(wavelengths_nm, float)
    low, high = np.interp(wavelengths, _CONTINUUM_NM, _CONTINUUM), np.zeros(wavelengths.shape)
    for line, strength in _LINES_R.items():
        share = np.maximum(1 - np.abs(wavelengths - line) / BAND_NM, 0) / BAND_NM
        layer = high if line in _RED_NM else low
        layer += share * radiance_of_rayleighs(strength, line)
    factor = 0.2 + 0.00614 * flux_sfu
    return low * factor, high * factor


def airglow_radiance(position: F64, direction: F64, wavelengths_nm: ArrayLike, flux_sfu: float = MEAN_FLUX_SFU) -> F64:
    """W m-2 sr-1 nm-1 (n, nw) along rays, without extinction. position (3,) or (n, 3): metres from the Earth's centre.

    Below the layers this is van Rhijn's factor; from above, the bright limb.
    """
    low, high = airglow_zenith(wavelengths_nm, flux_sfu)
    of_low = _times_thickness(position, direction, LAYER_M, THICKNESS_M)
    of_high = _times_thickness(position, direction, RED_LAYER_M, RED_THICKNESS_M)
    return np.asarray(of_low[:, None] * low + of_high[:, None] * high)


def _times_thickness(position: F64, direction: F64, layer_m: float, thickness_m: float) -> F64:
    """The way of rays through a shell, until they end on the ground, over its thickness."""
    p = np.broadcast_to(position, direction.shape)
    along = (p * direction).sum(-1)
    nearest2 = (p * p).sum(-1) - along**2

    def inside(height_m: float) -> tuple[F64, F64]:
        half2 = (EARTH_RADIUS_M + height_m) ** 2 - nearest2
        half = np.sqrt(np.maximum(half2, 0))
        return np.maximum(-along - half, 0), np.maximum(-along + half, 0)

    first, last = inside(layer_m + thickness_m / 2)
    enters, leaves = inside(layer_m - thickness_m / 2)
    ground_first, ground_last = inside(0.0)
    # from a place below sea level, or on the ground, the way up is free
    hits = (ground_first > 0) & (ground_last > ground_first)
    before = np.maximum(np.minimum(enters, last) - first, 0)
    after = np.where(hits, 0.0, np.maximum(last - leaves, 0))
    missed = leaves <= enters
    return np.asarray(np.where(missed, last - first, before + after) / thickness_m)


def solar_flux_sfu(time: Time) -> float:
    """The sun's radio flux at 10.7 cm at a time by a typical cycle, 70 to 180; measured ones differ by 40 %."""
    stamp = parse_time(time)
    year = 2000.0 if stamp is None else 1970.0 + stamp.astype("datetime64[s]").astype(float) / (365.2425 * 86400)
    n = int(np.clip(np.searchsorted(_MINIMA, year, "right") - 1, 0, len(_MINIMA) - 2))
    phase = float(np.clip((year - _MINIMA[n]) / (_MINIMA[n + 1] - _MINIMA[n]), 0, 1))
    turned = 0.5 * phase / _RISE if phase < _RISE else 0.5 + 0.5 * (phase - _RISE) / (1 - _RISE)
    return float(_LEAST_SFU + (_MOST_SFU - _LEAST_SFU) * np.sin(np.pi * turned) ** 2)
