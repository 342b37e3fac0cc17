"""A clear sky over a station: the scene that its data call for, and the aerosol that its beam tells of."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from openswim.cameras import Camera
from openswim.errors import UserError
from openswim.fluxes import broadband, vapour_by_humidity_cm
from openswim.ground.spectra import visible_from_broadband
from openswim.lighting import light
from openswim.lights import SunTrack
from openswim.scene import Scene
from openswim.scene.aerosol import AerosolProfile
from openswim.scene.atmosphere import Atmosphere
from openswim.stations.checks import sun_of
from openswim.stations.through_time import WAVELENGTHS_NM

F64 = NDArray[np.float64]

DEFAULT_ALBEDO = 0.2
_TRIED = (0.0, 0.2)  # optical depths; the beam's is linear in it
_HIGHEST_DEPTH = 3.0


def scene_over(
    station: xr.Dataset, aerosol: AerosolProfile | None = None, ozone_du: float = 300.0, albedo: float | None = None
) -> Scene:
    """The clear sky over a station: its height, its precipitable water by humidity (Gueymard 1994) and its ground's
    albedo by upwelling light, where it measures them. The default aerosol lies above the station.

    The air gets back what the ground reflects of visible light, which is less than of all sunlight; ``albedo`` is of
    visible light."""
    height = station.attrs["height_m"]
    aerosol = AerosolProfile(base_height_m=height) if aerosol is None else aerosol
    return Scene.clear(
        station.attrs["latitude"], station.attrs["longitude"], Atmosphere.us_standard(ozone_du, aerosol),
        surface_albedo=visible_albedo_of(station) if albedo is None else albedo, terrain_m=height,
        water_vapour_cm=vapour_of(station),
    )  # fmt: skip


def vapour_of(station: xr.Dataset) -> float | None:
    """Precipitable water (cm) by the day's median temperature and humidity; None where they are not measured."""
    if "temperature" not in station or "relative_humidity" not in station:
        return None
    kelvin, humidity = (float(station[name].median()) for name in ("temperature", "relative_humidity"))
    return float(vapour_by_humidity_cm(kelvin, min(humidity, 1.0)))


def albedo_of(station: xr.Dataset) -> float:
    """Upwelling over global light, of all wavelengths, around noon where both were measured then, else .2."""
    if "up" in station and "ghi" in station:
        ratio = (station.up / station.ghi).where(station.ghi > 0.7 * station.ghi.max()).values
        if np.isfinite(ratio).any():
            return float(np.clip(np.nanmedian(ratio), 0.0, 1.0))
    return DEFAULT_ALBEDO


def visible_albedo_of(station: xr.Dataset) -> float:
    """Of visible light, by `albedo_of` as for a model's ground: bare and green land are brighter beyond 700 nm."""
    return float(visible_from_broadband(np.array(albedo_of(station))))


@dataclass(frozen=True)
class AerosolFit:
    """An aerosol of the optical depth that measured direct light asks for; the times used, and how near they come."""

    optical_depth: float  # at 550 nm, of all layers
    times: int
    rms_w_m2: float


def fit_aerosol(station: xr.Dataset, rows: NDArray[np.bool_], scene: Scene) -> AerosolFit:
    """The optical depth of the scene's aerosol (550 nm) with which its DNI is a station's at `rows` (nt,), by least
    squares; everything else of the aerosol stays. Two solves, since the beam's depth is linear in the aerosol's."""
    if "dni" not in station:
        raise UserError("no direct irradiance in the station's file: an aerosol cannot be fitted to it")
    use = rows & np.isfinite(station.dni.values)
    if use.sum() < 3:
        raise UserError(f"{int(use.sum())} clear values of direct irradiance: too few to fit an aerosol to")
    if scene.atmosphere is None or not isinstance(scene.atmosphere.aerosol, AerosolProfile):
        raise UserError("the scene has no aerosol of one kind, whose optical depth could be fitted")
    track = sun_of(station)
    parts = SunTrack(*(getattr(track, field.name)[use] for field in dataclasses.fields(SunTrack)))
    measured = station.dni.values[use]
    atmosphere = scene.atmosphere
    depths, gases = [], {}
    for aod in _TRIED:
        changed = atmosphere.with_aerosol_depth(aod)
        tried = dataclasses.replace(scene, atmosphere=changed)
        lit = light(tried, wavelengths_nm=WAVELENGTHS_NM, sun=(0.0, 45.0))
        viewpoint = lit.viewpoint(Camera.allsky(*scene.place, size=2))
        beam = viewpoint.sky(parts.azimuth_deg, parts.refracted_altitude_deg)[1]
        depths.append(-np.log(np.maximum(beam, 1e-30)))
        gases = viewpoint.gases
    base, per_depth = depths[0], (depths[1] - depths[0]) / _TRIED[1]

    def off(aod: float) -> F64:
        transmittance = np.exp(-(base + aod * per_depth))
        rows = zip(transmittance, parts.refracted_altitude_deg, parts.distance_au, strict=True)
        none = np.zeros(len(WAVELENGTHS_NM))
        found = [broadband(t, none, np.array(WAVELENGTHS_NM), h, d, **gases).direct_normal for t, h, d in rows]
        return np.array(found) - measured

    from scipy.optimize import minimize_scalar

    best = minimize_scalar(
        lambda aod: float((off(aod) ** 2).mean()), bounds=(0.0, _HIGHEST_DEPTH), method="bounded",
        options={"xatol": 1e-4},
    )  # fmt: skip
    depth = float(best.x)
    return AerosolFit(depth, int(use.sum()), float(np.sqrt(best.fun)))
