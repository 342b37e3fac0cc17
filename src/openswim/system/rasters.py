"""Images that GDAL reads, opened within bounds: none that is only a description of other files or of servers."""

from __future__ import annotations

import warnings
from pathlib import Path
from typing import Any

from openswim.errors import UserError
from openswim.system.inputs import check_name, check_ordinary, check_within

_BY_OTHERS = ("VRT", "GTI", "WMS", "WMTS", "WCS")  # GDAL's drivers of images that lie elsewhere
_REMEDY = "make one GeoTIFF of it (gdal_translate)"


def open_raster(path: Path, extra: str = "geotiff") -> Any:
    """The rasterio dataset of a file; raises UserError. extra: of the package, which brings rasterio."""
    try:
        import rasterio
    except ImportError:
        raise UserError(f"{path}: reading it needs rasterio: pip install 'openswim[{extra}]'") from None
    check_ordinary(path)
    check_name(path)
    try:
        if path.is_file():
            with path.open("rb") as stream:
                head = stream.read(1000).lstrip(b"\xef\xbb\xbf \t\r\n")
            if head[:1] in (b"<", b"{"):  # looked at first, since some drivers ask servers as they open
                raise UserError(f"{path}: describes an image that lies in other files: {_REMEDY}")
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", rasterio.errors.NotGeoreferencedWarning)
            file = rasterio.open(path)
    except (rasterio.errors.RasterioError, OSError) as error:
        why = str(error).strip().split("\n")[0]
        raise UserError(f"{path}: not an image that GDAL can read ({why})") from None
    try:
        if file.driver in _BY_OTHERS:
            raise UserError(f"{path}: describes an image that lies in other files: {_REMEDY}")
        for each in map(Path, file.files):
            if each != path:  # which may be a link to anywhere
                check_within(each, path.parent, f"{path}: {each}", f"its folder: {_REMEDY}")
    except UserError:
        file.close()
        raise
    return file
