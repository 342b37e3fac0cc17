"""How deep the clouds are that each pixel of a picture sees."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from openswim.errors import UserError

if TYPE_CHECKING:
    import xarray as xr

    from openswim.pictures.viewpoint import Viewpoint

DEPTH = "cloud_optical_depth"


def with_cloud_depth(viewpoint: Viewpoint) -> xr.Dataset:
    """The image of a viewpoint, with the optical depth (y, x) of all particles but aerosol along each pixel's line of
    sight; of nested grids, of those species that the innermost has."""
    from openswim.transport import Field

    field, rays = viewpoint.lit.field, viewpoint.rays
    if not isinstance(field, Field):
        raise UserError("solver reference does not tell how deep clouds are: take fast or swim")
    species = [] if field.medium is None else field.medium.species
    cloud = [n for n, one in enumerate(species) if one.kind != "aerosol"]
    depth = field.viewpoint(rays).view(rays).species_depth[:, cloud].sum(axis=1)
    image = viewpoint.view()
    image[DEPTH] = ("y", "x"), viewpoint.pixels.image(depth.astype(np.float32)), {
        "long_name": "optical depth of clouds along the line of sight, to the ground or to space", "units": "1"
    }  # fmt: skip
    return image
