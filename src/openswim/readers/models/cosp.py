"""Input files of the COSP satellite simulator, as the Met Office Unified Model writes them."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from openswim.errors import UserError
from openswim.readers.common.fileset import values
from openswim.readers.fields.particles import Category, checked_content, known_sizes, together
from openswim.readers.gridded.reader import GriddedReader

F32 = NDArray[np.float32]
# Scene species: (mixing ratio, index of its effective radius along `hydro`), large-scale then convective.
SPECIES = {"liquid": (("mr_lsliq", 0), ("mr_ccliq", 4)), "ice": (("mr_lsice", 1), ("mr_ccice", 5))}
RAIN, SNOW, GRAUPEL = ("fl_lsrain", "fl_ccrain"), ("fl_lssnow", "fl_ccsnow"), ("fl_lsgrpl",)
_KINDS = 9  # of particles in COSP, along `hydro`
_SNOW_FALL_M_S, _GRAUPEL_FALL_M_S = 1.0, 3.0


class COSPReader(GriddedReader):
    """Reads COSP input: condensate of two cloud kinds, precipitation fluxes, effective radii."""

    name = "COSP input (UM)"

    def recognises(self, data: xr.Dataset) -> bool:
        return {"mr_lsliq", "pfull", "T_abs"} <= set(data.variables)

    def adapt(self, path: Path, data: xr.Dataset) -> xr.Dataset:
        """Fluxes to contents, both kinds of cloud to one, radii by species."""
        dims = data["mr_lsliq"].dims
        out: dict[str, Any] = {}
        notes: list[str] = []

        def field(name: str, units: str = "kg kg-1") -> F32:
            return checked_content(name, values(path, data[name].transpose(*dims), units), units, notes)

        def radius(index: int, content: F32) -> F32 | None:
            if not np.any(content > 0) or "Reff" not in data.variables or data["Reff"].ndim != 4:
                return None
            if data["Reff"].shape[0] != _KINDS:
                kinds = data["Reff"].shape[0]
                raise UserError(f"{path}: Reff has {kinds} kinds of particles; COSP has {_KINDS}: damaged header")
            return known_sizes(f"Reff {index}", values(path, data["Reff"][index].transpose(*dims), "m"), notes)

        wanted = [name for kinds in SPECIES.values() for name, _ in kinds]
        lacking = [name for name in (*wanted, *RAIN, *SNOW, *GRAUPEL, "Reff") if name not in data.variables]
        notes += [f"no {', '.join(lacking)} in the file: none of it"] if lacking else []
        for species, kinds in SPECIES.items():
            contents = [(field(name), index) for name, index in kinds if name in data.variables]
            there = [Category(content, None, radius(index, content)) for content, index in contents]
            content, size = together(species, there) if there else (None, None)
            if content is not None:
                attrs = {"units": "kg kg-1", "standard_name": f"{species}_mixing_ratio"}
                attrs["called"] = ", ".join(name for name, _ in kinds)
                out[f"{species}_content"] = (dims, content, attrs)
            if size is not None:
                out[f"{species}_effective_radius"] = (dims, size, {"units": "m"})
        for species, names in (("rain", RAIN), ("snow", SNOW), ("graupel", GRAUPEL)):
            flux = [field(name, "kg m-2 s-1") for name in names if name in data.variables]
            if flux:
                attrs = {"units": "kg m-3", "called": ", ".join(names)}
                out[f"{species}_content"] = (dims, content_of_flux(species, flux), attrs)
                notes.append(f"{species} content from its flux ({', '.join(names)})")
        renamed = {"T_abs": "temperature", "pfull": "pressure", "tca": "cloud_fraction", "height": "height"}
        renamed |= {"orography": "surface_altitude", "landmask": "lsm", "u_wind": "u10", "v_wind": "v10", "qv": "hus"}
        for name, target in renamed.items():
            if name in data.variables:
                out[target] = data[name].assign_attrs(called=name).variable
        coords = {str(name): data[name].variable for name in data.coords}
        attrs = {"title": "COSP input of the Met Office Unified Model", "openswim_notes": "\n".join(notes)}
        return xr.Dataset(out, coords=coords, attrs=attrs)


def content_of_flux(species: str, fluxes: list[F32]) -> F32:
    """Content [kg m-3] of precipitation fluxes [kg m-2 s-1].

    Rain: 72 mg m-3 (R/mm h-1)^.88 (Marshall and Palmer 1948); snow and graupel fall at 1 and 3 m/s.
    """
    if species == "rain":
        return np.sum([72e-6 * (3600.0 * flux) ** 0.88 for flux in fluxes], axis=0).astype(np.float32)
    fall = _SNOW_FALL_M_S if species == "snow" else _GRAUPEL_FALL_M_S
    return np.asarray(np.sum(fluxes, axis=0) / np.float32(fall), np.float32)
