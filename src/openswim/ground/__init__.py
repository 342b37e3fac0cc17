"""The ground: what it is made of, and how it reflects sun and sky."""

from openswim.ground.albedo import surface_properties
from openswim.ground.maps import Ground
from openswim.ground.reflectance import (
    bidirectional_reflectance,
    diffuse_reflectance,
    hemispherical_albedo,
    reflected_radiance,
)
from openswim.ground.sample import SurfaceSample

__all__ = [
    "Ground",
    "SurfaceSample",
    "bidirectional_reflectance",
    "diffuse_reflectance",
    "hemispherical_albedo",
    "reflected_radiance",
    "surface_properties",
]
