"""Ctrl-C ends the command line within two seconds, also where Python does not get to hear of it.

Python tells its main thread of a signal between two of its own steps. While Numba compiles or HDF5 reads that may take
minutes. So the system also writes a byte into a pipe, at which another thread waits; where nothing has come of the
signal after a while, it ends the process.
"""

from __future__ import annotations

import os
import signal
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from types import FrameType

from openswim.system.workshops import abandon

_PATIENCE_S = 1.4
INTERRUPTED = 130


class _Watch:
    def __init__(self) -> None:
        self.heard = 0  # of the signals, how many the main thread has been told of
        self.claimed = False  # it goes on to save what it has
        self.over = False


_watch = _Watch()


def claim() -> None:
    """Say that an interrupt has been taken for the wish to end with what there is, which may take a while."""
    _watch.claimed = True


@contextmanager
def watched() -> Iterator[None]:
    """Within the block of the main thread a Ctrl-C ends the process soon, one way or the other."""
    global _watch
    if threading.current_thread() is not threading.main_thread() or signal.getsignal(signal.SIGINT) is not _DEFAULT:
        yield
        return
    _watch = watch = _Watch()
    reader, writer = os.pipe()
    os.set_blocking(writer, False)
    before = signal.set_wakeup_fd(writer, warn_on_full_buffer=False)
    signal.signal(signal.SIGINT, _told)
    threading.Thread(target=_wait, args=(reader, watch), daemon=True, name="openswim-interrupts").start()
    try:
        yield
    finally:
        watch.over = True
        signal.signal(signal.SIGINT, _DEFAULT)
        signal.set_wakeup_fd(before)
        os.close(writer)  # which ends the thread


_DEFAULT = signal.default_int_handler


def _told(number: int, frame: FrameType | None) -> None:
    _watch.heard += 1
    raise KeyboardInterrupt


def _wait(reader: int, watch: _Watch) -> None:
    seen = 0
    with suppress(OSError):
        while data := os.read(reader, 64):
            seen += data.count(signal.SIGINT)
            if signal.SIGINT not in data:
                continue
            until = time.monotonic() + _PATIENCE_S
            while time.monotonic() < until and not watch.over:
                time.sleep(0.02)
            if not watch.over and not (watch.claimed and watch.heard >= seen and seen == 1):
                _end()
    os.close(reader)


def _end() -> None:
    abandon()
    with suppress(OSError, ValueError):
        os.write(sys.stderr.fileno(), b"\nopenswim: interrupted\n")
    os._exit(INTERRUPTED)
