"""How light travels: a sweep through the grid along one direction, and a march along an eye ray."""

from openswim.transport.field import Field, View
from openswim.transport.montecarlo import ReferenceField
from openswim.transport.solver import Solver

__all__ = ["Field", "ReferenceField", "Solver", "View"]
