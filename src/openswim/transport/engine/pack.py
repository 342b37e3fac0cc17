"""Packs: several numbers at once in a vector register, and how Numba's kernels read, split and reckon with them.

PACK of them are one number per wavelength; 2 PACK and 4 PACK lie together where a place has several such numbers.
Arithmetic among packs of a width, and of packs with scalars, is lane by lane. Without this LLVM must prove that arrays
lie apart before it vectorises, and mostly cannot; where a processor's registers are narrower, LLVM splits a pack.
Numbers are `types.FLOAT`. In a checked build what lies beyond an array is neither read nor written.
"""

from __future__ import annotations

import operator

import numpy as np
from llvmlite import ir
from numba import from_dtype, types
from numba.core.cgutils import get_or_insert_function, if_unlikely
from numba.core.errors import TypingError
from numba.core.imputils import lower_builtin
from numba.core.typing.templates import AbstractTemplate, infer_global, signature
from numba.extending import intrinsic, models, register_model

from openswim.transport.engine.types import BYTES, CHECKED, FLOAT

PACK = 4  # wavelengths carried together
LANES = 4 * PACK  # numbers in the widest pack


class PackType(types.Type):
    """``width`` numbers at once."""

    def __init__(self, width: int) -> None:
        self.width = width
        super().__init__(f"Pack{width}")


_NARROW, _DOUBLE, _QUADRUPLE = (PackType(n * PACK) for n in (1, 2, 4))
_NUMBER = from_dtype(np.dtype(FLOAT))
_FLOAT, _INT = ir.FloatType() if BYTES == 4 else ir.DoubleType(), ir.IntType(32)
_FAST = ("contract", "reassoc", "nsz", "arcp", "nnan", "ninf")


def _vector(kind, element=_FLOAT):
    return ir.VectorType(element, kind.width)


def _undefined(kind):
    return ir.Constant(_vector(kind), ir.Undefined)


def _indices(numbers):
    return ir.Constant(ir.VectorType(_INT, len(numbers)), list(numbers))


@register_model(PackType)
class _PackModel(models.PrimitiveModel):
    def __init__(self, manager, fe_type):
        super().__init__(manager, fe_type, _vector(fe_type))


def _spread(context, builder, kind, value, wanted):
    """A pack of equal numbers; packs pass."""
    if isinstance(kind, PackType):
        return value
    value = context.cast(builder, value, kind, _NUMBER)
    one = builder.insert_element(_undefined(wanted), value, _INT(0))
    return builder.shuffle_vector(one, _undefined(wanted), _indices([0] * wanted.width))


def _width_of(args):
    """The pack type among argument types, or None where there is none, or two widths."""
    widths = {a for a in args if isinstance(a, PackType)}
    others = all(isinstance(a, PackType | types.Float) for a in args)
    return widths.pop() if len(widths) == 1 and others else None


def _arithmetic(operation, instruction: str) -> None:
    """Teach Numba one operator on packs."""

    @infer_global(operation)
    class _Typing(AbstractTemplate):
        def generic(self, args, kws):
            kind = _width_of(args)
            return None if kind is None else signature(kind, *args)

    def lower(context, builder, sig, args):
        kind = sig.return_type
        a, b = (_spread(context, builder, t, v, kind) for t, v in zip(sig.args, args, strict=True))
        return getattr(builder, instruction)(a, b, flags=_FAST)

    for kinds in ((PackType, PackType), (PackType, types.Float), (types.Float, PackType)):
        lower_builtin(operation, *kinds)(lower)


for _operation, _instruction in (
    (operator.add, "fadd"), (operator.iadd, "fadd"), (operator.sub, "fsub"), (operator.isub, "fsub"),
    (operator.mul, "fmul"), (operator.imul, "fmul"), (operator.truediv, "fdiv"), (operator.itruediv, "fdiv"),
):  # fmt: skip
    _arithmetic(_operation, _instruction)


