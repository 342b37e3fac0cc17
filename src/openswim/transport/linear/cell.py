"""What one step, one place and one look-up do to light, each beside its slopes.

Every sweep and every march of the linear core is a loop around these functions, and so is each of their derivatives:
no two of them can disagree about a formula. The equations are those of docs/fast.md (F9, F16, F17), in double
precision and without limiters; tests/transport/linear/test_cell.py holds slopes against differences, and the values
against those that `fast` computes with.
"""

import math

from openswim.transport.engine.compiled import kernel, part
from openswim.transport.engine.lanes import chosen_above

SMALL = 0.02  # depth below which a slope is a series: it differs from the closed form by 1e-13 there
DARK = 44.0  # depth
_MOST, _NONE = 0.25, 1e-12  # of what steps take, over the light at nodes; added to that, lest it be none
_LEVEL = 1e-12  # a depth of .001 to the fourth: rises below it hardly bound, else a level field would have no slopes
_DEEP = 16.0  # to the fourth, -2: the least that a depth bends by
SOFT = 0.02  # twice the depth of a step below which its ends are trusted, see `amendment`


@part(inlined=True)
def through(tau):
    """(e^-tau, its mean over the step (1 - e^-tau)/tau), of depths of 0 and more.

    The mean of a 64th of the depth is a series, and that of twice a depth is mean (1 + e^-tau)/2. Nothing cancels, and
    there is no branch, so that rows of nodes are found together. Beyond a depth of `DARK` e^-tau stays at 8e-20.
    """
    x = -min(tau, DARK) / 64.0
    m = 1 / 1307674368000 + x * (1 / 20922789888000)
    m = 1 / 6227020800 + x * (1 / 87178291200 + x * m)
    m = 1 / 39916800 + x * (1 / 479001600 + x * m)
    m = 1 / 362880 + x * (1 / 3628800 + x * m)
    m = 1 / 5040 + x * (1 / 40320 + x * m)
    m = 1 / 120 + x * (1 / 720 + x * m)
    m = 1 / 6 + x * (1 / 24 + x * m)
    m = 1.0 + x * (0.5 + x * m)
    t = 1.0 + x * m
    m *= 0.5 + 0.5 * t
    t *= t
    m *= 0.5 + 0.5 * t
    t *= t
    m *= 0.5 + 0.5 * t
    t *= t
    m *= 0.5 + 0.5 * t
    t *= t
    m *= 0.5 + 0.5 * t
    t *= t
    m *= 0.5 + 0.5 * t
    return t * t, m * (DARK / max(tau, DARK))


@part(inlined=True)
def through_slope(tau):
    """Slope of the mean of `through`; that of e^-tau is itself."""
    t, mean = through(tau)
    series = -1 / 2 + tau * (1 / 3 - tau * (1 / 8 - tau * (1 / 30 - tau * (1 / 144 - tau * (1 / 840)))))
    return chosen_above(tau, SMALL, (t - mean) / max(tau, SMALL), series)


@part(inlined=True)
def step_weights(near_ext, far_ext, ds):
    """(trans, near, far): radiance = trans upstream + near S_near + far S_far; extinction and S linear between (F9)."""
    tau = 0.5 * (near_ext + far_ext) * ds
    trans, mean = through(tau)
    c = ds / (12.0 + 2.0 * tau)
    w = mean * ds
    return trans, w * (0.5 + far_ext * c), w * (0.5 - near_ext * c)


@part(inlined=True)
def step_slopes(near_ext, far_ext, ds):
    """Slopes of `step_weights` by the near and by the far extinction: six numbers, weight by weight."""
    tau = 0.5 * (near_ext + far_ext) * ds
    trans, mean = through(tau)
    slope = through_slope(tau)
    c = ds / (12.0 + 2.0 * tau)
    dc = -2.0 * c * c / ds  # by tau
    w, dw = mean * ds, slope * ds
    half = 0.5 * ds  # of tau by either extinction
    common_near = dw * (0.5 + far_ext * c) + w * far_ext * dc
    common_far = dw * (0.5 - near_ext * c) - w * near_ext * dc
    return (
        -trans * half, -trans * half,
        common_near * half, common_near * half + w * c,
        common_far * half - w * c, common_far * half,
    )  # fmt: skip


@part(inlined=True)
def trusted(near_ext, far_ext, ds):
    """By what `amendment` divides; its slopes are one each."""
    return near_ext + far_ext + SOFT / ds


