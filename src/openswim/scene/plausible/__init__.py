"""The gate that every scene passes: whether its fields can be."""

from openswim.scene.plausible.gate import check_plausible, high_bottom
from openswim.scene.plausible.samples import sampled, times_text

__all__ = ["check_plausible", "high_bottom", "sampled", "times_text"]
