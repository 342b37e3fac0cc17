"""Broadband irradiance from a few visible wavelengths.

The visible tells what scatters; what it cannot tell, the absorption in the near infrared, comes from the gas
transmittances of Bird and Riordan (1984).  This replaces the proportionality to 546 nm of Albers et al. 2020,
Sect. 3.1 (corrected: broadband over 546-nm transmittance is .87-.89 at 1.5 cm of water vapour).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from openswim.fluxes.gases import airmass, gas_transmittance, liquid_transmittance, ozone_optical_depth
from openswim.lights.spectrum import solar_bins
from openswim.optics.gas_bands import band_transmittance

if TYPE_CHECKING:
    from openswim.scene.atmosphere import Atmosphere

SEA_LEVEL_PA = 101_325.0
SEA_LEVEL_WATER_CM = 1.42  # of the US standard
LONGEST_NODE_NM = 700.0
AEROSOL_ANGSTROM = 1.3  # where a single wavelength cannot tell
AEROSOL_ALBEDO = 0.93
AEROSOL_FORWARD = 0.75  # share of its scattered light that aerosol sends down, Rayleigh air sending 1/2
SURPLUS_OF_CLOUD = 0.4  # diffuse light beyond the clear sky's, relative to it, that is half cloud light
THICKEST_AEROSOL = 1.5  # vertical optical depth at which the sun is as likely behind a cloud


@dataclass(frozen=True)
class Broadband:
    """Irradiance in W m-2, 280-4000 nm."""

    global_horizontal: float
    direct_normal: float
    direct_horizontal: float
    diffuse_horizontal: float


@dataclass(frozen=True)
class _Sky:
    """What the extrapolation needs to know of the beam."""

    sine: float  # of the sun's altitude, floored where the beam grazes
    airmass: float
    pressure_ratio: float
    ozone_cm: float

    def rayleigh(self, wavelength_nm: np.ndarray) -> np.ndarray:
        """Slant optical depth of the air: Hansen and Travis (1974)."""
        inverse = (1000.0 / wavelength_nm) ** 2
        vertical = 0.008569 * inverse**2 * (1 + 0.0113 * inverse + 0.00013 * inverse**2)
        return vertical * self.pressure_ratio * self.airmass

    def ozone(self, wavelength_nm: np.ndarray) -> np.ndarray:
        """Slant optical depth of ozone."""
        return ozone_optical_depth(wavelength_nm, self.ozone_cm) * self.airmass


def gases_above(
    atmosphere: Atmosphere | None, height_m: float, water_vapour_cm: float | None = None
) -> dict[str, float]:
    """What `broadband` asks of the gases above a height (m above sea level): pressure, ozone and precipitable water.

    water_vapour_cm: the precipitable water above that height; None: that of the atmosphere's profile. None of each
    without an atmosphere.
    """
    if atmosphere is None:
        return {"water_vapour_cm": 0.0, "ozone_du": 0.0, "pressure_pa": 0.0}
    return {
        "water_vapour_cm": atmosphere.precipitable_water_cm(height_m) if water_vapour_cm is None else water_vapour_cm,
        "ozone_du": atmosphere.ozone_column_du(height_m),
        "pressure_pa": float(atmosphere.at(height_m)[0]),
    }


def broadband(
    direct_transmittance: np.ndarray,
    relative_diffuse: np.ndarray,
    wavelengths_nm: np.ndarray,
    sun_altitude_deg: float,
    distance_au: float = 1.0,
    water_vapour_cm: float = SEA_LEVEL_WATER_CM,
    ozone_du: float = 300.0,
    pressure_pa: float = SEA_LEVEL_PA,
    visible: float | None = None,
) -> Broadband:
    """Broadband irradiance from the beam's transmittance and the diffuse horizontal light over E_TOA, (nwl,).

    Both include ozone and bands of gases, as the model's clear sky does.  `visible` is the share of the sun's disc in
    sight, toward which the transmittance is (all of it by default, above the horizon).  `water_vapour_cm` is the
    precipitable water, `pressure_pa` that of the air at the plane (`gases_above` tells them).  Global irradiance agrees
    with the spectral model whose gas absorption is used to +.3 to +2.5 % for sun altitudes above 15 degrees (that model
    is the highest of four clear-sky models, 0-5 % above their mean for optical depths up to .1); one wavelength instead
    of three adds 1 %.  Under clouds about 5 %: their absorption in the near infrared is a climatological one, which
    lifts the visible share of the light by 8 % under overcast.  Wavelengths beyond 700 nm, which meet stronger bands of
    gases, are left out; where there are no others nothing is known (NaN).
    """
    order = np.argsort(wavelengths_nm)
    order = order[np.asarray(wavelengths_nm, dtype=float)[order] <= LONGEST_NODE_NM]
    if order.size == 0:
        return Broadband(np.nan, np.nan, np.nan, np.nan)
    nodes = np.asarray(wavelengths_nm, dtype=float)[order]
    sine = float(np.sin(np.radians(sun_altitude_deg)))
    sky = _Sky(max(sine, 0.02), airmass(sun_altitude_deg), pressure_pa / SEA_LEVEL_PA, ozone_du / 1000)

    edges, top = solar_bins()
    wavelength = (edges[1:] + edges[:-1]) / 2
    energy = top * np.diff(edges) / distance_au**2
    gases = gas_transmittance(wavelength, sky.airmass, sky.pressure_ratio, water_vapour_cm, sky.ozone_cm)

    depth = -np.log(np.clip(np.asarray(direct_transmittance, dtype=float)[order], 1e-60, None))
    gas = sky.ozone(nodes) - np.log(band_transmittance(nodes, sky.airmass, water_vapour_cm, pressure_pa))
    excess = depth - sky.rayleigh(nodes) - gas
    beam = np.exp(-sky.rayleigh(wavelength) - _excess_beyond(wavelength, nodes, excess))
    normal = float(energy @ (beam * gases)) * float(sine > 0 if visible is None else visible)

    scattered = np.asarray(relative_diffuse, dtype=float)[order] * np.exp(gas)
    clear, cloud = _diffuse(wavelength, nodes, scattered, excess, sky)
    diffuse = float(energy @ ((clear + cloud * liquid_transmittance(wavelength)) * gases))
    horizontal = normal * max(sine, 0.0)
    return Broadband(horizontal + diffuse, normal, horizontal, diffuse)


def _excess_beyond(wavelength_nm: np.ndarray, nodes_nm: np.ndarray, excess: np.ndarray) -> np.ndarray:
    """Slant optical depth of aerosol and cloud: exact at the nodes, a power law beyond them."""
    inside = np.interp(np.log(wavelength_nm), np.log(nodes_nm), excess)
    outer = np.clip(wavelength_nm, nodes_nm[0], nodes_nm[-1])
    return np.maximum(inside, 0) * (wavelength_nm / outer) ** -_angstrom(nodes_nm, excess)


def _angstrom(nodes_nm: np.ndarray, excess: np.ndarray) -> float:
    """Angstrom exponent of the excess, within 0..2.2; clouds are grey."""
    first, last = max(float(excess[0]), 1e-4), max(float(excess[-1]), 1e-4)
    if len(nodes_nm) == 1:
        return AEROSOL_ANGSTROM if first < THICKEST_AEROSOL else 0.0
    return float(np.clip(np.log(first / last) / np.log(nodes_nm[-1] / nodes_nm[0]), 0.0, 2.2))


def _diffuse(
    wavelength_nm: np.ndarray, nodes_nm: np.ndarray, scattered: np.ndarray, excess: np.ndarray, sky: _Sky
) -> tuple[np.ndarray, np.ndarray]:
    """Diffuse light over E_TOA before gas absorption, in two parts: of the clear sky, and of clouds.

    The clear part follows Bird and Riordan (1984), scaled to the nodes; of what they have far beyond it the
    most is cloud light, grey outside the nodes.
    """
    expected = _clear_diffuse(wavelength_nm, nodes_nm, excess, sky)
    at_nodes = np.maximum(_clear_diffuse(nodes_nm, nodes_nm, excess, sky), 1e-12)
    surplus = np.maximum(scattered / at_nodes - 1.0, 0.0)
    grey = surplus**2 / (surplus**2 + SURPLUS_OF_CLOUD**2)
    cloud = grey * surplus * at_nodes
    log, log_nodes = np.log(wavelength_nm), np.log(nodes_nm)
    scale = np.interp(log, log_nodes, (scattered - cloud) / at_nodes)
    return expected * scale, np.interp(log, log_nodes, cloud)


def _clear_diffuse(
    wavelength_nm: np.ndarray, nodes_nm: np.ndarray, excess: np.ndarray, sky: _Sky
) -> np.ndarray:
    """Diffuse horizontal light over E_TOA of air and aerosol, without gases: Bird and Riordan."""
    air = sky.rayleigh(wavelength_nm)
    vertical = max(float(excess.mean()), 0.0) / sky.airmass
    aerosol_share = 1 / (1 + (vertical / THICKEST_AEROSOL) ** 4)  # of what dims the sun; the rest is cloud
    haze = _excess_beyond(wavelength_nm, nodes_nm, excess) * aerosol_share
    absorbed = np.exp(-(1 - AEROSOL_ALBEDO) * haze)
    from_air = 0.5 * (1 - np.exp(-0.95 * air))
    from_haze = AEROSOL_FORWARD * np.exp(-1.5 * air) * (1 - np.exp(-AEROSOL_ALBEDO * haze))
    return sky.sine * absorbed * (from_air + from_haze)
