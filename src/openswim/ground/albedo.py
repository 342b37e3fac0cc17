"""What the ground is at given places: albedo, open water, snow, sea ice and wind."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from openswim.ground import earth, spectra

if TYPE_CHECKING:
    import xarray as xr

    from openswim.scene.grid import Grid
    from openswim.scene.scene import Scene

FloatArray = NDArray[np.float64]

DEFAULT_WIND_M_S = 5.0
_WIND_CELLS = 30.0
_EDGE_CELLS = 3.0  # width over which the domain's ground fades into the default Earth


@dataclass
class SurfaceSample:
    """The ground at n places.

    albedo: (n, nwl) of all that is not open water (land, snow, ice); water: open-water fraction; snow: share
    of the rest that reflects like snow; sea_ice: sea-ice fraction of the place; wind_speed: m/s at 10 m; all
    (n,). lambertian: reflect the same in all directions (reference cases).
    """

    albedo: FloatArray
    water: FloatArray
    snow: FloatArray
    sea_ice: FloatArray
    wind_speed: FloatArray
    lambertian: bool = False


def surface_properties(scene: Scene, lat: ArrayLike, lon: ArrayLike, wavelengths_nm: ArrayLike) -> SurfaceSample:
    """The ground at places (n,), in degrees; in flat scenes `lat` and `lon` are y and x in metres.

    - A scene that is flat, has no grid, or gives `surface_albedo` without `land_area_fraction` has exactly
    that
      albedo, Lambertian, and nothing else; beyond its grid the nearest value holds (or the period repeats).
    - Otherwise the model's fields hold in its domain and the default Earth (`openswim.ground.earth`) outside
    and
      for what the model lacks, without sea ice, and with the model's mean wind, which becomes 5 m/s
      some 30 cells away; they blend over the outermost three cells.
    - A spectral `surface_albedo` (y, x, wavelength) is used as it is. A broadband one sets the visible level
      (`spectra.visible_from_broadband`); the default Earth and the model's snow give the colour.
    """
    wavelengths = np.atleast_1d(np.asarray(wavelengths_nm, float))
    lat_, lon_ = np.atleast_1d(np.asarray(lat, float)), np.atleast_1d(np.asarray(lon, float))
    data, grid = scene.data, scene.grid
    if grid is None or not grid.curved:
        return _plain(data, grid, lat_, lon_, wavelengths)
    ix, iy = grid.index(lon_, lat_)
    if "surface_albedo" in data and "land_area_fraction" not in data:
        return _plain_at(data, ix, iy, wavelengths, lat_.size)
    outside = _default_earth(lat_, lon_, wavelengths)
    outside.wind_speed[:] = _wind_around(data, ix, iy, grid)
    inside = _inside_weight(ix, iy, grid)
    hit = inside > 0
    if not hit.any():
        return outside
    model = _model_ground(data, ix[hit], iy[hit], _subset(outside, hit), wavelengths)
    return _blended(outside, model, hit, inside[hit])


def _plain(data: xr.Dataset, grid: Grid | None, y: FloatArray, x: FloatArray, wavelengths: FloatArray) -> SurfaceSample:
    if grid is None:
        return _plain_at(data, x, y, wavelengths, y.size)
    ix, iy = (x - grid.x[0]) / grid.step[0], (y - grid.y[0]) / grid.step[1]
    if grid.periodic:
        ix, iy = ix % grid.x.size, iy % grid.y.size
    return _plain_at(data, ix, iy, wavelengths, y.size, periodic=grid.periodic)


def _plain_at(
    data: xr.Dataset, ix: FloatArray, iy: FloatArray, wavelengths: FloatArray, n: int, periodic: bool = False
) -> SurfaceSample:
    """Lambertian ground of the scene's own albedo (black where it has none)."""
    zero = np.zeros(n)
    if "surface_albedo" not in data:
        albedo = np.zeros((n, wavelengths.size))
    elif "x" in data["surface_albedo"].dims:
        values = _spectral(data["surface_albedo"], wavelengths)
        if periodic:
            values = np.pad(values, ((0, 1), (0, 1), (0, 0)), mode="wrap")
        albedo = _bilinear(values, ix, iy)
    else:
        albedo = np.broadcast_to(_spectral(data["surface_albedo"], wavelengths), (n, wavelengths.size)).copy()
    return SurfaceSample(albedo, zero, zero, zero, zero, lambertian=True)


