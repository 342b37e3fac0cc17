"""The `openswim` command: its groups, options and exit codes.

Exit codes: 0 done, 1 our fault, 2 the user's mistake or a bad file, 130 interrupted. Heavy modules are
imported by the commands that need them, so that `openswim --help` is quick.
"""

import gc
import os
import sys
import traceback
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NoReturn

import click

from openswim import __version__
from openswim.errors import UserError
from openswim.progress import spoken
from openswim.system.interrupts import INTERRUPTED, watched

# products of matrices are small here, and the threads that wait for them would take time from the kernels'
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

SOLVERS = ("swim", "fast", "reference")
QUALITIES = ("preview", "standard", "high")
VIEWS = ("allsky", "panorama", "sphere", "perspective", "satellite")

DONE, OUR_FAULT, USERS_MISTAKE = 0, 1, 2


def _remember_debug(context: click.Context, parameter: click.Parameter, value: bool) -> None:
    if value:
        context.find_root().obj["debug"] = True


_debug = click.option(
    "--debug",
    is_flag=True,
    expose_value=False,
    is_eager=True,
    callback=_remember_debug,
    help="Show the traceback of an error.",
)


_allow_references = click.option(
    "--allow-references", is_flag=True,
    help="Follow what a file says lies in other files, out of its folder and in the network too.",
)  # fmt: skip
_quality = click.option(
    "--quality", type=click.Choice(QUALITIES),
    help="Of --solver fast: how finely light is solved for.  [default: standard]",
)  # fmt: skip


@click.group(context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 100})
@click.version_option(__version__, prog_name="openswim")
@_debug
def cli() -> None:
    """A weather model's file in, a believable sky out."""


@cli.command()
@click.option(
    "-o",
    "--output",
    "folder",
    type=click.Path(path_type=Path),
    default=Path("openswim-demo"),
    show_default=True,
    envvar="OPENSWIM_DEMO_DIR",
    help="Folder for the pictures; made where it is missing.",
)
@_debug
def demo(folder: Path) -> None:
    """Render four pictures of a made-up summer sky: no file and no network needed."""
    from openswim.cli.demo import run

    run(folder)


@cli.command()
@click.argument("files", type=click.Path(path_type=Path), nargs=-1, required=True)
@click.option("--map", "picture", type=click.Path(path_type=Path), help="Map column maxima in this PNG.")
@click.option("--time", help="UTC, ISO 8601, of the maps.  [default: the file's first]")
@_allow_references
@_debug
def info(files: tuple[Path, ...], picture: Path | None, time: str | None, allow_references: bool) -> None:
    """Say what FILES hold, and what will be assumed where they lack something."""
    from openswim.cli.info import run

    run(files, picture, time, allow_references)


