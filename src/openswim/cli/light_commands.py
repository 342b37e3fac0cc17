"""Commands of light that is measured: irradiance, satellite, validate, aerosol. Each imports what it needs."""

from pathlib import Path
from typing import Any

import click

from openswim.cli.options import PATH, SOLVERS, debug, member, quality, solver


@click.command(short_help="Global, direct and diffuse irradiance through time.")
@click.argument("files", type=PATH, nargs=-1)
@click.option("--clear", is_flag=True, help="A clear sky in place of a model's FILES.")
@click.option("--lat", type=float, help="Latitude, degrees north.  [default: as files of --station or --aeronet say]")
@click.option("--lon", type=float, help="Longitude, degrees east.  [default: as of --lat]")
@click.option("--height", "height_m", type=float, default=2.0, show_default=True, help="Metres above the ground.")
@click.option("--ground", "ground_m", type=float,
              help="Of --clear: height of the ground above sea level, m.  [default: as files of --station or --aeronet "
              "say, else 0]")  # fmt: skip
@click.option("--start", help="First time, UTC, ISO 8601.  [default: the model's times]")
@click.option("--end", help="Last time, UTC.  [default: --start, or the model's last]")
@click.option("--every", help="From time to time, such as 10min or 30s.  [default: 1min; the model's own times]")
@click.option("--plane", "planes", multiple=True, metavar="TILT,AZIMUTH",
              help="A tilted plane: degrees from the horizontal, and the azimuth that it faces, degrees clockwise from "
              "north; may be given several times.")  # fmt: skip
@click.option("--wavelengths", help="Wavelengths of the spectral parts, nm.  [default: 870,615,500,400]")
@click.option("--vapour", "vapour_cm", type=float, help="Precipitable water, cm.  [default: the scene's own]")
@click.option("--aeronet", type=PATH, multiple=True,
              help="Of --clear: aerosol, water vapour and ozone by files of AERONET.")  # fmt: skip
@click.option("--aod", type=float, help="Of --clear: aerosol optical depth at 550 nm.  [default: .05]")
@click.option("--albedo", type=float,
              help="Of --clear: albedo of the ground.  [default: as measured, else .2]")
@click.option(
    "--station", type=PATH,
    help="Compare with this file of BSRN, SURFRAD, SOLRAD, MIDC or ARM, or a CSV table with columns utc and ghi.",
)  # fmt: skip
@click.option("--fit", type=click.Choice(("beam", "first-half", "second-half")),
              help="Of --clear: fit the aerosol to the station's DNI, of all clear times or half of them.")  # fmt: skip
@click.option("--plot", type=PATH, help="Picture of model and station, .png.")
@member
@solver()
@click.option("-o", "--output", type=PATH, help="File to write, .nc or .csv.")
@debug
def irradiance(**options: Any) -> None:
    """Global, direct and diffuse irradiance through time, from a model's FILES or for a clear sky."""
    from openswim.cli.irradiance import IrradianceRequest, run

    run(IrradianceRequest(**options))


@click.command(short_help="A model's clouds as an imager in space sees them.")
@click.argument("files", type=PATH, nargs=-1, required=True)
@click.option("--like", type=PATH,
              help="Observed picture on a fixed grid (.nc or .tif): its pixels and time are taken.")  # fmt: skip
@click.option("--grid", help="In place of --like: the imager's own pixels, 'full' disc or (of ABI) 'conus', where they "
              "show the model's domain.")  # fmt: skip
@click.option("--every", type=int,
              help="Of --grid: 2 for each second pixel, and so on.  [default: 1000 or fewer across]")  # fmt: skip
@click.option("--lon-0", type=float, help="Of --grid: longitude below the satellite.  [default: its usual place]")
@click.option("--disc", type=(float, float, float), metavar="LAT LON KM",
              help="In place of --like: the whole disc from L1, by the point below the satellite and its distance from "
              "the Earth's centre, as the list of EPIC's pictures has them.")  # fmt: skip
