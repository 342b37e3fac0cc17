"""Small pure functions of scalars: the physics of one step, one place, one look-up.

Every kernel is built of these and nothing else, so that a GPU back end or a hand-written adjoint can
reuse them. Units are in the names; none of them keeps state.
"""

from __future__ import annotations

import math
import operator

import numpy as np
from llvmlite import ir
from numba import njit, types
from numba.core.errors import TypingError
from numba.core.imputils import lower_builtin
from numba.core.typing.templates import AbstractTemplate, infer_global, signature
from numba.extending import intrinsic, models, register_model

PACK = 4  # wavelengths carried together, in one vector register
_F1 = np.float32(1.0)
_MOST_DEGREE = 12


class PackType(types.Type):
    """PACK float32 at once: one number per wavelength. Arithmetic among packs, and of packs with scalars, is lane by
    lane; without this LLVM must prove that arrays lie apart before it vectorises, and mostly cannot."""

    def __init__(self) -> None:
        super().__init__("Pack")


pack_type = PackType()
_FLOAT, _INT = ir.FloatType(), ir.IntType(32)
_VECTOR = ir.VectorType(_FLOAT, PACK)
_FAST = ("contract", "reassoc", "nsz", "arcp", "nnan", "ninf")


@register_model(PackType)
class _PackModel(models.PrimitiveModel):
    def __init__(self, manager, fe_type):
        super().__init__(manager, fe_type, _VECTOR)


def _spread(context, builder, kind, value):
    """A pack of equal numbers; packs pass."""
    if isinstance(kind, PackType):
        return value
    value = context.cast(builder, value, kind, types.float32)
    one = builder.insert_element(ir.Constant(_VECTOR, ir.Undefined), value, _INT(0))
    return builder.shuffle_vector(one, ir.Constant(_VECTOR, ir.Undefined), ir.Constant(ir.VectorType(_INT, PACK), None))


def _arithmetic(operation, instruction: str) -> None:
    """Teach Numba one operator on packs."""

    @infer_global(operation)
    class _Typing(AbstractTemplate):
        def generic(self, args, kws):
            packs = [isinstance(a, PackType) for a in args]
            if any(packs) and all(p or isinstance(a, types.Float) for a, p in zip(args, packs, strict=True)):
                return signature(pack_type, *args)
            return None

    def lower(context, builder, sig, args):
        a, b = (_spread(context, builder, t, v) for t, v in zip(sig.args, args, strict=True))
        return getattr(builder, instruction)(a, b, flags=_FAST)

    for kinds in ((PackType, PackType), (PackType, types.Float), (types.Float, PackType)):
        lower_builtin(operation, *kinds)(lower)


for _operation, _instruction in (
    (operator.add, "fadd"), (operator.iadd, "fadd"), (operator.sub, "fsub"), (operator.isub, "fsub"),
    (operator.mul, "fmul"), (operator.imul, "fmul"), (operator.truediv, "fdiv"), (operator.itruediv, "fdiv"),
):  # fmt: skip
    _arithmetic(_operation, _instruction)


def _element(context, builder, array_type, array, n):
    """Pointer to flat element n."""
    data = context.make_array(array_type)(context, builder, array).data
    return builder.gep(data, [n])


def _flat_array(array) -> None:
    if not isinstance(array, types.Array) or array.layout != "C":
        raise TypingError(f"a C-contiguous array is needed, not {array}")


@intrinsic
def flat(typingctx, array, n):
    """Element n of an array taken as one row: no bounds, no wraparound. C-contiguous arrays only."""
    _flat_array(array)

    def lower(context, builder, sig, args):
        pointer = _element(context, builder, sig.args[0], args[0], args[1])
        return context.unpack_value(builder, sig.args[0].dtype, pointer)

    return array.dtype(array, types.intp), lower


@intrinsic
def read(typingctx, array, n):
    """The pack whose first number is flat element n of a float32 array."""
    _flat_array(array)

    def lower(context, builder, sig, args):
        pointer = _element(context, builder, sig.args[0], args[0], args[1])
        return builder.load(builder.bitcast(pointer, _VECTOR.as_pointer()), align=4)

    return pack_type(array, types.intp), lower


@intrinsic
def read_row(typingctx, array, k):
    """Row k of an array (n, PACK) of any layout."""

    def lower(context, builder, sig, args):
        kind = sig.args[0]
        a = context.make_array(kind)(context, builder, args[0])
        if kind.layout == "C":
            pointer = builder.gep(a.data, [builder.mul(args[1], args[1].type(PACK))])
            return builder.load(builder.bitcast(pointer, _VECTOR.as_pointer()), align=4)
        strides = [builder.extract_value(a.strides, i) for i in range(2)]
        out = ir.Constant(_VECTOR, ir.Undefined)
        start = builder.ptrtoint(a.data, args[1].type)
        start = builder.add(start, builder.mul(args[1], strides[0]))
        for w in range(PACK):
            place = builder.add(start, builder.mul(strides[1], args[1].type(w)))
            value = builder.load(builder.inttoptr(place, _FLOAT.as_pointer()))
            out = builder.insert_element(out, value, _INT(w))
        return out

    return pack_type(array, types.intp), lower


