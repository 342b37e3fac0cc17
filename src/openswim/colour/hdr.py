"""Linear light for renderers: OpenEXR, and a Radiance picture with the sun as a source of its own.

Red, green and blue are of the primaries and the white of sRGB, unbounded, in W m-2 sr-1 as Radiance counts it: their
luminance times 179 lm/W is that of the image in cd/m2, within .6 % (the sun's white is carried to that of displays).
"""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from openswim.colour.beside import BESIDE, beside
from openswim.colour.cie import solar_illuminance_lx
from openswim.colour.glare import sun_seen
from openswim.colour.rgb import to_linear_rgb
from openswim.errors import UserError
from openswim.scene.files import written_whole
from openswim.scene.frame import horizon_vector

F32 = NDArray[np.float32]

LUMENS_PER_WATT = 179.0  # Radiance's
SUN_DIAMETER_DEG = 0.5332
_PRIMARIES = ".640 .330 .300 .600 .150 .060 .3127 .3290"
_RUN = 128  # bytes of a literal run in a line of RGBE
_MOST_HALF, _LEAST_HALF = 65504.0, 2.0**-14  # between which half floats have 11 bits


def save_light_picture(image: xr.Dataset, path: Path) -> None:
    """Write an image as .exr, or as .hdr. Panoramas and spheres that see the sun become a Radiance sky: a .hdr without
    the sun's disc, and beside it a scene (.rad) with sky and sun, and the sky's coordinates (.cal)."""
    if path.suffix.lower() == ".exr":
        with written_whole(path) as partial:
            _write_exr(image, partial)
        return
    round_about = bool(beside(path, image.attrs.get("view")))
    sun = None
    if round_about:
        image, sun = without_sun(image)
    with written_whole(path) as partial:
        partial.write_bytes(rgbe(radiance_rgb(image), _about(image)))
    if round_about:
        for suffix, text in zip(BESIDE, (sky_coordinates(image), radiance_scene(image, sun, path)), strict=True):
            with written_whole(path.with_suffix(suffix)) as partial:
                partial.write_text(text)


def radiance_rgb(image: xr.Dataset | xr.DataArray, sun_distance_au: float | None = None) -> F32:
    """(..., 3) W m-2 sr-1 by Radiance's count; NaN pixels are 0."""
    if sun_distance_au is None:
        sun_distance_au = float(image.attrs.get("sun_distance_au", 1.0))
    per_unit = solar_illuminance_lx() / (4 * math.pi * sun_distance_au**2) / LUMENS_PER_WATT
    return np.asarray(np.nan_to_num(np.maximum(to_linear_rgb(image), 0)) * np.float32(per_unit), np.float32)


def without_sun(image: xr.Dataset) -> tuple[xr.Dataset, F32 | None]:
    """The image with sky in place of the sun's disc, and the irradiance (3,) across the beam that this took, W m-2 by
    Radiance's count; None where no sun is seen."""
    found = sun_seen(image)
    if found is None:
        return image, None
    out = image.copy()
    light = image["solar_relative_radiance"].transpose("y", "x", "wavelength").copy(deep=True)
    part = light.values[found.rows]
    part[found.sunny] = found.sky
    out["solar_relative_radiance"] = light
    beam = xr.DataArray(found.irradiance, dims="wavelength", coords={"wavelength": image["wavelength"]})
    return out, radiance_rgb(beam, float(image.attrs.get("sun_distance_au", 1.0)))


def rgbe(light: F32, about: str = "") -> bytes:
    """A Radiance picture (y, x, 3): 8 bits a colour and a common exponent, within .4 % of the brightest colour."""
    ny, nx, _ = light.shape
    most = light.max(axis=-1)
    exponent = np.where(most > 1e-32, np.frexp(np.maximum(most, 1e-32))[1], -128)
    scale = np.where(most > 1e-32, np.ldexp(1.0, 8 - exponent), 0.0)
    pixels = np.empty((ny, nx, 4), np.uint8)
    pixels[..., :3] = np.clip(light * scale[..., None], 0, 255)
    pixels[..., 3] = exponent + 128
    head = f"#?RADIANCE\nSOFTWARE=OpenSWIm\n{about}PRIMARIES={_PRIMARIES}\nFORMAT=32-bit_rle_rgbe\n\n-Y {ny} +X {nx}\n"
    if not 8 <= nx < 32768:
        return head.encode() + pixels.tobytes()
    begin = np.array([2, 2, nx >> 8, nx & 255], np.uint8)
    starts = np.arange(0, nx, _RUN)
    counts = np.minimum(nx - starts, _RUN).astype(np.uint8)
    lines = [np.insert(pixels[..., n], starts, counts, axis=1) for n in range(4)]
    return head.encode() + np.concatenate([np.broadcast_to(begin, (ny, 4)), *lines], axis=1).tobytes()


