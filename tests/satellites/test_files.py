"""Files of pictures, and what is said of two pictures of one place."""

from __future__ import annotations

import os
import resource
import shutil
from pathlib import Path

import numpy as np
import pytest
import xarray as xr

from openswim.errors import UserError
from openswim.satellites import FixedGrid, band, reflectance
from openswim.satellites.comparison import agreement, displacement
from openswim.satellites.files import grid_of, middle_of, read, write
from openswim.scene import Scene

SHARED = Path(os.environ.get("OPENSWIM_SHARED", Path(__file__).parents[3] / "shared"))
ABI = SHARED / "data/satellite/abi"


@pytest.fixture(scope="module")
def picture() -> xr.Dataset:
    grid = FixedGrid(2.8e-5 * np.arange(-6, 7), 2.8e-5 * np.arange(1006, 989, -1), -75.0)
    bare = Scene.clear(10.0, -75.0, None, 0.4)
    return reflectance(bare, grid, [band("goes-16 abi", "C02"), band("goes-16 abi", "C03")], "2021-06-21T15:00")


@pytest.mark.parametrize("suffix", [".nc", ".tif"])
def test_what_is_written_is_read_at_the_same_places(picture: xr.Dataset, tmp_path: Path, suffix: str) -> None:
    write(picture, tmp_path / f"a{suffix}")
    back = read(tmp_path / f"a{suffix}")
    np.testing.assert_array_equal(back.reflectance_factor, picture.reflectance_factor[0])
    for name in ("latitude", "longitude"):  # degrees: a hundredth of a pixel
        np.testing.assert_allclose(back[name], picture[name], atol=1e-4)
    assert grid_of(back).sweep == "x"
    assert picture.attrs["time_coverage_start"].startswith("2021-06-21T15:00")
    assert back.attrs["time_coverage_start"] == picture.attrs["time_coverage_start"]


def test_a_full_disk_is_told_in_a_line_and_leaves_nothing(picture: xr.Dataset, tmp_path: Path) -> None:
    limits = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (1000, limits[1]))
    try:
        with pytest.raises(UserError, match=r"a.tif: cannot be written .*: free some space"):
            write(picture, tmp_path / "a.tif")
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limits)
    assert not list(tmp_path.iterdir())


def test_satpy_reads_what_is_written_into_a_folder(picture: xr.Dataset, tmp_path: Path) -> None:
    path = write(picture, tmp_path)
    assert path.name == "goes16-abi-20210621150000-20210621150000.nc"
    satpy = pytest.importorskip("satpy")
    scene = satpy.Scene([str(path)], reader="satpy_cf_nc")
    scene.load(["reflectance_factor"])
    found = scene["reflectance_factor"].sel(band="C03")
    np.testing.assert_array_equal(found, picture.reflectance_factor.sel(band="C03"))
    assert scene.sensor_names == {"abi"}
    lon, lat = found.attrs["area"].get_lonlats()
    for places, name in ((lat, "latitude"), (lon, "longitude")):
        np.testing.assert_allclose(places, picture[name], atol=1e-4)


@pytest.mark.parametrize("suffix", [".nc", ".tif"])
def test_of_several_bands_the_one_that_is_asked_for_is_read(picture: xr.Dataset, tmp_path: Path, suffix: str) -> None:
    names = [str(name) for name in picture.band.values]
    path = write(picture, tmp_path / f"several{suffix}")
    for n, name in enumerate(names):
        found = read(path, ["C99", name])
        assert found.attrs["band"] == name
        np.testing.assert_array_equal(found.reflectance_factor, picture.reflectance_factor[n])
    assert read(path).attrs["band"] == read(path, ["C99"]).attrs["band"] == names[0]


