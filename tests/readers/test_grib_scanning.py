"""A scanning mode that cannot be: it contradicts the first and the last point, or tears the field apart."""

from __future__ import annotations

import numpy as np
import pytest
from tests.readers import grib_files as gf

from openswim.errors import UserError
from openswim.ground import earth
from openswim.readers import open_scene


def _turned(tmp_path, product, key, value):
    """The file, with a key changed in all messages as a flipped bit changes it: values stay as they lie."""
    import eccodes as ec

    parts = []
    for one in product.messages:
        handle = ec.codes_new_from_message(gf.encode(product, one))
        ec.codes_set(handle, key, value)
        parts.append(bytes(ec.codes_get_message(handle)))
        ec.codes_release(handle)
    path = tmp_path / "file"
    path.write_bytes(b"".join(parts))
    return path


@pytest.mark.parametrize("grid", [gf.AROME, gf.GAUSSIAN], ids=["latitudes", "Gaussian"])
@pytest.mark.parametrize(("key", "told"), [("jScansPositively", "but northward"), ("iScansNegatively", "but westward")])
def test_points_that_run_the_other_way_are_refused(tmp_path, grid, key, told):
    path = _turned(tmp_path, gf.on_pressure(grid), key, 1)
    with pytest.raises(UserError, match=f"{told} by the scanning mode.*set {key} right"):
        open_scene(path)


@pytest.mark.parametrize("make", [lambda: gf.on_pressure(gf.AROME), lambda: gf.hrrr(levels=3)], ids=["GFS", "HRRR"])
@pytest.mark.parametrize("key", ["jPointsAreConsecutive", "alternativeRowScanning"])
def test_a_field_that_is_torn_apart_is_refused(tmp_path, make, key):
    path = _turned(tmp_path, make(), key, 1)
    with pytest.raises(UserError, match=r"torn .*jPointsAreConsecutive=0 .*alternativeRowScanning=0"):
        open_scene(path)


@pytest.mark.parametrize(("last", "told"), [(16.0, False), (16.5, False), (30.0, True)])
def test_columns_that_do_not_end_where_the_file_says_are_told(tmp_path, last, told):
    """By more than a column, that is: what is less may be rounding. The step is believed."""
    path = _turned(tmp_path, gf.on_pressure(gf.AROME), "longitudeOfLastGridPointInDegrees", last)
    notes = open_scene(path).notes
    assert any("do not end where the file says, at longitude 30" in note for note in notes) == told


def test_noise_is_in_no_order(tmp_path):
    """Which is as rough in one as in the other: nothing is refused for it."""
    product = gf.on_pressure(gf.AROME)
    random = np.random.default_rng(1)
    for one in product.messages:
        if one.level == (1, 0):
            one.values = lambda lat, lon: 500 * random.random(lat.shape)
    assert open_scene(gf.write(tmp_path / "file", product)).grid.shape == (12, 31, 41)


@pytest.mark.parametrize("key", ["", "jScansPositively", "iScansNegatively"])
def test_a_projection_that_is_turned_is_told_by_its_land(tmp_path, key):
    """Nothing else in such a message tells where it ends. North America, with the land that it has."""
    product = gf.hrrr(gf.HRRR | {"Dx": 180_000_000, "Dy": 180_000_000}, levels=2)
    for one in product.messages:
        if one.parameter == (2, 0, 0):
            one.values = lambda lat, lon: earth.water_at_nearest(lat, lon) == 0
    path = gf.write(tmp_path / "file", product) if not key else _turned(tmp_path, product, key, key[0] == "i")
    told = [note for note in open_scene(path).notes if "where the Earth has sea" in note]
    assert bool(told) == bool(key)
