"""What single models need beyond the contract: species, sizes, aerosol, series of files, references."""

from __future__ import annotations

import json
from dataclasses import replace

import netCDF4
import numpy as np
import pytest
import xarray as xr
from tests.readers.model_files import HUMIDITY, NZ, TEMPERATURE, cosp, density, ecrad, era5, les, les_text, rams, um

from openswim.errors import UserError
from openswim.optics.aerosol import interpolate_spectral
from openswim.optics.aerosol_depth import aerosol_depth
from openswim.optics.hydrometeors import extinction_per_m
from openswim.readers import describe, open_scene
from openswim.readers.common.fileset import dates_of
from openswim.readers.fields.aerosol_species import SPECIES, AerosolPart, added_up
from openswim.readers.fields.particles import Category, together
from openswim.scene.particles import relative_extinction
from openswim.scene.phase import phases_at

LEVELS = ("bottom_top", "south_north", "west_east")


def _wrf_field(value: float) -> np.ndarray:
    field = np.zeros((5, 6, 7))
    field[1] = value
    return field


def test_wrf_hail_and_graupel_dim_light_as_they_do_apart(wrf_file):
    graupel, hail = 1e-3, 2e-3
    path = wrf_file(
        extra={
            "QGRAUP": (LEVELS, _wrf_field(graupel), "kg kg-1"),
            "QHAIL": (LEVELS, _wrf_field(hail), "kg kg-1"),
            "QNGRAUPEL": (LEVELS, _wrf_field(1e4), "kg-1"),
            "QNHAIL": (LEVELS, _wrf_field(1e2), "kg-1"),
        }
    )
    data = open_scene(path).data
    content, radius = (data[f"graupel_{what}"].values[1, 2, 3] for what in ("content", "effective_radius"))
    rho = content / (graupel + hail)
    apart = sum(
        float(extinction_per_m("graupel", mass * rho, None, number * rho))
        for mass, number in ((graupel, 1e4), (hail, 1e2))
    )
    assert float(extinction_per_m("graupel", content, radius)) == pytest.approx(apart, rel=1e-4)


def test_wrf_ice_categories_are_added(wrf_file):
    path = wrf_file(
        extra={"QICE": (LEVELS, _wrf_field(1e-4), "kg kg-1"), "QICE2": (LEVELS, _wrf_field(3e-4), "kg kg-1")}
    )
    data = open_scene(path).data
    ratio = data.ice_content.values[1] / data.liquid_content.values[1]
    np.testing.assert_allclose(ratio, 4e-4 / 1e-3, rtol=1e-5)


def test_wrf_chem_extinction(wrf_file):
    scene = open_scene(wrf_file(extra={"EXTCOF55": (LEVELS, _wrf_field(0.4), "km-1")}))
    assert float(scene.data.aerosol_extinction.max()) == pytest.approx(4e-4)
    assert [(layer.name, layer.beyond) for layer in scene.atmosphere.layers] == [("aerosol", True)]
    assert any("EXTCOF55" in note for note in scene.notes)


def test_wrf_chem_dust_and_soot(wrf_file):
    """Five bins of dust are one kind; info says the same of the background as opening does."""
    path = wrf_file(
        extra={
            name: (LEVELS, _wrf_field(mass), "ug/kg-dryair")
            for name, mass in (("DUST_1", 50.0), ("DUST_5", 50.0), ("BC1", 1.0))
        }
    )
    scene = open_scene(path)
    assert scene.species[-2:] == ["dust", "black_carbon"]
    rho = scene.data.liquid_content.values[1] / 1e-3
    np.testing.assert_allclose(scene.data.extinction_dust.values[1], 50e-6 * rho * (1.22 + 0.079), rtol=0.02)
    np.testing.assert_allclose(scene.data.extinction_black_carbon.values[1], 1e-6 * rho * 9.39, rtol=0.02)
    (note,) = (note for note in scene.notes if "no aerosol but" in note)
    assert note in describe(path).assumed


