"""How kinds of matter scatter, per their extinction, with the forward peak counted as not scattered (F1, F16, F17)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from openswim.scene.phase import PhaseFunction
from openswim.transport.march.forward_peak import forward_share, peak_table

F64 = NDArray[np.float64]


@dataclass(frozen=True)
class Scatterer:
    """A kind of matter: its single-scattering albedo (nt,) and phase functions, at the terms."""

    name: str
    single_scattering_albedo: ArrayLike
    phase: Sequence[PhaseFunction]
    degree: int | None = None  # of its truncation, if another than that of the diffuse light


@dataclass(frozen=True, eq=False)
class Optics:
    """Of all kinds at one term, per extinction: ``scaled`` extinction and ``forward`` scattering (kinds,), which add to
    one with what is scattered otherwise; ``low`` (kinds, M): Legendre moments of that; ``table`` (kinds, angles,
    depths): forward peaks, albedo included."""

    scaled: F64
    forward: F64
    low: F64
    table: F64


def optics_of(scatterers: Sequence[Scatterer], term: int, degree: int) -> Optics:
    """Of kinds of matter at a term."""
    scaled, forward, low, tables = [], [], [], []
    for one in scatterers:
        omega = float(np.atleast_1d(one.single_scattering_albedo)[term])
        own = one.degree or degree
        chi = np.asarray(one.phase[term].moments(own + 1), float)
        f = float(forward_share(chi, own))
        scaled.append(1 - omega * f)
        forward.append(omega * f)
        low.append(omega * (chi[:degree] - f))
        tables.append(omega * peak_table(one.phase[term], own, degree).astype(float))
    return Optics(np.array(scaled), np.array(forward), np.array(low), np.stack(tables))


def mixed(shares: F64, fields: F64) -> F64:
    """Sums (..., nodes) of fields (k, nodes) by shares (..., k). A library would give long ones to threads of
    its own, which wait busily for more."""
    return np.asarray(np.einsum("...k,kp->...p", shares, fields))
