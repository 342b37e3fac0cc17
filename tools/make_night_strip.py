"""Make the pictures of docs/all-hours.md: days by the hour, an eclipse by the minute, alpenglow, a city at night.

    python tools/make_night_strip.py [new full eclipse corona alps city] [--to folder]
"""

import argparse
import importlib.util
import tempfile
from collections.abc import Callable, Iterable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray
from PIL import Image, ImageDraw, ImageFont

import openswim
from openswim.colour import to_rgb
from openswim.colour.exposure import camera_exposure
from openswim.colour.rgb import auto_exposure
from openswim.films.keogram import keogram
from openswim.lights.eclipses import solar_eclipse
from openswim.scene.atmosphere import Atmosphere
from openswim.scene.frame import horizon_vector
from openswim.scene.procedural import demo_scene
from openswim.solver import Solver
from openswim.validation.night.whole_day import WAVELENGTHS_NM, Skies

TARGET = Path(__file__).parents[1] / "docs/images"
MOST_BYTES = 199_000
DAYS = {"new": "2024-06-06", "full": "2024-09-17"}  # with a new and a full moon, each from noon to noon
PLACE = 46.8, 11.0
BURGOS = 42.35, -3.70  # in the shadow's path on 2026-08-12, with the sun 8 degrees high
MINUTES = (-10.0, -3.0, -1.5, -0.8, 0.0, 0.8, 1.5, 3.0, 10.0)
BERLIN, OUTSIDE = (52.52, 13.40), (52.40, 13.40)
BACK = (8, 10, 14)
EVERY = np.timedelta64(4, "m")  # of the keograms


def clouds(place: tuple[float, float], time: str, cover: float = 0.35) -> openswim.Scene:
    """Broken cumulus over hills, 24 x 12 km."""
    return demo_scene(
        96, 48, 32, spacing_m=250.0, latitude=place[0], longitude=place[1], time=time, cloud_cover=cover
    )


def by_the_hour(which: str) -> NDArray[np.uint8]:
    """24 panoramas, from noon on, and a keogram of the clear sky of the same day."""
    scene, images = clouds(PLACE, f"{DAYS[which]}T12:00"), []
    camera = openswim.Camera.panorama(*PLACE, 2.0, size=(84, 320))
    for hour in range(24):
        time = np.datetime64(f"{DAYS[which]}T11:00") + np.timedelta64(hour, "h")
        images.append(openswim.light(scene, Solver(quality="preview"), time=time).viewpoint(camera).view())
        print(time, images[-1].attrs["illuminance_lx"], images[-1].attrs.get("lights", ""), flush=True)
    pictures = developed(images, 0.95)
    shown = [labelled(picture, f"{image.attrs['light_time'][11:16]}  {lux(image)}")
             for picture, image in zip(pictures, images, strict=True)]  # fmt: skip
    return stacked([tiled(shown, 4), clear_keogram(DAYS[which], 4 * 320 + 3 * 4)])


def clear_keogram(day: str, width: int, height: int = 100) -> NDArray[np.uint8]:
    """The clear sky above the south, from the horizon to the zenith, every few minutes from 10:30 on for a day."""
    skies = Skies.over(*PLACE)
    altitude = np.linspace(90.0, 0.3, height)
    south = horizon_vector(np.full(height, 180.0), altitude)
    times = np.datetime64(f"{day}T10:30") + EVERY * np.arange(round(np.timedelta64(24, "h") / EVERY))
    lines = []
    for time in times:
        seen = xr.DataArray(skies.toward(time, south)[:, None], dims=("y", "x", "wavelength"),
                            coords={"wavelength": WAVELENGTHS_NM})  # fmt: skip
        lines.append(seen)
    return keogram([picture[:, 0] for picture in developed(lines, 0.95)], width)