def test_the_middle_of_a_picture_across_the_date_line() -> None:
    """What himawari's grid has east of 180 and west of it in equal parts is in the middle of it."""
    grid = FixedGrid(2.8e-5 * np.arange(3600, 4200, 20), 2.8e-5 * np.arange(300, -301, -20), 140.7)
    lat, lon = grid.latlon()
    assert 0.1 < (lon < 0).mean() < 0.9
    found = middle_of(xr.Dataset({"latitude": (("y", "x"), lat), "longitude": (("y", "x"), lon)}), 140.7)
    assert found[0] == pytest.approx(0.0, abs=1e-6)
    assert found[1] == pytest.approx(np.degrees(np.angle(np.exp(1j * np.radians(lon)).mean())), abs=0.05)


def test_a_geotiff_is_cloud_optimised_and_where_proj_has_it(picture: xr.Dataset, tmp_path: Path) -> None:
    rasterio = pytest.importorskip("rasterio")
    from pyproj import Transformer

    write(picture, tmp_path / "a.tif")
    with rasterio.open(tmp_path / "a.tif") as file:
        assert file.tags(ns="IMAGE_STRUCTURE")["LAYOUT"] == "COG"
        x, y = file.xy(3, 4)
        lon, lat = Transformer.from_crs(file.crs.to_wkt(), "EPSG:4326", always_xy=True).transform(x, y)
    assert lat == pytest.approx(float(picture.latitude[3, 4]), abs=1e-4)
    assert lon == pytest.approx(float(picture.longitude[3, 4]), abs=1e-4)


@pytest.mark.skipif(not ABI.exists(), reason="no reference data")
@pytest.mark.parametrize(("rows", "columns", "least"), [(670, 830, 0.5), (850, 900, 0.8)])  # a lake, the coast
def test_an_observed_crop_lies_on_its_coast(rows: int, columns: int, least: float) -> None:
    """Dark water and bright land in the near infrared agree best with the land mask where nothing is shifted.

    With the sweep along the other axis the crop is 10 km off.
    """
    from openswim.ground.earth import water_fraction

    (path,) = ABI.glob("*C03*CMI.tif")
    found = read(path).isel(y=slice(rows, rows + 100), x=slice(columns, columns + 100))
    factor = found.reflectance_factor.values
    land = 1 - water_fraction(found.latitude.values, found.longitude.values)
    inner = np.s_[12:-12, 12:-12]
    shifts = [(i, j) for i in range(-12, 13, 2) for j in range(-12, 13, 2)]
    scores = [np.corrcoef(np.roll(land, shift, (0, 1))[inner].ravel(), factor[inner].ravel())[0, 1] for shift in shifts]
    assert max(scores) > least
    assert np.abs(shifts[int(np.argmax(scores))]).max() <= 4  # pixels of 1 km; the mask's are of 4 km
    assert np.nanmin(factor) > 0
    assert found.attrs["time_coverage_start"].startswith("2021-05-25T18:10:26")


def test_displaced_features_are_found() -> None:
    rng = np.random.default_rng(3)
    from scipy.ndimage import gaussian_filter

    field = gaussian_filter(rng.normal(size=(200, 240)), 4)
    field = 0.3 + 0.2 * field / field.std()
    seen = np.roll(field, (5, -7), (0, 1)) + rng.normal(0, 0.02, field.shape)
    down, right, best = displacement(field, seen)
    assert (np.nanmedian(down), np.nanmedian(right)) == (5, -7)
    assert np.nanmin(best) > 0.9
    noise = displacement(rng.normal(size=field.shape), seen)
    assert np.isfinite(noise[0]).mean() < 0.2
    shifted = agreement(field + 0.05, field)
    assert shifted.bias == pytest.approx(0.05)
    assert shifted.correlation == pytest.approx(1)
    assert np.isnan(agreement(np.full((4, 4), 0.2), field[:4, :4]).correlation)
    with pytest.raises(UserError, match="one grid"):
        agreement(field, seen[1:])
    with pytest.raises(UserError, match="nothing to compare"):
        agreement(np.full_like(field, np.nan), seen)


def test_what_is_no_picture_is_refused(tmp_path: Path) -> None:
    with pytest.raises(UserError, match=r"gone\.nc: no such file"):
        read(tmp_path / "gone.nc")
    (tmp_path / "a.tif").write_text("no")
    with pytest.raises(UserError):
        read(tmp_path / "a.tif")
    xr.Dataset({"a": ("x", [1.0])}).to_netcdf(tmp_path / "a.nc")
    with pytest.raises(UserError, match="no reflectance factor"):
        read(tmp_path / "a.nc")


