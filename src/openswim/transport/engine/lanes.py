"""Eight numbers at once in a vector register: nodes of a row, of single or of double precision as their array is.

Arithmetic is lane by lane, also with scalars. Of a row's last numbers only the first ``some`` are read and written;
the others are 0. Where ``some`` is None, all eight are. See `pack`, whose packs are single wherever users run them.
"""

from __future__ import annotations

import operator

from llvmlite import ir
from numba import types
from numba.core.cgutils import get_or_insert_function
from numba.core.errors import TypingError
from numba.core.imputils import lower_builtin
from numba.core.typing.templates import AbstractTemplate, infer_global, signature
from numba.extending import intrinsic, models, overload, register_model

LANES = 8

_INT, _BIT = ir.IntType(32), ir.IntType(1)
_FAST = ("contract",)


class LanesType(types.Type):
    """``LANES`` numbers of an element's type."""

    def __init__(self, element: types.Float) -> None:
        self.element = element
        super().__init__(f"Lanes({element})")


def _vector(kind: LanesType) -> ir.VectorType:
    return ir.VectorType(ir.FloatType() if kind.element.bitwidth == 32 else ir.DoubleType(), LANES)


@register_model(LanesType)
class _LanesModel(models.PrimitiveModel):
    def __init__(self, manager, fe_type):
        super().__init__(manager, fe_type, _vector(fe_type))


def _constant(kind, numbers):
    return ir.Constant(ir.VectorType(kind, LANES), list(numbers))


def _repeated(builder, value):
    undefined = ir.Constant(ir.VectorType(value.type, LANES), ir.Undefined)
    one = builder.insert_element(undefined, value, _INT(0))
    return builder.shuffle_vector(one, undefined, _constant(_INT, [0] * LANES))


def _spread(context, builder, given, value, wanted):
    """Equal numbers in all lanes; lanes pass."""
    if isinstance(given, LanesType):
        return value
    value = context.cast(builder, value, given, wanted.element)
    return _repeated(builder, value)


def _kind_of(args):
    """The type of lanes among arguments that are such lanes and numbers, or None."""
    kinds = {a for a in args if isinstance(a, LanesType)}
    return kinds.pop() if len(kinds) == 1 and all(isinstance(a, LanesType | types.Number) for a in args) else None


def _teach(operation, build) -> None:
    """Teach Numba an operation of two on lanes."""

    @infer_global(operation)
    class _Typing(AbstractTemplate):
        def generic(self, args, kws):
            kind = _kind_of(args) if len(args) == 2 else None
            return None if kind is None else signature(kind, *args)

    def lower(context, builder, sig, args):
        kind = sig.return_type
        return build(builder, *(_spread(context, builder, t, v, kind) for t, v in zip(sig.args, args, strict=True)))

    for kinds in ((LanesType, LanesType), (LanesType, types.Number), (types.Number, LanesType)):
        lower_builtin(operation, *kinds)(lower)


def _plain(instruction):
    return lambda builder, a, b: getattr(builder, instruction)(a, b, flags=_FAST)


def _chosen(relation):
    return lambda builder, a, b: builder.select(builder.fcmp_ordered(relation, a, b), a, b)


for _operations, _instruction in (
    ((operator.add, operator.iadd), "fadd"), ((operator.sub, operator.isub), "fsub"),
    ((operator.mul, operator.imul), "fmul"), ((operator.truediv, operator.itruediv), "fdiv"),
):  # fmt: skip
    for _operation in _operations:
        _teach(_operation, _plain(_instruction))
_teach(min, _chosen("<"))
_teach(max, _chosen(">"))


@infer_global(operator.neg)
class _Negative(AbstractTemplate):
    def generic(self, args, kws):
        return signature(args[0], args[0]) if isinstance(args[0], LanesType) else None


@lower_builtin(operator.neg, LanesType)
def _negative(context, builder, sig, args):
    return builder.fneg(args[0])


def chosen_above(a, b, above, other):
    """``above`` where a > b, else ``other``: of numbers, or lane by lane."""
    return above if a > b else other


@overload(chosen_above)
def _compiled_choice(a, b, above, other):
    return lambda a, b, above, other: _chosen_above(a, b, above, other)


@intrinsic
def _chosen_above(typingctx, a, b, above, other):
    given = (a, b, above, other)
    kind = _kind_of(given)

    def lower(context, builder, sig, args):
        if kind is None:
            args = [context.cast(builder, v, t, types.float64) for t, v in zip(sig.args, args, strict=True)]
        else:
            args = [_spread(context, builder, t, v, kind) for t, v in zip(sig.args, args, strict=True)]
        return builder.select(builder.fcmp_ordered(">", args[0], args[1]), args[2], args[3])

    return (kind or types.float64)(*given), lower


def _place(context, builder, array_type, array, n):
    """Pointer to the lanes from flat element n on."""
    data = context.make_array(array_type)(context, builder, array).data
    kind = _vector(LanesType(array_type.dtype))
    return builder.bitcast(builder.gep(data, [n]), kind.as_pointer()), kind


def _first(context, builder, kind, some):
    """Which lanes are meant."""
    count = _repeated(builder, context.cast(builder, some, kind, types.int32))
    return builder.icmp_signed("<", _constant(_INT, range(LANES)), count)


def _masked(what: str, array: types.Array) -> str:
    return f"llvm.masked.{what}.v{LANES}f{array.dtype.bitwidth}.p0"


def _check(array, some) -> None:
    if not isinstance(array, types.Array) or array.layout != "C" or not isinstance(array.dtype, types.Float):
        raise TypingError(f"a C-contiguous array of numbers is needed, not {array}")
    if not isinstance(some, types.Integer | types.NoneType):
        raise TypingError(f"a number of lanes or None is needed, not {some}")


@intrinsic
def read(typingctx, array, n, some):
    """The numbers from flat element n of an array on."""
    _check(array, some)

    def lower(context, builder, sig, args):
        pointer, kind = _place(context, builder, sig.args[0], args[0], args[1])
        align = sig.args[0].dtype.bitwidth // 8
        if isinstance(sig.args[2], types.NoneType):
            return builder.load(pointer, align=align)
        mask = _first(context, builder, sig.args[2], args[2])
        function_type = ir.FunctionType(kind, [pointer.type, _INT, mask.type, kind])
        function = get_or_insert_function(builder.module, function_type, _masked("load", sig.args[0]))
        return builder.call(function, [pointer, _INT(align), mask, ir.Constant(kind, [0.0] * LANES)])

    return LanesType(array.dtype)(array, types.intp, some), lower


@intrinsic
def write(typingctx, array, n, lanes, some):
    """Store lanes from flat element n of an array on."""
    _check(array, some)

    def lower(context, builder, sig, args):
        pointer, kind = _place(context, builder, sig.args[0], args[0], args[1])
        align = sig.args[0].dtype.bitwidth // 8
        if isinstance(sig.args[3], types.NoneType):
            builder.store(args[2], pointer, align=align)
        else:
            mask = _first(context, builder, sig.args[3], args[3])
            function_type = ir.FunctionType(ir.VoidType(), [kind, pointer.type, _INT, mask.type])
            function = get_or_insert_function(builder.module, function_type, _masked("store", sig.args[0]))
            builder.call(function, [args[2], pointer, _INT(align), mask])
        return context.get_dummy_value()

    return types.void(array, types.intp, LanesType(array.dtype), some), lower
