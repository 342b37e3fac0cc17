"""How kernels are compiled: in two ways, with the liberties that the compiler may take with what they reckon.

A `kernel` is called from Python or owns arrays; a `part` is called by kernels and makes none, so that nothing counts
who holds them. Both are kept on disk and divide as NumPy does. Neither has an entry for C, which nobody calls: it would
be compiled for each function, with all that is inlined in it: 8 % more of the first start.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from numba import njit

CONTRACTED = frozenset({"contract"})  # a product and a sum in one instruction
IN_ORDER = CONTRACTED | {"nsz", "arcp"}  # products by reciprocals too; sums keep their order
REORDERED = IN_ORDER | {"reassoc"}
FINITE = REORDERED | {"nnan", "ninf"}  # and no number is NaN or infinite
FAST = frozenset({"fast"})  # and functions may be approximate

_Decorator = Callable[[Any], Any]


def kernel(liberties: frozenset[str] = frozenset()) -> _Decorator:
    """Decorator of a function that Python calls, or that makes arrays; liberties: one of the sets above."""
    return _compiled(liberties)


def part(liberties: frozenset[str] = frozenset(), *, inlined: bool = False, merged: bool = False) -> _Decorator:
    """Decorator of a function that kernels call and that makes no arrays.

    liberties: one of the sets above. inlined: its machine code becomes its callers'. merged: its source does, before
    types are known.
    """
    more: dict[str, Any] = {"forceinline": True} if inlined else {}
    return _compiled(liberties, _nrt=False, inline="always" if merged else "never", **more)


def _compiled(liberties: frozenset[str], **more: Any) -> _Decorator:
    how: dict[str, Any] = {"cache": True, "error_model": "numpy", "nogil": True, "no_cfunc_wrapper": True, **more}
    decorator: _Decorator = njit(fastmath=set(liberties), **how)
    return decorator
