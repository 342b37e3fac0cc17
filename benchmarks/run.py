"""Where the time goes: `python benchmarks/run.py` prints a table, stage by stage.

The demo scene on 256x256x64 nodes and a 1440x720 panorama at three wavelengths, in a first process that finds
no compiled kernels and a second one that does, each stage twice ("again"); and `openswim demo` as a whole.
"""

import argparse
import json
import os
import re
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.table import Table

HERE = Path(__file__).parent
STARTS = ("first start", "second start")


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--solver", default="fast", choices=("swim", "fast"))
    parser.add_argument(
        "--keep-cache", action="store_true", help="start from Numba's usual cache, not an empty one"
    )
    parser.add_argument("--json", type=Path, help="also write the numbers to this file")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as scratch:
        # The demo and the stages share no cache, so that each has a first start.
        caches = (None, None) if options.keep_cache else (f"{scratch}/demo", f"{scratch}/stages")
        demo_env, stages_env = (
            {**os.environ, "NUMBA_CACHE_DIR": c} if c else dict(os.environ) for c in caches
        )
        numbers = {
            start: {"demo_s": demo_seconds(demo_env), **stages(stages_env, options.solver)}
            for start in STARTS
        }
    Console(width=120).print(as_table(numbers, options.solver))
    if options.json:
        options.json.write_text(json.dumps({"solver": options.solver, **numbers}, indent=1) + "\n")


def demo_seconds(environment: dict[str, str]) -> float:
    """Wall-clock seconds of `openswim demo`, the start of the process and the writing of files included."""
    with tempfile.TemporaryDirectory() as folder:
        start = time.perf_counter()
        run([sys.executable, "-m", "openswim", "demo", "-o", folder], environment)
        return time.perf_counter() - start


def stages(environment: dict[str, str], solver: str) -> dict[str, Any]:
    """What `stages.py` measures in a process of its own."""
    said = run([sys.executable, str(HERE / "stages.py"), "--solver", solver], environment)
    return dict(json.loads(said.splitlines()[-1]))


def run(command: list[str], environment: dict[str, str]) -> str:
    """The standard output of a command; ends the benchmark where it fails."""
    done = subprocess.run(command, env=environment, capture_output=True, text=True)
    if done.returncode:
        sys.exit(f"{' '.join(command)}\n{done.stderr}")
    return done.stdout


def as_table(numbers: dict[str, Any], solver: str) -> Table:
    """Seconds per stage for both starts; samples and cycles from the second."""
    cores, clock_hz = os.cpu_count() or 1, clock()
    table = Table(
        title=f"solver {solver}, {cores} cores at {clock_hz / 1e9:.1f} GHz", box=None, pad_edge=False
    )
    table.add_column("stage")
    for heading in (*(f"{start}, s" for start in STARTS), "M samples", "M samples/s", "cycles/sample"):
        table.add_column(heading, justify="right")
    first, second = (numbers[start] for start in STARTS)
    for name, stage in second["stages"].items():
        cells = [f"{one['stages'][name]['seconds']:.3f}" for one in (first, second)]
        if "samples" in stage:
            seconds, samples = stage["seconds"], stage["samples"]
            cells += [f"{samples / 1e6:.1f}", f"{samples / seconds / 1e6:.1f}"]
            cells += [f"{seconds * cores * clock_hz / samples:.0f}"]
        table.add_row(name, *cells)
    table.add_row("openswim demo, in all", *(f"{one['demo_s']:.1f}" for one in (first, second)))
    table.add_row("peak memory, MB", *(f"{one['peak_mb']:.0f}" for one in (first, second)))
    return table


def clock() -> float:
    """The processor's clock in Hz as Linux tells it now; 0 where it does not."""
    try:
        found = re.findall(r"cpu MHz\s*:\s*([\d.]+)", Path("/proc/cpuinfo").read_text())
    except OSError:
        found = []
    return max((1e6 * float(mhz) for mhz in found), default=0.0)


if __name__ == "__main__":
    main()
