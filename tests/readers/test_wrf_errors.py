"""Bad WRF files: one line that names the file, what is wrong, and what to do."""

from __future__ import annotations

import netCDF4
import numpy as np
import pytest

from openswim.errors import UserError
from openswim.readers import open_scene


def _error(path, time=None) -> str:
    with pytest.raises(UserError) as caught:
        open_scene(path, time)
    message = str(caught.value)
    assert "\n" not in message
    assert str(path) in message
    assert message.count(str(path)) == 1
    return message


def _nan(values):
    values[0, 0, 2, 2] = np.nan
    return values


def _fill(values):
    values[0, 0, 2, 2] = 1e20
    return values


def _wavy(lat):
    return lat + 0.02 * np.sin(np.arange(lat.shape[2]))


BAD = {
    "missing variables": (dict(drop=("PB", "T")), ["PB, T", "keep these variables"]),
    "NaN": (dict(change={"QCLOUD": _nan}), ["QCLOUD has 1 missing value"]),
    "fill values": (dict(change={"T": _fill}), ["T has 1 missing value"]),
    "NaN coordinates": (dict(change={"XLAT": lambda lat: lat * np.nan}), ["XLAT has 42 missing"]),
    "units": (dict(units={"QCLOUD": "g kg-1"}), ["QCLOUD is in 'g kg-1'", "'kg kg-1'"]),
    "pressure in hPa": (dict(units={"P": "hPa"}), ["P is in 'hPa'", "'Pa'"]),
    "grams without saying so": (
        dict(change={"QCLOUD": lambda q: 1000 * q}),
        ["QCLOUD", "0.1 kg kg-1", "g/kg"],
    ),
    "negative water": (dict(change={"QCLOUD": lambda q: -q}), ["QCLOUD runs from -0.001"]),
    "negative pressure": (dict(change={"PB": lambda p: -p}), ["P + PB"]),
    "levels upside down": (dict(change={"PHB": lambda phb: phb[:, ::-1]}), ["ascend"]),
    "no projection": (dict(attributes=dict(MAP_PROJ=None)), ["MAP_PROJ"]),
    "unknown projection": (dict(attributes=dict(MAP_PROJ=17)), ["MAP_PROJ is 17"]),
    "no true latitude": (dict(attributes=dict(TRUELAT1=None)), ["TRUELAT1"]),
    "no spacing": (dict(map_proj=0, attributes=dict(DX=None)), ["DX"]),
    "not the grid of the attributes": (dict(change={"XLAT": _wavy}), ["XLAT/XLONG lie up to", "STAND_LON"]),
    "cropped without coordinates": (
        dict(
            drop=("XLAT", "XLONG"),
            attributes={"WEST-EAST_GRID_DIMENSION": 97, "SOUTH-NORTH_GRID_DIMENSION": 97},
        ),
        ["keep XLAT and XLONG"],
    ),
    "garbled times": (dict(times=("not-a-date-at-all!!",)), ["Times holds 'not-a-date"]),
    "albedo in percent": (
        dict(extra={"ALBEDO": (("south_north", "west_east"), np.full((6, 7), 30.0), "-")}),
        ["surface_albedo", "percent"],
    ),
}


@pytest.mark.filterwarnings("ignore:invalid value")
@pytest.mark.parametrize(("spec", "said"), BAD.values(), ids=BAD.keys())
def test_bad_contents(wrf_file, spec, said):
    message = _error(wrf_file(**spec))
    for words in said:
        assert words in message


@pytest.mark.parametrize(
    ("name", "value", "said"),
    [
        ("DX", "abc", "DX is missing or not a number"),
        ("MAP_PROJ", "abc", "MAP_PROJ is missing or not a number"),
        ("TRUELAT1", 95.0, "TRUELAT2, MOAD_CEN_LAT and STAND_LON make no map"),
    ],
)
def test_attributes_that_make_no_map(wrf_file, name, value, said):
    path = wrf_file(map_proj=3)
    with netCDF4.Dataset(path, "a") as file:
        file.setncattr(name, value)
    assert said in _error(path)


