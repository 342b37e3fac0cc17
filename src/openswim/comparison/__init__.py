"""A camera's sky beside the simulated one: pictures, masks, scores, and clouds corrected by them."""

from openswim.comparison.cloud_correction import correct_clouds
from openswim.comparison.comparing import compare

__all__ = ["compare", "correct_clouds"]
