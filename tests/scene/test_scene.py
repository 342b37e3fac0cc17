"""What a scene accepts, repairs and refuses."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import xarray as xr

from openswim.errors import UserError
from openswim.scene import Grid, Optics, Scene
from openswim.scene.phase import HenyeyGreenstein
from openswim.scene.variables import variable

AXES = dict(x_m=np.arange(4) * 10.0, y_m=np.arange(3) * 10.0, z_m=np.arange(2) * 10.0)
SHAPE = (2, 3, 4)


def _scene(**fields) -> Scene:
    grid = Grid(AXES["x_m"], AXES["y_m"], AXES["z_m"])
    return Scene(grid, xr.Dataset({name: (("z", "y", "x")[3 - np.ndim(v) :], v) for name, v in fields.items()}))


def test_a_notebook_shows_a_line():
    scene = _scene(liquid_content=np.zeros(SHAPE))
    scene.wider = _scene(liquid_content=np.zeros(SHAPE))
    text = repr(scene)
    assert len(text) < 200
    for said in ("4 x 3 x 2 nodes", "10 x 10 m", "liquid", "in 1 wider", "no time"):
        assert said in text
    clear = Scene.clear(46.0, 8.0)
    assert "clear sky" in repr(clear)
    assert repr(scene.grid) == "<Grid: 4 x 3 x 2 nodes; 0 to 10 m; flat>"
    assert len(repr(clear.atmosphere)) < 120
    assert "depth 0 at" in repr(replace(clear.atmosphere, aerosol=None))


@pytest.mark.parametrize("dtype", ["float32", "float64"])
def test_a_scene_is_not_in_the_memory_of_its_arrays(dtype):
    """Nor does what becomes of the arrays afterwards become of the scene."""
    content, albedo, terrain = np.full(SHAPE, 1e-4, dtype), np.full(SHAPE[1:], 0.5, dtype), np.zeros(SHAPE[1:], dtype)
    cloud = xr.DataArray(np.full(SHAPE, 0.02, dtype), dims=("z", "y", "x"), attrs={"units": "m-1"})
    axes = {name: axis.astype(dtype) for name, axis in AXES.items()}
    axes["z_m"] = np.broadcast_to(axes["z_m"][:, None, None], SHAPE).copy()
    scene = Scene.from_arrays(
        cloud, **axes, fields={"ice_content": content}, surface_albedo=albedo, terrain_m=terrain
    )
    before = scene.data.copy(deep=True)
    kept = [*(scene.data[name].values for name in scene.data.data_vars), scene.grid.x, scene.grid.y]
    theirs = [content, albedo, terrain, cloud.values, *axes.values()]
    for array in theirs:
        assert not any(np.shares_memory(array, each) for each in [*kept, scene.grid.height_m])
        array[...] = 7.0
    assert scene.data.identical(before)
    assert scene.data.ice_content.values.flags.c_contiguous


def test_what_readers_hand_over_is_not_copied():
    content = np.full(SHAPE, 1e-4, np.float32)
    assert np.shares_memory(_scene(ice_content=content).data.ice_content.values, content)


def test_from_arrays_keeps_what_it_is_given():
    extinction = np.random.default_rng(0).uniform(0, 0.02, SHAPE)
    scene = Scene.from_arrays(
        {"drops": extinction, "dust": 0.1 * extinction},
        **AXES,
        single_scattering_albedo={"drops": 1.0, "dust": [0.9, 0.85, 0.8]},
        phase={"drops": HenyeyGreenstein(0.85), "dust": HenyeyGreenstein(0.7)},
        kind={"drops": "liquid", "dust": "aerosol"},
        surface_albedo=0.2,
        terrain_m=np.full((3, 4), -5.0),
        place=(46.0, 8.0),
        fields={"rain_content": np.full(SHAPE, 1e-4)},
        periodic=True,
    )
    np.testing.assert_allclose(scene.data.extinction_drops, extinction, rtol=1e-6)
    assert scene.species == ["rain", "drops", "dust"]
    assert scene.optics["dust"].phase.asymmetry == pytest.approx(0.7)
    np.testing.assert_array_equal(scene.optics["dust"].single_scattering_albedo, [0.9, 0.85, 0.8])
    assert scene.optics["drops"].kind == "liquid"
    assert scene.place == (46.0, 8.0)
    assert scene.grid.periodic
    assert scene.atmosphere is None
    assert float(scene.data.surface_albedo.mean()) == pytest.approx(0.2)
    assert {field.dtype for field in scene.data.data_vars.values()} == {np.dtype("f4")}


@pytest.mark.parametrize("name", ["a/b", "../up", "nul\0", "lone\ud800", "end ", "x" * 300])
def test_names_that_no_file_can_hold_are_refused(name):
    with pytest.raises(UserError, match="no file can hold a variable named") as told:
        Scene.from_arrays({name: np.zeros(SHAPE)}, **AXES)
    assert str(told.value).isprintable()
    str(told.value).encode()


def test_spectral_albedo_needs_its_wavelengths():
    albedo = np.ones((3, 4, 3)) * [0.1, 0.2, 0.3]
    scene = Scene.from_arrays(np.zeros(SHAPE), **AXES, surface_albedo=albedo)
    np.testing.assert_array_equal(scene.data.wavelength, [615.0, 546.0, 450.0])
    with pytest.raises(UserError, match="wavelength_nm lists 2"):
        Scene.from_arrays(np.zeros(SHAPE), **AXES, surface_albedo=albedo, wavelength_nm=[500, 600])
    with pytest.raises(UserError, match="nanometres"):
        Scene.from_arrays(np.zeros(SHAPE), **AXES, surface_albedo=albedo, wavelength_nm=[0.6, 0.5, 0.4])


def test_clear_sky_has_a_place_and_a_ground():
    scene = Scene.clear(78.2, 15.7, surface_albedo=[0.8, 0.82, 0.85], terrain_m=450.0)
    assert scene.grid is None
    assert scene.species == []
    assert scene.place == (78.2, 15.7)
    assert float(scene.data.surface_altitude) == 450.0
    np.testing.assert_allclose(scene.data.surface_albedo, [0.8, 0.82, 0.85], rtol=1e-6)
    assert scene.atmosphere.ozone_column_du() == pytest.approx(300.0)
    assert Scene.clear(0, 0, atmosphere=None).atmosphere is None
    with pytest.raises(UserError, match="no place on Earth"):
        Scene.clear(95.0, 0.0)


def test_a_flat_scene_may_have_a_place():
    scene = Scene.from_arrays(np.zeros(SHAPE), **AXES, place=(40, -105))
    assert scene.place == (40.0, -105.0)
    for nowhere in ((100, 0), (40,), 5):
        with pytest.raises(UserError, match="no place on Earth"):
            Scene.from_arrays(np.zeros(SHAPE), **AXES, place=nowhere)


def test_a_projection_may_be_text():
    degrees = AXES | {"x_m": np.arange(4.0), "y_m": np.arange(3.0)}
    assert Scene.from_arrays(np.zeros(SHAPE), **degrees, crs="EPSG:4326").grid.crs.is_geographic
    with pytest.raises(UserError, match="no projection"):
        Scene.from_arrays(np.zeros(SHAPE), **AXES, crs="lambert, or so")


def test_order_of_dimensions_does_not_matter():
    content = np.arange(24.0).reshape(SHAPE) * 1e-5
    grid = Grid(AXES["x_m"], AXES["y_m"], AXES["z_m"])
    turned = xr.Dataset({"ice_content": (("x", "z", "y"), content.transpose(2, 0, 1))})
    np.testing.assert_allclose(Scene(grid, turned).data.ice_content, content, rtol=1e-6)


def test_noise_in_clear_air_is_noise():
    assert not _scene(liquid_content=np.full(SHAPE, -1e-9)).data.liquid_content.any()
    with pytest.raises(UserError, match=r"from -1e-06 to 0 kg m-3; it must lie within 0 to 0.1"):
        _scene(liquid_content=np.append(np.full(23, -1e-6), 0.0).reshape(SHAPE))


@pytest.mark.parametrize(
    ("name", "typical", "noise"),
    [("extinction_dust", 0.02, 1e-9), ("extinction_dust", 1e-4, 1e-9), ("aerosol_extinction", 1e-4, 1e-9),
     ("ice_number", 1e4, 0.1), ("liquid_number", 1e8, 0.1), ("rain_number", 1e2, 0.1), ("ice_content", 1e-5, 1e-10),
     ("liquid_effective_radius", 1e-5, 1e-11), ("snow_depth", 0.1, 1e-6), ("precipitable_water", 10.0, 1e-6),
     ("snow_area_fraction", 0.5, 1e-8)],
)  # fmt: skip
def test_what_is_below_zero_is_less_than_a_tenth_or_nothing(name, typical, noise):
    """Whatever range the table leaves to a field."""
    shape = SHAPE[1:] if variable(name).dims == ("y", "x") else SHAPE
    grid, optics = Grid(AXES["x_m"], AXES["y_m"], AXES["z_m"]), {}
    if name == "extinction_dust":
        optics["dust"] = Optics(1.0, HenyeyGreenstein(0.7))

    def scene(first: float, second: float) -> Scene:
        values = np.zeros(shape)
        values.flat[:2] = first, second
        return Scene(grid, xr.Dataset({name: (("z", "y", "x")[3 - len(shape) :], values)}), optics=optics)

    for low, high in ((-0.09 * typical, typical), (-noise, 0.0)):  # a little beside more; almost nothing
        clipped = scene(low, high)
        assert float(clipped.data[name].min()) == 0.0
        assert f"{name}: 1 of {np.prod(shape)} values below 0" in " ".join(clipped.notes)
    for low, high in ((-0.11 * typical, typical), (-typical, 0.0)):
        with pytest.raises(UserError, match=f"{name} runs from .*it must lie within 0 to"):
            scene(low, high)


def test_noise_is_clipped_and_told():
    content = np.full(SHAPE, 1e-3)
    content[0, 0, 0] = -1e-9
    scene = _scene(liquid_content=content, land_area_fraction=np.full((3, 4), 1.0005))
    assert float(scene.data.liquid_content.min()) == 0.0
    assert float(scene.data.land_area_fraction.max()) == 1.0
    assert any("liquid_content: 1 of 24 values below 0" in note for note in scene.notes)
    assert any("land_area_fraction: 12 of 12 values above 1" in note for note in scene.notes)


REFUSED = {
    "NaN": (dict(ice_content=np.full(SHAPE, np.nan)), "24 missing values"),
    "infinite": (dict(ice_content=np.full(SHAPE, np.inf)), "24 missing values"),
    "fill value": (dict(ice_content=np.full(SHAPE, 9.97e36)), "24 missing values"),
    "negative": (dict(ice_content=np.full(SHAPE, -1e-4)), "must lie within 0 to 0.1 kg m-3"),
    "grams": (dict(ice_content=np.full(SHAPE, 0.5)), "g m-3"),
    "micrometres": (dict(ice_effective_radius=np.full(SHAPE, 30.0)), "micrometres"),
    "Celsius": (dict(air_temperature=np.full(SHAPE, 15.0)), "Celsius"),
    "percent": (dict(snow_area_fraction=np.full((3, 4), 60.0)), r"within 0 to 1 \(is it in percent"),
    "misspelt": (dict(liquid_contents=np.zeros(SHAPE)), "did you mean liquid_content"),
    "wrong dimensions": (dict(ice_content=np.zeros((3, 4))), r"must have \(z, y, x\)"),
    "without optics": (dict(extinction_dust=np.zeros(SHAPE)), "needs optics"),
}  # fmt: skip


@pytest.mark.parametrize(("fields", "said"), REFUSED.values(), ids=REFUSED.keys())
def test_refused(fields, said):
    with pytest.raises(UserError, match=said) as caught:
        _scene(**fields)
    assert "\n" not in str(caught.value)


def test_refused_shapes_and_optics():
    with pytest.raises(UserError, match=r"has shape \(2, 3, 5\)"):
        Scene.from_arrays(np.zeros((2, 3, 5)), **AXES)
    with pytest.raises(UserError, match="5 values along x; the grid has 4"):
        Scene(
            Grid(AXES["x_m"], AXES["y_m"], AXES["z_m"]),
            xr.Dataset({"ice_content": (("z", "y", "x"), np.zeros((2, 3, 5)))}),
        )
    with pytest.raises(UserError, match="no field extinction_dust"):
        Scene(_scene().grid, xr.Dataset(), optics={"dust": Optics(1.0, HenyeyGreenstein(0.7))})
    with pytest.raises(UserError, match="within 0 to 1"):
        Optics(1.2, HenyeyGreenstein(0.7))
    for albedo in ({}, {550.0: 1.2}, {0.55: 0.9}, [], None):
        with pytest.raises(UserError, match="optics: single_scattering_albedo"):
            Optics(albedo, HenyeyGreenstein(0.7))
    for phase in ({}, None, {550.0: 0.7}):
        with pytest.raises(UserError, match="optics: phase"):
            Optics(1.0, phase)
    with pytest.raises(UserError, match="optics: angstrom_exponent"):
        Optics(1.0, HenyeyGreenstein(0.7), angstrom_exponent=np.nan)
    with pytest.raises(UserError, match="nothing is given for species cloud"):
        Scene.from_arrays(np.zeros(SHAPE), **AXES, phase={"ice": HenyeyGreenstein(0.7)})
    with pytest.raises(UserError, match="no grid"):
        Scene(None, xr.Dataset({"ice_content": (("z", "y", "x"), np.zeros(SHAPE))}))
    with pytest.raises(UserError, match="without a place"):
        _ = _scene().place


def test_terrain_and_levels_belong_together():
    """Ground may rise through levels, not above them all."""
    axis, levels = np.arange(4.0) * 1e3, np.array([2000.0, 3000.0])
    terrain = np.full((4, 4), 2500.0)
    terrain[0] = 3500.0
    Scene.from_arrays({}, axis, axis, levels, terrain_m=terrain)
    with pytest.raises(UserError, match="500 m above the highest level in most columns"):
        Scene.from_arrays({}, axis, axis, levels, terrain_m=np.full((4, 4), 3500.0))


def test_arrays_with_dimensions_may_have_them_in_any_order():
    """On a cube no shape would tell."""
    axes = {name: np.arange(4) * 100.0 for name in ("x_m", "y_m", "z_m")}
    values = np.zeros((4, 4, 4), np.float32)
    values[1, 2, 3] = 0.01
    turned = xr.DataArray(values, dims=("z", "y", "x")).transpose("y", "x", "z")
    albedo = xr.DataArray(np.arange(16.0).reshape(4, 4) / 16, dims=("y", "x")).transpose("x", "y")
    found = Scene.from_arrays(turned, **axes, fields={"surface_albedo": albedo}).data
    np.testing.assert_array_equal(found.extinction_cloud.values, values)
    np.testing.assert_array_equal(found.surface_albedo.values, np.arange(16.0).reshape(4, 4) / 16)
    levels = xr.DataArray(100.0 * np.arange(64).reshape(4, 4, 4), dims=("z", "y", "x"))
    scene = Scene.from_arrays(turned, **axes | {"z_m": levels.transpose("x", "z", "y")}, surface_albedo=albedo)
    np.testing.assert_array_equal(scene.data.surface_albedo.values, np.arange(16.0).reshape(4, 4) / 16)
    np.testing.assert_array_equal(scene.grid.height_m, levels.values)


def test_a_wavelength_that_is_there_twice_is_refused():
    with pytest.raises(UserError, match=r"wavelengths \[500.0, 500.0\] nm: leave out what is there twice"):
        Scene.from_arrays(np.zeros(SHAPE), **AXES, surface_albedo=np.zeros((*SHAPE[1:], 2)), wavelength_nm=[500, 500])


def test_arrays_on_a_sphere_have_air_and_ground_as_in_a_file():
    """Unless they are told otherwise; flat ones are alone in the dark, as theory wants them."""
    degrees = dict(x_m=np.arange(4) * 0.1, y_m=np.arange(3) * 0.1, z_m=AXES["z_m"])
    bare = Scene.from_arrays(None, **degrees, crs="EPSG:4326", fields={"liquid_content": np.zeros(SHAPE)})
    assert bare.atmosphere is not None
    assert "surface_albedo" not in bare.data
    assert "US standard atmosphere" in " ".join(bare.notes)
    assert "surface albedo, terrain height, land and water: of the ground map" in " ".join(bare.notes)
    assert "default aerosol (optical depth 0.05 at 550 nm above" in " ".join(bare.notes)
    told = Scene.from_arrays(None, **degrees, crs="EPSG:4326", atmosphere=None, surface_albedo=0.0)
    assert told.atmosphere is None
    assert not told.data["surface_albedo"].any()
    flat = Scene.from_arrays(None, **AXES)
    assert flat.atmosphere is None
    assert not flat.data["surface_albedo"].any()
    assert flat.notes == []
