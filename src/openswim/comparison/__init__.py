"""A camera's sky beside the simulated one: pictures, masks, scores."""

from openswim.comparison.comparing import compare

__all__ = ["compare"]
