"""Progress of long jobs: a one-line bar on stderr that appears only when a job lasts over two seconds.

    for tile in track(tiles, "view"):
        ...

The bar is a swappable object: `with use(Quiet()): ...` silences every job inside, and anything with the three
methods of `Meter` can take its place. It is drawn with carriage returns alone, which terminals and notebooks
both understand.
"""

import sys
import time
from collections.abc import Iterable, Iterator, Sized
from contextlib import contextmanager
from contextvars import ContextVar
from typing import Protocol, TextIO, TypeVar

from openswim.switches import switched

Item = TypeVar("Item")

PATIENCE_S = 2.0
_REDRAW_S = 0.1
_BAR_WIDTH = 30


class Meter(Protocol):
    """Shows how far a job is. `start` and `close` come once each; `advance` as often as steps are done."""

    def start(self, label: str, total: float | None) -> None: ...

    def advance(self, steps: float = 1) -> None: ...

    def close(self) -> None: ...


class Quiet:
    """A meter that shows nothing."""

    def start(self, label: str, total: float | None) -> None: ...

    def advance(self, steps: float = 1) -> None: ...

    def close(self) -> None: ...


class Bar:
    """A text bar with per cent and time left; silent for the first `patience_s` seconds."""

    def __init__(self, stream: TextIO | None = None, patience_s: float = PATIENCE_S) -> None:
        self.stream = stream
        self.patience_s = patience_s
        self._shown_width = 0

    def start(self, label: str, total: float | None) -> None:
        self.label, self.total, self.done = label, total, 0.0
        self._start = time.monotonic()
        self._next_draw = self._start + self.patience_s
        self._shown_width = 0

    def advance(self, steps: float = 1) -> None:
        self.done += steps
        now = time.monotonic()
        if now >= self._next_draw:
            self._next_draw = now + _REDRAW_S
            self._draw(self._line(now - self._start))

    def close(self) -> None:
        if self._shown_width:
            self._draw("")
            self._write("\r")
            self._shown_width = 0

    def _line(self, elapsed_s: float) -> str:
        if not self.total:
            return f"{self.label}: {self.done:g} done, {elapsed_s:.0f} s"
        part = min(self.done / self.total, 1.0)
        left_s = elapsed_s * (1 - part) / part if part > 0 else float("inf")
        filled = round(part * _BAR_WIDTH)
        bar = "#" * filled + "-" * (_BAR_WIDTH - filled)
        return f"{self.label} [{bar}] {100 * part:3.0f} %, {left_s:.0f} s left"

    def _draw(self, line: str) -> None:
        self._write("\r" + line.ljust(self._shown_width))
        self._shown_width = len(line)

    def _write(self, text: str) -> None:
        # Looked up late: notebooks and test runners replace sys.stderr.
        stream = self.stream or sys.stderr
        stream.write(text)
        stream.flush()


_meter: ContextVar[Meter | None] = ContextVar("openswim_progress", default=None)


@contextmanager
def use(meter: Meter) -> Iterator[None]:
    """Within the block every job reports to `meter` instead of the default bar."""
    token = _meter.set(meter)
    try:
        yield
    finally:
        _meter.reset(token)


@contextmanager
def job(label: str, total: float | None = None) -> Iterator[Meter]:
    """One job of `total` steps; call `.advance(n)` on what this yields."""
    meter = _meter.get() or (Bar() if _someone_watches() else Quiet())
    meter.start(label, total)
    try:
        yield meter
    finally:
        meter.close()


def relabel(meter: Meter, label: str) -> None:
    """Show what a running job has come to; meters without a label stay as they are."""
    if isinstance(meter, Bar):
        meter.label = label


def track(items: Iterable[Item], label: str, total: float | None = None) -> Iterator[Item]:
    """Yield `items`, one step each. `total` is taken from `len(items)` where it has one."""
    if total is None and isinstance(items, Sized):
        total = len(items)
    with job(label, total) as meter:
        for item in items:
            yield item
            meter.advance()


_spoken = False  # whether the command line runs, which tells what it does


@contextmanager
def spoken() -> Iterator[None]:
    """Within the block what is told is written, whether someone watches or not."""
    global _spoken
    before, _spoken = _spoken, True
    try:
        yield
    finally:
        _spoken = before


def tell(line: str) -> None:
    """A line on stderr for the command line, a terminal or a notebook; silent elsewhere. Any thread may call it."""
    if _spoken or _someone_watches():
        print(line, file=sys.stderr, flush=True)


def _someone_watches() -> bool:
    """A terminal, a notebook, or OPENSWIM_PROGRESS=1 (0: never)."""
    forced = switched("OPENSWIM_PROGRESS")
    if forced is not None:
        return forced
    if sys.stderr is None:  # closed
        return False
    return sys.stderr.isatty() or "ipykernel" in sys.modules
