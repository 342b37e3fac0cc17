"""Solvers with closed-form answers, to check the geometry and the bookkeeping around a real one."""

from collections.abc import Callable
from dataclasses import dataclass, field
from types import SimpleNamespace
from typing import Any

import numpy as np

Radiance = Callable[[Any, np.ndarray, np.ndarray, np.ndarray], np.ndarray]


@dataclass
class FakeSolver:
    """`radiance(scene, sun, origin (n, 3), direction (n, 3))` -> L' (n,), the same at every wavelength."""

    radiance: Radiance
    fluxes: Callable[[Any, np.ndarray], dict[str, float]] | None = None
    name: str = "fake"
    scenes: list[Any] = field(default_factory=list)
    rays: list[tuple[np.ndarray, np.ndarray]] = field(default_factory=list)

    def solve(self, scene: Any, sun_direction: Any, wavelengths_nm: Any) -> Any:
        self.scenes.append(scene)
        sun, bands = np.asarray(sun_direction), len(wavelengths_nm)

        def view(rays: Any) -> Any:
            origin, direction = rays.origins(), rays.directions()
            self.rays.append((origin, direction))
            values = self.radiance(scene, sun, origin, direction)
            return SimpleNamespace(radiance=np.repeat(values[:, None], bands, axis=1))

        def fluxes() -> dict[str, np.ndarray]:
            assert self.fluxes is not None
            return {name: np.full(bands, value) for name, value in self.fluxes(scene, sun).items()}

        return SimpleNamespace(view=view, fluxes=fluxes)


def single_scattering(scene: Any, sun: np.ndarray, origin: np.ndarray, direction: np.ndarray) -> np.ndarray:
    """L' of a homogeneous layer by single scattering over a Lambertian ground: exact in the thin limit."""
    beta = float(scene.data["extinction_cloud"].max())
    tau = beta * float(np.ptp(scene.grid.height_m))
    optics = scene.optics["cloud"]
    source = optics.single_scattering_albedo * optics.phase.value(np.clip(direction @ sun, -1, 1))
    mu0, mu = sun[2], np.abs(direction[:, 2])
    mu = np.where(np.abs(mu - mu0) < 1e-6, mu + 1e-5, mu)
    down = source * mu0 / (mu0 - mu) * (np.exp(-tau / mu0) - np.exp(-tau / mu))
    slant = tau * (1 / mu0 + 1 / mu)
    ground = 4 * float(scene.data["surface_albedo"].mean()) * mu0 * np.exp(-slant)
    up = source * mu0 / (mu0 + mu) * (1 - np.exp(-slant)) + ground
    return np.where(direction[:, 2] > 0, down, up)
