"""The list of kernels that the first start compiles is of what the demo's pictures call, no more and no less."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import pytest

import openswim.transport
from openswim.transport.engine.types import BUILD

ROOT = Path(__file__).parents[2]
LIST = Path(openswim.transport.__file__).with_name("first_kernels.json")
SMALL = """
import json, sys
sys.path.insert(0, sys.argv[1])
from list_first_kernels import called
from numba.core import event
from openswim import Camera, light, render
from openswim.scene.procedural import demo_scene

compiled = []
class Listener(event.Listener):
    def on_start(self, one): compiled.append(one.data["dispatcher"].py_func.__module__)
    def on_end(self, one): ...
event.register("numba:compile", Listener())

scene = demo_scene(16, 16, 16)
lit = light(scene, wavelengths_nm=[550.0])
render(lit, Camera.panorama(*scene.place, size=48), sparse=0.015)
render(lit, Camera.satellite(*scene.place, height_m=4e5, fov_deg=3.2, size=24), sparse=0.015)
print(json.dumps([called(), any(name.startswith("openswim.transport") for name in compiled)]))
"""


@pytest.mark.skipif(BUILD != "float32", reason="the list is of single precision")
def test_the_list_is_what_the_demo_calls():
    for _ in range(2):  # a kernel that is compiled brings those that it calls: only from disk they come alone
        done = subprocess.run(
            [sys.executable, "-c", SMALL, str(ROOT / "tools")], capture_output=True, text=True, check=True
        )
        found, compiled = json.loads(done.stdout.splitlines()[-1])
        if not compiled:
            break
    called = {(name, tuple(kinds)) for name, kinds in found}
    listed = {(one["name"], tuple(one["kinds"])) for one in json.loads(LIST.read_text())}
    assert called == listed, "run python tools/list_first_kernels.py"
