"""Domains of very many columns, seen from space: lit and seen part by part, so that memory does not grow with them.

Each part is the columns under some of the picture's rays, with as many more around as rays and sunlight slant through.
Its columns are solved by themselves (`columns.py`), and levels, species, air and suns are those of the whole domain:
what a ray sees does not depend on where parts end. docs/decisions/0013-large-domains.md.
"""

from __future__ import annotations

import time
from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from openswim.errors import UserError
from openswim.lights.eclipses import MoonShadow
from openswim.optics.matter import Matter
from openswim.options import Options
from openswim.progress import job
from openswim.scene.rays import Rays
from openswim.transport.air.dimmed import eclipse_of
from openswim.transport.air.shells import no_volume
from openswim.transport.beam.lit_volume import Sunlight, beams_and_shadows, sunlit_volume
from openswim.transport.columns.columns import FromAbove, columns_of_grid, fluxes_of_columns, light_from_above
from openswim.transport.engine.decisions import Decisions
from openswim.transport.engine.pack import PACK
from openswim.transport.engine.types import FLOAT
from openswim.transport.ground_light.fluxes import Lighting, clear_sky_table
from openswim.transport.ground_light.relief import Relief
from openswim.transport.lit.lit_grid import GridLight, LitGrid, Once
from openswim.transport.medium.chart import columns_on
from openswim.transport.medium.coefficients import coefficients_of, forward_tables
from openswim.transport.medium.medium import Medium
from openswim.transport.medium.surface import Surface
from openswim.transport.medium.tiles import Window, large_medium, part_of_medium
from openswim.transport.plan import Plan
from openswim.transport.solve_grid import shells_around
from openswim.transport.swim import light as swim
from openswim.transport.view.seen import View
from openswim.transport.view.sight import Sight, sight_of, species_of
from openswim.transport.view.viewer import Viewer, skies_for

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]

_PART_COLUMNS = 90_000
_MARGIN = 12  # columns of the ground's fields beyond a part, where what fades at their edge may fade
_MOST_SLANT = 96  # columns that light may come from the side
_LEAST_HEIGHT_M = 1e5  # of the eye
_SEEN_AT_M = 4000.0  # height at which rays are given to parts


@dataclass(frozen=True, eq=False)
class LitDomain:
    """What all parts of a large domain share, and all eyes: ``lit`` has its medium and the clear air around, ``above``
    the light from above, ``cover`` (nz, ny, nx) that of its clouds. Diffuse light is solved anew for every view, part
    by part, and forgotten."""

    lit: LitGrid
    above: FromAbove
    cover: F32 | None

    @property
    def quality(self) -> str:
        """See `LitGrid.quality`."""
        return "columns" if self.lit.options.name == "fast" else self.lit.options.quality

    @property
    def whole(self) -> Medium:
        """The medium, of which parts are filled."""
        assert self.lit.medium is not None
        return self.lit.medium

    def part(self, window: Window) -> LitGrid:
        """The light of a window's columns."""
        started = time.perf_counter()
        lit, whole = self.lit, self.whole
        fast, sun, shells, count = lit.options.name == "fast", lit.sun, lit.shells, lit.count
        medium = part_of_medium(whole, self.cover, window)
        wider = window.grown((_MARGIN, _MARGIN), (_MARGIN, _MARGIN), whole.shape[1:])
        ground = lit.surface.window(*wider.slices)
        lighting = Lighting.of_grid(ground, medium)
        lighting.clear_sky = lit.lighting.clear_sky
        lighting.place_sun(sun)
        local_sun = np.einsum("jiab,b->jia", medium.axes.astype(float), sun)
        coefficients = [coefficients_of(medium, shells, w, fast) for w in range(PACK)]
        timings = {"air": time.perf_counter() - started}
        started = time.perf_counter()
        backscatter = None if fast else swim.backscatter_weights(medium)
        volume, channels, depths = sunlit_volume(medium, coefficients, local_sun, Decisions(), Decisions(), backscatter)
        sunlit, dimmed = (shells, None) if lit.eclipse is None else (lit.eclipse.lit, lit.eclipse.dimmed)
        sunlight = Sunlight(coefficients, local_sun, sun)
        beams = beams_and_shadows(medium, lighting, sunlit, volume, channels, depths, sunlight, count, dimmed=dimmed)
        light = GridLight(medium, *beams, coefficients, local_sun, sun, count)
        timings["sun"] = time.perf_counter() - started
        if fast:
            columns = columns_of_grid(medium, coefficients, lighting, local_sun, self.above, count, True)
            fluxes_of_columns(columns, channels.beam, lighting)
            light = replace(light, columns=columns)
        else:
            volume = swim.light_grid(light, volume, channels, lighting, shells, local_sun, sun)
        return replace(
            lit, surface=ground, volume=volume, lighting=lighting, medium=medium, light=light, channels=channels,
            timings=timings, once=Once(),
        )  # fmt: skip


