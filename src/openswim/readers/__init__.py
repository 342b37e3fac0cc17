"""Readers turn a model's files into a Scene. Each looks at the content of a file, never at its name."""

from openswim.readers.common.base import Reader, SceneInfo
from openswim.readers.domain.beyond import seen_part
from openswim.readers.domain.neighbourhood import Neighbourhood, reach_m
from openswim.readers.registry import readers
from openswim.readers.scenes import describe, files_of, grids_of, members_of, open_scene, states_of

__all__ = ["Neighbourhood", "Reader", "SceneInfo", "describe", "files_of", "grids_of", "members_of", "open_scene",
           "reach_m", "readers", "seen_part", "states_of"]  # fmt: skip
