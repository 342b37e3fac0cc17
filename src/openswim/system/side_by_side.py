"""Work by several processes of one machine. What they share is sent once, and they hand back little.

The first task is done alone. It compiles what kernels are not compiled yet, so that this is done once, and the memory
that it took says how many may work side by side.
"""

from __future__ import annotations

import multiprocessing
import os
import signal
import sys
import threading
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from contextlib import suppress
from multiprocessing.connection import wait as wait_for
from typing import Any, Protocol, TypeVar

from openswim.arguments import whole
from openswim.errors import UserError
from openswim.system.machine import cores, free_memory
from openswim.system.workshops import abandon

SURE = 0.8  # of the free memory
MOST_JOBS = 1024
KILLED = "its process was killed, as where memory runs out: use smaller pictures or a smaller domain"
_NONE_LIVES = (
    "the processes that should work are killed, or end as they begin: use smaller pictures or a smaller domain where "
    'memory runs out; in a script of yours, call this under: if __name__ == "__main__":'
)


class Outcome(Protocol):
    """What comes of a task; peak_bytes: the most memory that its process has held."""

    @property
    def peak_bytes(self) -> float: ...


Order = TypeVar("Order")
Task = TypeVar("Task")
Result = TypeVar("Result", bound=Outcome)

_order: Any = None  # of a worker: what all its tasks share


def outcomes(
    work: Callable[[Order, Task], Result], order: Order, tasks: Sequence[Task], jobs: int,
    killed: Callable[[Task], Result],
) -> Iterator[Result]:  # fmt: skip
    """Do tasks by at most ``jobs`` processes at a time, as many as memory holds; in the order in which they end.

    work : a function of a module, of what all tasks share and a task; it never raises what a task can be blamed for.
    killed : what comes of a task whose process was killed when it was tried again alone.
    """
    waiting, alone, ended_well = deque(tasks), deque[Task](), False
    running: dict[Future[Result], Task] = {}
    side_by_side, pool = 1, _pool(order, jobs)
    try:
        while waiting or alone or running:
            lost, lonely = [], bool(alone)
            while (alone or waiting) and len(running) < (1 if lonely else side_by_side):
                task = alone[0] if lonely else waiting[0]
                try:
                    running[pool.submit(_work, work, task)] = task
                except BrokenProcessPool:  # by a death between two tasks, of which none is to blame
                    pool.shutdown(wait=True)
                    pool = _pool(order, jobs)
                    continue
                (alone if lonely else waiting).popleft()
            ended, _ = wait(running, return_when=FIRST_COMPLETED)
            for future in ended:
                task = running.pop(future)
                try:
                    outcome = future.result()
                except BrokenProcessPool:
                    lost.append(task)
                    continue
                ended_well = True
                side_by_side = fitting(jobs, len(running) + 1, outcome.peak_bytes)
                yield outcome
            if lost and lonely and not ended_well:
                raise UserError(_NONE_LIVES)
            if lost and lonely:
                yield killed(lost[0])
            elif lost:
                alone.extend([*lost, *running.values()])
                running.clear()
        pool.shutdown(wait=True)  # workers that end by themselves give back what libraries have of the system
    finally:
        _end(pool)


def jobs_of(jobs: int | None, threads: int = 1) -> int:
    """How many processes: one a core and so many threads, unless it is said."""
    if not 1 <= whole("threads", threads) <= MOST_JOBS:
        raise UserError(f"threads {threads}: give 1 to {MOST_JOBS}")
    if jobs is None:
        return max(1, cores() // threads)
    if not 1 <= whole("jobs", jobs) <= MOST_JOBS:
        raise UserError(f"jobs {jobs}: give 1 to {MOST_JOBS}")
    return jobs


def fitting(jobs: int, there: int, peak_bytes: float) -> int:
    """How many of the jobs that are wanted the memory holds, where so many are there already and each takes so much."""
    return max(1, int(min(jobs, there + SURE * free_memory() / max(peak_bytes, 1.0))))


def peak_bytes() -> float:
    """The most memory that this process has held; 0 where the system does not tell."""
    try:
        import resource
    except ImportError:
        return 0.0
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return float(peak if sys.platform == "darwin" else 1024 * peak)


def _pool(order: Any, jobs: int) -> ProcessPoolExecutor:
    context = multiprocessing.get_context("spawn")
    return ProcessPoolExecutor(jobs, context, _begin, (order,))


def _begin(order: Any) -> None:
    """A worker sets out: Ctrl-C is its parent's to hear, and it does not outlive that."""
    global _order
    _order = order
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    parent = multiprocessing.parent_process()
    if parent is not None:
        threading.Thread(target=_follow, args=(parent.sentinel,), daemon=True).start()


def _follow(parent: int) -> None:
    wait_for([parent])
    abandon()
    os._exit(1)


def _work(work: Callable[[Order, Task], Result], task: Task) -> Result:
    return work(_order, task)


def _end(pool: ProcessPoolExecutor) -> None:
    """Without waiting for what is still at work, as after Ctrl-C."""
    workers = list((getattr(pool, "_processes", None) or {}).values())
    pool.shutdown(wait=False, cancel_futures=True)
    for worker in workers:
        with suppress(OSError, ValueError):
            worker.terminate()
