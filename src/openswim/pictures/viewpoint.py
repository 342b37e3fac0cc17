"""Viewpoint: a camera in solved light. What it sees is asked for whole, tile by tile, or ray by ray."""

from __future__ import annotations

import dataclasses
import os
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import ArrayLike, NDArray

from openswim.arguments import check_kind, numbers, shown
from openswim.cameras import Camera, Rays
from openswim.cameras.pixels import Pixels
from openswim.colour.photometry import illuminance_lx
from openswim.errors import UserError
from openswim.fluxes import (
    broadband,
    gases_above,
    quadrature_directions,
    scene_vapour_cm,
    spectral_irradiance,
)
from openswim.heavens.eyes import Eyes, LitBy
from openswim.heavens.far_towns import domes_beyond
from openswim.heavens.lamps import Lamps, toa_irradiance
from openswim.heavens.seen import DUSK_DEG, Heavens
from openswim.heavens.sun_disc import Beam, Disc, beam_of, beams_of, drawn
from openswim.kept_light import KeptLamp, save_light
from openswim.lights import disc_coverage
from openswim.lights.daylight import Daylight
from openswim.optics.limits import stated
from openswim.pictures.attributes import image_attributes, irradiance_attributes
from openswim.pictures.images import add_errors, add_layers, dataset
from openswim.pictures.observer import (
    SPACE_M,
    aerosol_above,
    check_above_ground,
    check_observer,
    ground_below,
    place_of,
)
from openswim.pictures.outlines import outlines_of, softened
from openswim.scene import Scene
from openswim.scene.around import Around
from openswim.scene.frame import azimuth_altitude, horizon_vector
from openswim.solver import Solver
from openswim.transport import Field, ReferenceField
from openswim.transport.lit.lit_grid import Once
from openswim.transport.montecarlo.reference import ReferenceView
from openswim.transport.view.eye import Eye
from openswim.transport.view.sight import Sight

F64 = NDArray[np.float64]

_QUADRATURE = 32  # .3 % off 64 under broken clouds, where 8 are 5 %
_ROUNDING_DEG = 1e-6  # of altitudes of the zenith that were computed
LOOKED_AT = 0.015  # ``sparse`` of pictures of 8 bits, of which nobody sees any difference


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
    lamps: Lamps | None = None  # which lights there are; None where no time is known
    lights: tuple[LitBy, ...] = ()  # each solved, `field` the first's; none where it is the whole sun's alone

    def __repr__(self) -> str:
        """One line: which lights, how they were solved, of what scene."""
        names = ", ".join(each.name for each in self.lights) or "sun"
        wavelengths = ", ".join(f"{each:g}" for each in self.field.wavelengths_nm)
        return f"<LitScene: {names}; solver {self.field.solver.name}; {wavelengths} nm; {self.scene!r}>"

    def viewpoint(self, camera: Camera) -> Viewpoint:
        """A camera in this light: aimed once, it hands out pictures, tiles and rays, from any thread."""
        check_kind("camera", camera, Camera, "give one, such as Camera.allsky(lat, lon)")
        check_observer(self.scene, camera, self.field.solver.name)
        ground_m = ground_below(self.scene, self.field, camera)
        check_above_ground(camera, ground_m)
        pixels = camera.pixels()
        return Viewpoint(self, camera, ground_m, pixels, camera.rays(self.field.frame, ground_m, pixels))

    def strength(self, name: str) -> F64 | float:
        """What a light's solar-relative radiance counts (nw,); 0 for one that is not solved for."""
        if not self.lights:
            return float(name == "sun")
        return next((light.strength for light in self.lights if light.name == name), 0.0)

    def save(self, path: str | os.PathLike[str]) -> None:
        """Keep the light and its scene as a Zarr folder, from which `openswim.open_light` makes the same pictures.

        Raises UserError for solver "reference" and for domains of very many columns, whose light is not kept.
        """
        towns = {} if self.lamps is None else {lamp.name: lamp.towns for lamp in self.lamps.every}
        lights = [KeptLamp(each.name, each.field, each.strength, towns[each.name]) for each in self.lights]
        save_light(self.scene, self.field, self.daylight, self.time, path, lights)


