"""Commands that make skies: demo, info, render, film, batch. Each imports what it needs when it is called."""

from pathlib import Path
from typing import Any

import click

from openswim.cli.options import PATH, allow_references, debug, member, observer_options, solver


@click.command(short_help="Render four pictures of a made-up sky, without any file.")
@click.option(
    "-o",
    "--output",
    "folder",
    type=PATH,
    default=Path("openswim-demo"),
    show_default=True,
    envvar="OPENSWIM_DEMO_DIR",
    help="Folder for the pictures; made where it is missing.",
)
@debug
def demo(folder: Path) -> None:
    """Render four pictures of a made-up summer sky: no file and no network needed."""
    from openswim.cli.demo import run

    run(folder)


@click.command(short_help="Say what files hold, and what is assumed besides.")
@click.argument("files", type=PATH, nargs=-1, required=True)
@click.option("--map", "picture", type=PATH, help="Write this PNG: maps of each field's largest value in the column.")
@click.option("--time", help="UTC, ISO 8601, of the maps.  [default: the file's first]")
@allow_references
@debug
def info(files: tuple[Path, ...], picture: Path | None, time: str | None, allow_references: bool) -> None:
    """Say what FILES hold, and what will be assumed where they lack something."""
    from openswim.cli.info import run

    run(files, picture, time, allow_references)


@click.command()
@click.argument("file", type=PATH, nargs=-1, required=True)
@observer_options
@member
@click.option("--time", help="UTC, ISO 8601, such as 2005-08-28T18:00.  [default: the file's first]")
@click.option(
    "--sun",
    help="Light of another time (UTC, ISO 8601), or AZIMUTH,ALTITUDE in degrees over the observer.  "
    "[default: the sun at --time]",
)
@click.option("--roll", "roll_deg", type=float, help="Of a perspective: the camera turned clockwise, degrees.")
@click.option("--altitude-range", help="Of a panorama: BOTTOM,TOP in degrees.  [default: -30,90]")
@click.option(
    "--only", multiple=True,
    help="Keep only these species of particles (see openswim info), or clouds, or aerosol; may be given several times.",
)
@solver()
@click.option(
    "--albedo", "albedo_maps", type=PATH, multiple=True,
    help="Your own map of the ground's colour: GeoTIFF in any projection, Blue Marble tile or aerial photograph; may "
    "be given several times.",
)  # fmt: skip
@click.option(
    "--dem", "height_maps", type=PATH, multiple=True,
    help="Your own elevation model: GeoTIFF in any projection, metres above sea level; may be given several times.",
)  # fmt: skip
@click.option(
    "--town-lights", "town_lights", type=PATH, multiple=True,
    help="Your own map of towns at night: GeoTIFF in nW cm-2 sr-1, such as VIIRS; may be given several times.",
)  # fmt: skip
@click.option(
    "--aerosol",
    help="Background aerosol: a type (openswim aerosol types), climatology (optical depth of the place and day; needs "
    "pvlib), or none.  [default: the file's, else continental]",
)
@click.option(
    "--aod", type=float,
    help="Optical depth of the background aerosol at 550 nm above the mean ground of the domain's middle.  [default: "
    "0.05]",
)
@click.option(
    "--stratosphere",
    help="Aerosol in the stratosphere besides: background, pinatubo, smoke, with an optical depth of your own as in "
    "pinatubo:0.1.  [default: none]",
)
@click.option(
    "--droplet-variance", type=float,
    help="How much cloud droplets differ in size, as effective variance: .1, usual, to .01, where they show corona and "
    "glory.  [default: the file's, else 0.1]",
)
@click.option(
    "--pristine-ice", type=float,
    help="Share of cloud ice by smooth crystals, which show halos.  [default: the file's, else 0.05]",
)
@click.option(
    "--level-ice", type=float,
    help="Share of cloud ice by plates that float level, which show sundogs.  [default: the file's, else 0]",
)
@click.option(
    "--level-columns", type=float,
    help="Share of cloud ice by columns that float level, which show tangent arcs.  [default: the file's, else 0]",
)
@click.option("--wavelengths", help="Wavelengths to render, nm, divided by commas.  [default: 615,546,450]")
@click.option("--layers", is_flag=True,
              help="Also write what each pixel shows, how far away and how high, and optical depths, in .nc, .zarr and "
              ".exr.")  # fmt: skip
@click.option("--paths", type=int, help="Of --solver reference: paths per pixel.  [default: 256]")
@click.option("--seed", type=int, default=0, show_default=True,
              help="Of --solver reference: seed of its random numbers.")
@click.option("--error", "error_percent", type=float, help="Of --solver reference: stop at this mean error, per cent.")
@click.option(
    "--checkpoint", type=PATH,
    help="Of --solver reference: file to stop with (Ctrl-C) and to go on from.",
)  # fmt: skip
@click.option(
    "--exposure", default="auto", show_default=True,
    help="Factor from solar-relative radiance to display; auto, by what is seen; sun, by the sun's altitude alone, "
    "alike for all of a series; a curve ALTITUDE:FACTOR,ALTITUDE:FACTOR,... of the sun's; or a camera's, such as "
    "'15s f/2.8 ISO1600'.",
)
@click.option("--eye", is_flag=True, help="Colours as an eye sees them that has got used to the dark.")
@click.option("--matrix", type=click.Choice(("srgb", "paper")), default="srgb", show_default=True,
              help="Colours by sRGB, or by Eq. 36 of Albers et al. 2020.")  # fmt: skip
@click.option("--gamma", type=float, help="Power law in place of sRGB's curve; the paper has 2.2.")
@click.option("--bits", type=click.Choice(("8", "16")), default="8", show_default=True,
              help="Bits of each colour, in .png and .tif.")  # fmt: skip