@cli.command()
@click.argument("file", type=click.Path(path_type=Path), nargs=-1, required=True)
@click.option("--lat", type=float, help="Observer's latitude, degrees north.")
@click.option("--lon", type=float, help="Observer's longitude, degrees east.")
@click.option("--x", "x_m", type=float, help="Observer's x in metres, in place of --lon where the scene is flat.")
@click.option("--y", "y_m", type=float, help="Observer's y in metres, in place of --lat where the scene is flat.")
@click.option(
    "--height",
    "height_m",
    type=float,
    help="Metres above ground (satellite: above sea level).  [default: 2; satellite: 35786 km]",
)
@click.option("--time", help="UTC, ISO 8601, such as 2005-08-28T18:00.  [default: the file's first]")
@click.option("--member", type=int, help="Of an ensemble, by the file's own number.  [default: its first]")
@click.option(
    "--sun",
    help="Light of another time (UTC, ISO 8601), or AZIMUTH,ALTITUDE in degrees.  [default: the sun at --time]",
)
@click.option(
    "--camera", "camera_file", type=click.Path(path_type=Path),
    help="TOML file of a real camera (docs/cameras.md), in place of --view; --lat, --lon, --height go before its own.",
)  # fmt: skip
@click.option("--view", type=click.Choice(VIEWS), default="allsky", show_default=True)
@click.option("--azimuth", "azimuth_deg", type=float, help="Of the image's centre, degrees clockwise from north.")
@click.option("--altitude", "altitude_deg", type=float, help="Of the image's centre, degrees above the horizon.")
@click.option("--fov", "fov_deg", type=float, help="Field of view across the width, degrees.")
@click.option("--roll", "roll_deg", type=float, help="Of a perspective: the camera turned clockwise, degrees.")
@click.option("--altitude-range", help="Of a panorama: BOTTOM,TOP in degrees.  [default: -30,90]")
@click.option("--size", help="Pixels: COLUMNS, or COLUMNSxROWS.")
@click.option(
    "--only", multiple=True,
    help="Keep only these species of particles (see openswim info), or clouds, or aerosol; may be given several times.",
)
@click.option("--solver", type=click.Choice(SOLVERS), default="fast", show_default=True)
@_quality
@click.option(
    "--albedo", "albedo_maps", type=click.Path(path_type=Path), multiple=True,
    help="Your own map of the ground's colour: GeoTIFF in any projection, Blue Marble tile or aerial photograph; may "
    "be given several times.",
)  # fmt: skip
@click.option(
    "--dem", "height_maps", type=click.Path(path_type=Path), multiple=True,
    help="Your own elevation model: GeoTIFF in any projection, metres above sea level; may be given several times.",
)  # fmt: skip
@click.option(
    "--town-lights", "town_lights", type=click.Path(path_type=Path), multiple=True,
    help="Your own map of towns at night: GeoTIFF in nW cm-2 sr-1, such as VIIRS; may be given several times.",
)  # fmt: skip
@click.option(
    "--aerosol",
    help="Background aerosol: a type (openswim aerosol types), climatology (optical depth of the place and day; needs "
    "pvlib), or none.  [default: the file's, else continental]",
)
@click.option(
    "--aod", type=float, help="Optical depth of the background aerosol at 550 nm above the ground.  [default: 0.05]"
)
@click.option("--wavelengths", help="Wavelengths to render, nm, divided by commas.  [default: 615,546,450]")
@click.option("--paths", type=int, help="Of --solver reference: paths per pixel.  [default: 256]")
@click.option("--seed", type=int, default=0, help="Of --solver reference: number that all chances follow from.")
@click.option("--error", "error_percent", type=float, help="Of --solver reference: stop at this mean error, per cent.")
@click.option(
    "--checkpoint", type=click.Path(path_type=Path, dir_okay=False),
    help="Of --solver reference: file to stop with (Ctrl-C) and to go on from.",
)  # fmt: skip
@_allow_references
@click.option(
    "--exposure", default="auto", show_default=True,
    help="Factor from solar-relative radiance to display; auto, by what is seen; sun, by the sun's altitude alone, "
    "alike for all of a series; or a curve ALTITUDE:FACTOR,ALTITUDE:FACTOR,... of the sun's.",
)
@click.option("--matrix", type=click.Choice(("srgb", "paper")), default="srgb", show_default=True,
              help="Colours by sRGB, or by Eq. 36 of Albers et al. 2020.")  # fmt: skip
@click.option("--gamma", type=float, help="Power law in place of sRGB's curve; the paper has 2.2.")
@click.option("--bits", type=click.Choice(("8", "16")), default="8", show_default=True,
              help="A colour, in .png and .tif.")  # fmt: skip
@click.option("--caption", type=click.Choice(("inside", "below", "none")), default="inside", show_default=True,
              help="Where pictures say what was rendered.")  # fmt: skip
@click.option(
    "-o", "--output", "outputs", type=click.Path(path_type=Path), multiple=True, required=True,
    help="File to write, by suffix .png .jpg .tif .nc .zarr; may be given several times.",
)  # fmt: skip
@_debug
def render(file: tuple[Path, ...], outputs: tuple[Path, ...], **options: Any) -> None:
    """Render what an observer in FILE would see.

    Several files of one model, or a pattern in quotes, are one series of times or the parts of one state.
    """
    from openswim.cli.render import RenderRequest, run

    run(RenderRequest(file=file[0] if len(file) == 1 else file, outputs=outputs, **options))


@cli.command()
@click.argument("file", type=click.Path(path_type=Path), nargs=-1, required=True)
@click.option("--lat", type=float, help="Observer's latitude, degrees north.")
@click.option("--lon", type=float, help="Observer's longitude, degrees east.")
@click.option("--x", "x_m", type=float, help="Observer's x in metres, in place of --lon where the scene is flat.")
@click.option("--y", "y_m", type=float, help="Observer's y in metres, in place of --lat where the scene is flat.")
@click.option("--height", "height_m", type=float, help="Metres above ground (satellite: above sea level).")
@click.option("--path", type=click.Path(path_type=Path),
              help="Where the camera is at which time: CSV (time,lat,lon,height_m; azimuth,altitude,roll,fov as you "
              "like) or GPX. The film then follows it.")  # fmt: skip
