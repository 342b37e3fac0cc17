import numpy as np
import pytest
import xarray as xr
from PIL import Image, ImageFont

from openswim.colour import check_writable, save
from openswim.colour.caption import _wrapped
from openswim.errors import UserError

FACTS = {
    "latitude": 24.5,
    "longitude": -90.0,
    "height_m": 2.0,
    "valid_time": "2005-08-28T18:00:00Z",
    "light_time": "2005-08-28T18:00:00Z",
    "source": "wrfout_d01",
    "solver": "fast",
    "sun_altitude_deg": 61.23,
    "sun_azimuth_deg": 180.0,
    "global_horizontal_irradiance_w_m2": 812.3,
}


@pytest.fixture
def image():
    """A small rendered image."""
    random = np.random.default_rng(0)
    radiance = random.uniform(0.1, 1.0, (40, 300, 3)).astype("float32")
    radiance[0, 0] = np.nan
    dims = ("y", "x", "wavelength")
    return xr.Dataset(
        {
            "solar_relative_radiance": (dims, radiance, {"units": "1", "flag": True, "empty": None}),
            "radiance": (dims, radiance * 0.15, {"units": "W m-2 sr-1 nm-1"}),
        },
        coords={"wavelength": ("wavelength", [615.0, 546.0, 450.0], {"units": "nm"})},
        attrs=FACTS | {"scene": None, "progress": False},
    )


def text_of(path):
    """The text metadata of a PNG."""
    with Image.open(path) as opened:
        return dict(opened.text)


@pytest.mark.parametrize("name", ["sky.png", "sky.PNG", "sky.jpg", "sky.jpeg", "sky.tif"])
def test_pictures_carry_a_caption_below(image, tmp_path, name):
    save(image, tmp_path / name, caption="below")
    captioned = np.asarray(Image.open(tmp_path / name))
    save(image, tmp_path / f"bare_{name}", caption=False)
    bare = np.asarray(Image.open(tmp_path / f"bare_{name}"))
    assert bare.shape == (40, 300, 3)
    assert captioned.shape[0] > 50
    assert captioned.shape[1:] == (300, 3)
    if "jp" not in name.lower():
        np.testing.assert_array_equal(captioned[:40], bare)
    strip = captioned[40:].astype(int)
    assert strip.max() > 150  # ink ...
    assert np.median(strip) < 40  # ... on a dark ground
    assert sorted(p.name for p in tmp_path.iterdir()) == sorted([name, f"bare_{name}"])


def test_a_caption_inside_leaves_the_size_alone(image, tmp_path):
    """It is over the lowest rows; all else is as without. Where it would hide a quarter there is none."""
    tall = xr.concat([image] * 8, "y")
    for caption in ("inside", "none"):
        save(tall, tmp_path / f"{caption}.png", caption=caption)
    inside, bare = (np.asarray(Image.open(tmp_path / f"{c}.png")).astype(int) for c in ("inside", "none"))
    assert inside.shape == bare.shape == (320, 300, 3)
    np.testing.assert_array_equal(inside[:240], bare[:240])
    assert inside[270:].max() > 150
    assert np.median(inside[300:]) < 0.5 * np.median(bare[300:])
    save(image, tmp_path / "low.png")
    np.testing.assert_array_equal(np.asarray(Image.open(tmp_path / "low.png")), bare[:40])
    with pytest.raises(UserError, match="choose inside, below or none"):
        save(image, tmp_path / "wrong.png", caption="above")


@pytest.mark.filterwarnings("ignore:Dataset has no geotransform")
def test_sixteen_bits_hold_what_eight_do_and_more(image, tmp_path):
    """Read by rasterio, which knows 16 bits in three channels; its texts by Pillow."""
    rasterio = pytest.importorskip("rasterio")
    for name in ("sky.png", "sky.tif"):
        save(image, tmp_path / name, caption="none", bits=16, exposure=0.5)
        with rasterio.open(tmp_path / name) as opened:
            deep = np.moveaxis(opened.read(), 0, -1)
        with Image.open(tmp_path / name) as opened:
            assert opened.size == (300, 40)
            words = opened.text["Source"] if name.endswith("png") else opened.getexif()[270]
            assert "wrfout_d01" in words
        assert deep.dtype == np.uint16
        assert len(np.unique(deep)) > 5000
        save(image, tmp_path / f"plain_{name}", caption="none", dither=False, exposure=0.5)
        np.testing.assert_allclose(deep / 257, np.asarray(Image.open(tmp_path / f"plain_{name}")), atol=0.51)
    with pytest.raises(UserError, match="JPEG has 8 bits"):
        save(image, tmp_path / "sky.jpg", bits=16)


