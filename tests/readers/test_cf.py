"""Files in the documented layout as others may write them: units, order, gaps, times, and mistakes."""

from __future__ import annotations

import re
import shutil
import warnings
from pathlib import Path

import netCDF4
import numpy as np
import pytest
import xarray as xr

from openswim.errors import UserError
from openswim.readers import describe, open_scene, states_of
from openswim.readers.common.base import iso
from openswim.scene import Scene
from openswim.scene.labels.units import conversion
from openswim.scene.procedural import demo_scene

LEVELS = np.array([100.0, 600.0, 1500.0])
CONTENT = (np.arange(24.0).reshape(3, 2, 4) * 1e-5).astype("f4")


def _dataset(**changes) -> xr.Dataset:
    fields = {"liquid_content": (("z", "y", "x"), CONTENT, {"units": "kg m-3"})} | changes
    coords = {
        "x": ("x", 500.0 * np.arange(4), {"units": "m"}),
        "y": ("y", 500.0 * np.arange(2), {"units": "m"}),
        "height": ("z", LEVELS, {"units": "m"}),
    }
    return xr.Dataset(fields, coords={name: value for name, value in coords.items() if name not in changes})


def _read(tmp_path, dataset: xr.Dataset, time=None):
    dataset.to_netcdf(tmp_path / "model.nc")
    return open_scene(tmp_path / "model.nc", time)


def test_the_example_of_the_documentation(tmp_path, monkeypatch):
    text = (Path(__file__).resolve().parents[2] / "docs" / "scene-format.md").read_text()
    monkeypatch.chdir(tmp_path)
    exec(re.search(r"```python\n(.*?)```", text, re.DOTALL)[1], {})  # what the reader of the page would run
    scene = open_scene("mymodel.nc")
    assert scene.grid.shape == (5, 40, 50)
    assert float(scene.data.liquid_content.max()) == pytest.approx(3e-4)
    assert scene.time == np.datetime64("2024-06-21T12:00")
    np.testing.assert_allclose(scene.grid.lonlat(0, 0), (10.0, 50.0), atol=1e-9)
    assert any("no ice, rain, snow, graupel in the file" in note for note in scene.notes)


def test_every_variable_is_documented():
    from openswim.scene.variables import VARIABLES

    text = (Path(__file__).resolve().parents[2] / "docs" / "scene-format.md").read_text()
    for name in VARIABLES:
        generic = re.sub("^(liquid|ice|rain|snow|graupel)_(effective_radius|number)$", r"liquid_\2", name)
        assert f"`{generic}`" in text


@pytest.mark.parametrize(
    ("units", "factor"),
    [("kg m-3", 1.0), ("g m-3", 1e-3), ("g/m^3", 1e-3), ("mg m**-3", 1e-6), ("kg/m3", 1.0)],
)
def test_units_of_content(tmp_path, units, factor):
    written = (CONTENT / factor).astype("f8")
    scene = _read(tmp_path, _dataset(liquid_content=(("z", "y", "x"), written, {"units": units})))
    np.testing.assert_allclose(scene.data.liquid_content, CONTENT, rtol=1e-6)


@pytest.mark.parametrize(
    ("found", "expected", "value", "converted"),
    [
        ("hPa", "Pa", 1013.25, 101325.0),
        ("degC", "K", 20.0, 293.15),
        ("\u00b5m", "m", 10.0, 1e-5),
        ("1/cm3", "m-3", 100.0, 1e8),
        ("#/L", "m-3", 3.0, 3000.0),
        ("km-1", "m-1", 20.0, 0.02),
        ("%", "1", 40.0, 0.4),
        ("knots", "m s-1", 10.0, 5.1444),
        ("m/s", "m s-1", 3.0, 3.0),
        ("um", "nm", 0.55, 550.0),
    ],
)
def test_conversions(found, expected, value, converted):
    factor, offset = conversion(found, expected)
    assert factor * value + offset == pytest.approx(converted, rel=1e-4)


def test_whole_numbers_become_fractions(tmp_path):
    data = _dataset(
        cloud_area_fraction=(("z", "y", "x"), np.full(CONTENT.shape, 50, "i1"), {"units": "%"}),
        liquid_effective_radius=(("z", "y", "x"), np.full(CONTENT.shape, 10, "i2"), {"units": "um"}),
        surface_altitude=(("y", "x"), np.full((2, 4), 1, "i1"), {"units": "km"}),
    )
    scene = _read(tmp_path, data)
    np.testing.assert_allclose(scene.data.cloud_area_fraction, 0.5)
    np.testing.assert_allclose(scene.data.liquid_effective_radius, 1e-5)
    np.testing.assert_allclose(scene.data.surface_altitude, 1000.0)


