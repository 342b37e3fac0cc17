"""Small pure functions of scalars and packs: the physics of one step, one place, one look-up.

Every kernel is built of these and nothing else, so that a GPU back end or a hand-written adjoint can
reuse them. Units are in the names; none of them keeps state.
"""

from __future__ import annotations

import math

import numpy as np

from openswim.transport.engine.compiled import FAST, part
from openswim.transport.engine.pack import PACK, choose_above, flat, halved, whole
from openswim.transport.engine.types import FLOAT

__all__ = ["PACK", "flat"]  # beside what stands here

_F1 = FLOAT(1.0)
_HALVES, _DARKEST = FLOAT(1 / math.log(2.0)), FLOAT(80.0)  # of an optical depth of 1; e^-80 is not denormal yet
# 2^-t = 1 + t (...) from 0 to 1 within 2.5e-7 t and one half at 1, by linear programming
POLYNOMIAL = -0.693146927, 0.240213912, -0.0554035751, 0.00933454995, -0.000997959641
_P1, _P2, _P3, _P4, _P5 = map(FLOAT, POLYNOMIAL)
_MOST_DEGREE = 12


def _recurrence() -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Coefficients of the normalised Legendre recurrences, [l, m] and [m]: roots are too dear for a kernel."""
    a = np.zeros((_MOST_DEGREE, _MOST_DEGREE))
    b = np.zeros((_MOST_DEGREE, _MOST_DEGREE))
    for m in range(_MOST_DEGREE):
        for ell in range(m + 1, _MOST_DEGREE):
            a[ell, m] = math.sqrt((4.0 * ell * ell - 1.0) / (ell * ell - m * m))
            b[ell, m] = math.sqrt(((ell - 1.0) ** 2 - m * m) / (4.0 * (ell - 1.0) ** 2 - 1.0))
    m = np.arange(_MOST_DEGREE)
    return a, b, -np.sqrt((2.0 * m + 3.0) / (2.0 * m + 2.0))


UP, BACK, ALONG = _recurrence()


@part(FAST, inlined=True)
def smaller(a, b):
    """Of two packs, lane by lane."""
    return choose_above(a, b, b, a)


@part(FAST, inlined=True)
def greater(a, b):
    """Of two packs, lane by lane."""
    return choose_above(a, b, a, b)


@part(FAST, merged=True)
def transmission(optical_depth):
    """exp(-optical_depth) for any depth >= 0, within 3e-7, and within 5e-4 of itself below 0; vectorises, unlike exp.

    2^-t of the whole part of t by the number's exponent, of the rest by a polynomial.
    """
    t = choose_above(optical_depth, _DARKEST, _DARKEST, optical_depth) * _HALVES
    rest = t - whole(t)
    square = rest * rest
    curve = (_P2 + _P3 * rest) + square * (_P4 + _P5 * rest)
    return halved((_F1 + _P1 * rest) + square * curve, t)


@part(FAST, merged=True)
def step_emission(depth, trans, step_m, source_near, source_far, extinction_near, extinction_far):
    """Light that one step adds at its near end, extinction and source linear along it.

    (1 - e^-tau)/tau ds [(S_n + S_f)/2 + (S_n beta_f - S_f beta_n) ds/(12 + 2 tau)], docs/fast.md, F9;
    right in the thin and the thick limit. ``depth`` = (beta_n + beta_f) ds/2, ``trans`` = e^-depth.
    """
    mean_transmission = choose_above(
        depth, FLOAT(0.01), (_F1 - trans) / depth, _F1 - depth * (FLOAT(0.5) - depth * FLOAT(1 / 6))
    )
    slope = (source_near * extinction_far - source_far * extinction_near) * step_m
    return (
        mean_transmission
        * step_m
        * (FLOAT(0.5) * (source_near + source_far) + slope / (FLOAT(12.0) + FLOAT(2.0) * depth))
    )


@part(FAST, merged=True)
def share_of_step(extinction_near, extinction_far, step_m, optical_depth):
    """Share (0..1) of a step after which ``optical_depth`` is met, extinction linear along it; it must be met."""
    depth_per_m = optical_depth / step_m
    square = extinction_near * extinction_near + FLOAT(2.0) * (extinction_far - extinction_near) * depth_per_m
    return min(FLOAT(2.0) * depth_per_m / (extinction_near + math.sqrt(max(square, FLOAT(0.0)))), _F1)


@part(FAST, merged=True)
def height_m(x, y, z, radius_m):
    """Height above the sphere of a point given relative to the sphere's top point; no cancellation."""
    return height_of_square_m(x * x + y * y + z * (2.0 * radius_m + z), radius_m)


