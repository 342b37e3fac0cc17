"""The clear, spherically symmetric atmosphere: slant depths to the sun and the diffuse field.

The paper's Step 2 (Eq. 3) with all orders of scattering: rays from a few levels and solar zenith angles see the
source that the last iteration left, until the field no longer changes.
"""

from __future__ import annotations

from functools import lru_cache
from hashlib import blake2b
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from openswim.optics import Background
from openswim.transport.engine.ordinates import hemisphere_product
from openswim.transport.engine.pack import PACK
from openswim.transport.engine.scalar import harmonics_symmetric
from openswim.transport.engine.types import FLOAT
from openswim.transport.march.forward_peak import forward_share
from openswim.transport.march.march import ground_radiance_rows, march_rays
from openswim.transport.march.sample import SOURCE_AZIMUTHS, SOURCE_ZENITHS
from openswim.transport.march.volume import (
    AIR_DEGREE,
    DEGREE,
    FAR_M,
    PEAK_COSINES,
    SHELL_TABLE_PER_M,
    Shells,
    Volume,
    blank_fields,
    reach,
    tidy,
)

Array = NDArray[np.float64]

_LEVELS_M = np.concatenate(
    [
        np.arange(0, 4000, 200),
        np.arange(4000, 8000, 250),
        np.arange(8000, 12000, 500),
        np.arange(12000, 30000, 1000),
        np.arange(30000, 60000, 2500),
        np.arange(60000, 100001, 5000),
    ]
).astype(float)
_MOMENT_LEVELS_M = np.array(
    [0, 300, 600, 1000, 1500, 2000, 3000, 4000, 5000, 6000, 8000, 10000, 12000, 14000, 17000, 20000, 24000, 28000,
     33000, 40000, 50000, 65000, 80000, 100000], float
)  # fmt: skip
# Depth of a layer between these from which on it is halved, at most so many times: haze of a depth of 3 that absorbs
# nothing keeps 98 % of its light, with whole layers 95
_THICK, _HALVINGS = 0.2, 3
# Depth of absorption above, under which a wavelength has nothing left to be followed closely: light at 940 and 1378 nm
# is off by .1 % then, at a sixth of the price; oxygen at 760 nm never takes so much
_ABSORBED = 7.0
_SUNS_DEG = np.array(
    [0, 10, 20, 30, 40, 50, 58, 65, 70, 74, 78, 81, 84, 86, 88, 89.5, 91, 92, 93, 94, 95, 96, 97, 98, 99, 100, 101, 102,
     104, 106, 108, 110], float
)  # fmt: skip
_DUSK_DEG, _DUSK_DEX = 91.0, 0.47  # from this zenith angle of the sun on light falls by so much a degree
_SUN_NODES = 160
_HARMONICS = AIR_DEGREE * (AIR_DEGREE + 1) // 2
_ORDINATES = (6, 8)  # cosines in each hemisphere, azimuths in half a circle
_CONVERGED = 1e-3  # change by a round over the light there is, under the sun and at the wavelength where it is largest
_MOST_ITERATIONS = 40
_REMEMBERED = 4  # rounds before the last that tell where light is going
SHINING_M, SHINING_HALF_M = 60e3, 25e3  # where the light of an even sky begins; thick enough for steps in thin air


def no_volume() -> Volume:
    """The absence of a grid, in the shape the kernels take."""
    return Volume(
        chart_origin_m=0.0,
        chart_per_m=1.0,
        chart=np.full((2, 2, 2), -1e9),
        sides_m=np.zeros(4),
        level_origin_m=0.0,
        level_per_m=1.0,
        level_table=np.zeros(2),
        top_m=-1e9,
        cell_m=np.array([1e9, 1e9], FLOAT),
        levels_m=np.array([0.0, 1e9], FLOAT),
        periodic=False,
        shining=False,
        peak_inner=PEAK_COSINES[0],
        peak_outer=PEAK_COSINES[1],
        species=0,
        cloud_channel=0,
        free=np.zeros((1, 1, 1), np.uint32),
        fields=blank_fields((1, 1, 1), 1),
        scaled=np.zeros((1, PACK), FLOAT),
        forward=np.zeros((1, PACK), FLOAT),
        single=np.zeros((0, DEGREE, PACK), FLOAT),
        forward_factors=np.zeros((0, PACK), FLOAT),
        bend=np.zeros((0, 1, 1, PACK), FLOAT),
        per_extinction=False,
        turning=np.zeros((0, DEGREE * DEGREE, PACK), FLOAT),
        turning_row=np.zeros((1, 1, 1), np.int32),
        air=np.zeros((2, 4 * PACK), FLOAT),
        haze_depth=np.zeros((2, PACK), FLOAT),
        terrain_m=np.zeros((1, 1), FLOAT),
        steep=np.zeros((1, 1), FLOAT),
    )


