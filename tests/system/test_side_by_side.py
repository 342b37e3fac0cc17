"""Work by several processes ends as quietly as it went."""

import subprocess
import sys
from pathlib import Path

PROGRAM = """
import multiprocessing, time
from multiprocessing.util import Finalize
from openswim.system import side_by_side

held = multiprocessing.get_context("spawn").Lock()  # as numcodecs has one, in each process that writes Zarr

class Done:
    peak_bytes = 0.0

def work(order, task):
    Finalize(None, time.sleep, (0.5,), exitpriority=99)  # it takes its time to end
    return Done()

if __name__ == "__main__":
    print(len(list(side_by_side.outcomes(work, None, range(4), 2, work))))
"""


def test_nothing_is_said_of_what_workers_held(tmp_path: Path) -> None:
    script = tmp_path / "program.py"
    script.write_text(PROGRAM)
    ended = subprocess.run([sys.executable, script], capture_output=True, text=True, timeout=120, check=True)
    assert (ended.stdout, ended.stderr) == ("4\n", "")
