"""Which member of an ensemble, which pieces of a store, which variables: what was taken or lost is told."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import xarray as xr
from tests.readers.grib_files import hrrr, write
from tests.readers.model_files import era5

from openswim.errors import UserError
from openswim.readers import describe, members_of, open_scene


@pytest.fixture
def analysis(tmp_path: Path) -> xr.Dataset:
    with xr.open_dataset(era5(tmp_path / "a.nc", new=True).paths[0], decode_cf=False) as data:
        data = data.drop_vars(["expver", "number"]).load()
    for field in data.variables.values():
        field.encoding = {}
    return data


@pytest.fixture
def ensemble(analysis: xr.Dataset, tmp_path: Path) -> Path:
    """Three members, numbered 5, 7 and 9, with once, twice and three times the liquid."""
    members = [analysis.assign(clwc=(n * analysis.clwc).assign_attrs(analysis.clwc.attrs)) for n in (1, 2, 3)]
    joined = xr.concat(members, xr.DataArray([5, 7, 9], dims="number", name="number"), data_vars=["clwc"])
    joined.to_netcdf(tmp_path / "ensemble.nc")
    return tmp_path / "ensemble.nc"


def test_an_ensemble_says_which_member_it_shows(ensemble):
    first = open_scene(ensemble)
    assert any("3 ensemble members in the file (5, 7, 9): 5 is shown" in note for note in first.notes)
    assert any("5 is shown" in note for note in describe(ensemble).assumed)
    third = open_scene(ensemble, member=9)
    assert not any("ensemble" in note for note in third.notes)
    np.testing.assert_allclose(third.data.liquid_content, 3 * first.data.liquid_content, rtol=1e-5)


def test_members_that_are_not_there(ensemble, tmp_path):
    with pytest.raises(UserError, match="no ensemble member 6 in it; it has 5, 7, 9"):
        open_scene(ensemble, member=6)
    with pytest.raises(UserError, match="leave out member"):
        open_scene(era5(tmp_path / "one.nc", new=True).paths[0], member=1)


@pytest.mark.parametrize("dim", [None, "number", "ens"])
def test_each_member_in_a_file_of_its_own(analysis, tmp_path, dim):
    """By a number beside the fields or by a dimension of one; all files are named, as a pattern names them."""
    for number in (0, 2, 7):
        data = analysis.assign(clwc=((1 + number) * analysis.clwc).assign_attrs(analysis.clwc.attrs))
        data = data.assign_coords(number=number) if dim is None else data.expand_dims({dim: [number]})
        data.to_netcdf(tmp_path / f"member_{number}.nc")
    every = tmp_path / "member_*.nc"
    assert members_of(every) == [0, 2, 7]
    first = open_scene(every)
    assert any("3 ensemble members in the file (0, 2, 7): 0 is shown" in note for note in first.notes)
    np.testing.assert_allclose(
        open_scene(every, member=7).data.liquid_content, 8 * first.data.liquid_content, rtol=1e-5
    )
    with pytest.raises(UserError, match="no ensemble member 1 in it; it has 0, 2, 7"):
        open_scene(every, member=1)


def test_files_of_one_time_that_do_not_say_which_member_they_are(analysis, tmp_path):
    """They were taken for one state, the first file's; copies of one state still are."""
    for name, factor in (("a.nc", 1.0), ("b.nc", 2.0), ("copy.nc", 1.0)):
        more = (factor * analysis.clwc).assign_attrs(analysis.clwc.attrs)
        analysis.assign(clwc=more).to_netcdf(tmp_path / name)
    with pytest.raises(UserError, match=r"a.nc and .*b.nc both hold cc, ciwc, clwc at 20.*: open one of them"):
        open_scene([tmp_path / "a.nc", tmp_path / "b.nc"])
    open_scene([tmp_path / "a.nc", tmp_path / "copy.nc"])


def test_members_whose_numbers_are_written_as_text(analysis, tmp_path):
    for name, numbers in (("text.nc", ["03", "11"]), ("named.nc", ["r1", "r2"])):
        xr.concat([analysis] * 2, xr.DataArray(numbers, dims="member", name="member")).to_netcdf(tmp_path / name)
    assert members_of(tmp_path / "text.nc") == [3, 11]
    assert open_scene(tmp_path / "text.nc", member=11).source.endswith("member 11")
    with pytest.raises(UserError, match="member has r1"):
        open_scene(tmp_path / "named.nc", member=1)