def fractional_index(nodes: Array, query: Array) -> Array:
    """Fractional index of ``query`` in ascending ``nodes``, clamped to the ends."""
    return np.interp(query, nodes, np.arange(len(nodes), dtype=float))


def slant_depths(coefficient_per_m: Array, levels_m: Array, radius_m: float, ground_m: float) -> Array:
    """Slant optical depth to space (nl, _SUN_NODES, nw) of a profile (nl, nw), by straight rays through shells.

    The sun axis is the square root of the cosine above the local horizon; rays reach the top without touching the
    ground. Error below 0.2 % of the depth (midpoint rule in the square root of the height above the lowest point).
    """
    ways = _ways_to_space(np.asarray(levels_m, float).tobytes(), radius_m, ground_m)
    return np.einsum("ktl,lw->ktw", ways, np.asarray(coefficient_per_m, float))  # the bits of @ depend on threads


@lru_cache(maxsize=4)  # all lights of a scene, and all times of a film, go through the same shells
def _ways_to_space(levels: bytes, radius_m: float, ground_m: float) -> Array:
    """(nl, _SUN_NODES, nl): metres of the way to space that the value at each level stands for."""
    levels_m = np.frombuffer(levels)
    r_ground, count = radius_m + ground_m, len(levels_m)
    t = np.linspace(0, 1, _SUN_NODES)
    out = np.zeros((count, _SUN_NODES, count))
    top = levels_m[-1]
    row = np.arange(_SUN_NODES)[:, None] * count
    for k, above in enumerate(levels_m):
        r = r_ground + above
        mu_h = -np.sqrt(max(0.0, 1 - (r_ground / r) ** 2))
        mu = mu_h + t**2 * (1 - mu_h)
        # path length, measured from the lowest point: s0 at the node, s1 at the top
        q = above * (2 * r_ground + above)
        s0 = mu * r
        s1 = np.sqrt(np.maximum(s0**2 + (top * (2 * r_ground + top) - q), 0))
        steps = 240
        # equal steps in a coordinate that is fine where the path is near its lowest point
        u = (np.arange(steps) + 0.5) / steps
        a, b = np.cbrt(s0 / 1e4), np.cbrt(np.maximum(s1, s0) / 1e4)
        v = a[:, None] + (b - a)[:, None] * u
        s = 1e4 * v**3
        ds = 3e4 * v**2 * (b - a)[:, None] / steps
        rr = s**2 - s0[:, None] ** 2 + q  # (R_ground + h)^2 - R_ground^2
        height = np.maximum(rr, 0) / (np.sqrt(r_ground**2 + np.maximum(rr, 0)) + r_ground)
        place = fractional_index(levels_m, height)
        below = np.minimum(place.astype(np.intp), count - 2)
        for level, share in ((below, 1 - (place - below)), (below + 1, place - below)):
            added = np.bincount((row + level).ravel(), (share * ds).ravel(), _SUN_NODES * count)
            out[k] += added.reshape(_SUN_NODES, count)
    out.flags.writeable = False
    return out


