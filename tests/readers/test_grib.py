"""GRIB products of every centre against what was written: units, heights, orientation, wind, mass, place, time."""

from __future__ import annotations

import numpy as np
import pytest
from tests.readers import grib_files as gf

from openswim.readers import describe, open_scene

PRODUCTS = {
    "HRRR, native levels": gf.hrrr(),
    "HRRR, simple packing": gf.hrrr(packing="grid_simple"),
    "HRRR, JPEG 2000": gf.hrrr(packing="grid_jpeg"),
    "RAP, native levels": gf.hrrr(gf.RAP, process=105),
    "polar stereographic": gf.hrrr(gf.POLAR),
    "GFS, global": gf.on_pressure(gf.GLOBAL),
    "GFS, GRIB1": gf.on_pressure(gf.GLOBAL, edition=1),
    "NAVGEM, GRIB1": gf.on_pressure(gf.GLOBAL, edition=1, centre=58, process=0),
    "IFS, GRIB1": gf.ifs(gf.AROME, edition=1),
    "IFS, GRIB2, CCSDS": gf.ifs(gf.AROME, packing="grid_ccsds"),
    "ICON": gf.icon(gf.AROME),
    "COSMO, rotated": gf.icon(gf.COSMO),
    "AROME, heights above ground": gf.arome(),
}


@pytest.fixture(scope="module", params=PRODUCTS.values(), ids=PRODUCTS.keys())
def opened(request, tmp_path_factory):
    """(product, scene, latitudes and longitudes of its nodes by ecCodes in the file's order)."""
    product = request.param
    path = gf.write(tmp_path_factory.mktemp("grib") / "file", product)
    lat, lon = gf.points_of(gf.encode(product, product.messages[0]))
    return product, open_scene(path), lat, lon


def _nodes(scene):
    ny, nx = scene.grid.shape[1:]
    return scene.grid.lonlat(np.arange(nx), np.arange(ny)[:, None])


def test_nodes_lie_where_eccodes_says(opened):
    _, scene, lat, lon = opened
    ix, iy = scene.grid.index(lon, lat)
    np.testing.assert_allclose(ix, np.round(ix), atol=0.01)
    np.testing.assert_allclose(iy, np.round(iy), atol=0.01)
    ny, nx = scene.grid.shape[1:]
    at = np.unique(np.stack([np.round(ix) % nx, np.round(iy)]), axis=1)
    assert at.shape[1] == nx * ny  # every node of the file is one of the grid's
    assert at.min() >= 0
    assert at[1].max() == ny - 1


def test_north_is_up_and_fields_are_not_turned(opened):
    _, scene, _, _ = opened
    lon, lat = _nodes(scene)
    assert lat[-1].mean() > lat[0].mean()
    np.testing.assert_allclose(scene.data.surface_altitude, gf.terrain_m(lat, lon), atol=0.1)


def test_state_of_the_air(opened):
    product, scene, _, _ = opened
    data, height = scene.data, scene.grid.height_m
    assert (np.diff(height, axis=0) > 0).all()
    np.testing.assert_allclose(data.air_temperature, gf.TEMPERATURE_K, atol=1e-3)
    layers = product.centre in (78, 85)  # their heights are geometric
    geopotential = height if layers else height / (1 + height / 6.371229e6)
    atol = 40.0 if product.centre == 98 else 2.0  # m; full levels of the IFS are means of pressures
    np.testing.assert_allclose(gf.height_at(data.air_pressure.values), geopotential, atol=atol)


