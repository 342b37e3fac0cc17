"""A plan's tasks by several processes of one machine. No field of light crosses from one to another: they hand back
one line."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from openswim.batches.plan import Plan
from openswim.batches.tasks import Task
from openswim.batches.working import Outcome, do
from openswim.system import side_by_side


def outcomes(plan: Plan, tasks: Sequence[Task], jobs: int, threads: int = 1) -> Iterator[Outcome]:
    """Do tasks by at most ``jobs`` processes at a time, as many as memory holds; in the order in which they end."""
    return side_by_side.outcomes(_work, (plan, threads), tasks, jobs, _killed)


def _work(order: tuple[Plan, int], task: Task) -> Outcome:
    plan, threads = order
    return do(plan, task, threads)


def _killed(task: Task) -> Outcome:
    return Outcome(task.name, failure=side_by_side.KILLED)
