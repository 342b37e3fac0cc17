"""What another process compiles ahead is what a solve calls."""

import subprocess
import sys

_COMPARE = """
import numpy as np
from openswim.scene.procedural import demo_scene
from openswim.cameras import Rays
from openswim.solver import Solver
from openswim.transport.beam import within_cells as bend
from openswim.transport import warm_up as compiling
from openswim.transport.view import source_function as eye_source
from openswim.transport.diffuse import moments
from openswim.transport.diffuse import sweep
names = [(sweep, "share_rows"), (sweep, "share_ordinates"), (moments, "prolong"), (moments, "restrict"),
         (moments, "add_scaled"), (moments, "squares"), (moments, "weighted_change"), (moments, "inner_product"),
         (eye_source, "view_source"), (bend, "bend_cells")]
kernels = [getattr(module, name) for module, name in names]
compiling.compile_sweeps()
compiling.compile_view()
ahead = [list(k.signatures) for k in kernels]
assert all(len(a) == 1 for a in ahead), ahead
field = Solver().solve(demo_scene(50, 50, 16), np.array([0.5, 0.0, 0.866]), [615.0, 450.0])
field.view(Rays(np.array([0.0, 0.0, 1e3]), np.array([[0.6, 0.0, 0.8], [0.0, 0.6, 0.8]])))
for kernel, before in zip(kernels, ahead, strict=True):
    assert list(kernel.signatures) == before, kernel
"""


def test_a_solve_calls_only_what_was_compiled_ahead() -> None:
    done = subprocess.run([sys.executable, "-c", _COMPARE], capture_output=True, text=True, timeout=500, check=False)
    assert done.returncode == 0, done.stderr
