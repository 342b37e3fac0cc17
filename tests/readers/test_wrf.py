"""WRF files as they should be: place, heights, state, water, ground, wind and time."""

from __future__ import annotations

import netCDF4
import numpy as np
import pytest
from tests.readers.conftest import stacked

from openswim.errors import UserError
from openswim.readers import describe, grids_of, members_of, open_scene

PROJECTIONS = {
    "lambert": dict(map_proj=1),
    "lambert, one parallel": dict(map_proj=1, attributes=dict(TRUELAT1=45.0, TRUELAT2=45.0)),
    "lambert, southern": dict(map_proj=1, attributes=dict(TRUELAT1=-30.0, TRUELAT2=-60.0, MOAD_CEN_LAT=-46.0)),
    "polar stereographic": dict(map_proj=2),
    "polar stereographic, southern": dict(map_proj=2, attributes=dict(TRUELAT1=-71.0, TRUELAT2=-71.0)),
    "mercator over the date line": dict(map_proj=3),
    "latitude-longitude over the date line": dict(map_proj=6),
    "global latitude-longitude": dict(map_proj=6, nx=72, degrees=5.0),
    "rotated latitude-longitude": dict(map_proj=6, attributes=dict(POLE_LAT=35.0, POLE_LON=180.0, STAND_LON=20.0)),
}


@pytest.mark.parametrize("spec", PROJECTIONS.values(), ids=PROJECTIONS.keys())
def test_grid_lies_where_the_formulae_say(wrf_file, wrf_lonlat, spec):
    grid = open_scene(wrf_file(**spec)).grid
    lon, lat = wrf_lonlat(**spec)
    ny, nx = lon.shape
    ix, iy = grid.index(lon, lat)
    np.testing.assert_allclose(ix, np.broadcast_to(np.arange(nx), (ny, nx)), atol=2e-3)
    np.testing.assert_allclose(iy, np.broadcast_to(np.arange(ny)[:, None], (ny, nx)), atol=2e-3)
    found_lon, found_lat = grid.lonlat(np.arange(nx), np.arange(ny)[:, None])
    np.testing.assert_allclose((found_lon - lon + 180) % 360 - 180, 0.0, atol=1e-4)
    np.testing.assert_allclose(found_lat, lat, atol=1e-4)


@pytest.mark.parametrize("spec", PROJECTIONS.values(), ids=PROJECTIONS.keys())
def test_wind_points_along_the_earth(wrf_file, wrf_lonlat, spec):
    """3 m/s along x and 4 m/s along y, turned by the bearing of the grid axes from the true coordinates."""
    lon, lat = (np.radians(angle) for angle in wrf_lonlat(**spec))
    step = (np.gradient(np.unwrap(lon, axis=1), axis=1) * np.cos(lat), np.gradient(lat, axis=1))
    to_x = np.arctan2(step[1], step[0])[:, 1:-1]  # centred differences only
    data = open_scene(wrf_file(**spec)).data.isel(x=slice(1, -1))
    np.testing.assert_allclose(data.wind_east_10m, 3 * np.cos(to_x) - 4 * np.sin(to_x), atol=2e-3)
    np.testing.assert_allclose(data.wind_north_10m, 4 * np.cos(to_x) + 3 * np.sin(to_x), atol=2e-3)


def test_terrain_without_hgt_is_the_lowest_level(wrf_file):
    scene = open_scene(wrf_file(drop=("HGT",)))
    np.testing.assert_allclose(scene.data.surface_altitude, open_scene(wrf_file()).data.surface_altitude, atol=0.01)
    assert any("geopotential of the lowest level" in note for note in scene.notes)


def test_state_and_water_by_hand(wrf_file):
    scene = open_scene(wrf_file())
    full = 100.0 + np.linspace(0.0, 12_000.0, 6)
    mass = 0.5 * (full[1:] + full[:-1])
    pressure = 1e5 * np.exp(-mass / 8000.0)
    column = scene.data.isel(x=0, y=0)
    np.testing.assert_allclose(scene.grid.height_m[:, 0, 0], mass, rtol=1e-6)
    np.testing.assert_allclose(column.air_pressure, pressure, rtol=1e-5)
    np.testing.assert_allclose(column.air_temperature, 280.0, rtol=1e-5)
    # vapour pressure from the mixing ratio, then the gas law for the dry part alone
    dry_pressure = pressure[1] / (1 + 0.008 / (287.0 / 461.6))
    assert float(column.liquid_content[1]) == pytest.approx(1e-3 * dry_pressure / (287.0 * 280.0), rel=1e-5)
    assert float(column.liquid_content[0]) == 0.0
    assert scene.data.liquid_content.dtype == np.float32