def _default_earth(lat: FloatArray, lon: FloatArray, wavelengths: FloatArray) -> SurfaceSample:
    water = earth.water_fraction(lat, lon)
    albedo = np.broadcast_to(spectra.generic_land(wavelengths), (lat.size, wavelengths.size)).copy()
    land = water < 1
    if land.any():
        albedo[land] = earth.land_albedo(lat[land], lon[land], wavelengths)
    # Only ice sheets and permanent snow are both as bright as this.
    snow = np.where(land, np.clip((albedo.min(axis=1) - 0.55) / 0.2, 0.0, 1.0), 0.0)
    albedo += snow[:, None] * (spectra.snow(wavelengths) - albedo)
    return SurfaceSample(albedo, water, snow, np.zeros(lat.size), np.full(lat.size, DEFAULT_WIND_M_S))


def _model_ground(
    data: xr.Dataset, ix: FloatArray, iy: FloatArray, default: SurfaceSample, wavelengths: FloatArray
) -> SurfaceSample:
    """The model's fields at fractional indices, `default` (at the same places) filling the gaps."""
    dry = 1.0 - default.water
    if "land_area_fraction" in data:
        land = _surface(data, "land_area_fraction")
        dry = _bilinear(land, ix, iy)
        if np.isin(land, (0.0, 1.0)).all():
            dry = earth.sharpened(dry)
    ice = np.zeros(ix.size)
    if "sea_ice_area_fraction" in data:
        ice = _bilinear(_surface(data, "sea_ice_area_fraction"), ix, iy)
    albedo, snow = default.albedo, default.snow
    if "snow_area_fraction" in data:
        cover = _bilinear(_surface(data, "snow_area_fraction"), ix, iy)
        albedo = albedo + (cover * (1 - snow))[:, None] * np.maximum(spectra.snow(wavelengths) - albedo, 0.0)
        snow = np.maximum(snow, cover)
    if "surface_albedo" in data:
        albedo = _with_model_albedo(data, ix, iy, albedo, wavelengths)
    frozen = (1 - dry) * ice
    solid = dry + frozen
    share = np.divide(frozen, solid, out=np.zeros_like(solid), where=solid > 0)
    albedo = albedo + share[:, None] * (spectra.sea_ice(wavelengths) - albedo)
    return SurfaceSample(albedo, 1 - solid, snow + share * (1 - snow), frozen, _wind(data, ix, iy))


def _with_model_albedo(
    data: xr.Dataset, ix: FloatArray, iy: FloatArray, colour: FloatArray, wavelengths: FloatArray
) -> FloatArray:
    """Spectral albedo of the land: the model's own, or its broadband level in the colour of the land."""
    field = data["surface_albedo"]
    land = _surface(data, "land_area_fraction") >= 0.5
    if "wavelength" in field.dims:
        return _bilinear(_spectral(field, wavelengths), ix, iy, land)
    level = spectra.visible_from_broadband(_bilinear(_surface(data, "surface_albedo"), ix, iy, land))
    return np.clip(colour * (level / np.maximum(colour.mean(axis=1), 1e-3))[:, None], 0.0, 0.98)


def _wind(data: xr.Dataset, ix: FloatArray, iy: FloatArray) -> FloatArray:
    if "wind_east_10m" not in data or "wind_north_10m" not in data:
        return np.full(ix.size, DEFAULT_WIND_M_S)
    speed = np.hypot(_surface(data, "wind_east_10m"), _surface(data, "wind_north_10m"))
    return _bilinear(speed, ix, iy)


