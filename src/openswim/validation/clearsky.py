"""Clear skies on a spherical Earth: from the ground, the air and space, by day and in twilight."""

from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from openswim.cameras import Rays
from openswim.scene import Scene
from openswim.scene.aerosol import AerosolProfile
from openswim.scene.atmosphere import Atmosphere
from openswim.scene.frame import Frame, scene_frame
from openswim.validation.reference import Reference, Row, Solver, Stopwatch, groups, with_sigma
from openswim.validation.reference.metrics import agreement, score
from openswim.validation.reference.phases import PhaseTables

Array = NDArray[np.float64]

# The references are the same everywhere on the sphere: any place and any azimuth of the sun will do.
_LAT, _LON, _SUN_AZIMUTH_DEG = 40.0, 10.0, 150.0
_SPACE_M = 800_000.0
_EYE_M = 1.0  # an observer on the ground
_NOISIEST = 0.1  # standard deviation over value beyond which a Monte Carlo value tells nothing


class ClearSky:
    """The solved clear sky of one sun, aerosol and ground; the references' atmosphere is the default one.

    US standard gas with 300 DU of ozone; aerosol exp(-z/1.5 km), Angstrom 1.3, albedo .95, HG g = .65.
    """

    def __init__(
        self, solver: Solver, sza_deg: float, aod550: float, albedo: float, wavelengths_nm: Array
    ) -> None:
        aerosol = AerosolProfile(optical_depth=aod550, base_height_m=0.0) if aod550 > 0 else None
        atmosphere = Atmosphere.us_standard(ozone_du=300.0, aerosol=aerosol)
        scene = Scene.clear(_LAT, _LON, atmosphere, surface_albedo=albedo)
        self.frame: Frame = scene_frame(scene)
        sun = self.frame.direction(_SUN_AZIMUTH_DEG, 90.0 - sza_deg, _LAT, _LON)
        self.field: Any = solver.solve(scene, sun, wavelengths_nm)

    def _direction(self, zenith_deg: ArrayLike, azimuth_deg: ArrayLike) -> Array:
        """Unit vectors (n, 3) at the place; azimuth from the sun's."""
        zenith, azimuth = np.broadcast_arrays(np.asarray(zenith_deg, float), np.asarray(azimuth_deg, float))
        return self.frame.direction(_SUN_AZIMUTH_DEG + azimuth, 90.0 - zenith, _LAT, _LON)

    def _position(self, height_m: ArrayLike) -> Array:
        return self.frame.position(_LAT, _LON, height_m)

    def _radiance(self, origin_m: Array, direction: Array) -> Array:
        origin = np.broadcast_to(origin_m, direction.shape)
        if len(direction) == 0:
            return np.zeros((2, 0, len(self.field.wavelengths_nm)))
        if len(np.unique(origin, axis=0)) <= 1 or len(np.unique(direction, axis=0)) <= 1:
            return np.stack(with_sigma(self.field.view(Rays(origin, direction))))
        # an eye stands at one place, or looks along parallel rays
        one_by_one = [with_sigma(self.field.view(Rays(o, d[None]))) for o, d in zip(origin, direction, strict=True)]
        return np.concatenate([np.stack(each) for each in one_by_one], axis=1)

    def from_inside(self, height_m: ArrayLike, zenith_deg: ArrayLike, azimuth_deg: ArrayLike) -> Array:
        """L' and its standard error (2, n, nwl) seen from heights (m), at angles from the zenith (over 90: down)."""
        origin = self._position(np.maximum(np.asarray(height_m, float), _EYE_M))
        return self._radiance(origin, self._direction(zenith_deg, azimuth_deg))

    def ground_from_space(self, zenith_deg: ArrayLike, azimuth_deg: ArrayLike) -> Array:
        """L' and its standard error (2, n, nwl) leaving the atmosphere above a ground point; azimuth 0: forward."""
        upward = self._direction(zenith_deg, np.asarray(azimuth_deg, float) + 180.0)
        ground = self._position(0.0)
        return self._radiance(ground + self._distance_to_space(0.0, zenith_deg)[:, None] * upward, -upward)

    def limb(self, tangent_height_m: ArrayLike, azimuth_deg: ArrayLike) -> Array:
        """L' and its standard error (2, n, nwl) along rays lowest above the place; azimuth 0: toward the sun."""
        height = np.asarray(tangent_height_m, float)
        along = self._direction(90.0, azimuth_deg)
        return self._radiance(
            self._position(height) - self._distance_to_space(height, 90.0)[:, None] * along, along
        )

    def _distance_to_space(self, height_m: ArrayLike, zenith_deg: ArrayLike) -> Array:
        """Distance (m) to 800 km above sea level from a height, in a direction given by its zenith angle."""
        start = self.frame.radius_m + np.asarray(height_m, float)
        rise = start * np.cos(np.radians(zenith_deg))
        top = self.frame.radius_m + _SPACE_M
        return np.atleast_1d(np.sqrt(rise**2 + top**2 - start**2) - rise)


def is_sky_file(reference: Reference) -> bool:
    return reference.has("case_sza", "case_aod550", "case_albedo", "wavelength") and bool(
        _observers(reference)
    )


