"""Arrays that say their units and the names of their dimensions, handed to `Scene.from_arrays`."""

from __future__ import annotations

import numpy as np
import pytest
import xarray as xr

import openswim
from openswim.errors import UserError
from openswim.scene import Scene

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
