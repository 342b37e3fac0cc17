"""What adjoints were asked before, and what they found: from it the next one is begun.

An adjoint is linear in its residual. A search goes from state to state in short steps: its residuals are nearly sums of
those before, and so are the answers, as far as the sweeps are the same.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

F64 = NDArray[np.float64]

MOST = 6  # of earlier answers that are gone on from
_ALIKE = 1e-6  # of the greatest singular value: residuals that are told apart


class Asked(NamedTuple):
    """A residual, in one row; size: how large is what eyes and ground ask of the moments, before it is scattered
    (``asked``) and after it is scattered once (``size``); found (K, nodes): what is asked of them in all."""

    residual: F64
    asked: float
    size: float
    found: F64


def begun(earlier: Sequence[Asked], residual: F64) -> F64:
    """That sum (K, nodes) of what was found whose residuals come nearest."""
    known = np.stack([one.residual for one in earlier], axis=1)
    shares = np.linalg.lstsq(known, residual, rcond=_ALIKE)[0]
    out = np.zeros_like(earlier[0].found)
    for share, one in zip(shares, earlier, strict=True):
        out += out.dtype.type(share) * one.found
    return out
