"""What fills a scene at given wavelengths: all that transport is told of a scene but its ground."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from openswim.optics.cover import cloud_cover
from openswim.optics.gas_bands import Terms, terms_of
from openswim.optics.layers import ground_of_place_m
from openswim.optics.species import Background, OpticalSpecies, background, each_species, for_wavelengths
from openswim.scene.frame import Frame, scene_frame
from openswim.scene.grid import Grid
from openswim.scene.variables import HYDROMETEORS

if TYPE_CHECKING:
    from openswim.scene.atmosphere import Atmosphere
    from openswim.scene.scene import Scene

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]
I64 = NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class Air:
    """The background air around a scene, at the terms (nwl,) that stand for wavelengths. starlit: an even sky of L' = 1
    shines above it."""

    atmosphere: Atmosphere
    terms: Terms
    starlit: bool = False

    def at(self, height_m: ArrayLike) -> Background:
        """Its coefficients at heights (nz,) above sea level."""
        found = background(self.atmosphere, self.terms.nm, height_m, self.terms)
        return replace(found, starlit=True) if self.starlit else found


@dataclass(frozen=True, eq=False)
class Matter:
    """Species on a grid, and the air around it, in the frame in which light travels.

    terms: what is solved for, `wavelengths_nm` (nwl,) of each. grid: None for a clear sky. species: a list, or of large
    domains whatever makes them anew, one after the other.
    cover (nz, ny, nx): share of each cell that is cloud; None where cloud fills its cells. air: None for none.
    highest_m: level above all that is on levels. cut: whether the grid is a part of a domain that goes on.
    wider: what lies on a wider, coarser grid around this one. drift_m: see `Scene`.
    """

    frame: Frame
    grid: Grid | None
    terms: Terms
    species: Iterable[OpticalSpecies]
    cover: F32 | None
    air: Air | None
    highest_m: float
    cut: bool = False
    wider: Matter | None = None
    drift_m: tuple[float, float] = (0.0, 0.0)

    @property
    def wavelengths_nm(self) -> F64:
        """Of each term (nwl,): what is solved for."""
        return self.terms.nm

    @property
    def levels(self) -> list[Matter]:
        """This matter and that on the wider grids around it."""
        return [self] if self.wider is None else [self, *self.wider.levels]

    def starlit(self) -> Matter:
        """The same under an even sky."""
        return replace(
            self, air=None if self.air is None else replace(self.air, starlit=True),
            wider=None if self.wider is None else self.wider.starlit(),
        )  # fmt: skip

    def at(self, which: I64) -> Matter:
        """The same at some of the wavelengths, each as often as it is named; all arrays on the grid are shared."""
        terms = self.terms.at(which)
        species: Iterable[OpticalSpecies]
        if isinstance(self.species, EachSpecies):
            species = self.species.at(which)
        else:
            species = [one.at(which) for one in self.species]
        return replace(
            self, terms=terms, species=species, air=None if self.air is None else replace(self.air, terms=terms),
            wider=None if self.wider is None else self.wider.at(which),
        )  # fmt: skip


@dataclass(frozen=True, eq=False)
class EachSpecies:
    """The species of a scene, made anew one by one whenever they are gone through: none is kept."""

    scene: Scene
    wavelengths_nm: F64
    cover: F32 | None
    names: Sequence[str] | None

    def __iter__(self) -> Iterator[OpticalSpecies]:
        yield from each_species(self.scene, self.wavelengths_nm, self.cover, self.names)

    def at(self, which: I64) -> EachSpecies:
        """See `Matter.at`."""
        return replace(self, wavelengths_nm=self.wavelengths_nm[which])


def terms_in(scene: Scene, wavelengths_nm: F64) -> Terms:
    """What is solved for: the same in all levels, if any has air."""
    return terms_of(wavelengths_nm, any(level.atmosphere is not None for level in scene.levels))


def matter_of(
    scene: Scene, wavelengths_nm: ArrayLike, keep: bool = True, names: Sequence[Sequence[str] | None] = ()
) -> Matter:
    """What fills a scene, and the wider ones around it.

    keep: hold the extinction of all species on its grid. names: those of other matter's species and of what is around
    it, so that droplets are divided by size alike.
    """
    wavelengths = np.atleast_1d(np.asarray(wavelengths_nm, float))
    terms = terms_in(scene, wavelengths)
    scene, frame = for_wavelengths(scene, wavelengths), scene_frame(scene)
    out, ground_m = None, ground_of_place_m(scene)
    for n, level in reversed(list(enumerate(scene.levels))):
        cover = cloud_cover(level)
        species = EachSpecies(level, terms.nm, cover, names[n] if n < len(names) else None)
        air = None if level.atmosphere is None else Air(with_own_vapour(level).above_ground(ground_m), terms)
        out = Matter(
            frame, level.grid, terms, list(species) if keep else species, cover, air, _highest_m(level), level.cut, out,
            level.drift_m,
        )  # fmt: skip
    assert out is not None
    return out


def with_own_vapour(scene: Scene) -> Atmosphere:
    """The scene's atmosphere, with the mean of its precipitable water where it has no profile of vapour."""
    assert scene.atmosphere is not None
    if scene.atmosphere.vapour_kg_m3 is not None or "precipitable_water" not in scene.data:
        return scene.atmosphere
    ground_m = float(np.nanmean(scene.data["surface_altitude"])) if "surface_altitude" in scene.data else 0.0
    return scene.atmosphere.with_precipitable_water(0.1 * float(np.nanmean(scene.data["precipitable_water"])), ground_m)


def _highest_m(scene: Scene) -> float:
    """Height of the level above all that is on levels."""
    if scene.grid is None:
        return 0.0
    heights, last = scene.grid.height_m, 1
    for name, values in scene.data.data_vars.items():
        if values.ndim == 3 and (str(name).removesuffix("_content") in HYDROMETEORS or "extinction" in str(name)):
            filled = np.array([level.any() for level in values.transpose("z", "y", "x").values])
            last = max(last, int(np.flatnonzero(filled).max(initial=0)))
    return float(np.max(heights[min(last + 1, len(heights) - 1)]))
