"""Batches whose tasks are done in the test's own process."""

from collections.abc import Iterator, Sequence

from openswim.batches import Plan, Work
from openswim.batches.records import Records
from openswim.batches.tasks import Task
from openswim.batches.working import Outcome, do


def outcomes(plan: Plan, tasks: Sequence[Task], jobs: int, threads: int = 1) -> Iterator[Outcome]:
    """In place of `openswim.batches.processes.outcomes`."""
    return (do(plan, task, threads) for task in tasks)


def done(work: Work) -> list[Outcome]:
    """What waits of a plan, done without anything around it."""
    Records(work.plan.folder).prepare(work.mine)
    return [do(work.plan, task) for task in work.waiting]
