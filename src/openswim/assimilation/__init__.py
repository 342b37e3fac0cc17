"""Clouds and ground by what cameras, satellites and pyranometers see: an observation operator with tangent linear and
adjoint, and analyses made with it (docs/assimilation.md)."""

from openswim.assimilation.analysing import Analysis, analyse
from openswim.assimilation.background import Background
from openswim.assimilation.departures import representation_error
from openswim.assimilation.ensemble import ensemble_filter, ensemble_of
from openswim.assimilation.observing.ioda import write_observations
from openswim.assimilation.observing.linearization import Linearization
from openswim.assimilation.observing.observe import observe
from openswim.assimilation.observing.operator import Operator
from openswim.assimilation.observing.window import observe_window
from openswim.assimilation.writing_back import write_back

__all__ = [
    "Analysis", "Background", "Linearization", "Operator", "analyse", "ensemble_filter", "ensemble_of", "observe",
    "observe_window", "representation_error", "write_back", "write_observations",
]  # fmt: skip