def test_time_not_in_the_file_lists_those_that_are(wrf_file):
    message = _error(wrf_file(), "2005-08-28T13:00")
    assert "2005-08-28T12:00:00, 2005-08-28T15:00:00" in message


def test_time_not_understood(wrf_file):
    with pytest.raises(UserError, match=r"'yesterday' is not understood: write it as 2005-08-28T18:00"):
        open_scene(wrf_file(), "yesterday")


def test_wrong_dimensions(wrf_file):
    path = wrf_file(drop=("QCLOUD",))
    with netCDF4.Dataset(path, "a") as file:
        file.createVariable("QCLOUD", "f4", ("Time", "south_north", "west_east"))[:] = 0.0
    message = _error(path)
    assert "QCLOUD has dimensions (Time, south_north, west_east)" in message
    assert "bottom_top" in message


@pytest.mark.parametrize(
    "layout", ["NETCDF3_CLASSIC", "NETCDF3_64BIT_OFFSET", "NETCDF3_64BIT_DATA", "NETCDF4"]
)
@pytest.mark.parametrize("kept", [0.98, 0.6, 0.1, 0.004])
def test_truncated(wrf_file, layout, kept):
    """The netCDF library itself reads what is cut off from a classic file as zeros."""
    path = wrf_file(format=layout, times=("2005-08-28_12:00:00",))
    whole = path.read_bytes()
    path.write_bytes(whole[: int(kept * len(whole))])
    message = _error(path)
    assert "truncated" in message
    assert "copy or download it again" in message


def test_damaged_inside(wrf_file):
    """Checksummed data overwritten in the middle of a file that still opens."""
    path = wrf_file(drop=("QCLOUD",))
    with netCDF4.Dataset(path, "a") as file:
        cloud = file.createVariable(
            "QCLOUD", "f4", ("Time", "bottom_top", "south_north", "west_east"), fletcher32=True
        )
        cloud.units = "kg kg-1"
        cloud[:] = np.float32(1.2345e-4)
    written = np.full(20, 1.2345e-4, "f4").tobytes()
    content = path.read_bytes()
    assert written in content
    path.write_bytes(content.replace(written, bytes(len(written)), 1))
    assert "QCLOUD cannot be read" in _error(path)


def test_absurd_sizes_are_refused_before_reading(tmp_path):
    """Sixty thousand squared by a hundred levels, declared but never written: a file of a few kilobytes."""
    path = tmp_path / "wrfout_huge"
    with netCDF4.Dataset(path, "w") as file:
        sizes = dict(Time=1, west_east=60_000, south_north=60_000, bottom_top=100, bottom_top_stag=101)
        for name, size in sizes.items():
            file.createDimension(name, size)
        file.setncatts({"TITLE": "OUTPUT FROM WRF V4", "MAP_PROJ": 1, "START_DATE": "2005-08-28_12:00:00"})
        for name in ("PH", "PHB", "P", "PB", "T"):
            level = "bottom_top_stag" if name.startswith("PH") else "bottom_top"
            dims = ("Time", level, "south_north", "west_east")
            file.createVariable(name, "f4", dims, zlib=True, chunksizes=(1, 1, 1000, 1000))
    message = _error(path)
    assert "declares 7.2e+03 GB of values in a file of 0.013 MB" in message


def test_nothing_written_yet(tmp_path):
    path = tmp_path / "wrfout_d01"
    with netCDF4.Dataset(path, "w") as file:
        for name, size in dict(
            Time=None, west_east=3, south_north=3, bottom_top=3, bottom_top_stag=4
        ).items():
            file.createDimension(name, size)
        file.setncatts({"TITLE": "OUTPUT FROM WRF V4", "MAP_PROJ": 1})
        for name in ("PH", "PHB", "P", "PB", "T"):
            file.createVariable(name, "f4", ("Time", "bottom_top", "south_north", "west_east"))
    assert "no time has been written" in _error(path)
