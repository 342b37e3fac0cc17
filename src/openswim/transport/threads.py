"""Threads share a kernel's work: one call each of a compiled function that lets go of the interpreter's lock.

Numba's own parallel loops would compile what stands in them twice more, and optimise all it calls anew.
"""

from __future__ import annotations

import os
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from functools import cache

from numba import get_num_threads


def in_threads(kernel: Callable[..., None], *args: object) -> None:
    """kernel(t, threads, *args) for t = 0 to threads - 1 side by side; ``threads`` as `numba.set_num_threads` says."""
    threads = get_num_threads()
    others = [_pool().submit(kernel, t, threads, *args) for t in range(1, threads)]
    try:
        kernel(0, threads, *args)
    finally:
        for other in others:
            other.result()


@cache
def _pool() -> ThreadPoolExecutor:
    return ThreadPoolExecutor(os.cpu_count() or 1, "openswim")


if hasattr(os, "register_at_fork"):  # a forked process has none of its parent's threads
    os.register_at_fork(after_in_child=_pool.cache_clear)
