"""How light travels: a sweep through the grid along one direction, and a march along an eye ray."""

from openswim.transport.solver import Field, Solver, View

__all__ = ["Field", "Solver", "View"]