@click.option("--every", help="From frame to frame, such as 5min; clouds drift between the model's times.")
@click.option("--from", "start", help="First time, UTC, ISO 8601.")
@click.option("--to", "end", help="Last time, UTC.")
@click.option("--fps", "frames_per_second", type=float, default=25.0, show_default=True, help="Frames per second.")
@click.option("--speed", type=float, default=1.0, show_default=True, help="Of --path: times its own speed.")
@click.option("--camera", "camera_file", type=click.Path(path_type=Path), help="TOML file of a real camera.")
@click.option("--view", type=click.Choice(VIEWS), default="allsky", show_default=True)
@click.option("--azimuth", "azimuth_deg", type=float, help="Of the image's centre, degrees clockwise from north.")
@click.option("--altitude", "altitude_deg", type=float, help="Of the image's centre, degrees above the horizon.")
@click.option("--fov", "fov_deg", type=float, help="Field of view across the width, degrees.")
@click.option("--size", help="Pixels: COLUMNS, or COLUMNSxROWS.")
@click.option("--solver", type=click.Choice(("swim", "fast")), default="fast", show_default=True)
@_quality
@click.option("--member", type=int, help="Of an ensemble: the member's number.  [default: the first]")
@click.option("--exposure", default="auto", show_default=True,
              help="As of openswim render; auto is one smooth curve for the film.")  # fmt: skip
@click.option("--keogram", type=click.Path(path_type=Path),
              help="Also write the middle columns of all frames as this picture.")  # fmt: skip
@click.option("--title/--no-title", default=True, help="Time, place and model on the frames, or none.")
@click.option(
    "-o", "--output", type=click.Path(path_type=Path), required=True,
    help="The film: .mp4, .webm, .zarr (radiance), or a folder of pictures.",
)  # fmt: skip
@_debug
def film(
    file: tuple[Path, ...], output: Path, path: Path | None, every: str | None, start: str | None, end: str | None,
    frames_per_second: float, speed: float, keogram: Path | None, title: bool, **options: Any,
) -> None:  # fmt: skip
    """Make a film of the sky over FILE's times, or along a camera's path.

    It shows its progress; stopped by Ctrl-C or worse, the same command goes on where it was.
    """
    from openswim.cli.film import FilmRequest, run
    from openswim.cli.render import RenderRequest

    picture = RenderRequest(file=file[0] if len(file) == 1 else file, outputs=(), **options)
    run(FilmRequest(picture, output, every, path, start, end, frames_per_second, speed, keogram, title))


@cli.command()
@click.argument("frames", type=click.Path(path_type=Path), nargs=-1, required=True)
@click.option("--lat", type=float, help="Latitude of the camera, degrees north.")
@click.option("--lon", type=float, help="Longitude of the camera, degrees east.")
@click.option("--height", "height_m", type=float, default=0.0, help="Metres above sea level, for the refraction.")
@click.option("--time", help="UTC, ISO 8601, of a single frame.  [default: by its FITS header, its name, its EXIF]")
@click.option("--time-pattern", help="How file names tell the time, such as %d%m%y_%H%M%S (strptime).")
@click.option("--utc-offset", "utc_offset_h", type=float, help="Hours that their clock is ahead of UTC.")
@click.option("--by", type=click.Choice(("stars", "sun", "moon")), help="What to go by.  [default: stars, sun by day]")
@click.option("--mask", type=click.Path(path_type=Path), help="Picture of a frame's size, black where no sky is seen.")
@click.option("--name", default="", help="What to call the camera.")
@click.option("--camera", "camera_file", type=click.Path(path_type=Path), help="Check this camera; nothing is fitted.")
@click.option("-o", "--output", type=click.Path(path_type=Path), help="The camera's file, .toml.")
@click.option("--report", type=click.Path(path_type=Path), help="Page of the fit.  [default: as the output, .html]")
@_debug
def calibrate(**options: Any) -> None:
    """Find a fisheye camera's lens and mount from FRAMES of stars, or of the sun's way through a day.

    Nothing but place and time need be known. What the frames do not give is refused (exit code 2).
    """
    from openswim.cli.calibrate import CalibrateRequest, run

    run(CalibrateRequest(**options))


