"""Many frames: a file and a page for each, scores over time, and keograms; what is done is never done again."""

import hashlib
import json
from collections.abc import Callable, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from openswim.cameras import Camera
from openswim.cameras.files import CameraFile
from openswim.comparison.one_frame import compare_frame
from openswim.comparison.report.page import write_page
from openswim.comparison.report.series_page import write_series_page
from openswim.comparison.settings import KnownCamera, Settings, frame_of
from openswim.comparison.skies import Skies
from openswim.errors import UserError
from openswim.observations import SkyFrame
from openswim.scene.cf import save_netcdf

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
        read = frame_of(frame, content)
        found.append(of_series(compare_frame(skies, read, content, settings, known), content.camera))
    return joined(found)


def of_series(comparison: xr.Dataset, camera: Camera) -> xr.Dataset:
    """What a series keeps of one frame: its scores, and a line of each picture along the meridian."""
    names = [name for each in SCORES for name in (each, f"{each}_bounds") if name in comparison]
    kept = comparison[names].drop_vars(("azimuth", "altitude", "solid_angle"), errors="ignore")
    smaller = camera.resized(comparison.sizes["x"]) if comparison.sizes["x"] != camera.shape[1] else camera
    lines = {name: _meridian(comparison[name].values, smaller) for name in _PICTURES}
    for name, line in lines.items():
        kept[f"keogram_{name}"] = (("meridian", "channel"), line)
    kept = kept.assign_coords(
        time=np.datetime64(comparison.attrs["time"].rstrip("Z"), "ns"), frame=comparison.attrs["frame"],
        meridian=("meridian", np.linspace(0, 180, KEOGRAM), {"long_name": "angle from the northern horizon over the "
                                                                          "zenith", "units": "degree"}),
        sun_altitude=comparison.attrs["sun_altitude_deg"],
    )  # fmt: skip
    kept.attrs = {name: comparison.attrs[name] for name in ("model", "solver", "aerosol_note", "sun_mask_deg")}
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


def compare_into(
    skies: Skies, frames: Sequence[Path], content: CameraFile, settings: Settings, known: KnownCamera, folder: Path,
    time: Any = None, tell: Callable[[xr.Dataset], None] = lambda comparison: None,
    tell_failed: Callable[[Path, UserError], None] = lambda path, error: None,
) -> Path:  # fmt: skip
    """Compare frames into a folder: NAME.nc and NAME.html of each, and of several scores.nc and index.html.

    A frame's file appears when it is complete, and frames whose file is there, made with the same settings, are left as
    they are: after an interruption the same call goes on where it stopped. Of several frames those that cannot be
    compared are told and left out; if there is no other, the first error is raised. Returns the page to look at.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise UserError(f"{folder}: cannot be made ({error.strerror}); choose another folder with -o") from None
    names = [path.stem for path in frames]
    doubled = {name for name in names if names.count(name) > 1}
    if doubled:
        raise UserError(f"two frames are called {min(doubled)}: compare them one by one, into folders of their own")
    mark = fingerprint(skies, content, settings, known)
    camera = content.camera.resized(settings.size) if settings.size < content.camera.shape[1] else content.camera
    parts: list[xr.Dataset] = []
    failed: list[UserError] = []
    for path in sorted(frames, key=lambda path: path.name):
        target = folder / f"{path.stem}.nc"
        done = _done(target, mark)
        if done is None:
            try:
                frame: SkyFrame = frame_of(path, content, time)
                done = compare_frame(skies, frame, content, settings, known)
            except UserError as error:
                failed.append(error)
                if len(failed) == len(frames):
                    raise failed[0] from None
                tell_failed(path, error)
                continue
            done.attrs["fingerprint"] = mark
            write_page(done, camera, folder / f"{path.stem}.html")
            save_netcdf(done, target)
            tell(done)
        parts.append(of_series(done, content.camera))
    if len(frames) == 1:
        return folder / f"{names[0]}.html"
    series = joined(parts)
    save_netcdf(series, folder / "scores.nc")
    write_series_page(series, folder / "index.html")
    return folder / "index.html"


def fingerprint(skies: Skies, content: CameraFile, settings: Settings, known: KnownCamera) -> str:
    """What a comparison depends on but for the frame: files made otherwise are not taken for it."""
    model = "clear" if skies.model is None else str(skies.model)
    pixels = content.camera.resized(min(32, content.camera.shape[1])).pixels()
    curves = None if known.curves is None else [curve.radiance.tolist() for curve in known.curves]
    said = json.dumps(
        [model, str(skies.solver), skies.aod, skies.albedo, skies.sun, asdict(settings), known.red_blue, curves,
         str(content.response), str(content.frames), content.camera.horizon_deg, content.camera.lat,
         content.camera.lon],
        default=str,
    )  # fmt: skip
    return hashlib.sha256(said.encode() + np.nan_to_num(pixels.direction).round(6).tobytes()).hexdigest()[:16]


def _done(target: Path, mark: str) -> xr.Dataset | None:
    """A frame's comparison that an earlier run has left, if it was made alike."""
    if not target.exists():
        return None
    try:
        with xr.open_dataset(target) as found:
            return found.load() if found.attrs.get("fingerprint") == mark else None
    except (OSError, ValueError):
        return None


def _meridian(picture: NDArray[Any], camera: Camera) -> NDArray[np.float32]:
    """(KEOGRAM, channels): a picture along the meridian, the mean over 5 degrees across it."""
    along = np.linspace(0, 180, KEOGRAM)[:, None]
    away = np.linspace(-2.5, 2.5, 5)[None]
    altitude = 90 - np.abs(along - 90) + 0 * away
    azimuth = np.where(along <= 90, 0.0, 180.0) + np.where(along <= 90, 1, -1) * away / np.maximum(
        np.cos(np.radians(altitude)), 0.05
    )
    row, column = camera.pixel_of(azimuth % 360, altitude)
    ny, nx = camera.shape
    there = np.isfinite(row) & (row > -0.5) & (row < ny - 0.5) & (column > -0.5) & (column < nx - 0.5)
    y, x = (np.where(there, np.round(np.nan_to_num(v)), 0).astype(int) for v in (row, column))
    values = np.where(there[..., None], picture[y, x], np.nan)
    with np.errstate(invalid="ignore"):
        mean = np.nansum(values, axis=1) / np.isfinite(values).sum(axis=1)
    return np.asarray(mean, np.float32)