def test_units_that_do_not_convert():
    assert conversion("inHg", "Pa") is None
    assert conversion("kg kg-1", "kg m-3") is None
    assert conversion("m", "K") is None


def test_mixing_ratios_take_the_density_of_air(tmp_path):
    pressure = 800.0 * np.exp(-LEVELS / 8200.0)[:, None, None] + 0 * CONTENT
    state = {
        "air_pressure": (("z", "y", "x"), pressure, {"units": "hPa"}),
        "air_temperature": (("z", "y", "x"), np.full_like(CONTENT, 280.0), {"units": "K"}),
        "ice_number": (("z", "y", "x"), np.full_like(CONTENT, 1e4), {"units": "kg-1"}),
        "liquid_content": (("z", "y", "x"), CONTENT, {"units": "kg kg**-1"}),
    }
    scene = _read(tmp_path, _dataset(**state))
    density = 100.0 * pressure / (287.0 * 280.0)
    np.testing.assert_allclose(scene.data.liquid_content, CONTENT * density, rtol=1e-6)
    np.testing.assert_allclose(scene.data.ice_number, 1e4 * density, rtol=1e-6)
    with pytest.raises(UserError, match="give air_pressure and air_temperature too"):
        _read(tmp_path, _dataset(liquid_content=state["liquid_content"]))


def test_turned_axes_and_orders(tmp_path):
    plain = _read(tmp_path, _dataset())
    upside_down = _dataset().isel(z=slice(None, None, -1), y=slice(None, None, -1)).transpose("x", "y", "z")
    turned = _read(tmp_path, upside_down)
    assert turned.data.identical(plain.data)


def test_terrain_following_heights_in_kilometres(tmp_path):
    heights = LEVELS[:, None, None] + np.array([0.0, 100.0, 200.0, 300.0]) + np.zeros((3, 2, 4))
    data = _dataset(height=(("z", "y", "x"), heights / 1e3, {"units": "km"})).set_coords("height")
    np.testing.assert_allclose(_read(tmp_path, data).grid.height_m, heights, rtol=1e-6)


def test_longitudes_and_latitudes(tmp_path):
    data = _dataset(
        x=("x", 10.0 + 0.25 * np.arange(4), {"units": "degrees_east"}),
        y=("y", [46.0, 45.75], {"units": "degrees_north"}),
    ).set_coords(["x", "y"])
    scene = _read(tmp_path, data)
    np.testing.assert_allclose(scene.grid.lonlat(1, 0), (10.25, 45.75))
    assert any("sphere of 6371 km" in note for note in scene.notes)


@pytest.mark.parametrize("turn", [slice(None), slice(None, None, -1)])
def test_longitudes_over_the_date_line(tmp_path, turn):
    degrees = [179.25, 179.75, -179.75, -179.25]
    data = _dataset(
        x=("x", degrees, {"units": "degrees_east"}), y=("y", [46.0, 45.5], {"units": "degrees_north"})
    ).set_coords(["x", "y"])
    scene = _read(tmp_path, data.isel(x=turn))
    np.testing.assert_allclose(scene.grid.lonlat(np.arange(4), 0)[0], degrees)
    np.testing.assert_allclose(scene.data.liquid_content, CONTENT[:, ::-1])


@pytest.mark.parametrize("gap", [np.nan, -9999.0])
def test_gaps_below_the_terrain_are_filled(tmp_path, gap):
    terrain = np.array([[0.0, 0.0, 700.0, 700.0]] * 2)
    buried = np.broadcast_to(LEVELS[:, None, None] < terrain, CONTENT.shape)
    temperature = np.broadcast_to(np.array([290.0, 285.0, 280.0])[:, None, None], CONTENT.shape)
    fields = {
        "surface_altitude": (("y", "x"), terrain, {"units": "m"}),
        "liquid_content": (("z", "y", "x"), np.where(buried, gap, CONTENT), {"units": "kg m-3"}),
        "air_temperature": (("z", "y", "x"), np.where(buried, gap, temperature), {"units": "K"}),
    }
    scene = _read(tmp_path, _dataset(**fields))
    np.testing.assert_allclose(scene.data.liquid_content, np.where(buried, 0.0, CONTENT), rtol=1e-6)
    np.testing.assert_allclose(scene.data.air_temperature, np.where(buried, 280.0, temperature))
    assert any("liquid_content: 8 missing values below the terrain" in note for note in scene.notes)
    with pytest.raises(UserError, match=r"liquid_content (has 8 missing values|runs from -9999)"):
        _read(tmp_path, _dataset(liquid_content=fields["liquid_content"]))


