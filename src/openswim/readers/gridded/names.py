"""What models call things: names, CF standard names and units of the quantities a scene is made from.

A variable is taken for a quantity when its name (or its standard_name) is listed *and* its units convert. Which
model uses which name: docs/models.md.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace

import xarray as xr

from openswim.scene.labels.units import conversion


@dataclass(frozen=True)
class Quantity:
    """Unit the quantity is wanted in, and what files call it."""

    units: str
    names: tuple[str, ...]
    standard_names: tuple[str, ...] = ()
    unitless: bool = False  # a file may leave out the units


def _and_own(quantities: dict[str, Quantity], suffix: str = "") -> dict[str, Quantity]:
    """Files may use a scene's own names (docs/scene-format.md), too, on dimensions of any name."""
    return {what: replace(q, names=(*q.names, f"{what}{suffix}")) for what, q in quantities.items()}


def _q(units: str, names: str, standard_names: str = "", unitless: bool = False) -> Quantity:
    return Quantity(units, tuple(names.split()), tuple(standard_names.split()), unitless)


# On levels. ECMWF (ERA5, CAMS, IFS), MERRA-2, Met Office (UM), COSP, MicroHH, PALM, CM1, SAM in turn.
STATE: dict[str, Quantity] = {
    "altitude": _q("m", "altitude height H HT zhval z_full level_height", "altitude height_above_reference_ellipsoid"),
    "geopotential": _q("m2 s-2", "z geopotential PHI", "geopotential"),
    "geopotential_height": _q("m", "gh hgt zg H", "geopotential_height"),
    "pressure": _q("Pa", "pres pressure PL pfull prs p phydro air_pressure P", "air_pressure"),
    "thickness": _q("Pa", "DELP delp"),
    "temperature": _q("K", "t T ta temp T_abs temperature air_temperature tabs TABS tk", "air_temperature"),
    "potential_temperature": _q("K", "th theta pt THETA air_potential_temperature", "air_potential_temperature"),
    "density": _q("kg m-3", "AIRDENS rho rhoa air_density", "air_density"),
    "specific_humidity": _q("kg kg-1", "q hus QV qv QVAPOR qt", "specific_humidity humidity_mixing_ratio"),
    "relative_humidity": _q("1", "r RH rh hur relative_humidity", "relative_humidity"),
    "cloud_fraction": _q("1", "cc CLOUD tca cl clc cloud_fraction cloud_area_fraction",
                         "cloud_area_fraction_in_atmosphere_layer", True),
}  # fmt: skip

_WATER = "mass_fraction_of_{0}_in_air mass_concentration_of_{0}_in_air {0}_mixing_ratio"
# One variable of each list counts, and lists are added up: some models keep convective cloud or hail apart.
CONTENTS: dict[str, tuple[Quantity, ...]] = {
    "liquid": (
        _q("kg kg-1", "liquid_content clwc QL qc QC ql clw qcl QCLOUD QN", _WATER.format("cloud_liquid_water")),
        _q("kg kg-1", "", "mass_fraction_of_convective_cloud_liquid_water_in_air"),
    ),
    "ice": (
        _q("kg kg-1", "ice_content ciwc QI qi cli qcf QICE", _WATER.format("cloud_ice")),
        _q("kg kg-1", "", "mass_fraction_of_convective_cloud_ice_in_air"),
    ),
    "rain": (_q("kg kg-1", "rain_content crwc QR qr QRAIN", _WATER.format("rain")),),
    "snow": (_q("kg kg-1", "snow_content cswc QS qs QSNOW", _WATER.format("snow")),),
    "graupel": (
        _q("kg kg-1", "graupel_content qg QG QGRAUP", _WATER.format("graupel")),
        _q("kg kg-1", "qh qhl QHAIL", _WATER.format("hail")),
    ),
}
NUMBERS: dict[str, Quantity] = _and_own({
    "liquid": _q("kg-1", "nc ncc qnc QNCLOUD ccl nd", "number_concentration_of_cloud_liquid_water_particles_in_air"),
    "ice": _q("kg-1", "nci ni qni QNICE", "number_concentration_of_ice_crystals_in_air"),
    "rain": _q("kg-1", "nr ncr qnr QNRAIN"),
    "snow": _q("kg-1", "ns ncs qns QNSNOW"),
    "graupel": _q("kg-1", "ng ncg qng QNGRAUPEL"),
}, "_number")  # fmt: skip
_SIZE = "effective_radius_of_cloud_{}_particles"
RADII: dict[str, Quantity] = {
    "liquid": _q("m", "liquid_effective_radius re_liquid RE_CLOUD effc rel RL reffc", _SIZE.format("liquid_water")),
    "ice": _q("m", "ice_effective_radius re_ice RE_ICE effi rei RI reff_ice", _SIZE.format("ice")),
    "rain": _q("m", "rain_effective_radius RR"),
    "snow": _q("m", "snow_effective_radius RE_SNOW effs RS"),
    "graupel": _q("m", "graupel_effective_radius"),
}

# along the grid's axes where the standard name says so
WIND = _and_own({
    "wind_east": _q("m s-1", "u U ua uinterp", "eastward_wind x_wind grid_eastward_wind"),
    "wind_north": _q("m s-1", "v V va vinterp", "northward_wind y_wind grid_northward_wind"),
})  # fmt: skip
SURFACE: dict[str, Quantity] = _and_own({
    "surface_altitude": _q("m", "orog orography surface_altitude zs topo hgt HGT terrain", "surface_altitude"),
    "surface_geopotential": _q("m2 s-2", "PHIS z zs", "surface_geopotential geopotential"),
    "land_area_fraction": _q("1", "lsm landmask FRLAND LAND sftlf", "land_area_fraction land_binary_mask", True),
    "sea_ice_area_fraction": _q("1", "siconc ci FRSEAICE sic", "sea_ice_area_fraction", True),
    "snow_area_fraction": _q("1", "snowc snc FRSNO", "surface_snow_area_fraction", True),
    "snow_water": _q("m", "sd", "lwe_thickness_of_surface_snow_amount"),
    "surface_albedo": _q("1", "fal al ALBEDO albedo", "surface_albedo", True),
    "surface_pressure": _q("Pa", "sp ps PS psfc surface_air_pressure", "surface_air_pressure"),
    "wind_east_10m": _q("m s-1", "u10 10u U10M u10m", "x_wind eastward_wind grid_eastward_wind"),
    "wave_mean_square_slope": _q(
        "1", "msqs mss", "sea_surface_wave_mean_square_slope sea_surface_mean_square_slope", True),
    "wind_north_10m": _q("m s-1", "v10 10v V10M v10m", "y_wind northward_wind grid_northward_wind"),
})  # fmt: skip
FRACTIONS = ("land_area_fraction", "sea_ice_area_fraction", "snow_area_fraction", "surface_albedo")


def matches(field: xr.DataArray, quantity: Quantity, units: Iterable[str] = ()) -> bool:
    """Whether a variable is this quantity: its name or standard_name is listed and its units convert."""
    named = str(field.name) in quantity.names
    said = str(field.attrs.get("standard_name", "")) in quantity.standard_names
    if not (named or said):
        return False
    found = field.attrs.get("units")
    if found is None or not str(found).strip():
        return said or quantity.unitless or quantity.units == "1"
    return any(conversion(str(found), wanted) is not None for wanted in (quantity.units, *units))
