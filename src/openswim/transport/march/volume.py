"""What the march knows of the world: the shells, the gridded volume, and how to find a point's place in them."""

from __future__ import annotations

import math
from typing import Any, NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray

from openswim.transport.engine.compiled import FINITE, part
from openswim.transport.engine.pack import PACK, flat
from openswim.transport.engine.scalar import height_m
from openswim.transport.engine.types import BYTES, FLOAT

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]

SHELL_TABLE_PER_M = 0.01  # the level tables have an entry every 100 m
SUN_RADIUS_RAD = 0.00465
DEGREE = 5  # truncation order M of the smooth field
AIR_DEGREE = 10  # that of the air's aerosol, and moments of the shells' diffuse field, which is narrow near the horizon
PEAK_COSINES = (0.75**0.5, 0.0)  # forward peaks: read out within 30 degrees of the sun, not beyond 90 (fast.md F18)
FAR_M = 1e30  # a distance that no ray meets
STEP_DEPTH = 0.25  # optical depth of air that a step may pass
_OUTSIDE = -1e9
LINE = 64 // BYTES  # numbers in a cache line


class Shells(NamedTuple):
    """The spherically symmetric part of the atmosphere, on levels (nl) above ``ground_m``, at PACK wavelengths."""

    radius_m: float
    ground_m: float
    top_m: float
    level_table: F64  # fractional level per 100 m above the ground
    reach_table: F64  # longest step that the air's depth allows, per 100 m above the ground, m
    rows: F32  # (nl, 4 PACK) 1/m: delta-scaled extinction; scattering of molecules; of aerosol; what scaling takes off
    phase: F32  # (2, AIR_DEGREE, PACK) Legendre moments of molecules, and of aerosol delta-scaled: chi_l - f
    slant: F32  # (nl, n_mu, 2 PACK) delta-scaled, forward depth to the sun; axis sqrt of cosine above the horizon
    horizon: F64  # (nl,) cosine of the zenith angle of the horizon
    moment_sun_table: F64  # fractional index into the suns of `moments` and `source`, by cosine from -1 to 1
    moments: F32  # (nlm, ns, harmonic, PACK) cosine harmonics of the diffuse radiance
    source: F32  # (nl, ns, zenith, azimuth, PACK) what diffuse light is scattered toward `sample.SOURCE_ZENITHS` ...
    ground_flux: F32  # (ns, PACK) total flux reaching the ground below the shells, for E_TOA = 1 (delta-scaled)
    ground_albedo: F32  # (PACK,)

    @property
    def extinction(self) -> F32:
        """Delta-scaled extinction (nl, PACK), 1/m."""
        return self.rows[:, :PACK]

    @property
    def forward(self) -> F32:
        """What delta scaling takes off (nl, PACK): omega f beta of the aerosol, 1/m."""
        return self.rows[:, 3 * PACK :]

    @property
    def scattering(self) -> F32:
        """Legendre moments (nl, M, PACK) of the delta-scaled scattering coefficient, 1/m; `phase` has more."""
        molecules, aerosol = self.rows[:, None, PACK : 2 * PACK], self.rows[:, None, 2 * PACK : 3 * PACK]
        return molecules * self.phase[0, :DEGREE] + aerosol * self.phase[1, :DEGREE]

    @property
    def sun_depth(self) -> F32:
        """Delta-scaled slant depth to the sun (nl, n_mu, PACK)."""
        return self.slant[..., :PACK]

    @property
    def sun_forward(self) -> F32:
        """Slant depth of `forward` (nl, n_mu, PACK)."""
        return self.slant[..., PACK:]