def test_captions_are_whole_or_left_out(image, tmp_path):
    """Nothing is cut off that has spaces; what is too narrow for them has them in its metadata alone."""
    parts = ["View: satellite, straight down, 17.3 degrees wide", "Solver: fast", "Irradiance: global 812 W/m2"]
    lines = _wrapped(parts, ImageFont.load_default(9), 130)
    assert " ".join(lines).replace("  |  ", " ") == " ".join(parts)
    assert all(ImageFont.load_default(9).getlength(line) <= 130 for line in lines)
    narrow = image.isel(x=slice(150))
    save(narrow, tmp_path / "sky.png")
    with Image.open(tmp_path / "sky.png") as opened:
        assert opened.size == (150, 40)
    assert text_of(tmp_path / "sky.png")["Solver"] == "fast"


def test_png_metadata_says_what_was_rendered(image, tmp_path):
    save(image, tmp_path / "sky.png", exposure=0.5)
    text = text_of(tmp_path / "sky.png")
    assert text["Place"] == "24.500 N 90.000 W, 2 m above ground"
    assert text["Time"] == "2005-08-28 18:00:00 UTC"
    assert text["Source"] == "wrfout_d01"
    assert text["Solver"] == "fast"
    assert text["Sun"].startswith("altitude 61.2")
    assert text["Irradiance"] == "global 812 W/m2"
    assert text["Exposure"] == "0.5"
    assert "wrfout_d01" in text["Description"]


@pytest.mark.parametrize(
    ("times", "said"),
    [
        ({"light_time": "2005-08-28T23:30:00Z"},
         {"Weather": "2005-08-28 18:00:00 UTC", "Light": "2005-08-28 23:30:00 UTC, 5.5 h later"}),
        ({"light_time": "2005-08-25T18:00:00Z"},
         {"Weather": "2005-08-28 18:00:00 UTC", "Light": "2005-08-25 18:00:00 UTC, 3 days earlier"}),
        ({"light_time": None}, {"Weather": "2005-08-28 18:00:00 UTC", "Light": "sun placed by hand"}),
        ({"valid_time": None}, {"Time": "2005-08-28 18:00:00 UTC"}),
    ],
)  # fmt: skip
def test_weather_lit_by_another_sun_says_so(image, tmp_path, times, said):
    """Never is the time of the light taken for that of the clouds."""
    save(image.assign_attrs(times), tmp_path / "sky.png")
    text = text_of(tmp_path / "sky.png")
    assert {name: text[name] for name in ("Time", "Weather", "Light") if name in text} == said


@pytest.mark.parametrize(
    ("altitude", "where"), [(-14.0, "azimuth 160.5, altitude -14"), (-90.0, "straight down")], ids=["aslant", "down"]
)
def test_a_perspective_says_where_it_looks(image, tmp_path, altitude, where):
    looking = {"view_azimuth_deg": 160.5, "view_altitude_deg": altitude, "field_of_view_deg": 65.0}
    save(image.assign_attrs(view="perspective", **looking), tmp_path / "air.png")
    assert text_of(tmp_path / "air.png")["View"] == f"perspective, {where}, 65 degrees wide"


def test_jpeg_and_tiff_describe_themselves_too(image, tmp_path):
    for name in ("sky.jpg", "sky.tif"):
        save(image, tmp_path / name)
        with Image.open(tmp_path / name) as opened:
            assert "wrfout_d01" in opened.getexif()[270]


def test_a_long_name_does_not_overflow_a_narrow_picture(image, tmp_path):
    image.attrs["source"] = "/a/very/long/path" * 20
    save(image.isel(x=slice(0, 60)), tmp_path / "sky.png")
    with Image.open(tmp_path / "sky.png") as picture:
        assert picture.width == 60
        assert picture.text["Source"] == image.attrs["source"]


def test_what_is_unknown_is_left_out(image, tmp_path):
    image.attrs = {}
    save(image, tmp_path / "sky.png")
    assert set(text_of(tmp_path / "sky.png")) == {"Software", "Description", "Exposure"}


