"""Clouds and ground by what cameras, satellites and pyranometers see: an observation operator with tangent linear and
adjoint, and analyses made with it (docs/assimilation.md)."""

from openswim.assimilation.observing import observe
from openswim.assimilation.operator import Operator

__all__ = ["Operator", "observe"]