def test_thinned_file_is_still_placed(wrf_file, wrf_lonlat):
    """Every second point of a file whose attributes were left as they were."""
    spec = dict(attributes=dict(DX=3000.0))
    path = wrf_file(nx=13, ny=11, **spec)
    with netCDF4.Dataset(path) as whole, netCDF4.Dataset(path.with_suffix(".thin"), "w") as thin:
        thin.setncatts(whole.__dict__)
        for name, dimension in whole.dimensions.items():
            across = name in ("west_east", "south_north")
            thin.createDimension(name, (len(dimension) + 1) // 2 if across else len(dimension))
        for name, variable in whole.variables.items():
            step = [
                slice(None, None, 2 if dim in ("west_east", "south_north") else None) for dim in variable.dimensions
            ]
            thin.createVariable(name, variable.dtype, variable.dimensions)[:] = variable[tuple(step)]
    scene = open_scene(path.with_suffix(".thin"))
    lon, lat = (angle[::2, ::2] for angle in wrf_lonlat(nx=13, ny=11, **spec))
    ix, iy = scene.grid.index(lon, lat)
    np.testing.assert_allclose(ix[0], np.arange(7), atol=2e-3)
    np.testing.assert_allclose(iy[:, 0], np.arange(6), atol=2e-3)
    assert any("thinned" in note for note in scene.notes)


def test_only_the_wanted_time_is_read(wrf_file):
    def spoiled(values):
        values[1] = np.nan
        return values

    path = wrf_file(change={"QCLOUD": spoiled, "P": spoiled})
    assert open_scene(path).time == np.datetime64("2005-08-28T12:00")
    with pytest.raises(UserError, match=r"P has .* missing values"):
        open_scene(path, "2005-08-28T15:00")


@pytest.mark.parametrize("name", ["PH", "P", "QCLOUD", "HGT"])
def test_minus_9999_everywhere_is_no_field(wrf_file, name):
    """Heights 1019 m lower could be those of another place."""
    with pytest.raises(UserError, match=rf"{name} has .* missing values"):
        open_scene(wrf_file(change={name: lambda values: np.full_like(values, -9999.0)}))


@pytest.mark.parametrize(
    "wanted",
    [
        "2005-08-28T15:00",
        "2005-08-28_15:00:00",
        "2005-08-28 15:00:00Z",
        "2005-08-28T17:00:00+02:00",
        np.datetime64("2005-08-28T15:00:00.9"),
    ],
)
def test_times_in_every_spelling(wrf_file, wanted):
    path = wrf_file(change={"QCLOUD": lambda q: q * np.array([1.0, 2.0])[:, None, None, None]})
    first, second = open_scene(path), open_scene(path, wanted)
    assert second.time == np.datetime64("2005-08-28T15:00")
    np.testing.assert_allclose(second.data.liquid_content, 2 * first.data.liquid_content, rtol=1e-6)


def test_times_come_from_xtime_where_times_are_lost(wrf_file):
    """Minutes since the run's start, which START_DATE would be taken for."""
    path = wrf_file(drop=("Times",), attributes={"START_DATE": "2005-08-28_00:00:00"})
    with netCDF4.Dataset(path, "a") as file:
        minutes = file.createVariable("XTIME", "f4", ("Time",))
        minutes.units = "minutes since 2005-08-28 00:00:00"
        minutes[:] = [720.0, 900.0]
    assert describe(path).times == ["2005-08-28T12:00:00", "2005-08-28T15:00:00"]
    assert open_scene(path, "2005-08-28T15:00").time == np.datetime64("2005-08-28T15:00")


def test_files_without_dates_are_of_the_time_asked_for(wrf_file):
    """docs/models.md; else 10 o'clock local time on 20 March 2000."""
    path = wrf_file(drop=("Times",))
    asked = open_scene(path, "2005-08-28T15:00")
    assert asked.time == np.datetime64("2005-08-28T15:00")
    assert "no date in the file: the time that was asked for" in asked.notes
    scene = open_scene(path)
    hours = np.timedelta64(round(scene.place[1] / 15 * 3600), "s")
    assert abs(scene.time + hours - np.datetime64("2000-03-20T10:00")) < np.timedelta64(60, "s")
    notes = " | ".join(scene.notes)
    assert "2 times without dates in the file: the first is taken" in notes
    assert "(--time)" in notes
    info = describe(path)
    assert info.times == []
    assert any("no date in the file" in note for note in info.assumed)


def test_static_coordinates_and_moving_nests(wrf_file):
    """XLAT may lack the time axis, and may move with the nest."""
    path = wrf_file(change={"XLAT": lambda lat: lat + np.array([0.0, 0.5])[:, None, None]}, map_proj=6)
    assert open_scene(path, "2005-08-28T15:00").place[0] - open_scene(path).place[0] == pytest.approx(0.5, abs=1e-5)
    (name, first), (_, second) = (grids_of(path, time)[0] for time in (None, "2005-08-28T15:00"))
    assert name == path.name
    assert second.lonlat(0, 0)[1] - first.lonlat(0, 0)[1] == pytest.approx(0.5, abs=1e-5)
    with netCDF4.Dataset(path, "a") as file:
        file.renameVariable("XLAT", "XLAT_MOVING")
        fixed = file.createVariable("XLAT", "f4", ("south_north", "west_east"))
        fixed[:] = file["XLAT_MOVING"][1]
    assert open_scene(path).place == open_scene(path, "2005-08-28T15:00").place


def test_numbers_radii_hail_and_ground(wrf_file):
    levels, ground = ("bottom_top", "south_north", "west_east"), ("south_north", "west_east")
    one, flat = np.ones((5, 6, 7)), np.ones((6, 7))
    extra = {
        "QGRAUP": (levels, 1e-4 * one, "kg kg-1"),
        "QHAIL": (levels, 2e-4 * one, "kg kg-1"),
        "QICE": (levels, 1e-5 * one, "kg kg-1"),
        "QNICE": (levels, 1e5 * one, "  kg(-1)"),
        "RE_CLOUD": (levels, 8e-6 * one, "m"),
        "RE_ICE": (levels, 0 * one, "m"),
        "XLAND": (ground, np.where(np.arange(7) < 3, 1.0, 2.0) * flat, ""),
        "ALBEDO": (ground, 0.3 * flat, "-"),
        "SNOWC": (ground, 0.5 * flat, ""),
    }
    data = open_scene(path := wrf_file(extra=extra)).data
    density = data.ice_content / 1e-5
    np.testing.assert_allclose(data.graupel_content, 3e-4 * density, rtol=1e-5)
    np.testing.assert_allclose(data.ice_number, 1e5 * density, rtol=1e-5)
    np.testing.assert_allclose(data.liquid_effective_radius, 8e-6, rtol=1e-6)
    assert "ice_effective_radius" not in data  # written as zeros: not yet computed by the model
    np.testing.assert_array_equal(data.land_area_fraction[0], [1, 1, 1, 0, 0, 0, 0])
    assert float(data.surface_albedo.mean()) == pytest.approx(0.3)
    assert float(data.snow_area_fraction.mean()) == 0.5
    notes = " ".join(open_scene(path).notes)
    assert "QHAIL" in notes
    assert "RE_ICE is zero" in notes


def test_what_is_lacking_is_told(wrf_file):
    ground = ("south_north", "west_east")
    scene = open_scene(wrf_file(drop=("QVAPOR",), extra={"ALBEDO": (ground, np.zeros((6, 7)), "-")}))
    notes = " | ".join(scene.notes)
    for said in (
        "no QVAPOR",
        "no QRAIN, QICE, QSNOW, QGRAUP in the file",
        "no LANDMASK",
        "no SNOWC",
        "no SEAICE",
        "ALBEDO is not filled in",
        "US standard atmosphere",
    ):
        assert said in notes
    assert scene.species == ["liquid"]
    assert "surface_albedo" not in scene.data


def test_slightly_negative_water_is_clipped_and_told(wrf_file):
    def noisy(q):
        q[:, 0] = -1e-12
        return q

    scene = open_scene(wrf_file(change={"QCLOUD": noisy}))
    assert float(scene.data.liquid_content.min()) == 0.0
    assert any("QCLOUD: 42 of 210 values below 0" in note for note in scene.notes)


def test_idealised_run_is_flat(wrf_file):
    zero = {"XLAT": lambda values: 0 * values, "XLONG": lambda values: 0 * values}
    scene = open_scene(wrf_file(map_proj=0, change=zero, attributes=dict(DX=100.0, DY=50.0)))
    assert not scene.grid.curved
    assert scene.grid.spacing_m() == (100.0, 50.0)
    assert any("idealised" in note for note in scene.notes)


def test_without_coordinates_an_uncropped_file_is_placed_by_its_centre(wrf_file, wrf_lonlat):
    lon, lat = wrf_lonlat(map_proj=1, nx=7, ny=7)
    whole = {
        "WEST-EAST_GRID_DIMENSION": 8,
        "SOUTH-NORTH_GRID_DIMENSION": 8,
        "CEN_LAT": lat[3, 3],
        "CEN_LON": lon[3, 3],
    }
    scene = open_scene(wrf_file(map_proj=1, nx=7, ny=7, drop=("XLAT", "XLONG"), attributes=whole))
    ix, iy = scene.grid.index(lon, lat)
    np.testing.assert_allclose(ix[0], np.arange(7), atol=1e-3)
    np.testing.assert_allclose(iy[:, 0], np.arange(7), atol=1e-3)
    assert any("CEN_LAT" in note for note in scene.notes)


@pytest.mark.parametrize("layout", ["NETCDF3_CLASSIC", "NETCDF3_64BIT_OFFSET", "NETCDF3_64BIT_DATA", "NETCDF4"])
def test_every_netcdf_format(wrf_file, layout):
    assert open_scene(wrf_file(format=layout)).grid.shape == (5, 6, 7)


def test_description(wrf_file):
    info = describe(wrf_file())
    text = str(info)
    assert info.times == ["2005-08-28T12:00:00", "2005-08-28T15:00:00"]
    assert "liquid (QCLOUD)" in info.species
    assert {"QRAIN", "QICE", "ALBEDO"} <= set(info.missing)
    for said in (
        "WRF V4.5",
        "7 x 6 x 5",
        "Lambert conformal",
        "46.",
        " N ",
        "E",
        "km",
        "no QRAIN",
        "ground map",
    ):
        assert said in text
    incomplete = describe(wrf_file(drop=("PH", "PHB")))
    assert {"PH", "PHB"} <= set(incomplete.missing)


def test_what_a_file_says_of_itself_is_shown_and_not_obeyed(wrf_file):
    title = "OUTPUT FROM WRF \x1b]0;you\x07\u202e\nspecies    liquid"
    path = wrf_file(attributes={"TITLE": title})
    told = str(describe(path))
    assert "\nmodel      OUTPUT FROM WRF \\x1b]0;you\\x07\\u202e species    liquid\n" in told
    assert all(c.isprintable() or c == "\n" for c in told + open_scene(path).source)


NOON = "2023-01-15T12:00"
ORDERS = {
    "all along members, before time": lambda dims: ("member", *dims),
    "all but those without time, behind it": lambda dims: ("Time", "member", *dims[1:]) if dims[0] == "Time" else dims,
}


@pytest.mark.parametrize("order", ORDERS.values(), ids=ORDERS.keys())
def test_members_stacked_in_one_file(wrf_file, tmp_path, order):
    one = wrf_file(times=("2023-01-15_11:00:00", "2023-01-15_12:00:00"))
    path = stacked(one, tmp_path / "wrfout_members", order, [3, 7])
    assert members_of(path) == [3, 7]
    alone, third, seventh = open_scene(one, NOON), open_scene(path, NOON), open_scene(path, NOON, member=7)
    assert third.time == seventh.time == alone.time
    assert any("2 ensemble members in the file (3, 7): 3 is shown" in note for note in third.notes)
    np.testing.assert_array_equal(third.data.liquid_content, alone.data.liquid_content)
    np.testing.assert_array_equal(seventh.data.liquid_content, 2 * alone.data.liquid_content)
    assert any("ensemble members" in line for line in describe(path).assumed)
    with pytest.raises(UserError, match=r"no ensemble member 1 in it; it has 3, 7: choose one of these"):
        open_scene(path, member=1)


def test_members_in_files_of_their_own(wrf_file, tmp_path):
    paths = []
    for number in (1, 2):
        paths.append(wrf_file(change={"QCLOUD": lambda q, n=number: n * q}).rename(tmp_path / f"wrfout_{number}"))
        with netCDF4.Dataset(paths[-1], "a") as file:
            file.createVariable("member", "i4", ())[...] = number
    assert members_of(paths) == [1, 2]
    one, two = (open_scene(paths, member=number).data.liquid_content for number in (1, 2))
    np.testing.assert_array_equal(two, 2 * one)
    with pytest.raises(UserError, match=r"on the same grid: open one of them, or one member \(--member\)"):
        open_scene(paths)


def test_of_no_ensemble_no_member_is_taken(wrf_file):
    with pytest.raises(UserError, match=r"no ensemble members in it: leave out member"):
        open_scene(wrf_file(), member=1)


def test_runs_stacked_along_anything_else_are_told_what_to_do(wrf_file, tmp_path):
    path = stacked(wrf_file(), tmp_path / "wrfout_records", ORDERS["all along members, before time"])
    with netCDF4.Dataset(path, "a") as file:
        file.renameDimension("member", "record")
    with pytest.raises(UserError, match=r"take one along record, or call it member where it counts those of an ens"):
        open_scene(path)