def test_several_times(tmp_path):
    times = np.array(["2024-06-21T12:00", "2024-06-21T18:00"], "datetime64[ns]")
    content = np.stack([CONTENT, 2 * CONTENT])
    data = _dataset(liquid_content=(("time", "z", "y", "x"), content, {"units": "kg m-3"})).assign_coords(
        time=times
    )
    assert float(_read(tmp_path, data).data.liquid_content.max()) == pytest.approx(CONTENT.max())
    later = _read(tmp_path, data, "2024-06-21T18:00Z")
    assert later.time == np.datetime64("2024-06-21T18:00")
    np.testing.assert_allclose(later.data.liquid_content, 2 * CONTENT, rtol=1e-6)
    assert describe(tmp_path / "model.nc").times == ["2024-06-21T12:00:00", "2024-06-21T18:00:00"]
    with pytest.raises(
        UserError, match="no time 2024-06-21T13:00:00 in it; it has 2024-06-21T12:00:00, 2024"
    ):
        open_scene(tmp_path / "model.nc", "2024-06-21T13:00")


@pytest.mark.parametrize("position", [0, 1])
def test_a_time_that_is_missing_among_others(tmp_path, position):
    times = np.insert(np.array(["2024-06-21T12:00", "2024-06-21T18:00"], "datetime64[ns]"), position, "NaT")
    data = _dataset(liquid_content=(("time", "z", "y", "x"), np.stack(3 * [CONTENT]), {"units": "kg m-3"}))
    data = data.assign_coords(time=times)
    scene = _read(tmp_path, data)
    assert scene.time == np.datetime64("2024-06-21T12:00")
    assert any("1 of 3 times are missing" in note for note in scene.notes) == (position == 0)  # another than the first
    named = open_scene(tmp_path / "model.nc", "2024-06-21T18:00")
    assert named.time == np.datetime64("2024-06-21T18:00")
    assert not any("times are missing" in note for note in named.notes)
    assert describe(tmp_path / "model.nc").times == ["2024-06-21T12:00:00", "2024-06-21T18:00:00"]


@pytest.mark.parametrize("kind", ["nc", "zarr"])
def test_a_series_is_looked_through_for_its_times_alone(tmp_path, kind):
    """Of files with two times and one that is missing, those that are known; what is wrong with times is said."""
    paths = [tmp_path / f"{n}.{kind}" for n in range(2)]
    for day, path in enumerate(paths):
        times = np.array(["2024-06-21T12:00", "NaT", "2024-06-21T18:00"], "datetime64[ns]") + np.timedelta64(day, "D")
        data = _dataset(liquid_content=(("time", "z", "y", "x"), np.stack(3 * [CONTENT]), {"units": "kg m-3"}))
        data = data.assign_coords(time=times)
        data.to_zarr(path, zarr_format=2) if kind == "zarr" else data.to_netcdf(path)
    states = states_of(paths)
    assert [files for _, files in states] == [paths[:1], paths[:1], paths[1:], paths[1:]]
    assert [str(time) for time, _ in states][1::2] == ["2024-06-21T18:00:00.000", "2024-06-22T18:00:00.000"]
    assert [iso(time) for time, _ in states] == sorted(each for path in paths for each in describe(path).times)
    for attributes, said in (({"openswim_layout": 99}, "newer than this program's"), ({}, "time is not a date")):
        other = data.assign_attrs(attributes).assign_coords(time=[1.0, 2.0, 3.0])
        name = tmp_path / f"{len(attributes)}.other.{kind}"
        other.to_zarr(name, zarr_format=2) if kind == "zarr" else other.to_netcdf(name)
        with pytest.raises(UserError, match=f"{name.name}: .*{said}"):
            states_of([*paths, name])


def test_a_scene_without_time_has_the_one_asked_for(tmp_path):
    data = _dataset(liquid_content=(("z", "y", "x"), CONTENT))
    assert _read(tmp_path, data).time is None
    assert _read(tmp_path, data, "2024-06-21T18:00Z").time == np.datetime64("2024-06-21T18:00")