@dataclass(frozen=True, eq=False)
class Viewpoint:
    """A camera in the light of a scene; nothing that it is asked changes it."""

    lit: LitScene
    camera: Camera
    ground_m: float
    pixels: Pixels
    rays: Rays
    once: Once = dataclasses.field(default_factory=Once, repr=False)

    def __repr__(self) -> str:
        """One line: the camera and the light."""
        return f"<Viewpoint: {self.camera!r} in {self.lit!r}>"

    def view(self, layers: bool = False, irradiance: bool = True, sparse: float = 0.0) -> xr.Dataset:
        """The whole image: see `openswim.render`. ``irradiance``: with that at the observer among its attributes, which
        takes as long as some 60,000 rays. ``sparse``: light is not gathered along rays between neighbours along whose
        rows and columns it bends by no more than this over its mean. Under broken clouds pixels are then within .2 %
        rms and, but for one in a thousand, 1.7 % at `LOOKED_AT`, and within .9 % rms and 9 % at .1."""
        return self._picture(slice(None), slice(None), layers, irradiance, sparse)

    def tile(self, rows: slice, columns: slice, layers: bool = False, irradiance: bool = True) -> xr.Dataset:
        """Some rows and columns of the image, the same bit for bit as in the whole."""
        return self._picture(rows, columns, layers, irradiance)

    def _picture(
        self, rows: slice, columns: slice, layers: bool, irradiance: bool, sparse: float = 0.0
    ) -> xr.Dataset:
        ny, nx = self.pixels.inside.shape
        (top, bottom), (left, right) = _bounds("rows", rows, ny), _bounds("columns", columns, nx)
        if (rows.step or 1) != 1 or (columns.step or 1) != 1 or top >= bottom or left >= right:
            raise UserError(f"tile of rows {rows} and columns {columns}: give slices within {ny} x {nx}, without steps")
        # outlines are told by the pixels beside: one more on every side
        more = int(self._eye.sees_outlines)
        around = np.s_[max(top - more, 0) : min(bottom + more, ny), max(left - more, 0) : min(right + more, nx)]
        own = np.zeros((ny, nx), bool)
        own[top:bottom, left:right] = True
        relative, view = self._seen(_part(self.pixels, around), self._number[around], own[around], sparse)
        pixels = _part(self.pixels, np.s_[top:bottom, left:right])
        field, day = self.lit.field, self.lit.daylight
        if self.camera.view == "rays":
            _add_disc(relative, view, pixels, self._disc, self.lit.strength("sun") * self._disc.left)
        else:
            row, column, radiance = self.once("disc", self._drawn_disc)
            here = (row >= top) & (row < bottom) & (column >= left) & (column < right)
            number = (np.cumsum(pixels.inside) - 1).reshape(pixels.inside.shape)
            relative[number[row[here] - top, column[here] - left]] += radiance[here].astype(np.float32)
            if (heavens := self._heavens) is not None:
                for each in self.once(
                    "moon and stars", lambda: heavens.drawn(self.camera, self.pixels, self._disc, self._through)
                ):
                    part = each.part(top, bottom, left, right)
                    relative[number[part.row, part.column]] += part.radiance.astype(np.float32)
        self._add_night(relative, view, pixels)
        attrs = self._attrs(irradiance)
        image = dataset(field.frame, field.wavelengths_nm, day.distance_au, pixels, relative, view, attrs)
        if isinstance(view, ReferenceView):
            add_errors(image, pixels, view, field.solver.seed)
        if layers:
            rays = self.rays[self._number[top:bottom, left:right][pixels.inside]]
            add_layers(image, pixels, self._eye.sight(rays), field.frame)
        return image

    def sight(self, azimuth_deg: ArrayLike, altitude_deg: ArrayLike) -> Sight:
        """What stands in directions (n,) from the camera's place, and how far away it is."""
        rays = self._toward(azimuth_deg, altitude_deg)
        return self._eye.of_others(rays).sight(rays)

    def ahead(self) -> Sight:
        """The same in the middle pixel of the picture, with the land as the picture has it."""
        ny, nx = self._number.shape
        middle = int(self._number[ny // 2, nx // 2])
        return self._eye.sight(self.rays[middle : middle + 1])

    def look(self, azimuth_deg: ArrayLike, altitude_deg: ArrayLike) -> F64:
        """Solar-relative radiance (n, nw; Albers et al. 2020, Eq. 2) toward directions (n,) from the camera's place,
        without discs and stars."""
        rays = self._toward(azimuth_deg, altitude_deg)
        view = self._eye.view(rays)
        return np.asarray(view.radiance, float) + self._behind(rays.directions(), view)

    def sky(self, azimuth_deg: ArrayLike, altitude_deg: ArrayLike) -> tuple[F64, F64]:
        """Solar-relative radiance toward directions (n,), of which the sum counts, and the transmittance to space along
        them, 0 where they end on the ground; both (n, nw)."""
        view = self._eye.summed(self._toward(azimuth_deg, altitude_deg))
        return np.asarray(view.radiance, float), np.asarray(view.transmittance * ~view.hit[:, None], float)

    def beams(self, azimuth_deg: F64, altitude_deg: F64, radius_deg: F64) -> list[Beam]:
        """The beams of suns (n,) that stand elsewhere in the same sky."""
        wl = self.lit.field.wavelengths_nm
        at = zip(azimuth_deg, altitude_deg, radius_deg, strict=True)
        discs = [Disc(float(azimuth), float(altitude), float(radius), wl) for azimuth, altitude, radius in at]
        return beams_of(discs, self._through)

    def _toward(self, azimuth_deg: ArrayLike, altitude_deg: ArrayLike) -> Rays:
        azimuth, altitude = _checked_directions(azimuth_deg, altitude_deg)
        return Rays(self.rays.origin_m, horizon_vector(azimuth, altitude) @ self._axes)

    @cached_property
    def sun(self) -> tuple[float, float]:
        """Azimuth and altitude (degrees) of the sun at the camera."""
        return azimuth_altitude(self._axes @ self.lit.daylight.direction)

    @property
    def gases(self) -> dict[str, float]:
        """What `openswim.fluxes.broadband` asks of the gases above the camera; the scene's own water vapour where it
        has any."""
        height_m = float(self.lit.field.frame.latlon(self.rays.origin_m)[2])
        vapour_cm = scene_vapour_cm(self.lit.scene, *place_of(self.camera))
        air = self.lit.scene.atmosphere
        if vapour_cm is not None and air is not None:  # as much of it as the profile has above the camera
            vapour_cm *= air.precipitable_water_cm(height_m) / max(air.precipitable_water_cm(self.ground_m), 1e-9)
        return gases_above(air, height_m, vapour_cm)

    @property
    def _disc(self) -> Disc:
        bite = None if self._heavens is None else self._heavens.bite()
        return Disc(*self.sun, self.lit.daylight.angular_radius_deg, self.lit.field.wavelengths_nm, bite)

    def _drawn_disc(self) -> tuple[NDArray, NDArray, F64]:
        row, column, radiance = drawn(self.camera, self.pixels, self._disc, self._through)
        return row, column, radiance * self.lit.strength("sun")

    @property
    def _heavens(self) -> Heavens | None:
        """What stands in the sky besides the sun; None where no time is known."""
        return self.once("heavens", self._make_heavens)

    def _make_heavens(self) -> Heavens | None:
        lit, frame, at = self.lit, self.lit.field.frame, place_of(self.camera)
        if lit.lamps is None or lit.time is None:
            return None
        lon, lat = at if frame.curved else lit.scene.place[::-1]
        wl = lit.field.wavelengths_nm
        return Heavens(
            lit.lamps, lit.time, (lat, lon), float(frame.latlon(self.rays.origin_m)[2]), self._axes,
            lit.scene.atmosphere, wl, toa_irradiance(wl, lit.daylight), self.sun[1],
            np.atleast_2d(np.asarray(self.rays.origin_m, float))[0],
        )  # fmt: skip

    def _behind(self, direction: F64, view: Any) -> F64 | float:
        """Solar-relative radiance (n, nw) of the night's sky behind what rays (n, 3) see."""
        heavens = self._heavens
        if heavens is None or self.sun[1] >= DUSK_DEG:
            return 0.0
        found = heavens.behind(direction, view.transmittance, view.hit)
        domes = self.once("domes", self._make_domes)
        if domes is None:
            return found
        free = np.where(view.hit, 0.0, np.exp(-view.species_depth.sum(axis=1, dtype=float)))  # of clouds
        return found + free[:, None] * domes.toward(direction) * (4 * np.pi / heavens.toa)

    def _make_domes(self) -> Around | None:
        sky = next((light for light in self.lit.lights if light.name == "sky"), None)
        if self._heavens is None or sky is None:
            return None
        return domes_beyond(self.lit.scene, sky.field, self._heavens)

    def _add_night(self, relative: NDArray, view: Any, pixels: Pixels) -> None:
        """The night's sky behind all else, into radiance (n, nw) of pixels; on single rays the moon as well."""
        heavens = self._heavens
        if heavens is None:
            return
        if self.sun[1] < DUSK_DEG:
            relative += np.float32(self._behind(pixels.direction[pixels.inside] @ self._axes, view))
        if self.camera.view == "rays":
            _add_disc(relative, view, pixels, heavens.moon_disc(), heavens.moon_strength())

    def _through(self, local: F64, width_rad: float) -> tuple[NDArray, NDArray[np.bool_]]:
        """What rays toward directions (n, 3) in the horizon frame go through: see `heavens.sun_disc.Through`."""
        return self._eye.through(Rays(self.rays.origin_m, local @ self._axes, width_rad))

    @property
    def attrs(self) -> dict[str, Any]:
        """What is to be known of the image: place, time, sun, solver, and the irradiance at an observer near by."""
        return self._attrs()

    def _attrs(self, irradiance: bool = True) -> dict[str, Any]:
        made = dict(self.once("attributes", self._made_attrs))
        return made | (self.once("irradiance", self._near_irradiance) if irradiance and self._near else {})

    def _made_attrs(self) -> dict[str, Any]:
        lit = self.lit
        notes = stated(lit.field.wavelengths_nm, lit.scene.atmosphere)
        notes += [] if lit.lamps is None else lit.lamps.stated()
        out = image_attributes(lit.scene, lit.field, self.camera, self.sun, lit.daylight.distance_au, lit.time, notes)
        out |= {} if self._heavens is None else self._heavens.attrs()
        if self._near and lit.scene.atmosphere is not None:
            levels = lit.scene.levels[: max(len(lit.field.media), 1)]
            out["aerosol_optical_depth_550nm"] = round(aerosol_above(levels, self.camera, self.ground_m), 5)
        return out

    def _near_irradiance(self) -> dict[str, Any]:
        kept, place = self.lit.irradiances, np.asarray(self.rays.origin_m, float).tobytes()
        if place not in kept:
            kept[place] = self._irradiance()
        return kept[place]

    @property
    def _eye(self) -> Eye:
        return self.once("eye", self._aimed)

    def _aimed(self) -> Eye:
        return Eyes.of(self._seen_from_here(), self.rays) if self.lit.lights else self.lit.field.viewpoint(self.rays)

    def _seen_from_here(self) -> tuple[LitBy, ...]:
        """The lights; from space, where it is night in the scene, also the sun on clear air beyond: the lit limb."""
        lit, left, air = self.lit, 1 - np.asarray(self.lit.strength("sun")), self.lit.scene.atmosphere
        if self._near or air is None or not lit.field.frame.curved or not left.any():
            return lit.lights
        frame, wl = lit.field.frame, lit.field.wavelengths_nm
        found = Solver().solve(Scene.clear(frame.lat, frame.lon, air), lit.daylight.direction, wl)
        assert isinstance(found, Field)
        return (*lit.lights, LitBy("limb", found, left * np.ones(len(wl))))

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
        wl, distance_au = self.lit.field.wavelengths_nm, self.lit.daylight.distance_au
        quadrature = quadrature_directions(_QUADRATURE, *self.sun)
        radiance, _ = self.sky(quadrature.azimuth_deg, quadrature.altitude_deg)
        beam = beam_of(self._disc, self._through)
        direct, altitude = beam.direct * self.lit.strength("sun"), beam.altitude_deg
        spectral = spectral_irradiance(radiance, quadrature, direct, altitude, wl, distance_au)
        diffuse = spectral["relative_diffuse_horizontal"].values
        wide = broadband(beam.open, diffuse, wl, altitude, distance_au, visible=beam.visible, **self.gases)
        lux = illuminance_lx(spectral["relative_global_horizontal"].values + self._moonbeam(), wl, distance_au)
        return irradiance_attributes(spectral, wide, lux)

    def _moonbeam(self) -> F64 | float:
        """The moon's direct light on the horizontal, over the sun's outside of the air."""
        heavens, strength = self._heavens, self.lit.strength("moon")
        if heavens is None or not np.any(strength):
            return 0.0
        beam = beam_of(heavens.moon_disc(), self._through)
        return np.asarray(beam.direct * strength * max(np.sin(np.radians(beam.altitude_deg)), 0.0))

    def _seen(
        self, pixels: Pixels, number: NDArray[np.int64], own: NDArray[np.bool_], sparse: float
    ) -> tuple[NDArray, Any]:
        """Radiance of those pixels that are ``own``, and what they see; those around tell of outlines."""
        eye, inside = self._eye, pixels.inside
        rays = self.rays[number[inside]]
        if sparse > 0:
            rays.image, rays.alike = np.where(inside, np.cumsum(inside).reshape(inside.shape) - 1, -1), sparse
        view = eye.view(rays)
        relative, wanted = view.radiance.astype(np.float32), own[inside]
        # from space pixels are about as long on the ground as they are wide, and are seen as one
        if self._near and eye.sees_outlines and self.lit.field.frame.curved:
            edge = np.flatnonzero(outlines_of(view, inside) & wanted)
            relative[edge] = softened(eye, rays[edge], self.lit.field.frame)
        every = {f.name: getattr(view, f.name) for f in dataclasses.fields(view)}
        rows = {k: v[wanted] for k, v in every.items() if isinstance(v, np.ndarray) and v.shape[:1] == wanted.shape}
        return relative[wanted], dataclasses.replace(view, **rows)


def _bounds(what: str, part: Any, length: int) -> tuple[int, int]:
    """The first of the rows or columns of a slice, and the one after the last."""
    check_kind(what, part, slice, "give a slice, such as slice(0, 8)")
    try:
        return part.indices(length)[:2]
    except TypeError:
        raise UserError(f"{what} is {shown(part)}: give a slice of whole numbers, such as slice(0, 8)") from None


def _checked_directions(azimuth_deg: ArrayLike, altitude_deg: ArrayLike) -> tuple[F64, F64]:
    """Azimuths and altitudes (n,), of one number each or of lists."""
    azimuth = np.atleast_1d(numbers("azimuth_deg", azimuth_deg)).astype(float)
    altitude = np.atleast_1d(numbers("altitude_deg", altitude_deg)).astype(float)
    alike = azimuth.size == altitude.size or 1 in (azimuth.size, altitude.size)
    if azimuth.ndim > 1 or altitude.ndim > 1 or not alike:
        raise UserError(
            f"azimuth_deg has shape {azimuth.shape} and altitude_deg {altitude.shape}: give a number or a list of "
            "each, of one length"
        )
    if not np.isfinite(azimuth).all():
        raise UserError("azimuth_deg must be finite: leave out directions that are not known")
    if not (np.abs(altitude) <= 90 + _ROUNDING_DEG).all():
        raise UserError("altitude_deg must lie within -90..90 degrees")
    azimuth, altitude = np.broadcast_arrays(azimuth, altitude)
    return azimuth, altitude


def _add_disc(relative: NDArray, view: Any, pixels: Pixels, disc: Disc, strength: F64 | float) -> None:
    """A disc, of sun or moon, in single rays, whose footprints are round and soft, dimmed by what each goes through."""
    inside, open_to = pixels.inside, np.flatnonzero(~view.hit)
    distance = pixels.angle_to_deg(disc.azimuth_deg, disc.altitude_deg)[inside]
    half = np.broadcast_to(pixels.half_width_deg, inside.shape)[inside]
    radiance = disc_coverage(distance[open_to], half[open_to], disc.radius_deg, disc.wavelengths_nm)
    relative[open_to] += (strength * radiance * view.transmittance[open_to]).astype(np.float32)


def _part(pixels: Pixels, where: tuple[slice, slice]) -> Pixels:
    return Pixels(pixels.direction[where], pixels.solid_angle_sr[where])
