"""A step of an eye ray through cloud with `Detail`."""

from __future__ import annotations

import numpy as np
from numba import njit

from openswim.transport.engine.pack import PACK, flat, largest, put, read, write
from openswim.transport.engine.scalar import height_of_square_m, step_emission, transmission
from openswim.transport.march.cloud_detail import (
    FRESH,
    HERE,
    NOISE,
    lerp,
    noise_at,
    scalar_at,
    seen_octaves,
    sunward,
    thickened,
)
from openswim.transport.march.walk import PLACE_LEVEL, PLACE_S, PLACE_X, PLACE_Y, RISE, SQUARE

_FLAGS = {"contract", "reassoc", "nsz", "arcp", "nnan", "ninf"}
_ZERO, _HALF, _ONE = np.float32(0.0), np.float32(0.5), np.float32(1.0)

FAINT = 0.03  # transmission below which detail is not seen
_FINEST, _COARSEST_M = 0.07, 35.0  # least part of a step, of the first wavelength, and at most
_PART = 1.5  # part of a step, of the ray's width
_BLUR = 1.6  # wavelength that begins to be seen, in parts of a step
_HASTE = np.float32(6.0)  # by how much parts grow, less one, as it becomes dark
_FOLLOWS = np.float32(0.8)  # share of the beam's changes that the diffuse light follows in full sun
_NOTHING = np.float32(1e-12)


def widest_m(wavelength_m: float) -> float:
    """Width of rays that see nothing of a wavelength any more."""
    return wavelength_m / (_PART * _BLUR)


WIDEST = widest_m(1.0)


@njit(cache=True, error_model="numpy", _nrt=False, fastmath=_FLAGS, forceinline=True)
def _next_part(a, least, left):
    """How much of a step is done after its next part, and that part; ``left``: transmission so far."""
    part = least * (_ONE + _HASTE * (_ONE - left))
    rest = _ONE - a
    if left < np.float32(FAINT) or np.float32(1.2) * part > rest:
        return _ONE, rest
    return a + part, part


@njit(cache=True, error_model="numpy", _nrt=False, fastmath=_FLAGS)
def detailed_step(
    radiance, through, ahead, ds, width_m, extinction, extinction_far, forward, forward_far, diffuse, diffuse_far,
    single, single_far, beam, beam_far, air, cloud, cloud_far, refined, refined_far, w, places, last, place, scratch,
    radius_m, cell_x, cell_y, detail,
):  # fmt: skip
    """Radiance, transmission and depth of the forward peaks to the eye after a step of ``ds`` from place ``last`` to
    ``place``, in parts that are short while much is seen.

    ``w``: the walk. All is linear along the step but for `Detail`: extinction, peaks and sources change alike, by the
    extinction that is there over the mean (``cloud``, of which ``refined``, and air); the beam by the noise's slope.
    """
    s, t = flat(places, place + PLACE_S), flat(places, place + PLACE_S) - ds
    ix, iy, level = flat(places, place + PLACE_X), flat(places, place + PLACE_Y), flat(places, place + PLACE_LEVEL)
    jx, jy, last_level = flat(places, last + PLACE_X), flat(places, last + PLACE_Y), flat(places, last + PLACE_LEVEL)
    x, y, z = jx * cell_x, jy * cell_y, height_of_square_m(w[SQUARE] + t * (2.0 * w[RISE] + t), radius_m)
    dx, dy = ix * cell_x - x, iy * cell_y - y
    dz = height_of_square_m(w[SQUARE] + s * (2.0 * w[RISE] + s), radius_m) - z
    dense, dense_far = scalar_at(detail.in_cloud, jx, jy, last_level), scalar_at(detail.in_cloud, ix, iy, level)
    first_m = flat(detail.wavelength_m, 0)
    finest = max(_PART * width_m, min(_FINEST * first_m, _COARSEST_M))
    count, edge = seen_octaves(detail, _BLUR * finest, scratch)
    least, lump_m = np.float32(min(finest / ds, 1.0)), np.float32(0.25 * first_m)
    clear = largest(air) + _NOTHING
    near, near_forward, near_source = (
        read(scratch, HERE), read(scratch, HERE + PACK), read(scratch, HERE + 2 * PACK)
    )  # fmt: skip
    a, part = _ZERO, _ZERO
    if flat(scratch, FRESH) > _ZERO:
        a, part = _next_part(a, least, largest(through))
    while True:
        noise_at(detail, count, x + a * dx, y + a * dy, z + a * dz, scratch)
        mean, all_cloud, most = lerp(refined, refined_far, a), lerp(cloud, cloud_far, a), lerp(dense, dense_far, a)
        more = mean * (thickened(flat(scratch, NOISE), edge, mean / max(most, _NOTHING), detail.quantile) - _ONE)
        ratio = (all_cloud + more + clear) / (all_cloud + clear)
        slope = flat(scratch, NOISE + 1) + flat(scratch, NOISE + 2) + flat(scratch, NOISE + 3)
        bright = sunward(slope, most * lump_m)
        sunlight = lerp(beam, beam_far, a)
        lit = bright * sunlight
        # where the sun shines most of what is scattered again was sunlight just before
        follows = (bright - _ONE) * _FOLLOWS * sunlight + _ONE
        here, forward_here = ratio * lerp(extinction, extinction_far, a), ratio * lerp(forward, forward_far, a)
        source = ratio * (lerp(diffuse, diffuse_far, a) * follows + lerp(single, single_far, a) * lit)
        if part > _ZERO:
            step = part * ds
            depth = (near + here) * (_HALF * step)
            ahead += (near_forward + forward_here) * (_HALF * step)
            trans = transmission(depth)
            radiance += through * step_emission(depth, trans, step, near_source, source, near, here)
            through *= trans
        if a >= _ONE:
            break
        near, near_forward, near_source = here, forward_here, source
        a, part = _next_part(a, least, largest(through))
    write(scratch, HERE, here)
    write(scratch, HERE + PACK, forward_here)
    write(scratch, HERE + 2 * PACK, source)
    put(scratch, FRESH, _ONE)
    return radiance, through, ahead