def test_notes_tell_what_is_assumed(tmp_path):
    data = _dataset(liquid_content=(("z", "y", "x"), CONTENT), cloud_cover=(("y", "x"), np.zeros((2, 4))))
    notes = " | ".join(_read(tmp_path, data).notes)
    assert "liquid_content gives no units: taken as kg m-3" in notes
    assert "not used: cloud_cover" in notes
    assert "no surface_albedo" in notes
    assert "US standard atmosphere with the default aerosol" in notes
    text = str(describe(tmp_path / "model.nc"))
    for said in ("4 x 2 x 3", "none (flat)", "500 x 500 m", "liquid", "ice_content", "100 to 1500 m"):
        assert said in text


def test_background_aerosol_by_hand(tmp_path):
    data = _dataset(aerosol_background=((), 0, {"optical_depth": 0.4, "single_scattering_albedo": 0.9}))
    scene = _read(tmp_path, data)
    assert scene.atmosphere.aerosol.optical_depth == 0.4
    assert scene.atmosphere.aerosol.single_scattering_albedo == 0.9
    data.attrs["atmosphere"] = "none"
    assert _read(tmp_path, data).atmosphere is None
    data.attrs["atmosphere"] = "mars"
    with pytest.raises(UserError, match="attribute atmosphere is 'mars'"):
        _read(tmp_path, data)


def _set(name, **attributes):
    def change(data):
        data[name].attrs |= attributes
        return data

    return change


def _with_smoke(**attributes):
    return lambda data: data.assign(
        extinction_smoke=data.liquid_content.assign_attrs(units="m-1", **attributes)
    )


def _with_background(**attributes):
    return lambda data: data.assign(aerosol_background=((), 0, attributes))


HG = '{"type": "henyey_greenstein", "g": 0.7}'
PYTHONS_WORDS = "could not convert|object (has no|is not)|not supported between|argument of type|invalid literal|^'"
WRONG = {
    "units": (
        _set("liquid_content", units="furlong"),
        "liquid_content is in 'furlong'; it must be in 'kg m-3'",
    ),
    "height units": (_set("height", units="hPa"), "coordinate height is in 'hPa'"),
    "no heights": (lambda data: data.drop_vars("height"), "coordinate height is missing"),
    "no x": (lambda data: data.drop_vars("x"), "coordinate x is missing"),
    "uneven x": (lambda data: data.assign_coords(x=[0.0, 1.0, 2.0, 4.0]), "even steps"),
    "heights on the wrong dimensions": (
        lambda data: data.assign_coords(height=(("z", "x"), np.ones((3, 4)))),
        "coordinate height has dimensions",
    ),
    "uneven levels": (lambda data: data.assign_coords(height=("z", [0.0, 2000.0, 1000.0])), "ascend"),
    "missing values": (lambda data: data.where(data.x > 0), "liquid_content has 6 missing values"),
    "text for heights": (
        lambda data: data.assign_coords(height=("z", ["low", "middle", "high"])),
        "model.*: height holds text: write it as numbers",
    ),
    "text for a field": (
        lambda data: data.assign(liquid_content=(("z", "y", "x"), np.full((3, 2, 4), "text"))),
        "liquid_content holds text: write it as numbers",
    ),
    "flat field": (
        lambda data: data.assign(ice_content=data.liquid_content[0]),
        r"ice_content has dimensions \(y, x\)",
    ),
    "grid mapping": (
        lambda data: data.assign(crs=((), 0, {"grid_mapping_name": "flat_earth"})),
        "grid mapping crs is not understood",
    ),
    "no phase function": (_with_smoke(), "extinction_smoke lacks the attribute phase_function"),
    "phase function": (_with_smoke(phase_function="{g = 0.7}"), "not JSON"),
    "phase function of no kind": (_with_smoke(phase_function="0.7"), "phase function 0.7 is not understood"),
    "asymmetry": (_with_smoke(phase_function=HG.replace("0.7", '"a"')), "extinction_smoke: phase function"),
    "kind": (_with_smoke(phase_function=HG, kind="liqiud"), "extinction_smoke: optics: kind 'liqiud' is unknown"),
    "albedo's wavelengths": (
        _with_smoke(phase_function=HG, single_scattering_albedo='{"blue": 1}'),
        "single_scattering_albedo must have wavelengths in nanometres, got blue",
    ),
    "radius": (lambda data: data.assign_attrs(earth_radius_m="large"), "earth_radius_m must be a number"),
    "periodic sides": (lambda data: data.assign_attrs(periodic_sides="ture"), "periodic_sides is 'ture'"),
    "no albedo": (
        _with_smoke(phase_function=HG, single_scattering_albedo="{}"),
        "extinction_smoke: optics: single_scattering_albedo must have wavelengths",
    ),
    "no phase functions": (_with_smoke(phase_function='{"spectral": {}}'), "extinction_smoke: optics: phase"),
    "Angstrom exponent": (
        _with_smoke(phase_function=HG, angstrom_exponent=np.nan),
        "extinction_smoke: optics: angstrom_exponent must be a number",
    ),
    "background's albedo": (
        _with_background(single_scattering_albedo=3.0),
        "aerosol_background: aerosol single_scattering_albedo must be a number within 0 to 1",
    ),
    "background's exponent": (
        _with_background(angstrom_exponent="null"),
        "aerosol_background: aerosol angstrom_exponent must be a number",
    ),
    "background's phase": (
        _with_background(phase='{"spectral": {}}'),
        "aerosol_background: aerosol phase must have wavelengths",
    ),
    "background's spectrum": (
        _with_background(phase='{"spectral": 3}'),
        "aerosol_background: unknown phase function type None: choose one of",
    ),
    "half a profile": (
        lambda data: data.assign(profile_height=("profile", [0.0, 1e5])),
        "lacks profile_pressure",
    ),
    "newer layout": (lambda data: data.assign_attrs(openswim_layout=99), "newer"),
}