@pytest.mark.parametrize("name", ["sky.nc", "sky.zarr"])
def test_data_come_back_as_they_were(image, tmp_path, name):
    save(image, tmp_path / name)
    if name.endswith(".nc"):
        with xr.open_dataset(tmp_path / name) as opened:
            back = opened.load()
    else:
        back = xr.open_zarr(tmp_path / name).load()
    for variable in image.data_vars:
        np.testing.assert_array_equal(back[variable], image[variable])
        assert back[variable].dims == ("y", "x", "wavelength")
        assert back[variable].attrs["units"] == image[variable].attrs["units"]
    assert back.wavelength.attrs["units"] == "nm"
    assert back.attrs["Conventions"].startswith("CF-")
    assert back.attrs["source"] == "wrfout_d01"
    assert "scene" not in back.attrs
    assert image.attrs["scene"] is None  # the image itself is left alone


def test_netcdf_is_compressed(image, tmp_path):
    image = xr.concat([image * 0 + 1] * 20, dim="y")
    save(image, tmp_path / "sky.nc")
    assert (tmp_path / "sky.nc").stat().st_size < image.nbytes / 5


@pytest.mark.parametrize("name", ["sky.png", "sky.nc", "sky.zarr"])
def test_saving_again_replaces(image, tmp_path, name):
    save(image, tmp_path / name, caption=False)
    save(image.isel(y=slice(0, 10)), tmp_path / name, caption=False)
    if name == "sky.zarr":
        assert xr.open_zarr(tmp_path / name).sizes["y"] == 10
    elif name == "sky.nc":
        with xr.open_dataset(tmp_path / name) as back:
            assert back.sizes["y"] == 10
    else:
        with Image.open(tmp_path / name) as back:
            assert back.height == 10
    assert [p.name for p in tmp_path.iterdir()] == [name]


def test_a_failed_write_leaves_the_old_file_and_no_debris(image, tmp_path, monkeypatch):
    save(image, tmp_path / "sky.png")
    before = (tmp_path / "sky.png").read_bytes()

    def full(self, file, format, **options):
        file.write(b"half a pic")
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(Image.Image, "save", full)
    with pytest.raises(UserError, match="No space left"):
        save(image, tmp_path / "sky.png", exposure=1.0)
    assert (tmp_path / "sky.png").read_bytes() == before
    assert [p.name for p in tmp_path.iterdir()] == ["sky.png"]


def test_what_cannot_be_written_is_known_beforehand(tmp_path):
    (tmp_path / "folder.png").mkdir()
    (tmp_path / "folder.zarr").mkdir()
    (tmp_path / "file").write_text("")
    (tmp_path / "file.zarr").write_text("")
    for path in (
        tmp_path / "sky.gif",
        tmp_path / "sky",
        tmp_path / "missing" / "sky.png",
        tmp_path / "folder.png",
        tmp_path / "file" / "sky.png",
        "/proc/sky.png",
        tmp_path / "file.zarr",
        tmp_path / "folder.zarr",
        tmp_path / f"{'long' * 64}.png",
    ):
        with pytest.raises(UserError, match="output") as caught:
            check_writable(path)
        assert "\n" not in str(caught.value)
    check_writable(tmp_path / "sky.png")
    check_writable(tmp_path / "sky.zarr")
    assert sorted(p.name for p in tmp_path.iterdir()) == ["file", "file.zarr", "folder.png", "folder.zarr"]


def test_a_folder_that_is_no_store_is_kept(image, tmp_path):
    mine = tmp_path / "mine.zarr" / "thesis.tex"
    mine.parent.mkdir()
    mine.write_text("precious")
    with pytest.raises(UserError, match="not a Zarr store"):
        save(image, mine.parent)
    assert mine.read_text() == "precious"


def test_what_is_read_is_not_written_over(tmp_path):
    weather, store = tmp_path / "weather.nc", tmp_path / "run.zarr"
    store.mkdir()
    for path in (weather, store / ".zgroup", store / "part.nc"):
        path.write_text("{}")
    (tmp_path / "link.nc").symlink_to(weather)
    for path, needed in (
        (tmp_path / "." / "weather.nc", weather), (tmp_path / "link.nc", weather), (store, store),
        (store, store / "part.nc"), (tmp_path / "later.nc", tmp_path / "later.nc"),
    ):  # fmt: skip
        with pytest.raises(UserError, match="needed; choose another name"):
            check_writable(path, [needed])
    check_writable(tmp_path / "other.nc", [weather])


@pytest.mark.parametrize("suffix", ["png", "nc", "zarr"])
def test_names_as_long_as_the_system_takes(image, tmp_path, suffix):
    path = tmp_path / ("x" * (254 - len(suffix)) + "." + suffix)  # 255 bytes
    save(image, path)
    assert path.exists()
