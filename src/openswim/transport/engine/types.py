"""What the kernels are built of: the kind of number they reckon with, and whether they check where they read and write.

Two environment variables, for developers and tests, are read here and nowhere else, once in a process:

- ``OPENSWIM_ELEMENT=float64``: packs, constants, scratch and results in double precision, from the same source;
- ``OPENSWIM_CHECKED=1``: a kernel that reads or writes beyond an array raises an IndexError that names it.

Without them kernels are what users run: float32, unchecked. What Numba keeps of another build lies in folders of its
own. To type checkers numbers are float32, as in production.
"""

from __future__ import annotations

import os
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numba import config

from openswim.errors import UserError
from openswim.switches import switched

_ELEMENTS = {"float32": np.float32, "float64": np.float64}
_NAME = os.environ.get("OPENSWIM_ELEMENT", "float32")
if _NAME not in _ELEMENTS:
    raise UserError(f"OPENSWIM_ELEMENT is {_NAME!r}: set it to float32 or float64, or not at all")

if TYPE_CHECKING:
    FLOAT = np.float32
else:
    FLOAT = _ELEMENTS[_NAME]
CHECKED = bool(switched("OPENSWIM_CHECKED"))
BYTES = np.dtype(FLOAT).itemsize
BUILD = _NAME + "-checked" * CHECKED

if BUILD != "float32":  # before any kernel is defined: Numba knows a kernel by its source, not by what is built of it
    kept = Path(config.CACHE_DIR or Path(__file__).parents[1] / "__pycache__")  # type: ignore[attr-defined]
    config.CACHE_DIR = str(kept / BUILD)  # type: ignore[attr-defined]
if CHECKED:
    config.BOUNDSCHECK = 1  # type: ignore[attr-defined]
