"""Random numbers and phase functions of the Monte Carlo kernels.

A scattering angle is held as q = 1 - cos(angle), exact where the forward peak is. Phase functions are linear in q
between the nodes of one common table, and directions are drawn from just that function: no weight is needed.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from openswim.scene.phase import PhaseFunction
from openswim.transport.engine.compiled import part

F64 = NDArray[np.float64]

HALF_NODES = 1536  # nodes from 0 to 90 degrees, at q = (i/n)^4, and mirrored from 90 to 180
_GUIDES = 4096

_LAYERS = 256
_TAIL = 7.69711747013104972  # of the ziggurat, whose layers have the area of _TAIL's and what is beyond


def _ziggurat() -> tuple[F64, F64]:
    """Widths (257,) of the layers under exp(-x), and exp(-width)."""
    area = (_TAIL + 1.0) * math.exp(-_TAIL)
    x = [area * math.exp(_TAIL), _TAIL]
    while len(x) < _LAYERS:
        x.append(-math.log(area / x[-1] + math.exp(-x[-1])))
    x.append(0.0)
    return np.array(x), np.exp(-np.array(x))


_WIDTH, _HEIGHT = _ziggurat()

_GAMMA = np.uint64(0x9E3779B97F4A7C15)
_MIX_1, _MIX_2 = np.uint64(0xBF58476D1CE4E5B9), np.uint64(0x94D049BB133111EB)
_S30, _S27, _S31, _S11 = np.uint64(30), np.uint64(27), np.uint64(31), np.uint64(11)
_LOW_8 = np.uint64(0xFF)
_LOW_32, _S32 = np.uint64(0xFFFFFFFF), np.uint64(32)


class Phases(NamedTuple):
    """Phase functions of all scatterers at all wavelengths, row = scatterer * wavelengths + wavelength."""

    q: F64  # (nodes,)
    value: F64  # (rows, nodes), mean 1 over the sphere
    chance: F64  # (rows, nodes) probability of a smaller q
    guide: NDArray[np.int16]  # (rows, _GUIDES) last node with a chance below i/_GUIDES
    aim: F64  # (nodes,) mean of the particles' phase functions: what light near the sun is sought with
    aim_chance: F64
    aim_guide: NDArray[np.int16]


def phases_of(
    rows: Sequence[Sequence[PhaseFunction]], particles: Sequence[Sequence[PhaseFunction]]
) -> Phases:
    """Tables of scatterers, each one phase function per wavelength; those of the ``particles`` are aimed with."""
    tables = [[_table(p) for p in row] for row in rows]
    value = np.array([t for row in tables for t in row])
    aim = np.mean([_table(p) for row in particles for p in row], axis=0) if particles else np.ones(value.shape[1])
    chance = np.array([_chance(v) for v in value])
    aim_chance = _chance(aim)
    return Phases(
        _nodes(), value, chance, np.array([_guide(c) for c in chance]), aim, aim_chance, _guide(aim_chance)
    )  # fmt: skip


def _nodes() -> F64:
    q = (np.arange(HALF_NODES + 1) / HALF_NODES) ** 4
    return np.concatenate([q, 2.0 - q[-2::-1]])


@lru_cache(maxsize=256)
def _table(phase: PhaseFunction) -> F64:
    q = _nodes()
    value = np.maximum(phase.value(1.0 - q), 0.0)
    return value / _chance_unscaled(value)[-1]


def _chance_unscaled(value: F64) -> F64:
    steps = 0.25 * (value[1:] + value[:-1]) * np.diff(_nodes())
    return np.concatenate([[0.0], np.cumsum(steps)])


def _chance(value: F64) -> F64:
    chance = _chance_unscaled(value)
    return chance / chance[-1]


def _guide(chance: F64) -> NDArray[np.int16]:
    node = np.searchsorted(chance, np.arange(_GUIDES) / _GUIDES, "right") - 1
    return np.clip(node, 0, len(chance) - 2).astype(np.int16)


@part(inlined=True)
def _mixed(z):
    z = (z ^ (z >> _S30)) * _MIX_1
    z = (z ^ (z >> _S27)) * _MIX_2
    return z ^ (z >> _S31)


@part(inlined=True)
def start_stream(rng, seed, ray, path):
    """Begin the random numbers of one path, which follow from seed, ray and path alone (SplitMix64, Steele 2014)."""
    z = _mixed(np.uint64(seed) + _GAMMA)
    z = _mixed(z ^ (np.uint64(ray) * _GAMMA + _MIX_1))
    rng[0] = _mixed(z ^ (np.uint64(path) * _GAMMA + _MIX_2))


@part(inlined=True)
def uniform(rng):
    """A random number in [0, 1)."""
    rng[0] = rng[0] + _GAMMA
    return np.float64(_mixed(rng[0]) >> _S11) * 1.1102230246251565e-16


@part(inlined=True)
def exponential(rng):
    """A random number with mean 1, density exp(-x), by the ziggurat (Marsaglia and Tsang 2000)."""
    while True:
        rng[0] = rng[0] + _GAMMA
        z = _mixed(rng[0])
        i = np.int64(z & _LOW_8)
        x = np.float64(z >> _S11) * 1.1102230246251565e-16 * _WIDTH[i]
        if x < _WIDTH[i + 1]:
            return x
        if i == 0:
            return _TAIL - math.log(1.0 - uniform(rng))
        if _HEIGHT[i] + uniform(rng) * (_HEIGHT[i + 1] - _HEIGHT[i]) < math.exp(-x):
            return x


@part(inlined=True)
def unit_circle(rng):
    """Cosine and sine of a random azimuth, by rejection."""
    while True:
        rng[0] = rng[0] + _GAMMA
        z = _mixed(rng[0])
        x = np.float64(z & _LOW_32) * 4.656612873077393e-10 - 1.0
        y = np.float64(z >> _S32) * 4.656612873077393e-10 - 1.0
        square = x * x + y * y
        if 1e-12 < square <= 1.0:  # twice its angle: no root
            inverse = 1.0 / square
            return (x * x - y * y) * inverse, 2.0 * x * y * inverse


@part(inlined=True)
def phase_place(q, nodes):
    """Node below q, and the share of the one above."""
    if q <= 1.0:
        i = int(math.sqrt(math.sqrt(max(q, 0.0))) * HALF_NODES)
    else:
        i = 2 * HALF_NODES - 1 - int(math.sqrt(math.sqrt(max(2.0 - q, 0.0))) * HALF_NODES)
    i = min(max(i, 0), 2 * HALF_NODES - 1)
    return i, min(max((q - nodes[i]) / (nodes[i + 1] - nodes[i]), 0.0), 1.0)


@part(inlined=True)
def drawn_q(u, nodes, value, chance, guide):
    """q of a random scattering angle, from a random number in [0, 1), and the phase function there."""
    i = int(guide[int(u * _GUIDES)])
    while chance[i + 1] <= u and i < 2 * HALF_NODES - 1:
        i += 1
    width = nodes[i + 1] - nodes[i]
    p0, p1 = 0.5 * value[i], 0.5 * value[i + 1]
    c = (u - chance[i]) / width
    root = math.sqrt(max(p0 * p0 + 2.0 * (p1 - p0) * c, 0.0))
    way = min(2.0 * c / max(p0 + root, 1e-300), 1.0)
    return nodes[i] + width * way, 2.0 * (p0 + way * (p1 - p0))


@part(inlined=True)
def turned(dx, dy, dz, q, c, s):
    """Direction at 1 - cos = q from a unit vector, with cosine and sine (c, s) of the azimuth around it."""
    sine = math.sqrt(max(q * (2.0 - q), 0.0))
    sign = 1.0 if dz >= 0.0 else -1.0
    a = -1.0 / (sign + dz)
    b = dx * dy * a
    along = 1.0 - q
    x = along * dx + sine * (c * (1.0 + sign * dx * dx * a) + s * b)
    y = along * dy + sine * (c * sign * b + s * (sign + dy * dy * a))
    z = along * dz + sine * (-c * sign * dx - s * dy)
    return x, y, z
