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
