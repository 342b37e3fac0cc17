"""3-D cases: one netCDF holds the scene, the rays and their radiances; nothing about a case is built in."""

import re
from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from openswim.arguments import shown
from openswim.cameras import Rays
from openswim.errors import UserError
from openswim.scene import Scene
from openswim.scene.labels.units import conversion
from openswim.validation.geometry import grid_body, parse_body
from openswim.validation.reference import Reference, Row, Solver, Stopwatch, with_sigma
from openswim.validation.reference.metrics import image_agreement, image_score
from openswim.validation.reference.phases import PhaseTables, phase_of_attributes

Array = NDArray[np.float64]

WAVELENGTH_NM = 550.0  # the cases are monochromatic and without gas: any will do
_LENGTHS = ("x", "y", "z", "ray_origin", "pixel_u", "pixel_v")
_FINE_CELLS = 193  # across a body with sharp edges, for a solver that is to be right to its noise


def matches(reference: Reference) -> bool:
    return reference.has("radiance", "ray_origin", "ray_direction", "sun_direction")


def compare(reference: Reference, solver: Solver, phases: PhaseTables) -> Iterator[Row]:
    """A row per surface albedo: the image, on 4x4-pixel means of lit pixels."""
    reference = in_kilometres(reference)
    data = reference.data
    watch = Stopwatch()
    sun = np.asarray(data.sun_direction.values, np.float64)
    radiance = data.radiance.transpose("i", "j", ...)
    sigma = data.sigma.transpose("i", "j", ...) if "sigma" in data else 0 * radiance
    for k, albedo in enumerate(np.atleast_1d(data.surface_albedo.values)):
        exact = solver.name == "reference"
        scene = case_scene(reference, float(albedo), _FINE_CELLS if exact else None)
        with watch.running():
            field = solver.solve(scene, sun / np.linalg.norm(sun), np.array([WAVELENGTH_NM]))
            image, own = case_estimate(field, reference) if exact else case_image(field, reference)
        truth, noise = (a.values.reshape(*image.shape, -1)[..., k] for a in (radiance, sigma))
        yield reference.row(
            solver.name, f"radiance, albedo {albedo:g}", image_score(image, truth, np.hypot(noise, own)), watch.lap(),
            image_agreement(image, truth, own, noise),
        )  # fmt: skip


def in_kilometres(reference: Reference) -> Reference:
    """With lengths in km and extinction in 1/km, as they are where no units are told; raises UserError."""
    data, where = reference.data, reference.path.name
    light = str(data["radiance"].attrs.get("units", ""))
    if "W" in light:
        raise UserError(f"{where}: radiance is in {shown(light)}: give 4 pi L / E_TOA, which has no units")
    for name, metres, factor in (*((name, "m", 1e-3) for name in _LENGTHS), ("extinction", "m-1", 1e3)):
        units = str(data[name].attrs.get("units", "")) if name in data.variables else ""
        if not units:
            continue
        found = conversion(units, metres)
        if found is None:
            raise UserError(f"{where}: {name} is in {shown(units)}: give it in {'km' if metres == 'm' else 'km-1'}")
        if found[0] * factor != 1:
            data = data.assign({name: found[0] * factor * data[name]})
    return replace(reference, data=data)


def case_scene(reference: Reference, albedo: float, cells: int | None = None) -> Scene:
    data, attributes = reference.data, reference.data.attrs
    boundary = str(attributes.get("boundary", "open"))
    periodic = "periodic" in boundary
    if "extinction" in data:
        x, y, z = (data[axis].values.astype(np.float64) for axis in "xyz")
        extinction = data.extinction.transpose("z", "y", "x").values
        if periodic:
            x, y, extinction = _without_repeated_sides(x, y, extinction)
    else:
        x, y, z, extinction = grid_body(parse_body(str(attributes.get("geometry", ""))), cells)
    ground_m = _ground_m(str(attributes.get("surface", "")))
    return Scene.from_arrays(
        np.asarray(extinction, np.float32) / 1000.0,
        1000.0 * x,
        1000.0 * y,
        1000.0 * z,
        single_scattering_albedo=float(attributes.get("single_scattering_albedo", 1.0)),
        phase=phase_of_attributes(attributes, reference.path.name),
        periodic=periodic,
        surface_albedo=albedo,
        terrain_m=np.full((len(y), len(x)), ground_m) if ground_m else None,
    )


