"""From a scene to what light meets: the optical species on its grid, and the background air around it."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from copy import copy
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from openswim.errors import UserError
from openswim.optics import aerosol, hydrometeors
from openswim.optics.cover import CLOUD, cloud_cover
from openswim.optics.displays import crystals
from openswim.optics.displays.shapes import Shapes
from openswim.optics.gas_bands import Terms
from openswim.optics.layers import beside_background, layers_optics
from openswim.optics.ozone import ozone_cross_section_m2
from openswim.optics.rayleigh import depolarisation_factor, rayleigh_scattering_per_m
from openswim.scene.particles import relative_extinction
from openswim.scene.phase import PhaseFunction, Rayleigh, phases_at

if TYPE_CHECKING:
    from openswim.scene import Optics, Scene
    from openswim.scene.atmosphere import Atmosphere

FloatArray = NDArray[np.float64]

REFERENCE_NM = 550.0
SPLIT_SPREAD = 0.25  # standard deviation of ln(effective radius) above which droplets are two species


@dataclass(frozen=True, eq=False)
class OpticalSpecies:
    """One kind of particle on the scene's grid.

    extinction_per_m: (nz, ny, nx) float32 at the reference (550 nm for aerosol); relative_extinction,
    single_scattering_albedo: (nwl,); phase: one per wavelength; fine: whether it is known to have lumps finer than
    the grid, as a model's own liquid cloud has (what is given as extinction is given as it is); level: shapes and
    shares of crystals of ice that float level, whose ``phase`` is that of all orientations (`transport.ice.level`).
    """

    name: str
    kind: str
    extinction_per_m: NDArray[np.float32]
    relative_extinction: FloatArray
    single_scattering_albedo: FloatArray
    phase: list[PhaseFunction]
    fine: bool = False
    level: tuple[tuple[str, float], ...] = ()

    @property
    def backscatter_fraction(self) -> float:
        """b of Albers et al. 2020, Eq. 4, of the kind; (1 - g)/2, which makes .069 of liquid's .863, where they give
        none."""
        if self.kind in hydrometeors.HYDROMETEORS:
            return hydrometeors.HYDROMETEORS[self.kind].backscatter_fraction
        if self.kind == "aerosol":
            return aerosol.BACKSCATTER_FRACTION
        return float(np.mean([0.5 * (1 - p.asymmetry) for p in self.phase]))

    def at(self, which: NDArray[np.int64]) -> OpticalSpecies:
        """The same at some of the wavelengths; the extinction is shared."""
        return replace(
            self, relative_extinction=self.relative_extinction[which],
            single_scattering_albedo=self.single_scattering_albedo[which], phase=[self.phase[w] for w in which],
        )  # fmt: skip


@dataclass
class Background:
    """Spherically symmetric air at heights `height_m` (nz,); coefficients (nwl, nz) in 1/m. The aerosol's albedo
    (nwl,) and phase functions are those of its whole column. starlit: see `Air`."""

    height_m: FloatArray
    rayleigh_per_m: FloatArray
    absorption_per_m: FloatArray
    aerosol_per_m: FloatArray
    aerosol_scattering_per_m: FloatArray
    aerosol_albedo: FloatArray
    aerosol_phase: list[PhaseFunction]
    rayleigh_phase: PhaseFunction
    starlit: bool = False


def for_wavelengths(scene: Scene, wavelengths_nm: FloatArray) -> Scene:
    """The scene, and the wider ones around it, with lists of single-scattering albedos as {wavelength_nm: value}.

    A list is one value for each wavelength that will be rendered, whatever these are divided into later.
    """
    wider = scene.wider and for_wavelengths(scene.wider, wavelengths_nm)
    lists = [name for name, one in scene.optics.items() if isinstance(one.single_scattering_albedo, np.ndarray)]
    if wider is scene.wider and not lists:
        return scene
    out = copy(scene)
    given = {name: _by_wavelength(name, scene.optics[name], wavelengths_nm) for name in lists}
    out.optics = scene.optics | {
        name: replace(scene.optics[name], single_scattering_albedo=albedo) for name, albedo in given.items()
    }
    out.wider = wider
    return out


def scene_optics(scene: Scene, wavelengths_nm: ArrayLike) -> list[OpticalSpecies]:
    """The species of a scene that are anywhere present (possibly none), on scene.grid, at the wavelengths
    (nm).

    Hydrometeors by Eq. 7 (`openswim.optics.hydrometeors`), `aerosol_extinction`, and `extinction_<name>` with
    `scene.optics[name]`.
    """
    return list(each_species(scene, wavelengths_nm, cloud_cover(scene)))


def each_species(
    scene: Scene, wavelengths_nm: ArrayLike, cover: NDArray[np.float32] | None, names: Sequence[str] | None = None
) -> Iterator[OpticalSpecies]:
    """`scene_optics` one after the other, for those who keep none; cover: the scene's `cloud_cover`; names: of the
    species of another scene, whose droplets are to be divided by size as they were there."""
    wavelengths = np.atleast_1d(np.asarray(wavelengths_nm, float))
    for kind in hydrometeors.HYDROMETEORS:
        yield from (one for one in _hydrometeor(scene, kind, wavelengths, cover, names) if one.extinction_per_m.any())
    yield from (one for one in _aerosol(scene, wavelengths) if one.extinction_per_m.any())
    prefix = "extinction_"
    for name in map(str, scene.data.data_vars):
        if name.startswith(prefix):
            one = _direct(scene, name.removeprefix(prefix), wavelengths)
            if one.extinction_per_m.any():
                yield one


def _hydrometeor(
    scene: Scene, kind: str, wavelengths: FloatArray, cover: NDArray[np.float32] | None, names: Sequence[str] | None
) -> list[OpticalSpecies]:
    """One species at the mean effective radius; two where the model's own liquid radii differ much (`size_bins`)."""
    content = _field(scene, f"{kind}_content")
    if content is None:
        return []
    present = content > 0
    if not present.any():
        return []
    own, number = (_field(scene, f"{kind}_{what}") for what in ("effective_radius", "number"))
    share = np.float32(1) if cover is None or kind not in CLOUD else cover[present]  # sizes are those within cloud
    given = (None if own is None else own[present], None if number is None else number[present] / share)
    radius = hydrometeors.effective_radius_m(kind, content[present] / share, *given)
    extinction = hydrometeors.extinction_per_m(kind, content[present] / share, *given) * share
    extinction *= hydrometeors.extinction_factor(kind, REFERENCE_NM, radius)
    informed = own is not None or number is not None
    split_spread = SPLIT_SPREAD if informed else np.inf
    if names is not None:
        split_spread = 0.0 if f"{kind}, small" in names else np.inf
    found, shapes = [], Shapes.of(scene)
    level = {"plate": shapes.plates, "column": shapes.columns} if kind == "ice" else {}
    afloat = sum(level.values())
    for name, mean_m, weight in size_bins(kind, radius, extinction, split_spread):
        on_grid = np.zeros(content.shape, np.float32)
        on_grid[present] = extinction * weight
        found.append(_of_size(name, kind, on_grid * np.float32(1 - afloat), mean_m, wavelengths, shapes))
        if afloat:
            shares = tuple((shape, share / afloat) for shape, share in level.items() if share > 0)
            phase = [crystals.mixed(float(wl), shares) for wl in wavelengths]
            theirs = replace(found[-1], name=f"{name}, level", phase=phase, level=shares)
            found.append(replace(theirs, extinction_per_m=on_grid * np.float32(afloat)))
    return found