def test_wrf_smoke_lies_on_the_background(wrf_file):
    scene = open_scene(wrf_file(extra={"smoke": (LEVELS, _wrf_field(100.0), "ug/kg")}))
    rho = scene.data.liquid_content.values[1] / 1e-3
    humidity = _humidity(scene)
    expected = 100e-9 * rho * 4.5e3 * (1 - humidity) ** -0.2
    np.testing.assert_allclose(scene.data.extinction_smoke.values[1], expected, rtol=0.02)
    default, smoke = scene.atmosphere.layers
    assert (default.optical_depth, smoke.name, smoke.beyond) == (0.05, "smoke", True)


def _humidity(scene) -> np.ndarray:
    """Of 8 g/kg at 280 K, by Magnus' formula."""
    pressure = scene.data.air_pressure.values[1]
    vapour = 0.008 / (0.622 + 0.008) * pressure
    return np.minimum(vapour / (610.94 * np.exp(17.625 * 6.85 / (243.04 + 6.85))), 0.95)


def test_wrf_series_of_files(wrf_file, tmp_path):
    first = wrf_file(times=("2005-08-28_12:00:00",)).rename(tmp_path / "wrfout_d01_12")
    second = wrf_file(times=("2005-08-28_13:00:00",)).rename(tmp_path / "wrfout_d01_13")
    assert open_scene([second, first]).time == np.datetime64("2005-08-28T12:00")
    assert open_scene(tmp_path / "wrfout_d01_*", "2005-08-28T13:00").time == np.datetime64("2005-08-28T13:00")
    assert describe([first, second]).times == ["2005-08-28T12:00:00", "2005-08-28T13:00:00"]
    with pytest.raises(UserError, match="2005-08-28T13:00:00"):
        open_scene([first, second], "2005-08-28T14:00")
    with pytest.raises(UserError, match="no file matches"):
        open_scene(tmp_path / "none*")


def test_files_on_grids_of_their_own_are_described_one_by_one(wrf_file, tmp_path):
    first, second = wrf_file().rename(tmp_path / "a"), wrf_file().rename(tmp_path / "b")
    elsewhere = wrf_file(map_proj=3).rename(tmp_path / "c")
    text = str(describe([first, elsewhere, second]))
    assert f"{first} and 1 more" in text
    assert str(elsewhere) in text
    assert text.count("projection") == 2
    assert "Mercator" in text.split("\n\n")[1]


def test_wrf_nests_the_finest_that_covers_the_place(wrf_file, tmp_path):
    coarse = wrf_file().rename(tmp_path / "d01")
    fine = wrf_file(attributes={"DX": 1000.0, "DY": 1000.0}).rename(tmp_path / "d02")
    lon, lat = (float(v) for v in open_scene(fine).grid.lonlat(3, 3))
    inside = open_scene([coarse, fine], around=(lat, lon), radius_km=1)
    np.testing.assert_allclose(inside.grid.spacing_m(), 1000.0, rtol=0.05)  # by the map factor
    lon, lat = (float(v) for v in open_scene(coarse).grid.lonlat(3, 3))
    aside = open_scene([coarse, fine], around=(lat, lon))
    np.testing.assert_allclose(aside.levels[-1].grid.spacing_m(), 3000.0, rtol=0.05)
    i, j = aside.levels[-1].grid.index(lon, lat)
    assert 0 < i < aside.levels[-1].grid.shape[2] - 1
    assert 0 < j < aside.levels[-1].grid.shape[1] - 1