def _element(context, builder, array_type, array, n, width=1):
    """Pointer to flat element n, from which ``width`` are to be read or written."""
    whole = context.make_array(array_type)(context, builder, array)
    if CHECKED:
        beyond = builder.icmp_signed(">", n, builder.sub(whole.nitems, n.type(width)))
        with if_unlikely(builder, builder.or_(beyond, builder.icmp_signed("<", n, n.type(0)))):
            words = f"{context.fndesc.qualname}: {width} in a row of {array_type} are not all within it"
            context.call_conv.return_user_exc(builder, IndexError, (words,))
    return builder.gep(whole.data, [n])


def _flat_array(array, element=None) -> None:
    if not isinstance(array, types.Array) or array.layout != "C" or element not in (None, array.dtype):
        raise TypingError(f"a C-contiguous array of {element or 'any kind'} is needed, not {array}")


@intrinsic
def flat(typingctx, array, n):
    """Element n of an array taken as one row: no bounds, no wraparound. C-contiguous arrays only."""
    _flat_array(array)

    def lower(context, builder, sig, args):
        pointer = _element(context, builder, sig.args[0], args[0], args[1])
        return context.unpack_value(builder, sig.args[0].dtype, pointer)

    return array.dtype(array, types.intp), lower


def _reader(kind):
    def lower(context, builder, sig, args):
        pointer = _element(context, builder, sig.args[0], args[0], args[1], kind.width)
        return builder.load(builder.bitcast(pointer, _vector(kind).as_pointer()), align=BYTES)

    return lower


@intrinsic
def read(typingctx, array, n):
    """The PACK numbers from flat element n of an array."""
    _flat_array(array, _NUMBER)
    return _NARROW(array, types.intp), _reader(_NARROW)


@intrinsic
def read_double(typingctx, array, n):
    """The 2 PACK numbers from flat element n of an array."""
    _flat_array(array, _NUMBER)
    return _DOUBLE(array, types.intp), _reader(_DOUBLE)


@intrinsic
def read_quadruple(typingctx, array, n):
    """The 4 PACK numbers from flat element n of an array."""
    _flat_array(array, _NUMBER)
    return _QUADRUPLE(array, types.intp), _reader(_QUADRUPLE)


def _bytes_reader(kind):
    def lower(context, builder, sig, args):
        pointer = _element(context, builder, sig.args[0], args[0], args[1], kind.width)
        given = _vector(kind, ir.IntType(8))
        return builder.sitofp(builder.load(builder.bitcast(pointer, given.as_pointer()), align=4), _vector(kind))

    return lower


@intrinsic
def read_double_bytes(typingctx, array, n):
    """The 2 PACK numbers from flat element n of an int8 array, n a multiple of PACK."""
    _flat_array(array, types.int8)
    return _DOUBLE(array, types.intp), _bytes_reader(_DOUBLE)


@intrinsic
def read_lanes(typingctx, array, start, rows):
    """Lane by lane its own row of a table (rows, PACK) that begins at flat element ``start``; ``rows`` a pack >= 0."""
    _flat_array(array, _NUMBER)

    def lower(context, builder, sig, args):
        whole = builder.fptosi(args[2], _vector(_NARROW, _INT))
        out = _undefined(_NARROW)
        for w in range(PACK):
            row = builder.zext(builder.extract_element(whole, _INT(w)), args[1].type)
            n = builder.add(args[1], builder.add(builder.mul(row, row.type(PACK)), row.type(w)))
            value = builder.load(_element(context, builder, sig.args[0], args[0], n))
            out = builder.insert_element(out, value, _INT(w))
        return out

    return _NARROW(array, types.intp, _NARROW), lower


@intrinsic
def write(typingctx, array, n, pack):
    """Store a pack at flat element n."""
    _flat_array(array, _NUMBER)

    def lower(context, builder, sig, args):
        pointer = _element(context, builder, sig.args[0], args[0], args[1], sig.args[2].width)
        builder.store(args[2], builder.bitcast(pointer, _vector(sig.args[2]).as_pointer()), align=BYTES)
        return context.get_dummy_value()

    return types.void(array, types.intp, pack), lower