class Volume(NamedTuple):
    """The gridded part: (nz, ny, nx) nodes with channels interleaved, and how to find one's place in it.

    Channels: root of the delta-scaled beam, air included (PACK); smooth source, maybe `per_extinction` (PACK); species
    extinctions; forward depths to the sun; sum of species; padding to whole cache lines.
    """

    chart_origin_m: float  # coordinate of chart[0, 0] on Lambert's azimuthal equal-area map around the scene's origin
    chart_per_m: float
    chart: F64  # (n, n, 2): fractional ix, iy at [row v, column u]
    sides_m: F64  # (4,) least and greatest tangent-plane x, then y, of the domain
    level_origin_m: float
    level_per_m: float
    level_table: F64  # fractional level, uniform in height
    top_m: float
    cell_m: F32  # (2,) nominal dx, dy
    levels_m: F32  # (nz + 1,) heights of the levels, and of one more, above the lowest
    periodic: bool
    shining: bool  # whether the air scatters toward the eye
    peak_inner: float  # cosines of the angles from the sun within which the forward peaks are read out whole,
    peak_outer: float  # and beyond which they are not: see `PEAK_COSINES`
    species: int
    cloud_channel: int
    free: NDArray[np.uint32]  # (nz, ny, nx) see `free_cubes`
    fields: F32  # (nz, ny, nx, channels), see `blank_fields`
    scaled: F32  # (species, PACK) delta-scaled extinction per reference extinction
    forward: F32  # (species, PACK) omega f times relative extinction
    single: F32  # (species, M, PACK) Legendre moments of smooth scattering per reference extinction, of the beam's
    # light at the ray's own place; zero where the sources at the nodes hold it
    forward_factors: F32  # (n, PACK) by which the channels of forward depths are summed at every wavelength
    bend: F32  # (nz, ny, nx, PACK) of the cell beyond each node: c along x, y, z of the depth to the sun, `bend.py`,
    # less that of the square of `fields`' roots, at the first wavelength; of no size where there is nothing to know
    per_extinction: bool  # whether the smooth source is to be multiplied by the delta-scaled extinction, air's included
    turning: F32  # (rows, M^2, PACK) harmonics of the smooth source, by which rays read it in their own direction, in
    # place of the channels' for one eye; the first row is nothing, and where there are none the channels hold
    turning_row: NDArray[np.int32]  # (nz, ny, nx) of a node
    air: F32  # (nz, 4 PACK) `Shells.rows` on the levels
    haze_depth: F32  # (nz, PACK) forward depth of the air to the sun
    terrain_m: F32  # (ny, nx)
    steep: F32  # (ny, nx) bound of the terrain's slope around, see `free.steepness`


