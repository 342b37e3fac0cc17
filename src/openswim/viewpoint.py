"""Viewpoint: a camera in solved light. What it sees is asked for whole, tile by tile, or ray by ray."""

from __future__ import annotations

import dataclasses
import os
from dataclasses import dataclass
from datetime import UTC, datetime
from functools import cached_property
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import ArrayLike, NDArray

import openswim
from openswim.arguments import check_kind
from openswim.cameras import Camera, Rays
from openswim.cameras.pixels import Pixels
from openswim.errors import UserError
from openswim.fluxes import broadband, gases_above, quadrature_directions, spectral_irradiance
from openswim.images import add_errors, dataset
from openswim.kept_light import save_light
from openswim.lights import disc_coverage
from openswim.lights.daylight import Daylight
from openswim.observer import SPACE_M, check_observer, ground_below, place_of
from openswim.optics.limits import stated
from openswim.outlines import outlines_of, softened
from openswim.scene import Scene
from openswim.scene.frame import horizon_vector
from openswim.transport import Field, ReferenceField
from openswim.transport.field import Viewpoint as Eye
from openswim.transport.lit.lit_grid import Once
from openswim.transport.montecarlo.reference import PATHS, ReferenceView

F64 = NDArray[np.float64]

_QUADRATURE = 32  # .3 % off 64 under broken clouds, where 8 are 5 %
_LAST_VISIBLE_NM = 700.0  # broadband irradiance is told from shorter wavelengths, which meet no bands of gases
_SPREAD = 16  # so many times fewer paths a ray has where the rays' sum alone is asked for


@dataclass(frozen=True)
class LitScene:
    """A scene with its field of light solved: render it from as many cameras as you like."""

    scene: Scene
    field: Field | ReferenceField
    daylight: Daylight
    time: np.datetime64 | None
    irradiances: dict[bytes, dict[str, Any]] = dataclasses.field(
        default_factory=dict, repr=False, compare=False
    )  # of places that a picture has been made from

    def viewpoint(self, camera: Camera) -> Viewpoint:
        """A camera in this light: aimed once, it hands out pictures, tiles and rays, from any thread."""
        check_kind("camera", camera, Camera, "give one, such as Camera.allsky(lat, lon)")
        check_observer(self.scene, camera, self.field.solver.name)
        ground_m = ground_below(self.scene, self.field, camera)
        pixels = camera.pixels()
        return Viewpoint(self, camera, ground_m, pixels, camera.rays(self.field.frame, ground_m, pixels))

    def save(self, path: str | os.PathLike[str]) -> None:
        """Keep the light and its scene as a Zarr folder, from which `openswim.open_light` makes the same pictures.

        Raises UserError for solver "reference" and for domains of very many columns, whose light is not kept.
        """
        save_light(self.scene, self.field, self.daylight, self.time, path)


