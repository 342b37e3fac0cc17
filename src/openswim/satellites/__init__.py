"""Pictures as imagers in space take them: their bands, their grids, and files of them."""

from openswim.satellites.bands import Band, band, imagers
from openswim.satellites.by_band import reflectance_by_band
from openswim.satellites.fixed_grid import FixedGrid
from openswim.satellites.named_grids import named_grid
from openswim.satellites.picture import reflectance
from openswim.satellites.pixels import Pixels

__all__ = ["Band", "FixedGrid", "Pixels", "band", "imagers", "named_grid", "reflectance", "reflectance_by_band"]
