"""A folder watched: what arrives is rendered, shown on a page, and kept up to a bound."""

from __future__ import annotations

import os
import time as clock
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

from openswim.batches.arrivals import Arrivals
from openswim.batches.index_page import check_index, write_index
from openswim.batches.making import Work
from openswim.batches.plan import Plan
from openswim.batches.records import Record, Records
from openswim.batches.tasks import Task
from openswim.batches.working import Outcome
from openswim.errors import UserError

KEEP = 288  # times: a day of one every five minutes
EVERY_S = 10.0  # from look to look


def watch(
    plan: Plan, arrivals: Arrivals, *, keep: int = KEEP, jobs: int | None = None, threads: int = 1,
    scheduler: str | None = None, every_s: float = EVERY_S, looks: int | None = None,
    tell: Callable[[Outcome], None] = lambda outcome: None,
) -> None:  # fmt: skip
    """Render what arrives until Ctrl-C (or for so many ``looks``).

    Of each run the pictures of the newest ``keep`` times stay, those of files that are gone included; older ones are
    neither made nor kept. Whatever stops it, the next call goes on from the records on disk.
    """
    if keep < 1:
        raise UserError(f"--keep {keep}: give 1 time or more")
    check_index(plan.folder)
    watched = arrivals.names.folder
    inside = _within(plan.folder, watched)
    if inside and _within(watched, plan.folder):
        raise UserError(f"--watch {watched}: is where pictures are written: choose another folder with -o")
    tried: set[str] = set()  # marks of tasks that failed: they are tried again when their files change
    failures: dict[str, str] = {}
    before: list[tuple[Path, int, int]] | None = None
    look = 0
    while looks is None or look < looks:
        if look:
            clock.sleep(every_s)
        look += 1
        now = [each for each in arrivals.whole() if not (inside and _within(each[0], plan.folder))]
        if now == before:
            continue
        before = now
        if files := [path for path, *_ in now]:
            failures = _cycle(plan, files, keep, tried, failures, jobs, threads, scheduler, tell)
        write_index(plan, Records(plan.folder).standing(), failures)


def _cycle(
    plan: Plan, files: list[Path], keep: int, tried: set[str], failures: dict[str, str], jobs: int | None, threads: int,
    scheduler: str | None, tell: Callable[[Outcome], None],
) -> dict[str, str]:  # fmt: skip
    """Make what is new and among the newest, and remove what is older; returns the failures that stand."""
    records = Records(plan.folder)
    here = replace(plan, weathers=(replace(plan.weathers[0], files=tuple(files)),))
    try:
        work = newest(Work.of(here), records.standing(), keep)
    except UserError as error:  # not one of them can be read
        unreadable, ended, stand = [Outcome(files[-1].name, failure=str(error))], [], dict(failures)
    else:
        known = {task.name: task.mark for task in work.waiting}
        stand = {name: why for name, why in failures.items() if name in known}
        again = tuple(task for task in work.waiting if task.mark not in tried)
        report = replace(work, waiting=again, unreadable=()).run(jobs, threads, scheduler, tell)
        unreadable, ended = list(work.unreadable), [*report.made, *report.failed]
        tried |= {known[one.task] for one in report.failed if one.task in known}
    for one in unreadable:
        if one.failure != failures.get(one.task):
            tell(one)
    for one in [*unreadable, *ended]:
        stand.pop(one.task, None)
        if one.failure:
            stand[one.task] = one.failure
    for record in older(records.standing(), keep):
        records.remove(record)
    return stand


def _within(path: Path, folder: Path) -> bool:
    return Path(os.path.realpath(path)).is_relative_to(os.path.realpath(folder))


def newest(work: Work, standing: list[Record], keep: int) -> Work:
    """The work without times that are too old to stay."""
    times = sorted({str(task.time) for task in work.tasks} | {record.time for record in standing})[-keep:]

    def stays(task: Task) -> bool:
        return str(task.time) in times

    return replace(work, tasks=tuple(filter(stays, work.tasks)), mine=tuple(filter(stays, work.mine)),
                   waiting=tuple(filter(stays, work.waiting)))  # fmt: skip


def older(standing: list[Record], keep: int) -> list[Record]:
    """Records of all but the newest times."""
    times = sorted({record.time for record in standing})[-keep:]
    return [record for record in standing if record.time not in times]