@intrinsic
def spread(typingctx, x):
    """PACK equal numbers."""

    def lower(context, builder, sig, args):
        return _spread(context, builder, sig.args[0], args[0], _NARROW)

    return _NARROW(x), lower


@intrinsic
def spread_quadruple(typingctx, x):
    """4 PACK equal numbers."""

    def lower(context, builder, sig, args):
        return _spread(context, builder, sig.args[0], args[0], _QUADRUPLE)

    return _QUADRUPLE(x), lower


@intrinsic
def root(typingctx, pack):
    """Square roots of a pack."""

    def lower(context, builder, sig, args):
        kind = args[0].type
        name = f"llvm.sqrt.v{sig.return_type.width}f{8 * BYTES}"
        function = get_or_insert_function(builder.module, ir.FunctionType(kind, [kind]), name)
        return builder.call(function, args)

    return pack(pack), lower


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
def expect(typingctx, array, n):
    """Ask for the cache line of flat element n, which will be read soon."""
    _flat_array(array)

    def lower(context, builder, sig, args):
        byte = ir.IntType(8).as_pointer()
        data = context.make_array(sig.args[0])(context, builder, args[0]).data  # asking beyond an array does no harm
        pointer = builder.bitcast(builder.gep(data, [args[1]]), byte)
        kind = ir.FunctionType(ir.VoidType(), [byte, _INT, _INT, _INT])
        function = builder.module.declare_intrinsic("llvm.prefetch", (byte,), kind)
        builder.call(function, [pointer, _INT(0), _INT(3), _INT(1)])
        return context.get_dummy_value()

    return types.void(array, types.intp), lower


