"""Threads share a kernel's work: one call each of a compiled function that lets go of the interpreter's lock.

Numba's own parallel loops would compile what stands in them twice more, and optimise all it calls anew.
"""

from __future__ import annotations

import os
import threading
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from functools import cache

from numba import get_num_threads

_here = threading.local()  # ``shared``: whether this thread is at a share now


def in_threads(kernel: Callable[..., None], *args: object) -> None:
    """kernel(t, threads, *args) for t = 0 to threads - 1 side by side; ``threads`` as `numba.set_num_threads` says.

    Called by what is itself a share, one after the other: threads that wait for each other's would wait for ever.
    """
    threads = get_num_threads()
    if getattr(_here, "shared", False):
        for t in range(threads):
            kernel(t, threads, *args)
        return
    others = [_pool().submit(_share, kernel, t, threads, *args) for t in range(1, threads)]
    try:
        _share(kernel, 0, threads, *args)
    finally:
        for other in others:
            other.result()


def _share(kernel: Callable[..., None], *args: object) -> None:
    _here.shared = True
    try:
        kernel(*args)
    finally:
        _here.shared = False


@cache
def _pool() -> ThreadPoolExecutor:
    return ThreadPoolExecutor(os.cpu_count() or 1, "openswim")


if hasattr(os, "register_at_fork"):  # a forked process has none of its parent's threads
    os.register_at_fork(after_in_child=_pool.cache_clear)
