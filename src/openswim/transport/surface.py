"""Light that reaches the ground, and what an eye ray sees where it ends there."""

from __future__ import annotations

from dataclasses import dataclass, field, fields
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from openswim.ground import SurfaceSample, hemispherical_albedo, reflected_radiance, surface_properties
from openswim.ground.fields import blurred
from openswim.ground.hills import steepness_below, sunlight_on_slopes
from openswim.ground.model import ModelGround
from openswim.ground.relief import height_maps, mapped_normals
from openswim.ground.sky_view import Terrain
from openswim.scene.frame import Frame
from openswim.scene.rims import BEYOND_CELLS
from openswim.scene.scene import Scene
from openswim.transport.medium import Medium
from openswim.transport.mirror import HIGHEST_EYE_M, mirrored_sky
from openswim.transport.ordinates import Ordinates, hemisphere_product
from openswim.transport.pack import PACK
from openswim.transport.shells import beam_transmission, beam_transmission_at, clear_radiance, rows_between
from openswim.transport.threads import in_threads
from openswim.transport.volume import Shells

if TYPE_CHECKING:
    from openswim.transport.field import PackField

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]

_SKY_MU = np.sin(np.radians(np.array([0.5, 2, 4, 7, 11, 16, 23, 32, 44, 60, 90])))
_SKY_AZIMUTHS = 19
_PART = 16_384  # places shaded together, so that what is known of them stays in a cache
_TOP_ZENITHS = 24  # enough for the edge of the Earth's disc
_LEAST_SLOPE = 1e-3  # slopes that are not seen
_DARK = 0.02  # of E_TOA, diffuse flux of a sky with the sun on the horizon