def sky_coordinates(image: xr.Dataset) -> str:
    """Radiance functions sky_u, sky_v of a direction (x east, y north, z up): its place in a panorama or a sphere."""
    azimuth, altitude = image["azimuth"].values.astype(float), image["altitude"].values.astype(float)
    ny, nx = azimuth.shape
    row = altitude[:, 0]
    step = (row[0] - row[-1]) / max(ny - 1, 1)
    low, high = row[-1] - 0.5 * step, row[0] + 0.5 * step
    middle = float(azimuth[ny // 2, nx // 2]) - 180.0 / nx * (1 - nx % 2)
    shorter = min(nx, ny)
    return (
        f"{{ {nx} x {ny} pixels about azimuth {middle:.6g} degrees, altitudes {low:.6g} to {high:.6g} }}\n"
        f"sky_turn = atan2(Dx, Dy) - {math.radians(middle):.9g};\n"
        "sky_round = if(sky_turn - PI, sky_turn - 2*PI, if(-PI - sky_turn, sky_turn + 2*PI, sky_turn));\n"
        "sky_alt = asin(if(Dz - 1, 1, if(-1 - Dz, -1, Dz)));\n"
        f"sky_u = (0.5 + sky_round/(2*PI)) * {nx / shorter:.9g};\n"
        f"sky_v = (sky_alt - {math.radians(low):.9g})/{math.radians(high - low):.9g} * {ny / shorter:.9g};\n"
    )


def radiance_scene(image: xr.Dataset, sun: F32 | None, path: Path) -> str:
    """A Radiance scene: the picture as a glow all around, and the sun as a source of its own."""
    name, calculated = (f'"{p.name}"' if " " in p.name else p.name for p in (path, path.with_suffix(".cal")))
    text = (
        f"# {_about(image).strip()}\n"
        f"void colorpict openswim_sky\n7 red green blue {name} {calculated} sky_u sky_v\n0\n0\n\n"
        "openswim_sky glow openswim_glow\n0\n0\n4 1 1 1 0\n\n"
        "openswim_glow source openswim_dome\n0\n0\n4 0 0 1 360\n"
    )
    if sun is None or not sun.any():
        return text
    solid_angle = 2 * math.pi * (1 - math.cos(math.radians(SUN_DIAMETER_DEG / 2)))
    direction = horizon_vector(float(image.attrs["sun_azimuth_deg"]), float(image.attrs["sun_altitude_deg"]))
    light = " ".join(f"{value:.6g}" for value in sun / solid_angle)
    toward = " ".join(f"{value:.8g}" for value in np.ravel(direction))
    return text + (
        f"\nvoid light openswim_sunlight\n0\n0\n3 {light}\n\n"
        f"openswim_sunlight source openswim_sun\n0\n0\n4 {toward} {SUN_DIAMETER_DEG}\n"
    )


def exr_library() -> Any:
    """The package OpenEXR, or a UserError that says how to get it."""
    try:
        import OpenEXR
    except ImportError as error:
        raise UserError(".exr needs the package OpenEXR: pip install 'openswim[hdr]', or write .hdr") from error
    return OpenEXR


def _write_exr(image: xr.Dataset, path: Path) -> None:
    """Channels R, G, B in single precision, and spectral radiance (W m-2 sr-1 nm-1), one channel a wavelength: as half
    floats, or, where any of it is too little for these, as at dusk and at night, in single precision; Z is the distance
    of what is seen (m), where the image has it, infinite where that is the sky."""
    library = exr_library()
    rgb = radiance_rgb(image)
    channels = {name: np.ascontiguousarray(rgb[..., n]) for n, name in enumerate("RGB")}
    if "radiance" in image:
        radiance = np.nan_to_num(image["radiance"].transpose("y", "x", "wavelength").values)
        dim = ((radiance > 0) & (radiance < _LEAST_HALF)).any()
        kept = np.float32 if dim else np.float16
        radiance = np.clip(radiance, 0, None if dim else _MOST_HALF)
        for n, wavelength in enumerate(image["wavelength"].values):
            channels[f"radiance.{wavelength:g}nm"] = np.ascontiguousarray(radiance[..., n], kept)
    if "distance" in image:
        metres = image["distance"].transpose("y", "x").values.astype(np.float32)
        channels["Z"] = np.ascontiguousarray(np.where(np.isnan(metres), np.float32(np.inf), metres))
    header = {"compression": library.ZIP_COMPRESSION, "type": library.scanlineimage, "comments": _about(image).strip()}
    with library.File(header, channels) as file:
        file.write(str(path))


def _about(image: xr.Dataset) -> str:
    from openswim.colour.caption import facts

    found = "; ".join(f"{key} {value}" for key, value in facts(image).items())
    return f"OPENSWIM={' '.join(found.split())}\n" if found else ""
