"""Any scene comes back from netCDF and Zarr as it was; files are written whole or not at all."""

from __future__ import annotations

import dataclasses
import tempfile
from pathlib import Path

import netCDF4
import numpy as np
import pytest
import xarray as xr
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from pyproj import CRS

from openswim.errors import UserError
from openswim.readers import open_scene
from openswim.readers.domain.shores import astray
from openswim.scene import Grid, Optics, Scene
from openswim.scene.aerosol import AerosolProfile
from openswim.scene.atmosphere import Atmosphere
from openswim.scene.files import check_target
from openswim.scene.phase import HenyeyGreenstein, Mixture, TablePhase
from openswim.scene.variables import VARIABLES, variable

SYSTEMS = [
    None,
    CRS.from_proj4("+proj=lcc +lat_1=30 +lat_2=60 +lat_0=46 +lon_0=8 +R=6370000"),
    CRS.from_proj4("+proj=stere +lat_0=-90 +lat_ts=-71 +lon_0=30 +R=6371229"),
    CRS.from_proj4("+proj=merc +lat_ts=10 +lon_0=180 +R=6370000"),
    CRS.from_proj4("+proj=longlat +R=6371229"),
    CRS.from_cf(
        {
            "grid_mapping_name": "rotated_latitude_longitude",
            "grid_north_pole_latitude": 39.25,
            "grid_north_pole_longitude": -162.0,
            "earth_radius": 6371229.0,
            "longitude_of_prime_meridian": 0.0,
            "prime_meridian_name": "Greenwich",  # or pyproj looks for it for .4 s
        }
    ),
    CRS.from_epsg(32632),
]
PHASES = st.one_of(
    st.floats(-0.9, 0.95).map(HenyeyGreenstein),
    st.just(Mixture([0.7, 0.3], [HenyeyGreenstein(0.9), HenyeyGreenstein(-0.3)])),
    st.just(TablePhase(np.linspace(0, 180, 1801), np.exp(-np.linspace(0, 18, 1801)) + 0.1)),
    st.just({450.0: HenyeyGreenstein(0.7), 650.0: HenyeyGreenstein(0.6)}),
)
ALBEDOS = st.one_of(st.floats(0, 1), st.lists(st.floats(0, 1), min_size=2, max_size=4).map(np.array))
ATMOSPHERES = st.one_of(
    st.none(),
    st.just(Atmosphere.us_standard()),
    st.floats(200, 450).map(lambda ozone: Atmosphere.us_standard(ozone, aerosol=None)),
    st.just(
        Atmosphere.us_standard(
            aerosol=AerosolProfile(0.3, 0.9, 2500.0, 400.0, {450.0: 0.9, 650.0: 0.95}, HenyeyGreenstein(0.7))
        )
    ),
)
# What Scene takes for possible is narrower than the range of a single value.
SANE = {"_content": (0.0, 2e-4), "_effective_radius": (1e-5, 9e-5), "air_temperature": (220.0, 300.0),
        "aerosol_extinction": (0.0, 1e-3)}  # fmt: skip
LINES = st.text(st.characters(codec="utf-8", exclude_categories=("C", "Z")), min_size=1, max_size=30)


@st.composite
def scenes(draw) -> Scene:
    nz, ny, nx = (draw(st.integers(2, 4)) for _ in range(3))
    crs = draw(st.sampled_from(SYSTEMS))
    step = 0.25 if crs is not None and crs.is_geographic else 3000.0
    heights = np.cumsum(draw(arrays("f4", nz, elements=st.floats(10, 3000, width=32))))
    if draw(st.booleans()):
        heights = heights[:, None, None] + draw(arrays("f4", (ny, nx), elements=st.floats(0, 500, width=32)))
    grid = Grid(
        step * np.arange(nx) + draw(st.integers(-9, 9)),
        step * np.arange(ny) + draw(st.integers(-9, 9)),
        heights,
        crs,
        6371229.0,
        periodic=crs is None and draw(st.booleans()),
    )
    names = draw(st.lists(st.sampled_from(sorted(VARIABLES)), unique=True, max_size=6))
    direct = draw(st.lists(st.sampled_from(["cloud", "smoke_2", "x"]), unique=True, max_size=2))
    fields = {}
    for name in [*names, *(f"extinction_{species}" for species in direct)]:
        spec = variable(name)
        shape = (nz, ny, nx)[3 - len(spec.dims) :]
        unit = draw(arrays("f4", shape, elements=st.floats(0, 1, width=32)))
        high = min(spec.high, heights[-1].min()) if name == "surface_altitude" else spec.high
        low, high = next((sane for end, sane in SANE.items() if name.endswith(end)), (spec.low, high))
        values = np.float32(low) + unit * np.float32(high - low)
        if name == "air_pressure":
            tall = heights if heights.ndim == 3 else heights[:, None, None]
            values = np.broadcast_to(np.float32(1e5) * np.exp(-tall / 8000.0), shape).astype("f4")
        fields[name] = (
            spec.dims,
            np.clip(values, np.float32(spec.low), np.nextafter(np.float32(spec.high), 0)),
        )
    data = xr.Dataset(fields)
    if draw(st.booleans()):
        wavelengths = np.array([615.0, 546.0, 450.0, 400.5])
        albedo = draw(arrays("f4", (ny, nx, 4), elements=st.floats(0, 1, width=32)))
        data = data.drop_vars("surface_albedo", errors="ignore").assign(
            surface_albedo=(("y", "x", "wavelength"), albedo)
        )
        data = data.assign_coords(wavelength=wavelengths)
    if crs is None and draw(st.booleans()):
        data = data.assign_coords(latitude=draw(st.floats(-90, 90)), longitude=draw(st.floats(-180, 180)))
    optical = [*direct, *(["aerosol"] if "aerosol_extinction" in fields and draw(st.booleans()) else [])]
    optics = {
        species: Optics(draw(ALBEDOS), draw(PHASES), draw(st.sampled_from(["liquid", "aerosol", "other"])))
        for species in optical
    }
    time = draw(st.none() | st.integers(-(10**12), 4 * 10**12).map(lambda ms: np.datetime64(ms, "ms")))
    return Scene(grid, data, draw(ATMOSPHERES), optics, time, draw(LINES), draw(st.lists(LINES, max_size=3)))


