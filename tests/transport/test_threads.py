"""Every thread gets its share, once; errors come through; a forked process has threads of its own."""

from __future__ import annotations

import os
import subprocess
import sys
import threading
import time

import numba
import pytest

from openswim.transport.engine.threads import in_threads

FORKED = """
import os, warnings
from numba import set_num_threads
from openswim.transport.engine.threads import in_threads
warnings.simplefilter("ignore", DeprecationWarning)
seen = []
in_threads(lambda t, threads: seen.append(t))
pid = os.fork()
if pid == 0:
    in_threads(lambda t, threads: seen.append(t))
    os._exit(len(seen))
print(len(seen), os.waitstatus_to_exitcode(os.waitpid(pid, 0)[1]))
"""


def test_shares_are_handed_out_once() -> None:
    seen, threads = [], numba.get_num_threads()
    in_threads(lambda *share: seen.append(share), "x")
    assert sorted(seen) == [(t, threads, "x") for t in range(threads)]


def test_as_many_as_numba_is_told() -> None:
    seen, threads = [], numba.get_num_threads()
    try:
        numba.set_num_threads(1)
        in_threads(lambda *share: seen.append((*share, threading.current_thread().name)))
    finally:
        numba.set_num_threads(threads)
    assert seen == [(0, 1, threading.current_thread().name)]


def test_parts_are_done_once_by_whoever_is_free() -> None:
    seen = []
    in_threads(lambda *part: seen.append(part), parts=57)
    assert sorted(seen) == [(n, 57) for n in range(57)]
    few = []
    in_threads(lambda *part: few.append(part), parts=1)  # never fewer than threads
    assert len(few) == numba.get_num_threads()


def test_after_an_interrupt_no_part_is_begun() -> None:
    """It comes to the main thread, between parts; the other threads end theirs and leave the rest."""
    main, begun = threading.current_thread(), []

    def kernel(part: int, parts: int) -> None:
        begun.append(part)
        if threading.current_thread() is main:
            raise KeyboardInterrupt
        time.sleep(0.01)

    with pytest.raises(KeyboardInterrupt):
        in_threads(kernel, parts=1000)
    assert len(begun) < 100


def test_what_a_share_hands_out_it_does_itself() -> None:
    seen, threads = [], numba.get_num_threads()

    def inner(t: int, threads: int, outer: int) -> None:
        seen.append((outer, t, threading.current_thread()))

    def share(t: int, threads: int) -> None:
        in_threads(inner, t)
        assert {who for outer, _, who in seen if outer == t} == {threading.current_thread()}

    in_threads(share)
    assert sorted(pair[:2] for pair in seen) == [(a, b) for a in range(threads) for b in range(threads)]
    in_threads(lambda t, threads: seen.append((threads, t, threading.current_thread())))  # and then hands out again
    assert len(seen) == threads * (threads + 1)


@pytest.mark.parametrize("which", [0, -1])
def test_errors_come_through(which: int) -> None:
    last = (numba.get_num_threads() + which) % numba.get_num_threads()

    def fails(t: int, threads: int) -> None:
        if t == last:
            raise ZeroDivisionError

    with pytest.raises(ZeroDivisionError):
        in_threads(fails)


@pytest.mark.skipif(not hasattr(os, "fork"), reason="needs fork")
def test_a_forked_process_does_not_wait_for_its_parents_threads() -> None:
    done = subprocess.run([sys.executable, "-c", FORKED], capture_output=True, text=True, timeout=60, check=True)
    before, after = map(int, done.stdout.split())
    assert after == 2 * before
