"""Few mixtures of the species, of whose optical depths those at all wavelengths are made.

A depth is linear in the species' extinctions: where these, at a wavelength, are a sum of what they are at others, so is
the depth. One species has one depth but for a factor, two have two, however many wavelengths there are.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from openswim.transport.engine.types import FLOAT

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]

TOLERANCE = 1e-4  # share of a species' extinction by which a sum may be off,
_LEAST = 1e-3  # where it is more than this, per reference extinction


def mixtures(extinction: F32, most: int = 1 << 30) -> NDArray[np.int64]:
    """Which columns of the species' ``extinction`` (ns, n) suffice as terms of sums for all, at most so many, the first
    one first."""
    chosen = [0]
    while True:
        terms = np.array(chosen)
        off = np.abs(_weight(extinction) * (extinction[:, terms] @ factors_of(extinction, terms) - extinction))
        worst = off.max(axis=0, initial=0.0)
        if worst.max() <= TOLERANCE or len(chosen) >= most:
            return terms
        chosen.append(int(worst.argmax()))


def factors_of(extinction: F32, terms: NDArray[np.int64]) -> F32:
    """By which factors (len, n) the columns ``terms`` of ``extinction`` (ns, n) are summed to every one, as near as may
    be."""
    weight, rows = _weight(extinction), np.asarray(extinction[:, terms], float)
    out = np.zeros((len(terms), extinction.shape[1]))
    for n, (wanted, own) in enumerate(zip(np.asarray(extinction, float).T, weight.T, strict=True)):
        out[:, n] = np.linalg.lstsq(rows * own[:, None], wanted * own, rcond=1e-6)[0]
    out[:, terms] = np.eye(len(terms))
    return out.astype(FLOAT)


def _weight(extinction: F32) -> F64:
    return 1 / np.maximum(np.abs(np.asarray(extinction, float)), _LEAST)
