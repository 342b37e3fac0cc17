"""What rays look at: a cloud, the land, water or the open sky; how far away it is, and how much cloud is on the way.

Rays go through the grid once more, by the same march with other inputs: clouds dim nothing, so that they are counted to
the ray's end, and what is left of the light is what the air lets through. Nothing of it depends on the sun.
"""

from __future__ import annotations

from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import NDArray

from openswim.scene.rays import Rays
from openswim.transport.lit.lit_grid import CLEAR_STEP, LitGrid
from openswim.transport.march.march import march_rays
from openswim.transport.march.volume import FAR_M, Shells, Volume
from openswim.transport.view import nested
from openswim.transport.view.seen import Seen
from openswim.transport.view.viewer import AimedGrid, Viewer

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]

SKY, LAND, WATER, FIRST_SPECIES = 0, 1, 2, 3  # kinds of what is seen; then one for each species

_SEEN_ON_SKY = 0.03  # optical depth of the thinnest cirrus that is seen against the sky (Sassen & Cho 1992)
_SEEN_ON_GROUND = float(np.log(2))  # against the ground: it hides more than half of that
_CONTRAST = 0.02  # of what is behind air, that is still told from it (Koschmieder 1924)
_PART = 1.0  # of a cell, to which a distance is found by halving, and by a straight line from there
_TILE_RAYS = 300_000
AT_NM = 550.0  # at which species are counted, and air


@dataclass
class Sight:
    """What rays (n) look at.

    kind: `SKY` (the open sky, or haze that hides all), `LAND`, `WATER`, or `FIRST_SPECIES` and on. distance_m: to where
    a cloud has taken half of all the light that it takes, or to the ground; NaN where it is the sky. position (n, 3):
    there. depth (n, ns): optical depth of each species at 550 nm along the whole way to the ground or to space.
    """

    species: tuple[str, ...]
    kind: NDArray[np.int8]
    distance_m: F64
    position: F64
    depth: F32

    @classmethod
    def nothing(cls, n: int, species: tuple[str, ...]) -> Sight:
        """Rays that see the sky."""
        return cls(
            species, np.full(n, SKY, np.int8), np.full(n, np.nan), np.full((n, 3), np.nan),
            np.zeros((n, len(species)), np.float32),
        )  # fmt: skip

    @property
    def names(self) -> list[str]:
        """What each number of ``kind`` stands for."""
        return ["sky", "land", "water", *self.species]

    def put(self, rays: NDArray[np.int64] | slice, part: Sight) -> None:
        """Set what some of the rays see."""
        for field in fields(self):
            if field.name != "species":
                getattr(self, field.name)[rays] = getattr(part, field.name)


@dataclass(frozen=True, eq=False)
class Undimmed:
    """A grid whose clouds dim nothing, and those around it."""

    lit: LitGrid
    volume: Volume
    sky: Shells
    wider: Undimmed | None

    @classmethod
    def of(cls, grid: AimedGrid) -> Undimmed:
        volume = grid.volume
        open_volume = volume._replace(
            scaled=np.zeros_like(volume.scaled), forward=np.zeros_like(volume.forward), turning=volume.turning[:0]
        )
        return cls(grid.lit, open_volume, grid.sky, None if grid.wider is None else cls.of(grid.wider))

    def march(self, origin: F64, direction: F64, ends: F64 | None, cone: F64 | None = None) -> Seen:
        """Depths of the species along rays (n, 3), and what the air lets through."""
        if self.wider is not None:
            return nested.march(self, self.wider, origin, direction, ends, cone)
        return self.march_alone(origin, direction, ends, cone)

    def march_alone(self, origin: F64, direction: F64, ends: F64 | None, cone: F64 | None = None) -> Seen:
        """`march` in this grid and the air beside it."""
        lit = self.lit
        step = lit.options.step * (CLEAR_STEP if lit.medium is None else 1.0)
        met = march_rays(
            origin, direction, lit.sun, np.zeros_like(lit.table), self.sky, self.volume, step, ends=ends
        )  # fmt: skip
        return Seen(
            met.radiance, met.scaled, met.full, met.distance_m, met.species_depth, int(met.samples.sum()),
            np.zeros(len(direction), np.int8),
        )  # fmt: skip

    @property
    def top_m(self) -> float:
        """Height under which all species are, with a cell to spare."""
        own = self.volume.top_m
        return own if self.wider is None else max(own, self.wider.top_m)

    @property
    def levels(self) -> list[Undimmed]:
        return [self] if self.wider is None else [self, *self.wider.levels]


def sight_of(viewer: Viewer, rays: Rays) -> Sight:
    """What rays of a viewer look at; memory is bounded by tiling over them."""
    grid = Undimmed.of(viewer.grid)
    out = Sight.nothing(len(rays), species_of(viewer.lit))
    for a in range(0, len(rays), _TILE_RAYS):
        part = slice(a, min(len(rays), a + _TILE_RAYS))
        tile = rays[part]
        origin, direction = np.array(tile.origins()), np.array(tile.directions())
        relief = viewer.grid.relief
        ends = None if relief is None else relief.meet(origin, direction)
        width_rad = np.array(np.broadcast_to(np.asarray(tile.width_rad, float), len(tile)))
        out.put(part, _sight(grid, origin, direction, ends, width_rad, out.species))
    return out