def test_contents_are_the_files_mass(opened):
    """Column mass from contents and heights equals that from mixing ratios and pressure, as in the file."""
    product, scene, _, _ = opened
    lon, lat = _nodes(scene)
    data, pressure = scene.data, scene.data.air_pressure.values
    ratio = (data.liquid_content + data.ice_content).values * gf.GAS * gf.TEMPERATURE_K / pressure
    amount = gf.cloud(lat, lon)
    if product.centre in (7, 58) and product.process in (0, 96):
        expected = amount * pressure / 1e5
    elif product.centre == 7:
        k = np.arange(1, len(ratio) + 1)[:, None, None]
        expected = amount * (k % 3 + 0.1 * (k > 6))
    elif product.centre == 98:
        k = np.arange(len(ratio), 0, -1)[:, None, None]
        expected = amount * np.where(k > len(ratio) // 2, 1.0, 0.2)
    elif product.centre == 78:
        k = np.arange(len(ratio), 0, -1)[:, None, None]
        expected = amount * np.where(k > 5, 1.0, 0.3)
    else:
        expected = amount * (scene.grid.height_m - gf.terrain_m(lat, lon) > 400)
    np.testing.assert_allclose(ratio, expected, rtol=2e-3, atol=2e-8)
    mass = np.trapezoid((data.liquid_content + data.ice_content).values, scene.grid.height_m, axis=0)
    # the same integral in pressure: between levels both are linear in different things
    in_pressure = -np.trapezoid(expected, pressure, axis=0) / gf.GRAVITY
    np.testing.assert_allclose(mass, in_pressure, rtol=0.08)


def test_time_is_the_valid_time(opened):
    _, scene, _, _ = opened
    assert scene.time == np.datetime64("2024-06-21T12:00")


def test_wind_points_along_the_earth(opened):
    """3 m/s along u and 4 m/s along v; turned by the bearing of the grid's axes where the message says so."""
    product, scene, _, _ = opened
    if "wind_east_10m" not in scene.data:
        assert not any(one.parameter[:2] == (0, 2) for one in product.messages)
        return
    lon, lat = (np.radians(angle) for angle in _nodes(scene))
    east, north = np.full(lat.shape, 3.0), np.full(lat.shape, 4.0)
    if product.grid.get("resolutionAndComponentFlags") == 8:
        step = np.gradient(np.unwrap(lon, axis=1), axis=1) * np.cos(lat), np.gradient(lat, axis=1)
        turn = np.arctan2(step[1], step[0])
        east, north = 3 * np.cos(turn) - 4 * np.sin(turn), 4 * np.cos(turn) + 3 * np.sin(turn)
    inner = (slice(1, -1), slice(1, -1))
    np.testing.assert_allclose(scene.data.wind_east_10m.values[inner], east[inner], atol=0.01)
    np.testing.assert_allclose(scene.data.wind_north_10m.values[inner], north[inner], atol=0.01)


def test_hrrr_species_smoke_and_ground(tmp_path):
    scene = open_scene(gf.write(tmp_path / "hrrr", gf.hrrr()))
    assert scene.species == ["liquid", "ice", "rain", "snow", "graupel", "smoke"]
    density = scene.data.air_pressure / (gf.GAS * gf.TEMPERATURE_K)
    for name, ratio in (("rain", 2e-5), ("snow", 3e-5), ("graupel", 4e-5)):
        np.testing.assert_allclose(scene.data[f"{name}_content"] / density, ratio, rtol=1e-3)
    np.testing.assert_allclose(scene.data.liquid_number / density, 1e8, rtol=1e-3)
    smoke = 4500.0 * 1e-8 / np.arange(1, 13)
    np.testing.assert_allclose(scene.data.extinction_smoke[:, 3, 4], smoke, rtol=1e-3)
    np.testing.assert_allclose(scene.data.snow_area_fraction, 0.25, atol=1e-3)
    assert not any("split by temperature" in note for note in scene.notes)


def test_one_condensate_is_split_by_temperature(tmp_path):
    product = gf.on_pressure(gf.AROME)
    for one in product.messages:
        if one.parameter == (0, 0, 0):
            one.values = lambda lat, lon, p=one.level[1]: 223.16 + 60.0 * p / 1e5
    scene = open_scene(gf.write(tmp_path / "gfs", product))
    data = scene.data
    share = data.ice_content / (data.ice_content + data.liquid_content)
    np.testing.assert_allclose(share, np.clip((273.16 - data.air_temperature) / 20, 0, 1), atol=1e-3)
    assert float(share.max()) == 1.0
    assert float(share.min()) == 0.0
    assert any("split by temperature" in note for note in scene.notes)


@pytest.mark.parametrize("reduced", [False, True], ids=["regular", "reduced"])
def test_gaussian_grids(tmp_path, reduced):
    """Rows are not quite even, and a reduced grid has its own columns in each: fields still lie where they should."""
    grid = dict(gf.GAUSSIAN)
    if reduced:
        half = [20, 27, 36, 40, 45, 50, 60, 64, *[64] * 8]
        grid = {"gridType": "reduced_gg", "N": 16, "Nj": 32, "pl": half + half[::-1],
                "latitudeOfFirstGridPointInDegrees": 85.76058712044382,
                "longitudeOfFirstGridPointInDegrees": 0.0, "latitudeOfLastGridPointInDegrees": -85.76058712044382,
                "longitudeOfLastGridPointInDegrees": 354.375}  # fmt: skip
    path = gf.write(tmp_path / "ifs", gf.ifs(grid, levels=6))
    for scene in (open_scene(path), open_scene(path, around=(52.0, 179.0), radius_km=3000)):
        lon, lat = _nodes(scene)
        inside = np.abs(lat) < 80
        expected = gf.terrain_m(lat, lon)
        # linear between nodes 5.6 degrees apart, or 18 in the shortest rows: f'' h^2 / 8
        np.testing.assert_allclose(scene.data.surface_altitude.values[inside], expected[inside], atol=15.0)


def test_several_times_and_static_fields(tmp_path):
    first, second = gf.icon(gf.AROME), gf.icon(gf.AROME, time=1300)
    second.messages = [one for one in second.messages if one.parameter != (0, 3, 6)]
    for one in second.messages:
        if one.parameter == (0, 1, 22):
            one.values = lambda lat, lon: 5e-4
    path = tmp_path / "two"
    path.write_bytes(gf.write(tmp_path / "a", first).read_bytes() + gf.write(tmp_path / "b", second).read_bytes())
    assert open_scene(path).time == np.datetime64("2024-06-21T12:00")
    later = open_scene(path, time="2024-06-21T13:00")
    assert later.time == np.datetime64("2024-06-21T13:00")
    density = later.data.air_pressure / (gf.GAS * gf.TEMPERATURE_K)
    np.testing.assert_allclose(later.data.liquid_content / density, 5e-4, rtol=1e-3)
    np.testing.assert_allclose(later.data.surface_altitude, open_scene(path).data.surface_altitude)
    assert describe(path).times == ["2024-06-21T12:00:00", "2024-06-21T13:00:00"]


def test_fields_packed_together_in_one_message(tmp_path):
    """NCEP repeats sections 4 to 7 within a message (wind), and may refer to an earlier bitmap."""
    import eccodes as ec

    product = gf.hrrr()
    whole = gf.write(tmp_path / "apart", product)
    multi = ec.codes_grib_multi_new()
    for one in product.messages[-2:]:
        handle = ec.codes_new_from_message(gf.encode(product, one))
        ec.codes_grib_multi_append(handle, 4, multi)
        ec.codes_release(handle)
    together = tmp_path / "together"
    with together.open("wb") as file:
        ec.codes_grib_multi_write(multi, file)
    ec.codes_grib_multi_release(multi)
    rest = b"".join(gf.encode(product, one) for one in product.messages[:-2])
    together.write_bytes(together.read_bytes() + rest)
    assert together.read_bytes().count(b"GRIB") == len(product.messages) - 1
    a, b = open_scene(whole).data, open_scene(together).data
    np.testing.assert_array_equal(a.wind_east_10m, b.wind_east_10m)
    np.testing.assert_array_equal(a.wind_north_10m, b.wind_north_10m)


def test_heights_by_the_hydrostatic_equation_alone(tmp_path):
    product = gf.on_pressure(gf.AROME)
    product.messages = [one for one in product.messages if one.parameter != (0, 3, 5) or one.level[0] == 1]
    product.messages.append(gf.Message((0, 3, 0), (1, 0), lambda lat, lon: gf.pressure_at(gf.terrain_m(lat, lon))))
    scene = open_scene(gf.write(tmp_path / "gfs", product))
    geopotential = scene.grid.height_m / (1 + scene.grid.height_m / 6.371229e6)
    np.testing.assert_allclose(geopotential, gf.height_at(scene.data.air_pressure.values), atol=1.0)
    assert any("hydrostatic" in note for note in scene.notes)


def test_info_says_what_is_there_and_what_is_not(tmp_path):
    text = str(describe(gf.write(tmp_path / "ifs", gf.ifs(gf.GLOBAL, levels=8))))
    for said in ("ECMWF", "72 x 37", "8 hybrid levels", "latitude-longitude", "2024-06-21T12:00:00", "liquid, ice",
                 "no rain, snow, graupel", "surface_altitude", "surface_albedo"):  # fmt: skip
        assert said in text


def test_description_tells_what_opening_will_assume(tmp_path):
    """The GFS's one condensate becomes two, its cells are broken by humidity, and night's albedo is none."""
    for name in ("GFS, GRIB1", "HRRR, native levels", "ICON"):
        path = gf.write(tmp_path / name, PRODUCTS[name])
        scene, info = open_scene(path), describe(path)
        # what values look like is known only when they are read
        assert {note for note in scene.notes if not note.endswith("?")} <= set(info.assumed), name
        assert {one for one in scene.species if one != "aerosol"} <= set(info.species), name


def test_other_readers_are_left_alone(tmp_path):
    from openswim.readers.grib.reader import GRIBReader

    assert not GRIBReader().detects(tmp_path)
    (tmp_path / "text").write_bytes(b"no weather here")
    assert not GRIBReader().detects(tmp_path / "text")
    (tmp_path / "bulletin").write_bytes(b"\x01\r\r\n100\r\r\n" + gf.encode(gf.hrrr(), gf.hrrr().messages[0]))
    assert GRIBReader().detects(tmp_path / "bulletin")
