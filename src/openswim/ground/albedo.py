"""What the ground is at given places: albedo, open water, snow, sea ice and wind."""

from __future__ import annotations

from dataclasses import dataclass, fields, replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from openswim.ground import earth, snow, spectra
from openswim.ground.fields import bilinear, spectral
from openswim.ground.footprints import LongFootprints
from openswim.ground.maps import Ground, mapped_albedo, maps_of, textured
from openswim.ground.model import DARK_LAND, ModelGround
from openswim.ground.near_infrared import LAST_VISIBLE_NM, VISIBLE_NM, beyond_visible
from openswim.ground.noise import fractal_noise, resolved_share
from openswim.ground.patches import patched, wood_noise
from openswim.ground.sample import SurfaceSample
from openswim.scene.rims import BEYOND_CELLS

if TYPE_CHECKING:
    import xarray as xr

    from openswim.scene.grid import Grid
    from openswim.scene.scene import Scene

FloatArray = NDArray[np.float64]

DEFAULT_WIND_M_S = 5.0
SEA_CHLOROPHYLL, LAKE_CHLOROPHYLL = 0.2, 2.0  # mg m-3: the open ocean's median, a clear lake
_EDGE_CELLS = 3.0  # width over which the domain's shores fade into the default Earth's
_WIND_CELLS = 10.0  # over which wind beyond the domain goes over to the domain's mean
_NO_SHORE = 1e-6  # share of water, or of land, that is none
_RAGGED = 0.15  # of a cell of what knows land and water, standard deviation of the shore
_BY_HEIGHT = 0.75  # standard deviation, of 1, of where snow lies that height tells; the rest is chance


def surface_properties(
    scene: Scene, lat: ArrayLike, lon: ArrayLike, wavelengths_nm: ArrayLike, footprint_m: ArrayLike = 0.0,
    detail: bool = False, model: ModelGround | None = None, long: LongFootprints | None = None,
) -> SurfaceSample:  # fmt: skip
    """The ground at places (n,), in degrees; in flat scenes `lat` and `lon` are y and x in metres.

    - A scene that is flat, has no grid, or gives `surface_albedo` without `land_area_fraction` has exactly that
      albedo, Lambertian, and nothing else; beyond its grid the nearest value holds (or the period repeats).
    - Otherwise the user's maps come first (`openswim.ground.Ground`), then the model's fields in its domain, then the
      default Earth (`openswim.ground.earth`). Shores blend over the outermost three cells; the model's snow, wind and
      brightness fade out over some 30 cells beyond it.
    - A spectral `surface_albedo` (y, x, wavelength) is used as it is. A broadband one sets the visible level
      (`spectra.visible_from_broadband`) of land and of snow; maps and the model's snow give the colour.
    - Snow of a fraction of a cell lies where it is higher than its neighbourhood, and by chance (`snow`).

    footprint_m: what a pixel of the picture covers, a number or (n,); maps are averaged over it, or over what it covers
    of the ground that it looks along (``long``). detail: whether land
    is given the woods and clearings that maps are too coarse for, where a footprint is known (`patches`; invented).
    model: the scene's `ModelGround` at the wavelengths, for who asks more than once.

    Beyond 700 nm, where no map shows anything, land and snow are what their visible colour says (`near_infrared`); an
    albedo that the scene gives at wavelengths of its own is used there as it is.
    """
    wavelengths = np.atleast_1d(np.asarray(wavelengths_nm, float))
    if wavelengths.max(initial=0.0) > LAST_VISIBLE_NM and not _own_spectrum(scene):
        return _beyond_visible(scene, lat, lon, wavelengths, footprint_m, detail, model, long)
    lat_, lon_ = np.atleast_1d(np.asarray(lat, float)), np.atleast_1d(np.asarray(lon, float))
    footprint = np.broadcast_to(np.asarray(footprint_m, float), lat_.shape)
    data, grid = scene.data, scene.grid
    if grid is None or not grid.curved:
        return _plain(data, grid, lat_, lon_, wavelengths)
    ix, iy = grid.index(lon_, lat_)
    if "surface_albedo" in data and "land_area_fraction" not in data:
        return _plain_at(data, ix, iy, wavelengths, lat_.size)
    ground = scene.ground or Ground()
    ix, iy = (np.nan_to_num(i, nan=1e9, posinf=1e9, neginf=-1e9) for i in (ix, iy))
    finest = np.where(footprint > 0, footprint, np.inf) if detail else np.full(lat_.size, np.inf)
    near = _Places(lat_, lon_, ix, iy, _away(ix, iy, grid), footprint, finest, min(grid.spacing_m()))
    model = ModelGround.of(scene, wavelengths) if model is None else model
    sample, mapped = _without_model(ground, scene, near, wavelengths, long)
    sample.wind_speed[:] = _wind(model, near)
    sample.mean_square_slope = _wave_slope(model, near, sample.slope_variance)
    hit = near.fade > 0.01
    if hit.any():
        modelled = _with_model(model, near.where(hit), sample[hit], wavelengths, mapped[hit])
        inside = _inside_weight(ix[hit], iy[hit], grid)
        _blend(sample, modelled, hit, inside)
    bright, known_m = _pictured(ground, scene, near, sample.albedo, wavelengths, mapped, long)
    fine = np.flatnonzero((sample.water < 1) & (sample.snow < 1) & (finest < known_m))
    bright[fine] = patched(bright[fine], lat_[fine], lon_[fine], wavelengths, known_m[fine], finest[fine])
    sample.albedo += (1 - sample.snow)[:, None] * (bright - sample.albedo)
    return sample


