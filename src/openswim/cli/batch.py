"""`openswim batch`: the pictures of many files, times, members and cameras."""

import re
import time as clock
from dataclasses import dataclass, replace
from itertools import product
from pathlib import Path
from typing import TYPE_CHECKING

import click

from openswim.errors import UserError, one_line

if TYPE_CHECKING:
    from openswim.batches import Report, Work
    from openswim.cameras import Camera
    from openswim.cli.estimate import Estimate
    from openswim.scene import Scene

_TOLD = 20  # failures that are listed
_TRIED = 3  # tasks that are looked at for an estimate


@dataclass(frozen=True)
class BatchRequest:
    """The options of `openswim batch`; None: not given."""

    plan: Path
    files: tuple[Path, ...] = ()
    output: Path | None = None
    jobs: int | None = None
    threads: int = 1
    scheduler: str | None = None
    part: str | None = None
    dry_run: bool = False
    watch: Path | None = None
    keep: int | None = None
    allow_references: bool = False


class TasksFailed(Exception):
    """Some tasks failed by a fault of ours."""


def run(request: BatchRequest) -> None:
    """Check the request, say what it will take, make the pictures, and list what failed."""
    from openswim.batches import Work, read_plan
    from openswim.batches.plan import ENSEMBLE
    from openswim.readers import files_of
    from openswim.system.side_by_side import jobs_of

    jobs = jobs_of(request.jobs, request.threads)
    if request.watch is not None:
        _watch(request, request.watch, jobs)
        return
    if request.keep is not None:
        raise UserError("--keep belongs to --watch")
    files = files_of(request.files) if request.files else []
    plan = read_plan(request.plan, files, request.output, request.allow_references)
    part = None if request.part is None else part_of_text(request.part)
    work = Work.of(plan, part)
    _announce(work, jobs, request)
    if request.dry_run:
        _tell_cameras(work)
        return
    start = clock.perf_counter()
    report = work.run(jobs, request.threads, request.scheduler)
    seconds = clock.perf_counter() - start
    ensembles = sum(one.task.startswith(f"{ENSEMBLE}/") for one in report.made)
    joined = f", {ensembles} ensemble{'s' * (ensembles > 1)} put together" if ensembles else ""
    failed = f"{len(report.failed)} failed{_in_part(report, len(plan.cameras))}"
    made = f"{len(report.made) - ensembles} made, {report.standing} stood already"
    click.echo(f"{plan.folder}: {made}, {failed}{joined}, {seconds:.0f} s")
    tell_failed(report)


def _in_part(report: "Report", cameras: int) -> str:
    """What was made all the same of times that failed."""
    made = [one.made for one in report.failed if one.made]
    if not made:
        return ""
    return f" ({len(made)} of them in part: {sum(made)} of {cameras * len(made)} cameras' pictures made)"


def _watch(request: BatchRequest, folder: Path, jobs: int) -> None:
    from openswim.batches import read_plan
    from openswim.batches.arrivals import Arrivals
    from openswim.batches.watching import KEEP, watch
    from openswim.batches.working import Outcome

    if request.part is not None or request.dry_run:
        raise UserError("--watch has neither --part nor --dry-run")
    if not folder.is_dir():
        raise UserError(f"--watch {folder}: no such folder")
    plan = read_plan(request.plan, (), request.output, request.allow_references, watched=True)
    patterns = [str(each) for each in request.files] or plan.patterns

    def tell(outcome: Outcome) -> None:
        failed = bool(outcome.failure)
        click.echo(UserError(f"failed: {outcome.told}") if failed else
                   f"{outcome.task}: {outcome.seconds:.0f} s", err=failed)  # fmt: skip

    click.echo(f"watching {folder}, page {plan.folder / 'index.html'}; Ctrl-C ends", err=True)
    watch(
        plan, Arrivals(folder, patterns, request.allow_references), jobs=jobs, threads=request.threads,
        keep=KEEP if request.keep is None else request.keep, scheduler=request.scheduler, tell=tell,
    )  # fmt: skip


def part_of_text(text: str) -> tuple[int, int]:
    """ "3/16" as (3, 16)."""
    match = re.fullmatch(r"\s*(\d{1,6})/(\d{1,6})\s*", text)
    if match is None or not 1 <= int(match[1]) <= int(match[2]):
        raise UserError(f"--part {text}: write WHICH/HOW_MANY, such as 3/16")
    return int(match[1]), int(match[2])


