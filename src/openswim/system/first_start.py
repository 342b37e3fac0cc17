"""The first start: what most pictures need is compiled by several processes, and then read from disk.

A package keeps a list of such kernels, with the types of their arguments and the seconds that each takes, the longest
first. When one of them is not found on disk, processes are started that compile all of the list; who starts meanwhile
waits for them. What they do not do, the process that asks for it does itself.
"""

from __future__ import annotations

import importlib
import json
import os
import signal
import subprocess
import sys
import threading
import time
from collections import deque
from contextlib import ExitStack, suppress
from pathlib import Path
from queue import SimpleQueue
from typing import Any, NamedTuple

from numba import config, types
from numba.core import event

from openswim.progress import Meter, job, tell
from openswim.system import compiling
from openswim.system.machine import cores, free_memory
from openswim.system.workshops import alone_in

_settings: Any = config
_kinds: Any = types
_MOST_PROCESSES = 4  # the longest kernel takes a third of the time
_PROCESS_BYTES = 1e9
_LEAST_MISSED = 8  # fewer are not worth the start of processes
_PATIENCE_S = 600.0
_DONE = "done"


def compile_together(package: str, listed: Path) -> None:
    """Have the kernels of a list compiled by several processes as soon as one of them is not found on disk.

    package: with its import every listed kernel is defined; they keep what is compiled of them (`compiling.heal`).
    """
    indices = [_index(one.name) for one in _entries(listed)]

    def prepare() -> None:
        with suppress(OSError):  # no process can be started, no folder read
            _prepare(package, listed, indices)

    if all(indices):  # else nothing is kept, or nothing compiled
        compiling.prepare_with(prepare, set(indices))


def written(kind: Any) -> str:
    """A type of an argument in a list: int64, float32[2] of an array, module:name(..) of a named tuple."""
    if isinstance(kind, types.Array):
        more = ("" if kind.layout == "C" else kind.layout) + ("" if kind.mutable else "r")
        return f"{kind.dtype}[{kind.ndim}{more}]"
    if isinstance(kind, _kinds.BaseTuple):
        made = getattr(kind, "instance_class", None)
        name = f"{made.__module__}:{made.__qualname__}" if made else ""
        return f"{name}({','.join(written(one) for one in kind.types)})"
    if isinstance(kind, types.Number | types.Boolean):
        return str(kind)
    raise TypeError(f"{kind}: kernels of a list are called with numbers, arrays and tuples of them")


def read(text: str) -> Any:
    """The type that `written` gives as ``text``."""
    kind, rest = _read(text)
    if rest:
        raise ValueError(f"{text}: {rest} is left over")
    return kind


def _read(text: str) -> tuple[Any, str]:
    end = next((n for n, letter in enumerate(text) if letter in "(,)"), len(text))
    name, rest = text[:end], text[end:]
    if rest.startswith("("):
        parts = []
        while not rest.startswith(")"):
            part, rest = _read(rest[1:])
            parts.append(part)
        return _kinds.BaseTuple.from_types(tuple(parts), _named(name) if name else None), rest[1:]
    if name.endswith("]"):
        element, _, more = name[:-1].partition("[")
        digits = more.rstrip("AFr")
        layout = next((letter for letter in more if letter in "AF"), "C")
        return _kinds.Array(_plain(element), int(digits), layout, readonly=more.endswith("r")), rest
    return _plain(name), rest


def _plain(name: str) -> Any:
    return _kinds.boolean if name == "bool" else getattr(_kinds, name)


def _named(name: str) -> Any:
    module, _, own = name.partition(":")
    return getattr(importlib.import_module(module), own)


class _Entry(NamedTuple):
    name: str  # module:function
    seconds: float  # CPU, on one machine
    kinds: list[str]  # see `written`


def _entries(listed: Path) -> list[_Entry]:
    return [_Entry(**one) for one in json.loads(listed.read_text())]


def _index(name: str) -> str:
    """The file that says what is kept of a kernel; empty where nothing is."""
    files = getattr(getattr(_named(name), "_cache", None), "_cache_file", None)
    return str(getattr(files, "_index_path", ""))