def _ground_m(surface: str) -> float:
    """Height of the ground in metres from "infinite Lambertian plane at z = 0" (km)."""
    match = re.search(r"z\s*=\s*([-+]?\d*\.?\d+)", surface)
    return 1000.0 * float(match.group(1)) if match else 0.0


def _without_repeated_sides(x: Array, y: Array, extinction: Array) -> tuple[Array, Array, Array]:
    """A periodic field whose last plane repeats the first has one plane too many for nodes a period apart."""
    if np.array_equal(extinction[..., 0], extinction[..., -1]) and np.ptp(extinction, axis=2).any():
        x, extinction = x[:-1], extinction[..., :-1]
    if np.array_equal(extinction[:, 0], extinction[:, -1]) and np.ptp(extinction, axis=1).any():
        y, extinction = y[:-1], extinction[:, :-1]
    return x, y, extinction


def _rays(reference: Reference) -> tuple[Array, Array, NDArray[np.bool_]]:
    """Origins (n, 3) in km and unit directions of the image's rays, and where in it (ni, nj) they are."""
    origin, direction = (
        reference.data[name].transpose("i", "j", "xyz").values.astype(np.float64)
        for name in ("ray_origin", "ray_direction")
    )
    known = np.asarray(np.isfinite(origin).all(-1) & np.isfinite(direction).all(-1))
    return origin[known], direction[known] / np.linalg.norm(direction[known], axis=-1, keepdims=True), known


def case_image(field: Any, reference: Reference) -> tuple[Array, Array]:
    """The image (ni, nj), NaN where there is no ray, without error; extended pixels are means over sub-rays."""
    origin, along, known = _rays(reference)
    # One view per shift: its rays then share their origin or their direction, as those of the case do.
    views = [
        field.view(Rays(1000.0 * (origin + shift), along)).radiance for shift in _footprint(reference)
    ]
    image = np.full(known.shape, np.nan)
    image[known] = np.mean(views, axis=0)[:, 0]
    return image, np.zeros_like(image)


def case_estimate(field: Any, reference: Reference) -> tuple[Array, Array]:
    """The image (ni, nj) and its standard error by a solver whose paths are spread over the pixels."""
    origin, along, known = _rays(reference)
    view = field.view(Rays(1000.0 * origin, along), *(1000.0 * side for side in _sides(reference)))
    out = []
    for values in with_sigma(view):
        image = np.full(known.shape, np.nan)
        image[known] = values[:, 0]
        out.append(image)
    return out[0], out[1]


def _sides(reference: Reference) -> list[Array]:
    """Sides (3,) in km of the parallelogram that a pixel is, zero for a point."""
    return [
        np.asarray(reference.data[name].values, np.float64) if name in reference.data else np.zeros(3)
        for name in ("pixel_u", "pixel_v")
    ]


def _footprint(reference: Reference) -> Array:
    """Offsets (n, 3) in km of a pixel's sub-rays: two on a diagonal, for sharp-edged bodies 3x3, one for a point."""
    u, v = _sides(reference)
    if not (u.any() or v.any()):
        return np.zeros((1, 3))
    if "extinction" in reference.data:
        return np.array([[-0.25], [0.25]]) * (u + v)
    ticks = (np.arange(3) - 1) / 3
    return np.asarray((ticks[:, None, None] * u + ticks[:, None] * v).reshape(-1, 3))
