"""`batch`: all pictures of a plan that are not there yet."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from openswim.arguments import takes
from openswim.batches import ensembles
from openswim.batches.plan import Plan, read_plan
from openswim.batches.records import Records
from openswim.batches.tasks import Task, check_any, part_of, tasks_of
from openswim.batches.working import Outcome
from openswim.progress import job
from openswim.system.side_by_side import jobs_of


@dataclass(frozen=True)
class Report:
    """What became of a batch: tasks that were made now, that stood already, and that failed, with their reasons."""

    made: tuple[Outcome, ...]
    standing: int
    failed: tuple[Outcome, ...]


@dataclass(frozen=True)
class Work:
    """A plan's tasks: all of them, the share of this machine, and those of it whose pictures do not all stand yet; and
    the files that cannot be read, and the runs that these are of."""

    plan: Plan
    tasks: tuple[Task, ...]
    mine: tuple[Task, ...]
    waiting: tuple[Task, ...]
    unreadable: tuple[Outcome, ...] = ()
    incomplete: frozenset[str] = frozenset()

    @classmethod
    def of(
        cls, plan: Plan, part: tuple[int, int] | None = None, unreadable: dict[Path, str] | None = None
    ) -> Work:
        """What there is to do; nothing is written. unreadable: of a watched folder, where there may be nothing to do as
        yet; gets the files that cannot be read, and why."""
        watched, unreadable = unreadable is not None, {} if unreadable is None else unreadable
        tasks = tasks_of(plan, unreadable)
        if not watched:
            check_any(plan, tasks, unreadable)
        mine = tasks if part is None else part_of(tasks, part)
        records = Records(plan.folder)
        waiting = [task for task in mine if records.missing(task, plan.cameras)]
        bad = tuple(Outcome(path.name, failure=why) for path, why in unreadable.items())
        incomplete = frozenset(run.name for run in plan.weathers if not unreadable.keys().isdisjoint(run.files))
        return cls(plan, tuple(tasks), tuple(mine), tuple(waiting), bad, incomplete)

    def run(
        self, jobs: int | None = None, threads: int = 1, scheduler: str | None = None,
        tell: Callable[[Outcome], None] = lambda outcome: None,
    ) -> Report:  # fmt: skip
        """Do it: see `batch`."""
        count = jobs_of(jobs, threads)
        records = Records(self.plan.folder)
        records.prepare(self.mine)
        found: list[Outcome] = []
        with job("batch", len(self.waiting)) as meter:
            for outcome in _outcomes(self.plan, self.waiting, count, threads, scheduler):
                found.append(outcome)
                tell(outcome)
                meter.advance()
        for outcome in ensembles.outcomes(self.plan, self.tasks, self.incomplete):
            found.append(outcome)
            tell(outcome)
        records.write_manifest(self.tasks, self.plan.cameras)
        return Report(
            tuple(one for one in found if not one.failure), len(self.mine) - len(self.waiting),
            (*self.unreadable, *(one for one in found if one.failure)),
        )  # fmt: skip


@takes
def batch(
    plan: Plan | str | os.PathLike[str], *, jobs: int | None = None, threads: int = 1, scheduler: str | None = None,
    part: tuple[int, int] | None = None, tell: Callable[[Outcome], None] = lambda outcome: None,
) -> Report:  # fmt: skip
    """Make all pictures of a plan that do not stand yet, made alike, in its folder.

    plan : a `Plan`, or the name of its TOML file. jobs : processes side by side (default: one a core and so many
    threads); fewer where memory holds no more. threads : of each. scheduler : address of a Dask scheduler, whose
    workers do it. part : (which, of how many): the share of one of several machines. tell : is called after each task.

    What is done is kept: stopped at any moment, the same call goes on, and makes at most one task a process anew. Call
    it under ``if __name__ == "__main__":`` in a script, since the processes import that.
    """
    return Work.of(plan if isinstance(plan, Plan) else read_plan(plan), part).run(jobs, threads, scheduler, tell)


def _outcomes(
    plan: Plan, tasks: Sequence[Task], jobs: int, threads: int, scheduler: str | None
) -> Iterator[Outcome]:
    if scheduler is not None:
        from openswim.batches import cluster

        return cluster.outcomes(plan, tasks, scheduler, threads)
    from openswim.batches import processes

    return processes.outcomes(plan, tasks, min(jobs, max(1, len(tasks))), threads)