def test_together_is_the_sum():
    """Mass and extinction of two categories; a species without any size keeps none."""
    one = Category(np.array([1e-4, 0.0], "f4"), np.array([1e3, 0.0], "f4"))
    two = Category(np.array([2e-4, 3e-4], "f4"), None, np.array([5e-4, 5e-4], "f4"))
    content, radius = together("rain", [one, two])
    np.testing.assert_allclose(content, [3e-4, 3e-4], rtol=1e-6)
    apart = extinction_per_m("rain", one.content, None, one.number) + extinction_per_m(
        "rain", two.content, two.effective_radius_m
    )
    np.testing.assert_allclose(extinction_per_m("rain", content, radius), apart, rtol=1e-5)
    assert together("rain", [Category(one.content), Category(two.content)])[1] is None


def test_cosp_radii_and_flux(tmp_path):
    truth = cosp(tmp_path / "a.nc")
    data = open_scene(truth.paths).data
    # four fifths of the water in drops of 10 um, one fifth in drops of 20 um
    cloudy = data.liquid_content.values > 1e-6
    np.testing.assert_allclose(data.liquid_effective_radius.values[cloudy], 1 / (0.8 / 10e-6 + 0.2 / 20e-6), rtol=1e-3)


def test_cosp_radii_of_zero_are_told(tmp_path):
    path = cosp(tmp_path / "a.nc").paths[0]
    assert not any("Reff" in note or "both units" in note for note in open_scene(path).notes)
    with netCDF4.Dataset(path, "a") as data:
        data["Reff"][1] = 0  # ice of large scale
    told = [note for note in open_scene(path).notes if "Reff" in note]
    assert told == ["Reff 1 is zero or unknown everywhere: sizes from content or number"]


def test_rams_over_the_date_line_has_the_hour_there(tmp_path):
    path = rams(tmp_path / "x-A-2024-06-21-g1.h5", header=False).paths[0]
    with netCDF4.Dataset(path, "a") as file:
        east = file["GLON"][:] + 169.0  # from 11 E
        file["GLON"][:] = (east + 180.0) % 360.0 - 180.0
        assert np.ptp(file["GLON"][:]) > 300
    ten_local = np.datetime64("2024-06-21T22:00")
    assert abs(open_scene(path).time - ten_local) < np.timedelta64(2, "m")


def test_radii_and_numbers_reach_the_scene(tmp_path):
    assert float(open_scene(ecrad(tmp_path / "a.nc").paths).data.ice_effective_radius.max()) == pytest.approx(50e-6)
    path = rams(tmp_path / "x-A-2024-06-21-120000-g1.h5").paths[0]
    radius = open_scene(path).data.liquid_effective_radius.values
    content = open_scene(path).data.liquid_content.values
    expected = np.cbrt(3 * content / (4 * np.pi * 1000.0 * 1e8 * 0.72))  # 1e8 drops per cubic metre
    there = content > 1e-6
    np.testing.assert_allclose(radius[there], expected[there], rtol=0.01)


def test_drops_of_era5_without_liquid_by_cover(tmp_path):
    """Hack's climatology: .21 g m-3 exp(-z/h) in full cover, h of the column's vapour; none where it is clear."""
    path = era5(tmp_path / "a.nc", new=True).paths[0]
    with netCDF4.Dataset(path, "a") as file:
        file.renameVariable("clwc", "unknown")
        file["cc"][:] = 0.0
        file["cc"][:, 6] = 1.0
    scene = open_scene(path)
    level = NZ - 1 - 6
    liquid, height = scene.data.liquid_content.values, scene.grid.height_m[level]
    vapour = HUMIDITY * (98_000.0 - 25_000.0) / 9.80665
    np.testing.assert_allclose(liquid[level], 0.21e-3 * np.exp(-height / (700.0 * np.log1p(vapour))), rtol=0.01)
    assert not np.delete(liquid, level, axis=0).any()
    assert any("Hack" in note for note in scene.notes)


@pytest.mark.parametrize(("name", "kind", "dry_m2_g", "growth"), [("aermr04", "dust", 2.54, 1.0),
                                                                ("aermr11", "sulphate", 4.33, 1.6)])  # fmt: skip
