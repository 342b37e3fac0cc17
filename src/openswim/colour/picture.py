"""Pictures (.png, .jpg, .tif) and data (.nc, .zarr) in files, whole or not at all."""

import os
from collections.abc import Iterable
from io import BytesIO
from pathlib import Path
from typing import Any, Literal

import numpy as np
import xarray as xr

from openswim.arguments import check_choice, shown, takes
from openswim.colour.beside import BESIDE, beside
from openswim.errors import UserError
from openswim.scene.files import check_ours, check_target, written_whole
from openswim.system.inputs import check_name

PICTURES = (".png", ".jpg", ".jpeg", ".tif", ".tiff")
LIGHTS = (".hdr", ".exr")  # linear light, to light other scenes by
DATA = (".nc", ".zarr")
CAPTIONS = ("inside", "below", "none")


def check_writable(
    path: str | os.PathLike[str], inputs: Iterable[str | os.PathLike[str]] = (), view: object = None
) -> None:
    """Raise UserError unless `save` could write `path`: a known suffix, in a folder that takes files, none of `inputs`.

    Of a picture of this view the files that come along with it are looked at, too, and replace none but our own. Meant
    to be called before a long computation.
    """
    check_name(path, "output")
    path = Path(path)
    suffix = path.suffix.lower()
    known = PICTURES + LIGHTS + DATA
    if suffix not in known:
        raise UserError(f"output {path}: suffix {path.suffix!r} is unknown; use one of {', '.join(known)}")
    if suffix == ".exr":
        from openswim.colour.hdr import exr_library

        exr_library()
    check_target(path, inputs)
    if path.exists() and path.is_dir() != (suffix == ".zarr"):
        raise UserError(f"output {path} is a {'folder' if path.is_dir() else 'file'}; choose another name")
    for other in beside(path, view):
        check_target(other, inputs)
        check_ours(other, BESIDE[other.suffix], f"move it away, or give {path.name} another name")


def only_looked_at(suffixes: Iterable[str], bits: int) -> bool:
    """Whether files of these suffixes are all pictures of 8 bits a colour, whose light nobody measures."""
    return bits == 8 and all(suffix.lower() in PICTURES for suffix in suffixes)


@takes
def save(
    image: xr.Dataset | xr.DataArray,
    path: str | os.PathLike[str],
    exposure: float | str = "auto",
    caption: bool | str = "inside",
    *,
    matrix: Literal["srgb", "paper"] = "srgb",
    gamma: float | Literal["srgb"] = "srgb",
    roll_off: bool = True,
    dither: bool = True,
    glare: bool = True,
    bits: int = 8,
    eye: bool = False,
) -> None:
    """Write a rendered image by the suffix of `path`: .png, .jpg, .tif as a picture, .nc, .zarr as data, .hdr, .exr as
    linear light (`openswim.colour.hdr`).

    Pictures carry what was rendered in their metadata and on a strip: `caption` "inside", over the picture's lowest
    rows, so that the file has the image's size; "below", added to it; or "none".  `exposure` and the other options are
    those of `to_rgb`; PNG and TIFF may have 16 `bits`.  The file appears under its name only when it is complete.
    """
    from openswim.colour.exposure import check_exposure

    check_writable(path, view=getattr(image, "attrs", {}).get("view"))
    path = Path(path)
    check_exposure(exposure)
    caption = check_caption(caption)
    suffix = path.suffix.lower()
    if suffix in PICTURES:
        of_rgb = {
            "matrix": matrix, "gamma": gamma, "roll_off": roll_off, "dither": dither, "glare": glare, "bits": bits,
            "eye": eye,
        }  # fmt: skip
        _save_picture(image, path, exposure, caption, of_rgb)
    elif not isinstance(image, xr.Dataset):
        raise UserError(f"image is {shown(image)}: give {path.name} the whole Dataset, as openswim.render returns it")
    elif suffix in DATA:
        with written_whole(path) as partial:
            (_write_netcdf if suffix == ".nc" else _write_zarr)(image, partial)
    else:
        from openswim.colour.hdr import save_light_picture

        save_light_picture(image, path)


