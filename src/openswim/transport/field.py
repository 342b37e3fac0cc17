"""Field: the solved light of a scene at all its wavelengths, from which any number of eyes may look."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from openswim.optics.gas_bands import Terms
from openswim.options import Options
from openswim.scene.frame import Frame
from openswim.scene.rays import Rays
from openswim.transport.ground_light.landscape import Landscape
from openswim.transport.lit.lit_grid import LitGrid
from openswim.transport.medium.medium import Medium
from openswim.transport.plan import Plan
from openswim.transport.tiled import LargeViewer, LitDomain
from openswim.transport.view.eye import Transmission
from openswim.transport.view.seen import View
from openswim.transport.view.sight import AT_NM, Sight, sight_of
from openswim.transport.view.viewer import Viewer

F64 = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class FieldEye:
    """An eye in a field, at all wavelengths: see `Viewer`."""

    packs: tuple[Viewer | LargeViewer, ...]
    terms: Terms
    sees_outlines = True

    def view(self, rays: Rays) -> View:
        """Radiance along rays from the eye; memory is bounded by tiling over them."""
        views = [pack.view(rays) for pack in self.packs]
        return replace(
            views[0],
            radiance=self.terms.mean(np.concatenate([v.radiance for v in views], axis=1)),
            transmittance=self.terms.mean(np.concatenate([v.transmittance for v in views], axis=1)),
            samples=sum(v.samples for v in views),
        )

    def sight(self, rays: Rays) -> Sight:
        """What rays from the eye look at, and how far away it is."""
        off_nm = [float(np.abs(pack.lit.wavelengths_nm[: pack.lit.count] - AT_NM).min()) for pack in self.packs]
        pack = self.packs[int(np.argmin(off_nm))]
        return pack.sight(rays) if isinstance(pack, LargeViewer) else sight_of(pack, rays)

    def of_others(self, rays: Rays) -> FieldEye:
        """That of other rays from the same eye, for which little is made again: see `Viewer.of_others`."""
        lit, relief = self.packs[0].lit, None
        if lit.landscape is not None:
            relief = lit.landscape.seen_from(rays)
        return FieldEye(tuple(pack.of_others(rays, relief) for pack in self.packs), self.terms)

    def summed(self, rays: Rays) -> View:
        return self.of_others(rays).view(rays)

    def through(self, rays: Rays) -> Transmission:
        view = self.summed(rays)
        return view.transmittance, view.hit


@dataclass(frozen=True, eq=False)
class Field:
    """The solved light of a scene. What is solved for in place of wavelengths, their `terms`, is held in packs."""

    packs: Sequence[LitGrid | LitDomain]
    terms: Terms
    plan: Plan | None = None  # what was decided: another scene solved by it gives light that differs by values alone

    @property
    def lit(self) -> list[LitGrid]:
        """The light of every pack, of large domains what their parts share."""
        return [pack if isinstance(pack, LitGrid) else pack.lit for pack in self.packs]

    @property
    def _first(self) -> LitGrid:
        return self.lit[0]

    @property
    def solver(self) -> Options:
        return self._first.options

    @property
    def quality(self) -> str:
        return self.packs[0].quality

    @property
    def frame(self) -> Frame:
        return self._first.frame

    @property
    def medium(self) -> Medium | None:
        return self._first.medium

    @property
    def media(self) -> list[Medium]:
        """The media of the grid and of the wider ones around it."""
        return [level.medium for level in self._first.levels if level.medium is not None]

    @property
    def ground_m(self) -> float:
        """Height of the ground outside the grid."""
        return self._first.lighting.ground_m

    @property
    def landscape(self) -> Landscape | None:
        """The shape of the ground around the grid's nodes and beyond them, where it is known."""
        return self._first.landscape

    @property
    def wavelengths_nm(self) -> F64:
        return self.terms.wavelengths_nm

    @property
    def timings(self) -> dict[str, float]:
        """Seconds of each stage of the solution, summed over packs and nested grids: air, sun, diffuse."""
        out: dict[str, float] = {}
        for pack in (level for each in self.lit for level in each.levels):
            for name, seconds in pack.timings.items():
                out[name] = out.get(name, 0.0) + seconds
        return out

    def viewpoint(self, rays: Rays) -> FieldEye:
        """The eye of some rays, which share their origin or their direction; made once, it serves any of them."""
        relief = None if self.landscape is None else self.landscape.seen_from(rays)
        return FieldEye(tuple(
            Viewer.of(pack, rays, relief) if isinstance(pack, LitGrid) else LargeViewer.of(pack, rays)
            for pack in self.packs
        ), self.terms)  # fmt: skip

    def view(self, rays: Rays) -> View:
        """Radiance along rays: that of their own `viewpoint`."""
        return self.viewpoint(rays).view(rays)

    def fluxes(self) -> dict[str, F64]:
        """Domain means for E_TOA = 1: up_top, down_bottom (diffuse), direct_bottom, up_bottom, each (nw,)."""
        parts = [{k: v[: p.count] for k, v in p.lighting.mean_fluxes().items()} for p in self.lit]
        return {name: self.terms.mean(np.concatenate([p[name] for p in parts])) for name in parts[0]}
