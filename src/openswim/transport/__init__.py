"""How light travels: a sweep through the grid along one direction, and a march along an eye ray."""

from openswim.transport.field import Field, View
from openswim.transport.montecarlo import ReferenceField
from openswim.transport.solver import Solver
from openswim.transport.stale import drop_stale
from openswim.transport.sweep import share_ordinates

__all__ = ["Field", "ReferenceField", "Solver", "View"]

drop_stale(share_ordinates.stats.cache_path)  # of this package's kernels, before any is called
