"""Homogeneous plane-parallel layers over a Lambertian ground: fluxes and radiances by DISORT."""

from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import ArrayLike, NDArray

from openswim.cameras import Rays
from openswim.errors import UserError
from openswim.scene import Scene
from openswim.scene.phase import PhaseFunction
from openswim.validation.reference import Reference, Row, Solver, Stopwatch, groups, with_sigma
from openswim.validation.reference.metrics import agreement, score
from openswim.validation.reference.phases import PhaseTables, named_phases, phase_of_attributes

Array = NDArray[np.float64]

WAVELENGTH_NM = 550.0  # monochromatic, no gas: any will do
THICKNESS_M = 1000.0
_COLUMNS = 4
_CELL_DEPTH = 0.5  # optical depth of a cell that the layer is cut into, within the limits below
_FEWEST_CELLS, _MOST_CELLS = 32, 128


@dataclass(frozen=True)
class Slab:
    """One layer in one light: optical depth, solar zenith (degrees), single-scattering and ground albedo."""

    tau: float
    sza: float
    omega: float
    albedo: float

    @property
    def mu0(self) -> float:
        return float(np.cos(np.radians(self.sza)))

    def scene(self, phase: PhaseFunction) -> Scene:
        """The layer in cubic cells from the ground to 1 km, with periodic sides."""
        cells = int(np.clip(np.ceil(self.tau / _CELL_DEPTH), _FEWEST_CELLS, _MOST_CELLS))
        step = THICKNESS_M / cells
        across = step * np.arange(_COLUMNS)
        return Scene.from_arrays(
            np.full((cells + 1, _COLUMNS, _COLUMNS), self.tau / THICKNESS_M, np.float32),
            across,
            across,
            step * np.arange(cells + 1),
            single_scattering_albedo=self.omega,
            phase=phase,
            periodic=True,
            surface_albedo=self.albedo,
        )

    def solve(self, solver: Solver, phase: PhaseFunction) -> Any:
        sun = np.array([np.sin(np.radians(self.sza)), 0.0, self.mu0])
        return solver.solve(self.scene(phase), sun, np.array([WAVELENGTH_NM]))


def radiance(
    solved: Any, view_zenith_deg: ArrayLike, azimuth_deg: ArrayLike, upward: bool
) -> tuple[Array, Array]:
    """L' along lines of sight (broadcast shape) and its standard error: up from the ground, or down from above
    (`upward` light).

    view_zenith_deg from the vertical; azimuth_deg from the sun's, 0 = looking toward it (forward scatter).
    """
    zenith, azimuth = np.broadcast_arrays(np.radians(view_zenith_deg), np.radians(azimuth_deg))
    vertical = -1.0 if upward else 1.0
    direction = np.stack(
        [np.sin(zenith) * np.cos(azimuth), np.sin(zenith) * np.sin(azimuth), vertical * np.cos(zenith)],
        axis=-1,
    )
    height = THICKNESS_M + 1.0 if upward else 0.0
    seen = with_sigma(solved.view(Rays(np.array([0.0, 0.0, height]), direction.reshape(-1, 3))))
    return seen[0][:, 0].reshape(zenith.shape), seen[1][:, 0].reshape(zenith.shape)


def flux(solved: Any, *names: str, per: float = 1.0) -> tuple[float, float]:
    """Sum of the named domain-mean fluxes for E_TOA = 1 over ``per``, and its standard error."""
    fluxes = solved.fluxes()
    errors = solved.flux_errors() if hasattr(solved, "flux_errors") else {}
    whole = sum(np.asarray(fluxes[name]).ravel()[0] for name in names)
    variance = sum(float(np.ravel(errors[name])[0]) ** 2 for name in names if name in errors)
    return float(whole) / per, float(np.sqrt(variance)) / per