def compare_sky_file(reference: Reference, solver: Solver, phases: PhaseTables) -> Iterator[Row]:
    """Rows per observer height, wavelength and solar zenith angle; aerosols and grounds together."""
    data, watch = reference.data, Stopwatch()
    wavelengths = data.wavelength.values.astype(float)
    for (sza,), cases in groups(data.case_sza.values):
        model: dict[str, list[Array]] = {name: [] for name in _observers(reference)}
        for case in cases:
            aod, albedo = (round(float(data[name][case]), 6) for name in ("case_aod550", "case_albedo"))
            with watch.running():
                sky = ClearSky(solver, sza, aod, albedo, wavelengths)
                for name, height_m in _observers(reference).items():
                    zenith, azimuth = np.meshgrid(data[f"vza_{name}"], data.raa, indexing="ij")
                    seen = sky.from_inside(height_m, zenith.ravel(), azimuth.ravel())
                    model[name].append(np.moveaxis(seen, -1, 1).reshape(2, -1, *zenith.shape))
        cpu = watch.lap() / (len(model) * wavelengths.size)
        for name, images in model.items():
            truth = data[f"Lp_{name}"].transpose("case", "wavelength", f"vza_{name}", "raa").values[cases]
            for k, wavelength in enumerate(wavelengths):
                quantity = f"radiance from {name}, {wavelength:g} nm, sza {sza:g}"
                value, sigma = np.stack(images, axis=1)[:, :, k]
                found = score(value, truth[:, k], sigma)
                yield reference.row(solver.name, quantity, found, cpu, agreement(value, truth[:, k], sigma))


def _observers(reference: Reference) -> dict[str, float]:
    """Observers by name with their heights in m: Lp_ground is 0, Lp_10km is 10,000."""
    found = {}
    for variable in map(str, reference.data.data_vars):
        name = variable.removeprefix("Lp_")
        height = "0" if name == "ground" else name.removesuffix("km")
        if name != variable and f"vza_{name}" in reference.data and height.replace(".", "", 1).isdigit():
            found[name] = 1000.0 * float(height)
    return found


def is_sky_table(reference: Reference) -> bool:
    return (
        reference.is_table
        and reference.has("sza", "aod550", "albedo", "wl", "Lp")
        and "kind" not in reference.data
    )


def compare_sky_table(reference: Reference, solver: Solver, phases: PhaseTables) -> Iterator[Row]:
    """Rows per observer height, sun and wavelength; without columns vza and raa the zenith is meant, and the
    wavelengths share a row."""
    height = reference.column("obs_alt_m", 0.0)
    zenith, azimuth = reference.column("vza", 0.0), reference.column("raa", 0.0)
    sigma = reference.column("Lp_stderr", 0.0)

    def view(sky: ClearSky, rows: NDArray[np.intp]) -> Array:
        return sky.from_inside(height[rows], zenith[rows], azimuth[rows])

    bands = [f"{w:g} nm" if "vza" in reference.data else "zenith" for w in reference.column("wl")]
    labels = np.array(
        [f"radiance from {h / 1000:g} km, {band}" for h, band in zip(height, bands, strict=True)]
    )
    yield from _compare_table(reference, solver, labels, sigma, view)


def is_space_table(reference: Reference) -> bool:
    columns = ("kind", "sza", "aod550", "albedo", "wl", "vza_or_tangent_km", "raa", "Lp")
    return reference.is_table and reference.has(*columns)


def compare_space_table(reference: Reference, solver: Solver, phases: PhaseTables) -> Iterator[Row]:
    """Rows per kind (nadir, limb), solar zenith angle and wavelength."""
    kind, azimuth = reference.column("kind"), reference.column("raa")
    zenith_or_km = reference.column("vza_or_tangent_km")

    def view(sky: ClearSky, rows: NDArray[np.intp]) -> Array:
        limb = kind[rows] == "limb"
        seen = sky.ground_from_space(np.where(limb, 0.0, zenith_or_km[rows]), azimuth[rows])
        seen[:, limb] = sky.limb(1000.0 * zenith_or_km[rows][limb], azimuth[rows][limb])
        return seen

    labels = np.array(
        [f"{k} radiance from space, {w:g} nm" for k, w in zip(kind, reference.column("wl"), strict=True)]
    )
    yield from _compare_table(reference, solver, labels, np.zeros(len(kind)), view)


def _compare_table(
    reference: Reference, solver: Solver, labels: NDArray[Any], sigma: Array, view: Any
) -> Iterator[Row]:
    """Solve once per sun, aerosol and ground; one row per label and sun.

    Values whose own noise exceeds 10 % (deep twilight) are left out.
    """
    watch = Stopwatch()
    sza, aod, albedo, wl = (reference.column(name) for name in ("sza", "aod550", "albedo", "wl"))
    wavelengths = np.unique(wl)
    model, own = np.full(wl.shape, np.nan), np.zeros(wl.shape)
    cpu: dict[float, float] = {}
    for (sun, depth, ground), rows in groups(sza, aod, albedo):
        with watch.running():
            seen = view(ClearSky(solver, sun, depth, ground, wavelengths), rows)
        model[rows], own[rows] = seen[:, np.arange(rows.size), np.searchsorted(wavelengths, wl[rows])]
        cpu[sun] = cpu.get(sun, 0.0) + watch.lap()
    truth = reference.column("Lp")
    telling = sigma <= _NOISIEST * truth
    for (label, sun), group in groups(labels, sza):
        rows = group[telling[group]]
        share = cpu[sun] * group.size / np.count_nonzero(sza == sun)
        if rows.size:
            found = score(model[rows], truth[rows], np.hypot(sigma[rows], own[rows]))
            near = agreement(model[rows], truth[rows], own[rows], sigma[rows])
            yield reference.row(solver.name, f"{label}, sza {sun:g}", found, share, near)