@intrinsic
def read_lanes(typingctx, array, start, rows):
    """Lane by lane its own row of a table (rows, PACK) that begins at flat element ``start``; ``rows`` a pack >= 0."""
    _flat_array(array)

    def lower(context, builder, sig, args):
        whole = builder.fptosi(args[2], ir.VectorType(_INT, PACK))
        out = ir.Constant(_VECTOR, ir.Undefined)
        for w in range(PACK):
            row = builder.zext(builder.extract_element(whole, _INT(w)), args[1].type)
            n = builder.add(args[1], builder.add(builder.mul(row, row.type(PACK)), row.type(w)))
            value = builder.load(_element(context, builder, sig.args[0], args[0], n))
            out = builder.insert_element(out, value, _INT(w))
        return out

    return pack_type(array, types.intp, pack_type), lower


@intrinsic
def write(typingctx, array, n, pack):
    """Store a pack at flat element n."""
    _flat_array(array)

    def lower(context, builder, sig, args):
        pointer = _element(context, builder, sig.args[0], args[0], args[1])
        builder.store(args[2], builder.bitcast(pointer, _VECTOR.as_pointer()), align=4)
        return context.get_dummy_value()

    return types.void(array, types.intp, pack_type), lower


@intrinsic
def put(typingctx, array, n, x):
    """Store a scalar at flat element n."""
    _flat_array(array)

    def lower(context, builder, sig, args):
        pointer = _element(context, builder, sig.args[0], args[0], args[1])
        value = context.cast(builder, args[2], sig.args[2], sig.args[0].dtype)
        context.pack_value(builder, sig.args[0].dtype, value, pointer)
        return context.get_dummy_value()

    return types.void(array, types.intp, x), lower


@intrinsic
def spread(typingctx, x):
    """A pack of equal numbers."""

    def lower(context, builder, sig, args):
        return _spread(context, builder, sig.args[0], args[0])

    return pack_type(x), lower


@intrinsic
def pack_of(typingctx, a, b, c, d):
    """A pack of four numbers."""

    def lower(context, builder, sig, args):
        out = ir.Constant(_VECTOR, ir.Undefined)
        for w, x in enumerate(args):
            out = builder.insert_element(out, x, _INT(w))
        return out

    return pack_type(types.float32, types.float32, types.float32, types.float32), lower


@intrinsic
def whole(typingctx, pack):
    """Integer part of a pack >= 0."""

    def lower(context, builder, sig, args):
        return builder.sitofp(builder.fptosi(args[0], ir.VectorType(_INT, PACK)), _VECTOR)

    return pack_type(pack_type), lower


@intrinsic
def largest(typingctx, pack):
    """Greatest of a pack's numbers."""

    def lower(context, builder, sig, args):
        lanes = [builder.extract_element(args[0], _INT(w)) for w in range(PACK)]
        while len(lanes) > 1:
            a, b = lanes.pop(0), lanes.pop(0)
            lanes.append(builder.select(builder.fcmp_ordered(">", a, b), a, b))
        return lanes[0]

    return types.float32(pack_type), lower


@intrinsic
def choose_above(typingctx, a, b, above, other):
    """``above`` where a > b, else ``other``: for scalars, or lane by lane for packs."""
    kind = pack_type if any(isinstance(t, PackType) for t in (a, b, above, other)) else types.float32

    def lower(context, builder, sig, args):
        if kind is pack_type:
            args = [_spread(context, builder, t, v) for t, v in zip(sig.args, args, strict=True)]
        return builder.select(builder.fcmp_ordered(">", args[0], args[1], flags=_FAST), args[2], args[3])

    return (kind(a, b, above, other) if kind is pack_type else kind(kind, kind, kind, kind)), lower


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


_UP, _BACK, _ALONG = _recurrence()
_POWERS = 5


def _factors() -> np.ndarray:
    """Coefficients (l(l+1)/2 + m, power) of `legendre_factor`."""
    rows = []
    for ell in range(_POWERS):
        for m in range(ell + 1):
            p0, p1 = np.zeros(_POWERS), np.zeros(_POWERS)
            p1[0] = math.sqrt((0.25 if m == 0 else 0.5) / math.pi) * np.prod(_ALONG[:m])
            for n in range(m + 1, ell + 1):
                p0, p1 = p1, _UP[n, m] * (np.roll(p1, 1) - _BACK[n, m] * p0)
            rows.append(p1)
    return np.array(rows, np.float32)


_FACTORS = _factors()


