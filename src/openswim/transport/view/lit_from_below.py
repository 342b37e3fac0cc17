"""Light that the ground sends up into the air over it, seen from space: by the ground that is there.

The shells stand on ground of one albedo, the domain's mean. Over sea beside bright land the air would be too bright, by
up to a tenth in red light, and a domain would show its sides. What the ground of an albedo a adds to the light of the
air above it goes with

    f(a) = a/(1 - s a),

s the share of it that air sends back; for shells over black ground and over theirs, path radiances differ by t f(a).
So t(mu_sun, mu_view) is tabled, once, and a ray that ends on ground of albedo b has t [f(b) - f(a)] more. The ground
has (1 - s a)/(1 - s b) times the light.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from openswim.ground.reflectance import hemispherical_albedo
from openswim.scene.interpolation import smooth_step
from openswim.transport.air.shells import no_volume
from openswim.transport.engine.interpolation import bilinear
from openswim.transport.engine.pack import PACK
from openswim.transport.engine.types import FLOAT
from openswim.transport.lit.lit_grid import LitGrid
from openswim.transport.march.march import march_rays
from openswim.transport.march.volume import Shells
from openswim.transport.view.skies import black_shells, sunlit_wide_shells

F64 = NDArray[np.float64]

# In twilight close, where light falls to a tenth within two degrees; between them logarithms are read
_MU_SUN = np.array([
    -0.4, -0.35, -0.31, -0.26, -0.21, -0.17, -0.14, -0.12, -0.1, -0.08, -0.06, -0.045, -0.03, -0.015, 0.0, 0.015, 0.03,
    0.05, 0.08, 0.11, 0.15, 0.2, 0.25, 0.32, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 1.0,
])  # fmt: skip
_DARKEST = 1e-14  # L' that stands for none
_MU_VIEW = np.array([0.05, 0.075, 0.1, 0.125, 0.15, 0.2, 0.25, 0.3, 0.37, 0.45, 0.55, 0.65, 0.8, 1.0])
_FROM_M = 5e6  # along a ray from the ground, beyond all air
_NEXT_TO_BLACK = 0.005  # albedos that tell nothing of t
# Eyes between which this fades in: to lower ones the air below them is not all that they see
_LOWEST_EYE_M, _HIGHEST_EYE_M = 1e4, 4e4
_NEIGHBOURHOOD_M = 3e4  # of ground that lights the air over a place: four fifths of it by 20 km (Vermote et al. 1997)
_LEVEL = 0.15  # cosine of the zenith angle, up to which it fades out: beside rays that meet no ground


@dataclass(frozen=True)
class LitFromBelow:
    """Logarithms of t (PACK, suns, views), albedo a and share s (PACK,) of the shells that rays go through, and
    logarithms of the flux (PACK, suns) at their ground."""

    table: F64
    albedo: F64
    share: F64
    flux: F64

    @classmethod
    def of(cls, shells: Shells, black: Shells) -> LitFromBelow | None:
        """From shells, and the same over black ground; None where theirs is next to black."""
        albedo = shells.ground_albedo.astype(float)
        if albedo.max() < _NEXT_TO_BLACK:
            return None
        # flux at the ground goes with 1/(1 - s a)
        grown = black.ground_flux.sum(axis=0, dtype=float) / np.maximum(shells.ground_flux.sum(axis=0), 1e-30)
        share = np.clip((1 - grown) / np.maximum(albedo, _NEXT_TO_BLACK), 0.0, 1.0)
        more = np.maximum(_path_radiance(shells) - _path_radiance(black), _DARKEST)
        table = np.log(more / np.maximum(_sent(albedo, share), 1e-30)[:, None, None])
        places = np.interp(_MU_SUN, np.linspace(-1, 1, len(shells.moment_sun_table)), shells.moment_sun_table)
        suns = np.arange(len(shells.ground_flux))
        flux = np.array([np.interp(places, suns, own) for own in shells.ground_flux.T])
        return cls(table, albedo, share, np.log(np.maximum(flux, _DARKEST)))

    def more(self, albedo: F64, dull: F64, mu_sun: F64, mu_view: F64, eye_m: F64) -> tuple[F64, F64]:
        """L' (n, PACK) of the air, and of the ground, to add to rays that end on ground of this albedo (n, PACK), by
        cosines of the zenith angles of sun and view there (n,), and heights of the eye (n,), m. ``dull``: what of the
        ground is no water (n,), which mirrors most of what it sends elsewhere."""
        at_sun = np.interp(mu_sun, _MU_SUN, np.arange(len(_MU_SUN)))
        at_view = np.interp(mu_view, _MU_VIEW, np.arange(len(_MU_VIEW)))
        whole = smooth_step((eye_m - _LOWEST_EYE_M) / (_HIGHEST_EYE_M - _LOWEST_EYE_M)) * smooth_step(mu_view / _LEVEL)
        sent = _sent(albedo, self.share) - _sent(self.albedo, self.share)
        grown = (1 - self.share * self.albedo) / (1 - self.share * albedo) - 1
        flux = np.exp(bilinear(self.flux[:, None], at_sun, 0 * at_sun))
        of_air = np.exp(bilinear(self.table, at_view, at_sun))
        whole = whole[:, None]
        return whole * sent * of_air, whole * grown * 4 * dull[:, None] * albedo * flux


class EndsOfRays(NamedTuple):
    """Where rays end on ground: ``place`` and ``direction`` (n, 3), ``origin`` (n, 3) where they begin, and how far
    outside of the grids' sides they end, 0 within: ``beside_m`` (n,)."""

    place: F64
    direction: F64
    origin: F64
    beside_m: F64


