"""Irradiance at places on the ground through time: as the model has it, and as stations measure it."""

from openswim.stations.series import Series
from openswim.stations.through_time import irradiance

__all__ = ["Series", "irradiance"]