@part(FAST)
def height_of_square_m(q, radius_m):
    """Height h from q = (R + h)^2 - R^2: near the ground by the series of the root, to 1e-9 of the height."""
    x = q / (radius_m * radius_m)
    if abs(x) < 0.04:
        xx = x * x
        return (
            q
            / (2.0 * radius_m)
            * ((1.0 - 0.25 * x) + xx * ((0.125 - 0.078125 * x) + xx * (0.0546875 - 0.041015625 * x)))
        )
    return q / (math.sqrt(radius_m * radius_m + q) + radius_m)


@part(FAST, merged=True)
def shadow_fraction(mu, mu_horizon, sun_radius_rad):
    """Share of the sun's disc above the horizon (0..1), mu and mu_horizon being cosines of zenith angles."""
    x = (mu - mu_horizon) / sun_radius_rad
    if x >= 1.0:
        return 1.0
    if x <= -1.0:
        return 0.0
    return 0.5 + (x * math.sqrt(1.0 - x * x) + math.asin(x)) / math.pi


@part(FAST, merged=True)
def level_at(t, table):
    """Entry t of a table, interpolated linearly (ends clamped)."""
    n = table.shape[0] - 1
    t = min(max(t, 0.0), n * 1.0)
    i = min(int(t), n - 1)
    low = flat(table, i)
    return low + (t - i) * (flat(table, i + 1) - low)


@part(FAST, merged=True)
def table_index(value, origin, per_unit, table):
    """Fractional index of ``value`` by a uniform look-up table of fractional indices (ends clamped)."""
    return level_at((value - origin) * per_unit, table)


@part(FAST, merged=True)
def smoothstep(x):
    """0 below 0, 1 above 1, smooth between."""
    if x <= 0.0:
        return 0.0
    if x >= 1.0:
        return 1.0
    return x * x * (3.0 - 2.0 * x)


@part()
def harmonics(x, y, z, degree, out):
    """Real orthonormal spherical harmonics Y_lm(x, y, z), l < degree, into out[l*l + l + m]."""
    # P_mm and the upward recurrence in l, without the factor sin(theta)^m, which (x + iy)^m carries
    c = 1.0
    s = 0.0
    pmm = 0.28209479177387814
    for m in range(degree):
        p0 = 0.0
        p1 = pmm
        for ell in range(m, degree):
            if ell > m:
                p2 = UP[ell, m] * (z * p1 - BACK[ell, m] * p0)
                p0 = p1
                p1 = p2
            if m == 0:
                out[ell * ell + ell] = p1
            else:
                out[ell * ell + ell + m] = 1.4142135623730951 * p1 * c
                out[ell * ell + ell - m] = 1.4142135623730951 * p1 * s
        pmm *= ALONG[m]
        c, s = c * x - s * y, s * x + c * y


@part()
def harmonics_symmetric(mu, cos_azimuth, degree, out):
    """The harmonics even in azimuth (m >= 0) of a direction, into out[l*(l+1)/2 + m].

    In the spherically symmetric atmosphere the field is even about the plane of sun and zenith, and the
    cosine harmonics are all there is. The azimuth is taken from the sun's.
    """
    sin_theta = math.sqrt(max(0.0, 1.0 - mu * mu))
    x = sin_theta * cos_azimuth
    y = sin_theta * math.sqrt(max(0.0, 1.0 - cos_azimuth * cos_azimuth))
    c = 1.0
    s = 0.0
    pmm = 0.28209479177387814
    for m in range(degree):
        p0 = 0.0
        p1 = pmm
        norm = 1.0 if m == 0 else 1.4142135623730951
        for ell in range(m, degree):
            if ell > m:
                p2 = UP[ell, m] * (mu * p1 - BACK[ell, m] * p0)
                p0 = p1
                p1 = p2
            out[ell * (ell + 1) // 2 + m] = norm * p1 * c
        pmm *= ALONG[m]
        c, s = c * x - s * y, s * x + c * y
