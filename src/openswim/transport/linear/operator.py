"""The linear core: what eyes and pyranometers see of extinction at nodes, with tangent linear and adjoint.

    core = LinearCore(world, scatterers, views, points)         # frozen; see `of_matter.core_of`
    images, state = core.forward(extinction, albedo)            # Images, State
    change = core.tangent(state, d_extinction, d_albedo)        # Images: J v
    extinction_bar, albedo_bar = core.adjoint(state, residual)  # J^T r, residual: Images

extinction (w, k, nz, ny, nx), 1/m: of scatterer class k (``core.names``) at the wavelength w (``core.wavelengths_nm``),
at the nodes of ``core.shape`` = (nz, ny, nx); albedo (w, ny, nx) of the Lambertian ground. A `SceneCore` has those of
its scene, ``core.extinction`` and ``core.albedo``. `Images`: radiance, a list of (w, rays), one a view;
ghi (w, points). ``d_albedo`` may be None. A `State` holds what a linearisation needs; it may be kept, several at once.
Everything else is held fixed: see docs/linear.md.

    depth to the sun          d = R beta + what lies beyond the grid          linear
    beam                      T = e^-d; T_lit by what cells take of it
    diffuse moments           m = G(m, beta), K its slope by m                a fixed point of sweeps
    at the nodes              n: moments of the same sweep's light there, which eyes see
    ground                    F = flux down, G = albedo (mu0 T + F)/unit      of the same sweep
    eye rays                  y = march(beta, J(n), root of T and its bend within cells, forward depth, G)

Tangent linear and adjoint differentiate the fixed point implicitly: they solve (1 - K) dm = dK m + db and
(1 - K)^T lambda = what eyes and ground ask of m, by sweeps of their own.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from openswim.errors import UserError
from openswim.transport.engine.kernel_cache import drop_stale
from openswim.transport.engine.threads import in_threads
from openswim.transport.linear import beam_taken
from openswim.transport.linear.anderson import MOST, Asked, Solved, added, ahead, begun, fixed_point, norm
from openswim.transport.linear.diffuse import KEEP_BYTES, Change, Filled, Sweeps, Swept
from openswim.transport.linear.images import Images
from openswim.transport.linear.march import Between, Matter, channels, march
from openswim.transport.linear.march_slopes import march_tangent, march_transposed
from openswim.transport.linear.moments import Eye, toward, toward_transposed, ways_to
from openswim.transport.linear.optics import Optics, Scatterer, mixed, optics_of
from openswim.transport.linear.rays import View
from openswim.transport.linear.sun_depth import (
    TEAMS,
    bends,
    bends_tangent,
    bends_transposed,
    depths,
    depths_transposed,
    summed,
)
from openswim.transport.linear.world import World

drop_stale("openswim.transport.linear", alone=True)  # `transport` has not seen these kernels: it does not import them

F64 = NDArray[np.float64]

TOLERANCE = 1e-3  # of a sweep's change, over what light is scattered once; of changes and bars, over what is given


@dataclass(eq=False)
class OneState:
    """A forward run at one term: extinction (k, nodes), what it fills nodes with, the beam, depths to the sun through
    the grid, by how much these bend within cells (nodes, 3), forward depths (nodes,), the converged sweep with the
    moments before it, how many sweeps that took, and how much is scattered after one sweep from the dark, to which its
    tolerance is. solved: it and the states that it was begun from; earlier: what adjoints of these were asked; asked:
    the last of its own."""

    extinction: F64
    filled: Filled
    beam: F64
    depth: F64
    bends: F64
    forward_depth: F64
    swept: Swept
    sweeps: int
    size: float
    solved: tuple[Solved, ...]
    earlier: tuple[Asked, ...] = ()
    asked: Asked | None = None


@dataclass(eq=False)
class State:
    """A forward run, term by term. sweeps: of the forward run; ``tangent_sweeps`` and ``adjoint_sweeps`` of the last
    that were asked for."""

    terms: list[OneState]
    tangent_sweeps: list[int] = field(default_factory=list)
    adjoint_sweeps: list[int] = field(default_factory=list)

    @property
    def sweeps(self) -> list[int]:
        return [one.sweeps for one in self.terms]


class LinearCore:
    """H of one world and some eyes. points (n, 2): fractional row and column of pyranometers on the ground.

    terms (nt, w): shares of what is solved for in the wavelengths; None where they are the same.
    """

    def __init__(
        self, world: World, scatterers: Sequence[Scatterer], views: Sequence[View] = (), points: F64 | None = None,
        wavelengths_nm: F64 | None = None, terms: F64 | None = None, tolerance: float = TOLERANCE, memory: int = 3,
        most_sweeps: int = 200, element: type[np.floating] = np.float64,
    ) -> None:  # fmt: skip
        self.world, self.views = world, list(views)
        self.names = tuple(one.name for one in scatterers)
        count = len(world.inflow)
        self.wavelengths_nm = np.arange(count, dtype=float) if wavelengths_nm is None else wavelengths_nm
        self.terms = np.eye(count) if terms is None else terms
        self.tolerance, self.memory, self.most_sweeps = tolerance, memory, most_sweeps
        self.optics: list[Optics] = [optics_of(scatterers, term, world.degree) for term in range(count)]
        self._which = self.terms.argmax(axis=1)
        self._sweeps = Sweeps(world, element)
        self._kept_ways: dict[View, F64] = {}
        bytes_each = count * len(world.ell) * world.nodes * np.dtype(element).itemsize
        self._most = max(1, min(MOST, KEEP_BYTES // bytes_each))
        self._shape = np.array(world.shape, np.int64)
        self._columns, self._shares = _corners(np.zeros((0, 2)) if points is None else np.asarray(points, float), world)

    @property
    def shape(self) -> tuple[int, int, int]:
        return self.world.shape

    # -- forward ---------------------------------------------------------------------------------------------------
    def forward(self, extinction: F64, albedo: F64 | float = 0.0, start: State | None = None) -> tuple[Images, State]:
        """What is seen of extinction (w, k, nz, ny, nx) over albedo (w, ny, nx); start: a state to begin from."""
        every, of_ground = self._extinction(extinction), self._albedo(albedo)
        states = [
            self._solve(term, every[w], of_ground[w], None if start is None else start.terms[term])
            for term, w in enumerate(self._which)
        ]
        return self._images([self.observe(term, one) for term, one in enumerate(states)]), State(states)

    def _solve(self, term: int, extinction: F64, albedo: F64, start: OneState | None) -> OneState:
        w, optics, element = self.world, self.optics[term], self._sweeps.element
        filled = Filled(
            (mixed(optics.scaled, extinction) + self._gas(term)).astype(element),
            mixed(optics.low.T, extinction).astype(element),
            np.zeros(w.nodes, element), albedo, np.zeros(w.columns), w.inflow[term],
        )  # fmt: skip
        depth = self._depth(optics, extinction)
        of_grid = depth[:, 0].copy()
        if w.more_depth is not None:
            depth[:, 0] += w.more_depth[term].ravel()
        if w.more_forward is not None:
            depth[:, 1] += w.more_forward[term].ravel()
        beam = np.exp(-depth[:, 0])
        filled.lit = beam_taken.lit(self._grid(beam), self._grid(filled.ext), *self._cells).ravel().astype(element)
        filled.direct = w.per_beam_on_slopes(term) * beam[w.ground_nodes]
        self._sweeps.keep_steps(filled)
        swept, sweeps = self._sweeps.sweep(filled, None) if start is None else start.swept, 0

        solved = () if start is None else start.solved
        first = ahead(solved, filled.ext) if solved else swept.moments
        size = norm(first) if start is None else start.size

        def lit_sweep(moments: F64, _: float) -> F64:
            nonlocal swept, sweeps
            swept = self._sweeps.sweep(filled, moments)
            sweeps += 1
            return swept.moments

        image, before = fixed_point(lit_sweep, first, self.tolerance * size, self.most_sweeps, self.memory)
        swept = swept._replace(moments=before)
        earlier = () if start is None else (*start.earlier, *([start.asked] if start.asked else []))
        return OneState(
            extinction, filled, beam, of_grid, bends(w, of_grid, mixed(optics.scaled, extinction)),
            np.ascontiguousarray(depth[:, 1]), swept, sweeps + (start is None), size,
            (*solved, Solved(filled.ext, image))[-self._most :], earlier[-self._most :],
        )  # fmt: skip

    def observe(self, term: int, one: OneState, views: Sequence[View] | None = None) -> tuple[list[F64], F64]:
        """What views, the core's own if none are given, and pyranometers see of a state at a term."""
        w, found = self.world, []
        fields = self._fields(one.extinction, np.sqrt(one.beam), one.forward_depth)
        between = Between(fields, one.bends)
        for view in self.views if views is None else views:
            self._toward(view, term, one.swept.seen, fields)
            out = np.empty(len(view))
            in_threads(march, view.sent(term), self._matter(term, one), between, out)
            found.append(out)
        ghi = w.per_beam(term) * one.beam[w.ground_nodes] + one.swept.flux
        return found, self._at_points(ghi)

    # -- tangent linear --------------------------------------------------------------------------------------------
    def tangent(
        self, state: State, d_extinction: F64, d_albedo: F64 | float | None = None, tolerance: float | None = None
    ) -> Images:
        """J v: changes of the images with changes of extinction and albedo about a state."""
        every = self._extinction(d_extinction)
        of_ground = self._albedo(0.0 if d_albedo is None else d_albedo)
        state.tangent_sweeps = []
        found = []
        for term, w in enumerate(self._which):
            one = state.terms[term]
            changes, sweeps = self._tangent(term, one, every[w], of_ground[w], tolerance or self.tolerance)
            state.tangent_sweeps.append(sweeps)
            found.append(changes)
        return self._images(found)

    def _tangent(
        self, term: int, one: OneState, d_extinction: F64, d_albedo: F64, tolerance: float
    ) -> tuple[tuple[list[F64], F64], int]:
        w, optics, f = self.world, self.optics[term], one.filled
        d_depth = self._depth(optics, d_extinction)
        d_ext, d_beam = mixed(optics.scaled, d_extinction), -one.beam * d_depth[:, 0]
        d_lit = beam_taken.lit_tangent(
            self._grid(one.beam), self._grid(f.ext), *self._cells, self._grid(d_beam), self._grid(d_ext)
        ).ravel()  # fmt: skip
        d_direct = w.per_beam_on_slopes(term) * d_beam[w.ground_nodes]
        change = Change(d_ext, mixed(optics.low.T, d_extinction), d_lit, d_albedo, d_direct)
        by_values = self._sweeps.tangent(f, one.swept, change)
        by_moments, sweeps = self._changed(one, by_values.moments, tolerance)
        d_seen, d_flux = by_values.seen + by_moments.seen, by_values.flux + by_moments.flux
        root = np.sqrt(one.beam)
        fields = self._fields(one.extinction, root, one.forward_depth)
        d_fields = self._fields(d_extinction, -0.5 * root * d_depth[:, 0], d_depth[:, 1])
        ext = mixed(optics.scaled, one.extinction)
        d_bends = bends_tangent(w, one.depth, ext, np.ascontiguousarray(d_depth[:, 0]), d_ext)
        found = []
        for view in self.views:
            self._toward(view, term, one.swept.seen, fields)
            self._toward(view, term, d_seen, d_fields)
            out = np.empty(len(view))
            in_threads(
                march_tangent, view.sent(term), self._matter(term, one), Between(fields, one.bends),
                Between(d_fields, d_bends), by_values.ground + by_moments.ground, out,
            )  # fmt: skip
            found.append(out)
        return (found, self._at_points(w.per_beam(term) * d_beam[w.ground_nodes] + d_flux)), sweeps + 1

    def _changed(self, one: OneState, given: F64, tolerance: float) -> tuple[Swept, int]:
        """The sweep of the change of moments x = K x + given, and how many sweeps that took."""
        sweeps, swept = 0, None

        def sweep(x: F64, _: float) -> F64:
            nonlocal sweeps, swept
            swept = self._sweeps.changed(one.filled, one.swept, x)
            sweeps += 1
            return added(swept.moments, given)

        fixed_point(sweep, given, tolerance * norm(given), self.most_sweeps, self.memory)
        assert swept is not None
        return swept, sweeps

    # -- adjoint ---------------------------------------------------------------------------------------------------
    def adjoint(self, state: State, residual: Images, tolerance: float | None = None) -> tuple[F64, F64]:
        """J^T r: bars of extinction (w, k, nz, ny, nx) and albedo (w, ny, nx) from bars of the images."""
        residual = self._residual(residual)
        count = len(self.wavelengths_nm)
        extinction_bar = np.zeros((count, len(self.names), self.world.nodes))
        albedo_bar = np.zeros((count, self.world.columns))
        state.adjoint_sweeps = []
        for term, w in enumerate(self._which):
            share = self.terms[term]
            bars = [np.ascontiguousarray(share @ bar) for bar in residual.radiance]
            by_term, of_ground, sweeps = self._adjoint(
                term, state.terms[term], bars, share @ residual.ghi, tolerance or self.tolerance
            )
            extinction_bar[w] += by_term
            albedo_bar[w] += of_ground
            state.adjoint_sweeps.append(sweeps)
        return extinction_bar.reshape(count, -1, *self.shape), albedo_bar.reshape(count, *self.shape[1:])

    def _adjoint(
        self, term: int, one: OneState, bars: list[F64], ghi_bar: F64, tolerance: float
    ) -> tuple[F64, F64, int]:
        w, optics, f, kinds = self.world, self.optics[term], one.filled, len(self.names)
        root = np.sqrt(one.beam)
        fields = self._fields(one.extinction, root, one.forward_depth)
        fields_bar, seen_bar = np.zeros_like(fields), np.zeros((len(w.ell), w.nodes), self._sweeps.element)
        by_team = Between(channels(TEAMS, w.nodes, kinds), np.zeros((TEAMS, w.nodes, 3)))
        ground_by_team = np.zeros((TEAMS, w.columns))
        for view, bar in zip(self.views, bars, strict=True):
            self._toward(view, term, one.swept.seen, fields)
            by_team.fields[:] = 0.0
            in_threads(
                march_transposed, view.sent(term), self._matter(term, one), Between(fields, one.bends), bar, by_team,
                ground_by_team, parts=TEAMS,
            )  # fmt: skip
            of_view = summed(by_team.fields)
            in_threads(toward_transposed, self._ways(view), optics.low, of_view, seen_bar)
            fields_bar += of_view
        extinction_bar = np.ascontiguousarray(fields_bar[:, :kinds].T)
        ground_bar = summed(ground_by_team)
        flux_bar, beam_bar = np.zeros(w.columns), np.zeros(w.nodes)
        np.add.at(flux_bar, self._columns, self._shares * ghi_bar[:, None])
        beam_bar[w.ground_nodes] += w.per_beam(term) * flux_bar
        bars_of = seen_bar, ground_bar, flux_bar
        change, sweeps = self._asked(one, bars_of, np.concatenate([*bars, ghi_bar]), tolerance)
        by_lit, ext_bar = beam_taken.lit_transposed(
            self._grid(one.beam), self._grid(f.ext), *self._cells, self._grid(change.lit)
        )  # fmt: skip
        beam_bar += by_lit.ravel()
        beam_bar[w.ground_nodes] += w.per_beam_on_slopes(term) * change.direct
        depth_bar = np.empty((w.nodes, 2))
        depth_bar[:, 0] = -one.beam * beam_bar - 0.5 * root * fields_bar[:, 2 * kinds]
        depth_bar[:, 1] = fields_bar[:, 2 * kinds + 1]
        ext = mixed(optics.scaled, one.extinction)
        by_depth, by_ext = bends_transposed(w, one.depth, ext, summed(by_team.bends))
        depth_bar[:, 0] += by_depth
        ext_bar = change.ext + ext_bar.ravel() + by_ext
        extinction_bar += np.outer(optics.scaled, ext_bar) + mixed(optics.low, change.scattering)
        extinction_bar += self._depth_transposed(optics, depth_bar)
        return extinction_bar, change.albedo, sweeps

    def _asked(self, one: OneState, bars: tuple[F64, F64, F64], residual: F64, tolerance: float) -> tuple[Change, int]:
        """What is asked of `Filled`, through all sweeps, by bars of what eyes see at nodes, of the ground and of the
        flux; and how many sweeps that took, of which the last one, that gathers it, is as dear as two or three."""
        f, change, sweeps, asked_for = one.filled, None, 0, norm(bars[0])
        before = one.earlier[-1] if one.earlier and one.earlier[-1].asked > 0 else None
        if before is not None:
            start, size = begun(one.earlier, residual), before.size * asked_for / before.asked
        else:
            start, _ = self._sweeps.transposed(f, one.swept, None, *bars)
            size, sweeps = norm(start), 1
        wanted = tolerance * size

        def ask(x: F64, expected: float) -> F64:
            nonlocal change, sweeps
            image, change = self._sweeps.transposed(f, one.swept, x, *bars, gradient=not expected > wanted)
            sweeps += 1
            return image

        found, _ = fixed_point(ask, start, wanted, self.most_sweeps, self.memory)
        if change is None:
            ask(found, 0.0)
        assert change is not None
        one.asked = Asked(residual, asked_for, size, found)
        return change, sweeps

    # -- parts -----------------------------------------------------------------------------------------------------
    def _depth(self, optics: Optics, extinction: F64) -> F64:
        """Depths (nodes, 2) to the sun through matter: scaled, and what delta scaling takes off."""
        both = np.stack([optics.scaled, optics.forward])
        return depths(self.world, np.ascontiguousarray(mixed(both, extinction).T))

    def _depth_transposed(self, optics: Optics, bar: F64) -> F64:
        both = depths_transposed(self.world, bar)
        return np.outer(optics.scaled, both[:, 0]) + np.outer(optics.forward, both[:, 1])

    @property
    def _cells(self) -> tuple[tuple[F64, F64, F64], F64]:
        return self.world.speed, beam_taken.SOFT / self.world.least_cell_m

    def _grid(self, nodes: F64) -> F64:
        return nodes.reshape(self.shape)

    def _gas(self, term: int) -> F64:
        return np.repeat(self.world.gas[term], self.world.columns)

    def _fields(self, extinction: F64, root: F64, forward_depth: F64) -> F64:
        """Channels of eye rays, without what is scattered toward an eye."""
        kinds = len(extinction)
        out = channels(self.world.nodes, kinds)
        out[:, :kinds], out[:, 2 * kinds], out[:, 2 * kinds + 1] = extinction.T, root, forward_depth
        return out

    def _eye(self, view: View) -> Eye:
        w = self.world
        return Eye(self._shape, w.levels_m, w.axes, w.place, view.eye, view.parallel)

    def _ways(self, view: View) -> F64:
        """Harmonics (K, nodes) of the ways from an eye to the nodes, those of the core's own eyes kept."""
        if view in self._kept_ways:
            return self._kept_ways[view]
        out = np.empty((len(self.world.ell), self.world.nodes), self._sweeps.element)
        in_threads(ways_to, self._eye(view), out)
        if view in self.views and len(self.views) * out.nbytes <= KEEP_BYTES:
            self._kept_ways[view] = out
        return out

    def _toward(self, view: View, term: int, seen: F64, fields: F64) -> None:
        in_threads(toward, self._ways(view), self.optics[term].low, seen, fields)

    def _matter(self, term: int, one: OneState) -> Matter:
        o = self.optics[term]
        return Matter(self._shape, self.world.gas[term], one.swept.ground, o.table, o.low, o.scaled, o.forward)

    def _at_points(self, of_columns: F64) -> F64:
        return np.asarray((of_columns[self._columns] * self._shares).sum(axis=1))

    def _images(self, found: list[tuple[list[F64], F64]]) -> Images:
        """Of terms those of wavelengths."""
        radiance = [self.terms.T @ np.stack([views[n] for views, _ in found]) for n in range(len(self.views))]
        return Images(radiance, self.terms.T @ np.stack([ghi for _, ghi in found]))

    def _extinction(self, given: F64) -> F64:
        wanted = (len(self.wavelengths_nm), len(self.names), *self.shape)
        if np.shape(given) != wanted:
            raise UserError(
                f"extinction of {np.shape(given)}: give one of {wanted} (wavelength, kind, level, row, column)"
            )
        copied = np.array(given, float, order="C").reshape(*wanted[:2], -1)  # states keep it
        return _finite("extinction", copied)

    def _albedo(self, given: F64 | float) -> F64:
        wanted = (len(self.wavelengths_nm), *self.shape[1:])
        try:
            found = np.array(np.broadcast_to(np.asarray(given, float), wanted), order="C").reshape(wanted[0], -1)
        except ValueError:
            raise UserError(f"albedo of {np.shape(given)}: give one of {wanted} (wavelength, row, column)") from None
        return _finite("albedo", found)

    def _residual(self, given: Images) -> Images:
        """In float64; raises UserError unless it has the form of what this core sees."""
        count = len(self.wavelengths_nm)
        wanted = [(count, len(view)) for view in self.views], (count, len(self._columns))
        remedy = f"give Images of radiance {wanted[0]} and ghi {wanted[1]}, as `forward` does"
        if not isinstance(given, Images):
            raise UserError(f"residual is {type(given).__name__}: {remedy}")
        if ([np.shape(one) for one in given.radiance], np.shape(given.ghi)) != wanted:
            raise UserError(f"residual of radiance {[np.shape(one) for one in given.radiance]} and ghi "
                            f"{np.shape(given.ghi)}: {remedy}")  # fmt: skip
        _finite("residual", given.flat())
        return Images([np.asarray(one, float) for one in given.radiance], np.asarray(given.ghi, float))


def _finite(what: str, values: F64) -> F64:
    """Raise UserError where there are no numbers: sweeps would look for their light in vain."""
    if not np.isfinite(values).all():
        raise UserError(f"{what} has values that are no numbers")
    return values


def _corners(points: F64, world: World) -> tuple[NDArray[np.int64], F64]:
    """Columns and shares (n, 4) around places on the ground."""
    _, ny, nx = world.shape
    j = np.clip(points[:, 0].astype(int), 0, max(ny - 2, 0))
    i = np.clip(points[:, 1].astype(int), 0, max(nx - 2, 0))
    b, a = np.clip(points[:, 0] - j, 0, 1), np.clip(points[:, 1] - i, 0, 1)
    columns = np.stack([j * nx + i, j * nx + i + 1, (j + 1) * nx + i, (j + 1) * nx + i + 1], axis=-1)
    shares = np.stack([(1 - b) * (1 - a), (1 - b) * a, b * (1 - a), b * a], axis=-1)
    return columns.astype(np.int64), shares