@dataclass
class Lighting:
    """Fluxes at the ground on the grid's columns, for E_TOA = 1, delta-scaled (the beam carries the forward peak).

    albedo, direct (transmission of the beam), diffuse, up_top: (nw, ny, nx); mu_sun (ny, nx); normal (ny, nx, 3).
    """

    ground_m: float
    mean_albedo: F64
    albedo: F32
    direct: F32
    diffuse: F32
    up_top: F32
    mu_sun: F64 = field(default_factory=lambda: np.ones((1, 1)))
    normal: F64 | None = None
    axes: F32 | None = None
    clear_sky: F32 | None = None  # (mu, azimuth, nw) above the centre of the domain
    unshadowed: F32 | None = None  # ``direct`` without the terrain's own shadows, where a relief casts them
    steepness: F64 | None = None  # (ny, nx) of what slopes there are below the scene's cells
    forward_depth: F32 | None = None  # (nw, ny, nx) of the way to the sun: e^-depth of `direct` is unscattered
    terrain: Terrain | None = None  # None where it is level
    local_sun: F64 | None = None  # (3,) along the middle column's axes
    _slopes: tuple[F32, F32] | None = field(default=None, repr=False)

    @classmethod
    def of_clear_scene(cls, scene: Scene, frame: Frame, wl: F64) -> Lighting:
        """A single column at the scene's place."""
        lat, lon = np.array([frame.lat]), np.array([frame.lon])
        albedo = hemispherical_albedo(surface_properties(scene, lat, lon, wl), wl).T
        ground = float(scene.data["surface_altitude"].values.ravel()[0]) if "surface_altitude" in scene.data else 0.0
        nw = len(wl)
        blank = np.zeros((nw, 1, 1), np.float32)
        return cls(ground, albedo[:, 0], albedo[:, :, None].astype(np.float32), blank, blank.copy(), blank.copy())

    @classmethod
    def of_grid(cls, scene: Scene, medium: Medium) -> Lighting:
        """Albedo and slopes of the grid's columns."""
        _, ny, nx = medium.shape
        lat, lon, _ = medium.frame.latlon(medium.place.reshape(-1, 3))
        wl = medium.wavelengths_nm
        albedo = hemispherical_albedo(surface_properties(scene, lat, lon, wl), wl).T.reshape(-1, ny, nx)
        blank = np.zeros(albedo.shape, np.float32)
        terrain = medium.terrain_m.astype(float)
        slope_y = np.gradient(terrain, medium.cell_m[1], axis=0) if ny > 1 else np.zeros_like(terrain)
        slope_x = np.gradient(terrain, medium.cell_m[0], axis=1) if nx > 1 else np.zeros_like(terrain)
        whole = Terrain(medium.terrain_m, medium.cell_m, medium.periodic)
        axes = medium.axes.astype(float)
        normal = axes[..., 2, :] - slope_x[..., None] * axes[..., 0, :] - slope_y[..., None] * axes[..., 1, :]
        normal /= np.linalg.norm(normal, axis=-1, keepdims=True)
        return cls(
            medium.ground_m, albedo.mean(axis=(1, 2)), albedo.astype(np.float32), blank, blank.copy(), blank.copy(),
            normal=normal, axes=medium.axes,
            steepness=steepness_below(blurred(slope_x**2 + slope_y**2), _scene_cell_m(medium)),
            terrain=None if whole.level else whole,
        )  # fmt: skip

    def place_sun(self, sun: F64) -> None:
        """Cosine of the solar zenith angle over every column."""
        if self.axes is not None:
            self.mu_sun = self.axes[..., 2, :].astype(float) @ sun
            ny, nx = self.mu_sun.shape
            self.local_sun = self.axes[ny // 2, nx // 2].astype(float) @ sun

    def direct_horizontal(self, w: int) -> F32:
        """Direct flux through the horizontal (ny, nx)."""
        return (self.direct[w] * np.maximum(self.mu_sun, 0)).astype(np.float32)

    def albedo_for_sweeps(self, w: int) -> F32:
        """Albedo (ny, nx) of a plain that returns as much as the terrain does: of what slopes and hollows reflect part
        meets ground again."""
        if self.terrain is None:
            return self.albedo[w]
        return self.albedo[w] * self._on_slopes(self.terrain)[0][w]

    def diffuse_on_slopes(self) -> F32:
        """``diffuse`` as slopes and hollows get it: the ground around hides some of the sky, and shines itself."""
        if self.terrain is None:
            return self.diffuse
        gain, more = self._on_slopes(self.terrain)
        return gain * self.diffuse + more

    @cached_property
    def ground_around(self) -> tuple[F32, F32]:
        """Albedo, and albedo times ``direct`` (nw, ny, nx), over some cells."""
        albedo, sunlit = (
            np.stack([blurred(one) for one in every]).astype(np.float32)
            for every in (self.albedo, self.albedo * self.direct)
        )
        return albedo, sunlit

    def _on_slopes(self, terrain: Terrain) -> tuple[F32, F32]:
        """Factor and addend (nw, ny, nx) of `diffuse_on_slopes`, known as soon as ``direct`` is."""
        if self._slopes is None:
            assert self.local_sun is not None
            albedo, sunlit = self.ground_around
            mean = (self.albedo * self.direct).mean(axis=0)
            view, grey = terrain.seen(mean, self.local_sun)
            around = grey * sunlit / np.maximum(sunlit.mean(axis=0), 1e-9)
            # what the ground around has of the sky, and of the ground, is as much as here
            again = 1 / (1 - (1 - view) * albedo)
            self._slopes = np.asarray(view * again, np.float32), np.asarray(around * again, np.float32)
        return self._slopes

    def light_clear(self, shells: Shells, sun: F64) -> None:
        """Fluxes below the shells alone, and their sky."""
        mu = np.array([sun[2]])
        beam = beam_transmission(shells, mu)[0]
        self.mu_sun = mu.reshape(1, 1)
        self.direct[:, 0, 0] = beam
        self.diffuse[:, 0, 0] = sky_flux(shells, mu)[0]
        self.up_top[:, 0, 0] = outgoing_flux(shells, sun)
        self.forward_depth = forward_depth(shells, mu)[0][:, None, None].astype(np.float32)
        self.clear_sky = clear_sky_table(shells, sun)

    def correct_quadrature(self, ordinates: Ordinates, inflow: F32, shells: Shells, sun: F64) -> None:
        """Scale the ordinates' diffuse flux by what they miss of the clear sky's, which is known better."""
        self.clear_sky = clear_sky_table(shells, sun)
        if not shells.moments.size:
            return
        q, weight = ordinates
        down = q[:, 2] > 0
        raw = ((weight * q[:, 2])[down, None] * inflow[down, 0]).sum(axis=0) / (4 * np.pi)
        mu = np.array([sun[2]])
        ratio = np.where(raw > 0, sky_flux(shells, mu)[0] / np.maximum(raw, 1e-30), 1.0)
        self.diffuse *= np.clip(ratio, 0.8, 1.25).astype(np.float32)[:, None, None]

    def mean_fluxes(self) -> dict[str, F64]:
        """Domain means (nw,): up_top, down_bottom (diffuse), direct_bottom (unscattered), up_bottom."""
        beam = np.stack([self.direct_horizontal(w) for w in range(len(self.direct))])
        direct = beam if self.forward_depth is None else beam * np.exp(-self.forward_depth)
        total = beam + self.diffuse
        named = {
            "up_top": self.up_top,
            "down_bottom": total - direct,
            "direct_bottom": direct,
            "up_bottom": self.albedo * (beam + self.diffuse_on_slopes()),
        }
        return {name: np.asarray(v, float).mean(axis=(1, 2)) for name, v in named.items()}


def ground_flux(shells: Shells, mu_sun: F64) -> F64:
    """Total flux (n, nw) at the ground below the shells."""
    t = np.interp(mu_sun, np.linspace(-1, 1, len(shells.moment_sun_table)), shells.moment_sun_table)
    return rows_between(shells.ground_flux, t)


def sky_flux(shells: Shells, mu_sun: F64, beam: F64 | None = None) -> F64:
    """Diffuse flux (n, nw) at the ground below the shells; ``beam``: their `beam_transmission`, if known."""
    if not shells.rows.any():  # between a table's suns, some flux of the beam would pass for it
        return np.zeros((len(mu_sun), shells.ground_flux.shape[1]))
    beam = beam_transmission(shells, mu_sun) if beam is None else beam
    return np.maximum(ground_flux(shells, mu_sun) - beam * np.maximum(mu_sun, 0)[:, None], 0)


def forward_depth(shells: Shells, mu_sun: F64) -> F64:
    """Depth (..., nw) from the ground below the shells to the sun of what delta scaling takes off."""
    count = shells.sun_forward.shape[1]
    horizon = float(shells.horizon[0])
    t = np.sqrt(np.clip((mu_sun - horizon) / (1 - horizon), 0, 1)) * (count - 1)
    return rows_between(shells.sun_forward[0], t)


def outgoing_flux(shells: Shells, sun: F64) -> F64:
    """Flux (nw,) that leaves the top of the shells above the origin, per area of the ground."""
    mu, azimuth, weight = hemisphere_product(_TOP_ZENITHS, 10)
    horizontal = np.arctan2(sun[1], sun[0])
    sine = np.sqrt(1 - mu**2)
    direction = np.stack([sine * np.cos(azimuth + horizontal), sine * np.sin(azimuth + horizontal), mu], axis=-1)
    down = mu < 0
    origin = np.array([[0.0, 0.0, shells.top_m - 1.0]])
    radiance = clear_radiance(np.repeat(origin, down.sum(), axis=0), direction[down], sun, shells, 1.0)
    widening = ((shells.radius_m + shells.top_m) / (shells.radius_m + shells.ground_m)) ** 2
    return np.asarray(widening * (weight * np.maximum(-mu, 0))[down] @ radiance / (4 * np.pi))


def clear_sky_table(shells: Shells, sun: F64) -> F32:
    """Radiance (mu, azimuth from the sun, nw) of the clear sky above the origin, for water to mirror."""
    azimuth = np.linspace(0, np.pi, _SKY_AZIMUTHS)
    mu, phi = np.meshgrid(_SKY_MU, azimuth, indexing="ij")
    horizontal = np.array([sun[0], sun[1], 0.0])
    length = np.linalg.norm(horizontal)
    a = horizontal / length if length > 1e-9 else np.array([1.0, 0, 0])
    b = np.array([-a[1], a[0], 0.0])
    sine = np.sqrt(1 - mu**2)
    direction = sine[..., None] * (np.cos(phi)[..., None] * a + np.sin(phi)[..., None] * b)
    direction[..., 2] = mu
    direction = direction.reshape(-1, 3)
    origin = np.tile([0.0, 0.0, shells.ground_m + 2.0], (len(direction), 1))
    return clear_radiance(origin, direction, sun, shells, 1.5).reshape(*mu.shape, PACK)


def bilinear(values: NDArray, ix: F64, iy: F64) -> F64:
    """values (..., ny, nx) at fractional indices (n,), clamped to the edge: (n, ...)."""
    ny, nx = values.shape[-2:]
    x, y = np.clip(ix, 0, nx - 1), np.clip(iy, 0, ny - 1)
    i, j = np.minimum(x.astype(int), max(nx - 2, 0)), np.minimum(y.astype(int), max(ny - 2, 0))
    at, right, up = j * nx + i, min(1, nx - 1), nx * min(1, ny - 1)
    flat = values.reshape(*values.shape[:-2], ny * nx)

    def between(here: NDArray[np.int64]) -> F64:
        low = flat[..., here]
        return np.asarray(low + (flat[..., here + right] - low) * (x - i))

    low = between(at)
    return np.moveaxis(low + (between(at + up) - low) * (y - j), -1, 0)


@dataclass
class _Ground:
    """The ground that n rays meet: direct beam and diffuse flux (n, PACK), and the cosines (n,) of sun and view, and
    the azimuth (n,) between them, for its slope."""

    sample: SurfaceSample
    beam: F64
    diffuse: F64
    mu_sun: F64
    mu_view: F64
    azimuth: F64

    def __getitem__(self, where: NDArray[np.int64]) -> _Ground:
        return _Ground(*(getattr(self, f.name)[where] for f in fields(self)))


def shade(
    light_field: PackField, shells: Shells, place: F64, direction: F64, width_m: F64, eye: F64 | None = None
) -> F32:
    """L' (n, nw) of the ground at ``place`` (n, 3) seen along ``direction`` (n, 3), ``width_m`` (n,) of it to a pixel.

    Water mirrors the scene's own sky to an ``eye`` (3,) within the atmosphere, and the clear sky where there is none.
    """
    out = np.empty((len(place), PACK), np.float32)
    found: dict[int, tuple[NDArray[np.int64], _Ground]] = {}
    near = eye is not None and light_field.frame.latlon(eye)[2] < HIGHEST_EYE_M
    model = light_field.model_ground
    on_slopes = light_field.lighting.diffuse_on_slopes()

    def share(t: int, threads: int) -> None:
        for start in range(t * _PART, len(place), threads * _PART):
            part = slice(start, start + _PART)
            ground = _ground(light_field, shells, model, on_slopes, place[part], direction[part], width_m[part])
            out[part] = _reflected(light_field, shells, ground)
            wet = np.flatnonzero(ground.sample.water > 0.05)
            if near and wet.size and not ground.sample.lambertian:
                found[start] = (start + wet, ground[wet])

    if light_field.beyond is not None and _any_outside(light_field, place):
        light_field.beyond.prepare()  # by all threads, which a share is not
    in_threads(share, parts=-(-len(place) // _PART))
    waters = [found[start] for start in sorted(found)]
    if waters and eye is not None:
        which = np.concatenate([w for w, _ in waters])
        wind = np.concatenate([ground.sample.wind_speed for _, ground in waters])
        mirrored = mirrored_sky(light_field, eye, place[which], direction[which], wind)
        first = 0
        for wet, ground in waters:
            out[wet] = _reflected(light_field, shells, ground, mirrored[first : first + wet.size])
            first += wet.size
    return out


def _any_outside(light_field: PackField, place: F64) -> bool:
    """Whether any places lie beyond the grid's bounds, seen from the Earth's centre."""
    radius = light_field.frame.radius_m
    sides = light_field.volume.sides_m
    plane = place[:, :2] * (radius / np.maximum(radius + place[:, 2:], 1e-3 * radius))
    return bool(((plane < sides[[0, 2]]) | (plane > sides[[1, 3]])).any())


def _ground(
    light_field: PackField, shells: Shells, model: ModelGround, on_slopes: F32, place: F64, direction: F64, width_m: F64
) -> _Ground:
    """What is there, and the light on it, of which `diffuse_on_slopes` is given: see `shade`."""
    scene, frame, lighting = light_field.scene, light_field.frame, light_field.lighting
    sun, wl = light_field.sun, light_field.wavelengths_nm
    lat, lon, height_m = frame.latlon(place)
    up = place + np.array([0, 0, frame.radius_m])
    up /= np.linalg.norm(up, axis=-1, keepdims=True)
    mu_sun = up @ sun
    beam = beam_transmission(shells, mu_sun)
    diffuse = sky_flux(shells, mu_sun, beam)
    normal = up.copy()
    # a pixel that looks along the ground covers more of it: the geometric mean of both sides
    along_m = width_m / np.clip(-(up * direction).sum(-1), 0.05, 1.0)
    footprint = np.sqrt(width_m * along_m)
    medium, relief = light_field.medium, light_field.relief
    if relief is not None:
        beam = beam_transmission_at(shells, mu_sun, height_m - shells.ground_m)
        normal = relief.normals(place, up, footprint)
    if medium is not None:
        ix, iy = _indices(scene, medium, place, lat, lon)
        _, ny, nx = medium.shape
        inside = (ix >= 0) & (iy >= 0) & (ix <= nx - 1) & (iy <= ny - 1)
        direct = lighting.direct if relief is None or lighting.unshadowed is None else lighting.unshadowed
        beam[inside] = bilinear(direct, ix[inside], iy[inside])
        diffuse[inside] = bilinear(on_slopes, ix[inside], iy[inside])
        outside = np.flatnonzero(~inside)
        if outside.size and light_field.beyond is not None:
            diffuse[outside] = light_field.beyond.flux(ix[outside], iy[outside], diffuse[outside], lighting.diffuse)
        if lighting.normal is not None and relief is None:
            normal[inside] = bilinear(np.moveaxis(lighting.normal, -1, 0), ix[inside], iy[inside])
        shaded = np.flatnonzero(~inside & _behind_grid(medium, sun, mu_sun, ix, iy))
        if shaded.size:
            beam[shaded] *= light_field.through_clouds(place[shaded])
    sample = surface_properties(scene, lat, lon, wl, footprint, light_field.solver.detail, model)
    maps = height_maps(scene)
    if maps and relief is None:
        own, known = mapped_normals(maps, frame, place, up, footprint)
        normal += known[:, None] * (own - normal)
    normal = np.where(sample.water[:, None] > 0.5, up, normal)
    if maps and medium is not None and lighting.normal is not None:
        within = np.flatnonzero(inside)
        diffuse[within] = _on_finer_slopes(
            lighting, diffuse[within], (normal * up).sum(-1)[within], mu_sun[within], ix[within], iy[within]
        )
    facet_sun = (normal * sun).sum(-1)
    horizontal_sun = sun - mu_sun[:, None] * up
    if medium is not None and light_field.solver.detail and not (maps or sample.lambertian):
        steep = _steepness(lighting, medium, ix, iy)
        rough = np.flatnonzero((steep > _LEAST_SLOPE) & (sample.water < 0.5) & (facet_sun > 0) & (footprint > 0))
        beam[rough] *= sunlight_on_slopes(
            lat[rough], lon[rough], frame.earth_centred(horizontal_sun[rough]), facet_sun[rough], steep[rough],
            _scene_cell_m(medium), along_m[rough],
        )[:, None]  # fmt: skip
    if relief is not None:
        lit = np.flatnonzero((facet_sun > 0) & (beam > 0).any(axis=1))
        beam[lit] *= relief.lit(place[lit], sun)[:, None]
    facet_view = np.clip(-(normal * direction).sum(-1), 0.02, 1)
    horizontal_view = -direction + (direction * up).sum(-1, keepdims=True) * up
    cosine = (horizontal_sun * horizontal_view).sum(-1) / np.maximum(
        np.linalg.norm(horizontal_sun, axis=-1) * np.linalg.norm(horizontal_view, axis=-1), 1e-12
    )
    return _Ground(sample, beam, diffuse, facet_sun, facet_view, np.arccos(np.clip(cosine, -1, 1)))


def _reflected(light_field: PackField, shells: Shells, ground: _Ground, mirrored: F32 | None = None) -> F32:
    """L' (n, nw) of the ground; its water mirrors ``mirrored`` (n, nw) where that is known, else the clear sky."""
    centre = light_field.sun[2:]
    clear = np.maximum(sky_flux(shells, centre), 1e-9)

    def sky(which: NDArray[np.int64], mu: F64, azimuth: F64) -> F64:
        table = light_field.lighting.clear_sky
        assert table is not None
        radiance = bilinear(
            np.moveaxis(table, -1, 0),
            np.abs(azimuth) / np.pi * (_SKY_AZIMUTHS - 1),
            np.interp(mu, _SKY_MU, np.arange(len(_SKY_MU))),
        )
        diffuse = ground.diffuse[which]
        # the sky over the scene's centre, as bright as it is here; where the centre is dark, an even one
        known = np.clip(clear / _DARK, 0, 1)
        here = known * radiance * np.minimum(diffuse / clear, 4.0) + (1 - known) * 4 * diffuse
        return here if mirrored is None else np.where(np.isfinite(mirrored[which]), mirrored[which], here)

    direct = ground.beam * np.maximum(ground.mu_sun, 0)[:, None]
    return reflected_radiance(
        ground.sample, light_field.wavelengths_nm, ground.mu_sun, ground.mu_view, ground.azimuth, direct,
        ground.diffuse, sky,
    ).astype(np.float32)  # fmt: skip


def _on_finer_slopes(lighting: Lighting, diffuse: F64, upright: F64, mu_sun: F64, ix: F64, iy: F64) -> F64:
    """``diffuse`` (n, nw) on the slopes of an elevation model, with cosines ``upright`` (n,) to the vertical: less of
    the sky, (1 + cos)/2 by what it is on the grid's, and in its place the ground of the cells around."""
    assert lighting.normal is not None
    assert lighting.axes is not None
    own = bilinear((lighting.normal * lighting.axes[..., 2, :]).sum(-1), ix, iy)
    share = ((1 + upright) / (1 + own))[:, None]
    albedo, sunlit = (bilinear(field, ix, iy) for field in lighting.ground_around)
    around = albedo * diffuse + sunlit * np.maximum(mu_sun, 0)[:, None]
    return np.maximum(share * diffuse + (1 - share) * around, 0)


def _steepness(lighting: Lighting, medium: Medium, ix: F64, iy: F64) -> F64:
    """Of slopes below the scene's cells (n,), fading out beyond its domain; 0 where no terrain is known."""
    if lighting.steepness is None:
        return np.zeros(ix.shape)
    _, ny, nx = medium.shape
    away = np.hypot(ix - np.clip(ix, 0, nx - 1), iy - np.clip(iy, 0, ny - 1)) / medium.fineness
    return bilinear(lighting.steepness, ix, iy) * np.exp(-((np.minimum(away, 1e3) / BEYOND_CELLS) ** 2))


def _scene_cell_m(medium: Medium) -> float:
    """Width of the cells that the scene itself has."""
    return min(medium.cell_m) * medium.fineness


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


def _indices(scene: Scene, medium: Medium, place: F64, lat: F64, lon: F64) -> tuple[F64, F64]:
    """Fractional grid indices of places."""
    grid = scene.grid
    assert grid is not None
    if medium.frame.curved:
        ix, iy = grid.index(lon, lat)
        return (ix - medium.first[0]) * medium.fineness, (iy - medium.first[1]) * medium.fineness
    ix = medium.fineness * (place[:, 0] - grid.x[0]) / grid.step[0]
    iy = medium.fineness * (place[:, 1] - grid.y[0]) / grid.step[1]
    if medium.periodic:
        _, ny, nx = medium.shape
        return np.clip(ix % nx, 0, nx - 1), np.clip(iy % ny, 0, ny - 1)
    return ix, iy
