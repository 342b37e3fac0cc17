"""What a scene may hold and is read only where somebody asks for it, since it takes memory and time."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar

_winds: ContextVar[bool] = ContextVar("openswim_winds", default=False)


@contextmanager
def winds_asked(asked: bool) -> Iterator[None]:
    """Within the block readers give the wind on levels as well, or do not."""
    token = _winds.set(asked)
    try:
        yield
    finally:
        _winds.reset(token)


def winds_wanted() -> bool:
    return _winds.get()
