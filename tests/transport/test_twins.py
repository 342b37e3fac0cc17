"""Every kernel that light passes through against a slow twin, written from docs/fast.md: as users run it, and in double
precision with every access to memory checked."""

from __future__ import annotations

import json
import os
import runpy
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
from numba import config
from tests.transport.twins.cases import CASES, apart

from openswim.errors import UserError
from openswim.transport.diffuse.sweep import share_ordinates
from openswim.transport.engine import types

# Differences, where they are more than rounding: level ordinates have 1e-10 of their light from the plane before, which
# for the first plane is what another ordinate has left; eyes are a micrometre farther off, lest one be at a node.
ROUNDING = {"float32": 1e-5, "float64": 1e-12}
KNOWN = {"moments, level": 1e-9, "moments, open, level": 1e-9, "near": 3e-9}


@pytest.mark.parametrize("name", CASES)
def test_kernels_are_their_twins(name: str) -> None:
    for what, found in apart(CASES[name]()).items():
        assert found < ROUNDING["float32"], what


@pytest.fixture(scope="module")
def checked(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Any]:
    """What the cases tell when they run on kernels in double precision that check where they read and write."""
    more = {"OPENSWIM_ELEMENT": "float64", "OPENSWIM_CHECKED": "1"}
    # Nearly all the time goes to compiling, and nothing here asks for speed; what is so compiled is kept apart. Without
    # any optimisation (0) it takes as long, and Numba keeps none of the kernels that call others.
    kept = Path(config.CACHE_DIR or Path(types.__file__).parents[1] / "__pycache__") / "unoptimised"
    more |= {"NUMBA_OPT": "1", "NUMBA_LOOP_VECTORIZE": "0", "NUMBA_CACHE_DIR": str(kept)}
    root = Path(__file__).parents[2]
    path = os.pathsep.join([str(root), *sys.path])
    done = subprocess.run(
        [sys.executable, "-m", "tests.transport.twins.cases"], env={**os.environ, **more, "PYTHONPATH": path},
        cwd=root, capture_output=True, text=True, timeout=1500,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)


@pytest.mark.slow
@pytest.mark.parametrize("name", CASES)
def test_kernels_in_double_precision_are_their_twins(checked: dict[str, Any], name: str) -> None:
    assert checked["build"] == "float64-checked"
    for what, found in checked["apart"][name].items():
        assert found < KNOWN.get(what, ROUNDING["float64"]), what


@pytest.mark.slow
def test_checked_kernels_stop_at_the_ends_of_arrays(checked: dict[str, Any]) -> None:
    assert checked["beyond"] == ["_store: 4 in a row of array(float64, 1d, C) are not all within it"] * 6


@pytest.mark.slow
def test_builds_do_not_share_machine_code(checked: dict[str, Any]) -> None:
    assert types.BUILD == "float32"
    assert checked["kept"] != share_ordinates.stats.cache_path
    assert "float64-checked" in Path(checked["kept"]).parts


def test_an_element_that_there_is_not_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("OPENSWIM_ELEMENT", "float16")
    with pytest.raises(UserError, match="OPENSWIM_ELEMENT is 'float16': set it to float32 or float64, or not at all"):
        runpy.run_path(types.__file__)
