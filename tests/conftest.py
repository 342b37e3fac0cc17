import os
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path

import hypothesis
import pytest

hypothesis.settings.register_profile("openswim", deadline=None)  # on a busy machine any example may take long
hypothesis.settings.load_profile("openswim")
os.environ.setdefault("MIEPYTHON_USE_JIT", "1")  # as openswim sets it; read when miepython is first imported
# As the command line sets them, for the workers of xdist, which begin with them: idle threads of BLAS would spin.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
os.environ.setdefault("NUMPY_MADVISE_HUGEPAGE", "0")
# Zarr's plugin of pytest has loaded NumPy by now, with a BLAS of as many threads as there are cores: the last bits of
# its products would not be those of the processes that tests start.
with suppress(ImportError):
    from threadpoolctl import threadpool_limits

    threadpool_limits(int(os.environ["OPENBLAS_NUM_THREADS"]), "blas")
if "PYTEST_XDIST_WORKER" in os.environ:  # processes beside each other; two threads are what tests of threads need
    os.environ.setdefault("NUMBA_NUM_THREADS", "2")


@pytest.fixture(scope="session")
def shared() -> Path:
    """The folder of reference data; skips where it is absent."""
    folder = Path(os.environ.get("OPENSWIM_SHARED", Path(__file__).parents[2] / "shared"))
    if not (folder / "reference").is_dir():
        pytest.skip(f"no reference data at {folder}; set OPENSWIM_SHARED")
    return folder


@pytest.fixture(scope="module", autouse=True)
def one_prober() -> Iterator[None]:
    """One process looks at the HDF5 files of all tests of a module, as at those of a series: to start one for each
    file that is opened takes twice the time of the look itself. tests/readers/test_prober.py starts its own."""
    from openswim.readers.common.prober import prober

    with prober():
        yield