@click.option("--size", type=int, help="Of --disc: rows and columns.  [default: 512]")
@click.option("--imager", default="goes-16 abi", show_default=True, help="Such as 'himawari-9 ahi', 'mtg-i1 fci'.")
@click.option("--band", "bands", multiple=True, help="Name of a band, such as C02; that of --like is compared.")
@click.option("--time",
              help="UTC, of the model and its light.  [default: the model's nearest to the observed picture's, in the "
              "latter's light; without such a picture the model's first]")  # fmt: skip
@member
@solver()
@click.option("-o", "--output", "outputs", type=PATH, multiple=True, help=".nc or .tif to write.")
@debug
def satellite(**options: Any) -> None:
    """The clouds of a model's FILES as an imager in space sees them, beside what it saw (--like) or alone."""
    from openswim.cli.satellite import SatelliteRequest, run

    run(SatelliteRequest(**options))


@click.command(short_help="Compare with reference files; print a table.")
@click.argument("directory", type=PATH)
@solver(*SOLVERS, "linear")
@quality
@click.option("--json", "json_path", type=PATH, help="Also write the rows to this file.")
@click.option("--seconds", type=float, help="Of --solver reference: CPU seconds per view.  [default: 3]")
@debug
def validate(
    directory: Path, solver: str, quality: str | None, json_path: Path | None, seconds: float | None
) -> None:
    """Compare with every reference file below DIRECTORY; print a table, worst first."""
    from openswim.cli.validate import run

    run(directory, solver, json_path, seconds, quality)


@click.group(short_help="Aerosol types and phase functions.")
def aerosol() -> None:
    """Aerosol types, and phase functions from size and refractive index."""


@aerosol.command("types", short_help="List the aerosol types that may be named.")
@debug
def aerosol_types() -> None:
    """List the aerosol types that can be named wherever an aerosol is described."""
    from openswim.cli.aerosol import list_types

    list_types()


@aerosol.command("fit", short_help="Fit Eq. 28 of Albers et al. (2020) to Mie theory.")
@click.option(
    "--mode", "modes", multiple=True, metavar="RADIUS,STD[,AMOUNT]",
    help="A lognormal mode: median radius in um, geometric standard deviation (above 1), relative amount (1). "
    "May be given several times.",
)  # fmt: skip
@click.option("--by", type=click.Choice(("number", "volume")),
              help="What --mode describes: median radius and amount by number or by volume.  "
              "[default: number]")  # fmt: skip
@click.option(
    "--index", "indices", multiple=True, metavar="[WAVELENGTH:]N+Ki",
    help="Complex refractive index, such as 1.5+0.01i; one for all, or several such as 440:1.56+0.003i in nm. "
    "1.5-0.01i says the same.",
)  # fmt: skip
@click.option("--irregular", is_flag=True, help="Particles of size parameters above 3-8 are irregular, as dust is.")
@click.option("--type", "type_name", help="Fit the phase function of a named type in place of --mode and --index.")
@click.option(
    "--aeronet", type=PATH, multiple=True,
    help="File of AERONET's inversions (.all, .pfn), in place of --mode and --index; may be given often.",
)  # fmt: skip
@click.option("--time", help="Of --aeronet: UTC; the nearest row.  [default: the mean of all]")
@click.option("--wavelengths", default="615,546,450", show_default=True, help="Wavelengths in nm.")
@click.option("--json", "json_path", type=PATH, help="Also write the fit to this file.")
@click.option("--plot", "plot_path", type=PATH, help="Also draw the fit as this picture (.png).")
@debug
def aerosol_fit(**options: Any) -> None:
    """Fit the double Henyey-Greenstein function to Mie theory for given particles.

    Prints g_1 (sharp lobe), g_2 (broad lobe), f_c (share of the sharp lobe) and f_b of Albers et al. 2020, Eq. 28, the
    root mean square of ln(fit/Mie) over 1-180 degrees, and the single-scattering albedo.

    Example: openswim aerosol fit --mode 0.12,1.5,0.03 --mode 2.3,1.8,0.47 --by volume --index 1.56+0.002i
    """
    from openswim.cli.aerosol import FitRequest, fit

    fit(FitRequest(**options))