def test_cams_species_to_extinction(tmp_path, name, kind, dry_m2_g, growth):
    """Of dry air, and in the humidity of the file's lowest levels (some 55 %; Bozzo et al. 2020, Fig. 3)."""
    path = era5(tmp_path / "a.nc", new=True).paths[0]
    with netCDF4.Dataset(path, "a") as file:
        own = file.createVariable(name, "f4", file["t"].dimensions)
        own.units = "kg kg**-1"
        own[:] = 1e-8
    scene = open_scene(path)
    pressure = scene.data.air_pressure.values
    mass = 1e-8 * density(pressure)
    saturation = 611.2 * np.exp(17.67 * (TEMPERATURE - 273.15) / (TEMPERATURE - 273.15 + 243.5))
    humidity = np.minimum(HUMIDITY * pressure / 0.622 / saturation, 0.95)
    ratio = scene.data[f"extinction_{kind}"].values / (mass * 1e3 * dry_m2_g)
    np.testing.assert_allclose(ratio[humidity < 0.25], 1.0, rtol=0.01)
    damp = (humidity > 0.5) & (humidity < 0.6)
    assert damp.any()
    np.testing.assert_allclose(ratio[damp], growth, rtol=0.12)
    assert scene.optics[kind].kind == "aerosol"
    assert [(layer.name, layer.beyond) for layer in scene.atmosphere.layers] == [(kind, True)]
    assert aerosol_depth(scene, 0.0, (0.0, 0.0)) == pytest.approx(scene.atmosphere.aerosol.depth_above(0.0))


HYDROPHILIC = {
    "aermr01": 0,
    "aermr02": 1,
    "aermr03": 2,
    "aermr07": 3,
    "aermr11": 4,
    "aermr18": 7,
    "aermr16": 8,
    "aermr17": 9,
}
HYDROPHOBIC = {"aermr04": 0, "aermr05": 1, "aermr06": 2, "aermr08": 9, "aermr09": 10}


@pytest.mark.parametrize("name", [*HYDROPHILIC, *HYDROPHOBIC])
def test_optics_of_species_are_those_of_the_models_own_tables(shared, name):
    """Bozzo et al. (2020) at all humidities to 95 % and from 420 to 1600 nm: extinction and albedo are theirs. Our
    phase functions are Mie theory of our own: their asymmetry is within .035 of the table's."""
    part = AerosolPart(SPECIES[name], np.ones((1, 1, 1), np.float32), 0.0)
    wavelengths = [420.0, 550.0, 640.0, 870.0, 1600.0]
    with netCDF4.Dataset(shared / "data" / "optics" / "aerosol_ifs_49R1.nc") as file:
        at = [int(np.argmin(np.abs(file["wavelength"][:] - 1e-9 * wl))) for wl in wavelengths]
        nearest = 1e9 * np.asarray(file["wavelength"][at], float)
        kind, index = ("hydrophilic", HYDROPHILIC[name]) if name in HYDROPHILIC else ("hydrophobic", HYDROPHOBIC[name])
        middle = 0.5 * (file["relative_humidity1"][:] + file["relative_humidity2"][:]).astype(float)
        for k, humidity in enumerate(middle[:-1]):
            row = (index, k) if kind == "hydrophilic" else (index,)
            extinction, albedo, asymmetry = (
                np.asarray(file[f"{what}_{kind}"][row][at], float) for what in ("mass_ext", "ssa", "asymmetry")
            )
            (optics,) = added_up([replace(part, humidity=humidity)])[1].values()
            ours = SPECIES[name].mass_extinction(np.array(humidity))
            np.testing.assert_allclose(1e3 * ours, extinction[1], rtol=0.01)
            spectrum = relative_extinction(nearest, 550.0, 0.0, optics.relative_extinction)
            np.testing.assert_allclose(spectrum, extinction / extinction[1], rtol=0.03)
            np.testing.assert_allclose(
                interpolate_spectral(optics.single_scattering_albedo, nearest), albedo, atol=0.006
            )
            if kind == "hydrophilic" and k < 3:
                continue  # drier than any air that has much to see; the driest phase functions are of 45 %
            phases = phases_at(optics.phase, nearest)
            np.testing.assert_allclose([p.moments(1)[0] for p in phases], 1.0, rtol=1e-9)
            # organic matter is a mixture of which the table's few large particles are felt in the infrared alone
            ends = 4 if name == "aermr07" else 5
            np.testing.assert_allclose([p.asymmetry for p in phases[:ends]], asymmetry[:ends], atol=0.035)