@pytest.mark.parametrize("engine", ["netcdf", "zarr"])
@pytest.mark.parametrize(("change", "said"), WRONG.values(), ids=WRONG.keys())
def test_wrong_files(tmp_path, engine, change, said):
    path, data = tmp_path / "model", change(_dataset())
    if engine == "zarr":
        data.to_zarr(path, zarr_format=2, consolidated=True)
    else:
        data.to_netcdf(path)
    with pytest.raises(UserError, match=said) as caught:
        open_scene(path)
    assert str(caught.value).count(str(path)) == 1
    assert "\n" not in str(caught.value)
    assert not re.search(PYTHONS_WORDS, str(caught.value))


def test_ground_far_below_the_lowest_level_is_told(tmp_path):
    data = _dataset(surface_altitude=(("y", "x"), np.full((2, 4), -0.9), {"units": "km"}))
    said = f"the lowest level is {LEVELS[0] + 900:.0f} m above the ground: nothing is known of what is between"
    assert said in _read(tmp_path, data).notes
    assert said in describe(tmp_path / "model.nc").assumed


def test_misspelt_attributes_are_told(tmp_path):
    data = _with_smoke(phase_function=HG, knid="liquid")(_dataset()).assign_attrs(periodic_side=1)
    notes = _read(tmp_path, data).notes
    assert "attribute periodic_side is not used: is periodic_sides meant?" in notes
    assert "extinction_smoke: attribute knid is not used: is kind meant?" in notes


def test_not_scenes_at_all(tmp_path):
    (tmp_path / "empty").touch()
    (tmp_path / "text.nc").write_text("this is not netCDF")
    (tmp_path / "folder").mkdir()
    (tmp_path / "folder" / "zarr.json").write_text("{broken")
    (tmp_path / "plain").mkdir()
    xr.Dataset({"t2m": (("lat", "lon"), np.zeros((2, 2)))}).to_netcdf(tmp_path / "other.nc")
    said = {
        "missing.nc": "no such file",
        "empty": "empty: copy or download",
        "text.nc": "no file of weather: netCDF",
        "folder": "cannot be opened|not a Zarr",
        "plain": "not a Zarr",
        "other.nc": "holds t2m",
    }
    for name, words in said.items():
        with pytest.raises(UserError, match=words) as caught:
            open_scene(tmp_path / name)
        assert name in str(caught.value)


def test_truncated_netcdf(tmp_path):
    _read(tmp_path, _dataset())
    path = tmp_path / "model.nc"
    path.write_bytes(path.read_bytes()[:-500])
    with pytest.raises(UserError, match=r"model\.nc: truncated or damaged"):
        open_scene(path)