@cli.command()
@click.argument("files", type=click.Path(path_type=Path), nargs=-1, required=True, metavar="MODEL FRAME...")
@click.option("--camera", "camera_file", type=click.Path(path_type=Path), required=True,
              help="TOML file of the camera.")  # fmt: skip
@click.option("--clear", is_flag=True, help="No MODEL: beside the clear sky of the frames' place and time.")
@click.option("--clear-frame", type=click.Path(path_type=Path),
              help="A frame of the camera under a clear sky: gives its response and white balance.")  # fmt: skip
@click.option("--lat", type=float, help="Latitude of the camera, in place of its file's.")
@click.option("--lon", type=float, help="Longitude of the camera, in place of its file's.")
@click.option("--time", help="UTC, ISO 8601, of a single frame.  [default: by its FITS header, its name, its EXIF]")
@click.option("--time-pattern", help="How file names tell the time, such as %d%m%y_%H%M%S (strptime).")
@click.option("--utc-offset", "utc_offset_h", type=float, help="Hours that their clock is ahead of UTC.")
@click.option("--aod", type=float, help="Aerosol optical depth at 550 nm.  [default: the model's; of --clear .1]")
@click.option("--albedo", type=float, help="Of the ground below the clear sky.  [default: the model's; of --clear .15]")
@click.option("--solver", type=click.Choice(("swim", "fast")), default="fast", show_default=True)
@_quality
@click.option("--size", type=int, help="Columns that frames are averaged to.  [default: 320]")
@click.option("--sun-mask", "sun_mask_deg", type=float, help="Degrees around the sun without scores.  [default: 12]")
@click.option("--lowest", "lowest_deg", type=float, help="Altitude below which there are none.  [default: 5]")
@click.option("--encoding", help="Of the counts: srgb, linear, or an exponent.  [default: srgb of 8 bits, else linear]")
@click.option("--ghi", "ghi_w_m2", type=float, help="Global irradiance beside the camera, W/m2: fixes its scale.")
@click.option("--dhi", "dhi_w_m2", type=float, help="Diffuse irradiance beside the camera, W/m2: fixes its scale.")
@click.option("-o", "--output", type=click.Path(path_type=Path), default=Path("openswim-compare"), show_default=True,
              help="Folder for pages and netCDF files; frames that it has already are not done again.")  # fmt: skip
@_debug
def compare(files: tuple[Path, ...], **options: Any) -> None:
    """Compare a camera's FRAMEs with the sky that MODEL has at their place and time.

    Writes a page and a netCDF file for each frame; of several frames also their scores over time.
    """
    from openswim.cli.compare import CompareRequest, run

    run(CompareRequest(files, **options))


@cli.command("correct-clouds")
@click.argument("model", type=click.Path(path_type=Path))
@click.argument("frames", type=click.Path(path_type=Path), nargs=-1, required=True)
@click.option("--camera", "camera_files", type=click.Path(path_type=Path), multiple=True, required=True,
              help="TOML file of a camera; once for each frame, in their order.")  # fmt: skip
@click.option("--clear-frame", "clear_frames", type=click.Path(path_type=Path), multiple=True,
              help="A frame of the camera under a clear sky; once for each camera, in their order.")  # fmt: skip
@click.option("--time", help="UTC, ISO 8601, of the frames, where they do not tell.")
@click.option("--passes", type=int, default=2, show_default=True, help="How often the edited scene is looked at again.")
@click.option("--hold-out/--use-all", default=True, show_default=True,
              help="Keep every second block of the sky aside, and score by it.")  # fmt: skip
@click.option("--base", "base_m", type=float, help="Metres: base of clouds to add.  [default: like the model's own]")
@click.option("--thickness", "thickness_m", type=float, default=400.0, show_default=True, help="Of these, metres.")
@click.option("--quality", type=click.Choice(QUALITIES), default="standard", show_default=True,
              help="How finely light is solved for.")  # fmt: skip