def build_shells(
    background: Background | None,
    sun_range_deg: tuple[float, float],
    radius_m: float,
    ground_m: float,
    ground_albedo: ArrayLike,
    top_m: float,
    scale: float = 1.0,
) -> Shells:
    """Shells with their diffuse field, at PACK wavelengths, for suns between two zenith angles (degrees).

    ``background``: optical profile on `shell_levels`, or None for vacuum.
    """
    nw = PACK
    albedo = np.broadcast_to(np.asarray(ground_albedo, float), (nw,)).astype(FLOAT)
    suns = _SUNS_DEG[
        max(0, np.searchsorted(_SUNS_DEG, sun_range_deg[0], "right") - 1) : np.searchsorted(
            _SUNS_DEG, sun_range_deg[1], "left"
        )
        + 1
    ]
    if len(suns) < 2:
        suns = _SUNS_DEG[-2:]
    sun_mu = np.cos(np.radians(suns[::-1]))
    sun_table = _sun_table(suns[::-1])
    flux = np.repeat(np.maximum(sun_mu, 0)[:, None], nw, 1)
    if background is None:
        levels = np.array([0.0, max(top_m - ground_m, 1.0)])
        return tidy(Shells(
            radius_m, ground_m, top_m, fractional_index(levels, np.arange(0, levels[1] + 100, 100.0)),
            np.full(1, FAR_M), np.zeros((2, 4 * nw), FLOAT), np.zeros((2, AIR_DEGREE, nw), FLOAT),
            np.zeros((2, 2, 2 * nw), FLOAT), _horizon(levels, radius_m, ground_m), sun_table,
            np.zeros((0, len(suns), _HARMONICS, nw), FLOAT),
            np.zeros((2, len(suns), SOURCE_ZENITHS, SOURCE_AZIMUTHS, nw), FLOAT), flux.astype(FLOAT), albedo,
        ))  # fmt: skip
    levels = shell_levels()
    aerosol = background.aerosol_per_m.T
    scattered = background.aerosol_scattering_per_m.T
    f, phase = phase_moments(background)
    rayleigh = background.rayleigh_per_m.T
    forward = scattered * f
    extinction = rayleigh + background.absorption_per_m.T + aerosol - forward
    rows = np.concatenate([extinction, rayleigh, scattered, forward], axis=1).astype(FLOAT)
    slant = slant_depths(np.concatenate([extinction, forward], axis=1), levels, radius_m, ground_m)
    level_table = fractional_index(levels, np.arange(0, levels[-1] + 100, 1 / SHELL_TABLE_PER_M))
    # below FAR_M, which stands for vacuum, also at the very top, where rays from space begin
    reach_table = np.minimum(np.interp(level_table, np.arange(len(levels)), reach(still_lit(rows))), 0.5 * FAR_M)
    shells = Shells(
        radius_m, ground_m, ground_m + levels[-1], level_table, reach_table, rows,
        phase.astype(FLOAT),
        slant.astype(FLOAT), _horizon(levels, radius_m, ground_m), sun_table,
        np.zeros((len(moment_levels(rows)), len(suns), _HARMONICS, nw), FLOAT),
        np.zeros((len(levels), len(suns), SOURCE_ZENITHS, SOURCE_AZIMUTHS, nw), FLOAT), flux.astype(FLOAT), albedo,
    )  # fmt: skip
    return _solve(_Unlit(tidy(shells), phase, sun_mu, scale, background.starlit))


def phase_moments(background: Background) -> tuple[Array, Array]:
    """Share (nw,) of aerosol's scattering that delta scaling takes off, and the Legendre moments (2, moment, nw) of
    molecules and, scaled, of aerosol."""
    chi = np.array([p.moments(AIR_DEGREE + 1) for p in background.aerosol_phase])
    chi_r = np.zeros(AIR_DEGREE)
    chi_r[:3] = background.rayleigh_phase.moments(3)
    f = forward_share(chi, AIR_DEGREE)
    return f, np.stack([np.repeat(chi_r[:, None], PACK, 1), (chi[:, :AIR_DEGREE] - f[:, None]).T])


def _sun_table(suns_deg: Array) -> Array:
    """Fractional index in descending zenith angles of suns for cosines from -1 to 1: between suns light is linear in
    the cosine, and in twilight falls from one to the next as fast as it usually does."""
    mu = np.linspace(-1, 1, 4001)
    index = fractional_index(np.cos(np.radians(suns_deg)), mu)
    low = np.minimum(index.astype(int), len(suns_deg) - 2)
    dark, bright = suns_deg[low], suns_deg[low + 1]
    gain = 10 ** (_DUSK_DEX * (dark - bright))
    part = np.clip((dark - np.degrees(np.arccos(mu))) / (dark - bright), 0, 1)
    return np.asarray(np.where(bright >= _DUSK_DEG, low + (gain**part - 1) / (gain - 1), index))