def _abi(picture: xr.Dataset) -> xr.Dataset:
    """One band, as files of ABI have it."""
    about = {"grid_mapping": "goes_imager_projection", "units": "1"}
    return xr.Dataset(
        {"CMI": (("y", "x"), picture.reflectance_factor[0].values, about),
         "goes_imager_projection": ((), 0, picture.geostationary.attrs)},
        coords={name: (name, picture[name].values, {"units": "rad"}) for name in ("x", "y")},
    )  # fmt: skip


@pytest.mark.parametrize("form", ["with a time", "turned over", "per cent", "metres", "microradians", "all bands"])
def test_a_picture_is_the_same_in_every_form(picture: xr.Dataset, tmp_path: Path, form: str) -> None:
    file, height = _abi(picture), picture.geostationary.attrs["perspective_point_height"]
    if form == "with a time":
        file["CMI"] = file.CMI.expand_dims("t")
    elif form == "turned over":
        file["CMI"] = file.CMI.transpose("x", "y")
    elif form == "per cent":
        file["CMI"] = (file.CMI * 100).assign_attrs(file.CMI.attrs | {"units": "%"})
    elif form == "all bands":
        file["CMI_C02"], file["CMI_C01"] = file.CMI, file.CMI + 0.1
        file = file.drop_vars("CMI")
    else:
        unit, factor = ("m", height) if form == "metres" else ("microradian", 1e6)
        file = file.assign_coords({axis: (axis, file[axis].values * factor, {"units": unit}) for axis in ("x", "y")})
    file.to_netcdf(tmp_path / "a.nc")
    back = read(tmp_path / "a.nc", ["C02"])
    np.testing.assert_allclose(back.reflectance_factor, picture.reflectance_factor[0], rtol=1e-6)
    np.testing.assert_allclose(back.latitude, picture.latitude, atol=1e-6)
    if form == "all bands":
        assert back.attrs["band"] == "C02"


@pytest.mark.parametrize(
    ("change", "says"),
    [("kelvin", "its values are in 'K'"), ("counts", "no reflectance factors do"), ("axes", "x is in 'furlong'")],
)
def test_what_is_no_reflectance_is_refused(picture: xr.Dataset, tmp_path: Path, change: str, says: str) -> None:
    file = _abi(picture)
    if change == "kelvin":
        file.CMI.attrs["units"] = "K"
    elif change == "counts":
        file["CMI"] = (file.CMI * 3150).assign_attrs(file.CMI.attrs)
    else:
        file.x.attrs["units"] = "furlong"
    file.to_netcdf(tmp_path / "a.nc")
    with pytest.raises(UserError, match=says):
        read(tmp_path / "a.nc")


@pytest.mark.parametrize("scale", [1.0, 3150.0])
def test_flags_of_quality_and_counts_without_scale_are_no_picture(
    picture: xr.Dataset, tmp_path: Path, scale: float
) -> None:
    """ABI's flags lie beside its pictures, on the same grid."""
    pytest.importorskip("rasterio")
    spoilt = picture.copy()
    spoilt["reflectance_factor"] = picture.reflectance_factor * scale
    path = tmp_path / f"OR_ABI-L2-CMIPM1-M6C02_G16_s2021_{'DQF' if scale == 1 else 'CMI'}.tif"
    write(spoilt, path)
    with pytest.raises(UserError, match="holds flags of quality" if scale == 1 else "counts without scale"):
        read(path)


