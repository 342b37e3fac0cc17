"""How far the model is from reference radiances, fluxes and positions: `openswim validate DIR`."""

from openswim.validation.reference import Row
from openswim.validation.reference.metrics import Score, image_score, score
from openswim.validation.report import as_table, write_json
from openswim.validation.walk import reference_files, validate

__all__ = ["Row", "Score", "as_table", "image_score", "reference_files", "score", "validate", "write_json"]