def _even_sky(shape: tuple[int, ...]) -> NDArray[np.float32]:
    """What air that shines above nearly all that scatters adds to `Shells.source` (``shape``), so that eyes below see a
    sky of L' = 1 wherever they look up: in each layer as much as its way is short."""
    shine_per_m = np.maximum(1 - np.abs(shell_levels() - SHINING_M) / SHINING_HALF_M, 0) / SHINING_HALF_M
    rising = np.maximum(np.linspace(-1, 1, SOURCE_ZENITHS), 0)
    return np.broadcast_to((shine_per_m[:, None] * rising)[:, None, :, None, None], shape).astype(FLOAT)


@lru_cache
def _toward_nodes() -> NDArray[np.float32]:
    """Harmonics (node, harmonic) toward the directions of `Shells.source`."""
    basis = np.empty((SOURCE_ZENITHS * SOURCE_AZIMUTHS, _HARMONICS))
    nodes = ((mu, x) for mu in np.linspace(-1, 1, SOURCE_ZENITHS) for x in np.linspace(-1, 1, SOURCE_AZIMUTHS))
    for row, (mu, x) in zip(basis, nodes, strict=True):
        harmonics_symmetric(mu, x, AIR_DEGREE, row)
    return basis.astype(FLOAT)


def source_of(shells: Shells, moments: NDArray[np.float32], phase: Array) -> NDArray[np.float32]:
    """What the shells scatter of the diffuse field ``moments``: `Shells.source`. ``phase``: (2, moment, nw), Legendre
    moments of molecules and delta-scaled ones of aerosol."""
    index = fractional_index(moment_levels(shells.rows), shell_levels())
    k = np.minimum(index.astype(int), len(moments) - 2)
    share = (index - k).astype(FLOAT)[:, None, None, None]
    field = moments[k] * (1 - share) + moments[k + 1] * share
    order = np.repeat(np.arange(AIR_DEGREE), np.arange(AIR_DEGREE) + 1)
    molecules, aerosol = shells.rows[:, None, PACK : 2 * PACK], shells.rows[:, None, 2 * PACK : 3 * PACK]
    of_molecules, of_aerosol = phase.astype(FLOAT)
    scattered = field * (molecules * of_molecules + aerosol * of_aerosol)[:, None, order]
    toward = np.tensordot(scattered, _toward_nodes(), axes=([2], [1]))
    return np.ascontiguousarray(np.moveaxis(toward, -1, 2).reshape(shells.source.shape), FLOAT)


def _horizon(levels: Array, radius_m: float, ground_m: float) -> Array:
    """Cosine of the zenith angle of the horizon at heights above the ground."""
    r = radius_m + ground_m
    return -np.sqrt(levels * (2 * r + levels)) / (r + levels)


def shell_levels() -> Array:
    """Heights above the ground (m) on which the shells keep their profiles."""
    return _LEVELS_M


def still_lit(rows: NDArray[np.float32]) -> NDArray[np.float32]:
    """Extinction (nl, PACK) of air of ``rows`` (`Shells.rows`) on `shell_levels`, 0 of wavelengths of which the air
    above has absorbed all but e^-7: what they lose below tells neither steps nor levels."""
    extinction, molecules, aerosol, forward = np.split(rows, 4, axis=1)
    absorption = np.maximum(extinction - molecules - (aerosol - forward), 0)
    layers = 0.5 * (absorption[1:] + absorption[:-1]) * np.diff(shell_levels())[:, None]
    above = np.append(np.cumsum(layers[::-1], axis=0)[::-1], np.zeros((1, PACK)), axis=0)
    return np.where(above < _ABSORBED, extinction, FLOAT(0))


