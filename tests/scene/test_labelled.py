"""Arrays that say their units and the names of their dimensions, handed to `Scene.from_arrays`."""

from __future__ import annotations

import numpy as np
import pytest
import xarray as xr

import openswim
from openswim.errors import UserError
from openswim.scene import Scene
from openswim.scene.labels.units import conversion

AXES = dict(x_m=np.arange(4) * 10.0, y_m=np.arange(3) * 10.0, z_m=np.arange(2) * 10.0)
SHAPE = (2, 3, 4)
CUBE = {name: np.arange(4) * 100.0 for name in ("x_m", "y_m", "z_m")}


def _array(value: object, units: str, dims: tuple[str, ...] = ("z", "y", "x")) -> xr.DataArray:
    sizes = dict(zip(("z", "y", "x"), SHAPE, strict=True))
    filled = np.broadcast_to(value, [sizes[dim] for dim in dims])
    return xr.DataArray(filled.copy(), dims=dims, attrs={"units": units})


IN_SI = {  # as written, and as a scene has it: by the definitions of the units; air: p / (287 J kg-1 K-1 T)
    "ice_content": (_array(0.02, "g m-3"), 2e-5),
    "liquid_content": (_array(0.1, "g/kg"), 1e-4 * 9e4 / (287.0 * 273.15)),
    "liquid_number": (_array(100, "cm-3"), 1e8),
    "liquid_effective_radius": (_array(10.0, "um"), 1e-5),
    "extinction_cloud": (_array(20.0, "km-1"), 0.02),
    "air_pressure": (_array([[[900.0]], [[899.0]]], "hPa"), [[[9e4]], [[8.99e4]]]),
    "air_temperature": (_array(0.0, "degC"), 273.15),
    "snow_depth": (_array(20.0, "cm", ("y", "x")), 0.2),
    "surface_albedo": (_array(20.0, "%", ("y", "x")), 0.2),
    "surface_altitude": (_array(0.005, "km", ("y", "x")), 5.0),
}


def test_units_are_those_of_the_arrays_as_in_a_file(tmp_path):
    fields = {name: array for name, (array, _) in IN_SI.items()}
    height = xr.DataArray([0.0, 0.01], dims="z", attrs={"units": "km"})
    scene = Scene.from_arrays(
        fields["extinction_cloud"], AXES["x_m"], AXES["y_m"], height, terrain_m=fields["surface_altitude"],
        fields={name: fields[name] for name in IN_SI if name not in ("extinction_cloud", "surface_altitude")},
    )  # fmt: skip
    for name, (_, expected) in IN_SI.items():
        wanted = np.broadcast_to(expected, scene.data[name].shape)
        if name == "liquid_content":
            wanted = wanted * scene.data.air_pressure / 9e4
        np.testing.assert_allclose(scene.data[name], wanted, rtol=1e-6, err_msg=name)
    described = '{"type": "henyey_greenstein", "g": 0.85}'
    fields["extinction_cloud"] = fields["extinction_cloud"].assign_attrs(phase_function=described)
    coords = {"x": ("x", AXES["x_m"], {"units": "m"}), "y": ("y", AXES["y_m"], {"units": "m"}), "height": height}
    xr.Dataset(fields, coords=coords).to_netcdf(tmp_path / "same.nc")
    read = openswim.open_scene(tmp_path / "same.nc")
    for name in IN_SI:
        np.testing.assert_array_equal(scene.data[name], read.data[name], err_msg=name)
    np.testing.assert_array_equal(scene.grid.height_m, read.grid.height_m)
    assert [note for note in scene.notes if "dry air" in note] == [note for note in read.notes if "dry air" in note]


def test_ground_and_wavelengths_have_units_too():
    albedo = xr.DataArray(np.full((3, 4, 2), 20.0), dims=("y", "x", "wavelength"), attrs={"units": "%"})
    waves = xr.DataArray([0.45, 0.6], dims="wavelength", attrs={"units": "um"})
    data = Scene.from_arrays(None, **AXES, surface_albedo=albedo, wavelength_nm=waves).data
    np.testing.assert_allclose(data.surface_albedo, 0.2, rtol=1e-6)
    np.testing.assert_allclose(data.wavelength, [450.0, 600.0])
    clear = Scene.clear(
        46.0, 8.0, surface_albedo=_array(20.0, "%", ()), terrain_m=_array(1.0, "km", ()),  # type: ignore[arg-type]
    ).data  # fmt: skip
    assert float(clear.surface_albedo) == pytest.approx(0.2)
    assert float(clear.surface_altitude) == 1000.0