def from_space(lit: LitGrid, origin: F64) -> NDArray[np.bool_]:
    """Whether an eye (n, 3) or (3,) is so high that the light of the ground in the air below it is reckoned with."""
    return np.asarray(_height_m(lit, origin) > _LOWEST_EYE_M) & (lit.air is not None) & (lit.lighting.shining is None)


def light_from_below(lit: LitGrid, ends: EndsOfRays) -> tuple[F64, F64]:
    """L' (n, PACK) that air and ground at the ends of rays have from the ground there, more or less than over the mean
    of a grid's; but for what the grid solves with its own ground."""
    ground = lit.once("lit from below", lambda: LitFromBelow.of(sunlit_wide_shells(lit), black_shells(lit)))
    if ground is None:
        return np.zeros((len(ends.place), PACK)), np.zeros((len(ends.place), PACK))
    lat, lon, _ = lit.frame.latlon(ends.place)
    vertical = ends.place + np.array([0.0, 0.0, lit.frame.radius_m])
    vertical /= np.linalg.norm(vertical, axis=-1, keepdims=True)
    sample = lit.surface.sample(lat, lon, _NEIGHBOURHOOD_M)
    of_air, of_ground = ground.more(
        hemispherical_albedo(sample, lit.wavelengths_nm), 1 - np.asarray(sample.water), vertical @ lit.sun,
        -(vertical * ends.direction).sum(-1), _height_m(lit, ends.origin),
    )  # fmt: skip
    if lit.swept:  # by light that comes in through its sides from air over the mean
        share = -np.expm1(-((ends.beside_m / _NEIGHBOURHOOD_M) ** 2))[:, None]
        of_air, of_ground = share * of_air, share * of_ground
    return of_air, of_ground


def _height_m(lit: LitGrid, place: F64) -> F64:
    radius_m = lit.frame.radius_m
    return np.asarray(np.linalg.norm(place + np.array([0.0, 0.0, radius_m]), axis=-1) - radius_m)


def _path_radiance(shells: Shells) -> F64:
    """L' (PACK, suns, views) of the air between space and the ground, a quarter of a circle from the sun's azimuth."""
    across = np.sqrt(1 - _MU_VIEW**2)
    direction = np.stack([-across, 0 * across, -_MU_VIEW], axis=-1)
    origin = np.array([0.0, 0.0, shells.ground_m]) - _FROM_M * direction
    peaks = np.zeros((1, 2, 2, PACK), FLOAT)
    suns = [np.array([0.0, np.sqrt(1 - mu * mu), mu]) for mu in _MU_SUN]
    found = [march_rays(origin, direction, sun, peaks, shells, no_volume(), 1.0).radiance for sun in suns]
    return np.moveaxis(np.array(found, float), -1, 0)


def _sent(albedo: F64, share: F64) -> F64:
    return np.asarray(albedo / (1 - share * albedo))