def size_bins(
    kind: str, radius_m: NDArray[np.floating], extinction: NDArray[np.floating], split_spread: float
) -> list[tuple[str, float, NDArray[np.floating] | float]]:
    """(name, effective radius, share of the extinction) of the species that stand for particles of many sizes.

    The mean and standard deviation of ln radius are weighted by extinction. A standard deviation below
    `split_spread`, or particles other than liquid: one species at the mean. Above: two, 1.25 standard deviations to
    either side, with shares linear in ln radius between them. Where both are present their cloudbows and glories add.
    """
    log_radius, weight = np.log(radius_m, dtype=float), extinction / extinction.sum(dtype=float)
    mean = float((weight * log_radius).sum())
    spread = float(np.sqrt((weight * (log_radius - mean) ** 2).sum()))
    if kind != "liquid" or spread <= max(split_spread, 1e-3):
        return [(kind, float(np.exp(mean)), 1.0)]
    low, high = mean - 1.25 * spread, mean + 1.25 * spread
    large = np.clip((log_radius - low) / (high - low), 0.0, 1.0)
    return [(f"{kind}, small", float(np.exp(low)), 1 - large), (f"{kind}, large", float(np.exp(high)), large)]


def _of_size(
    name: str, kind: str, extinction: NDArray[np.float32], radius_m: float, wavelengths: FloatArray, shapes: Shapes
) -> OpticalSpecies:
    reference = hydrometeors.extinction_factor(kind, REFERENCE_NM, radius_m)
    relative = [hydrometeors.extinction_factor(kind, float(wl), radius_m) / reference for wl in wavelengths]
    return OpticalSpecies(
        name=name,
        kind=kind,
        extinction_per_m=extinction,
        relative_extinction=np.array(relative, float),
        single_scattering_albedo=hydrometeors.single_scattering_albedo(kind, wavelengths, radius_m),
        phase=[hydrometeors.phase_function(kind, float(wl), radius_m, shapes) for wl in wavelengths],
        fine=kind == "liquid",
    )