def moment_levels(rows: NDArray[np.float32]) -> Array:
    """Heights above the ground (m) at which `Shells.moments` has the light of air of ``rows`` (`Shells.rows`): closer
    where it is thick."""
    densest, levels = still_lit(rows).max(axis=1), _MOMENT_LEVELS_M
    depth = np.append(0.0, np.cumsum(0.5 * (densest[1:] + densest[:-1]) * np.diff(shell_levels())))
    for _ in range(_HALVINGS):
        thick = np.diff(np.interp(levels, shell_levels(), depth)) > _THICK
        levels = np.sort(np.append(levels, 0.5 * (levels[1:] + levels[:-1])[thick]))
    return levels


def beam_transmission(shells: Shells, mu_sun: Array, level: int = 0) -> Array:
    """Delta-scaled transmission (n, nw) from the sun to a level of the shells."""
    r_ground = shells.radius_m + shells.ground_m
    count = shells.sun_depth.shape[1]
    above = _LEVELS_M[level]
    mu_h = -np.sqrt(max(0.0, 1 - (r_ground / (r_ground + above)) ** 2))
    t = np.sqrt(np.clip((mu_sun - mu_h) / (1 - mu_h), 0, 1)) * (count - 1)
    lit = np.clip(0.5 + (mu_sun - mu_h) / 0.0093, 0, 1)
    return np.asarray(np.exp(-rows_between(shells.sun_depth[level], t)) * lit[:, None])


def beam_transmission_at(shells: Shells, mu_sun: Array, above_m: Array) -> Array:
    """`beam_transmission` (n, nw) at heights (n,) above the shells' ground, linear between their levels."""
    level = np.interp(above_m, np.arange(len(shells.level_table)) / SHELL_TABLE_PER_M, shells.level_table)
    lower = np.minimum(level.astype(int), len(shells.sun_depth) - 2)
    out = np.zeros((len(level), shells.sun_depth.shape[2]))
    for k in np.unique(lower):
        some = np.flatnonzero(lower == k)
        low, high = (beam_transmission(shells, mu_sun[some], int(n)) for n in (k, k + 1))
        out[some] = low + (level[some] - k)[:, None] * (high - low)
    return out


def rows_between(table: NDArray[np.float32], index: Array) -> Array:
    """Rows (..., nw) of a table (n, nw) at fractional indices within it."""
    i = np.minimum(index.astype(int), len(table) - 2)
    low = table.astype(float)
    return np.asarray(low[i] + (index - i)[..., None] * (low[i + 1] - low[i]))


class Gathering(NamedTuple):
    """Rays (levels times ordinates, 3) by which the light at the levels of `Shells.moments` is found above the origin,
    where the sun stands over the x axis; by what they make its harmonics (harmonic, ordinate), and the flux (ordinate,)
    down on the ground."""

    origin: Array
    direction: Array
    levels: int
    weighted: NDArray[np.float32]
    down: Array


def gathering(shells: Shells) -> Gathering:
    """Of the light of shells."""
    mu, azimuth, weight = hemisphere_product(*_ORDINATES)
    sine = np.sqrt(1 - mu**2)
    ordinates = np.stack([sine * np.cos(azimuth), sine * np.sin(azimuth), mu], axis=-1)
    basis = np.empty((len(mu), _HARMONICS))
    for row, m, phi in zip(basis, mu, azimuth, strict=True):
        harmonics_symmetric(m, np.cos(phi), AIR_DEGREE, row)
    levels = shells.ground_m + np.maximum(moment_levels(shells.rows), 0.5)
    origin = np.zeros((len(levels) * len(mu), 3))
    origin[:, 2] = np.repeat(levels, len(mu))
    return Gathering(
        origin, np.tile(ordinates, (len(levels), 1)), len(levels),
        np.ascontiguousarray((weight[:, None] * basis).T, FLOAT), weight * np.maximum(mu, 0) / (4 * np.pi),
    )  # fmt: skip


class _Unlit(NamedTuple):
    """Shells before their diffuse field; equal to others where all that this depends on is. ``phase``: see `source_of`,
    ``starlit``: `_even_sky`."""

    shells: Shells
    phase: Array
    sun_mu: Array
    scale: float
    starlit: bool

    def _content(self) -> bytes:
        found = blake2b(repr((self.scale, self.starlit)).encode())
        known = (value for name, value in self.shells._asdict().items() if name not in ("moments", "source"))
        for value in (*known, self.phase, self.sun_mu):
            found.update(np.ascontiguousarray(value).tobytes())
        return found.digest()

    def __hash__(self) -> int:
        return hash(self._content())

    def __eq__(self, other: object) -> bool:
        return isinstance(other, _Unlit) and self._content() == other._content()

    def __ne__(self, other: object) -> bool:
        return not self == other


