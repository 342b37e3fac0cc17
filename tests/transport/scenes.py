"""Small scenes with known answers, and the rays to look at them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from pyproj import CRS

from openswim.cameras import Rays
from openswim.ground.surface import surface_of
from openswim.optics.matter import matter_of
from openswim.scene import Scene
from openswim.scene.atmosphere import Atmosphere
from openswim.scene.phase import HenyeyGreenstein
from openswim.transport.field import Field
from openswim.transport.lit.lit_grid import LitGrid, Once
from openswim.transport.medium.medium import Medium, build_medium
from openswim.transport.medium.plan import Fineness, plan_medium
from openswim.transport.montecarlo.reference import ReferenceView
from openswim.transport.view.seen import View
from openswim.transport.view.viewer import AimedGrid

WAVELENGTH_NM = 546.0
LAT, LON = 40.0, 10.0
_CRS = CRS.from_proj4(f"+proj=lcc +lat_1=30 +lat_2=50 +lat_0={LAT} +lon_0={LON} +R=6371000")


def toward(azimuth_deg: float, altitude_deg: float) -> np.ndarray:
    """Unit vector in a flat scene (x east, y north)."""
    az, alt = np.radians([azimuth_deg, altitude_deg])
    return np.array([np.cos(alt) * np.sin(az), np.cos(alt) * np.cos(az), np.sin(alt)])


def sun_at_zenith_angle(deg: float) -> np.ndarray:
    """In the x-z plane."""
    return np.array([np.sin(np.radians(deg)), 0.0, np.cos(np.radians(deg))])


def slab(tau: float, albedo: float = 0.0, omega: float = 1.0, levels: int = 65, **more: Any) -> Scene:
    """Homogeneous plane-parallel layer from the ground to 1 km."""
    across = np.arange(3) * 1000.0
    return Scene.from_arrays(
        np.full((levels, 3, 3), tau / 1000.0, np.float32),
        across,
        across,
        np.linspace(0.0, 1000.0, levels),
        single_scattering_albedo=omega,
        periodic=True,
        surface_albedo=albedo,
        **more,
    )


def grid_scene(
    extinction: ArrayLike | Mapping[str, ArrayLike],
    shape: tuple[int, int, int],
    cell_m: tuple[float, float, float] = (100.0, 100.0, 100.0),
    curved: bool = False,
    air: bool = False,
    **more: Any,
) -> Scene:
    """A domain of nodes (nz, ny, nx), spacing (dx, dy, dz), centred on x = y = 0 and standing on z = 0."""
    nz, ny, nx = shape
    dx, dy, dz = cell_m
    x, y = dx * (np.arange(nx) - (nx - 1) / 2), dy * (np.arange(ny) - (ny - 1) / 2)
    return laid_scene(extinction, x, y, dz * np.arange(nz), curved, air, **more)


def laid_scene(
    extinction: ArrayLike | Mapping[str, ArrayLike], x: np.ndarray, y: np.ndarray, z: np.ndarray, curved: bool = True,
    air: bool = False, **more: Any,
) -> Scene:  # fmt: skip
    """A domain on axes of metres, from the projection's centre and from the ground."""
    more = {"atmosphere": Atmosphere.us_standard() if air else None, "surface_albedo": 0.0} | more
    crs = _CRS if curved else None
    return Scene.from_arrays(extinction, x, y, z, crs=crs, **{"phase": HenyeyGreenstein(0.85)} | more)


def box(
    shape: tuple[int, int, int], inside: tuple[slice, slice, slice], extinction_per_m: float
) -> np.ndarray:
    """Homogeneous box of nodes in vacuum."""
    field = np.zeros(shape, np.float32)
    field[inside] = extinction_per_m
    return field


def cloud_scene(**more: Any) -> Scene:
    """A box of cloud in vacuum."""
    shape = (9, 13, 13)
    return grid_scene(box(shape, (slice(3, 6), slice(4, 9), slice(4, 9)), 0.02), shape, **more)


def down_on(x_m: ArrayLike, y_m: ArrayLike, height_m: float) -> Rays:
    """Vertical rays from a height."""
    x, y = np.broadcast_arrays(np.asarray(x_m, float), np.asarray(y_m, float))
    origin = np.stack([x.ravel(), y.ravel(), np.full(x.size, height_m)], axis=-1)
    return Rays(origin, np.array([0.0, 0.0, -1.0]))


def sky_directions(zenith_deg: ArrayLike, azimuth_deg: ArrayLike) -> np.ndarray:
    """All combinations as unit vectors (n, 3), azimuth clockwise from +y."""
    z, a = np.meshgrid(np.radians(zenith_deg), np.radians(azimuth_deg), indexing="ij")
    return np.stack([np.sin(z) * np.sin(a), np.sin(z) * np.cos(a), np.cos(z)], axis=-1).reshape(-1, 3)


def mean_by_chance(view: View) -> tuple[float, float]:
    """Mean radiance of what `reference` saw, and its standard error."""
    assert isinstance(view, ReferenceView)
    return float(view.radiance.mean()), float(np.sqrt((view.sigma**2).sum()) / view.sigma.size)


def aimed_at(lit: LitGrid, eye: ArrayLike = (0.0, 0.0, 1e3)) -> AimedGrid:
    """The light of a grid turned toward an eye."""
    return AimedGrid.at(lit, np.asarray(eye, float), False, None, [level.shells for level in lit.levels])


def changed(field: Field, **changes: Any) -> Field:
    """The same light with other attributes of its packs, and nothing of what followed from those it had."""
    return Field([replace(lit, once=Once(), **changes) for lit in field.lit], field.terms)


def medium_of(
    scene: Scene, wavelengths_nm: ArrayLike, mu_sun: float, refine: bool = True, divide: bool = True, **more: bool
) -> Medium:
    """The medium of a scene that has no wider one around it."""
    matter, surface = matter_of(scene, wavelengths_nm), surface_of(scene, wavelengths_nm)
    plan = plan_medium(matter, surface.terrain_m, mu_sun, Fineness(refine, divide, **more))
    return build_medium(plan, matter, surface)
