"""Counts in picture files: JPEG, PNG, JPEG 2000, TIFF, FITS, and the raw files of cameras."""

import contextlib
import stat
import warnings
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from openswim.cameras.fits import is_fits, read_fits
from openswim.errors import UserError
from openswim.system.rasters import open_raster

RAW = (".arw", ".cr2", ".cr3", ".dng", ".nef", ".orf", ".raf", ".rw2", ".pef", ".srw")
MOST_PIXELS = 400_000_000
MOST_BYTES = 4_000_000_000
_SAMPLED = ("I;16", "I;16B", "I;16L", "I", "F", "L", "RGB")
_BITS_PER_SAMPLE = 258  # tag of TIFF
_ORIENTATION = 274  # tag of EXIF and TIFF
# what is done, in this order, to a picture with that orientation: rows and columns change places, are turned round
_UPRIGHT = {
    2: (False, False, True), 3: (False, True, True), 4: (False, True, False), 5: (True, False, False),
    6: (True, False, True), 7: (True, True, True), 8: (True, True, False),
}  # fmt: skip


@dataclass(frozen=True)
class Picture:
    """Counts as the file has them, (ny, nx) or (ny, nx, 3), row 0 on top (of FITS: the first in the file).

    On top is what viewers show there: by the orientation that the file states, in EXIF or a tag of TIFF.
    """

    counts: NDArray[Any]
    full_scale: float  # the count at which the format ends
    header: dict[str, Any] = field(default_factory=dict)  # of FITS
    exif: dict[str, str] = field(default_factory=dict)

    @property
    def shape(self) -> tuple[int, int]:
        return self.counts.shape[0], self.counts.shape[1]


def read_picture(path: Path | str) -> Picture:
    """The picture in a file, told by its content; raises UserError in one line."""
    path = Path(path)
    head = _head(path)
    if path.suffix.lower() in RAW:
        return _guarded(path, _read_raw)
    if is_fits(head, path):
        return _guarded(path, read_fits_picture)
    deep_png = head[:8] == b"\x89PNG\r\n\x1a\n" and head[24:26] in (b"\x10\x02", b"\x10\x04", b"\x10\x06")
    if deep_png:
        return _guarded(path, _read_deep)  # Pillow would make 8 bits of it without a word
    return _guarded(path, _read_pillow)


def _head(path: Path) -> bytes:
    try:
        status = path.stat()
        if not stat.S_ISREG(status.st_mode):
            raise UserError(f"{path}: is no file: give a picture")
        if status.st_size > MOST_BYTES:
            raise UserError(f"{path}: is larger than {MOST_BYTES / 1e9:g} GB: give a single picture")
        with path.open("rb") as stream:
            return stream.read(64)
    except (OSError, ValueError) as error:
        why = getattr(error, "strerror", None) or error
        raise UserError(f"{path}: cannot be read ({why})") from None


def _guarded(path: Path, read: Callable[[Path], Picture]) -> Picture:
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            return read(path)
    except UserError:
        raise
    except MemoryError:
        raise UserError(f"{path}: takes more memory than there is") from None
    except Exception as error:  # whatever decoders raise on damaged files
        text = " ".join(str(error).split()).replace(str(path), "it")[:120]
        raise UserError(f"{path}: cannot be read as a picture ({text}): damaged, or of an unknown format") from error


def read_fits_picture(path: Path) -> Picture:
    """FITS with two axes, or three colours in the third."""
    header, counts = read_fits(path)
    if counts.ndim == 3 and counts.shape[0] == 1:
        counts = counts[0]
    if counts.ndim == 3 and counts.shape[0] == 3:
        counts = np.moveaxis(counts, 0, -1)
    if counts.ndim != 2 and counts.shape[-1:] != (3,):
        raise UserError(f"{path}: holds an array of {counts.shape}: give a picture in one channel or in three")
    bits = int(header["BITPIX"])
    return Picture(counts, float(2**bits - 1), header) if bits > 0 else Picture(*_of_decimals(counts), header)


def _of_decimals(counts: NDArray[Any]) -> tuple[NDArray[Any], float]:
    """Counts, those that overflowed as the brightest that did not, and what that is: their full scale."""
    known = counts[np.isfinite(counts)]
    most = known.max() if known.size else counts.dtype.type(0)
    return np.minimum(counts, most), float(most)


