"""A sweep of all ordinates, its tangent and its transposes: the map whose fixed point diffuse light is.

Ordinates are swept a few at a time, each by one thread; no field of all ordinates ever exists.
"""

from __future__ import annotations

import threading
from collections.abc import Iterator
from dataclasses import dataclass
from typing import NamedTuple
from weakref import WeakKeyDictionary

import numpy as np
from numba import get_num_threads
from numpy.typing import NDArray

from openswim.transport.engine.threads import in_threads
from openswim.transport.linear.cell import bounded
from openswim.transport.linear.course import Grid
from openswim.transport.linear.moments import (
    Taken,
    around,
    around_transposed,
    emit,
    gather,
    scatter,
    scatter_transposed,
)
from openswim.transport.linear.sweep import About, Sources, carry, weigh
from openswim.transport.linear.transposed import Bars, Lit, carry_transposed
from openswim.transport.linear.world import World

F64 = NDArray[np.float64]
I64 = NDArray[np.int64]
_BATCH = 32  # ordinates at a time, or a multiple of it where there are more threads: sums stay the same
KEEP_BYTES = 2**28  # of steps' weights; where there are more, they are found anew row by row
_LINE = 64  # bytes of a cache's line
_PAGE, _APART = 64, 17  # lines: by how many rows of scratch begin apart, or they would displace each other from caches
_here = threading.local()  # of each thread the scratch of its sweeps


@dataclass(eq=False)
class Filled:
    """What is at the nodes at one term: ext (nodes,) scaled extinction, 1/m; scattering (M, nodes): its Legendre
    moments, 1/m; lit (nodes,): the beam as it lights what is around them; albedo and direct (columns,): of the ground,
    and the flux of the beam there; inflow (n, nz). steps (n, 4, width): what `sweep.weigh` makes of ext, where kept."""

    ext: F64
    scattering: F64
    lit: F64
    albedo: F64
    direct: F64
    inflow: F64
    steps: F64 | None = None


class Change(NamedTuple):
    """Changes of `Filled`, or bars of it."""

    ext: F64
    scattering: F64
    lit: F64
    albedo: F64
    direct: F64


class Swept(NamedTuple):
    """moments (K, nodes) of what is scattered around the nodes, ``seen`` of the light at them; flux and ground
    (columns,): down through the ground over E_TOA, and L' of it. Of a value: ``taken`` as `_taken` makes it."""

    moments: F64
    seen: F64
    flux: F64
    ground: F64
    taken: Taken | None = None


