"""A step of an eye ray through cloud with `Detail`."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

from openswim.transport.engine.compiled import FINITE, part
from openswim.transport.engine.pack import PACK, flat, lane, largest, power_of_two, put, read, write
from openswim.transport.engine.scalar import height_of_square_m, step_emission, transmission
from openswim.transport.engine.types import FLOAT
from openswim.transport.march.cloud_detail import (
    DENSE,
    FRESH,
    HERE,
    lerp,
    noise_at,
    place_octaves,
    scalar_at,
    seen_octaves,
    sunward,
    thickened,
)
from openswim.transport.march.state import Gathered
from openswim.transport.march.walk import PLACE_LEVEL, PLACE_S, PLACE_X, PLACE_Y, RISE, SQUARE

_ZERO, _HALF, _ONE = FLOAT(0.0), FLOAT(0.5), FLOAT(1.0)

FAINT = 0.03  # transmission below which detail is not seen
_FINEST, _COARSEST_M = 0.07, 35.0  # least part of a step, of the first wavelength, and at most
_PART = 1.5  # part of a step, of the ray's width
_BLUR = 1.5  # wavelength that begins to be seen, in parts of a step
_HASTE = FLOAT(2.0)  # by how much parts grow, less one, as it becomes dark
_FOLLOWS = FLOAT(0.8)  # share of the beam's changes that the diffuse light follows in full sun
_NOTHING = FLOAT(1e-12)


def widest_m(wavelength_m: float) -> float:
    """Width of rays that see nothing of a wavelength any more."""
    return wavelength_m / (_PART * _BLUR)


WIDEST = widest_m(1.0)


class Step(NamedTuple):
    """A step of a ray through cloud: its length, the ray's width and distance from the eye where it ends, and where
    among the places its ends stand."""

    ds_m: Any
    width_m: float
    away_m: float
    before: int
    place: int


@part(FINITE, inlined=True)
def _part_m(least_m, longer):
    """How long a part is: at most so many times as long as the least, by whole powers of two."""
    if longer < FLOAT(2.0):
        return least_m
    return 2.0 * least_m if longer < FLOAT(4.0) else 4.0 * least_m


@part(FINITE, inlined=True)
def _part_ends(away_m, end_m, part_m, left):
    """Distance from the eye where a part ends that begins at another: at a multiple of its length, the same for all
    rays, or where the step ends. Else what noise lies between the places would make lines where steps begin."""
    ends_m = (math.floor(away_m / part_m + 0.1) + 1.0) * part_m
    return end_m if left < FLOAT(FAINT) or ends_m + 0.1 * part_m > end_m else ends_m


@part(FINITE)
def detailed_step(seen, near, far, step, walk, places, scratch, radius_m, cell_m, detail):
    """`Gathered` after a `Step`, in parts that are short while much is seen: from it before, and the `Sample` at both
    ends; ``walk``, ``places``: of the ray; ``cell_m`` (2,) of the grid.

    All is linear along the step but for the noise n of `Detail`. With x_r the extinction of what is refined and x that
    of all cloud and the densest wavelength's air, what is there is what stands at the ends times

        ratio = 1 + x_r (f(n) - 1)/x,    f = Phi((n + q)/e)/Phi(q), of mean 1 (`thickened`),

    the beam b is brighter by g (`sunward`), and of the diffuse source a share follows it, so that with J the diffuse
    source and P what is scattered of the beam

        S = ratio [J (1 + .8 b (g - 1)) + P b g],    dL'/ds = S e^-tau',   each part by F9 as the march's steps are.
    """
    s, t = flat(places, step.place + PLACE_S), flat(places, step.place + PLACE_S) - step.ds_m
    ix, iy = flat(places, step.place + PLACE_X), flat(places, step.place + PLACE_Y)
    jx, jy = flat(places, step.before + PLACE_X), flat(places, step.before + PLACE_Y)
    cell_x, cell_y = 1.0 * flat(cell_m, 0), 1.0 * flat(cell_m, 1)
    x, y, z = jx * cell_x, jy * cell_y, height_of_square_m(walk[SQUARE] + t * (2.0 * walk[RISE] + t), radius_m)
    dx, dy = ix * cell_x - x, iy * cell_y - y
    dz = height_of_square_m(walk[SQUARE] + s * (2.0 * walk[RISE] + s), radius_m) - z
    x, y = x - flat(detail.drift_m, 0), y - flat(detail.drift_m, 1)
    dense = flat(scratch, DENSE)
    if flat(scratch, FRESH) <= _ZERO:
        dense = scalar_at(detail.in_cloud, jx, jy, flat(places, step.before + PLACE_LEVEL))
    dense_far = scalar_at(detail.in_cloud, ix, iy, flat(places, step.place + PLACE_LEVEL))
    first_m = flat(detail.wavelength_m, 0)
    finest_m = max(_PART * step.width_m, min(_FINEST * first_m, _COARSEST_M))
    least_m, lump_m = 1.0 * power_of_two(finest_m), FLOAT(0.25 * first_m)
    clear = largest(near.air) + _NOTHING
    radiance, through, ahead = seen.radiance, seen.through, seen.ahead
    last, last_forward, last_source = (
        read(scratch, HERE), read(scratch, HERE + PACK), read(scratch, HERE + 2 * PACK)
    )  # fmt: skip
    end_m, length_m = step.away_m, 1.0 * step.ds_m
    at_m = next_m = end_m - length_m
    left = largest(through)
    longer = _ONE + _HASTE * (_ONE - left)
    if flat(scratch, FRESH) > _ZERO:
        next_m = _part_ends(at_m, end_m, _part_m(least_m, longer), left)
    # what is finer than the way between places would alias to stripes
    place_octaves(detail, _BLUR * finest_m, x, y, z, dx, dy, dz, scratch)
    edge = seen_octaves(detail, _BLUR * finest_m * longer, scratch)
    a = _ONE - FLOAT((end_m - next_m) / length_m)
    noise = noise_at(detail, a, scratch)
    while True:
        way_m, at_m, share, here_noise, here_edge = FLOAT(next_m - at_m), next_m, a, noise, edge
        if next_m < end_m:
            left = largest(through)
            longer = _ONE + _HASTE * (_ONE - left)  # by what is left before this part: the next need not wait for it
            next_m = _part_ends(at_m, end_m, _part_m(least_m, longer), left)
            edge = seen_octaves(detail, _BLUR * finest_m * longer, scratch)
            a = _ONE - FLOAT((end_m - next_m) / length_m)
            noise = noise_at(detail, a, scratch)
        mean, all_cloud = lerp(near.refined, far.refined, share), lerp(near.cloud, far.cloud, share)
        most = lerp(dense, dense_far, share)
        more = mean * (thickened(lane(here_noise, 0), here_edge, mean / max(most, _NOTHING), detail.quantile) - _ONE)
        ratio = (all_cloud + more + clear) / (all_cloud + clear)
        slope = lane(here_noise, 1) + lane(here_noise, 2) + lane(here_noise, 3)
        bright = sunward(slope, most * lump_m)
        sunlight = lerp(near.beam, far.beam, share)
        lit = bright * sunlight
        # where the sun shines most of what is scattered again was sunlight just before
        follows = (bright - _ONE) * _FOLLOWS * sunlight + _ONE
        here = ratio * lerp(near.extinction, far.extinction, share)
        forward_here = ratio * lerp(near.forward, far.forward, share)
        source = ratio * (lerp(near.diffuse, far.diffuse, share) * follows + lerp(near.single, far.single, share) * lit)
        if way_m > _ZERO:
            depth = (last + here) * (_HALF * way_m)
            ahead += (last_forward + forward_here) * (_HALF * way_m)
            trans = transmission(depth)
            radiance += through * step_emission(depth, trans, way_m, last_source, source, last, here)
            through *= trans
        last, last_forward, last_source = here, forward_here, source
        if at_m >= end_m:
            break
    write(scratch, HERE, here)
    write(scratch, HERE + PACK, forward_here)
    write(scratch, HERE + 2 * PACK, source)
    put(scratch, FRESH, _ONE)
    put(scratch, DENSE, dense_far)
    return Gathered(radiance, through, ahead)