def _own_spectrum(scene: Scene) -> bool:
    """Whether the scene has an albedo that is used as it is at all wavelengths."""
    data, grid = scene.data, scene.grid
    if grid is None or not grid.curved:
        return True
    if "surface_albedo" not in data:
        return False
    return "land_area_fraction" not in data or "wavelength" in data["surface_albedo"].dims


def _beyond_visible(
    scene: Scene, lat: ArrayLike, lon: ArrayLike, wavelengths: FloatArray, footprint_m: ArrayLike, detail: bool,
    model: ModelGround | None, long: LongFootprints | None,
) -> SurfaceSample:  # fmt: skip
    """`surface_properties` where some wavelengths lie beyond 700 nm."""
    far = wavelengths > LAST_VISIBLE_NM
    seen = surface_properties(scene, lat, lon, VISIBLE_NM, footprint_m, detail, model, long)
    albedo = np.empty((seen.water.size, wavelengths.size))
    albedo[:, far] = beyond_visible(seen, wavelengths[far])
    if not far.all():
        near = surface_properties(scene, lat, lon, wavelengths[~far], footprint_m, detail, model, long)
        albedo[:, ~far] = near.albedo
    return replace(seen, albedo=albedo)


@dataclass
class _Places:
    """Places (n,) by degrees and grid index, how many cells they are `away` from the domain, what a pixel covers, and
    what nothing that is invented may be finer than."""

    lat: FloatArray
    lon: FloatArray
    ix: FloatArray
    iy: FloatArray
    away: FloatArray
    footprint_m: FloatArray
    finest_m: FloatArray
    cell_m: float

    @property
    def fade(self) -> FloatArray:
        """What is left of the model's say (n,): 1 inside, 0 far away."""
        return np.exp(-((np.minimum(self.away, 1e3) / BEYOND_CELLS) ** 2))

    def where(self, some: NDArray[np.bool_]) -> _Places:
        arrays = (f.name for f in fields(self) if f.name != "cell_m")
        return replace(self, **{name: getattr(self, name)[some] for name in arrays})


def _plain(data: xr.Dataset, grid: Grid | None, y: FloatArray, x: FloatArray, wavelengths: FloatArray) -> SurfaceSample:
    if grid is None:
        return _plain_at(data, x, y, wavelengths, y.size)
    ix, iy = grid.place(x, y)
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
        values = spectral(data["surface_albedo"], wavelengths)
        if periodic:
            values = np.pad(values, ((0, 1), (0, 1), (0, 0)), mode="wrap")
        albedo = bilinear(values, ix, iy)
    else:
        albedo = np.broadcast_to(spectral(data["surface_albedo"], wavelengths), (n, wavelengths.size)).copy()
    return SurfaceSample(albedo, zero, zero, zero, zero, zero + SEA_CHLOROPHYLL, lambertian=True)


def _without_model(
    ground: Ground, scene: Scene, near: _Places, wavelengths: FloatArray, long: LongFootprints | None
) -> tuple[SurfaceSample, FloatArray]:
    """The user's maps over the default Earth, and the share (n,) of each place that the maps show."""
    lat, lon, footprint = near.lat, near.lon, near.footprint_m
    water, lake = _shored(earth.water_fraction(lat, lon), near, earth.MASK_M), earth.lake_fraction(lat, lon)
    wide = footprint > 2 * earth.MASK_M
    water[wide] = 1.0 - earth.mean_land(lat[wide], lon[wide], footprint[wide])
    albedo = np.broadcast_to(spectra.generic_land(wavelengths), (lat.size, wavelengths.size)).copy()
    land = water < 1
    if land.any():
        albedo[land] = earth.land_albedo(lat[land], lon[land], wavelengths, footprint[land])
    maps = maps_of(ground).albedo_at(scene.time, texture=False)
    mapped = np.zeros(lat.size)
    if maps:
        own, mapped = mapped_albedo(maps, lat, lon, wavelengths, footprint, long)
        albedo += mapped[:, None] * (own - albedo)
    # Only ice sheets and permanent snow are both as bright as this.
    icy = np.where(land, np.clip((albedo.min(axis=1) - 0.55) / 0.2, 0.0, 1.0), 0.0)
    albedo += icy[:, None] * (snow.snow_albedo(wavelengths) - albedo)
    green = np.where(lake > 0.5, LAKE_CHLOROPHYLL, SEA_CHLOROPHYLL)
    if ground.chlorophyll_mg_m3 is not None:
        green = np.full(lat.size, ground.chlorophyll_mg_m3)
    wind = np.full(lat.size, DEFAULT_WIND_M_S)
    return SurfaceSample(albedo, water, icy, np.zeros(lat.size), wind, green), mapped