@part(inlined=True)
def amendment(light, up, near, far, near_ext, told, both, ds):
    """What a step takes of the light beyond what its ends say, over its extinction: half of it amends the light that is
    scattered around the near node, half that around the far ones.

        a = ((2/ds) (up - I) + S + S_up - beta I - sum w beta_c I_c)/both

    light, near, near_ext: I, S, beta of the near node; up, far: of the upstream point; told: the sum over its corners.
    Slopes: 2/ds and -(2/ds + beta) by up and light, 1 by the sources, -I and -1 by beta and told, -a by both, all over
    both.
    """
    return (2.0 / ds * (up - light) + near + far - near_ext * light - told) / both


@kernel()
def bounded(t, threads, more, mean, ratio, by_more, by_mean):
    """ratio (nodes,) of the light that is scattered around nodes to that at them, where steps take ``more`` of the mean
    radiance than the ``mean`` at the nodes, and its slopes by both: 1 + y (1 + (y/.25)^4)^(-1/4), y = more/mean, which
    is 1 + y as long as that is small and stays within 1 +- .25."""
    for n in range(t * mean.shape[0] // threads, (t + 1) * mean.shape[0] // threads):
        whole = mean[n] + _NONE
        y = more[n] / whole
        x = y / _MOST
        power = x * x * x * x
        root = (1.0 + power) ** -0.25
        slope = root / (1.0 + power) / whole
        ratio[n], by_more[n], by_mean[n] = 1.0 + y * root, slope, -y * slope


@part(inlined=True)
def _hermite(row, depth):
    """Index and place in its interval, and the cubic's coefficients there."""
    last = row.shape[0] - 1
    u = depth / (1.0 + depth) * last
    i = max(min(int(u), last - 1), 0)  # of no number, too
    a, b = row[i], row[i + 1]
    da = 0.5 * (b - row[i - 1]) if i > 0 else b - a
    db = 0.5 * (row[i + 2] - a) if i + 2 <= last else b - a
    return u - i, a, da, 3 * (b - a) - 2 * da - db, 2 * (a - b) + da + db


@part(inlined=True)
def peak(row, depth):
    """Forward peak of a ray (F17) at a forward depth, from its values (n,) at depth/(1 + depth) = j/(n - 1): a cubic
    through them, since the slope of straight lines jumps at every one."""
    x, a, da, c2, c3 = _hermite(row, depth)
    return a + x * (da + x * (c2 + x * c3))


@part(inlined=True)
def peak_slope(row, depth):
    """Slope of `peak` by the depth."""
    x, _, da, c2, c3 = _hermite(row, depth)
    return (da + x * (2 * c2 + 3 * x * c3)) * (row.shape[0] - 1) / ((1.0 + depth) * (1.0 + depth))


@part(inlined=True)
def bend(linear, mean, rises):
    """By how much the depth to the sun bends along an axis of a cell, c of F5, for the square of a line between roots.

    linear: what extinction and depth at the corners ask for; mean: of the rises of the depth along the four edges;
    rises: sum of the fourth powers of these. ``linear`` stays within twice the largest rise and the whole above -2, as
    in `fast`, but smoothly: x (m^4/(m^4 + x^4))^(1/4).
    """
    most = 16.0 * rises + _LEVEL
    c = linear * math.sqrt(math.sqrt(most / (most + linear**4)))
    c += mean * mean / (64.0 + abs(mean) ** 3) ** (1.0 / 3.0)
    low = min(c, 0.0)
    return c - low + low * math.sqrt(math.sqrt(_DEEP / (_DEEP + low**4)))


@part(inlined=True)
def bend_slopes(linear, mean, rises):
    """Slopes of `bend` by each."""
    most = 16.0 * rises + _LEVEL
    whole = most + linear**4
    share = math.sqrt(math.sqrt(most / whole))
    cube = abs(mean) ** 3
    part = (64.0 + cube) ** (1.0 / 3.0)
    low = min(linear * share + mean * mean / part, 0.0)
    kept = _DEEP / (_DEEP + low**4)
    kept *= math.sqrt(math.sqrt(kept))
    by_most = 0.25 * linear * share * (linear**4 / whole) / most
    return kept * share * (most / whole), kept * mean / part * (2.0 - cube / (64.0 + cube)), kept * 16.0 * by_most


@part(inlined=True)
def beam_of(root, bent):
    """The beam where its root is linear between nodes and its depth bends besides (F5), and e to the minus that; its
    slope by the root is 2 root times the latter, by the depth it is less than nothing, itself."""
    share = math.exp(-bent)
    return root * root * share, share


@part(inlined=True)
def less_between(single, single_far, beam, beam_far):
    """By how much the mean of single scattering times beam along a step is less than that of its ends; linear in
    either, so that its slopes are itself (fast's `march._plain_step`)."""
    return (single_far - single) * (beam_far - beam) / 6.0