def test_dust_beside_smoke_keeps_its_colour(tmp_path):
    """Each kind has its own field and optics; bins of one kind are one, weighted by what they take out."""
    path = era5(tmp_path / "a.nc", new=True).paths[0]
    with netCDF4.Dataset(path, "a") as file:
        for name, mass in (("aermr04", 1e-8), ("aermr06", 1e-7), ("aermr09", 1e-9)):
            own = file.createVariable(name, "f4", file["t"].dimensions)
            own.units = "kg kg**-1"
            own[:] = mass
    scene = open_scene(path)
    assert scene.species[-2:] == ["dust", "black_carbon"]
    dust, soot = scene.optics["dust"], scene.optics["black_carbon"]
    fine, coarse = 2.542 * 1, 0.4118 * 10
    albedo = (fine * 0.9861 + coarse * 0.9307) / (fine + coarse)
    assert dust.single_scattering_albedo[550.0] == pytest.approx(albedo, 1e-3)
    assert soot.single_scattering_albedo[550.0] == pytest.approx(0.206, abs=0.002)
    assert dust.relative_extinction[450.0] / dust.relative_extinction[550.0] == pytest.approx(1.0, abs=0.075)
    assert soot.relative_extinction[450.0] / soot.relative_extinction[550.0] > 1.25
    asymmetry = (fine * 0.9861 * 0.6640 + coarse * 0.9307 * 0.7566) / (albedo * (fine + coarse))
    assert dust.phase[550.0].asymmetry == pytest.approx(asymmetry, abs=0.003)


def test_era5_of_two_streams(tmp_path):
    """Preliminary data: two versions side by side, each missing where the other is not."""
    path = era5(tmp_path / "a.nc", new=True).paths[0]
    data = xr.load_dataset(path, decode_times=False).drop_vars(["expver", "number"])
    first, second = data.copy(deep=True), data.copy(deep=True)
    for name in data.data_vars:
        first[name][1], second[name][0] = np.nan, np.nan
    both = xr.concat([first, second], "expver").assign_coords(expver=("expver", [1, 5]))
    both = both.transpose("valid_time", "expver", ...)
    both["valid_time"].attrs = data["valid_time"].attrs
    both.to_netcdf(tmp_path / "b.nc")
    for time in ("2024-06-21T12:00", "2024-06-21T13:00"):
        np.testing.assert_array_equal(
            open_scene(tmp_path / "b.nc", time).data.liquid_content, open_scene(path, time).data.liquid_content
        )