def species_of(lit: LitGrid) -> tuple[str, ...]:
    """Names of a grid's species, in the order of their depths."""
    return () if lit.medium is None else tuple(one.name for one in lit.medium.species)


def _sight(
    grid: Undimmed, origin: F64, direction: F64, ends: F64 | None, width_rad: F64, species: tuple[str, ...]
) -> Sight:
    lit = grid.lit
    lane = int(np.abs(lit.wavelengths_nm[: lit.count] - AT_NM).argmin())
    whole = grid.march(origin, direction, ends)
    out = Sight.nothing(len(direction), species)
    out.depth[:] = whole.depth[:, : len(species)]
    met = whole.distance >= 0
    ground = np.flatnonzero(met & (whole.full[:, lane] > _CONTRAST))
    for number, level in enumerate(grid.levels):  # as the grid has it in which rays end
        here = ground[whole.level[ground] == number]
        if here.size:
            place = origin[here] + direction[here] * whole.distance[here, None]
            out.kind[here] = np.where(_wet(level.lit, place, width_rad[here] * whole.distance[here]), WATER, LAND)
            out.distance_m[here] = whole.distance[here]
    total = out.depth.astype(float).sum(axis=1)
    cloudy = np.flatnonzero(total >= np.where(out.kind != SKY, _SEEN_ON_GROUND, _SEEN_ON_SKY))
    if cloudy.size:
        end = np.where(met[cloudy], whole.distance[cloudy], FAR_M)
        distance, which, clear = _halfway(
            grid, origin[cloudy], direction[cloudy], None if ends is None else ends[cloudy], end, out.depth[cloudy],
            lane,
        )  # fmt: skip
        seen = clear > _CONTRAST
        out.kind[cloudy[seen]] = FIRST_SPECIES + which[seen]
        out.distance_m[cloudy[seen]] = distance[seen]
    out.position[:] = origin + direction * out.distance_m[:, None]
    return out


def _halfway(
    grid: Undimmed, origin: F64, direction: F64, ends: F64 | None, end: F64, depth: F32, lane: int
) -> tuple[F64, NDArray[np.int64], F64]:
    """Distances (n,) at which clouds of a ``depth`` (n, ns) have taken half of what they take, e^-tau = (1 + e^-all)/2;
    which species has the greatest depth before that; and what the air in front lets through.

    Halving: each time rays go on to the middle of what is left, which in all is the way once more.
    """
    wanted = -np.log(0.5 * (1.0 + np.exp(-depth.astype(float).sum(axis=1))))
    near, far = _bracket(origin, direction, end, grid.top_m, grid.lit.shells.radius_m)
    begun = np.zeros(depth.shape)
    whole = depth.astype(float)
    clear = np.ones(len(near))
    above = np.flatnonzero(near > 0)
    if above.size:
        clear[above] = grid.march(origin[above], direction[above], -near[above]).full[:, lane]
    finest_m = _PART * min(
        min(float(level.volume.cell_m.min()), float(np.diff(level.volume.levels_m).min())) for level in grid.levels
    )
    for _ in range(64):
        going = np.flatnonzero(far - near > max(finest_m, 1.0))
        if not going.size:
            break
        length = 0.5 * (far[going] - near[going])
        limit = -length if ends is None else np.where(ends[going] < 0, -length, length)
        o = origin[going] + near[going, None] * direction[going]
        part = grid.march(o, direction[going], limit)
        reached = begun[going] + part.depth[:, : depth.shape[1]]
        beyond = reached.sum(axis=1) >= wanted[going]
        past, short = going[beyond], going[~beyond]
        far[past], whole[past] = near[past] + length[beyond], reached[beyond]
        near[short], begun[short] = near[short] + length[~beyond], reached[~beyond]
        clear[short] *= part.full[~beyond, lane]
    share = (wanted - begun.sum(axis=1)) / np.maximum((whole - begun).sum(axis=1), 1e-12)
    share = np.clip(share, 0.0, 1.0)
    which = (begun + share[:, None] * (whole - begun)).argmax(axis=1)
    return near + share * (far - near), which, clear


def _bracket(origin: F64, direction: F64, end: F64, top_m: float, radius_m: float) -> tuple[F64, F64]:
    """Distances (n,) between which rays are under a height, or before their end."""
    up = origin + np.array([0.0, 0.0, radius_m])
    along = (up * direction).sum(axis=-1)
    height = np.linalg.norm(up, axis=-1) - radius_m
    # s^2 + 2 along s + over = 0, without the loss of digits
    over = (height - top_m) * (2 * radius_m + height + top_m)
    root = np.sqrt(np.maximum(along**2 - over, 0.0))
    one = np.where(along >= 0, -(along + root), root - along)
    other = over / np.where(one == 0, 1.0, one)
    first, last = np.minimum(one, other), np.maximum(one, other)
    return np.maximum(first, 0.0), np.minimum(np.maximum(last, 0.0), end)


def _wet(lit: LitGrid, place: F64, width_m: F64) -> NDArray[np.bool_]:
    """Whether most of the ground at places (n, 3) is water."""
    lat, lon, _ = lit.frame.latlon(place)
    water = lit.surface.sample(lat, lon, width_m, lit.options.detail).water
    return np.broadcast_to(np.asarray(water) > 0.5, len(place))