@click.option("--size", type=int, help="Columns that frames are averaged to.  [default: 320]")
@click.option("--sun-mask", "sun_mask_deg", type=float, help="Degrees around the sun that say nothing.  [default: 12]")
@click.option("--lowest", "lowest_deg", type=float, help="Altitude below which pixels say nothing.  [default: 5]")
@click.option("--encoding", help="Of the counts: srgb, linear, or an exponent.  [default: srgb of 8 bits, else linear]")
@click.option("-o", "--output", type=click.Path(path_type=Path), required=True, help="The edited scene, .nc or .zarr.")
@_debug
def correct_clouds(**options: Any) -> None:
    """Clear and add clouds of MODEL where cameras' FRAMES, one of each camera, show clear sky or cloud.

    Writes the edited scene, and the scores before and after each pass.
    """
    from openswim.cli.correct_clouds import CorrectCloudsRequest, run

    run(CorrectCloudsRequest(**options))


@cli.command()
@click.argument("files", type=click.Path(path_type=Path), nargs=-1)
@click.option("--clear", is_flag=True, help="A clear sky in place of a model's FILES.")
@click.option("--lat", type=float, help="Latitude, degrees north.")
@click.option("--lon", type=float, help="Longitude, degrees east.")
@click.option("--height", "height_m", type=float, default=2.0, show_default=True, help="Metres above the ground.")
@click.option("--ground", "ground_m", type=float, help="Of --clear: height of the ground above sea level, m.")
@click.option("--start", help="First time, UTC, ISO 8601.  [default: the model's times]")
@click.option("--end", help="Last time, UTC.")
@click.option("--every", type=float, help="Minutes from time to time.  [default: 1]")
@click.option("--plane", "planes", multiple=True, metavar="TILT,AZIMUTH", help="A tilted plane; may be given often.")
@click.option("--wavelengths", help="Wavelengths of the spectral parts, nm.  [default: 870,615,500,400]")
@click.option("--vapour", "vapour_cm", type=float, help="Precipitable water, cm.  [default: the scene's own]")
@click.option("--aeronet", type=click.Path(path_type=Path), multiple=True,
              help="Of --clear: aerosol, water vapour and ozone by files of AERONET.")  # fmt: skip
@click.option("--aod", type=float, help="Of --clear: aerosol optical depth at 550 nm.  [default: .05]")
@click.option("--albedo", type=float, help="Of --clear: the ground's.  [default: as measured, else .2]")
@click.option(
    "--station", type=click.Path(path_type=Path),
    help="Compare with this file of BSRN, SURFRAD, SOLRAD, MIDC, ARM, or a table with utc and ghi.",
)  # fmt: skip
@click.option("--fit", type=click.Choice(("beam", "first-half", "second-half")),
              help="Of --clear: fit the aerosol to the station's DNI, of all clear times or half of them.")  # fmt: skip
@click.option("--plot", type=click.Path(path_type=Path), help="Picture of model and station, .png.")
@click.option("--solver", type=click.Choice(SOLVERS), default="fast", show_default=True)
@click.option("-o", "--output", type=click.Path(path_type=Path), help="File to write, .nc or .csv.")
@_debug
def irradiance(**options: Any) -> None:
    """Global, direct and diffuse irradiance through time, from a model's FILES or for a clear sky."""
    from openswim.cli.irradiance import IrradianceRequest, run

    run(IrradianceRequest(**options))


@cli.command()
@click.argument("files", type=click.Path(path_type=Path), nargs=-1, required=True)
@click.option("--like", type=click.Path(path_type=Path), required=True,
              help="Observed picture on a fixed grid (.nc or .tif): its pixels and time are taken.")  # fmt: skip
@click.option("--imager", default="goes-16 abi", show_default=True, help="Such as 'himawari-9 ahi', 'mtg-i1 fci'.")
@click.option("--band", "bands", multiple=True, help="Name of a band, such as C02; the first is compared.")
@click.option("--time", help="UTC, of the model.  [default: its first; light of the observed picture's time]")
@click.option("--solver", type=click.Choice(SOLVERS), default="fast", show_default=True)
@click.option("-o", "--output", "outputs", type=click.Path(path_type=Path), multiple=True, help=".nc or .tif to write.")
@_debug
def satellite(**options: Any) -> None:
    """The clouds of a model's FILES as an imager in space sees them, beside what it saw."""
    from openswim.cli.satellite import SatelliteRequest, run

    run(SatelliteRequest(**options))


@cli.command()
@click.argument("directory", type=click.Path(path_type=Path))
@click.option("--solver", type=click.Choice(SOLVERS), default="fast", show_default=True)
@_quality
@click.option("--json", "json_path", type=click.Path(path_type=Path), help="Also write the rows to this file.")
@click.option("--seconds", type=float, help="Of --solver reference: CPU seconds per view.  [default: 3]")
@_debug
def validate(
    directory: Path, solver: str, quality: str | None, json_path: Path | None, seconds: float | None
) -> None:
    """Compare with every reference file below DIRECTORY; print a table, worst first."""
    from openswim.cli.validate import run

    run(directory, solver, json_path, seconds, quality)


