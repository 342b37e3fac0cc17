"""Our decoder of complex packing against ecCodes' on the same messages."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from tests.readers import grib_files as gf

from openswim.errors import UserError
from openswim.readers.grib.file import GRIBFile


def _both(path: Path):
    """(ours, ecCodes') for every field of a file."""
    import eccodes as ec

    with GRIBFile(path) as file:
        for one in file.fields:
            if one.sections.edition == 2:
                ours = file.values(one).astype(float) / one.meaning.factor
                handle = file._handle(one.number, one.sections, values=True)
                ec.codes_set(handle, "missingValue", 1e30)
                theirs = ec.codes_get_array(handle, "values")
                ec.codes_release(handle)
                theirs[theirs > 1e29] = np.nan
                yield ours, theirs


@pytest.mark.parametrize("packing", ["grid_complex", "grid_complex_spatial_differencing"])
@pytest.mark.parametrize("gaps", [False, True])
def test_same_values_as_eccodes(tmp_path, packing, gaps):
    rng = np.random.default_rng(2)
    rough = rng.standard_normal(31 * 23) * np.repeat([0.0, 1.0, 300.0], [200, 300, 213])
    messages = [
        gf.Message((0, 0, 0), (105, 1), lambda lat, lon: 260.0 + rough),
        gf.Message((0, 1, 22), (105, 1), gf.cloud),
        gf.Message((0, 1, 22), (105, 2), lambda lat, lon: -1e-3 * gf.cloud(lat, lon)),
        gf.Message((0, 0, 0), (105, 2), lambda lat, lon: 260.0),
    ]
    if gaps:
        for one in messages[:3]:
            one.missing = lambda lat, lon: lon < 237.6
    product = gf.Product(gf.HRRR, messages, packing=packing, bits=16)
    pairs = list(_both(gf.write(tmp_path / "file", product)))
    assert len(pairs) == 4
    for ours, theirs in pairs:
        np.testing.assert_allclose(ours, theirs, rtol=1e-6)
        assert np.isnan(ours).any() == np.isnan(theirs).any()


def test_same_values_as_eccodes_in_real_files(nwp):
    paths = [nwp / "gfs_2011-10-08_f072.grib1", *nwp.glob("gefs.chem*"), *(nwp / "hrrr2d").glob("*MASSDEN*")]
    count = 0
    for path in paths:
        for ours, theirs in _both(path):
            np.testing.assert_allclose(ours, theirs, rtol=1e-6, atol=1e-30)
            count += 1
    assert count > 180


@pytest.mark.parametrize("octet", [19, 31, 34, 35, 36, 37, 41, 42, 46, 47, 48])
@pytest.mark.parametrize("value", [0, 7, 33, 255])
def test_groups_that_do_not_fit_are_refused(tmp_path, octet, value):
    """Each number that says how groups lie, made wrong: an error, or (where it says nothing new) values."""
    product = gf.hrrr(levels=2)
    message = bytearray(gf.encode(product, gf.Message((0, 1, 22), (105, 1), gf.cloud)))
    section5 = message.index(b"\x00\x00\x00\x31\x05")
    message[section5 + octet] = value
    path = tmp_path / "file"
    path.write_bytes(bytes(message))
    with GRIBFile(path) as file:
        try:
            values = file.values(file.fields[0])
        except UserError:
            return
    assert values.size == 31 * 23