@dataclass(frozen=True, eq=False)
class LargeViewer:
    """An eye in space over a large domain; to it water mirrors the clear sky. See `Viewer`."""

    domain: LitDomain

    @classmethod
    def of(cls, domain: LitDomain, rays: Rays) -> LargeViewer:
        """The viewer of some rays from space."""
        if domain.lit.frame.latlon(rays.origins()[0])[2] < _LEAST_HEIGHT_M:
            raise UserError(
                "a domain of so many columns is lit for eyes in space alone: open the part around the observer, "
                "open_scene(path, around=(lat, lon))"
            )
        return cls(domain)

    @property
    def lit(self) -> LitGrid:
        return self.domain.lit

    def of_others(self, rays: Rays, relief: Relief | None) -> LargeViewer:
        """See `Viewer.of_others`."""
        return LargeViewer.of(self.domain, rays)

    def view(self, rays: Rays) -> View:
        """See `Viewer.view`."""
        n, lit = len(rays), self.lit
        skies = skies_for(lit, rays)
        out = View(
            np.zeros((n, lit.count), FLOAT), np.zeros((n, lit.count), FLOAT), np.zeros(n, bool),
            np.full((n, 3), np.nan), np.zeros(n), np.zeros((n, max(len(self.whole.species), 1)), FLOAT), 0,
        )  # fmt: skip
        with job("light and view", n) as meter:
            for window, which in self._parts(rays):
                seen = Viewer.of(self.domain.part(window), rays[which], None, skies).view(rays[which])
                out.samples += seen.samples
                for name in ("radiance", "transmittance", "hit", "position", "distance_m", "species_depth"):
                    getattr(out, name)[which] = getattr(seen, name)
                meter.advance(len(which))
        return out

    def sight(self, rays: Rays) -> Sight:
        """See `sight_of`. The parts are lit once more for it."""
        skies, out = skies_for(self.lit, rays), Sight.nothing(len(rays), species_of(self.lit))
        for window, which in self._parts(rays):
            out.put(which, sight_of(Viewer.of(self.domain.part(window), rays[which], None, skies), rays[which]))
        return out

    @property
    def whole(self) -> Medium:
        return self.domain.whole

    def _parts(self, rays: Rays) -> Iterator[tuple[Window, NDArray[np.int64]]]:
        """Windows of the domain, and the rays that each shows."""
        ix, iy = self._indices(rays)
        ny, nx = self.whole.shape[1:]
        cell = max(self.whole.cell_m)
        count = max(1, round(np.sqrt(_PART_COLUMNS)))
        across, up = max(1, round(nx / count)), max(1, round(ny / count))
        x_edges, y_edges = np.linspace(0, nx, across + 1).astype(int), np.linspace(0, ny, up + 1).astype(int)
        column = np.clip(np.searchsorted(x_edges, ix, "right") - 1, 0, across - 1)
        row = np.clip(np.searchsorted(y_edges, iy, "right") - 1, 0, up - 1)
        order = np.argsort(row * across + column, kind="stable")
        ends = np.searchsorted((row * across + column)[order], np.arange(across * up + 1))
        for n in range(across * up):
            which = order[ends[n] : ends[n + 1]]
            if which.size == 0:
                continue
            core = Window(x_edges[n % across], x_edges[n % across + 1], y_edges[n // across], y_edges[n // across + 1])
            yield core.grown(*self._slants(core, rays[which][:: max(1, which.size // 500)], cell), (ny, nx)), which

    def _indices(self, rays: Rays) -> tuple[F64, F64]:
        """Fractional columns where rays pass the height of clouds, or come nearest to it."""
        frame, grid = self.whole.frame, self.whole.grid
        ix, iy = np.empty(len(rays)), np.empty(len(rays))
        centre = np.array([0.0, 0.0, frame.radius_m])
        for a in range(0, len(rays), 200_000):
            some = slice(a, min(len(rays), a + 200_000))
            p, d = rays[some].origins() + centre, rays[some].directions()
            along = (p * d).sum(-1)
            reach = along**2 - (p * p).sum(-1) + (frame.radius_m + _SEEN_AT_M) ** 2
            place = p + (-along - np.sqrt(np.maximum(reach, 0)))[:, None] * d - centre
            lat, lon, _ = frame.latlon(place)
            x, y = grid.index(lon, lat)
            ix[some], iy[some] = (np.nan_to_num(v, nan=-1e6, posinf=1e6, neginf=-1e6) for v in (x, y))
        return ix, iy

    def _slants(self, core: Window, rays: Rays, cell: float) -> tuple[tuple[int, int], tuple[int, int]]:
        """Columns to the west and east, then south and north, that rays and the sun's beam pass beside their own."""
        top = float(self.whole.levels_m[-1] - self.whole.levels_m[0])
        y = np.linspace(core.south, core.north - 1, 3).astype(int)
        x = np.linspace(core.west, core.east - 1, 3).astype(int)
        axes, place = columns_on(self.whole.grid, self.whole.frame, np.ix_(y, x))
        sun = np.einsum("jiab,b->jia", axes.astype(float), self.domain.lit.sun).reshape(-1, 3)
        eye = rays.origins()[0]
        back = eye - place.reshape(-1, 3)
        back /= np.linalg.norm(back, axis=-1, keepdims=True)
        back = np.einsum("nab,nb->na", axes.astype(float).reshape(-1, 3, 3), back)
        found = []
        for axis in range(2):
            toward_sun = top * sun[:, axis] / np.maximum(sun[:, 2], 0.02) / cell
            sight = top * back[:, axis] / np.maximum(back[:, 2], 0.1) / cell  # the ray meets its column half-way up
            low = np.minimum(toward_sun, 0).min() - np.abs(sight).max()
            high = np.maximum(toward_sun, 0).max() + np.abs(sight).max()
            found.append((min(int(-low) + 3, _MOST_SLANT), min(int(high) + 3, _MOST_SLANT)))
        return found[0], found[1]


def solve_large(
    options: Options, plan: Plan, matter: Matter, surface: Surface, sun: F64, count: int,
    shadow: MoonShadow | None = None,
) -> LitDomain:  # fmt: skip
    """What all views and parts share: optics on levels, the clear air around."""
    started = time.perf_counter()
    assert plan.medium is not None
    medium, cover = large_medium(plan.medium, matter, surface)
    plan.of_all_packs()("species", lambda: tuple(one.name for one in medium.species))
    frame = medium.frame
    _, ny, nx = medium.shape
    y, x = np.arange(0, ny, 8), np.arange(0, nx, 8)
    _, place = columns_on(medium.grid, frame, np.ix_(y, x))
    lat, lon, _ = frame.latlon(place.reshape(-1, 3))
    albedo = surface.albedo(lat, lon)
    blank = np.zeros((PACK, 1, 1), FLOAT)
    lighting = Lighting(medium.ground_m, albedo.mean(axis=0), blank, blank, blank, blank)
    shells, reach = shells_around(medium, place, lighting, sun)
    eclipse = eclipse_of(shadow, sun, matter.wavelengths_nm, shells, medium.air)
    shells = shells if eclipse is None else eclipse.dimmed.of(shells)
    lighting.clear_sky = clear_sky_table(shells, sun)
    table = forward_tables(medium, options.name == "fast")
    coefficients = [coefficients_of(medium, shells, w, True) for w in range(PACK)]
    above = light_from_above(medium, coefficients, shells, count)
    lit = LitGrid(
        options, surface, matter.air, frame, sun, matter.wavelengths_nm, count, shells, no_volume(), table, lighting,
        medium, reach_deg=reach, timings={"air": time.perf_counter() - started}, eclipse=eclipse,
    )  # fmt: skip
    return LitDomain(lit, above, cover)