def by_the_minute() -> NDArray[np.uint8]:
    """Around totality, from the ground."""
    eclipse = solar_eclipse("2026-08-12T18:28", *BURGOS)
    assert eclipse is not None
    scene = clouds(BURGOS, "2026-08-12T18:00")
    camera = openswim.Camera.panorama(*BURGOS, 2.0, size=(105, 400))
    images = []
    for minute in MINUTES:
        time = eclipse.greatest + np.timedelta64(round(60_000 * minute), "ms")
        images.append(openswim.light(scene, Solver(quality="preview"), time=time).viewpoint(camera).view())
        print(time, images[-1].attrs["illuminance_lx"], flush=True)
    shown = [labelled(picture, f"{60 * minute:+.0f} s  {lux(image)}")
             for minute, picture, image in zip(MINUTES, developed(images, 0.8), images, strict=True)]  # fmt: skip
    return tiled(shown, 3)


def developed(images: list[Any], share: float) -> list[NDArray[np.uint8]]:
    """Pictures whose exposures follow the light, but not all the way: by a share of what is dark, in the logarithm."""
    best = [auto_exposure(image) for image in images]
    return [to_rgb(image, exposure=float(best[0] ** (1 - share) * own**share))
            for image, own in zip(images, best, strict=True)]  # fmt: skip


def lux(image: Any) -> str:
    """What falls on the ground, in two digits."""
    found = float(image.attrs["illuminance_lx"])
    return f"{float(f'{found:.2g}'):,.0f} lx" if found >= 10 else f"{found:.2g} lx"


def corona() -> NDArray[np.uint8]:
    """Through a lens of 600 mm: a minute before totality, at its begin, and in its middle (Texas, 2024)."""
    place = 31.0, -99.0
    eclipse = solar_eclipse("2024-04-08T18:40", *place)
    assert eclipse is not None
    assert eclipse.second is not None
    scene, pictures = openswim.Scene.clear(*place), []
    for time, exposure in (
        (eclipse.second - np.timedelta64(600, "s"), 3e-6),
        (eclipse.second - np.timedelta64(3, "s"), 4e-4),
        (eclipse.greatest, 2.0),
        (eclipse.greatest, 60.0),
    ):
        lit = openswim.light(scene, time=time)
        sun = lit.viewpoint(openswim.Camera.allsky(*place, size=9)).sun
        camera = openswim.Camera.perspective(*place, azimuth_deg=sun[0], altitude_deg=sun[1], fov_deg=3.0,
                                             size=(320, 320))  # fmt: skip
        image = lit.viewpoint(camera).view()
        pictures.append(labelled(to_rgb(image, exposure=exposure), f"{str(time)[11:19]}  exposure {exposure:g}"))
        print(time, flush=True)
    return tiled(pictures, 4)


def alps() -> NDArray[np.uint8]:
    """Made-up mountains of tools/make_relief_picture.py at dawn."""
    spec = importlib.util.spec_from_file_location("relief", Path(__file__).with_name("make_relief_picture.py"))
    assert spec is not None
    assert spec.loader is not None
    relief: Any = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(relief)
    height = relief.mountains()
    pictures = []
    with tempfile.TemporaryDirectory() as folder:
        ground = openswim.Ground(
            relief.write(Path(folder) / "albedo.tif", relief.cover(height)),
            relief.write(Path(folder) / "dem.tif", height[None]),
        )
        scene = replace(relief.model(height), ground=ground)
        camera = openswim.Camera.perspective(
            *relief.EYE, 60.0, azimuth_deg=297.0, altitude_deg=4.0, fov_deg=55.0, size=(260, 424)
        )
        for time in ("2024-11-05T05:50", "2024-11-05T06:04", "2024-11-05T06:18"):
            image = openswim.light(scene, time=time).viewpoint(camera).view()
            sun = float(image.attrs["sun_altitude_deg"])
            pictures.append(labelled(to_rgb(image), f"sun {sun:+.1f} degrees"))
            print(time, sun, image.attrs["illuminance_lx"], flush=True)
    return tiled(pictures, len(pictures))


