"""Options that several commands share, and what they ask for."""

import re
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any, TypeVar

import click

from openswim.errors import UserError

Command = TypeVar("Command", bound=Callable[..., Any])

SOLVERS = ("swim", "fast", "reference")
QUALITIES = ("preview", "standard", "high")
VIEWS = ("allsky", "panorama", "sphere", "perspective", "satellite")


class _Name(click.Path):
    """The name of a file or folder; an empty one, as of a shell's variable that is not set, would be this folder."""

    def convert(self, value: Any, parameter: click.Parameter | None, context: click.Context | None) -> Any:
        if value == "":
            self.fail("it is empty: give the name of a file or folder", parameter, context)
        return super().convert(value, parameter, context)


PATH = _Name(path_type=Path)


def stacked(*options: Callable[[Any], Any]) -> Callable[[Command], Command]:
    """Several options as one decorator, in the order of --help."""

    def decorated(command: Command) -> Command:
        for option in reversed(options):
            command = option(command)
        return command

    return decorated


def solver(*names: str) -> Callable[[Command], Command]:
    """--solver, of all or of some."""
    texts = {
        "swim": "swim: approximate and quick", "fast": "fast: light that is scattered many times is solved for",
        "reference": "reference: Monte Carlo, slow, with errors",
        "linear": "linear: the light of fast as a smooth fixed point, which analyses differentiate",
    }  # fmt: skip
    told = "; ".join(texts[name] for name in names or SOLVERS)
    return click.option("--solver", type=click.Choice(names or SOLVERS), default="fast", show_default=True,
                        help=f"How light is computed. {told[0].upper()}{told[1:]}.")  # fmt: skip


def _remember_debug(context: click.Context, parameter: click.Parameter, value: bool) -> None:
    if value:
        context.find_root().obj["debug"] = True


debug = click.option(
    "--debug",
    is_flag=True,
    expose_value=False,
    is_eager=True,
    callback=_remember_debug,
    help="Show the traceback of an error.",
)
allow_references = click.option(
    "--allow-references", is_flag=True,
    help="Follow what a file says lies in other files, out of its folder and in the network too.",
)  # fmt: skip
quality = click.option(
    "--quality", type=click.Choice(QUALITIES),
    help="Of --solver fast: how finely light is solved for.  [default: standard]",
)  # fmt: skip
member = click.option("--member", type=int, help="Of an ensemble, by the file's own number.  [default: its first]")
observer_options = stacked(  # of render and film: `RenderRequest` has them
    click.option("--lat", type=float, help="Observer's latitude, degrees north."),
    click.option("--lon", type=float, help="Observer's longitude, degrees east."),
    click.option("--x", "x_m", type=float, help="Observer's x in metres, in place of --lon where the scene is flat."),
    click.option("--y", "y_m", type=float, help="Observer's y in metres, in place of --lat where the scene is flat."),
    click.option(
        "--height",
        "height_m",
        type=float,
        help="Metres above ground (satellite: above sea level).  [default: 2; satellite: 35786 km]",
    ),
    click.option(
        "--camera", "camera_file", type=PATH,
        help="TOML file of a real camera (docs/cameras.md), in place of --view; --lat, --lon, --height go before its "
        "own.",
    ),
    click.option("--view", type=click.Choice(VIEWS), default="allsky", show_default=True,
                 help="Allsky is a fisheye picture of the upper hemisphere, north up and east left; sphere is a "
                 "panorama of all directions; satellite looks straight down."),
    click.option("--azimuth", "azimuth_deg", type=float,
                 help="Of the middle of a panorama, sphere or perspective, degrees clockwise from north.  [default: "
                 "180]"),
    click.option("--altitude", "altitude_deg", type=float,
                 help="Of the middle of a perspective, degrees above the horizon.  [default: 10]"),
    click.option("--fov", "fov_deg", type=float,
                 help="Of allsky, perspective and satellite: field of view across the width, degrees.  [default: 180; "
                 "60; of satellite the scene's domain where the point below lies in it, else the whole Earth, as from "
                 "100,000 km and more]"),
    click.option("--size",
                 help="Pixels: COLUMNS, or COLUMNSxROWS.  [default: allsky and satellite 800, panorama and sphere "
                 "1440, perspective 900]"),
    quality,
    allow_references,
)  # fmt: skip
frame_clock = stacked(  # of calibrate, compare and correct-clouds
    click.option("--time-pattern", help="How file names tell the time, such as %d%m%y_%H%M%S (strptime)."),
    click.option("--utc-offset", "utc_offset_h", type=float, help="Hours that their clock is ahead of UTC."),
)  # fmt: skip
frame_times = stacked(  # of calibrate and compare
    click.option("--time", help="UTC, ISO 8601, of a single frame.  [default: by its FITS header, its name, its EXIF]"),
    frame_clock,
)
frame_options = stacked(  # of compare and correct-clouds
    click.option("--size", type=int, help="Columns that frames are averaged to.  [default: 320]"),
    click.option("--sun-mask", "sun_mask_deg", type=float,
                 help="Degrees around the sun that are left out.  [default: 12]"),
    click.option("--lowest", "lowest_deg", type=float, help="Altitude below which pixels are left out.  [default: 5]"),
    click.option("--encoding",
                 help="Of the counts: srgb, linear, or an exponent.  [default: srgb of 8 bits, else linear]"),
)  # fmt: skip


def tell_notes(notes: Iterable[str]) -> None:
    """Print what was assumed, a line each, to stderr."""
    for note in notes:
        click.echo(f"note: {note}", err=True)


def known_to(command: click.Command | None, message: str) -> str:
    """A message of the library without brackets, or their parts between ";", that name options of other commands."""
    if command is None:
        return message
    own = {name for parameter in command.params for name in parameter.opts}

    def kept(bracket: re.Match[str]) -> str:
        parts = [part for part in bracket[1].split("; ") if own.issuperset(re.findall(r"--[a-z][a-z0-9-]*", part))]
        return f" ({'; '.join(parts)})" if parts else ""

    return re.sub(r" \(([^()]*--[a-z][^()]*)\)", kept, message)


def check_plot(path: Path, extra: str) -> None:
    """Raise UserError unless matplotlib, which an extra of the package brings, could draw this kind of picture."""
    try:
        from matplotlib.backend_bases import FigureCanvasBase
    except ImportError as error:
        raise UserError(f"--plot needs the package matplotlib: pip install 'openswim[{extra}]'") from error
    if path.suffix.lower().removeprefix(".") not in FigureCanvasBase.get_supported_filetypes():
        raise UserError(f"--plot {path}: suffix {path.suffix!r} is unknown; use .png, .pdf or .svg")
