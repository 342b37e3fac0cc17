"""Noise that belongs to places of the Earth, and shares laid out by it."""

# ruff: noqa: E402
from openswim.system.compiling import heal, provide_cache

provide_cache()  # before any kernel is defined

from openswim.ground.noise import kernels
from openswim.ground.noise.places import fractal_lumps, fractal_noise, fractal_slope, resolved_share

heal(vars(kernels).values())

__all__ = ["fractal_lumps", "fractal_noise", "fractal_slope", "resolved_share"]
