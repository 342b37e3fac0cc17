"""How light travels: a sweep through the grid along one direction, and a march along an eye ray."""

# ruff: noqa: E402
from pathlib import Path

from openswim.system.compiling import provide_cache
from openswim.system.first_start import compile_together

provide_cache()  # before any kernel is defined

from openswim.transport.diffuse.earlier import EarlierLight
from openswim.transport.engine.kernel_cache import drop_stale
from openswim.transport.engine.types import BUILD
from openswim.transport.field import Field
from openswim.transport.montecarlo.reference import ReferenceField
from openswim.transport.solve import solve
from openswim.transport.view.seen import View

__all__ = ["EarlierLight", "Field", "ReferenceField", "View", "solve"]

drop_stale(__name__)  # before any kernel is called
if BUILD == "float32":  # of which the list is
    compile_together(__name__, Path(__file__).with_name("first_kernels.json"))