def test_pressure_levels_and_surface_in_two_files(tmp_path):
    truth = era5(tmp_path / "a.nc", new=True)
    lat, lon = truth.lonlat[1][::-1, 0], truth.lonlat[0][0]
    seconds = int((truth.time - np.datetime64("1970-01-01")) / np.timedelta64(1, "s"))
    ground = 500.0 + np.arange(63.0).reshape(7, 9)
    xr.Dataset(
        {
            "z": (("valid_time", "latitude", "longitude"), 9.80665 * ground[None], {"units": "m**2 s**-2"}),
            "u10": (("valid_time", "latitude", "longitude"), np.full((1, 7, 9), 5.0), {"units": "m s**-1"}),
            "v10": (("valid_time", "latitude", "longitude"), np.full((1, 7, 9), -2.0), {"units": "m s**-1"}),
            "siconc": (("valid_time", "latitude", "longitude"), np.full((1, 7, 9), np.nan), {"units": "(0 - 1)"}),
        },
        coords={
            "valid_time": ("valid_time", [seconds], {"units": "seconds since 1970-01-01"}),
            "latitude": ("latitude", lat, {"units": "degrees_north"}),
            "longitude": ("longitude", lon, {"units": "degrees_east"}),
        },
    ).to_netcdf(tmp_path / "surface.nc")
    scene = open_scene([truth.paths[0], tmp_path / "surface.nc"])
    np.testing.assert_allclose(scene.data.surface_altitude, ground[::-1], rtol=2e-4)
    assert float(scene.data.wind_north_10m.mean()) == -2.0
    np.testing.assert_array_equal(scene.data.liquid_content, open_scene(truth.paths).data.liquid_content)


def test_a_global_field_around_the_date_line_and_a_pole(tmp_path):
    lat, lon = np.arange(-90.0, 90.1, 10.0), np.arange(0.0, 360.0, 10.0)
    levels = np.array([900.0, 700.0, 500.0])
    field = np.broadcast_to(1e-4 * (1 + 0.5 * np.cos(np.radians(lon - 180.0))), (3, lat.size, lon.size))
    dims = ("level", "latitude", "longitude")
    xr.Dataset(
        {
            "clwc": (dims, field.astype("f4"), {"units": "kg kg-1"}),
            "t": (dims, np.full(field.shape, 270.0, "f4"), {"units": "K"}),
        },
        coords={
            "level": ("level", levels, {"units": "hPa"}),
            "latitude": ("latitude", lat, {"units": "degrees_north"}),
            "longitude": ("longitude", lon, {"units": "degrees_east"}),
            "time": ((), 0, {"units": "hours since 2024-06-21"}),
        },
    ).to_netcdf(tmp_path / "a.nc")
    for place in ((0.0, 179.0), (0.0, -179.0)):
        scene = open_scene(tmp_path / "a.nc", around=place)
        i, j = (round(float(v)) for v in scene.grid.index(180.0, 0.0))
        rho = 70_000.0 / (287.05 * 270.0)
        assert float(scene.data.liquid_content[1, j, i]) == pytest.approx(1.5e-4 * rho, rel=0.02)
    assert np.isfinite(open_scene(tmp_path / "a.nc", around=(89.0, 0.0)).data.liquid_content).all()


@pytest.mark.parametrize(("hours", "told"), [(-9999.0, True), (12.0, False)])
def test_a_time_before_the_clock_begins_is_told(tmp_path, hours, told):
    path = era5(tmp_path / "a.nc", new=True).paths[0]
    with netCDF4.Dataset(path, "a") as file:
        file["valid_time"].units = "hours since 2024-06-21"
        file["valid_time"][:] = hours
    assert any("the date that the file counts from" in note for note in open_scene(path).notes) == told


@pytest.mark.parametrize(("first", "turn"), [(6.0, -360.0), (6.0, 360.0), (-1.0, 360.0), (179.0, 360.0)])
def test_longitudes_a_turn_too_far_are_those_that_they_mean(tmp_path, first, turn):
    path = era5(tmp_path / "a.nc", new=True, first_lon=first).paths[0]
    expected = open_scene(path).grid.x
    with netCDF4.Dataset(path, "a") as file:
        file["longitude"][:] += turn
    np.testing.assert_allclose(open_scene(path).grid.x, expected, atol=1e-4)


def test_columns_over_the_date_line_that_were_sorted_apart_are_told(tmp_path):
    era5(tmp_path / "a.nc", first_lon=179.0)
    with xr.open_dataset(tmp_path / "a.nc", decode_times=False, mask_and_scale=False) as data:
        turned = (data.longitude + 180) % 360 - 180
        data.assign_coords(longitude=turned).sortby("longitude").to_netcdf(tmp_path / "b.nc")
    with pytest.raises(UserError, match=r"b.nc: the coordinate .* over the date line sort by longitude % 360"):
        open_scene(tmp_path / "b.nc")