class _Round(NamedTuple):
    """What an iteration found: `Shells.moments`, the ground's flux (sun, nw), and by how much the mean radiance
    (level, sun, nw) has changed."""

    moments: NDArray[np.float32]
    flux: Array
    change: Array


def _foreseen(rounds: list[_Round]) -> tuple[NDArray[np.float32], Array]:
    """Moments and flux to go on from: that mixture of rounds, wavelength by wavelength, whose change would be least
    (Walker & Ni 2011). Orders of scattering fall nearly alike, so that few tell where they lead."""
    *before, now = rounds
    turns = np.array([now.change - one.change for one in before])
    gram, along = np.einsum("alsw,blsw->wab", turns, turns), np.einsum("alsw,lsw->wa", turns, now.change)
    shares = -np.einsum("wab,wb->aw", np.linalg.pinv(gram, 1e-7, hermitian=True), along)
    moments, flux = now.moments.copy(), now.flux.copy()
    for share, one in zip(shares, before, strict=True):
        moments += share.astype(FLOAT) * (now.moments - one.moments)
        flux += share * (now.flux - one.flux)
    return moments, flux


@lru_cache(maxsize=8)  # pictures, irradiance and the clear sky beside a model ask for the same air
def _solve(unlit: _Unlit) -> Shells:
    """Orders of scattering until the moments settle: rays from every level and sun see what the last round left.

    Peaks are not read: delta-scaled transport keeps them in the beam.
    """
    shells, phase, sun_mu, scale, starlit = unlit
    glow = _even_sky(shells.source.shape) if starlit else None
    if glow is not None:
        shells = shells._replace(source=glow)
    gather = gathering(shells)
    origin, direction, levels = gather.origin, gather.direction, gather.levels
    direct = beam_transmission(shells, sun_mu) * np.maximum(sun_mu, 0)[:, None]
    shells = shells._replace(ground_flux=direct.astype(FLOAT))
    rounds: list[_Round] = []
    for _ in range(_MOST_ITERATIONS):
        moments = np.empty(shells.moments.shape, FLOAT)
        flux = direct.copy()
        for star, mu_sun in enumerate(sun_mu):
            sun = np.array([np.sqrt(max(0.0, 1 - mu_sun**2)), 0.0, mu_sun])
            radiance = clear_radiance(origin, direction, sun, shells, 1.5 * scale).reshape(levels, -1, PACK)
            moments[:, star] = gather.weighted @ radiance
            flux[star] += gather.down @ radiance[0]
        mean = moments[:, :, 0].astype(float)
        rounds = [*rounds, _Round(moments, flux, mean - shells.moments[:, :, 0])][-1 - _REMEMBERED :]
        change = (np.abs(rounds[-1].change).sum(axis=0) / np.maximum(np.abs(mean).sum(axis=0), 1e-30)).max()
        if len(rounds) > 1:
            moments, flux = _foreseen(rounds)
        source = source_of(shells, moments, phase)
        shells = shells._replace(
            moments=moments, source=source if glow is None else source + glow, ground_flux=flux.astype(FLOAT)
        )
        if change < _CONVERGED:
            break
    return tidy(shells)


def clear_radiance(origin: Array, direction: Array, sun: Array, shells: Shells, scale: float) -> NDArray[np.float32]:
    """Delta-scaled radiance (n, PACK) of the shells and of the Lambertian ground below them along rays (n, 3)."""
    seen = march_rays(origin, direction, sun, np.zeros((1, 2, 2, PACK), FLOAT), shells, no_volume(), scale)
    radiance = seen.radiance
    hit = np.flatnonzero(seen.distance_m >= 0)
    place = origin[hit] + direction[hit] * seen.distance_m[hit, None]
    radiance[hit] += seen.scaled[hit] * ground_radiance_rows(place, sun, shells)
    return radiance
