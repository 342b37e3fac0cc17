"""What was seen as data: images of calibrated spectral radiance with their coordinates and attributes."""

from __future__ import annotations

from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from openswim.cameras.pixels import Pixels
from openswim.errors import UserError
from openswim.lights import solar_irradiance
from openswim.scene.frame import Frame
from openswim.system.machine import free_memory
from openswim.transport.montecarlo.reference import NO_LAYERS, ReferenceView
from openswim.transport.view.seen import View
from openswim.transport.view.sight import FIRST_SPECIES, Sight

F64 = NDArray[np.float64]

_NO_PIXEL = -1  # in `seen`, outside of a round image
PIXEL_BYTES = 90  # of memory that a view takes for each pixel and wavelength


def check_fits(shape: tuple[int, int], wavelengths: int) -> None:
    """Refuse a picture that the memory does not hold, before it is begun."""
    taken, free = PIXEL_BYTES * wavelengths * shape[0] * shape[1], free_memory()
    if taken > free:
        share = (0.8 * free / taken) ** 0.5
        raise UserError(
            f"size = {shape}: such a picture takes {taken / 1e9:.1f} GB of memory, and {free / 1e9:.1f} GB are free: "
            f"use size=({int(shape[0] * share)}, {int(shape[1] * share)}) or less"
        )


def dataset(
    frame: Frame, wavelengths_nm: F64, sun_distance_au: float, pixels: Pixels, relative: NDArray,
    view: View | ReferenceView, attrs: dict[str, Any],
) -> xr.Dataset:  # fmt: skip
    """The image of pixels that see solar-relative radiance ``relative`` (n, nw), and where they end."""
    wl = wavelengths_nm
    toa = solar_irradiance(wl) / sun_distance_au**2
    spectral = relative * (toa / (4 * np.pi)).astype(np.float32)
    dims = ("y", "x", "wavelength")
    image = xr.Dataset(
        {
            "radiance": (
                dims, pixels.image(spectral),
                {"long_name": "spectral radiance", "units": "W m-2 sr-1 nm-1"} | _which_way(pixels.altitude_deg),
            ),
            "solar_relative_radiance": (
                dims, pixels.image(relative), {"long_name": "4 pi L / E_TOA (Albers et al. 2020, Eq. 2)", "units": "1"},
            ),
            "solid_angle": (
                ("y", "x"), pixels.solid_angle_sr.astype(np.float32),
                {"long_name": "solid angle of the pixel; its sum with radiance is irradiance", "units": "sr"},
            ),
            "solar_irradiance": (
                ("wavelength",), toa,
                {"long_name": "solar spectral irradiance at the top of the atmosphere", "units": "W m-2 nm-1"},
            ),
        },
        coords={
            "wavelength": ("wavelength", wl, {"standard_name": "radiation_wavelength", "units": "nm"}),
            "azimuth": (
                ("y", "x"), pixels.azimuth_deg.astype(np.float32),
                {"long_name": "viewing azimuth, clockwise from north", "units": "degree"},
            ),
            "altitude": (
                ("y", "x"), pixels.altitude_deg.astype(np.float32),
                {"long_name": "viewing altitude above the horizon", "units": "degree"},
            ),
        },
        attrs=attrs,
    )  # fmt: skip
    if frame.curved:
        lat, lon, _ = frame.latlon(view.position)
        for name, value in (("latitude", lat), ("longitude", lon)):
            image.coords[name] = (
                ("y", "x"), pixels.image(value.astype(np.float32)),
                {"standard_name": name, "units": f"degrees_{'north' if name == 'latitude' else 'east'}",
                 "long_name": f"{name} of the ground that the pixel shows"},
            )  # fmt: skip
    return image


def check_layers(layers: bool, solver: str) -> None:
    """Complain of layers that a solver does not have, before it is begun."""
    if layers and solver == "reference":
        raise UserError(NO_LAYERS)


def add_layers(image: xr.Dataset, pixels: Pixels, sight: Sight, frame: Frame) -> None:
    """What pixels look at: its kind, distance and height, and the optical depth of each species on the way."""
    kinds = np.full(pixels.inside.shape, _NO_PIXEL, np.int8)
    kinds[pixels.inside] = sight.kind
    names = ["no_pixel", *sight.names]
    image["seen"] = (
        ("y", "x"), kinds,
        {"long_name": "what the pixel shows: a species of particles, the ground, or the sky",
         "flag_values": np.arange(_NO_PIXEL, FIRST_SPECIES + len(sight.species), dtype=np.int8),
         "flag_meanings": " ".join(names)},
    )  # fmt: skip
    for name, value, attrs in (
        ("distance", sight.distance_m, {"long_name": "distance of what is seen"}),
        ("height", frame.latlon(sight.position)[2],
         {"standard_name": "altitude", "long_name": "height above sea level of what is seen"}),
    ):  # fmt: skip
        image[name] = (("y", "x"), pixels.image(value.astype(np.float32)), attrs | {"units": "m"})
    image["optical_depth"] = (
        ("species", "y", "x"), np.moveaxis(pixels.image(sight.depth), -1, 0),
        {"long_name": "optical depth along the way to the ground or to space, at 550 nm", "units": "1"},
    )  # fmt: skip
    image.coords["species"] = ("species", np.array(sight.species, dtype=str), {"long_name": "species of particles"})


def add_errors(image: xr.Dataset, pixels: Pixels, view: ReferenceView, seed: int) -> None:
    """What Monte Carlo knows of its own noise."""
    scale = (image["solar_irradiance"].values / (4 * np.pi)).astype(np.float32)
    image["radiance_standard_error"] = (
        ("y", "x", "wavelength"), pixels.image(view.sigma * scale),
        {"long_name": "standard error of the spectral radiance", "units": "W m-2 sr-1 nm-1"},
    )  # fmt: skip
    image["radiance"].attrs["ancillary_variables"] = "radiance_standard_error"
    image.attrs |= {
        "paths_per_pixel": view.paths, "seed": seed, "interrupted": int(view.interrupted),
        "mean_error_percent": round(100 * view.mean_error, 4),
    }  # fmt: skip


def _which_way(altitude_deg: NDArray) -> dict[str, str]:
    """The standard name of light from above or from below; an image of both has none."""
    way = "" if np.nanmin(altitude_deg) < 0 else "downwelling"
    way = "upwelling" if np.nanmax(altitude_deg) <= 0 else way
    return {"standard_name": f"{way}_radiance_per_unit_wavelength_in_air"} if way else {}
