"""What a film is written as: a video, numbered pictures, or radiance."""

from __future__ import annotations

import os
import re
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from openswim.errors import UserError
from openswim.films.from_frames import FORMATS, curves_of, series_of, times_of
from openswim.films.kept_frames import KeptFrames
from openswim.films.video import CODECS, check_video, write_video
from openswim.scene.cf import save_netcdf
from openswim.scene.files import check_apart, check_folder, check_kept, check_target, check_targets, written_whole

KINDS = {".mp4": "video", ".webm": "video", ".zarr": "radiance", "": "pictures"}
_FRAME = re.compile(r"frame_\d{6}\.png")


def check_output(path: Path) -> str:
    """The kind of output, by suffix; UserError where it could not be written."""
    suffix = path.suffix.lower()
    if suffix not in KINDS:
        raise UserError(
            f"film {path}: suffix {path.suffix!r} is unknown; use {', '.join(CODECS)}, .zarr, or none for a folder of "
            "pictures"
        )
    kind = KINDS[suffix]
    if kind == "video":
        check_video(suffix)
    if kind == "pictures":
        if not path.name:
            raise UserError(f"film {path}: is no name for a folder of pictures: choose one")
        check_folder(path, "film")
        foreign = _foreign(path)
        if foreign:
            raise UserError(f"film {path}: {foreign}, which is no frame: choose another name")
    else:
        check_target(path)
    return kind


def check_outputs(
    film: Path, beside: Sequence[tuple[str, str | os.PathLike[str] | None]], inputs: Sequence[Path]
) -> None:
    """UserError where a film, or what is written beside it, would replace a file that is read, or each other."""
    check_kept("film", film, inputs)
    check_targets(beside, inputs)
    for name, path in beside:
        if path is not None:
            check_apart(name, Path(path), film)


def check_curves(path: Path) -> None:
    """UserError where curves could not be written."""
    if path.suffix.lower() not in FORMATS:
        raise UserError(f"irradiance {path}: suffix {path.suffix!r} is unknown; use {' or '.join(FORMATS)}")
    check_target(path, name="irradiance")


def write_curves(path: Path, kept: KeptFrames, count: int) -> None:
    """Irradiance at the camera and the sun's place in each frame, as a table."""
    curves = curves_of([kept.facts(number) for number in range(count)])
    if path.suffix.lower() == ".nc":
        save_netcdf(curves, path)
    else:
        with written_whole(path) as partial:
            table = curves.to_dataframe()
            for name in table.select_dtypes("datetime"):
                table[name] = _written_out(curves[name].values)
            table.to_csv(partial)


def _written_out(times: NDArray[np.datetime64]) -> list[str]:
    """To the second, or to the millisecond where they are not whole seconds."""
    whole = bool((times == times.astype("datetime64[s]")).all())
    return [f"{text}Z" for text in np.datetime_as_string(times, "s" if whole else "ms")]


def write_film(
    path: Path, kept: KeptFrames, count: int, pictures: Iterator[NDArray[np.uint8]], frames_per_second: float,
    facts: dict[str, Any], wavelengths_nm: Sequence[float],
) -> None:  # fmt: skip
    """Write all frames under the film's name, whole or not at all."""
    kind = KINDS[path.suffix.lower()]
    about = f"{facts.get('valid_time', '')} {facts.get('source', '')}".strip()
    if kind == "video":
        with written_whole(path) as partial:
            write_video(partial, pictures, frames_per_second, "OpenSWIm", about)
    elif kind == "radiance":
        with written_whole(path) as partial:
            _write_radiance(partial, kept, count, wavelengths_nm)
    else:
        _write_pictures(path, pictures, about)


def _write_pictures(path: Path, pictures: Iterator[NDArray[np.uint8]], about: str) -> None:
    from openswim.colour.picture import write_picture

    with written_whole(path, own_folder=True) as new:
        new.mkdir()
        for number, picture in enumerate(pictures, 1):
            write_picture(picture, new / f"frame_{number:06d}.png", {"Film": about})


def _foreign(path: Path) -> str:
    """What is in the way of a folder of pictures: a file, or the first in a folder that is no frame."""
    if not path.is_dir():
        return (
            "is a link to nowhere" if path.is_symlink() and not path.exists() else "is a file" if path.exists() else ""
        )
    return next((f"holds {each.name}" for each in sorted(path.iterdir()) if not _FRAME.fullmatch(each.name)), "")


def _write_radiance(path: Path, kept: KeptFrames, count: int, wavelengths_nm: Sequence[float]) -> None:
    """Radiance (frame, y, x, wavelength) with a frame a chunk, and the times of each frame."""
    import zarr

    first = kept.get(0).radiance
    assert first is not None
    root = zarr.open_group(str(path), mode="w", zarr_format=2)
    root.attrs.put({"Conventions": "CF-1.11", "title": "OpenSWIm film", **_plain(kept.facts(0))})
    array = root.create_array(
        "radiance", shape=(count, *first.shape), chunks=(1, *first.shape), dtype="f4", fill_value=np.nan
    )
    array.attrs.put({"_ARRAY_DIMENSIONS": ["frame", "y", "x", "wavelength"], "units": "W m-2 sr-1 nm-1",
                     "long_name": "spectral radiance"})  # fmt: skip
    facts = []
    for number, frame in enumerate(kept.each(count)):
        assert frame.radiance is not None
        array[number] = frame.radiance
        facts.append(frame.facts)
    for name, values in series_of(facts).items():
        _write_line(root, name, values, "frame", {})
    _write_line(root, "wavelength", np.asarray(wavelengths_nm, np.float64), "wavelength", {"units": "nm"})
    for name, times in times_of(facts).items():
        about = {"units": "milliseconds since 1970-01-01", **({"standard_name": "time"} if name == "time" else {})}
        _write_line(root, name, times.astype(np.int64), "frame", about)
    zarr.consolidate_metadata(str(path), zarr_format=2)


def _write_line(root: Any, name: str, values: NDArray, dim: str, attrs: dict[str, Any]) -> None:
    line = root.create_array(name, shape=values.shape, chunks=values.shape, dtype=values.dtype)
    line[:] = values
    line.attrs.put({"_ARRAY_DIMENSIONS": [dim], **attrs})


def _plain(facts: dict[str, Any]) -> dict[str, Any]:
    kept = ("source", "solver", "quality", "view", "assumptions")
    return {name: facts[name] for name in kept if name in facts}