def test_a_dimension_that_nobody_knows_is_named(analysis, tmp_path):
    """Members along `ensemble_member` are known; along a name of the writer's own they are not."""
    for dim, name in (("ensemble_member", "a.nc"), ("run_of_mine", "b.nc")):
        xr.concat([analysis] * 2, xr.DataArray([1, 2], dims=dim, name=dim)).to_netcdf(tmp_path / name)
    assert members_of(tmp_path / "a.nc") == [1, 2]
    with pytest.raises(UserError, match=r"b.nc: \w+ lies along more than levels.* run_of_mine \(2\)"):
        open_scene(tmp_path / "b.nc")


def test_all_members_are_known_without_counting(ensemble, analysis, tmp_path):
    assert members_of(ensemble) == [5, 7, 9]
    assert open_scene(ensemble, member=9).source.endswith(", member 9")
    alone = era5(tmp_path / "one.nc", new=True).paths[0]  # with a number, but of no dimension
    assert members_of(alone) == []
    named = xr.concat([analysis, analysis], xr.DataArray(["r1", "r2"], dims="realization", name="realization"))
    named.to_netcdf(tmp_path / "named.nc")
    with pytest.raises(UserError, match="realization has r1"):
        members_of(tmp_path / "named.nc")


def test_all_members_of_a_file_of_messages(tmp_path):
    pytest.importorskip("eccodes")
    product = hrrr(levels=2)
    assert members_of(write(tmp_path / "one.grib2", product)) == []
    product.messages = [
        replace(one, keys={"productDefinitionTemplateNumber": 1, "perturbationNumber": number} | one.keys)
        for number in (8, 3) for one in product.messages
    ]  # fmt: skip
    assert members_of(write(tmp_path / "two.grib2", product)) == [3, 8]


def test_a_member_has_its_own_ground_and_what_all_share(tmp_path):
    """Snow of the control run that stands before its own is not its; terrain and heights that come once, are."""
    pytest.importorskip("eccodes")
    product = hrrr(levels=2)
    plain = product.messages

    def of(number, messages, snow):
        keys = {"productDefinitionTemplateNumber": 1, "perturbationNumber": number}
        return [
            replace(one, keys=keys | one.keys, values=lambda lat, lon: snow) if one.parameter == (0, 1, 42)
            else replace(one, keys=keys | one.keys) for one in messages
        ]  # fmt: skip

    product.messages = of(0, plain, 10.0) + of(4, plain, 90.0)
    both = write(tmp_path / "both.grib2", product)
    for number, snow in ((0, 0.1), (4, 0.9)):
        np.testing.assert_allclose(open_scene(both, member=number).data.snow_area_fraction, snow, atol=1e-6)
    placed = [one for one in plain if one.parameter == (0, 3, 5)]
    rest = [one for one in plain if one.parameter != (0, 3, 5)]
    product.messages = placed + of(1, rest, 25.0) + of(4, rest, 25.0)
    shared = write(tmp_path / "shared.grib2", product)
    assert members_of(shared) == [1, 4]
    for scene in (open_scene(shared), open_scene(shared, member=4)):
        np.testing.assert_array_equal(scene.grid.height_m, open_scene(both).grid.height_m)


def test_messages_of_each_member_in_a_file_of_its_own(tmp_path):
    """The control run, whose number is 0, is one of them."""
    pytest.importorskip("eccodes")
    product = hrrr(levels=2)
    plain = product.messages
    for number in (0, 4):
        keys = {"productDefinitionTemplateNumber": 1, "perturbationNumber": number}
        product.messages = [replace(one, keys=keys | one.keys) for one in plain]
        write(tmp_path / f"member_{number}.grib2", product)
    every = tmp_path / "member_*.grib2"
    assert members_of(every) == [0, 4]
    for number in (0, 4):
        assert open_scene(every, member=number).source.startswith(f"member_{number}.grib2")


def test_a_member_of_a_file_in_the_layout(tmp_path):
    from openswim.scene.procedural import demo_scene

    data = demo_scene(16, 16, 16).to_dataset()
    clear = data.assign(liquid_content=0 * data.liquid_content)
    joined = xr.concat([data, clear], "member", data_vars=["liquid_content"])
    joined.to_netcdf(tmp_path / "scene.nc")
    assert open_scene(tmp_path / "scene.nc").data.liquid_content.any()
    assert not open_scene(tmp_path / "scene.nc", member=1).data.liquid_content.any()


