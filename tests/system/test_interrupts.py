"""Ctrl-C ends the process, also while it computes where Python does not hear of signals."""

from __future__ import annotations

import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

# pbkdf2_hmac computes for minutes and lets other threads run, as LLVM and HDF5 do
DEAF = "hashlib.pbkdf2_hmac('sha256', b'', b'', 10**9)"
PROGRAM = """
import hashlib, signal, sys, time
from pathlib import Path
from openswim.system.interrupts import claim, watched
from openswim.scene.files import written_whole

signal.signal(signal.SIGINT, signal.default_int_handler)  # shells ignore it for what they run in the background

def main():
    with written_whole(sys.argv[1]) as partial:
        partial.write_text("half")
        print("ready", flush=True)
        {}

with watched():
    try:
        main()
    except KeyboardInterrupt:
        print("heard", flush=True)
        sys.exit(7)
"""
SAVES = "try: time.sleep(60)\n        except KeyboardInterrupt: claim(); time.sleep(3); sys.exit(5)"


def _interrupted(tmp_path: Path, work: str, times: int = 1) -> tuple[int, str, float]:
    """Exit code, what was said, and the seconds that it took to end."""
    command = [sys.executable, "-c", PROGRAM.format(work), str(tmp_path / "out")]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as one:
        assert one.stdout is not None
        assert one.stdout.readline() == "ready\n"
        time.sleep(0.3)
        began = time.monotonic()
        for _ in range(times):
            one.send_signal(signal.SIGINT)
            time.sleep(0.2)
        try:
            out, err = one.communicate(timeout=60)
        except subprocess.TimeoutExpired:
            one.kill()
            raise
        took = time.monotonic() - began
    assert not list(tmp_path.iterdir())
    return one.returncode, out + err, took


def test_where_python_is_deaf(tmp_path):
    code, said, took = _interrupted(tmp_path, DEAF)
    assert code == 130
    assert "openswim: interrupted" in said
    assert took < 2.0 * 1.3  # on a busy machine


def test_where_python_hears(tmp_path):
    code, said, took = _interrupted(tmp_path, "time.sleep(60)")
    assert (code, said) == (7, "heard\n")
    assert took < 1.3


@pytest.mark.parametrize("times", [1, 2])
def test_who_has_something_to_save_may_take_longer(tmp_path, times):
    """Once; a second Ctrl-C ends that too."""
    code, _, took = _interrupted(tmp_path, SAVES, times)
    assert code == 5 if times == 1 else code in (7, 130)
    assert took > 2.9 if times == 1 else took < 2.9
