"""The variables a scene may hold: the one table that validation, the file layout and the readers share."""

from __future__ import annotations

import difflib
from dataclasses import dataclass

from openswim.arguments import check_kind, shown
from openswim.errors import UserError

HYDROMETEORS = ("liquid", "ice", "rain", "snow", "graupel")
DIRECT_PREFIX = "extinction_"
MOST_BYTES = 200  # of a name; netCDF allows 256
LEVEL_DIMS = ("z", "y", "x")
SURFACE_DIMS = ("y", "x")


@dataclass(frozen=True)
class Variable:
    """Unit and names of a variable, the range sane values keep to, and whether noise beyond it is clipped."""

    units: str
    long_name: str
    low: float
    high: float
    standard_name: str | None = None
    dims: tuple[str, ...] = LEVEL_DIMS
    clip: bool = False  # values just outside the range are numerical noise and are clipped
    noise: float | None = None  # how far outside any value may be, where nothing else is; None: 1e-7 of the range
    hint: str = ""  # the likely cause of values out of range


_LIQUID_DROPS = "cloud_liquid_water_particles"
_STANDARD = {
    "liquid_content": "mass_concentration_of_cloud_liquid_water_in_air",
    "liquid_effective_radius": f"effective_radius_of_{_LIQUID_DROPS}",
    "liquid_number": f"number_concentration_of_{_LIQUID_DROPS}_in_air",
    "ice_number": "number_concentration_of_ice_crystals_in_air",
}
_LABEL = {
    "liquid": "cloud liquid water",
    "ice": "cloud ice",
    "rain": "rain",
    "snow": "snow",
    "graupel": "graupel",
}


def _fraction(long_name: str, standard_name: str) -> Variable:
    return Variable(
        "1", long_name, 0.0, 1.0, standard_name, SURFACE_DIMS, clip=True, hint="is it in percent?"
    )


def _hydrometeors() -> dict[str, Variable]:
    kinds = (
        ("content", "kg m-3", "mass content of", 0.1, None, "is it in g m-3, or a mixing ratio?"),
        ("effective_radius", "m", "effective radius of", 0.1, None, "is it in micrometres?"),
        ("number", "m-3", "number concentration of", 1e13, 1.0, "is it a fill value?"),
    )
    return {
        f"{species}_{suffix}": Variable(
            units,
            f"{what} {_LABEL[species]}",
            0.0,
            high,
            _STANDARD.get(f"{species}_{suffix}"),
            clip=True,
            noise=noise,
            hint=hint,
        )
        for species in HYDROMETEORS
        for suffix, units, what, high, noise, hint in kinds
    }


VARIABLES: dict[str, Variable] = _hydrometeors() | {
    "aerosol_extinction": Variable(
        "m-1",
        "aerosol extinction at 550 nm",
        0.0,
        1.0,
        "volume_extinction_coefficient_in_air_due_to_ambient_aerosol_particles",
        clip=True,
        hint="is it in km-1?",
    ),
    "cloud_area_fraction": Variable(
        "1", "fraction of a cell that its cloud covers", 0.0, 1.0, "cloud_area_fraction_in_atmosphere_layer", clip=True,
        hint="is it in percent?",
    ),
    "liquid_effective_variance": Variable(
        "1", "effective variance of the sizes of cloud droplets", 0.01, 0.1, dims=()
    ),
    "ice_pristine_fraction": Variable("1", "share of the ice's extinction by smooth prisms", 0.0, 1.0, dims=()),
    "ice_level_plate_fraction": Variable("1", "share of the ice's extinction by level plates", 0.0, 1.0, dims=()),
    "ice_level_column_fraction": Variable("1", "share of the ice's extinction by level columns", 0.0, 1.0, dims=()),
    "air_pressure": Variable("Pa", "air pressure", 1e-3, 1.2e5, "air_pressure", hint="is it a fill value?"),
    "air_temperature": Variable(
        "K", "air temperature", 90.0, 1200.0, "air_temperature", hint="is it in degrees Celsius?"
    ),
    "precipitable_water": Variable(
        "kg m-2", "water vapour in the column above the ground", 0.0, 150.0, "atmosphere_mass_content_of_water_vapor",
        SURFACE_DIMS, clip=True, hint="is it in mm or kg m-2?",
    ),
    "surface_altitude": Variable(
        "m", "terrain height above sea level", -1000.0, 9000.0, "surface_altitude", SURFACE_DIMS
    ),
    "land_area_fraction": _fraction("fraction of land", "land_area_fraction"),
    "snow_area_fraction": _fraction("fraction covered by snow", "surface_snow_area_fraction"),
    "sea_ice_area_fraction": _fraction("fraction covered by sea ice", "sea_ice_area_fraction"),
    "snow_depth": Variable(
        "m", "depth of snow on the ground", 0.0, 1000.0, "surface_snow_thickness", SURFACE_DIMS, clip=True,
        hint="is it in millimetres?",
    ),
    "snow_age": Variable(
        "day", "age of the snow's surface", 0.0, 1e5, "age_of_surface_snow", SURFACE_DIMS, clip=True,
        hint="is it in seconds?",
    ),
    "surface_albedo": _fraction("surface albedo", "surface_albedo"),
    "wave_mean_square_slope": Variable(
        "1", "mean square slope of waves; 0 where it is not known", 0.0, 0.5, None, SURFACE_DIMS, clip=True
    ),
    "wind_east": Variable("m s-1", "eastward wind", -250.0, 250.0, "eastward_wind"),
    "wind_north": Variable("m s-1", "northward wind", -250.0, 250.0, "northward_wind"),
    "wind_east_10m": Variable(
        "m s-1", "eastward wind 10 m above ground", -150.0, 150.0, "eastward_wind", SURFACE_DIMS
    ),
    "wind_north_10m": Variable(
        "m s-1", "northward wind 10 m above ground", -150.0, 150.0, "northward_wind", SURFACE_DIMS
    ),
}
_DIRECT = Variable("m-1", "extinction coefficient", 0.0, 1e6, clip=True, noise=1e-7, hint="is it a fill value?")


def is_known(name: str) -> bool:
    """True for a name of the table and for any extinction_<name>."""
    return name in VARIABLES or (name.startswith(DIRECT_PREFIX) and len(name) > len(DIRECT_PREFIX))


def variable(name: str) -> Variable:
    """The entry of a variable of a scene; a UserError (with the nearest known name) where there is none."""
    check_kind("scene: name of a variable", name, str, "docs/scene-format.md lists the names")
    if name in VARIABLES:
        return VARIABLES[name]
    if not name.isprintable() or "/" in name or name != name.strip() or len(name.encode()) > MOST_BYTES:
        raise UserError(f"scene: no file can hold a variable named {shown(name)}: use letters, digits, _ and -")
    if is_known(name):
        return _DIRECT
    near = difflib.get_close_matches(name, VARIABLES, n=1)
    remedy = f"did you mean {near[0]}?" if near else "docs/scene-format.md lists the names"
    raise UserError(f"scene: unknown variable {name}: {remedy}")


def species_of(names: list[str]) -> list[str]:
    """Species present among variable names: hydrometeors by their content, "aerosol", then direct species."""
    found = [species for species in HYDROMETEORS if f"{species}_content" in names]
    if "aerosol_extinction" in names:
        found.append("aerosol")
    return found + [name.removeprefix(DIRECT_PREFIX) for name in names if name.startswith(DIRECT_PREFIX)]
