import os
from pathlib import Path

import pytest


@pytest.fixture
def shared() -> Path:
    """The folder of reference data; skips where it is absent."""
    folder = Path(os.environ.get("OPENSWIM_SHARED", Path(__file__).parents[3] / "shared"))
    if not (folder / "reference").is_dir():
        pytest.skip(f"no reference data at {folder}; set OPENSWIM_SHARED")
    return folder