@cli.group()
def aerosol() -> None:
    """Aerosol types, and phase functions from size and refractive index."""


@aerosol.command("types")
@_debug
def aerosol_types() -> None:
    """List the aerosol types that can be named wherever an aerosol is described."""
    from openswim.cli.aerosol import list_types

    list_types()


@aerosol.command("fit")
@click.option(
    "--mode", "modes", multiple=True, metavar="RADIUS,STD[,AMOUNT]",
    help="A lognormal mode: median radius in um, geometric standard deviation (above 1), relative amount (1). "
    "May be given several times.",
)  # fmt: skip
@click.option("--by", type=click.Choice(("number", "volume")), default="number", show_default=True,
              help="What --mode describes: median radius and amount by number or by volume.")  # fmt: skip
@click.option(
    "--index", "indices", multiple=True, metavar="[WAVELENGTH:]N+Ki",
    help="Complex refractive index, such as 1.5+0.01i; one for all, or several such as 440:1.56+0.003i in nm.",
)  # fmt: skip
@click.option("--irregular", is_flag=True, help="Particles of size parameters above 3-8 are irregular, as dust is.")
@click.option("--type", "type_name", help="Fit the phase function of a named type in place of --mode and --index.")
@click.option(
    "--aeronet", type=click.Path(path_type=Path), multiple=True,
    help="File of AERONET's inversions (.all, .pfn), in place of --mode and --index; may be given often.",
)  # fmt: skip
@click.option("--time", help="Of --aeronet: UTC; the nearest row.  [default: the mean of all]")
@click.option("--wavelengths", default="615,546,450", show_default=True, help="Wavelengths in nm.")
@click.option("--json", "json_path", type=click.Path(path_type=Path), help="Also write the fit to this file.")
@click.option("--plot", "plot_path", type=click.Path(path_type=Path), help="Also draw the fit as this picture (.png).")
@_debug
def aerosol_fit(**options: Any) -> None:
    """Fit the double Henyey-Greenstein function to Mie theory for given particles.

    Prints g_1 (sharp lobe), g_2 (broad lobe), f_c (share of the sharp lobe) and f_b of Albers et al. 2020, Eq. 28, the
    root mean square of ln(fit/Mie) over 1-180 degrees, and the single-scattering albedo.

    Example: openswim aerosol fit --mode 0.12,1.5,0.03 --mode 2.3,1.8,0.47 --by volume --index 1.56+0.002i
    """
    from openswim.cli.aerosol import FitRequest, fit

    fit(FitRequest(**options))


def main(arguments: Sequence[str] | None = None) -> NoReturn:
    """Run the command line and leave with its exit code; errors are one line on stderr."""
    with watched():
        code = run(arguments)
    gc.freeze()  # looking for garbage among all that was imported would take a third of a second
    sys.exit(code)


def run(arguments: Sequence[str] | None = None) -> int:
    """Run the command line; returns the exit code."""
    state: dict[str, bool] = {}
    try:
        with spoken():
            cli.main(args=arguments, prog_name="openswim", standalone_mode=False, obj=state)
    except UserError as error:
        return _fail(str(error), USERS_MISTAKE, state)
    except click.exceptions.NoArgsIsHelpError as error:
        click.echo(error.format_message(), err=True)
        return USERS_MISTAKE
    except click.ClickException as error:
        return _fail(str(UserError(f"{error.format_message()} (see openswim --help)")), USERS_MISTAKE, state)
    except (click.Abort, KeyboardInterrupt):
        click.echo("openswim: interrupted", err=True)
        return INTERRUPTED
    except MemoryError:
        return _fail("out of memory: use a smaller --size or a smaller domain", USERS_MISTAKE, state)
    except Exception as error:
        hint = "" if state.get("debug") else " (a fault of openswim; --debug shows where)"
        return _fail(f"{type(error).__name__}: {error}{hint}", OUR_FAULT, state)
    return DONE


def _fail(message: str, code: int, state: dict[str, bool]) -> int:
    if state.get("debug"):
        traceback.print_exc()
    click.echo(f"openswim: error: {' '.join(message.split())}", err=True)
    return code
