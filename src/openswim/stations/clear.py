"""Diffuse light of a clear sky at any altitude of the sun, from few solves.

A clear sky over even ground depends on the sun's altitude alone. It is solved for at the ends, and then wherever the
curve through the solved altitudes is found to be off: an interval is halved until its middle is predicted within the
tolerance. The logarithm of the light goes through a monotone cubic (PCHIP), nodes being dense near the horizon.
"""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from openswim.stations.planes import Planes

F64 = NDArray[np.float64]

TOLERANCE_W_M2 = 0.4  # of broadband diffuse light
TOLERANCE = 0.004  # or of its own size, where that is more
_LESS_BY_HALVING = 4.0  # the error of a half, whose middle need not be tried; 5 to 50 as measured
_FIRST, _MOST = 4, 16  # solves
_TOP_W_M2 = 1000.0  # of the solar constant, the part that is scattered much
_NEAR_HORIZON = 0.08  # sine of the altitude below which the light changes as fast as that
_AZIMUTHS = 12  # about the sun, for the curve of a tilted plane's light; it has so many harmonics as half of them


class ClearLight:
    """The curve of diffuse light over the sun's altitude, between two of them.

    solve : from the sun's altitude (degrees) and planes whose azimuths count from the sun's, to (1 + 2 planes, nw)
        relative diffuse light. planes : their tilts matter here.
    """

    def __init__(
        self, solve: Callable[[float, Planes], F64], altitudes_deg: tuple[float, float], planes: Planes
    ) -> None:
        self.tilts, self.which = np.unique(planes.tilt_deg, return_inverse=True)
        around = np.arange(_AZIMUTHS) * 360.0 / _AZIMUTHS
        about_sun = Planes(np.repeat(self.tilts, _AZIMUTHS), np.tile(around, self.tilts.size))
        found: dict[float, F64] = {}

        def at(node: float) -> F64:
            if node not in found:
                found[node] = np.maximum(solve(float(_altitude_deg(node)), about_sun), 1e-12)
            return found[node]

        self.low, self.high = (float(_stretched(angle)) for angle in altitudes_deg)
        first = np.linspace(self.low, self.high, _FIRST).tolist() if self.high - self.low > 1e-2 else [self.high]
        for node in first:
            at(node)
        left = list(pairwise(first))
        while left and len(found) < _MOST:
            # the lowest intervals bend most: these first
            below, above = left.pop(0)
            middle = 0.5 * (below + above)
            expected = self._curve(found)(middle)
            error = _TOP_W_M2 * abs(float(np.mean(np.exp(expected) - at(middle)[0])))
            near = max(TOLERANCE_W_M2, TOLERANCE * _TOP_W_M2 * float(at(middle)[0].mean()))
            if error > _LESS_BY_HALVING * near:
                left += [(below, middle), (middle, above)]
        self.log_diffuse = self._curve(found)
        if not self.tilts.size:
            self.solves = len(found)
            return
        nodes = np.array(sorted(found))
        ratios = np.stack([found[node][1:] / found[node][:1] for node in nodes])
        shape = (nodes.size, 2, self.tilts.size, _AZIMUTHS, ratios.shape[-1])  # from above and below the horizon
        waves = np.fft.rfft(ratios.reshape(shape), axis=3) / _AZIMUTHS
        self.waves = _through(nodes, waves.real)  # even about the sun's azimuth
        self.solves = len(found)

    @staticmethod
    def _curve(found: dict[float, F64]) -> Callable[[float | F64], F64]:
        nodes = sorted(found)
        return _through(np.array(nodes), np.log(np.stack([found[node][0] for node in nodes])))

    def diffuse(self, altitude_deg: F64, azimuth_deg: F64, planes: Planes) -> F64:
        """(nt, 1 + 2 planes, nw), as `relative_diffuse` has it, at altitudes and azimuths (nt,) of the sun."""
        node = np.clip(_stretched(altitude_deg), self.low, self.high)
        horizontal = np.exp(self.log_diffuse(node))[:, None]
        if not len(planes):
            return horizontal
        waves = self.waves(node)[:, :, self.which]  # (nt, 2, planes, harmonics, nw)
        from_sun = np.radians(planes.azimuth_deg - azimuth_deg[:, None])
        order = np.arange(waves.shape[3])
        twice = np.where((order == 0) | (order == _AZIMUTHS / 2), 1.0, 2.0)
        ratio = np.einsum("tspkw,tpk->tspw", waves, twice * np.cos(from_sun[..., None] * order))
        ratio = ratio.reshape(node.size, -1, waves.shape[-1])
        return np.concatenate([horizontal, horizontal * ratio], axis=1)


def _stretched(altitude_deg: float | F64) -> F64:
    """The coordinate of the nodes: like the logarithm of the sine of the altitude, but linear through the horizon."""
    return np.asarray(np.arcsinh(np.sin(np.radians(altitude_deg)) / _NEAR_HORIZON))


def _altitude_deg(node: float) -> F64:
    return np.degrees(np.arcsin(np.clip(_NEAR_HORIZON * np.sinh(node), -1, 1)))


def _through(x: F64, y: F64) -> Callable[[float | F64], F64]:
    from scipy.interpolate import PchipInterpolator

    if x.size == 1:
        return lambda at: np.broadcast_to(y[0], np.shape(at) + y.shape[1:])
    curve: Callable[[float | F64], F64] = PchipInterpolator(x, y)
    return curve