def test_units_that_nobody_knows_are_refused():
    for name in ("ice_content", "extinction_dust", "surface_altitude"):
        dims = ("y", "x") if name == "surface_altitude" else ("z", "y", "x")
        with pytest.raises(UserError, match=f"{name} is in 'furlong'; it must be in"):
            Scene.from_arrays(None, **AXES, fields={name: _array(0.0, "furlong", dims)})
    with pytest.raises(UserError, match="surface_albedo is in 'furlong'"):
        Scene.from_arrays(None, **AXES, surface_albedo=_array(0.0, "furlong", ("y", "x")))
    for name in AXES:
        axis = xr.DataArray(AXES[name], dims=name[0], attrs={"units": "furlong"})
        with pytest.raises(UserError, match=f"{name} is in 'furlong'; it must be in 'm'"):
            Scene.from_arrays(None, **AXES | {name: axis})
    east = xr.DataArray(AXES["x_m"], dims="x", attrs={"units": "degrees_east"})
    with pytest.raises(UserError, match='x_m is in degrees: give crs="EPSG:4326"'):
        Scene.from_arrays(None, **AXES | {"x_m": east})
    assert Scene.from_arrays(None, **AXES | {"x_m": east}, crs="EPSG:4326").grid.in_degrees
    with pytest.raises(UserError, match="give air_pressure and air_temperature too, or convert it first"):
        Scene.from_arrays(None, **AXES, fields={"ice_content": _array(1e-4, "kg kg-1")})


@pytest.mark.parametrize(
    "names", [("z", "y", "x"), ("level", "lat", "lon"), ("height", "south_north", "west_east"), ("plane", "y", "x")]
)
def test_dimensions_of_usual_names_are_put_in_order(names):
    """On a cube no shape would tell; one name of its own may be among them."""
    values = np.zeros((4, 4, 4))
    values[1, 2, 3] = 0.01
    for turn in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
        array = xr.DataArray(values, dims=names).transpose(*(names[axis] for axis in turn))
        found = Scene.from_arrays(array, **CUBE).data.extinction_cloud
        np.testing.assert_array_equal(found, values.astype(np.float32))


@pytest.mark.parametrize("names", [("time", "lat", "lon"), ("x", "row", "column"), ("y", "lat", "x"), ("a", "b", "z")])
def test_dimensions_at_the_place_of_others_are_refused(names):
    with pytest.raises(UserError, match=r"cloud has dimensions .*; it must have \(z, y, x\): rename or select them"):
        Scene.from_arrays(xr.DataArray(np.zeros((4, 4, 4)), dims=names), **CUBE)
    with pytest.raises(UserError, match=r"x_m has dimensions \(lat\); it must have \(x\)"):
        Scene.from_arrays(None, **CUBE | {"x_m": xr.DataArray(CUBE["x_m"], dims="lat")})


def test_dimensions_that_say_nothing_are_taken_by_place():
    values = np.arange(64.0).reshape(4, 4, 4) * 1e-4
    found = Scene.from_arrays(xr.DataArray(values), **CUBE).data.extinction_cloud  # dim_0, dim_1, dim_2
    np.testing.assert_array_equal(found, values.astype(np.float32))


def test_gaps_below_the_ground_are_filled_as_in_a_file():
    content = np.full(SHAPE, 1e-5, np.float32)
    content[0] = np.nan
    pressure = np.array([np.nan, 9e4])[:, None, None] * np.ones(SHAPE)
    given = dict(fields={"ice_content": content, "air_pressure": pressure})
    scene = Scene.from_arrays(None, **AXES, terrain_m=np.full(SHAPE[1:], 5.0), **given)
    assert not scene.data.ice_content[0].any()
    np.testing.assert_allclose(scene.data.ice_content[1], 1e-5)
    np.testing.assert_array_equal(scene.data.air_pressure, 9e4)
    assert "ice_content: 12 missing values below the terrain filled" in scene.notes
    assert np.isnan(content[0]).all()
    with pytest.raises(UserError, match="12 missing values"):  # of the level at the ground itself
        Scene.from_arrays(None, **AXES, terrain_m=np.zeros(SHAPE[1:]), **given)
    with pytest.raises(UserError, match="12 missing values"):
        Scene.from_arrays(None, **AXES, **given)