def tell_failed(report: "Report") -> None:
    """List what failed, and raise for it: the user's mistake or a bad file, or a fault of ours."""
    for one in report.failed[:_TOLD]:
        click.echo(one_line(f"failed: {one.told}"), err=True)
    if len(report.failed) > _TOLD:
        click.echo(f"failed: ... and {len(report.failed) - _TOLD} more", err=True)
    if report.failed:
        kind = TasksFailed if any(one.fault for one in report.failed) else UserError
        raise kind(f"{len(report.failed)} failed: mend what is said above, and give the same command again: what is "
                   "done is kept")  # fmt: skip


def _announce(work: "Work", jobs: int, request: BatchRequest) -> None:
    """Say what there is to do and what it will take; refuse what memory does not hold."""
    from openswim.batches.records import Records

    plan, waiting = work.plan, len(work.waiting)
    records = Records(plan.folder)
    pictures = sum(len(each.suffixes) for task in work.waiting for each in records.missing(task, plan.cameras))
    told = f"{len(work.mine)} times and members, {len(work.mine) - waiting} of them done"
    if not waiting:
        click.echo(f"{told}; nothing is left to render", err=True)
        return
    one = _of_a_task(work)
    if isinstance(one, str):
        why = f"what they take is not told, since the first of them fail: {one}"
        click.echo(f"{told}; {pictures} files; {why}", err=True)
        return
    if request.scheduler is not None:
        click.echo(f"{told}; {pictures} files by {request.scheduler}; one of them: {one}", err=True)
        return
    from openswim.system.machine import cores, free_memory
    from openswim.system.side_by_side import SURE

    free = free_memory()
    if one.memory_bytes > free:
        raise UserError(f"a time of this plan takes about {one.memory_bytes / 1e9:.1f} GB of memory, and "
                        f"{free / 1e9:.1f} GB are free: use smaller pictures or a smaller domain")  # fmt: skip
    workers = max(1, int(min(jobs, waiting, SURE * free / one.memory_bytes)))
    busy = min(workers * request.threads, cores())
    seconds = 2 * one.seconds * waiting / busy  # the estimate is for two cores
    whole = type(one)(seconds, workers * one.memory_bytes)
    fewer = f" (memory holds no more than {workers})" if workers < min(jobs, waiting) else ""
    by = f"{workers} process{'es' * (workers > 1)} of {request.threads} thread{'s' * (request.threads > 1)}{fewer}"
    click.echo(f"{told}; {pictures} files by {by}; {whole}", err=True)


def _of_a_task(work: "Work") -> "Estimate | str":
    """What one solve with all its cameras takes; where the first few cannot be opened for any camera, why."""
    from openswim.batches.working import scene_of
    from openswim.pictures.observer import check_observer

    why = ""
    for task, each in product(work.waiting[:_TRIED], work.plan.cameras):
        try:
            scene = scene_of(work.plan, task, each)
            check_observer(scene, each.camera, work.plan.solver.name)
            return _of_scene(work, scene)
        except UserError as fault:  # it will be listed with those that failed
            why = why or str(fault)
    return why


def _tell_cameras(work: "Work") -> None:
    """Which cameras will fail at the first time that is left, as where they stand outside of the domain."""
    from openswim.batches.working import scene_of
    from openswim.pictures.observer import check_observer

    for task, each in product(work.waiting[:1], work.plan.cameras):
        try:
            check_observer(scene_of(work.plan, task, each), each.camera, work.plan.solver.name)
        except UserError as fault:
            click.echo(one_line(f"note: camera {each.name} will fail: {fault}"), err=True)


def _of_scene(work: "Work", scene: "Scene") -> "Estimate":
    from openswim.cli.estimate import Estimate, estimate
    from openswim.lighting import lights_of, sun_altitude_deg

    plan = work.plan
    lights = lights_of(scene, plan.solver.name, plan.wavelengths_nm, **plan.sun_options)
    sun_deg = sun_altitude_deg(scene, **plan.sun_options)

    def of(camera: "Camera") -> Estimate:
        solver = plan.solver
        return estimate(
            scene, camera, solver.name, plan.wavelengths_nm, quality=solver.quality, lights=lights, sun_deg=sun_deg
        )

    found = [of(each.camera) for each in plan.cameras]
    point = replace(plan.cameras[0].camera, view="perspective", shape=(1, 1), fov_deg=1.0, lens_optics=None, given=None,
                    mask=None)  # fmt: skip
    solve = of(point).seconds
    return Estimate(solve + sum(one.seconds - solve for one in found), max(one.memory_bytes for one in found))
