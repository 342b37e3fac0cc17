"""What water mirrors: the sky of the scene itself, clouds and far shores, smeared by the waves."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from openswim.ground import water
from openswim.scene.rays import Rays
from openswim.transport.engine.pack import PACK
from openswim.transport.engine.types import FLOAT
from openswim.transport.ground_light.relief import Relief
from openswim.transport.lit.lit_grid import LitGrid
from openswim.transport.march.volume import FAR_M

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]

# What rays (n, 3) see as an eye (3,), the image of one under water, would: radiance (n, PACK), lit ground included, and
# the distance (n,) to the ground, or -1.
Look = Callable[[F64, F64, F64], tuple[F32, F64]]

HIGHEST_EYE_M = 30_000.0  # from above, water mirrors 2 % of the sky: the clear one will do
_ROWS, _COLUMNS = 50, 90  # of the mirrored picture, at most
_LEAST_STEP_RAD = np.radians(0.4)  # waves smear over several degrees
_BESIDE_RAD = np.radians(1.0)  # so that this far from its end a mirrored picture is what it is there
_FACETS, _LEAP = 34, 21  # a Fibonacci lattice: off by 1 % rms under a sun of 10 to 40 degrees, 2 % in the glow of dusk
_WIDER = 1.2  # slopes along the line of sight are spread so much wider than waves have them, and weighted accordingly
_LIFT_M = 0.5  # above the ground, that mirrored rays begin
WET = 0.05  # share of water in a pixel from which on what it mirrors is looked at
_LEVEL_M = 10.0  # in steps of which water has its height, as its image of the eye has it
_TOGETHER = 20_000  # rays whose facets are marched together
_ASKED = 60_000  # rays of a picture by which water in it is found, at most
_LOWEST = 0.01  # sine of the altitude: what would be mirrored from below the horizon is seen by way of a second wave


@dataclass(frozen=True)
class Mirrored:
    """The sky that waves mirror to an eye, by azimuth and altitude (rad) there: radiance ``seen`` (altitudes, azimuths,
    PACK), where it is ``known``. Azimuths count from ``start``.

    The mirrored picture is smooth, so it is marched on its own coarse grid of azimuth and altitude at the eye, several
    facets to a node: tilted by Cox & Munk's (1954) slopes, weighted with Fresnel reflectance, the area they show and
    what comes past other waves. Where water is seen all around, nodes go round too.
    """

    up: F64
    axes: F64
    start: float
    azimuth: F64
    altitude: F64
    seen: F64
    known: NDArray[np.bool_]
    beside_rad: float = _BESIDE_RAD

    @classmethod
    def of(cls, look: Look, relief: Relief | None, radius_m: float, eye: F64, wet: WetRays) -> Mirrored:
        """That part of it which is seen along the rays that end on water; ``look``: see `Look`."""
        up = _upward(eye[None], radius_m)[0]
        axes = _horizontal(up)
        azimuth, altitude = _angles(wet.direction, axes, up)
        start = _widest_gap(azimuth)
        turned = (azimuth - start) % (2 * np.pi)
        beside = max(_BESIDE_RAD, wet.beyond_rad)
        if np.ptp(turned) + 2 * beside > 2 * np.pi:
            turned, beside = np.array([0.0, 2 * np.pi]), 0.0
        grid_az, grid_alt = _axis(turned, _COLUMNS, wet.width_rad), _axis(altitude, _ROWS, wet.width_rad)
        level = float(np.median(np.linalg.norm(wet.place + np.array([0.0, 0.0, radius_m]), axis=-1))) + _LIFT_M
        az, alt = (v.ravel() for v in np.meshgrid(grid_az, grid_alt))
        az += start
        toward = np.cos(alt)[:, None] * (np.sin(az)[:, None] * axes[0] + np.cos(az)[:, None] * axes[1])
        toward += np.sin(alt)[:, None] * up
        node = _on_sphere(eye, toward, level, radius_m)
        if relief is not None:  # where no water lies level, it is as high as the ground
            distance = relief.meet(eye[None], toward)
            met = distance < FAR_M
            node[met] = eye + distance[met, None] * toward[met] + _LIFT_M * up
        shape = (grid_alt.size, grid_az.size)
        # all that a level mirror shows is seen from the eye's image under the water
        middle = len(node) // 2
        upright = _upward(node, radius_m)[middle]
        image = eye - 2 * ((eye - node[middle]) @ upright) * upright
        seen, known = _marched(look, radius_m, image, node, toward, np.full(len(node), wet.slope_variance))
        return cls(up, axes, start, grid_az, grid_alt, seen.reshape(*shape, PACK), known.reshape(shape), beside)

    def angles(self, direction: F64) -> tuple[F64, F64]:
        """Azimuth and altitude (n,) as they are counted here."""
        azimuth, altitude = _angles(direction, self.axes, self.up)
        first = float(self.azimuth[0]) - self.beside_rad  # what is a little before the first node is no turn after it
        return (azimuth - self.start - first) % (2 * np.pi) + first, altitude

    def along(self, direction: F64) -> F32:
        """Mean radiance L' (n, PACK) that is mirrored along rays (n, 3); NaN where it is not known."""
        azimuth, altitude = self.angles(direction)
        x = np.interp(azimuth, self.azimuth, np.arange(self.azimuth.size))
        y = np.interp(altitude, self.altitude, np.arange(self.altitude.size))
        return _among(self.seen, self.known, x, y)

    def shows(self, direction: F64) -> NDArray[np.bool_]:
        """Whether rays (n, 3) are among those that it is made for, or just beside them."""
        out = np.ones(len(direction), bool)
        sides = (self.azimuth, self.beside_rad), (self.altitude, _BESIDE_RAD)
        for angle, (nodes, beside) in zip(self.angles(direction), sides, strict=True):
            out &= (angle >= nodes[0] - beside) & (angle <= nodes[-1] + beside)
        return out