def _placed(units: str = "m") -> xr.DataArray:
    """Values that are all different, with the places of CUBE in these units."""
    places = CUBE["x_m"] / {"m": 1.0, "km": 1000.0}[units]
    coords = {dim: (dim, places, {"units": units}) for dim in ("z", "y", "x")}
    return xr.DataArray(np.arange(64.0).reshape(4, 4, 4) * 1e-4, dims=("z", "y", "x"), coords=coords)


@pytest.mark.parametrize("units", ["m", "km"])
def test_values_stand_where_their_coordinates_say(units):
    array = _placed(units)
    for other in (array[:, ::-1], array[::-1, :, ::-1], array.isel(x=[2, 0, 3, 1]), array.transpose("x", "z", "y")):
        found = Scene.from_arrays(other, **CUBE).data.extinction_cloud
        np.testing.assert_array_equal(found, array.values.astype(np.float32))
    ground = array[0, ::-1] * 100.0
    found = Scene.from_arrays(None, **CUBE, terrain_m=ground, surface_albedo=ground).data
    for name in ("surface_altitude", "surface_albedo"):
        np.testing.assert_array_equal(found[name], (array[0] * 100.0).astype(np.float32), err_msg=name)
    heights = 100.0 + 10.0 * array.z / float(array.z.max()) + 0.0 * array + array.y / float(array.y.max())
    heights.attrs["units"] = "m"
    turned = Scene.from_arrays(None, **CUBE | {"z_m": heights[:, ::-1]}).grid
    np.testing.assert_allclose(turned.height_m, heights.values)


def test_other_places_than_the_nodes_are_refused():
    array = _placed()
    for other in (array.assign_coords(y=array.y + 50.0), array.assign_coords(y=array.y.assign_attrs(units="km"))):
        with pytest.raises(UserError, match=r"extinction_cloud has its own y, .* asked for at 0 to 300: select"):
            Scene.from_arrays(other, **CUBE)
    albedo = xr.DataArray(np.zeros((4, 4, 2)), dims=("y", "x", "wavelength"), coords={"wavelength": [450.0, 600.0]})
    found = Scene.from_arrays(
        None, **CUBE, surface_albedo=albedo + albedo.wavelength / 1e3, wavelength_nm=[600.0, 450.0]
    )
    np.testing.assert_allclose(found.data.surface_albedo[0, 0], [0.6, 0.45])
    with pytest.raises(UserError, match="surface_albedo has its own wavelength, 450 to 600 nm"):
        Scene.from_arrays(None, **CUBE, surface_albedo=albedo, wavelength_nm=[450.0, 610.0])


def test_coordinates_that_are_rounded_or_no_places_are_left_as_they_are():
    """Nodes in float32, numbers of nodes, names, and levels of pressure."""
    array = _placed()
    pressure = ("z", [900.0, 850.0, 700.0, 500.0], {"units": "hPa"})
    others = (
        array.assign_coords({dim: array[dim].astype(np.float32) * np.float32(1.00001) for dim in array.dims}),
        array.assign_coords(x=range(4), y=range(1, 5), z=pressure),
        array.assign_coords(x=list("abcd")),
        array.drop_vars("z").rename(z="level").assign_coords(level=[60, 59, 58, 57]),
    )
    for other in others:
        found = Scene.from_arrays(other, **CUBE).data.extinction_cloud
        np.testing.assert_array_equal(found, array.values.astype(np.float32))
    lon = np.arange(350.0, 354.0)
    east = array.assign_coords(x=("x", lon, {"units": "degrees_east"}), y=array.y / 100.0)[:, :, ::-1]
    east.y.attrs["units"] = "degrees"
    axes = {"x_m": lon - 360.0, "y_m": CUBE["y_m"] / 100.0, "z_m": CUBE["z_m"]}
    found = Scene.from_arrays(east, **axes, crs="EPSG:4326").data.extinction_cloud
    np.testing.assert_array_equal(found, array.values.astype(np.float32))


