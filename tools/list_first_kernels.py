"""Write src/openswim/transport/first_kernels.json: what the demo's pictures need to be compiled, for the first start.

    python tools/list_first_kernels.py

To be run when tests/transport/test_first_kernels.py says that the list is not what the demo needs. It makes the demo's
pictures twice, and compiles every kernel of the list in an empty folder, to see how long each takes: some five minutes.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path

PACKAGE = "openswim.transport"
LIST = Path(__file__).parents[1] / "src/openswim/transport/first_kernels.json"


def called() -> list[tuple[str, list[str]]]:
    """The kernels that Python has called, if all were found on disk, and the types of their arguments."""
    from openswim.system.first_start import written

    return [
        (f"{name}:{kernel.__name__}", [written(kind) for kind in kinds])
        for name, module in sorted(sys.modules.items())
        if name.startswith(f"{PACKAGE}.")
        for kernel in vars(module).values()
        if getattr(kernel, "__module__", None) == name
        for kinds in getattr(kernel, "overloads", {})
    ]


def seconds(name: str, kinds: list[str]) -> float:
    """CPU seconds to compile a kernel, and what it calls that is not compiled yet."""
    import importlib

    from openswim.system.first_start import read

    module, _, own = name.partition(":")
    kernel = getattr(importlib.import_module(module), own)
    types = tuple(read(kind) for kind in kinds)
    began = time.process_time()
    kernel.compile(types)
    return time.process_time() - began


def _demo() -> None:
    from openswim.cli.demo import run

    with tempfile.TemporaryDirectory() as folder:
        run(Path(folder))


def _step(step: str, given: object = None, **environment: str) -> str:
    """What a step gives in a process of its own."""
    done = subprocess.run(
        [sys.executable, __file__, step], input=json.dumps(given), stdout=subprocess.PIPE, text=True, check=True,
        env={**os.environ, **environment},
    )  # fmt: skip
    return done.stdout.splitlines()[-1]


def main() -> None:
    _step("demo")
    found = json.loads(_step("called"))
    with tempfile.TemporaryDirectory() as empty:
        taken = json.loads(_step("seconds", found, NUMBA_CACHE_DIR=empty))
    entries = [
        {"name": name, "seconds": round(cost, 1), "kinds": kinds}
        for cost, (name, kinds) in sorted(zip(taken, found, strict=True), reverse=True)
    ]
    LIST.write_text("[\n" + ",\n".join(f"  {json.dumps(one)}" for one in entries) + "\n]\n")
    print(f"{LIST}: {len(entries)} kernels, {sum(taken):.0f} s")


if __name__ == "__main__":
    match sys.argv[1:]:
        case []:
            main()
        case ["demo"]:
            _demo()
        case ["called"]:
            _demo()
            print(json.dumps(called()))
        case ["seconds"]:
            import openswim.transport  # noqa: F401

            print(json.dumps([seconds(*one) for one in json.load(sys.stdin)]))
