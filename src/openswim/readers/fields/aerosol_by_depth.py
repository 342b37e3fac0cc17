"""Aerosol of which only the optical depth of the column is known, by kind."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from openswim.readers.fields.aerosol_species import optics_by_depth
from openswim.scene import Optics

F32 = NDArray[np.float32]

SCALE_M = 2000.0
TOTAL = "aerosol"  # the depth of all kinds together, and what of it is of no kind
_REST = 0.02  # of the whole that may be of no kind: packing


# Of variables, by model; in small letters.
NAMES: dict[str, str] = {
    # NAAPS and the ensemble of ICAP; fine particles of man and plants are counted as sulphate
    "dust_aod": "dust", "smoke_aod": "smoke", "salt_aod": "sea_salt", "ss_aod": "sea_salt", "seasalt_aod": "sea_salt",
    "abf_aod": "sulphate", "anthro_aod": "sulphate", "sulfate_aod": "sulphate", "total_aod": TOTAL,
    # CAMS
    "duaod550": "dust", "ssaod550": "sea_salt", "omaod550": "organic_matter", "bcaod550": "black_carbon",
    "suaod550": "sulphate", "niaod550": "nitrate", "aod550": TOTAL,
    # MERRA-2 and GEOS
    "duexttau": "dust", "ssexttau": "sea_salt", "ocexttau": "organic_matter", "bcexttau": "black_carbon",
    "suexttau": "sulphate", "niexttau": "nitrate", "totexttau": TOTAL,
}  # fmt: skip


def from_depths(
    depths: Mapping[str, F32], height_m: NDArray[Any], terrain_m: F32 | None, notes: list[str]
) -> tuple[dict[str, F32], dict[str, Optics]]:
    """Extinction at 550 nm (nz, ny, nx) on levels, and optics, of optical depths (ny, nx) at 550 nm by kind.

    It thins with height above the ground by 1/e in 2 km. What a total has more than its kinds is aerosol of no kind.
    """
    given = dict(depths)
    total = given.pop(TOTAL, None)
    if given and total is not None:
        rest = np.maximum(total - np.sum(list(given.values()), axis=0), np.float32(0))
        total = rest if float(rest.sum(dtype=np.float64)) > _REST * float(total.sum(dtype=np.float64)) else None
    if total is not None:
        given[TOTAL] = total
    shape = next(iter(given.values())).shape
    height = height_m[:, None, None] if height_m.ndim == 1 else height_m
    above = np.maximum(height - (0.0 if terrain_m is None else terrain_m), 0.0)
    thinned = np.broadcast_to(np.exp(-above / SCALE_M), (len(height_m), *shape))
    ground = np.zeros(shape) if terrain_m is None else terrain_m
    thickness = _above_ground(thinned, np.broadcast_to(height, thinned.shape), ground)
    fields = {kind: np.asarray(depth * thinned / thickness, np.float32) for kind, depth in given.items()}
    names = ", ".join("of no kind" if kind == TOTAL else kind.replace("_", " ") for kind in given)
    what = "aerosol" if list(given) == [TOTAL] else f"aerosol ({names})"
    notes.append(f"{what} from its optical depth at 550 nm, thinning with height by 1/e in 2 km")
    return fields, {kind: optics_by_depth(kind) for kind in given}


def _above_ground(field: NDArray[Any], height_m: NDArray[Any], ground_m: NDArray[Any]) -> NDArray[np.float64]:
    """Column above the ground of a field (nz, ny, nx) that is linear between its levels, and even below the lowest."""
    out = np.asarray(field[0] * np.maximum(height_m[0] - ground_m, 0.0), float)
    for low, high, below, above in zip(field[:-1], field[1:], height_m[:-1], height_m[1:], strict=True):
        start = np.clip(ground_m, below, above)
        there = low + (high - low) * (start - below) / (above - below)
        out += 0.5 * (there + high) * (above - start)
    return out
