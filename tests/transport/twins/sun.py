"""Twins of the sun sweep and of the direct beam (docs/fast.md, F4)."""

from __future__ import annotations

import numpy as np
from tests.transport.twins.steps import between, disc_above_horizon, shell_place, sun_column, transmission

SUN_RADIUS_RAD = 0.00465


def depths_to_sun(extinction, exact, sun, levels_m, cell_m, radius_m, periodic):
    """Depth tau'(sun) at every node (nz, ny, nx): extinction along the node's ray by the trapezoidal rule between the
    places where it meets a level and, from one level to the next, as many even ones as it crosses columns.

    ``exact`` nodes follow their ray to the top or to a side; the others one level up, and read the depth there. The ray
    rises by mu s + s^2 (1 - mu^2)/2R. Nodes of a row go side by side: all take the pieces that the longest ray needs,
    and those that leave in the midst of one add the mean of its ends along the part within.
    """
    nz, ny, nx = extinction.shape
    velocity, mu = sun[:2] / cell_m, sun[2]
    bend = (1 - mu * mu) / (2 * radius_m)
    depth = np.zeros(extinction.shape)

    def at(field, level, j, i):
        if periodic:
            j, i = j % ny, i % nx
            field = np.pad(field, [(0, 0), (0, 1), (0, 1)], mode="wrap")
        else:
            j, i = np.clip(j, 0, ny - 1), np.clip(i, 0, nx - 1)
        return between(field, level, j, i)

    def way_out_m(node, speed, count):
        return np.inf if periodic or speed == 0 else (count - 1 - node if speed > 0 else node) / abs(speed)

    for k in reversed(range(nz - 1)):
        for j in range(ny):
            leaves = [min(way_out_m(i, velocity[0], nx), way_out_m(j, velocity[1], ny)) for i in range(nx)]
            for i in range(nx):
                place, s, total = np.array([j, i], float), 0.0, 0.0
                before = extinction[k, j, i]
                for level in range(k + 1, nz if exact[k, j, i] else k + 2):
                    rise = levels_m[level] - levels_m[k]
                    end = min(2 * rise / (mu + np.sqrt(mu * mu + 4 * bend * rise)), max(leaves))
                    pieces = int(np.abs(velocity).max() * (end - s)) + 1
                    step = (end - s) / pieces
                    for _ in range(pieces):
                        within = min(max(leaves[i] - s, 0.0), step)
                        s += step
                        height = levels_m[k] + mu * s + bend * s * s
                        y, x = place + velocity[::-1] * s
                        here = at(extinction, np.interp(height, levels_m, np.arange(nz)), y, x)
                        total += within * (before + here) / 2
                        before = here
                if end < max(leaves) and s < leaves[i]:
                    y, x = place + velocity[::-1] * s
                    total += at(depth, level, y, x)
                depth[k, j, i] = total
    return depth


def air_depth(shells, height_m, mu, w):
    """Delta-scaled depth of the shells from a height to the sun, and the share of its disc above their horizon."""
    level, mu_horizon = shell_place(shells, height_m)
    depth = between(shells.slant[..., w], level, sun_column(mu, mu_horizon, shells.slant.shape[1]))
    return depth, disc_above_horizon(mu, mu_horizon, SUN_RADIUS_RAD)


def above_ridge(height_m, shadow_m, distance_m, softness_m):
    """Share of the sun above a ridge: linear over its disc there, or over ``softness_m`` if that is more."""
    return np.clip(1 - (shadow_m - height_m) / max(softness_m, 2 * SUN_RADIUS_RAD * distance_m), 0, 1)


def beam(depth, sun, levels_m, shadow_m, distance_m, shells, w):
    """T' at the nodes (nz, ny, nx): e^-(cloud's depth + the shells') times the share of the sun that is seen; what dims
    more than e^-27.631 counts as so much, and with cloud as e^-80."""
    out = np.zeros(depth.shape)
    for k, j, i in np.ndindex(depth.shape):
        soft = levels_m[min(k + 1, len(levels_m) - 1)] - levels_m[max(k - 1, 0)]
        air, seen = air_depth(shells, levels_m[k], sun[j, i, 2], w)
        seen *= above_ridge(levels_m[k], shadow_m[j, i], distance_m[j, i], soft)
        total = min(air - np.log(max(seen, 1e-12)), 27.631) + depth[k, j, i]
        out[k, j, i] = transmission(min(total, 80.0) / 2) ** 2  # rays read the root between the nodes
    return out


def beam_at_ground(depth, sun, levels_m, terrain_m, shadow_m, distance_m, shells, w):
    """The same at the ground (ny, nx), between the nodes around it; over a ridge's edge 20 m wide."""
    out = np.zeros(terrain_m.shape)
    for j, i in np.ndindex(out.shape):
        air, seen = air_depth(shells, terrain_m[j, i], sun[j, i, 2], w)
        cloud = np.interp(terrain_m[j, i], levels_m, depth[:, j, i])
        seen *= above_ridge(terrain_m[j, i], shadow_m[j, i], distance_m[j, i], 20.0)
        out[j, i] = seen * np.exp(-air) * np.exp(-cloud)
    return out
