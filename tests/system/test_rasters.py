"""Images that GDAL opens: in one file, or in files beside it."""

import os
from pathlib import Path

import numpy as np
import pytest

from openswim.cameras.picture_files import read_picture
from openswim.errors import UserError
from openswim.ground.raster import Raster
from openswim.satellites.files import read
from openswim.system.rasters import open_raster

rasterio = pytest.importorskip("rasterio")

VRT = """<VRTDataset rasterXSize="4" rasterYSize="4"><SRS>EPSG:4326</SRS><GeoTransform>7,1,0,47,0,-1</GeoTransform>
<VRTRasterBand dataType="Byte" band="1"><SimpleSource><SourceFilename>{}</SourceFilename><SourceBand>1</SourceBand>
</SimpleSource></VRTRasterBand></VRTDataset>"""
WMS = "<!-- {} --><GDAL_WMS><Service name='TMS'><ServerUrl>http://127.0.0.1:9/</ServerUrl></Service></GDAL_WMS>"
ISIS = """Object = IsisCube
  Object = Core
    ^Core = {}
    StartByte = 1
    Format = BandSequential
    Group = Dimensions
      Samples = 4
      Lines = 4
      Bands = 1
    End_Group
    Group = Pixels
      Type = UnsignedByte
      ByteOrder = Lsb
      Base = 0.0
      Multiplier = 1.0
    End_Group
  End_Object
End_Object
End
"""


@pytest.mark.parametrize("text", [VRT, WMS, ISIS])
@pytest.mark.parametrize("opens", [open_raster, Raster, read])
def test_what_only_names_files_elsewhere_is_not_followed(tmp_path: Path, text: str, opens) -> None:
    secret, folder = tmp_path / "secret", tmp_path / "maps"
    secret.write_bytes(bytes(range(16)))
    folder.mkdir()
    (folder / "map.tif").write_text(text.format("../secret" if text is ISIS else secret))
    with pytest.raises(UserError, match=r"map\.tif.*(other files|its folder|Path traversal)"):
        opens(folder / "map.tif")


def test_a_pipe_is_no_image_and_a_geotiff_is_one(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe.tif")
    with pytest.raises(UserError, match="pipe"):
        open_raster(tmp_path / "pipe.tif")
    deep = tmp_path / "deep.tif"
    with rasterio.open(deep, "w", driver="GTiff", count=3, height=4, width=5, dtype="uint16", crs="EPSG:4326",
                       transform=rasterio.Affine(1, 0, 7, 0, -1, 47), photometric="RGB") as file:  # fmt: skip
        file.write(np.full((3, 4, 5), 300, np.uint16))
    with open_raster(deep) as file:
        assert file.shape == (4, 5)
    (tmp_path / "linked").mkdir()
    (tmp_path / "linked" / "link.tif").symlink_to(deep)
    with open_raster(tmp_path / "linked" / "link.tif") as file:
        assert file.shape == (4, 5)
    assert (read_picture(deep).counts == 300).all()


def test_a_picture_from_space_of_endless_size_is_refused(tmp_path: Path) -> None:
    """Rows that a sparse file claims cost nothing on disk."""
    crs = "+proj=geos +lon_0=-75 +h=35786023 +a=6378137 +b=6356752.31414 +sweep=x"
    with rasterio.open(tmp_path / "s.tif", "w", driver="GTiff", count=1, height=200_000, width=200_000, dtype="uint8",
                       crs=crs, transform=rasterio.Affine(10, 0, 0, 0, -10, 0), tiled=True, compress="deflate",
                       sparse_ok=True, blockxsize=4096, blockysize=4096):  # fmt: skip
        pass
    with pytest.raises(UserError, match=r"s\.tif: 200000 x 200000 pixels take"):
        read(tmp_path / "s.tif")
