"""How light travels: a sweep through the grid along one direction, and a march along an eye ray."""

import os

# Threads meet at the end of every plane: those that wait sleep, or on a busy machine they spin away the others' time.
# Read when Numba first starts its threads.
os.environ.setdefault("OMP_WAIT_POLICY", "passive")

from openswim.transport.field import Field, View  # noqa: E402
from openswim.transport.montecarlo import ReferenceField  # noqa: E402
from openswim.transport.solver import Solver  # noqa: E402

__all__ = ["Field", "ReferenceField", "Solver", "View"]
