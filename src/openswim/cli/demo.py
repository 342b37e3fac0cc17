"""`openswim demo`: four pictures of a procedural summer sky."""

import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import TYPE_CHECKING

import click

from openswim.cli import ahead
from openswim.errors import UserError

if TYPE_CHECKING:
    import xarray as xr

    from openswim.cameras import Camera
    from openswim.rendering import LitScene
    from openswim.scene import Scene


def run(folder: Path) -> None:
    """Make the scene, render it four times, write four PNGs; print timings and irradiance."""
    from openswim.colour import check_writable

    start = time.perf_counter()
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise UserError(
            f"{folder}: cannot be made ({error.strerror}); choose another folder with -o"
        ) from None
    check_writable(folder / "demo_allsky.png")

    with ThreadPoolExecutor(2) as others:
        begun = others.submit(ahead.begin)
        others.submit(ahead.load)
        from openswim.scene.procedural import demo_scene

        scene = demo_scene()
        click.echo(f"scene: {scene.source}, {time.perf_counter() - start:.1f} s")
        begun.result()
        from openswim.cli.render import irradiance_line
        from openswim.rendering import light

        began = time.perf_counter()
        lit = light(scene)
        click.echo(f"light: solved once for all four pictures, {time.perf_counter() - began:.1f} s")
        began = time.perf_counter()
        # what a picture needs before and after its rays are marched, while those of another are
        pictures = {
            name: others.submit(_picture, lit, camera, folder / f"demo_{name}.png")
            for name, camera in cameras(scene).items()
        }
        try:
            for name, picture in pictures.items():
                image, path = picture.result()
                click.echo(f"{path}: {time.perf_counter() - began:.1f} s")
                if name == "allsky":
                    click.echo(irradiance_line(image))
        finally:
            others.shutdown(cancel_futures=True)
    click.echo(f"in all: {time.perf_counter() - start:.1f} s")


def _picture(lit: "LitScene", camera: "Camera", path: Path) -> "tuple[xr.Dataset, Path]":
    """Render and write one of the pictures."""
    import openswim
    from openswim.cli.render import write

    image = openswim.render(lit, camera)
    write(image, (path,))
    return image, path


def cameras(scene: "Scene") -> dict[str, "Camera"]:
    """The four points of view: on the ground (twice), in an aircraft, in orbit."""
    from openswim.cameras import Camera

    lat, lon = scene.place
    return {
        "allsky": Camera.allsky(lat, lon, size=600),
        "panorama": Camera.panorama(lat, lon, size=1200),
        "airborne": Camera.perspective(
            lat, lon, height_m=6000.0, azimuth_deg=30.0, altitude_deg=-15.0, fov_deg=75.0
        ),
        "space": Camera.satellite(lat, lon, height_m=400_000.0, fov_deg=3.2, size=600),
    }