@pytest.mark.parametrize("container", ["zarr", "kerchunk", "icechunk"])
def test_one_model_in_every_container(tmp_path, container):
    path = era5(tmp_path / "a.nc", new=True).paths[0]
    expected = open_scene(path)
    target = tmp_path / f"b.{container}"
    data = xr.load_dataset(path, decode_times=False).drop_vars(["expver", "number"])
    if container == "zarr":
        data.to_zarr(target, zarr_format=2)
    elif container == "kerchunk":
        hdf = pytest.importorskip("kerchunk.hdf")
        data.to_netcdf(tmp_path / "c.nc")
        target.write_text(json.dumps(hdf.SingleHdf5ToZarr(str(tmp_path / "c.nc")).translate()))
    else:
        icechunk = pytest.importorskip("icechunk")
        repository = icechunk.Repository.create(icechunk.local_filesystem_storage(str(target)))
        session = repository.writable_session("main")
        data.to_zarr(session.store, consolidated=False)
        session.commit("a model")
    scene = open_scene(target)
    np.testing.assert_array_equal(scene.data.liquid_content, expected.data.liquid_content)
    assert scene.time == expected.time


def test_undated_scenes_take_the_time_asked_for(tmp_path):
    path = les_text(tmp_path / "a.txt", "shdom").paths[0]
    assert open_scene(path, "2024-06-21T15:00").time == np.datetime64("2024-06-21T15:00")
    assert open_scene(path, around=(18.0, -60.0)).time == np.datetime64("2000-03-20T14:00")


@pytest.mark.parametrize(
    ("units", "value"), [("seconds", 600), ("s", 600), ("min", 10), ("Hours of run", 1 / 6), ("ms", 6e5), ("", 600)]
)
def test_elapsed_times_count_from_the_default_start(tmp_path, units, value):
    path = les(tmp_path / "a.nc", "cm1").paths[0]
    with netCDF4.Dataset(path, "a") as file:
        file["time"].units = units
        file["time"][:] = value
    scene = open_scene(path)
    assert abs(scene.time - np.datetime64("2000-03-20T10:10")) < np.timedelta64(1, "s")
    assert any("unknown start" in note for note in scene.notes)


def test_elapsed_times_in_units_that_are_none(tmp_path):
    path = les(tmp_path / "a.nc", "cm1").paths[0]
    with netCDF4.Dataset(path, "a") as file:
        file["time"].units = "months"
    with pytest.raises(UserError, match=r"a.nc: elapsed times in 'months': give seconds"):
        open_scene(path)


def test_fractions_of_seconds_are_not_cut_off(tmp_path):
    """0.7 days in single precision are 1 ms short of 16:48."""
    found = dates_of(tmp_path, np.array([0.7], "f4"), "days since 2024-06-21", "standard")
    assert found == np.datetime64("2024-06-21T16:47:59.999")


def test_nothing_floats_beyond_a_domain_that_ends_in_the_neighbourhood(nwp):
    """A curtain seen from far off: resampled to a map that reaches over its edges."""
    scene = open_scene(nwp / "ifs_meridian_columns.nc", around=(-10.0, 135.0), radius_km=4900)
    lon, _ = scene.grid.lonlat(np.arange(scene.grid.x.size), np.arange(scene.grid.y.size)[:, None])
    east = np.abs((lon - 135.0 + 180.0) % 360.0 - 180.0)
    assert not scene.data.liquid_content.values[:, east > 46.0].any()
    assert scene.data.liquid_content.values[:, east < 38.0].any()
    assert np.isfinite(scene.data.air_pressure).all()


