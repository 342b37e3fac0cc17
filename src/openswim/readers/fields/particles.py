"""Several of a model's categories as one species of a scene: drizzle with rain, hail with graupel."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from openswim.optics.hydrometeors import known_radius_m
from openswim.scene.checks import checked_values
from openswim.scene.variables import Variable

F32 = NDArray[np.float32]


@dataclass(frozen=True)
class Category:
    """Content (mass) of one category, and the number or the effective radius [m] of its particles if known.

    Content and number are both per volume or both per mass of air.
    """

    content: F32
    number: F32 | None = None
    effective_radius_m: F32 | None = None


def checked_content(name: str, values: F32, units: str, notes: list[str]) -> F32:
    """Content of one category, noise below zero clipped with a note; gaps (NaN) stay."""
    gaps = np.isnan(values)
    there = np.where(gaps, np.float32(0), values)
    spec = Variable(units, "", 0.0, 0.1, clip=True, hint="is it in g/kg? 1000 times too large")
    return np.where(gaps, values, checked_values(name, there, spec, notes))


def known_sizes(name: str, values: F32, notes: list[str]) -> F32 | None:
    """Numbers or radii of a file; what is missing or negative is unknown (zero), and a note says so. None where they
    are unknown everywhere."""
    lost = ~(values >= 0)
    if lost.any():
        notes.append(f"{name}: {int(lost.sum())} of {lost.size} values are missing or negative: unknown there")
        values = np.where(lost, np.float32(0), values)
    if values.any():
        return values
    notes.append(f"{name} is zero or unknown everywhere: sizes from content or number")
    return None


def together(kind: str, categories: Sequence[Category]) -> tuple[F32, F32 | None]:
    """Content of all, and the effective radius with which it takes out as much light as they do one by one.

    1/r = sum(content_i/r_i) / sum(content_i); None where no category knows its size.
    """
    content = np.sum(np.stack([each.content for each in categories]), axis=0, dtype=np.float32)
    if all(each.number is None and each.effective_radius_m is None for each in categories):
        return np.asarray(content), None
    per_radius = np.zeros(content.shape, np.float64)
    for each in categories:
        mass = np.maximum(each.content, 0.0)
        radius = known_radius_m(kind, mass, each.effective_radius_m, each.number).astype(np.float64)
        per_radius += np.where(mass > 0, mass / np.maximum(radius, 1e-7), 0.0)
    mean = np.divide(np.maximum(content, 0.0), per_radius, out=np.zeros_like(per_radius), where=per_radius > 0)
    return np.asarray(content), mean.astype(np.float32)
