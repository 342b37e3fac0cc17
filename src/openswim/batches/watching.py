"""A folder watched: what arrives is rendered, shown on a page, and kept up to a bound."""

from __future__ import annotations

import os
import time as clock
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from pathlib import Path

from openswim.batches.arrivals import Arrival, Arrivals
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

    The pictures of the newest ``keep`` times stay, those of files that are gone included; older ones are
    neither made nor kept. Whatever stops it, the next call goes on from the records on disk.
    """
    if keep < 1:
        raise UserError(f"--keep {keep}: give 1 time or more")
    check_index(plan.folder)
    watched = arrivals.names.folder
    inside = _within(plan.folder, watched)
    if inside and _within(watched, plan.folder):
        raise UserError(f"--watch {watched}: is where pictures are written: choose another folder with -o")
    seen = _Seen()
    before: list[Arrival] | None = None
    look = 0
    while looks is None or look < looks:
        if look:
            clock.sleep(every_s)
        look += 1
        now = [each for each in arrivals.whole() if not (inside and _within(each[0], plan.folder))]
        if now == before:
            continue
        before = now
        seen.forget_all_but(set(now))
        if files := [each for each in now if each not in seen.unreadable and each not in seen.old]:
            _cycle(plan, files, keep, seen, jobs, threads, scheduler, tell)
        write_index(plan, Records(plan.folder).standing(), seen.why_not())


@dataclass
class _Seen:
    """What is known of files that have arrived, and is not looked at again until they change."""

    unreadable: dict[Arrival, str] = field(default_factory=dict)
    old: set[Arrival] = field(default_factory=set)  # of times that are too old to stay
    failed: dict[str, tuple[str, str]] = field(default_factory=dict)  # of tasks: name, fingerprint and reason

    def forget_all_but(self, now: set[Arrival]) -> None:
        self.unreadable = {each: why for each, why in self.unreadable.items() if each in now}
        self.old &= now

    def why_not(self) -> dict[str, str]:
        """Reasons of what failed, by the names of files and tasks."""
        return {path.name: why for (path, *_), why in self.unreadable.items()} | {
            name: why for name, (_, why) in self.failed.items()
        }


def _cycle(
    plan: Plan, arrived: list[Arrival], keep: int, seen: _Seen, jobs: int | None, threads: int, scheduler: str | None,
    tell: Callable[[Outcome], None],
) -> None:  # fmt: skip
    """Make what is new and among the newest, and remove what is older."""
    records = Records(plan.folder)
    by_file = {str(each[0].absolute()): each for each in arrived}
    here = replace(plan, weathers=(replace(plan.weathers[0], files=tuple(path for path, *_ in arrived)),))
    unreadable: dict[Path, str] = {}
    try:
        every = Work.of(here, unreadable=unreadable)
    except UserError as error:  # not one of them can be read
        unreadable = unreadable or {arrived[-1][0]: str(error)}
    else:
        work = newest(every, records.standing(), keep)
        now = {task.name: task.mark for task in work.waiting}
        seen.failed = {name: one for name, one in seen.failed.items() if name in now}
        again = tuple(task for task in work.waiting if task.mark != seen.failed.get(task.name, ("", ""))[0])
        report = replace(work, waiting=again, unreadable=()).run(jobs, threads, scheduler, tell)
        for one in report.made:
            seen.failed.pop(one.task, None)
        seen.failed |= {one.task: (now.get(one.task, ""), one.failure) for one in report.failed}
        wanted = {file for task in work.tasks for file in task.files}
        seen.old |= {each for file, each in by_file.items() if file not in wanted and each[0] not in unreadable}
    for path, why in unreadable.items():
        seen.unreadable[by_file[str(path.absolute())]] = why
        tell(Outcome(path.name, failure=why))
    for record in older(records.standing(), keep):
        records.remove(record)


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
