"""Pictures of filter wheels: each band has a time of its own."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import xarray as xr

from openswim.errors import UserError
from openswim.satellites.bands import Band
from openswim.satellites.fixed_grid import FixedGrid
from openswim.satellites.picture import reflectance
from openswim.satellites.pixels import Pixels
from openswim.scene import Scene
from openswim.scene.times import parse_time
from openswim.solver import Solver


def reflectance_by_band(
    scene: Scene,
    grid: FixedGrid | Pixels,
    bands: Sequence[Band],
    times: Sequence[Any],
    solver: str | Solver = "fast",
) -> xr.Dataset:
    """`reflectance` of bands that were taken one after another, as EPIC's are; times : UTC of each.

    Light is solved for at each time. The scene is the same for all, so only the sun moves. ``band_time`` says when, and
    ``sun_zenith`` is on (band, y, x).
    """
    moments = [parse_time(one) for one in times]
    if not moments or len(moments) != len(bands) or any(one is None for one in moments):
        raise UserError(f"times: give one for each of the {len(bands)} bands, got {len(moments)}")
    parts = [
        reflectance(scene, grid, [one], when, solver=solver)
        for one, when in zip(bands, moments, strict=True)
    ]
    out = xr.concat(parts, "band", data_vars="minimal", coords="minimal", compat="override", join="exact")
    sun = np.stack([one.sun_zenith.values for one in parts])
    out = out.assign_coords(
        sun_zenith=(("band", "y", "x"), sun, parts[0].sun_zenith.attrs),
        band_time=("band", np.array(moments, "datetime64[ms]")),
    )
    stamps = sorted(one.attrs["time_coverage_start"] for one in parts)
    out.attrs |= {"time_coverage_start": stamps[0], "time_coverage_end": stamps[-1]}
    return out
