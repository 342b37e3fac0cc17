"""What is to be known of an image: place, times, sun, solver and, near the ground, the irradiance there."""

from __future__ import annotations

from datetime import UTC, datetime
from typing import Any

import numpy as np
import xarray as xr

import openswim
from openswim.cameras import Camera
from openswim.fluxes import Broadband
from openswim.pictures.observer import place_of
from openswim.scene import Scene
from openswim.transport import Field, ReferenceField


def image_attributes(
    scene: Scene, field: Field | ReferenceField, camera: Camera, sun_deg: tuple[float, float], sun_distance_au: float,
    time: np.datetime64 | None, assumptions: list[str],
) -> dict[str, Any]:  # fmt: skip
    """Of an image lit at a time by a sun at ``sun_deg``, its azimuth and altitude."""
    azimuth, altitude = sun_deg
    attrs: dict[str, Any] = {
        "Conventions": "CF-1.11",
        "title": f"OpenSWIm {camera.name} image",
        "history": f"{datetime.now(UTC):%Y-%m-%dT%H:%M:%SZ}: openswim {openswim.__version__}",
        "view": camera.name,
        "source": scene.source,
        "assumptions": "\n".join([*scene.notes, *assumptions]),
        "solver": field.solver.name,
        "quality": _quality(field),
        "sun_altitude_deg": round(altitude, 4),
        "sun_azimuth_deg": round(azimuth, 4),
        "sun_distance_au": sun_distance_au,
        "height_m": float(camera.height_m),
        "height_above": camera.above,
    }
    if camera.view == "perspective":
        attrs |= {
            "view_azimuth_deg": float(camera.azimuth_deg), "view_altitude_deg": float(camera.altitude_deg),
            "view_roll_deg": float(camera.roll_deg), "field_of_view_deg": float(camera.fov_deg),
        }  # fmt: skip
    x, y = place_of(camera)
    attrs |= {"longitude": x, "latitude": y} if field.frame.curved else {"x_m": x, "y_m": y}
    for name, when in (("valid_time", scene.time), ("light_time", time)):  # of the weather, of the sun
        if when is not None:
            attrs[name] = f"{np.datetime_as_string(np.datetime64(when), 's')}Z"
    return attrs


def _quality(field: Field | ReferenceField) -> str:
    """What was asked for; very wide domains are solved otherwise, whatever that was."""
    asked, solved = field.solver.quality, field.quality
    return asked if solved == asked else f"{asked} ({solved})"


def irradiance_attributes(spectral: xr.Dataset, wide: Broadband, illuminance_lx: float) -> dict[str, Any]:
    """Of light on the horizontal: in all, at each wavelength, and to the eye."""
    watts = {
        "global_horizontal_irradiance_w_m2": wide.global_horizontal,
        "direct_normal_irradiance_w_m2": wide.direct_normal,
        "direct_horizontal_irradiance_w_m2": wide.direct_horizontal,
        "diffuse_horizontal_irradiance_w_m2": wide.diffuse_horizontal,
    }
    # digits that count, since by night there are millionths of a W m-2
    out: dict[str, Any] = {name: float(f"{value:.6g}") for name, value in watts.items() if np.isfinite(value)}
    for part in ("global", "direct", "diffuse"):
        out[f"{part}_horizontal_spectral_irradiance_w_m2_nm"] = spectral[f"{part}_horizontal"].values.tolist()
    return out | {"illuminance_lx": float(f"{illuminance_lx:.4g}")}
