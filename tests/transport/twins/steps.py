"""What the twins share: one step of light, and tables read between their entries. Plain numpy, in double precision."""

from __future__ import annotations

from math import factorial

import numpy as np

from openswim.transport.engine.scalar import POLYNOMIAL


def transmission(depth):
    """e^-tau as the kernels have it, by halves and a polynomial between one and the next: within 3e-7 of what it stands
    for (tests/transport/test_scalar.py)."""
    halves = np.minimum(depth, 80.0) / np.log(2.0)
    whole = np.trunc(halves)
    return np.polynomial.Polynomial([1.0, *POLYNOMIAL])(halves - whole) * 2.0**-whole


def transmission_of_sweep(depth):
    """e^-tau as sweeps have it, by five terms of the exponential series at a sixteenth of the depth: within 2e-5."""
    return sum((np.asarray(depth) / 16) ** n / factorial(n) for n in range(6)) ** -16.0


def emission(tau, length_m, source_near, source_far, extinction_near, extinction_far, thin, terms, trans=transmission):
    """What a step adds at its near end (docs/fast.md, F9), (1 - e^-tau)/tau by ``terms`` of its series below the depth
    ``thin``; ``trans``: how e^-tau is told."""
    series = sum((-tau) ** n / factorial(n + 1) for n in range(terms))
    mean = (1 - trans(tau)) / tau if tau > thin else series
    bent = (source_near * extinction_far - source_far * extinction_near) / (12 + 2 * tau)
    return mean * length_m * ((source_near + source_far) / 2 + length_m * bent)


def between(table, *at):
    """A table at fractional indices along its first axes, linear along each; within the table."""
    if not at:
        return np.asarray(table, float)
    first = min(int(at[0]), len(table) - 2) if len(table) > 1 else 0
    share = at[0] - first
    low = between(table[first], *at[1:])
    return low if share == 0 else (1 - share) * low + share * between(table[first + 1], *at[1:])


def disc_above_horizon(mu, mu_horizon, radius_rad):
    """Share of the sun's disc above a straight horizon, from the cosines of both zenith angles."""
    x = np.clip((mu - mu_horizon) / radius_rad, -1, 1)
    return 0.5 + (x * np.sqrt(1 - x * x) + np.arcsin(x)) / np.pi


def shell_place(shells, height_m, table_per_m=0.01):
    """Fractional level of the shells at a height, and the cosine of its horizon's zenith angle."""
    above = max(height_m - shells.ground_m, 0.0)
    level = np.interp(above * table_per_m, np.arange(len(shells.level_table)), shells.level_table)
    radius = shells.radius_m + shells.ground_m
    return level, -np.sqrt(max(0.0, 1 - (radius / (radius + above)) ** 2))


def sun_column(mu, mu_horizon, count):
    """Fractional index on the sun axis of the shells' slant depths."""
    return min(np.sqrt(max(0.0, (mu - mu_horizon) / (1 - mu_horizon))) * (count - 1), count - 1.000001)
