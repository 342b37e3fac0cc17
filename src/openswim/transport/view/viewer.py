"""What an eye needs of solved light, made once: its sources toward it, the land around it, what water mirrors to it.

A `Viewer` is not changed by being used: it hands out any rays from its eye, in any order, from any thread, and each is
the same bit for bit whatever others it is asked for with.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from openswim.errors import UserError
from openswim.progress import job
from openswim.scene.rays import Rays
from openswim.transport.engine.pack import PACK
from openswim.transport.engine.types import FLOAT
from openswim.transport.ground_light.relief import Relief
from openswim.transport.lit.lit_grid import CLEAR_STEP, LitGrid, Once
from openswim.transport.march.cloud_detail import NO_DETAIL, Detail, detail_of, first_wavelength_m
from openswim.transport.march.detail_step import widest_m
from openswim.transport.march.forward_peak import blunted
from openswim.transport.march.level_ice import NO_LEVEL_ICE, LevelIce
from openswim.transport.march.march import march_rays
from openswim.transport.march.volume import FAR_M, Shells, Volume
from openswim.transport.swim import view as swim_view
from openswim.transport.view import nested, sparse
from openswim.transport.view.around_shadow import light_around
from openswim.transport.view.level_ice import level_ice
from openswim.transport.view.lit_from_below import EndsOfRays, from_space, light_from_below
from openswim.transport.view.mirror import HIGHEST_EYE_M, Look, Mirrored, Water, wet_rays
from openswim.transport.view.seen import Seen, View
from openswim.transport.view.shading import shade
from openswim.transport.view.skies import skies_for, sunlit_wide_shells
from openswim.transport.view.toward_eye import aimed

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]

_TILE_RAYS = 1_200_000
_AUREOLE_DEG = 10.0  # as far as one facet of a wave is from the next, or a little farther
_SAME_EYE_M, _SAME_WAY = 1e-3, 1e-6
_SAME_IMAGE = 0.05  # of the way up to the lowest cloud, which is seen 3 degrees elsewhere: waves smear over more


@dataclass(frozen=True, eq=False)
class AimedGrid:
    """The light of a grid with its sources toward an eye, and of those around it; ``sky``: the shells that the eye's
    rays go through; ``table``: forward peaks, which are cut where the beam glitters by itself; ``plates``: those
    of ice that float level."""

    lit: LitGrid
    volume: Volume
    sky: Shells
    table: F32
    detail: Detail
    relief: Relief | None
    plates: LevelIce = NO_LEVEL_ICE
    mirrored: Water | None = None
    wider: AimedGrid | None = None
    eye: F64 | None = None  # None where rays are parallel

    @classmethod
    def at(cls, lit: LitGrid, eye: F64, parallel: bool, relief: Relief | None, skies: list[Shells]) -> AimedGrid:
        """Turned toward an eye (3,), or, where rays are ``parallel``, along their direction; a sky for each grid."""
        wider = None if lit.wider is None else cls.at(lit.wider, eye, parallel, relief, skies[1:])
        place = None if parallel else eye
        plates = level_ice(lit, place)
        grid = aimed(lit, eye, parallel)
        return cls(lit, grid, skies[0], lit.table, NO_DETAIL, relief, plates, wider=wider, eye=place)

    @property
    def levels(self) -> list[AimedGrid]:
        """This grid and the wider ones around it."""
        return [self] if self.wider is None else [self, *self.wider.levels]

    def seen_by(self, rays: Rays) -> AimedGrid:
        """The same with the detail that clouds show to rays."""
        wider = None if self.wider is None else self.wider.seen_by(rays)
        return replace(self, detail=_detail_for(self.lit, rays), wider=wider)

    def mirroring(self, mirrored: Water | None) -> AimedGrid:
        """The same with water that mirrors the sky."""
        wider = None if self.wider is None else self.wider.mirroring(mirrored)
        return replace(self, mirrored=mirrored, wider=wider)

    def as_mirrored(self) -> AimedGrid:
        """The same without the narrow aureole that the delta-scaled beam has kept, and without detail."""
        table = self.lit.once("blunt table", lambda: blunted(self.lit.table, _AUREOLE_DEG))
        wider = None if self.wider is None else self.wider.as_mirrored()
        return replace(self, table=table, detail=NO_DETAIL, mirrored=None, wider=wider)

    def march(self, origin: F64, direction: F64, ends: F64 | None, cone: F64 | None = None) -> Seen:
        """What rays (n, 3) see, but for the ground's own light; ``ends``, ``cone`` as `march_rays` has them."""
        if self.wider is not None:
            return nested.march(self, self.wider, origin, direction, ends, cone)
        return self.march_alone(origin, direction, ends, cone)

    def march_alone(self, origin: F64, direction: F64, ends: F64 | None, cone: F64 | None = None) -> Seen:
        """`march` in this grid and the air beside it."""
        lit, level = self.lit, np.zeros(len(direction), np.int8)
        if lit.options.name == "swim" and lit.medium is not None:
            radiance, full, depth, distance, samples = swim_view.view(
                lit, self.volume, origin, direction, self.sky, ends
            )
            return Seen(radiance, full, full, distance, depth, int(samples.sum()), level)
        step = lit.options.step * (CLEAR_STEP if lit.medium is None else 1.0)
        seen = march_rays(
            origin, direction, lit.sun, self.table, self.sky, self.volume, step, ends=ends, cone=cone,
            detail=self.detail, level_ice=self.plates,
        )  # fmt: skip
        radiance = np.maximum(seen.radiance, 0)  # the truncated source may dip below zero where next to nothing is
        return Seen(
            radiance, seen.scaled, seen.full, seen.distance_m, seen.species_depth, int(seen.samples.sum()), level
        )

    def seen(
        self, origin: F64, direction: F64, width_rad: F64 | None = None, image: NDArray[np.int64] | None = None,
        alike: float = 0.0, beside: F64 | float = 0.0,
    ) -> Seen:  # fmt: skip
        """What rays (n, 3) of a width (n,) see, the light of the ground included; ``image``, ``alike`` and ``beside``:
        see `sparse.march`."""
        ends = None if self.relief is None else self.relief.meet(origin, direction)
        cone = None if width_rad is None else np.stack([np.zeros(len(direction)), width_rad], axis=-1)
        if image is None:
            found = self.march(origin, direction, ends, cone)
        else:
            found = sparse.march(self.march, origin, direction, ends, cone, image, alike, beside)
        place = origin + direction * found.distance[:, None]
        width_m = (0.01 if width_rad is None else width_rad) * found.distance
        for number, level in enumerate(self.levels):  # as the grid has it in which rays end
            hit = np.flatnonzero((found.distance >= 0) & (found.level == number))
            if hit.size:
                ground = shade(level, place[hit], direction[hit], width_m[hit])
                found.radiance[hit] += found.through[hit] * level.more_of_the_sun(place[hit]) * ground
        if self.lit.eclipse is not None:
            self._add_light_around(found, origin, direction, place)
        else:
            self._add_light_from_below(found, origin, direction, place)
        return found

    def _add_light_from_below(self, found: Seen, origin: F64, direction: F64, place: F64) -> None:
        """What air seen from space has of the ground below it: see `light_from_below`."""
        widest = self.levels[-1]
        over = np.flatnonzero((found.distance >= 0) & from_space(widest.lit, origin))
        beside_m = widest.beside_m(place[over])
        if widest.lit.options.name != "swim":
            over, beside_m = over[beside_m > 0], beside_m[beside_m > 0]
        if over.size == 0:
            return
        ends = EndsOfRays(place[over], direction[over], np.broadcast_to(origin, place.shape)[over], beside_m)
        of_air, of_ground = light_from_below(widest.lit, ends)
        if self.volume.species:
            of_air *= np.exp(-found.depth[over, : self.volume.species].astype(float) @ self.volume.scaled)
        more = of_air + (beside_m > 0)[:, None] * found.through[over] * of_ground
        found.radiance[over] = np.maximum(found.radiance[over] + more, 0)

    def _add_light_around(self, found: Seen, origin: F64, direction: F64, place: F64) -> None:
        """What air beside the grids has more or less of the sun than is left over the scene's middle."""
        widest = self.levels[-1]
        lit, eclipse, volume = widest.lit, widest.lit.eclipse, self.volume
        assert eclipse is not None
        beyond = np.flatnonzero((found.distance < 0) | ~widest.holds(place))
        if beyond.size == 0:
            return
        near = lit.shells.moments.shape[1] == widest.sky.moments.shape[1]
        more = light_around(
            eclipse, eclipse.lit if near else sunlit_wide_shells(lit), widest.volume, origin[beyond],
            direction[beyond], self.eye, lit.once,
        )  # fmt: skip
        if volume.species:
            more = more * np.exp(-found.depth[beyond, : volume.species].astype(float) @ volume.scaled)
        found.radiance[beyond] = np.maximum(found.radiance[beyond] + more, 0)

    def holds(self, place: F64) -> NDArray[np.bool_]:
        """Which of places (n, 3) lie within the grid's sides."""
        return self.beside_m(place) == 0

    def beside_m(self, place: F64) -> F64:
        """How far places (n, 3) lie outside of the grid's sides; 0 within."""
        medium = self.lit.medium
        if medium is None or medium.periodic:
            return np.full(len(place), 0.0 if self.volume.periodic else np.inf)
        (ix, iy), (_, ny, nx), (dx, dy) = medium.indices(place), medium.shape, medium.cell_m
        ix, iy = (np.nan_to_num(i, nan=1e9, posinf=1e9, neginf=-1e9) for i in (ix, iy))
        return np.asarray(np.hypot(dx * (ix - np.clip(ix, 0, nx - 1)), dy * (iy - np.clip(iy, 0, ny - 1))))

    def more_of_the_sun(self, place: F64) -> F64 | float:
        """Of places (n, 3) on ground beside the grid, how many times the light they have that the scene's origin has:
        1 but in the moon's shadow."""
        eclipse = self.lit.eclipse
        if eclipse is None:
            return 1.0
        return np.where(self.holds(place)[:, None], 1.0, eclipse.dimmed.brighter(place, eclipse.lit))

    def through_clouds(self, place: F64) -> F64:
        """Delta-scaled transmission (n, nw) of the grid's species from the sun to places, by rays: ground beyond it.
        A relief casts its own shadow; the grid's terrain, which ends there like a wall, casts none."""
        lifted = place + np.array([0.0, 0.0, 1.0])
        dark, ends, sun = np.zeros_like(self.table), np.full(len(place), FAR_M), self.lit.sun
        met = march_rays(lifted, sun, sun, dark, self.lit.shells, self.volume, 1.0, ends=ends)
        return np.asarray(np.exp(-met.species_depth[:, : self.volume.species].astype(float) @ self.volume.scaled))


