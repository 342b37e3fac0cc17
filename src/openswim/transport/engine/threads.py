"""Threads share a kernel's work: one call each of a compiled function that lets go of the interpreter's lock.

Numba's own parallel loops would compile what stands in them twice more, and optimise all it calls anew.
"""

from __future__ import annotations

import os
import threading
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from functools import cache

from numba import get_num_threads

_here = threading.local()  # ``shared``: whether this thread is at a share now


def in_threads(kernel: Callable[..., None], *args: object, parts: int = 0) -> None:
    """kernel(t, threads, *args) for t = 0 to threads - 1 side by side; ``threads`` as `numba.set_num_threads` says.

    parts: where the work is cut into more than threads, kernel(part, parts, *args), each done by the thread that is
    free first. Called by what is itself a share, one after the other: threads that wait for each other's would wait
    for ever.
    """
    threads = get_num_threads()
    parts = max(parts, threads)
    left = iter(range(parts))
    if getattr(_here, "shared", False):
        for part in left:
            kernel(part, parts, *args)
        return
    others = [_pool().submit(_share, left, kernel, parts, *args) for _ in range(1, threads)]
    try:
        _share(left, kernel, parts, *args)
    finally:
        for other in others:
            other.result()


def _share(left: Iterator[int], kernel: Callable[..., None], *args: object) -> None:
    """The parts that this thread comes to take."""
    _here.shared = True
    try:
        for part in left:
            kernel(part, *args)
    finally:
        _here.shared = False
        for _ in left:  # after an error or an interrupt no thread begins another
            pass


@cache
def _pool() -> ThreadPoolExecutor:
    return ThreadPoolExecutor(os.cpu_count() or 1, "openswim")


if hasattr(os, "register_at_fork"):  # a forked process has none of its parent's threads
    os.register_at_fork(after_in_child=_pool.cache_clear)