@pytest.mark.parametrize(
    ("written", "wanted", "factor"),
    [
        ("kilometers", "m", 1e3), ("Kilometres", "m", 1e3), ("centimetres", "m", 1e-2), ("millimeter", "m", 1e-3),
        ("km\u207b\u00b9", "m-1", 1e-3), ("1/kilometers", "m-1", 1e-3), ("kilometer-1", "m-1", 1e-3),
        ("\u03bcm", "nm", 1e3),
        ("g m\u207b\u00b3", "kg m-3", 1e-3), ("grams/meter^3", "kg m-3", 1e-3), ("cm\u22123", "m-3", 1e6),
        ("Mm-1", "m-1", 1e-6), ("MM", "m", None), ("centigrade", "m", None),
    ],
)  # fmt: skip
def test_units_are_known_by_their_long_names_and_raised_powers(written, wanted, factor):
    assert conversion(written, wanted) == (None if factor is None else (factor, 0.0))


@pytest.mark.parametrize("labelled", ["plain", "coordinates", "dimensions"])
@pytest.mark.parametrize("falling", ["x", "y", "z", "xyz"])
def test_axes_that_fall_are_turned_over_with_all_on_them(falling: str, labelled: str) -> None:
    """Latitudes from the north, levels from the top: the same scene as with all in rising order."""
    rng = np.random.default_rng(5)
    axes = {"x": np.arange(4.0), "y": 40 + np.arange(3.0), "z": np.array([0.0, 500.0, 1200.0])}
    cloud = rng.uniform(0, 1e-3, (3, 3, 4)).astype(np.float32)
    albedo = rng.uniform(0, 0.5, (3, 4, 3)).astype(np.float32)
    terrain = rng.uniform(0, 50, (3, 4)).astype(np.float32)

    def scene(turned: str, as_what: str) -> Scene:
        turn = {name: slice(None, None, -1 if name in turned else 1) for name in "xyz"}
        own = {name: places[turn[name]] for name, places in axes.items()}

        def given(values: np.ndarray, dims: str) -> np.ndarray | xr.DataArray:
            values = values[tuple(turn.get(dim, slice(None)) for dim in dims)]
            if as_what == "plain":
                return values
            coords = {dim: own[dim] for dim in dims if dim in own} if as_what == "coordinates" else None
            return xr.DataArray(values, coords, list(dims.replace("w", "")) + ["wavelength"] * ("w" in dims))

        return Scene.from_arrays(
            given(cloud, "zyx"), own["x"], own["y"], own["z"], crs="EPSG:4326", terrain_m=given(terrain, "yx"),
            surface_albedo=given(albedo, "yxw"), wavelength_nm=[650.0, 550.0, 450.0],
        )  # fmt: skip

    rising, turned = scene("", "plain"), scene(falling, labelled)
    xr.testing.assert_identical(turned.data, rising.data)
    for name in ("x", "y", "height_m"):
        np.testing.assert_array_equal(getattr(turned.grid, name), getattr(rising.grid, name))
    assert turned.data["extinction_cloud"].values.flags["C_CONTIGUOUS"]


@pytest.mark.parametrize("tall", [False, True])
@pytest.mark.parametrize(("name", "units"), [("level", "hPa"), ("plev", ""), ("isobaricInhPa", "")])
def test_levels_of_pressure_run_against_heights(name, units, tall):
    """ERA5's older files list the top first; what lies beside rising heights has to be turned over."""
    extinction = np.zeros(SHAPE)
    extinction[0, 1, 1] = 1e-3
    upward = xr.DataArray(
        extinction, dims=(name, "y", "x"), coords={name: (name, [1000.0, 990.0], {"units": units} if units else {})}
    )
    z = np.broadcast_to(AXES["z_m"][:, None, None], SHAPE) if tall else AXES["z_m"]
    scene = Scene.from_arrays(upward, **AXES | {"z_m": z})
    assert scene.data.extinction_cloud[0, 1, 1] == np.float32(1e-3)
    downward = upward.isel({name: slice(None, None, -1)})
    with pytest.raises(UserError, match=rf"lies on pressures of 990 to 1000 .*turn it over, isel\({name}"):
        Scene.from_arrays(downward, **AXES | {"z_m": z})
    if not tall:
        turned = Scene.from_arrays(downward, **AXES | {"z_m": AXES["z_m"][::-1]})
        np.testing.assert_array_equal(turned.data.extinction_cloud, scene.data.extinction_cloud)