def check_caption(caption: Any) -> str:
    """ "inside", "below" or "none"; True and False are "below" and "none"."""
    caption = {True: "below", False: "none"}.get(caption, caption) if isinstance(caption, bool) else caption
    check_choice("caption", caption, CAPTIONS)
    return str(caption)


def check_bits(path: Path, bits: int) -> None:
    """Raise UserError where a picture's format does not take so many bits a colour."""
    if bits == 16 and path.suffix.lower() in (".jpg", ".jpeg"):
        raise UserError(f"output {path}: JPEG has 8 bits a colour; write .png or .tif for 16")


def _save_picture(
    image: xr.Dataset | xr.DataArray, path: Path, exposure: Any, caption: str, options: dict[str, Any]
) -> None:
    from openswim.colour.caption import facts, with_strip
    from openswim.colour.rgb import exposure_for, to_rgb

    check_bits(path, options["bits"])
    exposure = exposure_for(image, exposure, options["glare"])
    picture = to_rgb(image, exposure, **options)
    entries = facts(image, exposure)
    if caption != "none" and entries:
        picture = with_strip(picture, entries, inside=caption == "inside")
    with written_whole(path) as partial:
        write_picture(picture, partial, entries)


def write_picture(picture: np.ndarray, path: Path, entries: dict[str, str]) -> None:
    """Write uint8 or uint16 (y, x, 3) with the entries as metadata: PNG text, or the description of a JPEG or TIFF."""
    from PIL import Image
    from PIL.PngImagePlugin import PngInfo

    from openswim.colour import sixteen

    if picture.dtype == np.uint16:
        path.write_bytes((sixteen.png if path.suffix.lower() == ".png" else sixteen.tiff)(picture, _texts(entries)))
        return
    drawn, encoded = Image.fromarray(picture), BytesIO()  # Pillow's own writer does not tell of a full disk
    texts = _texts(entries)
    description = texts["Description"]
    suffix = path.suffix.lower()
    if suffix == ".png":
        text = PngInfo()
        for key, value in texts.items():
            text.add_itxt(key, value)
        drawn.save(encoded, "PNG", pnginfo=text)
    elif suffix in (".jpg", ".jpeg"):
        exif = Image.Exif()
        exif[270], exif[305] = description, "OpenSWIm"  # ImageDescription, Software
        drawn.save(encoded, "JPEG", quality=95, subsampling=0, exif=exif)
    else:
        drawn.save(encoded, "TIFF", compression="tiff_deflate", tiffinfo={270: description, 305: "OpenSWIm"})
    path.write_bytes(encoded.getvalue())


def _texts(entries: dict[str, str]) -> dict[str, str]:
    description = "; ".join(f"{key}: {value}" for key, value in entries.items())
    return {"Software": "OpenSWIm", "Description": description, **entries}


def _write_netcdf(image: xr.Dataset, path: Path) -> None:
    storable = _storable(image)
    numeric = [name for name, field in storable.variables.items() if field.ndim and field.dtype.kind in "fiu"]
    storable.to_netcdf(path, encoding={name: {"zlib": True, "complevel": 4, "shuffle": True} for name in numeric})


def _write_zarr(image: xr.Dataset, path: Path) -> None:
    _storable(image).to_zarr(path, zarr_format=2, consolidated=True)  # as scenes are


def _storable(image: xr.Dataset) -> xr.Dataset:
    """A copy whose attributes files can hold: no None, dates and truth values as text and numbers."""

    def plain(value: Any) -> Any:
        if isinstance(value, (bool, np.bool_)):
            return int(value)
        return value if isinstance(value, (str, int, float, list, tuple, np.ndarray, np.number)) else str(value)

    stored = image.copy(deep=False)
    stored.attrs = {"Conventions": "CF-1.11", **image.attrs}
    stored.attrs = {key: plain(value) for key, value in stored.attrs.items() if value is not None}
    for field in stored.variables.values():
        field.attrs = {key: plain(value) for key, value in field.attrs.items() if value is not None}
    return stored
