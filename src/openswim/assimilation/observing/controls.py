"""From a state of control variables to what the linear core is filled with, and back for gradients."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from openswim.arguments import check_kind
from openswim.assimilation.observing.particles import Particles
from openswim.assimilation.observing.variables import Variable, variables_of
from openswim.errors import UserError
from openswim.optics.cover import CLOUD, cloud_cover
from openswim.scene import Scene
from openswim.scene.variables import LEVEL_DIMS

F64 = NDArray[np.float64]
Bool = NDArray[np.bool_]

FLOOR_PER_M = 2e-5  # extinction that stands for none: a first guess has it, so that cloud can come to be
LEAST_SHARE = 1e-3  # of the floor, below which no state goes: so little is still differentiable
_SIZED = ("content", "effective_radius", "number")


@dataclass(frozen=True, eq=False)
class Fill:
    """What a state makes of the world: extinction at 550 nm (nz, ny, nx), 1/m, of each species that is controlled;
    albedo (w, ny, nx) and scales (cameras, w), None where they are not."""

    extinction: dict[str, F64] = field(default_factory=dict)
    albedo: F64 | None = None
    scale: F64 | None = None


@dataclass(frozen=True, eq=False)
class Controls:
    """The controls of a scene.

    where (nz, ny, nx): nodes at which fields on levels may change; the others keep the scene's values.
    albedo (w, ny, nx): of the scene's ground. cameras: how many.
    """

    scene: Scene
    variables: tuple[Variable, ...]
    wavelengths_nm: F64
    where: Bool
    albedo: F64
    cameras: int
    floor_per_m: float = FLOOR_PER_M

    @classmethod
    def of(cls, scene: Scene, names: Sequence[str], wavelengths_nm: F64, where: Bool, albedo: F64, cameras: int,
           floor_per_m: float = FLOOR_PER_M) -> Controls:  # fmt: skip
        """Checked; raises UserError."""
        if scene.grid is None or where.shape != scene.grid.shape:
            shape = "no grid" if scene.grid is None else scene.grid.shape
            raise UserError(f"where has shape {where.shape}; the scene has {shape}")
        return cls(scene, variables_of(scene, names), wavelengths_nm, where, albedo, cameras, floor_per_m)

    # the state

    @cached_property
    def floors(self) -> dict[str, F64]:
        """Of the fields on levels: the value by which a node has the floor's extinction."""
        out = {}
        for each in self.variables:
            if each.kind == "extinction":
                out[each.name] = np.full(self.where.shape, self.floor_per_m)
            elif each.kind == "content":
                out[each.name] = self.particles(each.species).content_of(self.floor_per_m)
        return out

    def first(self) -> xr.Dataset:
        """The scene's own values as a state; fields on levels lie on their floor at least, where they may change."""
        data = {}
        for each in self.variables:
            value: Any
            if each.kind == "factor":
                value = np.array(1.0)
            elif each.kind == "scale":
                value = np.ones((self.cameras, self.wavelengths_nm.size))
            elif each.kind == "albedo":
                value = self.albedo.copy()
            else:
                value = self._own(each.name)
                if each.kind in ("effective_radius", "number"):
                    value = np.where(value > 0, value, np.median(value[value > 0]))
            data[each.name] = (each.dims, value, {"units": each.units})
        state = xr.Dataset(data, coords={"wavelength": self.wavelengths_nm})
        return self.lifted(state, 1.0)

    def lifted(self, state: xr.Dataset, share: float = LEAST_SHARE) -> xr.Dataset:
        """The state with fields on levels not below a share of their floor, where they may change; elsewhere the
        scene's."""
        out = self.checked(state).copy(deep=True)
        for name, floor in self.floors.items():
            out[name].values[:] = np.where(self.where, np.maximum(out[name].values, share * floor), self._own(name))
        return out

    def checked(self, state: xr.Dataset, what: str = "state", left_out: float | None = None) -> xr.Dataset:
        """The state's controls as float64, in their order and shape; raises UserError. left_out: the value of controls
        that it may be without."""
        check_kind(what, state, xr.Dataset, "give an xarray.Dataset such as operator.first()")
        shapes = dict(zip(LEVEL_DIMS, self.where.shape, strict=True))
        shapes |= {"wavelength": self.wavelengths_nm.size, "camera": self.cameras}
        data = {}
        for each in self.variables:
            if each.name not in state and left_out is not None:
                data[each.name] = (each.dims, np.full([shapes[d] for d in each.dims], left_out), {"units": each.units})
                continue
            if each.name not in state:
                raise UserError(f"{what}: {each.name} is missing; operator.first() has all that is needed")
            given = state[each.name]
            if set(given.dims) != set(each.dims) or any(given.sizes[d] != shapes[d] for d in each.dims):
                want = tuple(shapes[d] for d in each.dims)
                raise UserError(f"{what}: {each.name} is {dict(given.sizes)}; give {each.dims} of {want}")
            values = np.asarray(given.transpose(*each.dims).values, float)
            if not np.isfinite(values).all():
                raise UserError(f"{what}: {each.name} has values that are no numbers")
            data[each.name] = (each.dims, values, {"units": each.units})
        return xr.Dataset(data, coords={"wavelength": self.wavelengths_nm})

    # what it makes of the world, with slopes

    def fill(self, state: xr.Dataset) -> Fill:
        """Of a lifted state."""
        out = {}
        for species in self.species:
            out[species] = self._extinction(species, state)
        albedo = state["surface_albedo"].values if "surface_albedo" in state else None
        scale = state["camera_scale"].values if "camera_scale" in state else None
        return Fill(out, None if albedo is None else np.clip(albedo, 0.0, 1.0), scale)

    def slopes(self, state: xr.Dataset) -> dict[str, F64]:
        """d extinction or albedo / d control, of each control at its own places; 0 where it may not change."""
        out: dict[str, F64] = {}
        for each in self.variables:
            if each.kind in _SIZED:
                now = {v.kind: state[v.name].values for v in self.variables
                       if v.species == each.species and v.kind in _SIZED}  # fmt: skip
                out[each.name] = self.where * self.particles(each.species).slope(each.kind, **now)
            elif each.kind == "extinction":
                out[each.name] = np.where(self.where, 1.0, 0.0)
            elif each.kind == "factor":
                out[each.name] = self._own("aerosol_extinction")
            elif each.kind == "albedo":
                albedo = state[each.name].values
                out[each.name] = np.where((albedo >= 0) & (albedo <= 1), 1.0, 0.0)
        return out

    def tangent(self, slopes: dict[str, F64], change: xr.Dataset) -> Fill:
        """What a change of the state changes."""
        out: dict[str, F64] = {}
        for each in self.variables:
            if each.kind not in ("albedo", "scale"):
                more = slopes[each.name] * change[each.name].values
                out[each.species] = out.get(each.species, 0.0) + more
        albedo = slopes["surface_albedo"] * change["surface_albedo"].values if "surface_albedo" in slopes else None
        scale = change["camera_scale"].values if "camera_scale" in change else None
        return Fill(out, albedo, scale)

    def adjoint(self, slopes: dict[str, F64], bars: Fill) -> xr.Dataset:
        """The transpose of `tangent`."""
        data = {}
        for each in self.variables:
            if each.kind == "albedo":
                assert bars.albedo is not None
                value = slopes[each.name] * bars.albedo
            elif each.kind == "scale":
                assert bars.scale is not None
                value = bars.scale
            else:
                value = slopes[each.name] * bars.extinction[each.species]
                value = np.array(value.sum()) if each.kind == "factor" else value
            data[each.name] = (each.dims, value)
        return xr.Dataset(data, coords={"wavelength": self.wavelengths_nm})

    # pieces

    @cached_property
    def species(self) -> list[str]:
        """Of which something may change."""
        return list(dict.fromkeys(v.species for v in self.variables if v.species))

    def _extinction(self, species: str, state: xr.Dataset) -> F64:
        mine = {v.kind: v.name for v in self.variables if v.species == species}
        if "extinction" in mine:
            return np.asarray(state[mine["extinction"]].values)
        if "factor" in mine:
            return self._own("aerosol_extinction") * float(state["aerosol_factor"])
        now = {kind: state[name].values for kind, name in mine.items()}
        changed = self.particles(species).extinction_per_m(**now)
        return np.where(self.where, changed, self.particles(species).extinction_per_m())

    def particles(self, species: str) -> Particles:
        """The species as the scene has it."""
        if species not in self._particles:
            own = {kind: self._own(f"{species}_{kind}") for kind in _SIZED if f"{species}_{kind}" in self.scene.data}
            cover = cloud_cover(self.scene)
            share = 1.0 if cover is None or species not in CLOUD else np.asarray(cover, float)
            self._particles[species] = Particles(species, own, share)
        return self._particles[species]

    _particles: dict[str, Particles] = field(default_factory=dict, repr=False)

    def _own(self, name: str) -> F64:
        return np.asarray(self.scene.data[name].transpose(*LEVEL_DIMS).values, float)