@dataclass(frozen=True, eq=False)
class Water:
    """What water mirrors to an eye: by the picture of it where there is one, beside that to every ray by itself."""

    look: Look
    radius_m: float
    eye: F64
    picture: Mirrored | None

    def pictured(self, direction: F64) -> tuple[F32, NDArray[np.bool_]]:
        """What the picture has of L' (n, PACK) along rays (n, 3), NaN where it has none; and which it does not show."""
        out = np.full((len(direction), PACK), np.nan, FLOAT)
        if self.picture is None:
            return out, np.ones(len(direction), bool)
        shown = self.picture.shows(direction)
        out[shown] = self.picture.along(direction[shown])
        return out, ~shown

    def by_itself(self, place: F64, direction: F64, slope_variance: F64) -> F32:
        """L' (n, PACK) that is mirrored along rays that end at places (n, 3) on water with waves of mean square slopes
        (n,); NaN where it is not known. No ray's depends on the others'."""
        out = np.full((len(place), PACK), np.nan, FLOAT)
        up = _upward(self.eye[None], self.radius_m)[0]
        of_eye, of_water = (
            np.linalg.norm(p + np.array([0.0, 0.0, self.radius_m]), axis=-1) - self.radius_m for p in (self.eye, place)
        )
        level_m = np.round(of_water / _LEVEL_M) * _LEVEL_M  # so that a lake has one image of the eye
        for level in np.unique(level_m):
            here = np.flatnonzero(level_m == level)
            image = self.eye - 2 * (of_eye - level) * up
            lifted = place[here] + _LIFT_M * _upward(place[here], self.radius_m)
            for part in np.split(here, range(_TOGETHER, here.size, _TOGETHER)):
                which = np.searchsorted(here, part)
                seen, known = _marched(
                    self.look, self.radius_m, image, lifted[which], direction[part], slope_variance[part]
                )
                out[part[known]] = seen[known]
        return out


class WetRays(NamedTuple):
    """Rays (n,) that end on water: where, along which direction (n, 3) each, the mean slope variance there; how far
    beyond the last of them there may be water yet; and how wide the narrowest is, 0 where that is not known."""

    place: F64
    direction: F64
    slope_variance: float
    beyond_rad: float = 0.0
    width_rad: float = 0.0