def _aerosol(scene: Scene, wavelengths: FloatArray) -> list[OpticalSpecies]:
    """3-D aerosol: optics of the scene if it gives them, else of its background aerosol, else continental."""
    extinction = _field(scene, "aerosol_extinction")
    if extinction is None:
        return []
    layers = () if scene.atmosphere is None else scene.atmosphere.layers
    profile = layers[0] if layers else None
    character = aerosol.type_of_profile(profile)
    own = scene.optics.get("aerosol")
    if own is not None and (own.angstrom_exponent is not None or own.relative_extinction is not None):
        relative = relative_extinction(wavelengths, REFERENCE_NM, own.angstrom_exponent or 0.0, own.relative_extinction)
    else:
        spectrum = None if profile is None else profile.relative_extinction
        relative = relative_extinction(wavelengths, REFERENCE_NM, character.angstrom_exponent, spectrum)
    return [
        OpticalSpecies(
            name="aerosol",
            kind="aerosol",
            extinction_per_m=beside_background(scene, "aerosol", extinction),
            relative_extinction=relative,
            single_scattering_albedo=aerosol.spectral_albedo(character, wavelengths)
            if own is None
            else _albedo("aerosol", own, wavelengths),
            phase=phases_at(character.phase if own is None else own.phase, wavelengths),
        )
    ]


def _direct(scene: Scene, name: str, wavelengths: FloatArray) -> OpticalSpecies:
    extinction = _field(scene, f"extinction_{name}")
    optics = scene.optics.get(name)
    if extinction is None or optics is None:
        raise UserError(f"extinction_{name} needs its optics: give scene.optics[{name!r}]")
    return OpticalSpecies(
        name=name,
        kind=optics.kind,
        extinction_per_m=beside_background(scene, name, extinction),
        relative_extinction=relative_extinction(
            wavelengths, REFERENCE_NM, optics.angstrom_exponent or 0.0, optics.relative_extinction
        ),
        single_scattering_albedo=_albedo(name, optics, wavelengths),
        phase=phases_at(optics.phase, wavelengths),
    )


def _albedo(name: str, optics: Optics, wavelengths: FloatArray) -> FloatArray:
    return aerosol.interpolate_spectral(_by_wavelength(name, optics, wavelengths), wavelengths)


def _by_wavelength(name: str, optics: Optics, wavelengths: FloatArray) -> float | Mapping[float, float]:
    """Albedo of a species, a list as {wavelength_nm: value}."""
    albedo = optics.single_scattering_albedo
    if not isinstance(albedo, np.ndarray):
        return albedo
    if albedo.size != wavelengths.size:
        raise UserError(
            f"species {name!r} has {albedo.size} single-scattering albedos for {wavelengths.size} "
            "wavelengths: give one, or one per wavelength"
        )
    return dict(zip(wavelengths.tolist(), albedo.tolist(), strict=True))


def _field(scene: Scene, name: str) -> NDArray[np.float32] | None:
    if name not in scene.data:
        return None
    return np.asarray(scene.data[name].transpose("z", "y", "x").values, np.float32)


def background(
    atmosphere: Atmosphere | None, wavelengths_nm: ArrayLike, height_m: ArrayLike, terms: Terms | None = None
) -> Background:
    """Rayleigh scattering, ozone absorption and aerosol of a 1-D atmosphere at heights (nz,) and wavelengths
    (nm).

    `atmosphere=None` is a vacuum: all coefficients zero. terms: of the same wavelengths, whose gases absorb too.
    """
    wavelengths = np.atleast_1d(np.asarray(wavelengths_nm, float))
    height = np.atleast_1d(np.asarray(height_m, float))
    particles = layers_optics(() if atmosphere is None else atmosphere.layers, wavelengths, height)
    scattering = absorption = np.zeros((wavelengths.size, height.size))
    if atmosphere is not None:
        pressure, temperature, ozone = atmosphere.at(height)
        scattering = rayleigh_scattering_per_m(wavelengths, pressure, temperature)
        absorption = np.multiply.outer(ozone_cross_section_m2(wavelengths), ozone)
        if terms is not None:
            absorption += terms.absorption_per_m(atmosphere, height)
    return Background(
        height_m=height,
        rayleigh_per_m=scattering,
        absorption_per_m=absorption,
        aerosol_per_m=particles.extinction_per_m,
        aerosol_scattering_per_m=particles.scattering_per_m,
        aerosol_albedo=particles.albedo,
        aerosol_phase=particles.phase,
        rayleigh_phase=Rayleigh(float(depolarisation_factor(float(wavelengths.mean())))),
    )
