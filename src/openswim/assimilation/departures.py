"""What a better model than the linear core sees of a state, and what a grid cannot show."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from openswim.assimilation.observing.rows import Rows
from openswim.cameras import Camera
from openswim.errors import UserError
from openswim.lighting import light, solver_of
from openswim.scene import Scene
from openswim.scene.variables import LEVEL_DIMS
from openswim.solver import Solver

F64 = NDArray[np.float64]

_JUST_ABOVE = 1.01  # floors, up to which nothing was found


def scene_of(rows: Rows, state: xr.Dataset) -> Scene:
    """The scene with a state's values; what is not above the floor is clear air."""
    scene, data = rows.scene, rows.scene.data.copy()
    state = rows.controls.lifted(state)
    for each in rows.controls.variables:
        values = state[each.name].values
        if each.kind == "factor":
            own = scene.data["aerosol_extinction"]
            data["aerosol_extinction"] = own.copy(data=(own.values * float(values)).astype(np.float32))
        elif each.kind == "albedo":
            moved = np.clip(np.moveaxis(values, 0, -1), 0, 1).astype(np.float32)
            data = data.drop_vars("surface_albedo", errors="ignore").drop_vars("wavelength", errors="ignore")
            data["surface_albedo"] = (("y", "x", "wavelength"), moved)
            data = data.assign_coords(wavelength=rows.wavelengths_nm)
        elif each.kind != "scale":
            if each.on_levels:
                clear = rows.controls.where & (values <= _JUST_ABOVE * rows.controls.floors[each.name])
                values = np.where(clear, 0.0, values)
            data[each.name] = (LEVEL_DIMS, values.astype(np.float32), scene.data[each.name].attrs)
    return replace(scene, data=data, optics=dict(scene.optics), notes=list(scene.notes))


def checked_solver(departures: str | Solver) -> Solver | None:
    """None for the linear core itself."""
    if isinstance(departures, str) and departures == "linear":
        return None
    solver = solver_of(departures)
    if solver.name == "swim":
        raise UserError("departures by swim would be farther off than the linear core: take fast, reference or linear")
    return solver


def seen_by(rows: Rows, state: xr.Dataset, solver: Solver) -> F64:
    """H(x) by another solver: a row of observations. Sub-grid noise is left out, which no analysis can see."""
    quiet = replace(solver, detail=False) if solver.name == "fast" else solver
    scene, lights, watts = scene_of(rows, state), [], []
    for one in rows.of_times:
        of_time = scene if one.carrier is None else one.carrier.scene(scene)
        lit = light(of_time, quiet, one.wavelengths_nm.tolist(), one.time if one.sun is None else None, one.sun)
        for each in one.instruments:
            pixels = each.camera.pixels()
            azimuth, altitude = pixels.azimuth_deg[each.inside], pixels.altitude_deg[each.inside]
            lights.append(lit.viewpoint(each.camera).look(azimuth, altitude).T)
        curved = scene.grid is not None and scene.grid.curved
        for north, east in one.points:
            place: dict[str, Any] = {"lat": north, "lon": east} if curved else {"y_m": north, "x_m": east}
            attrs = lit.viewpoint(Camera.allsky(**place, height_m=1.0, size=8)).attrs
            watts.append(float(attrs["global_horizontal_irradiance_w_m2"]))
    scale, out = rows.scale(state), []
    for n, (each, seen) in enumerate(zip(rows.instruments, lights, strict=True)):
        out.append(each.quantity.value(seen if scale is None else seen * scale[n][:, None]).ravel())
    return np.concatenate([*out, watts])


def representation_error(rows: Rows, state: xr.Dataset, solver: str | Solver = "fast") -> list[float]:
    """Of each camera, how far pictures of a state are from those of its means over two by two columns: an estimate of
    what a grid does not show, as a share like ``noise`` of `observations`. Radiance of the cameras' own pixels."""
    chosen = solver_of(solver)
    fine = seen_by(rows, state, chosen)
    coarse = seen_by(rows, _coarsened(rows, state), chosen)
    out = []
    for part, each in zip(rows.parts, rows.instruments, strict=False):
        one, other = (row[part.here].reshape(part.shape)[:, each.usable] for row in (fine, coarse))
        if each.quantity.name in ("log_radiance", "ratio"):
            share = np.abs(one - other) / (1.0 if each.quantity.name == "log_radiance" else np.abs(one))
        else:
            share = np.abs(one - other) / np.sqrt(0.5 * (one**2 + one.mean(axis=1, keepdims=True) ** 2))
        out.append(float(np.sqrt(np.mean(share**2))))
    return out


def _coarsened(rows: Rows, state: xr.Dataset) -> xr.Dataset:
    """Fields on levels as means over two by two columns."""
    out = {}
    for each in rows.controls.variables:
        if each.on_levels:
            field = state[each.name].values
            for axis in (1, 2):
                f = np.moveaxis(field, axis, -1).copy()
                even = f[..., : f.shape[-1] // 2 * 2]
                pairs = even.reshape(*f.shape[:-1], -1, 2).mean(axis=-1)
                f[..., : even.shape[-1]] = np.repeat(pairs, 2, axis=-1)
                field = np.moveaxis(f, -1, axis)
            out[each.name] = state[each.name].copy(data=field)
    return state.assign(out)
