"""Files of aerosol optical depths alone, by kind: NAAPS, CAMS, MERRA-2. A sky with no cloud in it."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import xarray as xr

from openswim.errors import UserError
from openswim.readers.fields.aerosol_by_depth import NAMES
from openswim.readers.gridded.reader import GriddedReader

LEVELS_M = np.linspace(0.0, 10_000.0, 21)


class AerosolDepthsReader(GriddedReader):
    """Reads optical depths at 550 nm on latitude and longitude, whose names it knows."""

    name = "aerosol depths"

    def recognises(self, data: xr.Dataset) -> bool:
        found = [data[name] for name in data.data_vars if str(name).lower() in NAMES]
        return bool(found) and "openswim_layout" not in data.attrs and not super().recognises(data)

    def adapt(self, path: Path, data: xr.Dataset) -> xr.Dataset:
        """The file with levels of height, on which there is nothing yet."""
        sample = next(data[name] for name in data.data_vars if str(name).lower() in NAMES)
        if sample.ndim < 2:
            raise UserError(f"{path}: {sample.name} has no latitude and longitude: give a file of maps")
        plane = sample.dims[-2:]
        shape = (LEVELS_M.size, *(sample.sizes[dim] for dim in plane))
        height = np.broadcast_to(LEVELS_M.astype(np.float32)[:, None, None], shape)
        said = {"units": "m", "standard_name": "altitude"}
        return data.assign(altitude=(("level_of_height", *plane), height, said))
