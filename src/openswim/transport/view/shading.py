"""What an eye ray sees where it ends on the ground."""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from openswim.ground.footprints import LONGEST, LongFootprints
from openswim.ground.hills import sunlight_on_slopes
from openswim.ground.reflectance import reflected_radiance
from openswim.ground.sample import SurfaceSample
from openswim.scene.frame import Frame
from openswim.scene.rims import BEYOND_CELLS
from openswim.transport.air.shells import beam_transmission, beam_transmission_at
from openswim.transport.engine.interpolation import bilinear
from openswim.transport.engine.pack import PACK
from openswim.transport.engine.threads import in_threads
from openswim.transport.engine.types import FLOAT
from openswim.transport.ground_light.fluxes import SKY_AZIMUTHS, SKY_MU, Lighting, sky_flux
from openswim.transport.ground_light.relief import Relief
from openswim.transport.lit.lit_grid import LitGrid
from openswim.transport.march.volume import Shells
from openswim.transport.medium.medium import Medium
from openswim.transport.view.beyond_sides import Beyond
from openswim.transport.view.mirror import WET, Water, along_m

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]

_PART = 16_384  # places shaded together, so that what is known of them stays in a cache
_LEAST_SLOPE = 1e-3  # slopes that are not seen
_DARK = 0.02  # of E_TOA, diffuse flux of a sky with the sun on the horizon


@dataclass
class _Ground:
    """The ground that n rays meet: direct beam and diffuse flux (n, PACK), and the cosines (n,) of sun and view, and
    the azimuth (n,) between them, for its slope; and how much of it a pixel covers (n,)."""

    sample: SurfaceSample
    beam: F64
    diffuse: F64
    mu_sun: F64
    mu_view: F64
    azimuth: F64
    footprint_m: F64

    def __getitem__(self, where: NDArray[np.int64]) -> _Ground:
        return _Ground(*(getattr(self, f.name)[where] for f in fields(self)))


class Ground(Protocol):
    """A lit grid, and what its ground looks like to an eye."""

    @property
    def lit(self) -> LitGrid: ...

    @property
    def sky(self) -> Shells:
        """The shells that the eye's rays go through."""
        ...

    @property
    def relief(self) -> Relief | None: ...

    @property
    def mirrored(self) -> Water | None:
        """What water mirrors to the eye; None where it is the clear sky."""
        ...

    def through_clouds(self, place: F64) -> F64:
        """Transmission (n, PACK) of the grid's clouds from the sun to places (n, 3)."""
        ...