def assert_same(again: Scene, scene: Scene) -> None:
    assert again.data.identical(scene.data)
    assert (again.time, again.source) == (scene.time, scene.source)
    assert again.notes == [*scene.notes, *(note for note in astray(scene) if note not in scene.notes)]
    assert (again.atmosphere is None) == (scene.atmosphere is None)
    if scene.atmosphere is not None:
        assert again.atmosphere.to_dict() == scene.atmosphere.to_dict()
    assert again.optics.keys() == scene.optics.keys()
    for name, optics in scene.optics.items():
        np.testing.assert_array_equal(again.optics[name].single_scattering_albedo, optics.single_scattering_albedo)
        assert (again.optics[name].phase, again.optics[name].kind) == (optics.phase, optics.kind)
    if scene.grid is None:
        assert again.grid is None
        return
    for part in ("x", "y", "height_m"):
        np.testing.assert_array_equal(getattr(again.grid, part), getattr(scene.grid, part))
    assert (again.grid.periodic, again.grid.curved) == (scene.grid.periodic, scene.grid.curved)
    assert again.grid.earth_radius_m == scene.grid.earth_radius_m
    if scene.grid.curved:
        np.testing.assert_allclose(again.grid.lonlat(1.3, 0.4), scene.grid.lonlat(1.3, 0.4), atol=1e-9)


@settings(max_examples=12, deadline=None)
@given(scene=scenes(), zarr=st.booleans())
def test_round_trip(scene, zarr):
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "scene"
        scene.to_zarr(path) if zarr else scene.to_netcdf(path)
        assert_same(open_scene(path), scene)


@pytest.mark.parametrize("save", ["to_netcdf", "to_zarr"])
@pytest.mark.parametrize("albedo", [0.3, [0.1, 0.2, 0.3]])
def test_clear_sky_round_trip(tmp_path, save, albedo):
    scene = Scene.clear(48.6, 2.35, surface_albedo=albedo, terrain_m=80.0, time=np.datetime64("2025-02-15T08:08:30"))
    getattr(scene, save)(tmp_path / "sky")
    again = open_scene(tmp_path / "sky")
    assert_same(again, scene)
    assert again.place == (48.6, 2.35)


def test_zeros_are_in_the_store(tmp_path):
    """Their pieces, left out, would be taken for lost: the beginning of 1970 was refused."""
    scene = dataclasses.replace(_small(), time=np.datetime64("1970-01-01T00:00:00", "ms"))
    scene.to_zarr(tmp_path / "scene")
    assert open_scene(tmp_path / "scene").time == scene.time


def _small() -> Scene:
    return Scene.from_arrays(np.full((2, 2, 2), 0.01), [0, 1.0], [0, 1.0], [0, 1.0])


def test_the_file_is_plain_cf(tmp_path):
    grid = Grid(np.arange(3) * 1e3, np.arange(3) * 1e3, np.arange(2) * 1e3, SYSTEMS[1], 6.37e6)
    Scene(grid, xr.Dataset({"liquid_content": (("z", "y", "x"), np.full((2, 3, 3), 1e-4))})).to_netcdf(
        tmp_path / "a.nc"
    )
    with netCDF4.Dataset(tmp_path / "a.nc") as file:
        field = file["liquid_content"]
        assert field.units == "kg m-3"
        assert field.standard_name == "mass_concentration_of_cloud_liquid_water_in_air"
        assert file[field.grid_mapping].grid_mapping_name == "lambert_conformal_conic"
        assert file["x"].standard_name == "projection_x_coordinate"
        assert file["height"].standard_name == "altitude"
        assert set(field.coordinates.split()) >= {"lat", "lon"}
        assert file.Conventions.startswith("CF-")
        lon, lat = grid.lonlat(2, 1)
        np.testing.assert_allclose((file["lon"][1, 2], file["lat"][1, 2]), (lon, lat), atol=1e-9)