@pytest.mark.parametrize("name", ["DQF", "DQF_C02"])
def test_pixels_that_are_flagged_bad_are_left_out(picture: xr.Dataset, tmp_path: Path, name: str) -> None:
    """ABI L2 user's guide: 0 good, 1 conditionally usable, 2 out of range, 3 no value, 4 focal plane warm, 255 none."""
    file = _abi(picture)
    if name != "DQF":
        file["CMI_C02"], file["CMI_C01"] = file.CMI, file.CMI + 0.1
        file["DQF_C01"] = (("y", "x"), np.full(file.CMI.shape, 3, np.uint8))
        file = file.drop_vars("CMI")
    flags = np.zeros(picture.reflectance_factor[0].shape, np.uint8)
    flags[2, :6] = 0, 1, 2, 3, 4, 255
    file[name] = (("y", "x"), flags, {"_FillValue": np.uint8(255)})
    file.to_netcdf(tmp_path / "a.nc")
    found = read(tmp_path / "a.nc", ["C02"])
    bad = np.zeros(flags.shape, bool)
    bad[2, 3:6] = True
    np.testing.assert_array_equal(np.isnan(found.reflectance_factor), bad)
    assert found.attrs["pixels_left_out"] == 3
    file[name] = ("z", flags.ravel())
    file.to_netcdf(tmp_path / "b.nc")
    with pytest.raises(UserError, match=r"b\.nc: DQF has .* give"):
        read(tmp_path / "b.nc", ["C02"])


@pytest.mark.skipif(not ABI.exists(), reason="no reference data")
def test_flags_beside_a_geotiff_are_heeded(tmp_path: Path) -> None:
    """Of the million pixels none has no value, and the brightest, which are out of range, stay."""
    rasterio = pytest.importorskip("rasterio")
    (path,) = ABI.glob("*C03*CMI.tif")
    found = read(path)
    assert found.attrs["pixels_left_out"] == 0
    assert found.reflectance_factor.max() > 1.25
    own = shutil.copy(path, tmp_path)
    with rasterio.open(str(path).replace("_CMI", "_DQF")) as file:
        flags, profile = file.read(), file.profile
    flags[0, 5, 7:9] = 3, 4
    with rasterio.open(str(own).replace("_CMI", "_DQF"), "w", **profile) as file:
        file.write(flags)
    seen = read(own)
    assert seen.attrs["pixels_left_out"] == 2
    assert np.argwhere(np.isnan(seen.reflectance_factor.values)).tolist() == [[5, 7], [5, 8]]


@pytest.mark.parametrize("damage", ["no axis", "no numbers", "no mapping", "no ellipsoid"])
def test_damaged_pictures_are_refused_with_their_file(picture: xr.Dataset, tmp_path: Path, damage: str) -> None:
    spoilt = picture.copy()
    if damage == "no axis":
        spoilt = spoilt.isel(x=0)
    elif damage == "no numbers":
        spoilt["reflectance_factor"] = (("y", "x"), np.full((picture.y.size, picture.x.size), "a"))
    elif damage == "no mapping":
        spoilt = spoilt.drop_vars("geostationary")
    else:
        spoilt["geostationary"] = ((), 0, picture.geostationary.attrs | {"semi_major_axis": [1.0, 2.0]})
    spoilt.to_netcdf(tmp_path / "a.nc")
    with pytest.raises(UserError, match=r"a\.nc"):
        read(tmp_path / "a.nc")


@pytest.mark.parametrize("turn", [1.0, 30.0, 180.0])
def test_a_turned_geotiff_is_refused_and_one_that_stands_on_its_head_is_not(
    picture: xr.Dataset, tmp_path: Path, turn: float
) -> None:
    rasterio = pytest.importorskip("rasterio")
    write(picture, tmp_path / "a.tif")
    with rasterio.open(tmp_path / "a.tif") as file:
        values, profile = file.read(), file.profile | {"driver": "GTiff"}
    profile["transform"] = profile["transform"] @ rasterio.Affine.rotation(turn)
    with rasterio.open(tmp_path / "b.tif", "w", **profile) as file:
        file.write(values)
        file.descriptions = ["C02"] * file.count
    if turn == 180.0:
        assert read(tmp_path / "b.tif", ["C02"]).x[0] > read(tmp_path / "b.tif", ["C02"]).x[-1]
    else:
        with pytest.raises(UserError, match=r"b\.tif: its rows are turned.*gdalwarp"):
            read(tmp_path / "b.tif", ["C02"])