@click.option("--caption", type=click.Choice(("inside", "below", "none")), default="inside", show_default=True,
              help="Where pictures say what was rendered.")  # fmt: skip
@click.option(
    "-o", "--output", "outputs", type=PATH, multiple=True, required=True,
    help="File to write, by suffix .png .jpg .tif .hdr .exr .nc .zarr; may be given several times.",
)  # fmt: skip
@debug
def render(file: tuple[Path, ...], outputs: tuple[Path, ...], **options: Any) -> None:
    """Render what an observer in FILE would see.

    Several files of one model, or a pattern in quotes, are one series of times or the parts of one state.

    \b
    Examples:
      openswim render wrfout_d01 --lat 24.5 --lon -90 -o sky.png
      openswim render wrfout_d01 --lat 24.5 --lon -90 --view perspective --azimuth 280 --fov 60 -o west.png
      openswim render wrfout_d01 --lat 24.5 --lon -90 --view panorama --size 1440x720 -o round.png -o round.nc
      openswim render wrfout_d01 --lat 24.5 --lon -90 --view satellite --sun 2005-08-28T22:30 -o above.png
    """
    from openswim.cli.render import RenderRequest, run

    run(RenderRequest(file=file[0] if len(file) == 1 else file, outputs=outputs, **options))


@click.command(short_help="Film the sky through time, or along a path.")
@click.argument("file", type=PATH, nargs=-1, required=True)
@observer_options
@click.option("--member", help="Of an ensemble, by the file's own number; all: a film of each.  [default: its first]")
@click.option("--path", type=PATH,
              help="Where the camera is at which time: CSV (time,lat,lon,height_m; azimuth,altitude,roll,fov as you "
              "like) or GPX. The film then follows it.")  # fmt: skip
@click.option("--every",
              help="Time from frame to frame, such as 5min; clouds drift between the model's times.  [default: the "
              "model's own times]")  # fmt: skip
@click.option("--from", "start", help="First time, UTC, ISO 8601.  [default: the model's first]")
@click.option("--to", "end", help="Last time, UTC.  [default: the model's last]")
@click.option("--fps", "frames_per_second", type=float, default=25.0, show_default=True, help="Frames per second.")
@click.option("--speed", type=float, help="Of --path: times its own speed.  [default: 1]")
@solver("swim", "fast")
@click.option("--exposure", default="auto", show_default=True,
              help="As of openswim render; auto is one smooth curve for the film.")  # fmt: skip
@click.option("--keogram", type=PATH,
              help="Also write the middle columns of all frames as this picture.")  # fmt: skip
@click.option("--star-trails", type=PATH,
              help="Also write the brightest that each pixel is by night as this picture.")  # fmt: skip
@click.option("--irradiance", type=PATH,
              help="Also write irradiance at the camera in each frame, as .csv or .nc.")  # fmt: skip
@click.option("--title/--no-title", default=True, help="Time, place and model on the frames, or none.")
@click.option(
    "-o", "--output", type=PATH, required=True,
    help="The film: .mp4, .webm, .zarr (radiance), or a folder of pictures.",
)  # fmt: skip
@debug
def film(
    file: tuple[Path, ...], output: Path, path: Path | None, every: str | None, start: str | None, end: str | None,
    frames_per_second: float, speed: float | None, keogram: Path | None, star_trails: Path | None,
    irradiance: Path | None,
    title: bool, member: str | None, **options: Any,
) -> None:  # fmt: skip
    """Make a film of the sky over FILE's times, or along a camera's path.

    It shows its progress; stopped by Ctrl-C or worse, the same command goes on where it was.
    """
    from openswim.cli.film import FilmRequest, member_of, run
    from openswim.cli.render import RenderRequest

    number, all_members = member_of(member)
    picture = RenderRequest(file=file[0] if len(file) == 1 else file, outputs=(), member=number, **options)
    run(FilmRequest(
        picture, output, every=every, path=path, start=start, end=end, frames_per_second=frames_per_second,
        speed=speed, keogram=keogram, star_trails=star_trails, irradiance=irradiance, title=title,
        all_members=all_members,
    ))  # fmt: skip


@click.command(short_help="Make the pictures of many files, times and cameras.")
@click.argument("plan", type=PATH)
@click.argument("files", type=PATH, nargs=-1)
@click.option("-o", "--output", type=PATH, help="Folder for the pictures.  [default: the plan's, else openswim-batch]")
@click.option("--jobs", type=int,
              help="Processes side by side.  [default: as many as there are cores, divided by --threads]")
@click.option("--threads", type=int, default=1, show_default=True, help="Threads of each process.")
@click.option("--scheduler", help="Address of a Dask scheduler whose workers do it, such as tcp://10.0.0.5:8786.")
@click.option("--part", help="Share of this machine, of several: WHICH/HOW_MANY, such as 3/16.")
@click.option("--dry-run", is_flag=True, help="Only say what there is to do, and how long it will take.")
@click.option("--watch", type=PATH, help="Render what arrives in this folder, until Ctrl-C, and keep a page of it.")
@click.option("--keep", type=int, help="Of --watch: the newest times that are kept.  [default: 288]")
@allow_references
@debug
def batch(plan: Path, files: tuple[Path, ...], **options: Any) -> None:
    """Make all pictures that PLAN asks for: of many files, times, members and cameras.

    FILES, or patterns in quotes, stand in place of those that the plan names. What stands already, made alike, is not
    made again: stopped by Ctrl-C or worse, the same command goes on where it was, and what failed is tried again.
    """
    from openswim.cli.batch import BatchRequest, run

    run(BatchRequest(plan, files, **options))