class Sweeps:
    """Sweeps through one world, in single or double precision."""

    def __init__(self, world: World, element: type[np.floating] = np.float64) -> None:
        self.world, self.element = world, element
        self._grid = Grid(
            np.array(world.shape, np.int64), world.levels_m, np.array(world.cell_m, float), world.ground_node
        )
        self._harmonics, self._gathered = world.harmonics.astype(element), world.gathered.astype(element)
        self._sun = world.sun_harmonics.reshape(len(world.ell), -1).astype(element)
        per_line = _LINE // np.dtype(element).itemsize
        lines = -(-world.nodes // per_line)
        self._width = (lines + (_APART - lines) % _PAGE) * per_line  # of rows of scratch, the nodes' and what is unused

    @property
    def _size(self) -> int:
        return -(-get_num_threads() // _BATCH) * _BATCH

    def _batches(self, first: int, last: int) -> Iterator[slice]:
        size = self._size
        for n in range(first, last, size):
            yield slice(n, min(n + size, last))

    def _fields(self, count: int) -> list[F64]:
        """Scratch (b, width) each, with what the thread's last sweep left there: new memory is slow to come by."""
        if not hasattr(_here, "fields"):
            _here.fields = WeakKeyDictionary()
        kept: list[F64] = _here.fields.setdefault(self, [])
        if kept and len(kept[0]) != self._size:
            kept.clear()
        kept += [np.zeros((self._size, self._width), self.element) for _ in range(count - len(kept))]
        return kept[:count]

    def keep_steps(self, f: Filled) -> None:
        """All steps' weights, for all sweeps through what there is, unless they are too many."""
        count = len(self.world.weight)
        if 4 * count * self._width * f.ext.itemsize <= KEEP_BYTES:
            f.steps = np.empty((count, 4, self._width), self.element)
            in_threads(weigh, self._grid, self.world.direction, f.ext, f.steps)

    def _steps(self, f: Filled, some: slice) -> F64:
        return np.empty((0, 4, self._width), self.element) if f.steps is None else f.steps[some]

    def _scattered(self, scattering: F64, moments: F64 | None, lit: F64 | None) -> F64:
        """Moments (K, nodes) of what nodes scatter per length."""
        out = np.empty((len(self.world.ell), self.world.nodes), self.element)
        moments = np.zeros_like(out) if moments is None else moments
        lit = np.zeros(self.world.nodes, self.element) if lit is None else lit
        in_threads(scatter, *self._lighting(lit, scattering), self._levels(moments), self._levels(out))
        return out

    def _levels(self, field: F64) -> F64:
        """(..., nz, columns) of (..., nodes)."""
        return field.reshape(*field.shape[:-1], self.world.shape[0], -1)

    def _lighting(self, lit: F64, scattering: F64) -> tuple[I64, F64, F64, F64]:
        """What `moments.scatter` is told besides the moments."""
        return self.world.ell, self._sun, self._levels(lit), self._levels(scattering)

    def sweep(self, f: Filled, moments: F64 | None) -> Swept:
        """The light after a sweep; moments: before it; None: dark."""
        seen, taken, flux, ground = self._swept(f, moments, True)
        by = self._taken(taken, seen[0])
        return Swept(seen * by.ratio, seen, flux, ground, by)

    def changed(self, f: Filled, about: Swept, moments: F64) -> Swept:
        """Change of a sweep with the moments before it, about its value."""
        seen, taken, flux, ground = self._swept(f, moments, False)
        return Swept(self._change(about, seen, taken), seen, flux, ground)

    def _taken(self, more: F64, mean: F64) -> Taken:
        """Of what steps take ``more`` of the mean radiance than nodes have (nodes,)."""
        out = Taken(np.empty_like(mean), np.empty_like(mean), np.empty_like(mean))
        in_threads(bounded, more, mean, *out)
        return out

    def _change(self, about: Swept, seen: F64, taken: F64) -> F64:
        """Of the moments, from that of what is ``seen`` and of what steps take of the mean radiance."""
        assert about.taken is not None
        out = np.empty_like(seen)
        in_threads(around, about.taken, about.seen, seen, taken, out)
        return out

    def _swept(self, f: Filled, moments: F64 | None, lit: bool) -> tuple[F64, F64, F64, F64]:
        """What is seen, how much more of the mean radiance steps take, flux and ground after a sweep; lit by beam and
        inflow, or the linear part alone."""
        w = self.world
        scattered = self._scattered(f.scattering, moments, f.lit if lit else None)
        seen, taken, flux = np.zeros_like(scattered), np.zeros_like(scattered[:1]), np.zeros(w.columns)
        emission, light, more = self._fields(3)
        inflow = f.inflow if lit else np.zeros_like(f.inflow)
        ground = np.zeros(w.columns)
        for first, last in ((0, w.down), (w.down, len(w.weight))):
            if first:
                ground = f.albedo * (flux + f.direct if lit else flux) / w.unit
            for some in self._batches(first, last):
                n = some.stop - some.start
                in_threads(emit, self._harmonics[some], scattered, emission[:n])
                light_from = Sources(emission[:n], inflow[some], ground)
                given = (self._grid, w.direction[some], f.ext, self._steps(f, some))
                in_threads(carry, *given, light_from, light[:n], more[:n], None)
                in_threads(gather, self._gathered[some].T.copy(), light[:n], seen)
                in_threads(gather, self._gathered[some, :1].T.copy(), more[:n], taken)
                for b in range(n if not first else 0):
                    flux += w.per_flux[some.start + b] * light[b, w.ground_nodes]
        return seen, taken[0], flux, ground

    def tangent(self, f: Filled, about: Swept, d: Change) -> Swept:
        """Change of a lit sweep with what is at the nodes; the moments before it, which ``about`` has, stay."""
        w, moments = self.world, about.moments
        ext, scattering, lit = (a.astype(self.element) for a in d[:3])
        d = d._replace(ext=ext, scattering=scattering, lit=lit)
        scattered, d_scattered = (self._scattered(a, moments, f.lit) for a in (f.scattering, d.scattering))
        d_scattered += self._scattered(f.scattering, None, d.lit)
        seen, taken = np.zeros_like(scattered), np.zeros_like(scattered[:1])
        flux, d_flux, ground, d_ground = (np.zeros(w.columns) for _ in range(4))
        emission, d_emission, light, d_light, d_more = self._fields(5)
        for first, last in ((0, w.down), (w.down, len(w.weight))):
            if first:
                ground = f.albedo * (flux + f.direct) / w.unit
                d_ground = (d.albedo * (flux + f.direct) + f.albedo * (d_flux + d.direct)) / w.unit
            for some in self._batches(first, last):
                n = some.stop - some.start
                in_threads(emit, self._harmonics[some], scattered, emission[:n])
                in_threads(emit, self._harmonics[some], d_scattered, d_emission[:n])
                given = (self._grid, w.direction[some], f.ext, self._steps(f, some))
                light_from = Sources(emission[:n], f.inflow[some], ground)
                in_threads(carry, *given, light_from, light[:n], d_more[:n], None)
                changes_from = Sources(d_emission[:n], 0.0 * f.inflow[some], d_ground)
                about_light = About(emission[:n], light[:n], d.ext)
                in_threads(carry, *given, changes_from, d_light[:n], d_more[:n], about_light)
                in_threads(gather, self._gathered[some].T.copy(), d_light[:n], seen)
                in_threads(gather, self._gathered[some, :1].T.copy(), d_more[:n], taken)
                for b in range(n if not first else 0):
                    flux += w.per_flux[some.start + b] * light[b, w.ground_nodes]
                    d_flux += w.per_flux[some.start + b] * d_light[b, w.ground_nodes]
        return Swept(self._change(about, seen, taken[0]), seen, d_flux, d_ground)

    def transposed(
        self, f: Filled, about: Swept, bar: F64 | None, seen_bar: F64 | None = None, ground_bar: F64 | None = None,
        flux_bar: F64 | None = None, gradient: bool = False,
    ) -> tuple[F64, Change | None]:  # fmt: skip
        """Bars of the moments before a sweep from those of what it makes, about its value, but with the moments before
        it; gradient: of `Filled` as well.
        """
        value = about if gradient else None
        seen_bar, taken_bar = self._before_ratio(about, bar, seen_bar)
        w = self.world
        by_ground = np.zeros(w.columns) if ground_bar is None else ground_bar.copy()
        by_flux = np.zeros(w.columns) if flux_bar is None else flux_bar.copy()
        source_bar = np.zeros((len(w.ell), w.nodes), self.element)
        light_bar, more_bar, emission_bar, *more = self._fields(3 if value is None else 7)
        ground_bars = np.empty((len(light_bar), w.columns))
        ext_bar = np.zeros(w.nodes)
        if value is not None:
            scattered = self._scattered(f.scattering, value.moments, f.lit)
            emission, light, mean, ext_bars = more
        for first, last in ((w.down, len(w.weight)), (0, w.down)):
            if not first:
                by_flux += f.albedo / w.unit * by_ground
            for some in self._batches(first, last):
                n = some.stop - some.start
                for bars, of_light in ((taken_bar, more_bar), (seen_bar, light_bar)):
                    if bars is None:
                        of_light[:n] = 0.0
                    else:
                        in_threads(emit, self._gathered[some, : len(bars)].copy(), bars, of_light[:n])
                for b in range(n if not first else 0):
                    light_bar[b, w.ground_nodes] += w.per_flux[some.start + b] * by_flux
                given = (self._grid, w.direction[some], f.ext)
                bars_of = Bars(light_bar[:n], more_bar[:n], emission_bar[:n], ground_bars[:n])
                if value is None:
                    in_threads(carry_transposed, *given, self._steps(f, some), bars_of, None)
                else:
                    in_threads(emit, self._harmonics[some], scattered, emission[:n])
                    light_from = Sources(emission[:n], f.inflow[some], value.ground)
                    in_threads(carry, *given, self._steps(f, some), light_from, light[:n], mean[:n], None)
                    lit = Lit(emission[:n], light[:n], ext_bars[:n])
                    in_threads(carry_transposed, *given, self._steps(f, some), bars_of, lit)
                    for b in range(n):
                        ext_bar += ext_bars[b, : w.nodes]
                in_threads(gather, self._harmonics[some].T.copy(), emission_bar[:n], source_bar)
                for b in range(n if first else 0):
                    by_ground += ground_bars[b]
        if value is None:
            return self._before(f, source_bar), None
        scattering_bar, lit_bar = np.zeros(f.scattering.shape), np.zeros(w.nodes)
        in_threads(
            scatter_transposed, *self._lighting(f.lit, f.scattering), *map(self._levels, (value.moments, source_bar)),
            *map(self._levels, (scattering_bar, lit_bar)),
        )  # fmt: skip
        albedo_bar = (value.flux + f.direct) / w.unit * by_ground
        change = Change(ext_bar, scattering_bar, lit_bar, albedo_bar, f.albedo / w.unit * by_ground)
        return source_bar, change

    def _before_ratio(self, about: Swept, bar: F64 | None, seen_bar: F64 | None) -> tuple[F64 | None, F64 | None]:
        """Bars of what is seen and of what steps take of the mean radiance (1, nodes)."""
        if bar is None:
            return seen_bar, None
        assert about.taken is not None
        of_seen, of_taken = np.zeros_like(bar) if seen_bar is None else seen_bar.copy(), np.empty_like(bar[:1])
        in_threads(around_transposed, about.taken, about.seen, bar, of_seen, of_taken[0])
        return of_seen, of_taken

    def _before(self, f: Filled, source_bar: F64) -> F64:
        """Bars of moments from those of what they make nodes scatter."""
        for k, ell in enumerate(self.world.ell):
            source_bar[k] *= f.scattering[ell]
        return source_bar
