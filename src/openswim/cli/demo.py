"""`openswim demo`: four pictures of a procedural summer sky."""

import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import TYPE_CHECKING

import click

from openswim.errors import UserError

if TYPE_CHECKING:
    from openswim.cameras import Camera
    from openswim.scene import Scene


def run(folder: Path) -> None:
    """Make the scene, render it four times, write four PNGs; print timings and irradiance."""
    from openswim.colour import check_writable
    from openswim.ground.earth import preload

    start = time.perf_counter()
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise UserError(f"{folder}: cannot be made ({error.strerror}); choose another folder with -o") from None
    check_writable(folder / "demo_allsky.png")
    preload()

    import openswim
    from openswim.cli.render import irradiance_line, write
    from openswim.lighting import light
    from openswim.pictures.viewpoint import LOOKED_AT
    from openswim.scene.procedural import demo_scene

    scene = demo_scene()
    click.echo(f"scene: {scene.source}, {time.perf_counter() - start:.1f} s")
    began = time.perf_counter()
    lit = light(scene)
    click.echo(f"light: solved once for all four pictures, {time.perf_counter() - began:.1f} s")
    with ThreadPoolExecutor(1) as writer:  # a picture is written while the next is rendered
        written = []
        for name, camera in cameras(scene).items():
            began = time.perf_counter()
            image = openswim.render(lit, camera, sparse=LOOKED_AT)
            picture = folder / f"demo_{name}.png"
            written.append(writer.submit(write, image, (picture,)))
            click.echo(f"{picture}: {time.perf_counter() - began:.1f} s")
            if name == "allsky":
                click.echo(irradiance_line(image))
        for job in written:
            job.result()
    click.echo(f"in all: {time.perf_counter() - start:.1f} s")


def cameras(scene: "Scene") -> dict[str, "Camera"]:
    """The four points of view: on the ground (twice), in an aircraft, in orbit."""
    from openswim.cameras import Camera

    lat, lon = scene.place
    return {
        "allsky": Camera.allsky(lat, lon, size=600),
        "panorama": Camera.panorama(lat, lon, size=1200),
        "airborne": Camera.perspective(lat, lon, height_m=6000.0, azimuth_deg=30.0, altitude_deg=-15.0, fov_deg=75.0),
        "space": Camera.satellite(lat, lon, height_m=400_000.0, fov_deg=3.2, size=600),
    }