def _read_pillow(path: Path) -> Picture:
    from PIL import Image, UnidentifiedImageError

    with contextlib.ExitStack() as both:
        # a stream, not a path: of a TIFF mapped into memory Pillow 13 takes the width of the upright picture for stored
        stream = both.enter_context(path.open("rb"))
        try:
            image: Image.Image = both.enter_context(Image.open(stream))
        except UnidentifiedImageError:
            if _head(path)[:4] in (b"II*\0", b"MM\0*", b"II+\0", b"MM\0+"):
                return _read_deep(path)
            told = "is no picture that can be read: JPEG, PNG, JPEG 2000, TIFF, FITS or raw"
            raise UserError(f"{path}: {told}") from None
        _check_size(path, image.width, image.height)
        bits = getattr(image, "tag_v2", {}).get(_BITS_PER_SAMPLE, 8) if image.format == "TIFF" else 8
        if image.mode in ("RGB", "RGBA", "RGBX") and np.max(bits) > 8:
            return _read_deep(path)  # Pillow makes 8 bits of interleaved ones without a word
        image.load()  # with which Pillow turns a TIFF, and takes its orientation away
        turn, exif = _orientation(image), _exif(image)
        if image.has_transparency_data:
            every = _upright(np.asarray(image.convert("RGBA")), turn)
            return Picture(every[..., :3] * (every[..., 3:] == 255), 255.0, exif=exif)  # what is cut out is black
        if image.mode not in _SAMPLED:
            one = image.mode in ("1", "LA", "La")
            image = image.convert("L" if one else "RGB")
        counts = _upright(np.asarray(image), turn)
        if image.mode == "F":
            return Picture(*_of_decimals(counts), exif=exif)
        if image.mode == "I":
            return Picture(counts, 65535.0, exif=exif)
        return Picture(counts, 65535.0 if counts.dtype.itemsize == 2 else 255.0, exif=exif)


def _read_deep(path: Path) -> Picture:
    """Sixteen bits in three channels, or with a share of transparency."""
    with open_raster(path, "cameras") as data:
        _check_size(path, data.width, data.height)
        bands = data.read(list(range(1, 4)) if data.count >= 3 else [1])
        if data.colorinterp[-1].name == "alpha":
            whole = data.read(data.count)
            bands = bands * (whole == np.iinfo(whole.dtype).max)
    counts = _upright(bands[0] if len(bands) == 1 else np.moveaxis(bands, 0, -1), _orientation_of_file(path))
    if counts.dtype.kind == "u":
        return Picture(counts, float(np.iinfo(counts.dtype).max))
    return Picture(*_of_decimals(counts))


def _upright(counts: NDArray[Any], orientation: int) -> NDArray[Any]:
    """Counts as viewers show them, of those stored with an orientation (EXIF 2.32, tag 274: 1 to 8)."""
    transposed, rows, columns = _UPRIGHT.get(orientation, (False, False, False))
    counts = np.swapaxes(counts, 0, 1) if transposed else counts
    return np.ascontiguousarray(counts[:: -1 if rows else 1, :: -1 if columns else 1])


def _orientation(image: Any) -> int:
    """Of an opened image; 1, upright, where it states none."""
    try:
        return int(image.getexif().get(_ORIENTATION, 1))
    except Exception:  # damaged metadata do not spoil the picture
        return 1


def _orientation_of_file(path: Path) -> int:
    """Of a file whose pixels Pillow does not read as they are, or not at all."""
    from PIL import Image, UnidentifiedImageError

    try:
        with Image.open(path) as image:
            return _orientation(image)
    except UnidentifiedImageError:  # a TIFF, whose tags are laid out as EXIF is
        tags = Image.Exif()
    try:
        with path.open("rb") as stream:
            tags.load_from_fp(stream)
        return int(tags.get(_ORIENTATION, 1))
    except Exception:  # likewise
        return 1


def _read_raw(path: Path) -> Picture:
    """Linear counts: the sensor's, in the camera's own primaries, without white balance or gamma; upright."""
    try:
        import rawpy
    except ImportError:
        raise UserError(f"{path}: raw files need rawpy: pip install 'openswim[cameras]'") from None
    with rawpy.imread(str(path)) as raw:
        _check_size(path, raw.sizes.width, raw.sizes.height)
        counts = raw.postprocess(
            gamma=(1, 1), no_auto_bright=True, output_bps=16, use_camera_wb=False, user_wb=[1, 1, 1, 1],
            output_color=rawpy.ColorSpace.raw, adjust_maximum_thr=0.0,  # else the brightest pixel becomes white
        )  # fmt: skip
    return Picture(counts, 65535.0)


def _check_size(path: Path, width: int, height: int) -> None:
    if width * height > MOST_PIXELS:
        raise UserError(f"{path}: {width}x{height} pixels are more than {MOST_PIXELS:.0e}: give a smaller picture")


def _exif(image: Any) -> dict[str, str]:
    """When the picture was taken, as the camera wrote it, and what it said of the zone and the exposure."""
    try:
        tags = image.getexif()
        more = tags.get_ifd(0x8769)
    except Exception:  # damaged metadata do not spoil the picture
        return {}
    names = {0x9003: "DateTimeOriginal", 0x9011: "OffsetTimeOriginal", 0x829A: "ExposureTime", 0x9291: "SubSecTime"}
    found = {name: str(more[tag]).strip("\0 ") for tag, name in names.items() if tag in more}
    if 306 in tags and "DateTimeOriginal" not in found:
        found["DateTimeOriginal"] = str(tags[306]).strip("\0 ")
        if 0x9010 in more:
            found["OffsetTimeOriginal"] = str(more[0x9010]).strip("\0 ")
    return found