@pytest.mark.parametrize("save", ["to_netcdf", "to_zarr"])
def test_nothing_half_written(tmp_path, save, monkeypatch):
    target = tmp_path / "scene"
    getattr(_small(), save)(target)
    before = open_scene(target)

    def fails(self, path, **kwargs):
        Path(path).mkdir()
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(xr.Dataset, save, fails)
    with pytest.raises(UserError, match="No space left on device"):
        getattr(_small(), save)(target)
    with pytest.raises(UserError, match="No space left on device"):
        getattr(_small(), save)(tmp_path / "other")
    monkeypatch.undo()
    assert sorted(each.name for each in tmp_path.iterdir()) == ["scene"]
    assert_same(open_scene(target), before)


@pytest.mark.parametrize("save", ["to_netcdf", "to_zarr"])
def test_a_full_disk(tmp_path, save):
    """Files of 20 kB are the largest that there may be."""
    resource = pytest.importorskip("resource")
    noise = np.random.default_rng(0).random((20, 20, 20))
    scene = Scene.from_arrays(noise, *(np.arange(20.0) for _ in range(3)))
    limits = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (20_000, limits[1]))
    try:
        with pytest.raises(UserError, match=r"scene: cannot be written .*free some space") as caught:
            getattr(scene, save)(tmp_path / "scene")
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limits)
    assert "\n" not in str(caught.value)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("save", ["to_netcdf", "to_zarr"])
def test_overwriting_replaces_the_old_scene(tmp_path, save):
    getattr(_small(), save)(tmp_path / "scene")
    other = Scene.clear(10.0, 20.0)
    getattr(other, save)(tmp_path / "scene")
    assert open_scene(tmp_path / "scene").place == (10.0, 20.0)


def test_unwritable(tmp_path):
    with pytest.raises(UserError, match=r"missing/scene.nc: cannot be written .*choose a folder"):
        _small().to_netcdf(tmp_path / "missing" / "scene.nc")
    (tmp_path / "folder").mkdir()
    (tmp_path / "folder" / "kept").write_text("precious")
    with pytest.raises(UserError, match="is a folder"):
        _small().to_netcdf(tmp_path / "folder")
    with pytest.raises(UserError, match="is a folder"):
        _small().to_zarr(tmp_path / "folder")
    assert (tmp_path / "folder" / "kept").read_text() == "precious"


def test_neither_a_file_nor_a_store_takes_the_place_of_the_other(tmp_path):
    scene = Scene.clear(47, 8)
    (tmp_path / "a.nc").write_text("a file")
    with pytest.raises(UserError, match=r"a\.nc: is a file: choose another name"):
        scene.to_zarr(tmp_path / "a.nc")
    assert (tmp_path / "a.nc").read_text() == "a file"
    scene.to_zarr(tmp_path / "b.zarr")
    with pytest.raises(UserError, match=r"b\.zarr: is a folder: choose another name"):
        scene.to_netcdf(tmp_path / "b.zarr")
    assert open_scene(tmp_path / "b.zarr").place == (47, 8)


def test_a_link_stays_and_what_it_leads_to_is_written(tmp_path):
    there = tmp_path / "there"
    there.mkdir()
    link, kept = tmp_path / "link.nc", there / "kept.dat"
    link.symlink_to(kept)
    for place in ((10.0, 20.0), (30.0, 40.0)):  # not there yet, and there
        check_target(link)
        Scene.clear(*place).to_netcdf(link)
        assert link.is_symlink()
        assert open_scene(link).place == place
        assert [each.name for each in there.iterdir()] == ["kept.dat"]
    (tmp_path / "a").symlink_to(tmp_path / "b")
    (tmp_path / "b").symlink_to(tmp_path / "a")
    for write in (check_target, _small().to_netcdf):
        with pytest.raises(UserError, match="leads round in a circle"):
            write(tmp_path / "a")


def test_a_protected_file_is_not_replaced(tmp_path):
    """By its mode: root may write all."""
    for mode in (0o400, 0o444):
        target = tmp_path / f"{mode}.nc"
        target.write_text("precious")
        target.chmod(mode)
        for write in (check_target, _small().to_netcdf):
            with pytest.raises(UserError, match="is write-protected; remove it or choose another name"):
                write(target)
        assert target.read_text() == "precious"