@pytest.mark.parametrize("zarr_format", [2, 3])
def test_a_store_that_lost_its_clock(analysis, tmp_path, zarr_format):
    analysis.to_zarr(tmp_path / "a.zarr", zarr_format=zarr_format, consolidated=False)
    chunk = tmp_path / "a.zarr" / "valid_time" / ("0" if zarr_format == 2 else "c/0")
    assert open_scene(tmp_path / "a.zarr").time == np.datetime64("2024-06-21T12:00")
    chunk.unlink()
    with pytest.raises(UserError, match="valid_time are not in the store"):
        open_scene(tmp_path / "a.zarr")


@pytest.mark.parametrize("zarr_format", [2, 3])
def test_a_store_that_lost_a_piece_of_its_cloud(analysis, tmp_path, zarr_format):
    """Fields whose fill is NaN are refused; where there is none, zeros are read and the loss is told."""
    analysis.clwc.attrs.pop("_FillValue")
    for fill, said in ((np.float32(np.nan), None), (None, "clwc: 1 of 3 pieces are not in the store")):
        store = tmp_path / f"{fill}.zarr"
        packed = {"clwc": {"chunks": (1, 4, *analysis.clwc.shape[-2:]), "_FillValue": fill}}
        analysis.to_zarr(store, zarr_format=zarr_format, encoding=packed, consolidated=False)
        (store / "clwc" / ("0.1.0.0" if zarr_format == 2 else "c/0/1/0/0")).unlink()
        if said is None or zarr_format == 3:  # whose zero fill is a missing value, too
            with pytest.raises(UserError, match="clwc"):
                open_scene(store)
        else:
            assert any(said in note for note in open_scene(store).notes)


@pytest.mark.parametrize("dims", [("level", "y", "x"), ("level", "lat", "lon")])
def test_the_layout_on_dimensions_of_other_names(tmp_path, dims):
    """Numbers and radii come along, and what cannot is named."""
    nz, ny, nx = 12, 5, 6
    height = np.linspace(50.0, 9000.0, nz)
    cloud = np.broadcast_to(np.where(abs(height - 2e3) < 900, 2e-4, 0.0)[:, None, None], (nz, ny, nx))
    level = dims[0]
    if dims[1] == "lat":
        axes = {"lat": 45 + 0.1 * np.arange(ny), "lon": 7 + 0.1 * np.arange(nx)}
        units = {"lat": "degrees_north", "lon": "degrees_east"}
    else:
        axes, units = {"y": 500.0 * np.arange(ny), "x": 500.0 * np.arange(nx)}, {"y": "m", "x": "m"}
    data = xr.Dataset(
        {
            "liquid_content": (dims, cloud, {"units": "kg m-3"}),
            "liquid_number": (dims, np.where(cloud > 0, 3e8, 0.0), {"units": "m-3"}),
            "extinction_haze": (dims, 0 * cloud, {"units": "m-1"}),
        },
        coords={"height": (level, height, {"units": "m", "standard_name": "altitude"})}
        | {name: (name, axis, {"units": units[name]}) for name, axis in axes.items()},
    )
    data.to_netcdf(tmp_path / "other.nc")
    scene = open_scene(tmp_path / "other.nc")
    np.testing.assert_allclose(scene.data.liquid_number, np.where(cloud > 0, 3e8, 0.0), rtol=1e-5)
    assert any("not used: extinction_haze" in note for note in scene.notes)


def test_what_a_file_says_of_itself_may_be_endless(analysis, tmp_path):
    """A unit of ten megabytes does not fill the terminal."""
    analysis.t.attrs["units"] = "x y\n" * 2_500_000
    analysis.clwc.attrs["units"] = "kg kg**-1"
    analysis.valid_time.attrs["units"] = "x\n" * 1_000_000
    analysis.to_netcdf(tmp_path / "long.nc")
    with pytest.raises(UserError) as caught:
        open_scene(tmp_path / "long.nc")
    assert "long.nc" in str(caught.value)
    assert len(str(caught.value)) < 800
    assert "\n" not in str(caught.value)


def test_real_files_pass_the_gate(nwp):
    """Each file of each model, but for one of reflectivity alone; none is told to be odd."""
    odd = ("is it in", "disagree", "times as warm", "next to nothing", "same unit", "damaged")
    for path in sorted([*nwp.glob("*.*"), *nwp.glob("hrrr2d/*")]):
        if path.is_file() and "REFC" not in path.name:
            assert [note for note in open_scene(path).notes if any(text in note for text in odd)] == [], path.name