def _processes() -> int:
    """How many compile side by side; only this one where Python is part of a program, which would be started again."""
    if "python" not in Path(sys.executable or "").name.lower():
        return 1
    return int(min(_MOST_PROCESSES, _settings.NUMBA_NUM_THREADS, cores(), free_memory() / _PROCESS_BYTES))


def _prepare(package: str, listed: Path, indices: list[str]) -> None:
    processes = _processes()
    if processes < 2:
        return
    with ExitStack() as held:
        _hold(Path(indices[0]).parent, held)
        missed = deque(n for n, index in enumerate(indices) if not os.path.exists(index))
        if len(missed) >= _LEAST_MISSED:
            _compile(package, listed, missed, min(processes, len(missed)))


def _hold(folder: Path, held: ExitStack) -> None:
    """Hold a folder of kernels until ``held`` ends; while another process does, wait."""
    told, until = False, time.monotonic() + _PATIENCE_S
    while True:
        try:
            held.enter_context(alone_in(folder))
            return
        except BlockingIOError:
            if time.monotonic() > until:
                raise
        if not told:
            tell("note: waits for another process, which compiles kernels")
        told = True
        time.sleep(0.2)


def _compile(package: str, listed: Path, missed: deque[int], processes: int) -> None:
    taken = [one.seconds for n, one in enumerate(_entries(listed)) if n in missed]
    about = compiling.rounded(max(sum(taken) / processes, max(taken)))
    tell(f"note: kernels are compiled for this machine, once, by {processes} processes: about {about}")
    given = {
        "PYTHONPATH": os.pathsep.join(folder or os.getcwd() for folder in sys.path), "NUMBA_NUM_THREADS": "1",
        **({"NUMBA_CACHE_DIR": _settings.CACHE_DIR} if _settings.CACHE_DIR else {}),
    }  # fmt: skip
    workers: list[subprocess.Popen[str]] = []
    try:
        for _ in range(processes):
            workers.append(_worker(package, listed, {**os.environ, **given}))
        with job("kernels compiled") as meter:
            served = [threading.Thread(target=_serve, args=(one, missed, meter), daemon=True) for one in workers]
            for thread in served:
                thread.start()
            for thread in served:
                while thread.is_alive():  # a wait without an end would keep an interrupt from Python
                    thread.join(0.1)
    finally:
        for worker in workers:
            worker.kill()
            worker.communicate()


def _worker(package: str, listed: Path, environment: dict[str, str]) -> subprocess.Popen[str]:
    return subprocess.Popen(
        [sys.executable, "-P", "-m", __name__, package, str(listed)],  # -P: not what lies in the folder we are in
        stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True, env=environment,
    )  # fmt: skip


def _serve(worker: subprocess.Popen[str], missed: deque[int], meter: Meter) -> None:
    """Hand a worker one kernel after the other, until none is left or it has died."""
    assert worker.stdin is not None
    assert worker.stdout is not None
    with suppress(OSError, ValueError, IndexError):
        while True:
            worker.stdin.write(f"{missed.popleft()}\n")
            worker.stdin.flush()
            for line in worker.stdout:
                if line.strip() == _DONE:
                    break
                meter.advance()
            else:
                return


class _Counted(event.Listener):
    def on_start(self, compiling: Any) -> None: ...

    def on_end(self, compiling: Any) -> None:
        print("one", flush=True)


def _work(package: str, listed: Path) -> None:
    """A worker: compiles the kernels whose numbers come in, and ends when nobody can send any more."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is its parent's to hear
    orders: SimpleQueue[int] = SimpleQueue()
    threading.Thread(target=_listen, args=(orders,), daemon=True).start()
    importlib.import_module(package)
    compiling.prepare_with(lambda: None, set())
    event.register("numba:compile", _Counted())
    entries = _entries(listed)
    while True:
        wanted = entries[orders.get()]
        with suppress(Exception):  # it will be tried, and told of, where it is needed
            _named(wanted.name).compile(tuple(read(kind) for kind in wanted.kinds))
        print(_DONE, flush=True)


def _listen(orders: SimpleQueue[int]) -> None:
    for line in sys.stdin:
        orders.put(int(line))
    os._exit(0)


if __name__ == "__main__":
    _work(sys.argv[1], Path(sys.argv[2]))
