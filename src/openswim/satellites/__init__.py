"""Pictures as imagers in space take them: their bands, their grids, and files of them."""

from openswim.satellites.bands import Band, band, imagers
from openswim.satellites.fixed_grid import FixedGrid
from openswim.satellites.picture import reflectance

__all__ = ["Band", "FixedGrid", "band", "imagers", "reflectance"]