def wet_rays(lit: LitGrid, relief: Relief | None, eye: F64, rays: Rays) -> WetRays | None:
    """Those of a picture's rays, or of some spread over it, that end on water unless clouds hide it; None without."""
    each = max(1, len(rays) // _ASKED)
    some = rays[::each]
    direction = some.directions()
    if relief is not None:
        distance = relief.meet(eye[None], direction)
        met = np.flatnonzero(distance < FAR_M)
        place = eye + distance[met, None] * direction[met]
    else:
        radius = lit.frame.radius_m
        met = np.flatnonzero(_falls_to(eye, direction, radius + lit.lighting.ground_m, radius))
        place = _on_sphere(eye, direction[met], radius + lit.lighting.ground_m, radius)
    direction = direction[met]
    wide_m = np.broadcast_to(np.asarray(some.width_rad, float), len(some))[met] * np.linalg.norm(place - eye, axis=-1)
    covered = np.sqrt(wide_m * along_m(wide_m, _upward(place, lit.frame.radius_m), direction))
    water, variance = np.zeros(len(met), bool), np.zeros(len(met))
    left = np.ones(len(met), bool)
    for level in lit.levels:
        here = np.flatnonzero(left if level.wider is None else left & _within(level, place))
        if here.size:
            lat, lon, _ = level.frame.latlon(place[here])
            sample = level.surface.sample(lat, lon, covered[here], lit.options.detail)
            water[here] = (sample.water > WET) & (not sample.lambertian)
            variance[here] = sample.slope_variance
        left[here] = False
    if not water.any():
        return None
    beyond = 4 * each * float(np.max(rays.width_rad))  # it may end between rays that are asked
    width = float(np.broadcast_to(np.asarray(some.width_rad, float), len(some))[met][water].min())
    return WetRays(place[water], direction[water], float(variance[water].mean()), beyond, width)


def along_m(width_m: F64, up: F64, direction: F64) -> F64:
    """How far along the ground, whose up is given (n, 3), rays of a width (n,) see."""
    return np.asarray(width_m / np.clip(-(up * direction).sum(-1), 0.05, 1.0))


def _within(level: LitGrid, place: F64) -> NDArray[np.bool_]:
    """Whether places lie on a grid."""
    assert level.medium is not None
    ix, iy = level.medium.indices(place)
    _, ny, nx = level.medium.shape
    return np.asarray((ix >= 0) & (iy >= 0) & (ix <= nx - 1) & (iy <= ny - 1))


def _falls_to(eye: F64, direction: F64, level_m: float, radius_m: float) -> NDArray[np.bool_]:
    """Whether rays from an eye meet the sphere of a radius about the Earth's centre."""
    centre = eye + np.array([0.0, 0.0, radius_m])
    along = direction @ centre
    return np.asarray((along < 0) & (along**2 >= float(centre @ centre) - level_m**2))


def _marched(
    look: Look, radius: float, image: F64, place: F64, direction: F64, slope_variance: F64
) -> tuple[F64, NDArray[np.bool_]]:
    """Mirrored radiance (n, PACK) at places with a slope variance (n,) each, and whether the way up is free there;
    image: of the eye, under the water."""
    n = len(place)
    up = _upward(place, radius)
    level = direction - (direction * up).sum(-1, keepdims=True) * up
    level /= np.maximum(np.linalg.norm(level, axis=-1, keepdims=True), 1e-9)
    *slopes, share = _slopes()
    along, across = (one * np.sqrt(0.5 * slope_variance)[:, None] for one in slopes)
    # facets (n, facets, 3): positive slopes along lean toward the viewer
    normal = up[:, None] - along[..., None] * level[:, None] + across[..., None] * np.cross(up, level)[:, None]
    steepness = np.linalg.norm(normal, axis=-1, keepdims=True)
    normal /= steepness
    cos_in = -(direction[:, None] * normal).sum(-1)
    weight = share * np.maximum(cos_in, 0.0) * steepness[..., 0] * water.fresnel_reflectance(cos_in)
    out = direction[:, None] + 2 * cos_in[..., None] * normal
    rise = (out * up[:, None]).sum(-1, keepdims=True)
    mu_view = -(direction * up).sum(-1)
    weight *= water.returned(rise[..., 0], mu_view[:, None], slope_variance[:, None])
    out += np.maximum(_LOWEST - rise, 0.0) * up[:, None]
    out /= np.linalg.norm(out, axis=-1, keepdims=True)
    radiance, distance = look(np.repeat(place, _FACETS, axis=0), out.reshape(-1, 3), image)
    free = (distance.reshape(n, -1) < 0) | (distance.reshape(n, -1) > 30.0)
    weight = weight * free
    total = weight.sum(axis=1)
    mean = (weight[..., None] * radiance.reshape(n, _FACETS, PACK)).sum(axis=1) / np.maximum(total, 1e-12)[:, None]
    return mean, free.any(axis=1) & (total > 0)


@cache
def _slopes() -> F64:
    """Slopes along and across the line of sight in standard deviations of a Gaussian, and their weights (3, facets).

    No two facets have the same slope along or across, so that what is bright in a narrow band of altitude, such as the
    glow of dusk, is not mirrored as stripes.
    """
    from scipy.special import ndtri

    number = np.arange(_FACETS)
    along, across = (ndtri((n + 0.5) / _FACETS) for n in (number, number * _LEAP % _FACETS))
    along = _WIDER * along
    weight = np.exp(-0.5 * along**2 * (1 - 1 / _WIDER**2))
    return np.stack([along, across, weight])


def _among(values: F64, known: NDArray[np.bool_], x: F64, y: F64) -> F32:
    """Values (rows, columns, k) at fractional indices, among the known; NaN where there is none."""
    rows, columns = known.shape
    i, j = np.minimum(x.astype(int), max(columns - 2, 0)), np.minimum(y.astype(int), max(rows - 2, 0))
    a, b = x - i, y - j
    total, out = np.zeros(x.size), np.zeros((x.size, values.shape[-1]))
    for dj, di, share in ((0, 0, (1 - a) * (1 - b)), (0, 1, a * (1 - b)), (1, 0, (1 - a) * b), (1, 1, a * b)):
        r, c = np.minimum(j + dj, rows - 1), np.minimum(i + di, columns - 1)
        w = (share + 1e-6) * known[r, c]
        total += w
        out += w[:, None] * values[r, c]
    return np.where(total[:, None] > 0, out / np.maximum(total, 1e-12)[:, None], np.nan).astype(FLOAT)


def _axis(angle: F64, most: int, width_rad: float) -> F64:
    """Even nodes that span the angles, of rays of a width."""
    low, high = float(angle.min()), float(angle.max())
    # a lake seen at a glance spans little altitude and much distance, but no more of it than there are pixels
    least, step = most // 3, _LEAST_STEP_RAD
    if width_rad > 0:
        least, step = min(least, int(np.ceil((high - low) / width_rad)) + 2), max(step, width_rad)
    return np.linspace(low, high + 1e-9, int(np.clip(np.ceil((high - low) / step) + 1, least, most)))


def _widest_gap(azimuth: F64) -> float:
    """Where to start to count azimuths (rad), so that the widest gap among them lies at the ends."""
    ordered = np.sort(azimuth[:: max(1, azimuth.size // 5000)] % (2 * np.pi))
    gaps = np.diff(np.append(ordered, ordered[0] + 2 * np.pi))
    return float(ordered[(int(gaps.argmax()) + 1) % ordered.size]) - 0.01


def _angles(direction: F64, axes: F64, up: F64) -> tuple[F64, F64]:
    return np.arctan2(direction @ axes[0], direction @ axes[1]), np.arcsin(np.clip(direction @ up, -1, 1))


def _horizontal(up: F64) -> F64:
    """Two horizontal unit vectors."""
    first = np.cross([0.0, 1.0, 0.0] if abs(up[1]) < 0.9 else [1.0, 0.0, 0.0], up)
    first /= np.linalg.norm(first)
    return np.stack([first, np.cross(up, first)])


def _upward(place: F64, radius_m: float) -> F64:
    up = place + np.array([0.0, 0.0, radius_m])
    return np.asarray(up / np.linalg.norm(up, axis=-1, keepdims=True))


def _on_sphere(eye: F64, direction: F64, level_m: float, radius_m: float) -> F64:
    """Where rays from an eye first meet the sphere of a radius about the Earth's centre, or come nearest to it."""
    centre = eye + np.array([0.0, 0.0, radius_m])
    along = direction @ centre
    excess = float(centre @ centre) - level_m**2
    root = np.sqrt(np.maximum(along**2 - excess, 0.0))
    return np.asarray(eye + np.maximum(-along - root, 0.0)[:, None] * direction)
