"""Light on a horizontal plane: global, direct and diffuse, spectral and broadband."""

from openswim.fluxes.broadband import Broadband, broadband, gases_above
from openswim.fluxes.horizontal import Quadrature, quadrature_directions, spectral_irradiance
from openswim.fluxes.vapour import scene_vapour_cm, vapour_by_humidity_cm

__all__ = [
    "Broadband",
    "Quadrature",
    "broadband",
    "gases_above",
    "quadrature_directions",
    "scene_vapour_cm",
    "spectral_irradiance",
    "vapour_by_humidity_cm",
]
