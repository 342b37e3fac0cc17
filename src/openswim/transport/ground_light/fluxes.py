"""Light that reaches the ground: fluxes on the grid's columns, on their slopes, and below the clear sky."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from openswim.ground.fields import blurred
from openswim.ground.hills import steepness_below
from openswim.ground.sky_view import Terrain
from openswim.scene.frame import Frame
from openswim.transport.air.shells import beam_transmission, clear_radiance, rows_between
from openswim.transport.engine.interpolation import bilinear
from openswim.transport.engine.ordinates import Ordinates, hemisphere_product
from openswim.transport.engine.pack import PACK
from openswim.transport.engine.types import FLOAT
from openswim.transport.ground_light.clear_share import clear_share
from openswim.transport.march.volume import Shells
from openswim.transport.medium.medium import Medium
from openswim.transport.medium.surface import Surface

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]

SKY_MU = np.sin(np.radians(np.array([0.5, 2, 4, 7, 11, 16, 23, 32, 44, 60, 90])))  # of `clear_sky_table`
SKY_AZIMUTHS = 19
_DARKEST = 0.01  # albedo by which light of the ground's own is divided, since what it adds is multiplied by it
_TOP_ZENITHS = 24  # enough for the edge of the Earth's disc


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
    shining: F32 | None = None  # (nw, ny, nx) L' of the ground's own light

    @classmethod
    def of_clear_sky(cls, surface: Surface, frame: Frame) -> Lighting:
        """A single column at the frame's place."""
        albedo = surface.albedo([frame.lat], [frame.lon]).T
        blank = np.zeros((len(albedo), 1, 1), FLOAT)
        ground_m, of_column = float(surface.terrain_m[0, 0]), albedo[:, :, None].astype(FLOAT)
        return cls(ground_m, albedo[:, 0], of_column, blank, blank.copy(), blank.copy())

    @classmethod
    def of_grid(cls, surface: Surface, medium: Medium) -> Lighting:
        """Albedo and slopes of the grid's columns."""
        _, ny, nx = medium.shape
        lat, lon, _ = medium.frame.latlon(medium.place.reshape(-1, 3))
        albedo = surface.albedo(lat, lon).T.reshape(-1, ny, nx)
        blank = np.zeros(albedo.shape, FLOAT)
        land = Terrain(medium.terrain_m, medium.cell_m, medium.periodic)
        slope_y, slope_x = land.slopes()
        axes = medium.axes.astype(float)
        normal = axes[..., 2, :] - slope_x[..., None] * axes[..., 0, :] - slope_y[..., None] * axes[..., 1, :]
        normal /= np.linalg.norm(normal, axis=-1, keepdims=True)
        return cls(
            medium.ground_m, albedo.mean(axis=(1, 2)), albedo.astype(FLOAT), blank, blank.copy(), blank.copy(),
            normal=normal, axes=medium.axes,
            steepness=steepness_below(blurred(slope_x**2 + slope_y**2), medium.scene_cell_m),
            terrain=None if land.level else land, shining=_shining(surface, lat, lon, (ny, nx)),
        )  # fmt: skip

    def place_sun(self, sun: F64) -> None:
        """Cosine of the solar zenith angle over every column."""
        if self.axes is not None:
            self.mu_sun = self.axes[..., 2, :].astype(float) @ sun
            ny, nx = self.mu_sun.shape
            self.local_sun = self.axes[ny // 2, nx // 2].astype(float) @ sun

    def direct_horizontal(self, w: int) -> F32:
        """Direct flux through the horizontal (ny, nx)."""
        return (self.direct[w] * np.maximum(self.mu_sun, 0)).astype(FLOAT)

    def flux_for_sweeps(self, w: int) -> F32:
        """`direct_horizontal`, and as much more as makes the ground return what it shines with as well."""
        direct = self.direct_horizontal(w)
        if self.shining is None:
            return direct
        return (direct + self.shining[w] / (4 * np.maximum(self.albedo_for_sweeps(w), _DARKEST))).astype(FLOAT)

    def albedo_for_sweeps(self, w: int) -> F32:
        """Albedo (ny, nx) of a plain that returns as much as the terrain does: of what slopes and hollows reflect part
        meets ground again."""
        return self.albedo[w] if self._on_slopes is None else self.albedo[w] * self._on_slopes[0][w]

    def diffuse_on_slopes(self) -> F32:
        """``diffuse`` as slopes and hollows get it: the ground around hides some of the sky, and shines itself."""
        if self._on_slopes is None:
            return self.diffuse
        gain, more = self._on_slopes
        return gain * self.diffuse + more

    def on_finer_slopes(self, diffuse: F64, upright: F64, mu_sun: F64, ix: F64, iy: F64) -> F64:
        """``diffuse`` (n, nw) on the slopes of an elevation model, with cosines ``upright`` (n,) to the vertical: less
        of the sky, (1 + cos)/2 by what it is on the grid's, and in its place the ground of the cells around."""
        share = ((1 + upright) / (1 + bilinear(self._upright, ix, iy)))[:, None]
        albedo, sunlit = (bilinear(one, ix, iy) for one in self._ground_around)
        around = albedo * diffuse + sunlit * np.maximum(mu_sun, 0)[:, None]
        return np.maximum(share * diffuse + (1 - share) * around, 0)

    @cached_property
    def _upright(self) -> F64:
        """Cosine (ny, nx) of the grid's slopes to the vertical."""
        assert self.normal is not None
        assert self.axes is not None
        return np.asarray((self.normal * self.axes[..., 2, :]).sum(-1))

    @cached_property
    def _ground_around(self) -> tuple[F32, F32]:
        """Albedo, and albedo times ``direct`` (nw, ny, nx), over some cells."""
        albedo, sunlit = (
            np.stack([blurred(one) for one in every]).astype(FLOAT)
            for every in (self.albedo, self.albedo * self.direct)
        )
        return albedo, sunlit

    @cached_property
    def _on_slopes(self) -> tuple[F32, F32] | None:
        """Factor and addend (nw, ny, nx) of `diffuse_on_slopes`, to be asked for when ``direct`` is known; None where
        the terrain is level."""
        if self.terrain is None:
            return None
        assert self.local_sun is not None
        albedo, sunlit = self._ground_around
        view, grey = self.terrain.seen((self.albedo * self.direct).mean(axis=0), self.local_sun)
        around = grey * sunlit / np.maximum(sunlit.mean(axis=0), 1e-9)
        # what the ground around has of the sky, and of the ground, is as much as here
        again = 1 / (1 - (1 - view) * albedo)
        return np.asarray(view * again, FLOAT), np.asarray(around * again, FLOAT)

    def light_clear(self, shells: Shells, sun: F64) -> None:
        """Fluxes below the shells alone, and their sky."""
        mu = np.array([sun[2]])
        beam = beam_transmission(shells, mu)[0]
        self.mu_sun = mu.reshape(1, 1)
        self.direct[:, 0, 0] = beam
        self.diffuse[:, 0, 0] = sky_flux(shells, mu)[0]
        self.up_top[:, 0, 0] = outgoing_flux(shells, sun)
        self.forward_depth = forward_depth(shells, mu)[0][:, None, None].astype(FLOAT)
        self.clear_sky = clear_sky_table(shells, sun)

    def correct_quadrature(
        self, ordinates: Ordinates, inflow: F32, shells: Shells, sun: F64, medium: Medium, scaled: F32,
        ends: NDArray[np.bool_], found: Sequence[F32] = (),
    ) -> None:  # fmt: skip
        """Add what the ordinates miss of the clear sky's diffuse flux, which is known better, where the sky is seen.

        scaled, ends: see `clear_share`. found: in twilight, when light comes in nearly level and falls from place to
        place, what sweeps find in clear air (rows, columns) of each wavelength, see `clear_down_flux`.
        """
        self.clear_sky = clear_sky_table(shells, sun)
        if not shells.moments.size:
            return
        q, weight = ordinates
        down = q[:, 2] > 0
        raw = ((weight * q[:, 2])[down, None] * inflow[down, 0]).sum(axis=0) / (4 * np.pi)
        share = clear_share(medium, scaled, ordinates, inflow[:, 0], ends)
        if found:
            known = np.moveaxis(sky_flux(shells, self.mu_sun.ravel()).reshape(*self.mu_sun.shape, -1), -1, 0)
            every = np.stack([_spread_over(one, self.mu_sun.shape) for one in found])
            self.diffuse = np.maximum(self.diffuse + share * (known - every), 0).astype(FLOAT)
            return
        mu = np.array([sun[2]])
        ratio = np.where(raw > 0, sky_flux(shells, mu)[0] / np.maximum(raw, 1e-30), 1.0)
        missed = (np.clip(ratio, 0.8, 1.25) - 1) * raw
        self.diffuse += missed.astype(FLOAT)[:, None, None] * share

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


def _spread_over(values: F32, shape: tuple[int, ...]) -> F64:
    """Values at places spread evenly over columns, at all of these."""
    iy, ix = (np.linspace(0, have - 1, want) for have, want in zip(values.shape, shape, strict=True))
    x, y = np.meshgrid(ix, iy)
    return bilinear(values, x.ravel(), y.ravel()).reshape(shape)


def _shining(surface: Surface, lat: F64, lon: F64, shape: tuple[int, int]) -> F32 | None:
    found = surface.shining(lat, lon)
    return None if found is None else np.ascontiguousarray(found.T.reshape(-1, *shape), FLOAT)


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
    azimuth = np.linspace(0, np.pi, SKY_AZIMUTHS)
    mu, phi = np.meshgrid(SKY_MU, azimuth, indexing="ij")
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
