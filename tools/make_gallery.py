"""Make docs/images/gallery/*.jpg: each real model file from the ground and from above (docs/gallery.md).

    python tools/make_gallery.py ../shared/data/nwp [name ...]

Files of midnight are shown in the light of noon there.
"""

import sys
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from openswim import Camera, Solver, open_scene, render
from openswim.cli.render import framed
from openswim.colour import save
from openswim.readers.domain.neighbourhood import Neighbourhood, reach_m

TARGET = Path(__file__).parents[1] / "docs/images/gallery"
PANORAMA, SPACE = (200, 480), (400, 400)


@dataclass(frozen=True)
class Picture:
    """A file, a camera's view and its options, and the time of its sun where that is not the file's."""

    name: str
    file: str
    view: str
    camera: dict[str, Any]
    time: str | None = None
    sun_time: str | None = None
    framed: bool = False
    quality: str = "standard"


def ground(name: str, file: str, lat: float, lon: float, azimuth: float = 180.0, **more: Any) -> Picture:
    camera = {"lat": lat, "lon": lon, "height_m": 2.0, "azimuth_deg": azimuth, "size": PANORAMA}
    return Picture(f"{name}_ground", file, "panorama", camera, **more)


def space(name: str, file: str, lat: float, lon: float, height_m: float, **more: Any) -> Picture:
    camera = {"lat": lat, "lon": lon, "height_m": height_m, "size": SPACE}
    return Picture(f"{name}_space", file, "satellite", camera, **more)


def large_eddy(name: str, file: str, lat: float, lon: float, wide_m: float) -> list[Picture]:
    """A domain without a place, laid around one: from below, and from above on the slant."""
    here = {"lat": lat, "lon": lon}
    above = here | {"height_m": 1.1 * wide_m, "azimuth_deg": 20.0, "altitude_deg": -75.0, "fov_deg": 60.0,
                    "size": (300, 400)}  # fmt: skip
    return [ground(name, file, lat, lon), Picture(f"{name}_space", file, "perspective", above)]


GFS, ERA5 = "gfs_2011-10-08_f072.grib1", "era5_europe_2019-01-01.nc"
IFS, UM, GEFS = "ifs_meridian_columns.nc", "um_cosp_input_2d.nc", "gefs.chem.20240309t00z.a2d_0p25.f000.subset.grib2"
KATRINA, TIBET, ALPS = (
    "wrfout_katrina_2005-08-28.nc", "wrfout_tibet_2005-09-21.nc", "wrfinput_switzerland_2023-01-15.nc",
)  # fmt: skip
HRRR, SMOKE = "hrrr2d/hrrr_20180722t15z_wrfsfcf01_RMEidaho.grib2", "hrrr2d/hrrr_20260301t00z_MASSDEN_8m.grib2"
PICTURES = [
    ground("gfs", GFS, -38.0, 178.0, 0.0),
    space("gfs", GFS, -7.0, 178.0, 1.5e9, quality="high"),
    space("gfs_geo", GFS, 0.0, -75.0, 35_786_000.0, sun_time="2011-10-11T17:00", quality="high"),
    ground("era5", ERA5, 50.0, -8.0),
    space("era5", ERA5, 47.5, 4.0, 1.2e6, framed=True),
    space("era5_geo", ERA5, 0.0, 0.0, 35_786_000.0),
    ground("ifs", IFS, -12.0, 135.0, 90.0),
    space("ifs", IFS, 0.0, 135.0, 35_786_000.0),
    ground("um", UM, 45.0, 15.0),
    space("um", UM, 45.0, 15.0, 2e6, framed=True, quality="high"),
    ground("katrina", KATRINA, 24.5, -90.0, time="2005-08-28T18:00"),
    space("katrina", KATRINA, 23.75, -89.5, 7e5, time="2005-08-28T18:00", framed=True),
    ground("tibet", TIBET, 30.0, 87.0, time="2005-09-21T06:00"),
    space("tibet", TIBET, 30.0, 87.0, 7e5, time="2005-09-21T06:00", framed=True),
    ground("alps", ALPS, 46.65, 8.55, sun_time="2023-01-15T11:00"),
    space("alps", ALPS, 46.65, 8.55, 7e5, sun_time="2023-01-15T11:00", framed=True),
    ground("gefs", GEFS, 15.0, 10.0, sun_time="2024-03-09T10:00"),
    space("gefs", GEFS, 10.0, 25.0, 35_786_000.0, sun_time="2024-03-09T10:00"),
    ground("hrrr", HRRR, 43.0, -116.5),
    space("hrrr", HRRR, 43.0, -116.5, 7e5, framed=True),
    ground("smoke", SMOKE, 34.0, -84.0, sun_time="2026-03-01T20:00"),
    space("smoke", SMOKE, 36.0, -95.0, 4e6, sun_time="2026-03-01T20:00"),
    ground("rams", "rams_clear_2019-07-02.h5", 72.6, -38.6),
    *large_eddy("rico", "les_rico_122x106x39.txt", 18.0, -61.5, 2400.0),
    *large_eddy("stratocumulus", "les_stratocumulus_64x64x16.txt", 31.0, -121.0, 3500.0),
]


def make(picture: Picture, folder: Path) -> None:
    """Render one picture."""
    begin = time.process_time()
    camera = getattr(Camera, picture.view)(**picture.camera)
    around = None
    if "lat" in picture.camera:
        reach = reach_m(picture.camera["height_m"])
        around = Neighbourhood(picture.camera["lat"], picture.camera["lon"], reach, if_large=True)
    scene = open_scene(folder / picture.file, time=picture.time, around=around)
    if picture.framed:
        camera = framed(camera, scene)
    image = render(scene, camera, Solver("fast", quality=picture.quality), time=picture.sun_time)
    path = TARGET / f"{picture.name}.jpg"
    save(image, path, caption="below")
    print(f"{path.name}: {path.stat().st_size / 1e3:.0f} kB, {time.process_time() - begin:.0f} s", flush=True)


def main(folder: str, *names: str) -> None:
    TARGET.mkdir(parents=True, exist_ok=True)
    for picture in PICTURES:
        if not names or any(picture.name.startswith(name) for name in names):
            try:
                make(picture, Path(folder))
            except Exception as error:
                print(f"{picture.name}: {type(error).__name__}: {error}", flush=True)


if __name__ == "__main__":
    main(*sys.argv[1:])
