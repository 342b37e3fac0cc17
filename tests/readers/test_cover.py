"""Cloud fraction: the file's own where it has one, else by Xu and Randall where cells are wide."""

from __future__ import annotations

import math

import numpy as np
import pytest
from tests.readers import grib_files as gf
from tests.readers.model_files import cosp, era5

from openswim.readers import open_scene
from openswim.readers.fields.cover import cover_from_humidity


@pytest.mark.parametrize("make", [era5, cosp], ids=["ERA5", "COSP"])
def test_cf_files(tmp_path, make):
    truth = make(tmp_path / "file.nc")
    expected = np.clip(truth.fields["liquid_content"] / 3e-4, 0, 1)  # as the files are made
    np.testing.assert_allclose(open_scene(truth.paths).data.cloud_area_fraction, expected, atol=0.01)


def test_real_files(nwp):
    for name in ("era5_europe_2019-01-01.nc", "ifs_meridian_columns.nc", "um_cosp_input_2d.nc"):
        cover = open_scene(nwp / name).data.cloud_area_fraction.values
        assert 0.01 < cover.mean() < 0.5
        assert cover.max() > 0.95
    # the radiation of the GFS sees about two thirds of the Earth below some cloud
    cover = open_scene(nwp / "gfs_2011-10-08_f072.grib1").data.cloud_area_fraction.values
    assert 0.5 < cover.max(axis=0).mean() < 0.8


def test_clouds_that_cover_less_than_nothing_are_told(tmp_path):
    """Of one level, -1 %: within what packing may do to a field by itself, and all of it."""
    product = gf.icon(gf.AROME, levels=6)
    next(each for each in product.messages if each.parameter == (0, 6, 22)).values = lambda lat, lon: -1.0
    notes = open_scene(gf.write(tmp_path / "cover.grib", product)).notes
    assert "cloud cover runs from -0.01 to 0.4: none below 0, all above 1; a damaged field?" in notes


@pytest.mark.parametrize(("product", "share"), [(gf.ifs(gf.AROME), 0.5), (gf.icon(gf.AROME), 0.4)], ids=["IFS", "ICON"])
def test_grib(tmp_path, product, share):
    scene = open_scene(gf.write(tmp_path / "file", product))
    np.testing.assert_allclose(scene.data.cloud_area_fraction, share, atol=1e-3)


def _one(condensate, humidity, kelvin=280.0, pascal=8e4):
    q, t, p, rh = (np.full((1, 1, 1), value, np.float32) for value in (condensate, kelvin, pascal, humidity))
    return float(cover_from_humidity(q, t, p, None, rh)[0, 0, 0])


def test_xu_and_randall():
    saturated = 0.622 * 992.0 / (8e4 - 0.378 * 992.0)  # 9.92 hPa at 280 K (Goff-Gratch)
    for condensate, humidity in ((1e-5, 0.9), (1e-4, 0.9), (3e-4, 0.7)):
        expected = humidity**0.25 * (1 - math.exp(-100 * condensate / ((1 - humidity) * saturated) ** 0.49))
        assert _one(condensate, humidity) == pytest.approx(expected, rel=0.01)
    assert _one(0.0, 0.9) == 0
    assert _one(1e-5, 1.0) > 0.99
    assert _one(1e-4, 0.6) < _one(1e-4, 0.8) < _one(1e-4, 0.95)
    assert _one(1e-5, 0.9, 230.0) > 5 * _one(1e-5, 0.9)  # cold air holds less: the same ice is much cloud


def test_wrf_fraction(wrf_file):
    cloud = np.zeros((5, 6, 7), np.float32)
    cloud[1] = 0.3
    path = wrf_file(extra={"CLDFRA": (("bottom_top", "south_north", "west_east"), cloud, "")})
    np.testing.assert_allclose(open_scene(path).data.cloud_area_fraction, cloud, atol=1e-6)


def test_wrf_of_wide_cells_by_humidity_where_the_fraction_is_all_or_nothing(wrf_file):
    cloud = np.zeros((5, 6, 7), np.float32)
    cloud[1] = 1.0
    scene = open_scene(wrf_file(map_proj=6, extra={"CLDFRA": (("bottom_top", "south_north", "west_east"), cloud, "")}))
    assert any("Xu and Randall" in note for note in scene.notes)
    cover = scene.data.cloud_area_fraction.values
    assert 0.05 < cover[1].mean() <= 1
    assert not cover[2:].any()


def test_fine_cells_are_full_or_empty(wrf_file):
    assert "cloud_area_fraction" not in open_scene(wrf_file()).data


@pytest.mark.parametrize("most", [0.0, 1.0])
def test_wrf_of_fine_cells_is_full_of_cloud_where_the_fraction_is_all_or_nothing(wrf_file, most):
    cloud = np.zeros((5, 6, 7), np.float32)
    cloud[1] = most  # 0: the model's radiation has not run yet, and its clouds are there all the same
    scene = open_scene(wrf_file(extra={"CLDFRA": (("bottom_top", "south_north", "west_east"), cloud, "")}))
    assert "cloud_area_fraction" not in scene.data
    assert scene.data.liquid_content.values.any()
