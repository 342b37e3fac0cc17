import os
from pathlib import Path

import hypothesis
import pytest

hypothesis.settings.register_profile("openswim", deadline=None)  # on a busy machine any example may take long
hypothesis.settings.load_profile("openswim")
os.environ.setdefault("MIEPYTHON_USE_JIT", "1")  # as openswim sets it; read when miepython is first imported
# As the command line sets it, for the workers of xdist, which begin with it: idle threads of BLAS would spin.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
if "PYTEST_XDIST_WORKER" in os.environ:  # processes beside each other; two threads are what tests of threads need
    os.environ.setdefault("NUMBA_NUM_THREADS", "2")


@pytest.fixture(scope="session")
def shared() -> Path:
    """The folder of reference data; skips where it is absent."""
    folder = Path(os.environ.get("OPENSWIM_SHARED", Path(__file__).parents[2] / "shared"))
    if not (folder / "reference").is_dir():
        pytest.skip(f"no reference data at {folder}; set OPENSWIM_SHARED")
    return folder
