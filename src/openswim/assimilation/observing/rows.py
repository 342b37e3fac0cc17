"""From a state of clouds and ground to rows of observations, with slopes: all that lies around the linear core."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import ArrayLike, NDArray

from openswim.arguments import numbers
from openswim.assimilation.observing.carrying import Carrier
from openswim.assimilation.observing.controls import Controls, Fill
from openswim.assimilation.observing.core import Core, Images
from openswim.assimilation.observing.instruments import Instrument
from openswim.errors import UserError
from openswim.lights.daylight import Daylight
from openswim.scene import Scene

F64 = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Part:
    """Some observations in the row of all: those of a camera, or of all pyranometers; of shape (channels, n)."""

    name: str
    start: int
    shape: tuple[int, int]

    @property
    def here(self) -> slice:
        return slice(self.start, self.start + self.shape[0] * self.shape[1])


@dataclass(frozen=True, eq=False)
class Rows:
    """H(x) as rows of observations; see `operator.Operator`.

    relative: (w,) extinction of each of the core's classes over that at 550 nm, by name.
    watts (w, n): W m-2 of broadband global irradiance for each wavelength's share of E_TOA, at each point.
    points (n, 2): latitudes and longitudes of pyranometers, in flat scenes y and x in metres.
    carrier: from the time of a state to ``time``; None where they are the same.
    """

    scene: Scene
    core: Core
    controls: Controls
    instruments: tuple[Instrument, ...]
    points: F64
    relative: dict[str, F64]
    watts: F64
    daylight: Daylight
    time: np.datetime64 | None = None
    sun: tuple[float, float] | None = None
    carrier: Carrier | None = None
    _base: dict[str, F64] = field(default_factory=dict, repr=False)

    @property
    def wavelengths_nm(self) -> F64:
        return self.controls.wavelengths_nm

    @cached_property
    def parts(self) -> tuple[Part, ...]:
        """What lies where in a row of observations: each camera's, then the irradiance."""
        out, start = [], 0
        for n, each in enumerate(self.instruments):
            out.append(Part(f"camera {n}", start, (len(each.quantity.channels), each.rays)))
            start = out[-1].here.stop
        if len(self.points):
            out.append(Part("irradiance", start, (1, len(self.points))))
        return tuple(out)

    @property
    def size(self) -> int:
        return self.parts[-1].here.stop

    def first(self) -> xr.Dataset:
        """The scene's own state: fields named as in a scene, on the floor at least where they may change."""
        return self.controls.first()

    def __call__(self, state: xr.Dataset) -> xr.DataArray:
        """H(x), a row of observations."""
        images, _ = self.light(self.controls.fill(self.controls.lifted(state)))
        return self.row(self.values(images, self.scale(state)))

    @property
    def of_times(self) -> tuple[Rows, ...]:
        """Those of one time each, whose instruments and points, one after the other, are these."""
        return (self,)

    # light

    def light(self, fill: Fill, start: Any = None) -> tuple[Images, Any]:
        """What is seen of a fill, and what the core keeps of it; start: the same of a fill that is near."""
        return self.core.forward(*self.filled(fill), start=start)

    def light_tangent(self, light: Any, change: Fill, loosely: float = 1.0) -> Images:
        """J v. loosely: times the core's tolerance."""
        return self.core.tangent(light, *self.filled(change, change=True), loosely * self.core.tolerance)

    def light_adjoint(self, light: Any, residual: Images, loosely: float = 1.0) -> Fill:
        """J^T r."""
        return self.gathered(*self.core.adjoint(light, residual, loosely * self.core.tolerance))

    # rows of observations

    def row(self, values: ArrayLike) -> xr.DataArray:
        """Numbers as a labelled row of observations."""
        values = np.asarray(numbers("observations", values), float)
        if values.shape != (self.size,):
            raise UserError(f"observations have shape {values.shape}; this operator has ({self.size},)")
        return xr.DataArray(values, dims=("observation",), coords=self._coords)

    @cached_property
    def _coords(self) -> dict[str, Any]:
        """Of each observation: which instrument's (the last number is that of the pyranometers), and its wavelength."""
        number, wavelength = np.empty(self.size, np.int32), np.full(self.size, np.nan)
        for n, part in enumerate(self.parts):
            number[part.here] = n
            if n < len(self.instruments):
                channels = self.instruments[n].quantity.channels
                wavelength[part.here] = np.repeat(self.wavelengths_nm[channels], part.shape[1])
        return {"instrument": ("observation", number), "wavelength": ("observation", wavelength)}

    def pictures(self, row: ArrayLike) -> list[xr.DataArray]:
        """What a row of observations looks like: (y, x, wavelength) of each camera, NaN outside of the picture."""
        row, out = self.row(row).values, []
        for part, each in zip(self.parts, self.instruments, strict=False):
            channels = each.quantity.channels
            image = each.image(row[part.here].reshape(part.shape))
            coords = {"wavelength": self.wavelengths_nm[channels]}
            attrs = {"long_name": each.quantity.name, "units": each.quantity.units}
            out.append(xr.DataArray(image, dims=("y", "x", "wavelength"), coords=coords, attrs=attrs))
        return out

    def irradiance_w_m2(self, row: ArrayLike) -> F64:
        """The global irradiance (n,) in a row of observations."""
        return self.row(row).values[self.parts[-1].here] if len(self.points) else np.empty(0)

    def packed(self, state: xr.Dataset) -> F64:
        """The controls of a state in one row, in their order, each raveled."""
        state = self.controls.checked(state)
        return np.concatenate([np.ravel(state[v.name].values) for v in self.controls.variables])

    def unpacked(self, row: ArrayLike) -> xr.Dataset:
        """The inverse of `packed`."""
        like, row, out, start = self.first(), np.asarray(numbers("unpacked: row", row), float), {}, 0
        size = sum(like[each.name].size for each in self.controls.variables)
        if row.shape != (size,):
            raise UserError(f"unpacked: the row has shape {row.shape}; the controls of this operator have ({size},)")
        for each in self.controls.variables:
            there = like[each.name]
            out[each.name] = there.copy(data=row[start : start + there.size].reshape(there.shape))
            start += there.size
        return like.assign(out)

    # between states, the core's nodes, and rows

    def filled(self, fill: Fill, change: bool = False) -> tuple[F64, F64]:
        """Extinction (w, k, nz', ny', nx') and albedo (w, ny', nx') of the core, by a fill, or changes by a change."""
        extinction, albedo = np.zeros_like(self.base[0]), np.zeros_like(self.base[1])
        if not change:
            extinction, albedo = self.base[0].copy(), self.base[1]
        for species, values in fill.extinction.items():
            at = self.core.drawn.to_nodes(values if self.carrier is None else self.carrier(values))
            for k, share in self.shares(species):
                extinction[:, k] = self._relative(k)[:, None, None, None] * at * share
        if fill.albedo is not None:
            albedo = fill.albedo
        return extinction, albedo

    @cached_property
    def base(self) -> tuple[F64, F64]:
        """Extinction and albedo of the scene that the core was made from."""
        return np.asarray(self.core.extinction, float), np.asarray(self.core.albedo, float)

    def gathered(self, extinction: F64, albedo: F64) -> Fill:
        """The transpose of `filled` for changes."""
        out = {}
        for species in self.controls.species:
            bar = np.zeros(self.core.shape)
            for k, share in self.shares(species):
                bar += share * np.einsum("w,wzyx->zyx", self._relative(k), extinction[:, k])
            back = self.core.drawn.from_nodes(bar)
            out[species] = back if self.carrier is None else self.carrier.transposed(back)
        return Fill(out, np.asarray(albedo))

    def shares(self, species: str) -> list[tuple[int, F64 | float]]:
        """The core's classes that stand for a species, and the share of its extinction that each has at the nodes:
        droplets that differ much in size are two, "liquid, small" and "liquid, large"."""
        which = [k for k, name in enumerate(self.core.names) if name == species or name.startswith(f"{species}, ")]
        if not which:
            raise UserError(f"control of {species}: the scene has none anywhere; give it a first guess that has some")
        if len(which) == 1:
            return [(which[0], 1.0)]
        if species not in self._base:
            each = np.stack([self.base[0][0, k] / self._relative(k)[0] for k in which]).astype(float)
            total = each.sum(axis=0)
            mean = each.reshape(len(which), -1).sum(axis=1) / max(total.sum(), 1e-300)
            with np.errstate(invalid="ignore"):
                known = each / np.maximum(total, 1e-300)
            self._base[species] = np.where(total > 0, known, mean[:, None, None, None])
        return [(k, self._base[species][n]) for n, k in enumerate(which)]

    def _relative(self, k: int) -> F64:
        return self.relative[self.core.names[k]]

    def scale(self, state: xr.Dataset) -> F64 | None:
        """(cameras, w) factors of the cameras' calibration, where a state has them."""
        return np.asarray(state["camera_scale"].values, float) if "camera_scale" in state else None

    def values(self, images: Images, scale: F64 | None) -> F64:
        """Observations of the core's light; scale (cameras, w): of the cameras' calibration."""
        rows = []
        for n, (each, light) in enumerate(zip(self.instruments, images.radiance, strict=True)):
            seen = light if scale is None else light * scale[n][:, None]
            rows.append(each.quantity.value(seen).ravel())
        if len(self.points):
            rows.append((self.watts * images.ghi).sum(axis=0))
        return np.concatenate(rows)

    def tangent_values(self, images: Images, change: Images, scale: F64 | None, d_scale: F64 | None) -> F64:
        """Changes of `values`."""
        rows = []
        for n, (each, light, more) in enumerate(zip(self.instruments, images.radiance, change.radiance, strict=True)):
            by = np.ones((light.shape[0], 1)) if scale is None else scale[n][:, None]
            seen = more * by if d_scale is None else more * by + light * d_scale[n][:, None]
            rows.append(each.quantity.tangent(light * by, seen).ravel())
        if len(self.points):
            rows.append((self.watts * change.ghi).sum(axis=0))
        return np.concatenate(rows)

    def adjoint_values(self, images: Images, bar: F64, scale: F64 | None) -> tuple[Images, F64 | None]:
        """The transpose of `tangent_values`."""
        lights, scales = [], []
        for n, (each, light, part) in enumerate(zip(self.instruments, images.radiance, self.parts, strict=False)):
            by = np.ones((light.shape[0], 1)) if scale is None else scale[n][:, None]
            seen = each.quantity.adjoint(light * by, bar[part.here].reshape(part.shape))
            lights.append(seen * by)
            scales.append((seen * light).sum(axis=1))
        ghi = np.zeros((self.wavelengths_nm.size, len(self.points)))
        if len(self.points):
            ghi += self.watts * bar[self.parts[-1].here]
        return Images(lights, ghi), None if scale is None else np.array(scales)