def _shored(share: FloatArray, near: _Places, cell_m: float) -> FloatArray:
    """Water or land (n,) of a mask of cells of ``cell_m``, between which it is linear: with a smooth shore, or a ragged
    one for near eyes, that has as much on either side."""
    # what is linear between ones is one but for rounding
    shore = np.flatnonzero((share * (1 - share) > _NO_SHORE) & (near.finest_m < cell_m))
    ragged = share.copy()
    noise, _ = fractal_noise(near.lat[shore], near.lon[shore], cell_m, near.finest_m[shore])
    ragged[shore] += _RAGGED * noise
    return earth.sharpened(ragged)


def _pictured(
    ground: Ground, scene: Scene, near: _Places, albedo: FloatArray, wavelengths: FloatArray, mapped: FloatArray,
    long: LongFootprints | None,
) -> tuple[FloatArray, FloatArray]:  # fmt: skip
    """Albedo of land (n, nwl) with what aerial pictures show, and over how many metres (n,) it is then known."""
    known_m = np.full(near.lat.size, earth.PIXEL_M)
    if "surface_albedo" in scene.data and scene.grid is not None:
        known_m *= np.minimum(near.cell_m / earth.PIXEL_M, 1.0) ** _inside_weight(near.ix, near.iy, scene.grid)
    if mapped.any():
        pixel_m = maps_of(ground).albedo_at(scene.time, texture=False)[-1].pixel_m
        known_m *= np.minimum(pixel_m / known_m, 1.0) ** mapped
    pictures = maps_of(ground).albedo_at(scene.time, texture=True)
    if not pictures:
        return albedo.copy(), known_m
    bright, shown = textured(albedo, pictures, near.lat, near.lon, wavelengths, near.footprint_m, known_m, long)
    return bright, known_m * (pictures[-1].pixel_m / known_m) ** shown


def _with_model(
    model: ModelGround, near: _Places, default: SurfaceSample, wavelengths: FloatArray, mapped: FloatArray
) -> SurfaceSample:
    """The model's fields over `default` (at the same places)."""
    ix, iy = near.ix, near.iy
    dry = 1.0 - default.water
    if model.land is not None and not model.like_earth:
        dry = bilinear(model.land, ix, iy)
        if model.sharp_shores:
            dry = _shored(dry, near, near.cell_m)
    ice = np.zeros(ix.size) if model.sea_ice is None else bilinear(model.sea_ice, ix, iy)
    albedo, cover = _snow_covered(model, near, default, wavelengths, mapped)
    frozen = (1 - dry) * ice
    solid = dry + frozen
    share = np.divide(frozen, solid, out=np.zeros_like(solid), where=solid > 0)
    albedo = albedo + share[:, None] * (snow.sea_ice_albedo(wavelengths, ice) - albedo)
    # water that the default Earth has as land is a lake
    green = np.where((dry < 0.5) & (default.water < 0.5), LAKE_CHLOROPHYLL, default.chlorophyll)
    return SurfaceSample(
        albedo, 1 - solid, cover + share * (1 - cover), frozen, default.wind_speed,
        np.where(default.chlorophyll == SEA_CHLOROPHYLL, green, default.chlorophyll),
    )  # fmt: skip