# What makes a grid aimed at an eye, once
Own = Callable[[], AimedGrid]


@dataclass(frozen=True, eq=False)
class Viewer:
    """An eye, or a direction from which parallel rays come, in solved light at up to PACK wavelengths."""

    grid: AimedGrid
    eye: F64
    parallel: bool

    @classmethod
    def of(cls, lit: LitGrid, rays: Rays, relief: Relief | None, skies: list[Shells] | None = None) -> Viewer:
        """The viewer of some rays, which share their origin or their direction, and of others from the same eye.

        relief: the land's shape as they see it. What is made for all of them is the picture of the sky that water
        mirrors where they end on some; a ray beside those, or a single one, is told by itself what it mirrors.
        ``skies``: the shells they go through, if these are known.
        """
        eye, parallel = _eye_of(rays)
        skies = skies_for(lit, rays) if skies is None else skies
        own = cache(lambda: AimedGrid.at(lit, eye, parallel, relief, skies))
        mirrored = _alone(lit, relief, skies, rays) if parallel else _mirrored(lit, relief, skies, rays, eye, own)
        return cls(own().seen_by(rays).mirroring(mirrored), eye, parallel)

    @property
    def lit(self) -> LitGrid:
        return self.grid.lit

    def of_others(self, rays: Rays, relief: Relief | None) -> Viewer:
        """That of other rays from the same eye; its sources are the same, and not made again."""
        lit = self.lit
        if not self._is_of(rays) or _layered(lit):
            return Viewer.of(lit, rays, relief)
        skies = skies_for(lit, rays)
        grid, mirrored = _with_land(self.grid, relief, skies), None
        if not self.parallel and _mirrors(lit, self.eye):
            mirrored = _water(lit, relief, skies, self.eye, None, lambda: grid)
        return replace(self, grid=grid.seen_by(rays).mirroring(mirrored))

    def _is_of(self, rays: Rays) -> bool:
        """Whether rays come from this eye; a single one, that tells no eye of its own, too."""
        if len(rays) == 1 and not self.parallel:
            return np.array_equal(rays.origins()[0], self.eye)
        eye, parallel = _eye_of(rays)
        return parallel == self.parallel and np.array_equal(eye, self.eye)

    def view(self, rays: Rays) -> View:
        """What rays see; memory is bounded by tiling over them."""
        n, lit = len(rays), self.lit
        out = View(
            np.zeros((n, PACK), FLOAT), np.zeros((n, PACK), FLOAT), np.zeros(n, bool),
            np.full((n, 3), np.nan), np.zeros(n), np.zeros((n, max(lit.volume.species, 1)), FLOAT), 0,
        )  # fmt: skip
        with job("view", n) as meter:
            for part, grid, image in self._tiles(rays):
                tile = rays[part]
                origin, direction = tile.origins(), tile.directions()
                width_rad = np.array(np.broadcast_to(np.asarray(tile.width_rad, float), len(tile)))
                beside = 0.0 if rays.beside is None else rays.beside[part]
                seen = grid.seen(origin, direction, width_rad, image, rays.alike, beside)
                hit = seen.distance >= 0
                position = np.full((len(tile), 3), np.nan)
                position[hit] = origin[hit] + direction[hit] * seen.distance[hit, None]
                out.radiance[part], out.transmittance[part], out.distance_m[part] = (
                    seen.radiance, seen.full, seen.distance
                )  # fmt: skip
                out.species_depth[part], out.hit[part], out.position[part] = seen.depth, hit, position
                out.samples += seen.samples
                meter.advance(len(tile))
        return replace(out, radiance=out.radiance[:, : lit.count], transmittance=out.transmittance[:, : lit.count])

    def _tiles(self, rays: Rays) -> Iterator[tuple[Any, AimedGrid, NDArray[np.int64] | None]]:
        """Parts of the rays to march together, and their image; in scenes without sides, where a node is everywhere,
        one a direction."""
        if _layered(self.lit):
            _, which = np.unique(rays.directions().round(9), axis=0, return_inverse=True)
            order = np.argsort(which.ravel(), kind="stable")
            for part in np.split(order, np.flatnonzero(np.diff(which.ravel()[order])) + 1):
                yield part, AimedGrid.at(self.lit, rays.directions()[part[0]], True, None, [self.grid.sky]), None
        elif rays.image is not None:
            side = sparse.BLOCKS[0]
            rows = max(1, _TILE_RAYS // rays.image.shape[1] // side) * side + 1  # blocks between the tile's own corners
            for a in range(0, len(rays.image), rows):
                tile = rays.image[a : a + rows]
                part = tile[tile >= 0]
                if part.size:
                    yield part, self.grid, np.where(tile >= 0, np.cumsum(tile >= 0).reshape(tile.shape) - 1, -1)
        else:
            for a in range(0, len(rays), _TILE_RAYS):
                yield slice(a, min(len(rays), a + _TILE_RAYS)), self.grid, None


def _layered(lit: LitGrid) -> bool:
    return lit.light is not None and lit.light.layers is not None


def _with_land(grid: AimedGrid, relief: Relief | None, skies: list[Shells]) -> AimedGrid:
    wider = None if grid.wider is None else _with_land(grid.wider, relief, skies[1:])
    return replace(grid, relief=relief, sky=skies[0], wider=wider)


def _mirrored(lit: LitGrid, relief: Relief | None, skies: list[Shells], rays: Rays, eye: F64, own: Own) -> Water | None:
    """What water mirrors to rays from an eye, with the picture of it where any end on some."""
    if not _mirrors(lit, eye):
        return None
    wet = wet_rays(lit, relief, eye, rays)
    if wet is None:
        return _water(lit, relief, skies, eye, None, own)
    look = looking_from(lit, relief, skies, eye, own)
    picture = Mirrored.of(look, relief, lit.frame.radius_m, eye, wet)
    return _water(lit, relief, skies, eye, picture, own)


def _alone(lit: LitGrid, relief: Relief | None, skies: list[Shells], rays: Rays) -> Water | None:
    """What water mirrors to a single ray."""
    eye = rays.origins()[0]
    return _water(lit, relief, skies, eye, None) if len(rays) == 1 and _mirrors(lit, eye) else None


def _mirrors(lit: LitGrid, eye: F64) -> bool:
    """Whether water mirrors the scene's own sky to an eye."""
    return bool(lit.frame.latlon(eye)[2] < HIGHEST_EYE_M) and not _layered(lit)


def _water(
    lit: LitGrid, relief: Relief | None, skies: list[Shells], eye: F64, picture: Mirrored | None, own: Own | None = None
) -> Water:
    return Water(looking_from(lit, relief, skies, eye, own, Once()), lit.frame.radius_m, eye, picture)


def looking_from(
    lit: LitGrid, relief: Relief | None, skies: list[Shells], eye: F64, own: Own | None = None, once: Once | None = None
) -> Look:
    """How the image of an eye under water sees what is mirrored to it. Peaks are cut: they are in the beam, which
    glitters by itself. ``own``: the grid aimed at the eye, which serves an image near by, as of who stands at a shore;
    ``once``: where what is made for the last image is kept."""
    base_m = min((level.medium.cloud_base_m for level in lit.levels if level.medium is not None), default=np.inf)
    near_m = _SAME_IMAGE * (base_m - lit.frame.latlon(eye)[2])

    def look(origin: F64, direction: F64, image: F64) -> tuple[F32, F64]:
        def aim() -> AimedGrid:
            near = own is not None and np.linalg.norm(image - eye) <= near_m
            grid = own() if own is not None and near else AimedGrid.at(lit, image, False, relief, skies)
            return grid.as_mirrored()

        seen = (aim() if once is None else once.last("image", image.tobytes(), aim)).seen(origin, direction)
        return seen.radiance, seen.distance

    return look


def _detail_for(lit: LitGrid, rays: Rays) -> Detail:
    """What clouds are like between the nodes, where any ray is narrow enough to see it."""
    m, light, width_rad = lit.medium, lit.light, np.asarray(rays.width_rad, float)
    if not (lit.options.detail and width_rad.any()) or m is None or light is None or m.periodic or min(m.shape) < 2:
        return NO_DETAIL
    up = np.array([0.0, 0.0, lit.frame.radius_m])
    above_m = np.linalg.norm(rays.origins() + up, axis=-1) - lit.frame.radius_m - m.cloud_top_m
    if (width_rad * np.maximum(above_m, 0.0)).min() >= widest_m(first_wavelength_m(m.drawn_cell_m)):
        return NO_DETAIL

    def make() -> Detail:
        refined = [s.fine for s in m.species]
        if not any(refined):
            return NO_DETAIL
        _, ny, nx = m.shape
        return detail_of(
            m.extinction[refined].sum(axis=0), np.array(refined, FLOAT), m.drawn_cell_m,
            light.local_sun[ny // 2, nx // 2], m.drift_along_axes_m,
        )  # fmt: skip

    return lit.once("detail", make)


def _eye_of(rays: Rays) -> tuple[F64, bool]:
    """Common point of the rays, or their common direction."""
    if len(rays) == 1:
        return rays.directions()[0], True
    if rays.origin_m.ndim == 1:
        return rays.origin_m, False
    if rays.direction.ndim == 1:
        return rays.direction, True
    if np.allclose(rays.direction, rays.direction[:1], atol=_SAME_WAY):
        return rays.direction[0], True
    if np.allclose(rays.origin_m, rays.origin_m[:1], atol=_SAME_EYE_M):
        return rays.origin_m[0], False
    raise UserError("rays must share their origin or their direction: split them into groups that do")