@dataclass
class Collected:
    """Model and reference values of several cases, by quantity."""

    model: dict[str, list[Array]] = field(default_factory=dict)
    truth: dict[str, list[Array]] = field(default_factory=dict)
    sigma: dict[str, list[Array]] = field(default_factory=dict)

    def add(self, quantity: str, model: tuple[ArrayLike, ArrayLike], truth: ArrayLike) -> None:
        """``model``: values and their standard errors."""
        self.model.setdefault(quantity, []).append(np.ravel(model[0]))
        self.sigma.setdefault(quantity, []).append(np.ravel(model[1]))
        self.truth.setdefault(quantity, []).append(np.ravel(truth))

    def rows(self, reference: Reference, solver: Solver, suffix: str, cpu_seconds: float) -> Iterator[Row]:
        """A row per quantity; the CPU time, spent on all of them together, is shared out evenly."""
        for quantity, model in self.model.items():
            values, truth, sigma = (np.concatenate(a) for a in (model, self.truth[quantity], self.sigma[quantity]))
            yield reference.row(
                solver.name, f"{quantity}, {suffix}", score(values, truth, sigma), cpu_seconds / len(self.model),
                agreement(values, truth, sigma),
            )  # fmt: skip


def is_slab_file(reference: Reference) -> bool:
    return reference.has("tau", "sza", "albedo", "up_top", "dn_bot", "view_zenith", "relative_azimuth")


def compare_slab_file(reference: Reference, solver: Solver, phases: PhaseTables) -> Iterator[Row]:
    """Rows per optical depth and ground albedo: upward and downward flux and radiance."""
    data = reference.data.transpose("case", "view_zenith", "relative_azimuth")
    phase = phase_of_attributes(data.attrs, reference.path.name)
    zenith, azimuth = np.meshgrid(data.view_zenith.values, data.relative_azimuth.values, indexing="ij")
    watch = Stopwatch()
    for (tau, albedo), cases in groups(data.tau.values, data.albedo.values):
        found = Collected()
        for one in (data.isel(case=int(case)) for case in cases):
            with watch.running():
                solved = _slab_of(one).solve(solver, phase)
                up, down = (radiance(solved, zenith, azimuth, upward) for upward in (True, False))
            found.add("radiance up", up, one.up_top.values)
            found.add("radiance down", down, one.dn_bot.values)
            if "flux_up_top" in one:
                found.add("flux up", flux(solved, "up_top"), one.flux_up_top.values)
            if "flux_dir_bot" in one and "flux_dif_dn_bot" in one:
                total = one.flux_dir_bot.values + one.flux_dif_dn_bot.values
                found.add("flux down", flux(solved, "direct_bottom", "down_bottom"), total)
        yield from found.rows(reference, solver, f"tau {tau:g}, albedo {albedo:g}", watch.lap())


def is_aerosol_file(reference: Reference) -> bool:
    return reference.has("tau", "sza", "albedo", "principal_plane", "almucantar", "view_zenith", "azimuth")


def compare_aerosol_file(reference: Reference, solver: Solver, phases: PhaseTables) -> Iterator[Row]:
    """Rows per phase function and optical depth: sky in the principal plane and the almucantar, flux."""
    data, watch = reference.data, Stopwatch()
    by_name = named_phases(str(data.attrs.get("phase_function", "")))
    for (name, tau), cases in groups(data.phase.values, data.tau.values):
        if name not in by_name:
            raise UserError(f"{reference.path.name}: attribute phase_function does not define {name!r}")
        found = Collected()
        for one in (data.isel(case=int(case)) for case in cases):
            zenith = one.view_zenith.values  # positive toward the sun
            with watch.running():
                solved = _slab_of(one).solve(solver, by_name[name])
                plane = radiance(solved, np.abs(zenith), np.where(zenith >= 0, 0.0, 180.0), upward=False)
                circle = radiance(solved, float(one.sza), one.azimuth.values, upward=False)
            found.add("principal plane", plane, one.principal_plane.values)
            found.add("almucantar", circle, one.almucantar.values)
            if "flux_dif" in one:
                found.add("diffuse flux", flux(solved, "down_bottom"), one.flux_dif.values)
        yield from found.rows(reference, solver, f"{name}, tau {tau:g}", watch.lap())


def _slab_of(case: xr.Dataset) -> Slab:
    omega = float(case.omega) if "omega" in case else 1.0
    return Slab(float(case.tau), float(case.sza), omega, float(case.albedo))