def _snow_covered(
    model: ModelGround, near: _Places, default: SurfaceSample, wavelengths: FloatArray, mapped: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Albedo of land under the model's snow, and the share that reflects like snow."""
    land = _land_level(model, near, default.albedo, mapped)
    if model.snow_near is None:
        return land, default.snow
    beyond, _ = model.snow_near.at(near.ix, near.iy, near.away)
    cover = resolved_share(near.fade * beyond, *_favour(model, near))
    bright = _snow_level(model, near, default.albedo, wavelengths)
    if model.land_albedo is None and model.snow_level is None:
        bright = land + _forest_stands_out(near, default.albedo)[:, None] * (bright - land)
    own = cover * (1 - default.snow)
    return land + own[:, None] * np.maximum(bright - land, 0.0), default.snow + own


def _favour(model: ModelGround, near: _Places) -> tuple[FloatArray, FloatArray]:
    """How much likelier snow lies here than nearby: height above the neighbourhood, and chance, of normal distribution;
    and the variance of what is not seen of it."""
    noise, unseen = fractal_noise(near.lat, near.lon, 3 * near.cell_m, near.footprint_m)
    if model.standing_out is None:
        return noise, unseen
    above = bilinear(model.standing_out, near.ix, near.iy)
    by_height = _BY_HEIGHT * np.exp(-near.away / _EDGE_CELLS)  # what stands beyond the domain is not known
    chance = np.sqrt(1 - by_height**2)
    return by_height * np.clip(above, -2.5, 2.5) + chance * noise, chance**2 * unseen


def _forest_stands_out(near: _Places, colour: FloatArray) -> FloatArray:
    """What snow lends of its albedo to land (n,), by how green it is; woods and clearings are finer than the map."""
    share = snow.forest_share(colour.mean(axis=1))
    return snow.out_of_the_snow(resolved_share(share, *wood_noise(near.lat, near.lon, earth.PIXEL_M, near.footprint_m)))


def _land_level(model: ModelGround, near: _Places, colour: FloatArray, mapped: FloatArray) -> FloatArray:
    """Albedo of snow-free land: the user's maps, else the model's own, or its broadband level in the map's colour."""
    if model.land_albedo is None:
        return colour
    own, known = model.land_albedo.at(near.ix, near.iy, near.away)
    share = (near.fade * (1 - mapped) * known)[:, None]
    if model.has_spectrum:
        return colour + share * (own - colour)
    ratio = own / np.maximum(colour.mean(axis=1), 1e-3)
    return np.clip(colour * (1 + share * (ratio[:, None] - 1)), 0.0, 0.98)


def _snow_level(model: ModelGround, near: _Places, colour: FloatArray, wavelengths: FloatArray) -> FloatArray:
    """Albedo (n, nwl) of the snow: by its age, dimmed to the model's broadband level (forest stands out of it)."""
    age = np.full(near.ix.size, snow.FRESH_DAYS)
    if model.snow_age is not None:
        age = bilinear(model.snow_age, near.ix, near.iy)
    pure = snow.snow_albedo(wavelengths, age)
    if model.snow_level is None:
        return pure
    level, known = model.snow_level.at(near.ix, near.iy, near.away)
    share = np.clip((level - DARK_LAND) / (pure.mean(axis=1) - DARK_LAND), 0.0, 1.1)[:, None]
    seen = colour + share * (pure - colour)
    return np.clip(pure + known[:, None] * (seen - pure), 0.0, 0.98)


def _wind(model: ModelGround, near: _Places) -> FloatArray:
    """10-m wind speed (n,): the model's, beyond its domain means over ever more cells, which fade into the default."""
    speed = model.wind_speed
    if speed is None:
        return np.full(near.ix.size, DEFAULT_WIND_M_S)
    here, _ = speed.at(near.ix, near.iy, near.away)
    here += (1.0 - np.exp(-near.away / _WIND_CELLS)) * (speed.mean - here)
    return DEFAULT_WIND_M_S + near.fade * (here - DEFAULT_WIND_M_S)


def _wave_slope(model: ModelGround, near: _Places, by_wind: FloatArray) -> FloatArray | None:
    """Mean square slope of waves (n,): the model's where it has one nearby, ``by_wind`` elsewhere; None without any."""
    if model.wave_slope is None:
        return None
    here, known = model.wave_slope.at(near.ix, near.iy, near.away)
    return by_wind + near.fade * known * (here - by_wind)


def _away(ix: FloatArray, iy: FloatArray, grid: Grid) -> FloatArray:
    """Cells (n,) from a place to the domain; 0 inside."""
    _, ny, nx = grid.shape
    return np.hypot(ix - np.clip(ix, 0, nx - 1), iy - np.clip(iy, 0, ny - 1))


def _inside_weight(ix: FloatArray, iy: FloatArray, grid: Grid) -> FloatArray:
    """1 well within the domain, 0 outside, a ramp over the outermost cells."""
    _, ny, nx = grid.shape
    depth = np.minimum.reduce([ix, nx - 1 - ix, iy, ny - 1 - iy])
    return np.clip(depth / min(_EDGE_CELLS, 0.25 * (min(nx, ny) - 1)), 0.0, 1.0)


def _blend(sample: SurfaceSample, model: SurfaceSample, hit: NDArray[np.bool_], share: FloatArray) -> None:
    """Put the model's ground in: shores by `share`, land and snow as far as they reach."""
    sample.albedo[hit], sample.snow[hit], sample.chlorophyll[hit] = model.albedo, model.snow, model.chlorophyll
    sample.water[hit] += share * (model.water - sample.water[hit])
    sample.sea_ice[hit] += share * (model.sea_ice - sample.sea_ice[hit])