def shade(own: Ground, place: F64, direction: F64, width_m: F64) -> F32:
    """L' (n, nw) of the ground at ``place`` (n, 3) seen along ``direction`` (n, 3), ``width_m`` (n,) of it to a pixel.

    Water mirrors the scene's own sky to an eye that is not too high, else the clear sky.
    """
    lit = own.lit
    out = np.empty((len(place), PACK), FLOAT)
    on_slopes = lit.lighting.diffuse_on_slopes()
    # worked out by all threads, which a share is not
    beyond = _beyond(lit) if _any_outside(lit, place) else None

    alone = np.zeros(len(place), bool)  # rays that no picture of what is mirrored shows
    variance = np.zeros(len(place))

    def put(part: Any, given: F32 | None) -> None:
        """Fill in ``out`` for rays whose mirrored light is ``given``, or is in the picture."""
        ground = _ground(own, beyond, on_slopes, place[part], direction[part], width_m[part])
        mirrored = given
        if given is None and own.mirrored is not None and not ground.sample.lambertian:
            wet = np.flatnonzero(ground.sample.water > WET)
            mirrored = np.full((len(ground.mu_sun), PACK), np.nan, FLOAT)
            mirrored[wet], beside = own.mirrored.pictured(direction[part][wet])
            alone[part][wet] = beside
            variance[part][wet] = np.broadcast_to(ground.sample.slope_variance, ground.mu_sun.shape)[wet]
        out[part] = _reflected(lit, own.sky, ground, mirrored)
        if lit.lighting.shining is not None:
            dry = 1 - np.asarray(ground.sample.water, FLOAT)[:, None]  # lamps stand on land
            out[part] += dry * _own_light(lit, place[part], ground.footprint_m)

    def share(t: int, threads: int) -> None:
        for start in range(t * _PART, len(place), threads * _PART):
            put(slice(start, start + _PART), None)

    in_threads(share, parts=-(-len(place) // _PART))
    rest = np.flatnonzero(alone)
    if rest.size and own.mirrored is not None:
        put(rest, own.mirrored.by_itself(place[rest], direction[rest], variance[rest]))
    return out


def _beyond(lit: LitGrid) -> Beyond | None:
    """What clouds do to the light of the ground around a grid that was swept and ends there."""
    if lit.wider is not None or lit.light is None or not lit.swept or lit.light.medium.periodic:
        return None
    light = lit.light

    def make() -> Beyond:
        found = Beyond(light, lit.shells, lit.ends)
        found.prepare()
        return found

    return lit.once("beyond", make)


def _any_outside(lit: LitGrid, place: F64) -> bool:
    """Whether any places lie beyond the grid's bounds, seen from the Earth's centre."""
    radius = lit.frame.radius_m
    sides = lit.volume.sides_m
    plane = place[:, :2] * (radius / np.maximum(radius + place[:, 2:], 1e-3 * radius))
    return bool(((plane < sides[[0, 2]]) | (plane > sides[[1, 3]])).any())


def _ground(
    own: Ground, beyond: Beyond | None, on_slopes: F32, place: F64, direction: F64, width_m: F64
) -> _Ground:
    """What is there, and the light on it, of which `diffuse_on_slopes` is given: see `shade`."""
    lit, shells = own.lit, own.sky
    surface, frame, lighting, sun = lit.surface, lit.frame, lit.lighting, lit.sun
    lat, lon, height_m = frame.latlon(place)
    up = place + np.array([0, 0, frame.radius_m])
    up /= np.linalg.norm(up, axis=-1, keepdims=True)
    mu_sun = up @ sun
    beam = beam_transmission(shells, mu_sun)
    diffuse = sky_flux(shells, mu_sun, beam)
    normal = up.copy()
    # a pixel that looks along the ground covers more of it: the geometric mean of both sides
    length_m = along_m(width_m, up, direction)
    footprint = np.sqrt(width_m * length_m)
    medium, relief = lit.medium, own.relief
    if relief is not None:
        beam = beam_transmission_at(shells, mu_sun, height_m - shells.ground_m)
        normal = relief.normals(place, up, footprint)
    if medium is not None:
        ix, iy = medium.indices(place)
        _, ny, nx = medium.shape
        inside = (ix >= 0) & (iy >= 0) & (ix <= nx - 1) & (iy <= ny - 1) | medium.periodic
        direct = lighting.direct if relief is None or lighting.unshadowed is None else lighting.unshadowed
        beam[inside] = bilinear(direct, ix[inside], iy[inside], medium.periodic)
        diffuse[inside] = bilinear(on_slopes, ix[inside], iy[inside], medium.periodic)
        outside = np.flatnonzero(~inside)
        if outside.size and beyond is not None:
            diffuse[outside] = beyond.flux(ix[outside], iy[outside], diffuse[outside], lighting.diffuse)
        if lighting.normal is not None and relief is None:
            normal[inside] = bilinear(
                np.moveaxis(lighting.normal, -1, 0), ix[inside], iy[inside], medium.periodic
            )
        shaded = np.flatnonzero(~inside & _behind_grid(medium, sun, mu_sun, ix, iy))
        if shaded.size:
            beam[shaded] *= own.through_clouds(place[shaded])
    long = _long(frame, place, normal, direction, width_m, lat, lon) if surface.pictured else None
    sample = surface.sample(lat, lon, footprint, lit.options.detail, long)
    maps = surface.mapped
    if maps and relief is None:
        mapped, known = surface.mapped_normals(frame, place, up, footprint)
        normal += known[:, None] * (mapped - normal)
    normal = np.where(sample.water[:, None] > 0.5, up, normal)
    if maps and medium is not None:
        within = np.flatnonzero(inside)
        diffuse[within] = lighting.on_finer_slopes(
            diffuse[within], (normal * up).sum(-1)[within], mu_sun[within], ix[within], iy[within]
        )
    facet_sun = (normal * sun).sum(-1)
    horizontal_sun = sun - mu_sun[:, None] * up
    if medium is not None and lit.options.detail and not (maps or sample.lambertian):
        steep = _steepness(lighting, medium, ix, iy)
        rough = np.flatnonzero((steep > _LEAST_SLOPE) & (sample.water < 0.5) & (facet_sun > 0) & (footprint > 0))
        beam[rough] *= sunlight_on_slopes(
            lat[rough], lon[rough], frame.earth_centred(horizontal_sun[rough]), facet_sun[rough], steep[rough],
            medium.scene_cell_m, length_m[rough],
        )[:, None]  # fmt: skip
    if relief is not None:
        sunny = np.flatnonzero((facet_sun > 0) & (beam > 0).any(axis=1))
        beam[sunny] *= relief.lit(place[sunny], sun)[:, None]
    facet_view = np.clip(-(normal * direction).sum(-1), 0.02, 1)
    horizontal_view = -direction + (direction * up).sum(-1, keepdims=True) * up
    cosine = (horizontal_sun * horizontal_view).sum(-1) / np.maximum(
        np.linalg.norm(horizontal_sun, axis=-1) * np.linalg.norm(horizontal_view, axis=-1), 1e-12
    )
    return _Ground(sample, beam, diffuse, facet_sun, facet_view, np.arccos(np.clip(cosine, -1, 1)), footprint)


def _long(
    frame: Frame, place: F64, normal: F64, direction: F64, width_m: F64, lat: F64, lon: F64
) -> LongFootprints:
    """What pixels of a width (n,) cover of ground that rises as its normal (n, 3) says."""
    steep = -(normal * direction).sum(-1)
    length_m = width_m / np.clip(steep, 1 / LONGEST, 1.0)
    along = direction + steep[:, None] * normal  # on the slope
    along *= (0.5 * length_m / np.maximum(np.linalg.norm(along, axis=-1), 1e-9))[:, None]
    other_lat, other_lon, _ = frame.latlon(place + along)
    turned = (other_lon - lon + 180.0) % 360.0 - 180.0
    return LongFootprints(other_lat - lat, turned, width_m, length_m)


def _reflected(lit: LitGrid, shells: Shells, ground: _Ground, mirrored: F32 | None = None) -> F32:
    """L' (n, nw) of the ground; its water mirrors ``mirrored`` (n, nw) where that is known, else the clear sky."""
    centre = lit.sun[2:]
    clear = np.maximum(sky_flux(shells, centre), 1e-9)

    def sky(which: NDArray[np.int64], mu: F64, azimuth: F64) -> F64:
        table = lit.lighting.clear_sky
        assert table is not None
        radiance = bilinear(
            np.moveaxis(table, -1, 0),
            np.abs(azimuth) / np.pi * (SKY_AZIMUTHS - 1),
            np.interp(mu, SKY_MU, np.arange(len(SKY_MU))),
        )
        diffuse = ground.diffuse[which]
        # the sky over the scene's centre, as bright as it is here; where the centre is dark, an even one
        known = np.clip(clear / _DARK, 0, 1)
        here = known * radiance * np.minimum(diffuse / clear, 4.0) + (1 - known) * 4 * diffuse
        return here if mirrored is None else np.where(np.isfinite(mirrored[which]), mirrored[which], here)

    direct = ground.beam * np.maximum(ground.mu_sun, 0)[:, None]
    return reflected_radiance(
        ground.sample, lit.wavelengths_nm, ground.mu_sun, ground.mu_view, ground.azimuth, direct,
        ground.diffuse, sky,
    ).astype(FLOAT)  # fmt: skip


def _own_light(lit: LitGrid, place: F64, footprint_m: F64) -> F32:
    """L' (n, nw) that the ground shines with at places (n, 3), of which pixels cover so much (n,)."""
    lat, lon, _ = lit.frame.latlon(place)
    found = lit.surface.shining(lat, lon, footprint_m, detail=True)
    return np.zeros((len(place), PACK), FLOAT) if found is None else found.astype(FLOAT)


def _steepness(lighting: Lighting, medium: Medium, ix: F64, iy: F64) -> F64:
    """Of slopes below the scene's cells (n,), fading out beyond its domain; 0 where no terrain is known."""
    if lighting.steepness is None:
        return np.zeros(ix.shape)
    _, ny, nx = medium.shape
    if medium.periodic:
        return bilinear(lighting.steepness, ix, iy, periodic=True)
    away = np.hypot(ix - np.clip(ix, 0, nx - 1), iy - np.clip(iy, 0, ny - 1)) / medium.fineness
    return bilinear(lighting.steepness, ix, iy) * np.exp(-((np.minimum(away, 1e3) / BEYOND_CELLS) ** 2))


def _behind_grid(medium: Medium, sun: F64, mu_sun: F64, ix: F64, iy: F64) -> NDArray[np.bool_]:
    """Whether the way to the sun from places at fractional indices outside may pass over the grid."""
    _, ny, nx = medium.shape
    x, y, _ = medium.axes[ny // 2, nx // 2].astype(float) @ sun
    rise = medium.cloud_top_m / np.maximum(mu_sun, 0.03)
    # over a large domain the sun's azimuth differs
    half = 0.5 * np.hypot(nx * medium.cell_m[0], ny * medium.cell_m[1])
    astray = max(0.1, 1.5 * half / medium.frame.radius_m)
    near, far = np.full(ix.shape, 0.0), np.full(ix.shape, 1.0)
    with np.errstate(divide="ignore", invalid="ignore"):
        for at, toward, count, cell in ((ix, x, nx, medium.cell_m[0]), (iy, y, ny, medium.cell_m[1])):
            margin = 2.0 + astray * rise / cell
            way = rise * (toward if abs(toward) > 1e-6 else 1e-6) / cell
            a, b = (-margin - at) / way, (count - 1 + margin - at) / way
            near, far = np.maximum(near, np.minimum(a, b)), np.minimum(far, np.maximum(a, b))
    return np.asarray(near <= far)