def city_sky(depth: float) -> openswim.Scene:
    """Berlin and what is around it, 80 km wide, under a layer of cloud of an optical depth."""
    from pyproj import CRS

    x, z = np.linspace(-40e3, 40e3, 41), np.concatenate([np.arange(0.0, 2600.0, 200.0), [4e3, 8e3, 12e3]])
    extinction = np.zeros((len(z), len(x), len(x)), np.float32)
    extinction[(z > 700) & (z < 1700)] = depth / 1000.0
    crs = CRS.from_proj4(f"+proj=laea +lat_0={BERLIN[0]} +lon_0={BERLIN[1]} +R=6371000 +units=m")
    return openswim.Scene.from_arrays(extinction, x, x, z, crs=crs, atmosphere=Atmosphere.us_standard())


def city() -> NDArray[np.uint8]:
    """From 13 km south of its middle, clear and overcast, exposed alike, without a moon."""
    camera = openswim.Camera.perspective(*OUTSIDE, 250.0, azimuth_deg=0.0, altitude_deg=14.0, fov_deg=75.0,
                                         size=(320, 640))  # fmt: skip
    pictures = []
    for name, depth in (("clear", 0.0), ("overcast", 15.0)):
        lit = openswim.light(city_sky(depth), Solver(quality="preview"), time="2024-02-09T23:00")
        image = lit.viewpoint(camera).view()
        exposure = camera_exposure(seconds=8, f_number=2.8, iso=1600)
        pictures.append(labelled(to_rgb(image, exposure), f"{name}  {lux(image)}"))
        print(name, image.attrs["illuminance_lx"], flush=True)
    return tiled(pictures, len(pictures))


def labelled(picture: NDArray[np.uint8], text: str) -> NDArray[np.uint8]:
    """With a line of text in its lower left corner."""
    made = Image.fromarray(picture)
    pen, font = ImageDraw.Draw(made), ImageFont.load_default(11)
    pen.text((5, made.height - 16), text, (255, 255, 255), font=font, stroke_width=1, stroke_fill=(0, 0, 0))
    return np.asarray(made)


def tiled(pictures: Iterable[NDArray[np.uint8]], across: int, gap: int = 4) -> NDArray[np.uint8]:
    """Pictures of one size in rows of so many."""
    every = list(pictures)
    ny, nx = every[0].shape[:2]
    rows = -(-len(every) // across)
    out = np.full((rows * (ny + gap) - gap, across * (nx + gap) - gap, 3), BACK, np.uint8)
    for n, each in enumerate(every):
        j, i = divmod(n, across)
        out[j * (ny + gap) : j * (ny + gap) + ny, i * (nx + gap) : i * (nx + gap) + nx] = each
    return out


def stacked(parts: list[NDArray[np.uint8]], gap: int = 4) -> NDArray[np.uint8]:
    """One above the other."""
    line = np.full((gap, parts[0].shape[1], 3), BACK, np.uint8)
    return np.concatenate([each for part in parts for each in (part, line)][:-1])


MADE: dict[str, tuple[str, Callable[[], NDArray[np.uint8]]]] = {
    "new": ("hours_new_moon.jpg", lambda: by_the_hour("new")),
    "full": ("hours_full_moon.jpg", lambda: by_the_hour("full")),
    "eclipse": ("eclipse_minutes.jpg", by_the_minute),
    "corona": ("eclipse_corona.jpg", corona),
    "alps": ("alpenglow.jpg", alps),
    "city": ("city_sky.jpg", city),
}


def save(picture: NDArray[np.uint8], path: Path) -> None:
    """As good as it may be in so many bytes."""
    for quality in (92, 88, 84, 78, 70, 60):
        Image.fromarray(picture).save(path, quality=quality)
        if path.stat().st_size < MOST_BYTES:
            break
    print(f"{path}: {path.stat().st_size / 1e3:.0f} kB", flush=True)


def main() -> None:
    options = argparse.ArgumentParser(description=__doc__)
    options.add_argument("which", nargs="*", default=list(MADE), choices=list(MADE))
    options.add_argument("--to", type=Path, default=TARGET)
    chosen = options.parse_args()
    for which in chosen.which:
        name, make = MADE[which]
        save(make(), chosen.to / name)


if __name__ == "__main__":
    main()
