"""The shells of air that rays go through: those under the suns over a grid, or under every sun round the Earth."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from openswim.scene.rays import Rays
from openswim.transport.air.shells import build_shells
from openswim.transport.lit.lit_grid import LitGrid
from openswim.transport.march.volume import Shells
from openswim.transport.medium.medium import air_of


def skies_for(lit: LitGrid, rays: Rays) -> list[Shells]:
    """Of every grid the shells solved for the suns over it; of the widest, where rays reach farther round the Earth,
    those for every sun."""
    *inner, widest = lit.levels
    near = widest.air is None or _reach_deg(rays, widest.shells) < widest.reach_deg
    return [*(level.shells for level in inner), widest.shells if near else wide_shells(widest)]


def wide_shells(lit: LitGrid) -> Shells:
    """The shells under every sun there is, on all sides of the Earth."""
    eclipse = lit.eclipse
    if eclipse is None:
        return sunlit_wide_shells(lit)
    return lit.once("dim wide shells", lambda: eclipse.dimmed.of(sunlit_wide_shells(lit)))


def sunlit_wide_shells(lit: LitGrid) -> Shells:
    """The same without the moon's shadow."""
    return lit.once("wide shells", lambda: _every_sun(lit, lit.shells.ground_albedo))


def black_shells(lit: LitGrid) -> Shells:
    """`sunlit_wide_shells` over ground that is black."""
    return lit.once("black shells", lambda: _every_sun(lit, 0.0))


def _every_sun(lit: LitGrid, albedo: ArrayLike) -> Shells:
    s = lit.shells
    return build_shells(air_of(lit.air, s.ground_m), (0.0, 110.0), s.radius_m, s.ground_m, albedo, s.top_m, scale=1.5)


def _reach_deg(rays: Rays, shells: Shells) -> float:
    """Largest angle at the Earth's centre between the scene's origin and what rays pass of the atmosphere."""
    some = rays[:: max(1, len(rays) // 2000)]
    up = np.array([0.0, 0.0, shells.radius_m])
    p, d = some.origins() + up, some.directions()
    along = (p * d).sum(-1)
    nearest = np.maximum((p * p).sum(-1) - along**2, 0.0)  # squared distance of the line from the centre
    half = np.sqrt(np.maximum((shells.radius_m + shells.top_m) ** 2 - nearest, 0.0))
    ground = (shells.radius_m + shells.ground_m) ** 2 - nearest
    last = np.where((ground > 0) & (along < 0), -along - np.sqrt(np.maximum(ground, 0)), -along + half)
    seen = (half > 0) & (last > 0)
    if not seen.any():
        return 0.0
    ends = np.concatenate([p + np.maximum(-along - half, 0)[:, None] * d, p + last[:, None] * d])[np.tile(seen, 2)]
    return float(np.degrees(np.arccos(np.clip(ends[:, 2] / np.linalg.norm(ends, axis=-1), -1, 1))).max())
