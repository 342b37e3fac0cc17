"""Tasks by the workers of a Dask cluster. They see the same files under the same names, and hand back one line each."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

from openswim.batches.plan import Plan
from openswim.batches.tasks import Task
from openswim.batches.working import Outcome, do
from openswim.errors import UserError

PATIENCE_S = 10


def outcomes(plan: Plan, tasks: Sequence[Task], scheduler: str, threads: int = 1) -> Iterator[Outcome]:
    """Do tasks by a scheduler's workers, in the order in which they end.

    A worker that is lost costs what it was working at: that is done again by another one; Dask gives a task up whose
    workers were lost a few times.
    """
    library = _library()
    try:
        client = library.Client(scheduler, timeout=PATIENCE_S, set_as_default=False)
    except (OSError, ValueError, TypeError) as error:
        raise UserError(
            f"--scheduler {scheduler}: no Dask scheduler answers there ({str(error)[:100]}): start one with dask "
            "scheduler, and give its address, such as tcp://10.0.0.5:8786"
        ) from None
    with client:
        order = client.scatter(plan, broadcast=True, hash=False)
        sent = {client.submit(do, order, task, threads, key=f"openswim-{n}-{task.mark[:12]}", pure=False): task
                for n, task in enumerate(tasks)}  # fmt: skip
        for future in library.as_completed(list(sent), loop=client.loop):
            task = sent.pop(future)
            yield _outcome(future, task)
            future.release()


def _outcome(future: Any, task: Task) -> Outcome:
    if future.status == "finished":
        found = future.result()
        assert isinstance(found, Outcome)
        return found
    why = " ".join(str(future.exception() if future.status == "error" else future.status).split())
    return Outcome(task.name, failure=f"lost with its workers: {why}"[:600])


def _library() -> Any:
    try:
        import distributed
    except ImportError as error:
        raise UserError("--scheduler needs the package distributed: pip install 'openswim[cluster]'") from error
    return distributed
