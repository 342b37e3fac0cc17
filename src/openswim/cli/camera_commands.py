"""Commands of real cameras: calibrate, compare, correct-clouds, analyse. Each imports what it needs when called."""

from pathlib import Path
from typing import Any

import click

from openswim.cli.options import (
    PATH,
    QUALITIES,
    debug,
    frame_clock,
    frame_options,
    frame_times,
    member,
    quality,
    solver,
)


@click.command(short_help="Find a fisheye camera's lens and mount from its frames.")
@click.argument("frames", type=PATH, nargs=-1, required=True)
@click.option("--lat", type=float, help="Latitude of the camera, degrees north.")
@click.option("--lon", type=float, help="Longitude of the camera, degrees east.")
@click.option("--height", "height_m", type=float, default=0.0, help="Metres above sea level, for the refraction.")
@frame_times
@click.option("--by", type=click.Choice(("stars", "sun", "moon")), help="What to go by.  [default: stars, sun by day]")
@click.option("--mask", type=PATH, help="Picture of a frame's size, black where no sky is seen.")
@click.option("--name", default="", help="What to call the camera.")
@click.option("--camera", "camera_file", type=PATH, help="Check this camera; nothing is fitted.")
@click.option("-o", "--output", type=PATH, help="The camera's file, .toml.")
@click.option("--report", type=PATH, help="Page of the fit.  [default: as the output, .html]")
@debug
def calibrate(**options: Any) -> None:
    """Find a fisheye camera's lens and mount from FRAMES of stars, or of the sun's way through a day.

    Nothing but place and time need be known. What the frames do not give is refused (exit code 2).
    """
    from openswim.cli.calibrate import CalibrateRequest, run

    run(CalibrateRequest(**options))


@click.command(short_help="Compare a camera's frames with a model's sky.")
@click.argument("files", type=PATH, nargs=-1, required=True, metavar="MODEL FRAME...")
@click.option("--camera", "camera_file", type=PATH, required=True,
              help="TOML file of the camera.")  # fmt: skip
@click.option("--clear", is_flag=True, help="No MODEL: beside the clear sky of the frames' place and time.")
@click.option("--clear-frame", type=PATH,
              help="A frame of the camera under a clear sky: gives its response and white balance.")  # fmt: skip
@click.option("--lat", type=float, help="Latitude of the camera, in place of its file's.")
@click.option("--lon", type=float, help="Longitude of the camera, in place of its file's.")
@frame_times
@click.option("--aod", type=float, help="Aerosol optical depth at 550 nm.  [default: the model's; of --clear .1]")
@click.option("--albedo", type=float, help="Of the ground below the clear sky.  [default: the model's; of --clear .15]")
@member
@solver("swim", "fast")
@quality
@click.option("--detail/--no-detail", default=None,
              help="See more of near clouds and land than MODEL knows.  [default: of a single frame]")  # fmt: skip
@frame_options
@click.option("--ghi", "ghi_w_m2", type=float, help="Global irradiance beside the camera, W/m2: fixes its scale.")
@click.option("--dhi", "dhi_w_m2", type=float, help="Diffuse irradiance beside the camera, W/m2: fixes its scale.")
@click.option("-o", "--output", type=PATH, default=Path("openswim-compare"), show_default=True,
              help="Folder for pages and netCDF files; frames that it has already are not done again.")  # fmt: skip
@click.option("--jobs", type=int,
              help="Processes side by side, of several frames.  [default: as many as there are cores]")  # fmt: skip
@debug
def compare(files: tuple[Path, ...], **options: Any) -> None:
    """Compare a camera's FRAMEs with the sky that MODEL has at their place and time.

    Writes a page and a netCDF file for each frame; of several frames also their scores over time.
    """
    from openswim.cli.compare import CompareRequest, run

    run(CompareRequest(files, **options))


@click.command("correct-clouds", short_help="Mend a model's clouds by cameras' frames.")
@click.argument("model", type=PATH)
@click.argument("frames", type=PATH, nargs=-1, required=True)
@click.option("--camera", "camera_files", type=PATH, multiple=True, required=True,
              help="TOML file of a camera; once for each frame, in their order.")  # fmt: skip
@click.option("--clear-frame", "clear_frames", type=PATH, multiple=True,
              help="A frame of the camera under a clear sky; once for each camera, in their order.")  # fmt: skip
@click.option("--time", help="UTC, ISO 8601, of the frames.  [default: by their FITS headers, their names, their EXIF]")
@frame_clock
@member
@click.option("--passes", type=int, default=2, show_default=True, help="How often the edited scene is looked at again.")
@click.option("--hold-out/--use-all", default=True, show_default=True,
              help="Keep every second block of the sky aside, and score by it.")  # fmt: skip
@click.option("--base", "base_m", type=float,
              help="Base of clouds to add, metres above sea level.  [default: like the model's own]")
@click.option("--thickness", "thickness_m", type=float, default=400.0, show_default=True,
              help="Thickness of clouds to add, metres.")
@click.option("--quality", type=click.Choice(QUALITIES), default="standard", show_default=True,
              help="How finely light is solved for.")  # fmt: skip
@frame_options
@click.option("-o", "--output", type=PATH, required=True, help="The edited scene, .nc or .zarr.")
@debug
def correct_clouds(**options: Any) -> None:
    """Clear and add clouds of MODEL where cameras' FRAMES, one of each camera, show clear sky or cloud.

    Writes the edited scene, and the scores before and after each pass.
    """
    from openswim.cli.correct_clouds import CorrectCloudsRequest, run

    run(CorrectCloudsRequest(**options))


@click.command(short_help="Fit a model's clouds to what cameras measured.")
@click.argument("config", type=PATH)
@click.option("-o", "--output", type=PATH,
              help="The analysed scene, .nc or .zarr; a page and the departures are written beside it.")  # fmt: skip
@click.option("--check", is_flag=True,
              help="Only test CONFIG, and by four numbers the linearisation: tangent linear and adjoint.")  # fmt: skip
@click.option("--observations", type=PATH,
              help="Also write what was observed and is seen, as JEDI's IODA reads it, .nc.")  # fmt: skip
@click.option("--write-back", type=PATH,
              help="Also write a copy of the model's file (WRF), or of its files into this folder (LAPS), with the "
              "increments in it.")  # fmt: skip
@debug
def analyse(**options: Any) -> None:
    """Find clouds and ground of a model by what cameras and pyranometers measured, as CONFIG (.toml) says.

    Ctrl-C writes what there is and ends with exit code 130; the same command then goes on.
    """
    from openswim.cli.analyse import AnalyseRequest, run

    run(AnalyseRequest(**options))