REAL = {
    "era5_europe_2019-01-01.nc": ("liquid", "ice"),
    "um_cosp_input_2d.nc": ("liquid", "ice", "rain", "snow"),
    "ifs_meridian_columns.nc": ("liquid", "ice", "dust", "sea_salt", "organic_matter", "black_carbon", "sulphate"),
    "rams_clear_2019-07-02.h5": ("dust", "sea_salt"),
    "les_rico_122x106x39.txt": ("liquid",),
    "les_stratocumulus_64x64x16.txt": ("liquid",),
}


@pytest.mark.parametrize("name", REAL)
def test_real_files_open_without_a_word_of_help(nwp, name):
    scene = open_scene(nwp / name)
    there = [s for s in scene.species if scene.data.get(f"{s}_content", scene.data.get(f"extinction_{s}")).any()]
    assert set(REAL[name]) <= set(there)
    assert scene.time is not None


def test_rams_of_greenland_against_its_own_density(nwp):
    """Dry density from our pressure and temperature is the file's reference density; the heights are hydrostatic."""
    scene = open_scene(nwp / "rams_clear_2019-07-02.h5")
    with netCDF4.Dataset(nwp / "rams_clear_2019-07-02.h5") as file:
        reference = np.asarray(file["DN0"][1:])
    ours = scene.data.air_pressure / (287.0 * scene.data.air_temperature)
    off = np.abs(ours.values / reference - 1)
    assert np.median(off) < 2e-3
    assert off.max() < 0.015  # at the inversion, which the reference state smooths
    steps = np.diff(scene.grid.height_m, axis=0)
    np.testing.assert_allclose(steps, 6.25, rtol=0.03)


def test_stratocumulus_mass_against_the_rows(nwp):
    rows = np.loadtxt(nwp / "les_stratocumulus_64x64x16.txt", skiprows=3)
    data = open_scene(nwp / "les_stratocumulus_64x64x16.txt").data
    assert float(data.liquid_content.sum(dtype=float)) == pytest.approx(1e-3 * rows[:, 3].sum(), rel=1e-5)
    i, j, k, lwc, radius = rows[np.argmax(rows[:, 3])]
    assert float(data.liquid_content[int(k), int(j), int(i)]) == pytest.approx(1e-3 * lwc)
    assert float(data.liquid_effective_radius[int(k), int(j), int(i)]) == pytest.approx(1e-6 * radius)


def test_cosp_column_water_against_the_file(nwp):
    """Liquid water path of both kinds of cloud by the file's own pressure differences."""
    path = nwp / "um_cosp_input_2d.nc"
    scene = open_scene(path)
    with netCDF4.Dataset(path) as file:
        q = file["mr_lsliq"][:] + file["mr_ccliq"][:]
        half = np.concatenate([file["phalf"][:], np.zeros((1, 9, 17))])
        expected = float((q * (half[:-1] - half[1:]) / 9.81).sum())
    found = np.trapezoid(scene.data.liquid_content.values, scene.grid.height_m, axis=0).sum()
    assert found == pytest.approx(expected, rel=0.1)


def test_a_models_own_calendar_is_told(tmp_path):
    """Climate models have months of 30 days, and years without a leap day."""
    path = um(tmp_path / "um.nc").paths[0]
    notes = open_scene(path).notes
    assert not [note for note in notes if "calendar" in note]
    for calendar in ("360_day", "noleap"):
        with netCDF4.Dataset(path, "a") as file:
            file["time"].calendar, file["time"].units = calendar, "hours since 2021-11-06 00:00:00"
            file["time"][...] = 12.0
        scene = open_scene(path)
        assert scene.time == np.datetime64("2021-11-06T12:00")
        assert (
            f"times are of the calendar {calendar}: taken for those of the same name in the Gregorian one"
            in scene.notes
        )
    with netCDF4.Dataset(path, "a") as file:
        file["time"].calendar = "julian"
    with pytest.raises(UserError, match=r"julian calendar.*use the standard calendar"):
        open_scene(path)
