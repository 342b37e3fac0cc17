"""Made files of ARM's radiometers, by its conventions: names, clocks, bits of quality, places."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import netCDF4
import numpy as np
import pytest

from openswim.errors import UserError
from openswim.stations.files import read_station

EPOCH_S = 1546362000  # 2019-01-01T17:00Z
VALUES = [500.0, 501.0, 502.0, -9999.0, 504.0]
BITS = {
    "bit_1_description": "Value is equal to missing_value.", "bit_1_assessment": "Bad",
    "bit_2_description": "Value is less than the valid_min.", "bit_2_assessment": "Bad",
    "bit_3_description": "The instrument is being cleaned.", "bit_3_assessment": "Bad",
    "bit_4_description": "Difference exceeds valid_delta.", "bit_4_assessment": "Indeterminate",
}  # fmt: skip
MASKS = {"flag_masks": np.array([1, 2, 4, 8], "i4"), "flag_meanings": "below_200 cleaned missing_value tested",
         "flag_assessments": "Indeterminate Bad Bad Suspect"}  # fmt: skip
CLOCK = {"time": "seconds since 2019-01-01 17:00:00 0:00"}


def _file(path: Path, clock: Mapping[str, str] = CLOCK, name: str = "down_short_hemisp", units: str = "W/m^2",
          values: Any = VALUES, flags: Mapping[str, Any] | None = None, place: tuple[Any, ...] = (36.6, -97.5, 318.0),
          more: Mapping[str, Any] | None = None) -> Path:  # fmt: skip
    with netCDF4.Dataset(path, "w", format="NETCDF4") as file:
        file.createDimension("time", None)

        def put(name: str, values: Any, **about: Any) -> None:
            values = np.asarray(values)
            variable = file.createVariable(name, values.dtype, ("time",) if values.ndim else ())
            variable.setncatts(about)
            variable[...] = values

        put("base_time", np.int32(EPOCH_S), units="seconds since 1970-1-1 0:00:00 0:00")
        for one, unit in clock.items():
            put(one, 60.0 * np.arange(5), units=unit)
        put(name, np.array(values, "f4"), units=units, missing_value=np.float32(-9999))
        if flags is not None:
            put(f"qc_{name}", np.array([0, 1, 2, 4, 8], "i4"), **flags)
        for one, where in zip(("lat", "lon", "alt"), place, strict=True):
            put(one, np.array(where, "f4"))
        file.setncatts(more or {})
    return path


@pytest.mark.parametrize("clock", [
    CLOCK, {"time_offset": "seconds since 2019-01-01 17:00:00 0:00"}, {"time_offset": "seconds"},
    {"time": "seconds since base_time"}, {"time": "seconds since 2019-01-01 11:00:00 -6:00"},
])  # fmt: skip
def test_all_clocks_of_arm_say_the_same(tmp_path: Path, clock: Mapping[str, str]) -> None:
    """The hour was lost where a zone stands behind it, as it does in all of ARM's files."""
    found = read_station(_file(tmp_path / "x.cdf", clock))
    assert found.time.values[0] == np.datetime64("2019-01-01T17:00")
    assert found.time.values[-1] == np.datetime64("2019-01-01T17:04")
    np.testing.assert_array_equal(found.ghi, [500, 501, 502, np.nan, 504])


@pytest.mark.parametrize(("flags", "more", "missing"), [
    ({"units": "unitless"}, {}, [3]),  # codes, as before 2010
    (BITS, {}, [1, 3]), ({}, {f"qc_{name}": text for name, text in BITS.items()}, [1, 3]), (MASKS, {}, [2, 3]),
])  # fmt: skip
def test_values_whose_bits_are_bad_are_missing(tmp_path: Path, flags: Any, more: Any, missing: list[int]) -> None:
    """Bits for limits are not: a pyranometer is below its limit every night."""
    found = read_station(_file(tmp_path / "x.cdf", flags=flags, more=more))
    assert np.flatnonzero(np.isnan(found.ghi)).tolist() == missing


def test_light_goes_by_several_names_and_units(tmp_path: Path) -> None:
    for name in ("BestEstimate_down_short_hemisp", "downwelling_shortwave"):
        assert float(read_station(_file(tmp_path / f"{name}.nc", name=name)).ghi[0]) == 500
    kilo = _file(tmp_path / "k.nc", units="kW m-2", values=[0.5] * 5)
    assert float(read_station(kilo).ghi[0]) == pytest.approx(500)


def test_a_place_at_every_time_is_one_place(tmp_path: Path) -> None:
    still = read_station(_file(tmp_path / "x.nc", place=([36.6] * 5, [-97.5] * 5, [-9999.0] * 5)), height_m=318.0)
    assert still.attrs["latitude"] == pytest.approx(36.6)
    assert still.attrs["height_m"] == 318


@pytest.mark.parametrize(("options", "message"), [
    ({"units": "counts"}, r"down_short_hemisp is in 'counts', and not in W/m2"),
    ({"name": "hemisp_narrowband_filter1"}, "netCDF without any of .*no file of an ARM broadband radiometer"),
    ({"clock": {"time": "minutes"}}, "no times: neither time nor time_offset"),
    ({"clock": {}}, "no times: neither time nor time_offset"),
    ({"place": (range(5), 0.0, 0.0)}, "lat goes from 0 to 4: a station that moves"),
    ({"place": (-9999.0, 0.0, 0.0)}, "latitude = -9999 is none: mend the file, or give --lat"),
    ({"place": (np.nan, 0.0, 0.0)}, "ARM file does not say its latitude: give --lat and --lon$"),
])  # fmt: skip
def test_what_cannot_be_right_is_refused(tmp_path: Path, options: Any, message: str) -> None:
    with pytest.raises(UserError, match=rf"x\.nc: .*{message}"):
        read_station(_file(tmp_path / "x.nc", **options))
