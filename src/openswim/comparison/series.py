"""Many frames: scores over time, and keograms."""

from collections.abc import Sequence
from functools import lru_cache
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from openswim.cameras import Camera
from openswim.cameras.files import CameraFile
from openswim.comparison.one_frame import compare_frame
from openswim.comparison.settings import KnownCamera, Settings, frame_of
from openswim.comparison.skies import Skies
from openswim.errors import UserError

SCORES = ("r", "rmse", "bias", "pod", "far", "ets", "observed_cover", "simulated_cover", "fss", "r_below")
KEOGRAM = 90  # altitudes along the meridian, from north over the zenith to south
_PICTURES = ("stored", "simulated_as_stored")


def scores_over_time(
    skies: Skies, frames: Sequence[Any], content: CameraFile, settings: Settings, known: KnownCamera
) -> xr.Dataset:
    """Scores of frames along `time`, and the pair of keograms."""
    if not frames:
        raise UserError("compare: no frame is given")
    found = []
    for frame in frames:
        read = frame_of(frame, content, alone=False)
        found.append(of_series(compare_frame(skies, read, content, settings, known), content.camera))
    return joined(found)


def of_series(comparison: xr.Dataset, camera: Camera) -> xr.Dataset:
    """What a series keeps of one frame: its scores, and a line of each picture along the meridian."""
    names = [name for each in SCORES for name in (each, f"{each}_bounds") if name in comparison]
    kept = comparison[names].drop_vars(("azimuth", "altitude", "solid_angle"), errors="ignore")
    smaller = camera.resized(comparison.sizes["x"]) if comparison.sizes["x"] != camera.shape[1] else camera
    lines = {f"keogram_{name}": (("meridian", "channel"), _meridian(comparison[name].values, smaller))
             for name in _PICTURES}  # fmt: skip
    kept = kept.assign(lines).assign_coords(
        time=np.datetime64(comparison.attrs["time"].rstrip("Z"), "ns"), frame=comparison.attrs["frame"],
        meridian=("meridian", np.linspace(0, 180, KEOGRAM), {"long_name": "angle from the northern horizon over the "
                                                                          "zenith", "units": "degree"}),
        sun_altitude=comparison.attrs["sun_altitude_deg"],
    )  # fmt: skip
    said = ("model", "solver", "detail", "aerosol_note", "sun_mask_deg")
    kept.attrs = {name: comparison.attrs[name] for name in said if name in comparison.attrs}
    return kept


def joined(parts: Sequence[xr.Dataset]) -> xr.Dataset:
    """Frames in the order of their times; if some are in colours, so is what is kept of the grey ones."""
    ordered = sorted(parts, key=lambda part: (part["time"].values, str(part["frame"].values)))
    coloured = next((part for part in ordered if part.sizes["channel"] == 3), ordered[0])
    ordered = [part if part.sizes["channel"] == coloured.sizes["channel"] else _in_colours(part, coloured)
               for part in ordered]  # fmt: skip
    return xr.concat(ordered, "time", data_vars="all", coords="different", compat="equals", join="outer",
                     combine_attrs="drop_conflicts")  # fmt: skip


def _in_colours(grey: xr.Dataset, coloured: xr.Dataset) -> xr.Dataset:
    """A grey frame's part laid out as that of one in colours: mean r, the keogram alike in all colours, else NaN."""
    own = {name: grey[name] for name in ("time", "frame", "sun_altitude")}
    out = xr.full_like(coloured, np.nan).assign_coords(own).assign_attrs(grey.attrs)
    for name, found in grey.data_vars.items():
        if "score_channel" in found.dims:
            out[name].loc[{"score_channel": "mean"}] = found.sel(score_channel="mean", drop=True)
        elif str(name).startswith("keogram"):
            out[name][:] = found.values
    return out


def _meridian(picture: NDArray[Any], camera: Camera) -> NDArray[np.float32]:
    """(KEOGRAM, channels): a picture along the meridian, the mean over 5 degrees across it."""
    y, x, there = _on_meridian(camera)
    values = np.where(there[..., None], picture[y, x], np.nan)
    with np.errstate(invalid="ignore"):
        mean = np.nansum(values, axis=1) / np.isfinite(values).sum(axis=1)
    return np.asarray(mean, np.float32)


@lru_cache(maxsize=4)
def _on_meridian(camera: Camera) -> tuple[NDArray[np.intp], NDArray[np.intp], NDArray[np.bool_]]:
    """Rows and columns (KEOGRAM, 5) along the meridian and across it, and whether the camera sees there."""
    along = np.linspace(0, 180, KEOGRAM)[:, None]
    away = np.linspace(-2.5, 2.5, 5)[None]
    altitude = 90 - np.abs(along - 90) + 0 * away
    azimuth = np.where(along <= 90, 0.0, 180.0) + np.where(along <= 90, 1, -1) * away / np.maximum(
        np.cos(np.radians(altitude)), 0.05
    )
    row, column = camera.pixel_of(azimuth % 360, altitude)
    ny, nx = camera.shape
    there = np.isfinite(row) & (row > -0.5) & (row < ny - 0.5) & (column > -0.5) & (column < nx - 0.5)
    y, x = (np.where(there, np.round(np.nan_to_num(v)), 0).astype(np.intp) for v in (row, column))
    return y, x, there