@dataclass(frozen=True, eq=False)
class Viewpoint:
    """A camera in the light of a scene; nothing that it is asked changes it."""

    lit: LitScene
    camera: Camera
    ground_m: float
    pixels: Pixels
    rays: Rays
    once: Once = dataclasses.field(default_factory=Once, repr=False)

    def view(self) -> xr.Dataset:
        """The whole image: see `openswim.render`."""
        return self.tile(slice(None), slice(None))

    def tile(self, rows: slice, columns: slice) -> xr.Dataset:
        """Some rows and columns of the image, the same bit for bit as in the whole."""
        ny, nx = self.pixels.inside.shape
        (top, bottom, _), (left, right, _) = rows.indices(ny), columns.indices(nx)
        if (rows.step or 1) != 1 or (columns.step or 1) != 1 or top >= bottom or left >= right:
            raise UserError(f"tile of rows {rows} and columns {columns}: give slices within {ny} x {nx}, without steps")
        # outlines are told by the pixels beside: one more on every side
        more = 0 if isinstance(self._eye, ReferenceField) else 1
        around = np.s_[max(top - more, 0) : min(bottom + more, ny), max(left - more, 0) : min(right + more, nx)]
        own = np.zeros((ny, nx), bool)
        own[top:bottom, left:right] = True
        relative, view = self._seen(_part(self.pixels, around), self._number[around], own[around])
        pixels = _part(self.pixels, np.s_[top:bottom, left:right])
        field, day = self.lit.field, self.lit.daylight
        distance_deg = pixels.angle_to_deg(*self.sun)[pixels.inside]
        _add_disc(relative, view, self.lit, distance_deg, pixels)
        image = dataset(field.frame, field.wavelengths_nm, day.distance_au, pixels, relative, view, self.attrs)
        if isinstance(view, ReferenceView):
            add_errors(image, pixels, view, field.solver.seed)
        return image

    def look(self, azimuth_deg: ArrayLike, altitude_deg: ArrayLike) -> F64:
        """Solar-relative radiance (n, nw; Albers et al. 2020, Eq. 2) toward directions (n,) from the camera's place,
        without the sun's disc."""
        azimuth, altitude = np.broadcast_arrays(np.atleast_1d(azimuth_deg), np.atleast_1d(altitude_deg))
        direction = horizon_vector(azimuth, altitude) @ self._axes
        return np.asarray(self._eye.view(Rays(self.rays.origin_m, direction)).radiance, float)

    @cached_property
    def sun(self) -> tuple[float, float]:
        """Azimuth and altitude (degrees) of the sun at the camera."""
        east, north, up = self._axes @ self.lit.daylight.direction
        return float(np.degrees(np.arctan2(east, north)) % 360), float(np.degrees(np.arcsin(np.clip(up, -1, 1))))

    @property
    def attrs(self) -> dict[str, Any]:
        """What is to be known of the image: place, time, sun, solver, and the irradiance at an observer near by."""
        return dict(self.once("attributes", self._attrs))

    def _attrs(self) -> dict[str, Any]:
        out = _attributes(self.lit, self.camera, *self.sun)
        if self._near:
            kept, place = self.lit.irradiances, np.asarray(self.rays.origin_m, float).tobytes()
            if place not in kept:
                kept[place] = self._irradiance()
            out |= kept[place]
        return out

    @property
    def _eye(self) -> Eye | ReferenceField:
        field = self.lit.field
        return field if isinstance(field, ReferenceField) else self.once("eye", lambda: field.viewpoint(self.rays))

    @cached_property
    def _number(self) -> NDArray[np.int64]:
        """(ny, nx) which of the rays is a pixel's; -1 outside of the image."""
        inside = self.pixels.inside
        return np.where(inside, np.cumsum(inside).reshape(inside.shape) - 1, -1)

    @property
    def _axes(self) -> F64:
        """Rows east, north, up at the camera, in the scene frame."""
        lon, lat = place_of(self.camera)
        return self.lit.field.frame.enu(lat, lon)

    @property
    def _near(self) -> bool:
        return self.camera.height_above_sea_m(self.ground_m) < SPACE_M

    def _irradiance(self) -> dict[str, Any]:
        """Spectral and broadband irradiance on the horizontal at the observer."""
        field, day, (azimuth, altitude) = self.lit.field, self.lit.daylight, self.sun
        quadrature = quadrature_directions(_QUADRATURE, azimuth, altitude)
        local = horizon_vector(quadrature.azimuth_deg, quadrature.altitude_deg)
        rays = Rays(self.rays.origin_m, np.concatenate([local @ self._axes, day.direction[None]]))
        eye = self._eye
        view = _for_sums(eye).view(rays) if isinstance(eye, ReferenceField) else eye.of_others(rays).view(rays)
        direct = view.transmittance[-1] * (not view.hit[-1])
        wl = field.wavelengths_nm
        spectral = spectral_irradiance(view.radiance[:-1], quadrature, direct, altitude, wl, day.distance_au)
        out: dict[str, Any] = {}
        visible = wl <= _LAST_VISIBLE_NM
        if visible.any():
            gases = gases_above(self.lit.scene.atmosphere, float(field.frame.latlon(self.rays.origin_m)[2]))
            diffuse = spectral["relative_diffuse_horizontal"].values[visible]
            wide = broadband(direct[visible], diffuse, wl[visible], altitude, day.distance_au, **gases)
            out = {
                "global_horizontal_irradiance_w_m2": round(float(wide.global_horizontal), 2),
                "direct_normal_irradiance_w_m2": round(float(wide.direct_normal), 2),
                "direct_horizontal_irradiance_w_m2": round(float(wide.direct_horizontal), 2),
                "diffuse_horizontal_irradiance_w_m2": round(float(wide.diffuse_horizontal), 2),
            }
        for part in ("global", "direct", "diffuse"):
            out[f"{part}_horizontal_spectral_irradiance_w_m2_nm"] = [
                float(v) for v in spectral[f"{part}_horizontal"].values
            ]
        return out

    def _seen(self, pixels: Pixels, number: NDArray[np.int64], own: NDArray[np.bool_]) -> tuple[NDArray, Any]:
        """Radiance of those pixels that are ``own``, and what they see; those around tell of outlines."""
        eye, inside = self._eye, pixels.inside
        rays = self.rays[number[inside]]
        view = eye.view(rays)
        relative, wanted = view.radiance.astype(np.float32), own[inside]
        # from space pixels are about as long on the ground as they are wide, and are seen as one
        if self._near and not isinstance(eye, ReferenceField) and self.lit.field.frame.curved:
            edge = np.flatnonzero(outlines_of(view, inside) & wanted)
            relative[edge] = softened(eye, rays[edge], self.lit.field.frame)
        every = {f.name: getattr(view, f.name) for f in dataclasses.fields(view)}
        rows = {k: v[wanted] for k, v in every.items() if isinstance(v, np.ndarray) and v.shape[:1] == wanted.shape}
        return relative[wanted], dataclasses.replace(view, **rows)


