"""Twin of a sweep: emission, steps of every ordinate plane by plane, moments (docs/fast.md, F7 to F9 and F11)."""

from __future__ import annotations

import numpy as np
from scipy.special import factorial, lpmv
from tests.transport.twins.steps import between, emission
from tests.transport.twins.steps import transmission_of_sweep as transmission


def harmonics(directions, degree):
    """Real orthonormal Y_lm (n, M*M) of unit vectors (n, 3), by the associated Legendre functions."""
    z, azimuth = directions[:, 2], np.arctan2(directions[:, 1], directions[:, 0])
    out = np.empty((len(directions), degree * degree))
    for ell in range(degree):
        for m in range(ell + 1):
            norm = np.sqrt((2 * ell + 1) / (4 * np.pi) * factorial(ell - m) / factorial(ell + m))
            value = norm * lpmv(m, ell, z)
            if m == 0:
                out[:, ell * ell + ell] = value
            else:
                out[:, ell * ell + ell + m] = np.sqrt(2) * value * np.cos(m * azimuth)
                out[:, ell * ell + ell - m] = np.sqrt(2) * value * np.sin(m * azimuth)
    return out


def source(moments, scattering, beam, direction, sun):
    """S(n) = sum_lm Y_lm(n) sigma_l (I_lm + 4 pi Y_lm(sun) T') at the nodes (nz, ny, nx), from the moments I_lm (M*M,
    ...), and sigma_l (M, ...)."""
    degree = len(scattering)
    order = np.repeat(np.arange(degree), 2 * np.arange(degree) + 1)
    toward, of_sun = harmonics(direction[None], degree)[0], harmonics(sun[None], degree)[0]
    lit = moments + 4 * np.pi * of_sun[:, None, None, None] * beam
    return np.einsum("c,cz...,cz...->z...", toward, scattering[order], lit)


def enter(light, extinction, length, inflow):
    """Light at the first of two nodes, on an open side, that makes their mean that of the cell between them where it
    emits evenly: of light that comes in and light in balance with the cell's, e^-t at a depth t."""
    tau = length * (extinction[0] + extinction[1]) / 2
    share = 2 * (1 / -np.expm1(-tau) - 1 / tau) - 1 if tau > 0.1 else tau / 6
    return inflow + share * (light[1] - inflow)


def carry(direction, extinction, emitted, inflow, first, levels_m, cell_m, ends):
    """Radiance along one ordinate at the nodes: short characteristics from the upstream face of each node's cell.

    Nodes beyond the sides are as those at them, and have the ``inflow`` (nz,) of their level; ``first`` (ny, nx): what
    rises from the ground, on the first plane, or None where the sky's inflow enters there. ``ends`` (2, 2): sides of x
    and y, below and above, at which light enters as there is nothing beyond.
    """
    nz, ny, nx = extinction.shape
    light = np.empty((nz, ny + 2, nx + 2))
    light[:] = inflow[:, None, None]
    beta, source = (np.pad(a, [(0, 0), (1, 1), (1, 1)], mode="edge") for a in (extinction, emitted))
    toward = np.where(direction > 0, 1, -1)
    down = direction[2] >= 0
    planes, rows, columns = range(nz), range(1, ny + 1), range(1, nx + 1)
    for k in reversed(planes) if down else planes:
        begins = k == (nz - 1 if down else 0)
        before = k if begins else k + (1 if down else -1)
        height = 1.0 if begins else abs(levels_m[before] - levels_m[k])
        size = np.array([*cell_m, height])
        lengths = size / np.maximum(np.abs(direction), 1e-12)
        length = lengths.min()
        dx, dy, dz = np.where(lengths == length, 1.0, length / lengths)  # in cells
        if begins and dz == 1.0:
            if first is not None:
                light[k, 1:-1, 1:-1] = first
            continue
        open_x, open_y = (ends[axis, int(direction[axis] > 0)] and direction[axis] != 0 for axis in (0, 1))
        side_x, side_y = (n if direction[axis] > 0 else 1 for axis, n in ((0, nx), (1, ny)))
        for j in reversed(rows) if direction[1] > 0 else rows:
            if open_y and j == side_y:
                light[k, j] = inflow[k]
                continue
            for i in reversed(columns) if direction[0] > 0 else columns:
                if open_x and i == side_x:
                    light[k, j, i] = inflow[k]
                    continue
                # the upstream point lies between this plane and the one before
                corners = [
                    np.array([[f[n, m, i], f[n, m, i + toward[0]]] for n in (k, before) for m in (j, j + toward[1])])
                    .reshape(2, 2, 2) for f in (light, beta, source)
                ]  # fmt: skip
                corners[0][0, 0, 0] = 0.0  # the node itself, yet to be known
                up, beta_up, source_up = (between(c, dz, dy, dx) for c in corners)
                tau = length * (beta[k, j, i] + beta_up) / 2
                both = source[k, j, i], source_up, beta[k, j, i], beta_up
                own = emission(tau, length, *both, 0.1, 4, transmission)
                light[k, j, i] = transmission(tau) * up + own
            if open_x:
                two = [side_x, side_x - toward[0]]
                light[k, j, side_x] = enter(light[k, j, two], beta[k, j, two], lengths[0], inflow[k])
        if open_y:
            two = [side_y, side_y - toward[1]]
            for i in columns:
                light[k, side_y, i] = enter(light[k, two, i], beta[k, two, i], lengths[1], inflow[k])
    return light[:, 1:-1, 1:-1]


def sweep(moments, extinction, scattering, beam, sun, ordinates, inflow, albedo, direct, levels_m, cell_m, ends):
    """All ordinates once: new moments (M*M, nz, ny, nx); fluxes (ny, nx) down to the level ground and up through the
    top, on the scale of E_TOA = 1. inflow (ordinates, nz), ends: see `carry`."""
    directions, weights = ordinates
    flux_of = weights * np.abs(directions[:, 2]) / (4 * np.pi)
    every = harmonics(directions, len(scattering))
    new, down, up = np.zeros_like(moments), 0.0, 0.0
    rises = directions[:, 2] < 0
    for n in np.argsort(rises, kind="stable"):
        emitted = source(moments, scattering, beam, directions[n], sun)
        first = albedo * (direct + down) / flux_of[rises].sum() if rises[n] else None
        light = carry(directions[n], extinction, emitted, inflow[n], first, levels_m, cell_m, ends)
        new += weights[n] * every[n][:, None, None, None] * light
        if rises[n]:
            up = up + flux_of[n] * light[-1]
        else:
            down = down + flux_of[n] * light[0]
    return new, down, up


def source_toward_eye(moments, extinction, scattering, views):
    """J = sum_lm Y_lm sigma_l I_lm/beta' (F15) at nodes, by the unit vectors ``views`` (nz, ny, nx, 3) in which their
    light goes to the eye."""
    degree = len(scattering)
    order = np.repeat(np.arange(degree), 2 * np.arange(degree) + 1)
    toward = harmonics(views.reshape(-1, 3), degree).T.reshape(-1, *extinction.shape)
    return (toward * scattering[order] * moments).sum(axis=0) / extinction