@intrinsic
def each(typingctx, a, b, c, d):
    """Four numbers, each PACK times: what multiplies four packs that lie together."""

    def lower(context, builder, sig, args):
        out = _undefined(_NARROW)
        for w, x in enumerate(args):
            out = builder.insert_element(out, x, _INT(w))
        return builder.shuffle_vector(out, _undefined(_NARROW), _indices([n // PACK for n in range(4 * PACK)]))

    return _QUADRUPLE(_NUMBER, _NUMBER, _NUMBER, _NUMBER), lower


def _finer(factor: int):
    """Of nodes 0, 1, ... the linear interpolation to ``factor`` places a node, centred on nodes 1, 2, ..."""

    def lower(context, builder, sig, args):
        places = [1 + (n - (factor - 1) / 2) / factor for n in range(LANES)]
        near = builder.shuffle_vector(args[0], args[0], _indices([int(x) for x in places]))
        far = builder.shuffle_vector(args[0], args[0], _indices([int(x) + 1 for x in places]))
        share = ir.Constant(_vector(_QUADRUPLE), [x % 1 for x in places])
        change = builder.fmul(share, builder.fsub(far, near, flags=_FAST), flags=_FAST)
        return builder.fadd(near, change, flags=_FAST)

    return _QUADRUPLE(_QUADRUPLE), lower


@intrinsic
def twice_as_fine(typingctx, pack):
    """LANES nodes of a grid, two for each from the second number of ``pack`` on."""
    return _finer(2)


@intrinsic
def four_times_as_fine(typingctx, pack):
    """The same, four for each."""
    return _finer(4)


def _half_of(pack, which: int):
    kind = _NARROW if pack == _DOUBLE else _DOUBLE

    def lower(context, builder, sig, args):
        numbers = range(which * kind.width, (which + 1) * kind.width)
        return builder.shuffle_vector(args[0], args[0], _indices(numbers))

    return kind(pack), lower


@intrinsic
def low(typingctx, pack):
    """First half of a pack."""
    return _half_of(pack, 0)


@intrinsic
def high(typingctx, pack):
    """Second half of a pack."""
    return _half_of(pack, 1)


def _integers(builder, value):
    """Integer parts, of integers as wide as the numbers are."""
    kind, given = ir.IntType(8 * BYTES), value.type
    return builder.fptosi(value, ir.VectorType(kind, given.count) if isinstance(given, ir.VectorType) else kind)


@intrinsic
def whole(typingctx, x):
    """Integer part of a number or a pack >= 0."""
    kind = x if isinstance(x, PackType) else _NUMBER

    def lower(context, builder, sig, args):
        return builder.sitofp(_integers(builder, args[0]), args[0].type)

    return kind(kind), lower


@intrinsic
def halved(typingctx, x, times):
    """A number or a pack, halved as often as the integer part of ``times`` >= 0 says; it must not become denormal."""
    kind = x if isinstance(x, PackType) else _NUMBER

    def lower(context, builder, sig, args):
        steps = _integers(builder, args[1])
        exponent = 23 if BYTES == 4 else 52
        shift = ir.Constant(steps.type, [exponent] * steps.type.count if kind is not _NUMBER else exponent)
        bits = builder.sub(builder.bitcast(args[0], steps.type), builder.shl(steps, shift))
        return builder.bitcast(bits, args[0].type)

    return kind(kind, kind), lower


@intrinsic
def power_of_two(typingctx, x):
    """The greatest power of two that is not above a number > 0."""

    def lower(context, builder, sig, args):
        kind = ir.IntType(8 * BYTES)
        bits = builder.bitcast(context.cast(builder, args[0], sig.args[0], _NUMBER), kind)
        exponent = kind(0x7F800000 if BYTES == 4 else 0x7FF0000000000000)
        return builder.bitcast(builder.and_(bits, exponent), _FLOAT)

    return _NUMBER(x), lower


@intrinsic
def largest(typingctx, pack):
    """Greatest of a pack's numbers."""

    def lower(context, builder, sig, args):
        lanes = [builder.extract_element(args[0], _INT(w)) for w in range(sig.args[0].width)]
        while len(lanes) > 1:
            a, b = lanes.pop(0), lanes.pop(0)
            lanes.append(builder.select(builder.fcmp_ordered(">", a, b, flags=_FAST), a, b))
        return lanes[0]

    return _NUMBER(pack), lower


@intrinsic
def sum_of(typingctx, pack):
    """Sum of a pack's numbers."""

    def lower(context, builder, sig, args):
        lanes = [builder.extract_element(args[0], _INT(w)) for w in range(sig.args[0].width)]
        while len(lanes) > 1:
            half = len(lanes) // 2
            lanes = [builder.fadd(a, b, flags=_FAST) for a, b in zip(lanes[:half], lanes[half:], strict=True)]
        return lanes[0]

    return _NUMBER(pack), lower


@intrinsic
def lane(typingctx, pack, n):
    """Number n of a pack."""

    def lower(context, builder, sig, args):
        return builder.extract_element(args[0], args[1])

    return _NUMBER(pack, types.intp), lower


@intrinsic
def whole_lane(typingctx, pack, n):
    """Integer part of number n of a pack."""

    def lower(context, builder, sig, args):
        number = builder.extract_element(builder.fptosi(args[0], _vector(sig.args[0], _INT)), args[1])
        return builder.sext(number, context.get_value_type(types.intp))

    return types.intp(pack, types.intp), lower


@intrinsic
def floored(typingctx, pack):
    """A pack's numbers rounded down."""

    def lower(context, builder, sig, args):
        kind = args[0].type
        name = f"llvm.floor.v{sig.return_type.width}f{8 * BYTES}"
        return builder.call(get_or_insert_function(builder.module, ir.FunctionType(kind, [kind]), name), args)

    return pack(pack), lower


@intrinsic
def choose_above(typingctx, a, b, above, other):
    """``above`` where a > b, else ``other``: for scalars, or lane by lane for packs."""
    given = (a, b, above, other)
    kind = _width_of(given) or _NUMBER

    def lower(context, builder, sig, args):
        if kind is not _NUMBER:
            args = [_spread(context, builder, t, v, kind) for t, v in zip(sig.args, args, strict=True)]
        return builder.select(builder.fcmp_ordered(">", args[0], args[1], flags=_FAST), args[2], args[3])

    return (kind(*given) if kind is not _NUMBER else kind(kind, kind, kind, kind)), lower