@njit(cache=True, error_model="numpy", _nrt=False, fastmath=True, inline="always")
def transmission(optical_depth):
    """exp(-optical_depth) for any depth >= 0, absolute error below 2e-5; vectorises, unlike exp.

    The Taylor polynomial of exp at a sixteenth of the depth, inverted and squared four times.
    """
    y = optical_depth * np.float32(0.0625)
    p = _F1 + y * (
        _F1 + y * (np.float32(0.5) + y * (np.float32(1 / 6) + y * (np.float32(1 / 24) + y * np.float32(1 / 120))))
    )
    t = _F1 / p
    t = t * t
    t = t * t
    t = t * t
    return t * t


@njit(cache=True, error_model="numpy", _nrt=False, fastmath=True, inline="always")
def step_emission(depth, trans, step_m, source_near, source_far, extinction_near, extinction_far):
    """Light that one step adds at its near end, extinction and source linear along it.

    (1 - e^-tau)/tau ds [(S_n + S_f)/2 + (S_n beta_f - S_f beta_n) ds/(12 + 2 tau)], transport.md section 2;
    right in the thin and the thick limit. ``depth`` = (beta_n + beta_f) ds/2, ``trans`` = e^-depth.
    """
    mean_transmission = choose_above(
        depth, np.float32(0.01), (_F1 - trans) / depth, _F1 - depth * (np.float32(0.5) - depth * np.float32(1 / 6))
    )
    slope = (source_near * extinction_far - source_far * extinction_near) * step_m
    return (
        mean_transmission
        * step_m
        * (np.float32(0.5) * (source_near + source_far) + slope / (np.float32(12.0) + np.float32(2.0) * depth))
    )


@njit(cache=True, error_model="numpy", _nrt=False, fastmath=True, inline="always")
def height_m(x, y, z, radius_m):
    """Height above the sphere of a point given relative to the sphere's top point; no cancellation."""
    return height_of_square_m(x * x + y * y + z * (2.0 * radius_m + z), radius_m)


@njit(cache=True, error_model="numpy", _nrt=False, fastmath=True)
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


@njit(cache=True, error_model="numpy", _nrt=False, fastmath=True, inline="always")
def shadow_fraction(mu, mu_horizon, sun_radius_rad):
    """Share of the sun's disc above the horizon (0..1), mu and mu_horizon being cosines of zenith angles."""
    x = (mu - mu_horizon) / sun_radius_rad
    if x >= 1.0:
        return 1.0
    if x <= -1.0:
        return 0.0
    return 0.5 + (x * math.sqrt(1.0 - x * x) + math.asin(x)) / math.pi


@njit(cache=True, error_model="numpy", _nrt=False, fastmath=True, inline="always")
def table_index(value, origin, per_unit, table):
    """Fractional index of ``value`` by a uniform look-up table of fractional indices (ends clamped)."""
    t = (value - origin) * per_unit
    n = table.shape[0] - 1
    t = min(max(t, 0.0), n * 1.0)
    i = min(int(t), n - 1)
    f = t - i
    low = flat(table, i)
    return low + f * (flat(table, i + 1) - low)


@njit(cache=True, error_model="numpy", _nrt=False, fastmath=True, inline="always")
def smoothstep(x):
    """0 below 0, 1 above 1, smooth between."""
    if x <= 0.0:
        return 0.0
    if x >= 1.0:
        return 1.0
    return x * x * (3.0 - 2.0 * x)


@njit(cache=True, error_model="numpy", _nrt=False, fastmath=True, forceinline=True)
def legendre_factor(index, z):
    """What Y_lm (m >= 0, cosine part, orthonormal) is without sin^m cos(m azimuth), at l(l+1)/2 + m = ``index``,
    l <= 4: a polynomial of the cosine z."""
    n = index * _POWERS
    p = flat(_FACTORS, n + _POWERS - 1)
    for power in range(_POWERS - 2, -1, -1):
        p = p * z + flat(_FACTORS, n + power)
    return p


@njit(cache=True, error_model="numpy", _nrt=False)
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
                p2 = _UP[ell, m] * (z * p1 - _BACK[ell, m] * p0)
                p0 = p1
                p1 = p2
            if m == 0:
                out[ell * ell + ell] = p1
            else:
                out[ell * ell + ell + m] = 1.4142135623730951 * p1 * c
                out[ell * ell + ell - m] = 1.4142135623730951 * p1 * s
        pmm *= _ALONG[m]
        c, s = c * x - s * y, s * x + c * y


@njit(cache=True, error_model="numpy", _nrt=False)
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
                p2 = _UP[ell, m] * (mu * p1 - _BACK[ell, m] * p0)
                p0 = p1
                p1 = p2
            out[ell * (ell + 1) // 2 + m] = norm * p1 * c
        pmm *= _ALONG[m]
        c, s = c * x - s * y, s * x + c * y