@pytest.mark.parametrize("consolidated", [True, False])
@pytest.mark.parametrize("zarr_format", [2, 3])
def test_zarr_of_both_formats_opens_without_a_warning(tmp_path, zarr_format, consolidated):
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # format 3 has no standard for consolidated metadata yet
        _dataset(liquid_content=(("z", "y", "x"), CONTENT, {"units": "kg m-3"})).to_zarr(
            tmp_path / "model.zarr", zarr_format=zarr_format, consolidated=consolidated
        )
    assert open_scene(tmp_path / "model.zarr").species == ["liquid"]


def test_a_lost_piece_of_zarr_is_noticed(tmp_path):
    scene = _read(tmp_path, _dataset())
    scene.to_zarr(tmp_path / "scene.zarr")
    assert open_scene(tmp_path / "scene.zarr").data.identical(scene.data)
    shutil.rmtree(tmp_path / "scene.zarr" / "liquid_content" / "0", ignore_errors=True)
    for piece in (tmp_path / "scene.zarr" / "liquid_content").glob("[0-9]*"):
        piece.unlink()
    with pytest.raises(UserError, match="liquid_content has 24 missing values"):
        open_scene(tmp_path / "scene.zarr")


def test_absurd_sizes_are_refused_before_reading(tmp_path):
    path = tmp_path / "huge.nc"
    with netCDF4.Dataset(path, "w") as file:
        for name, size in dict(x=60_000, y=60_000, z=100).items():
            file.createDimension(name, size)
        file.createVariable("liquid_content", "f4", ("z", "y", "x"), zlib=True, chunksizes=(1, 1000, 1000))
        file.createVariable("height", "f4", ("z",))[:] = np.arange(100)
        for name in "xy":
            file.createVariable(name, "f8", (name,))[:] = np.arange(60_000)
    with pytest.raises(UserError, match=r"declares 1.4e\+03 GB of values in a file of 0.97 MB"):
        open_scene(path)


def test_readers_of_other_packages_come_first(tmp_path, monkeypatch):
    """An entry point of the group openswim.readers is asked before the built-in readers."""
    from importlib import metadata

    from openswim import readers

    class Texts:
        name = "texts"

        def detects(self, path):
            return path.suffix == ".txt"

        def read(self, path, time=None):
            scene = Scene.clear(0.0, 0.0)
            scene.source = f"read {path.name} at {time}"
            return scene

        def describe(self, path):
            return "a text"

    class Entry:
        def load(self):
            return Texts

    monkeypatch.setattr(
        metadata, "entry_points", lambda group: [Entry()] if group == "openswim.readers" else []
    )
    readers.readers.cache_clear()
    (tmp_path / "scene.txt").write_text("clouds")
    try:
        assert open_scene(tmp_path / "scene.txt", "now").source == "read scene.txt at now"
        assert readers.readers()[0].name == "texts"
    finally:
        readers.readers.cache_clear()


def test_fields_that_others_name_as_coordinates_are_read(tmp_path):
    data = _dataset(rain_content=(("z", "y", "x"), 0.5 * CONTENT, {"units": "kg m-3"}))
    data.liquid_content.attrs["coordinates"] = "rain_content"
    assert float(_read(tmp_path, data).data.rain_content.max()) == pytest.approx(0.5 * CONTENT.max())


def test_a_field_that_was_written_and_is_gone_is_told(tmp_path):
    """The file itself says what it was written with; a scene that goes to a file and back is told nothing."""
    scene = demo_scene(16, 16, 16)
    scene.to_netcdf(tmp_path / "a.nc")
    assert not any("any more" in note for note in open_scene(tmp_path / "a.nc").notes)
    with xr.open_dataset(tmp_path / "a.nc", decode_cf=False) as whole:
        whole.drop_vars(["surface_albedo", "ice_content"], errors="ignore").to_netcdf(tmp_path / "b.nc")
    told = [note for note in open_scene(tmp_path / "b.nc").notes if "any more" in note]
    assert len(told) == 1
    assert "surface_albedo" in told[0]
    assert told[0] in describe(tmp_path / "b.nc").assumed


def test_without_a_time_the_earliest_is_taken(tmp_path):
    scene = demo_scene(16, 16, 16)
    later, earlier = np.datetime64("2024-06-21T15", "ns"), np.datetime64("2024-06-21T12", "ns")
    data = xr.concat([scene.to_dataset().drop_vars("time").assign_coords(time=t) for t in (later, earlier)], "time",
                     data_vars="all")  # fmt: skip
    data.to_netcdf(tmp_path / "a.nc")
    assert open_scene(tmp_path / "a.nc").time == earlier
