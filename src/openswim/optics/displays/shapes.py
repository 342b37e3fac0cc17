"""How much alike a scene's droplets are, and how its ice crystals are shaped: what a model does not know."""

from __future__ import annotations

from copy import copy
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import xarray as xr

from openswim.errors import UserError
from openswim.optics.displays.droplets import USUAL_VARIANCE
from openswim.scene.particles import check_number
from openswim.scene.variables import variable

if TYPE_CHECKING:
    from openswim.scene import Scene

PRISTINE_SHARE = 0.05  # of ice, where nothing is said


@dataclass(frozen=True)
class Shapes:
    """droplet_variance: effective variance of the droplets' sizes, .01 (all alike) to .1 (as usual).

    pristine, plates, columns: shares of the ice's extinction by smooth prisms in all orientations, by smooth plates
    that float level, and by smooth columns that do; the rest is rough and shows no halo.
    """

    droplet_variance: float = USUAL_VARIANCE
    pristine: float = PRISTINE_SHARE
    plates: float = 0.0
    columns: float = 0.0

    @classmethod
    def of(cls, scene: Scene) -> Shapes:
        """Those that a scene's file or `with_shapes` told."""
        told = {name: float(scene.data[own]) for name, own in _VARIABLES.items() if own in scene.data}
        return cls(**told)


_VARIABLES = {
    "droplet_variance": "liquid_effective_variance", "pristine": "ice_pristine_fraction",
    "plates": "ice_level_plate_fraction", "columns": "ice_level_column_fraction",
}  # fmt: skip


def with_shapes(
    scene: Scene, droplet_variance: float | None = None, pristine: float | None = None, plates: float | None = None,
    columns: float | None = None,
) -> Scene:  # fmt: skip
    """The scene, and the wider ones around it, with `Shapes` of one's choice; what is not given stays."""
    given = {"droplet_variance": droplet_variance, "pristine": pristine, "plates": plates, "columns": columns}
    chosen = {_VARIABLES[name]: value for name, value in given.items() if value is not None}
    for name, value in chosen.items():
        check_number(variable(name).long_name, value, variable(name).low, variable(name).high)
    out = copy(scene)
    fields = {
        name: xr.DataArray(np.float32(value), attrs={"units": "1", "long_name": variable(name).long_name})
        for name, value in chosen.items()
    }
    out.data = scene.data.assign(fields)
    shapes = Shapes.of(out)
    if shapes.pristine + shapes.plates + shapes.columns > 1 + 1e-6:
        raise UserError(
            f"ice: shares of {shapes.pristine:g} pristine crystals, {shapes.plates:g} level plates and "
            f"{shapes.columns:g} level columns are more than all: give less of one"
        )
    out.wider = None if scene.wider is None else with_shapes(scene.wider, **given)
    return out
