"""The clear sky at any solar altitude, from few solves: it depends on solar altitude alone, but for the azimuth."""

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from openswim.cameras import Camera
from openswim.cameras.pixels import Pixels
from openswim.lighting import WAVELENGTHS_NM, light
from openswim.lights import solar_irradiance
from openswim.scene import Scene
from openswim.scene.atmosphere import Atmosphere
from openswim.scene.frame import horizon_vector
from openswim.scene.phase import HenyeyGreenstein

F64 = NDArray[np.float64]
SUNS_DEG = (
    -8, -7, -6, -5, -4, -3, -2, -1, 0, 1, 2, 3, 4, 5, 6, 7, 8.5, 10, 12, 14, 16.5, 19, 22, 26, 30, 35, 41, 48, 57,
    67, 78, 90,
)  # fmt: skip
_ALTITUDE = np.concatenate([[0, 0.5, 1, 1.7, 2.5, 4, 6, 8.5], np.arange(11, 88, 3.5), [90]])
_AZIMUTH = np.concatenate([np.arange(0, 20, 2.5), np.arange(20, 60, 5.0), np.arange(60, 181, 10.0)])
_LAT = 45.0


@dataclass(eq=False)
class ClearTable:
    """Radiance of the clear sky above the horizon for suns of -8 to 90 degrees; a sun is solved for when it is needed.

    Between the nodes the logarithm of radiance over what single scattering looks like (Rayleigh's and the haze's phase
    function) is interpolated: it has no aureole, and is smooth.
    """

    atmosphere: Atmosphere | None
    albedo: float
    ground_m: float
    height_m: float
    solver: Any
    _nodes: dict[int, F64] = field(default_factory=dict, repr=False)

    def radiance(self, pixels: Pixels, sun: tuple[float, float], distance_au: float) -> F64:
        """(ny, nx, 3), W m-2 sr-1 nm-1; NaN below the horizon and outside; without the sun's disc."""
        azimuth, height = sun
        height = float(np.clip(height, SUNS_DEG[0], SUNS_DEG[-1]))
        upper = int(np.clip(np.searchsorted(SUNS_DEG, height), 1, len(SUNS_DEG) - 1))
        share = (height - SUNS_DEG[upper - 1]) / (SUNS_DEG[upper] - SUNS_DEG[upper - 1])
        with np.errstate(invalid="ignore"):
            seen = pixels.inside & (pixels.altitude_deg >= 0)
        altitude, away = pixels.altitude_deg[seen], np.abs((pixels.azimuth_deg[seen] - azimuth + 180) % 360 - 180)
        rows, columns = (_between(nodes, at) for nodes, at in ((_ALTITUDE, altitude), (_AZIMUTH, away)))
        smooth = _mixed((1 - share) * self._node(upper - 1) + share * self._node(upper), rows, columns)
        cosine = pixels.direction[seen] @ horizon_vector(azimuth, height)
        relative = np.exp(smooth) * self._scattering(cosine)
        per_relative = solar_irradiance(np.array(WAVELENGTHS_NM)) / (4 * np.pi * distance_au**2)
        out = np.full((*pixels.inside.shape, 3), np.nan)
        out[seen] = relative * per_relative
        return out

    def _node(self, number: int) -> F64:
        """(altitudes, azimuths, 3): ln of L' over the look of single scattering, for the sun of a number."""
        if number not in self._nodes:
            height = SUNS_DEG[number]
            scene = Scene.clear(_LAT, 0.0, self.atmosphere, self.albedo, self.ground_m)
            eye = light(scene, self.solver, WAVELENGTHS_NM, sun=(0.0, float(height))).viewpoint(
                Camera.allsky(_LAT, 0.0, self.height_m, size=4)
            )
            altitude, azimuth = np.meshgrid(np.maximum(_ALTITUDE, 0.02), _AZIMUTH, indexing="ij")
            seen = eye.look(azimuth.ravel(), altitude.ravel())
            cosine = horizon_vector(azimuth.ravel(), altitude.ravel()) @ horizon_vector(0.0, float(height))
            smooth = np.log(np.maximum(seen, 1e-12) / self._scattering(cosine))
            self._nodes[number] = smooth.reshape(*altitude.shape, 3)
        return self._nodes[number]

    def _scattering(self, cosine: F64) -> F64:
        """(n, 3): what scatters once by angles of a cosine (n,)."""
        look = np.repeat(0.75 * (1 + cosine**2)[:, None], 3, axis=1)
        of_air = np.array([0.06, 0.1, 0.22])  # Rayleigh's depths, nearly
        for layer in () if self.atmosphere is None else self.atmosphere.layers:
            phase = layer.phase if hasattr(layer.phase, "value") else HenyeyGreenstein(0.65)
            depth = layer.optical_depth_at(np.array(WAVELENGTHS_NM))
            look = look + (depth / of_air) * np.asarray(phase.value(cosine))[:, None]  # type: ignore[union-attr]
        return look


def _between(nodes: F64, at: F64) -> tuple[NDArray[np.intp], F64]:
    lower = np.clip(np.searchsorted(nodes, at, side="right") - 1, 0, len(nodes) - 2)
    return lower, (at - nodes[lower]) / (nodes[lower + 1] - nodes[lower])


def _mixed(table: F64, rows: tuple[NDArray[np.intp], F64], columns: tuple[NDArray[np.intp], F64]) -> F64:
    (i, v), (j, u) = rows, columns
    v, u = v[:, None], u[:, None]
    return np.asarray(
        (1 - v) * ((1 - u) * table[i, j] + u * table[i, j + 1])
        + v * ((1 - u) * table[i + 1, j] + u * table[i + 1, j + 1])
    )