def _wind_around(data: xr.Dataset, ix: FloatArray, iy: FloatArray, grid: Grid) -> FloatArray:
    """Wind (n,) beyond the domain: its mean, fading into the default away from it, so that the glint has no edge."""
    _, ny, nx = grid.shape
    x, y = (np.nan_to_num(i, nan=1e9, posinf=1e9, neginf=-1e9) for i in (ix, iy))
    away = np.hypot(x - np.clip(x, 0, nx - 1), y - np.clip(y, 0, ny - 1))
    if "wind_east_10m" in data and "wind_north_10m" in data:
        mean = float(np.hypot(_surface(data, "wind_east_10m"), _surface(data, "wind_north_10m")).mean())
    else:
        mean = DEFAULT_WIND_M_S
    return DEFAULT_WIND_M_S + np.exp(-((away / _WIND_CELLS) ** 2)) * (mean - DEFAULT_WIND_M_S)


def _surface(data: xr.Dataset, name: str) -> FloatArray:
    return np.asarray(data[name].transpose("y", "x").values, float)


def _spectral(field: xr.DataArray, wavelengths: FloatArray) -> FloatArray:
    """(..., nwl): interpolated where the field has wavelengths, repeated where it has not."""
    if "wavelength" not in field.dims:
        return np.repeat(np.asarray(field.values, float)[..., None], wavelengths.size, axis=-1)
    field = field.transpose(..., "wavelength")
    known = np.asarray(field["wavelength"].values, float)
    return spectra.at_wavelengths(known, np.asarray(field.values, float), wavelengths)


def _bilinear(values: FloatArray, ix: FloatArray, iy: FloatArray, valid: NDArray[np.bool_] | None = None) -> FloatArray:
    """(ny, nx[, k]) at fractional indices, the edge holding beyond; only among `valid` nodes where there are
    any."""
    ny, nx = values.shape[:2]
    x, y = np.clip(ix, 0, nx - 1), np.clip(iy, 0, ny - 1)
    i, j = np.minimum(x.astype(int), nx - 2), np.minimum(y.astype(int), ny - 2)
    fx, fy = x - i, y - j
    rows, columns = np.stack([j, j, j + 1, j + 1]), np.stack([i, i + 1, i, i + 1])
    weights = np.stack([(1 - fy) * (1 - fx), (1 - fy) * fx, fy * (1 - fx), fy * fx])
    if valid is not None:
        kept = weights * valid[rows, columns]
        weights = np.where(kept.sum(axis=0) > 1e-6, kept, weights)
        weights = weights / weights.sum(axis=0)
    corners = values[rows, columns]
    return (corners * weights.reshape(weights.shape + (1,) * (corners.ndim - 2))).sum(axis=0)


def _inside_weight(ix: FloatArray, iy: FloatArray, grid: Grid) -> FloatArray:
    """1 well within the domain, 0 outside, a ramp over the outermost cells."""
    _, ny, nx = grid.shape
    with np.errstate(invalid="ignore"):
        depth = np.minimum.reduce([ix, nx - 1 - ix, iy, ny - 1 - iy])
    width = min(_EDGE_CELLS, 0.25 * (min(nx, ny) - 1))
    return np.clip(np.nan_to_num(depth, nan=-1.0, neginf=-1.0) / width, 0.0, 1.0)


def _subset(sample: SurfaceSample, where: NDArray[np.bool_]) -> SurfaceSample:
    return SurfaceSample(
        sample.albedo[where],
        sample.water[where],
        sample.snow[where],
        sample.sea_ice[where],
        sample.wind_speed[where],
    )


def _blended(outside: SurfaceSample, model: SurfaceSample, hit: NDArray[np.bool_], share: FloatArray) -> SurfaceSample:
    for name in ("albedo", "water", "snow", "sea_ice", "wind_speed"):
        target, own = getattr(outside, name), getattr(model, name)
        weight = share[:, None] if own.ndim == 2 else share
        target[hit] += weight * (own - target[hit])
    return outside