def blank_fields(shape: tuple[int, int, int], channels: int) -> F32:
    """Zeros (nz, ny, nx, channels or more), each node in cache lines of its own."""
    whole = -(-channels // LINE) * LINE
    size = int(np.prod(shape)) * whole
    store = np.zeros(size + LINE, FLOAT)
    first = -(store.ctypes.data // BYTES) % LINE
    return store[first : first + size].reshape(*shape, whole)


def reach(extinction: NDArray) -> F64:
    """The longest step (n,) that the extinction (n, PACK) of air allows, m."""
    greatest = extinction.max(axis=-1).astype(float)
    return np.where(greatest > 0, STEP_DEPTH / np.maximum(greatest, STEP_DEPTH / FAR_M), FAR_M)


_Tuple = TypeVar("_Tuple", Shells, Volume)


def tidy(world: _Tuple) -> _Tuple:
    """The same with every array contiguous and writable and every number plain, so that kernels compile once."""

    def one(value: Any) -> Any:
        if isinstance(value, np.ndarray):
            return value if value.flags.c_contiguous and value.flags.writeable else value.copy(order="C")
        return value.item() if isinstance(value, np.generic) else value

    return world._make(one(value) for value in world)


@part(FINITE)
def grid_index(x, y, z, radius_m, volume):
    """Fractional (ix, iy) of a point by the equal-area chart; far outside the domain, a large negative pair."""
    depth = radius_m + z
    r = math.sqrt(x * x + y * y + depth * depth)
    if depth <= -0.99 * r:
        return _OUTSIDE, _OUTSIDE
    q = radius_m * math.sqrt(2.0 / (r * (r + depth)))
    u = (x * q - volume.chart_origin_m) * volume.chart_per_m
    v = (y * q - volume.chart_origin_m) * volume.chart_per_m
    n = volume.chart.shape[0] - 1
    if not volume.periodic and (u < 0.0 or v < 0.0 or u > n or v > n):
        return _OUTSIDE, _OUTSIDE
    i = min(max(int(u), 0), n - 1)
    j = min(max(int(v), 0), n - 1)
    a = u - i
    b = v - j
    c = volume.chart
    here = 2 * (j * (n + 1) + i)
    up = here + 2 * (n + 1)
    w00, w01, w10, w11 = (1 - a) * (1 - b), a * (1 - b), (1 - a) * b, a * b
    ix = flat(c, here) * w00 + flat(c, here + 2) * w01 + flat(c, up) * w10 + flat(c, up + 2) * w11
    iy = flat(c, here + 1) * w00 + flat(c, here + 3) * w01 + flat(c, up + 1) * w10 + flat(c, up + 3) * w11
    return ix, iy


@part(FINITE, inlined=True)
def inside_grid(ix, iy, volume):
    """Whether fractional indices lie in the domain."""
    ny, nx = volume.terrain_m.shape
    return volume.periodic or (ix >= 0.0 and iy >= 0.0 and ix <= nx - 1.0 and iy <= ny - 1.0)


@part(FINITE)
def terrain_height_m(ix, iy, ground_m, volume):
    """Height of the ground at a place of the grid, or of the base of the shells outside it."""
    if volume.periodic or not inside_grid(ix, iy, volume):
        return ground_m
    field = volume.terrain_m
    ny, nx = field.shape
    i = min(max(int(ix), 0), max(nx - 2, 0))
    j = min(max(int(iy), 0), max(ny - 2, 0))
    a, b = ix - i, iy - j
    i1, j1 = min(i + 1, nx - 1), min(j + 1, ny - 1)
    return (field[j, i] * (1 - a) + field[j, i1] * a) * (1 - b) + (field[j1, i] * (1 - a) + field[j1, i1] * a) * b


@part(FINITE)
def above_ground_m(x, y, z, radius_m, ground_m, volume):
    """Height of a point over the terrain, or over the base of the shells outside the grid."""
    ix, iy = grid_index(x, y, z, radius_m, volume)
    return height_m(x, y, z, radius_m) - terrain_height_m(ix, iy, ground_m, volume)


@part(FINITE)
def sphere_crossings(square, rise, height, radius_m):
    """Where along a ray (R + h)^2 - R^2 = square + s (2 rise + s) is that of ``height``: (first, last) s, or FAR_M."""
    target = height * (2.0 * radius_m + height)
    under = square - target
    disc = rise * rise - under
    if disc <= 0.0:
        return FAR_M, FAR_M
    root = math.sqrt(disc)
    # of the two forms of a root the one without cancellation
    if rise > 0.0:
        return -(rise + root), -under / (rise + root)
    return under / (root - rise), root - rise


@part(FINITE)
def way_through(ox, oy, oz, dx, dy, dz, square, rise, radius_m, volume):
    """Between which distances a ray is in the grid, or rather in the cone over its sides below its top: (enter, leave),
    both FAR_M where it never is."""
    enter, leave = 0.0, 0.0
    if volume.fields.shape[0] > 1:
        first, last = sphere_crossings(square, rise, volume.top_m, radius_m)
        if first < FAR_M:
            enter, leave = max(first, 0.0), last
    if not volume.periodic:
        for n in range(5):
            # planes through the Earth's centre: a + s b >= 0 on the domain's side
            if n < 4:
                slope = volume.sides_m[n] / radius_m
                sign = 1.0 - 2.0 * (n % 2)
                a = sign * ((ox if n < 2 else oy) - slope * (radius_m + oz))
                b = sign * ((dx if n < 2 else dy) - slope * dz)
            else:
                a, b = radius_m + oz, dz
            if b > 0.0:
                enter = max(enter, -a / b)
            elif b < 0.0:
                leave = min(leave, a / -b)
            elif a < 0.0:
                leave = 0.0
    if leave <= enter:
        return FAR_M, FAR_M
    return enter, leave