def _add_disc(relative: NDArray, view: Any, lit: LitScene, distance_deg: F64, pixels: Any) -> None:
    """The sun's disc, limb-darkened and anti-aliased, dimmed by the full optical depth in front of it."""
    inside = np.asarray(pixels.inside).ravel()
    distance = distance_deg[inside] if distance_deg.size == inside.size else distance_deg
    half = np.broadcast_to(np.asarray(pixels.half_width_deg), pixels.inside.shape).ravel()[inside]
    radius = lit.daylight.angular_radius_deg
    open_to = np.flatnonzero(~view.hit)
    disc = disc_coverage(distance[open_to], half[open_to], radius, lit.field.wavelengths_nm)
    relative[open_to] += (disc * view.transmittance[open_to]).astype(np.float32)


def _for_sums(field: ReferenceField) -> ReferenceField:
    """The field to look from along rays of which the sum counts: Monte Carlo spreads its paths over them."""
    solver = field.solver
    most = PATHS if solver.target_error is None and solver.seconds is None else None
    paths = solver.paths or most
    fewer = dataclasses.replace(
        solver,
        paths=None if paths is None else max(2, paths // _SPREAD),
        target_error=None if solver.target_error is None else min(solver.target_error * _SPREAD**0.5, 0.5),
    )
    return dataclasses.replace(field, solver=fewer)


def _attributes(lit: LitScene, camera: Camera, azimuth: float, altitude: float) -> dict[str, Any]:
    attrs: dict[str, Any] = {
        "Conventions": "CF-1.11",
        "title": f"OpenSWIm {camera.name} image",
        "history": f"{datetime.now(UTC):%Y-%m-%dT%H:%M:%SZ}: openswim {openswim.__version__}",
        "view": camera.name,
        "source": lit.scene.source,
        "assumptions": "\n".join([*lit.scene.notes, *stated(lit.field.wavelengths_nm, lit.scene.atmosphere)]),
        "solver": lit.field.solver.name,
        "quality": lit.field.solver.quality if isinstance(lit.field, ReferenceField) else lit.field.quality,
        "sun_altitude_deg": round(altitude, 4),
        "sun_azimuth_deg": round(azimuth, 4),
        "sun_distance_au": lit.daylight.distance_au,
        "height_m": float(camera.height_m),
        "height_above": camera.above,
    }
    if camera.view == "perspective":
        attrs |= {
            "view_azimuth_deg": float(camera.azimuth_deg), "view_altitude_deg": float(camera.altitude_deg),
            "view_roll_deg": float(camera.roll_deg), "field_of_view_deg": float(camera.fov_deg),
        }  # fmt: skip
    x, y = place_of(camera)
    attrs |= {"longitude": x, "latitude": y} if lit.field.frame.curved else {"x_m": x, "y_m": y}
    if lit.time is not None:
        attrs["time"] = f"{np.datetime_as_string(np.datetime64(lit.time), 's')}Z"
    return attrs


def _part(pixels: Pixels, where: tuple[slice, slice]) -> Pixels:
    return Pixels(pixels.direction[where], pixels.solid_angle_sr[where])
