"""When a frame was taken, as its name, its EXIF or its FITS header has it."""

import os
import time

import numpy as np
import pytest
from PIL import Image
from tests.cameras.test_picture_files import COLOUR, DEEP, fits

from openswim.cameras import Camera
from openswim.cameras.files import FrameSettings
from openswim.comparison.prepared import prepared
from openswim.errors import UserError
from openswim.observations import read_frame
from openswim.observations.standing import Standing
from openswim.observations.sun_spot import find_spot


def frame(tmp_path, name, exif=None, **settings):
    path = tmp_path / name
    options = {} if exif is None else {"exif": exif}
    Image.fromarray(COLOUR).save(path, **options)
    return read_frame(path, settings=FrameSettings(**settings))


@pytest.mark.parametrize(
    ("name", "settings", "utc"),
    [
        ("image_20250215080830.png", {"utc_offset_h": 0.0}, "2025-02-15T08:08:30"),
        ("FE3_Image_20160901_100000_UTCp1.png", {}, "2016-09-01T09:00:00"),
        ("Wolf_20160530_094400_UTCp1_sunrow1338_suncol616.png", {}, "2016-05-30T08:44:00"),
        ("cam_2021-07-01T12-30-05_GMT-3.png", {}, "2021-07-01T15:30:05"),
        ("cam_20210701_123005_UTC+05:30.png", {}, "2021-07-01T07:00:05"),
        ("cam_20210701_123005_utc-0930_2.png", {}, "2021-07-01T22:00:05"),
        ("cam_20210701_123005_UTCp5.5.png", {}, "2021-07-01T07:00:05"),
        ("cam4Z_2021-07-01T12-30-05.250Z_7.png", {}, "2021-07-01T12:30:05"),
        ("W8446B18_2020-12-11_20-09-36.png", {"utc_offset_h": -7.5}, "2020-12-12T03:39:36"),
        ("sky_202401311205.png", {"utc_offset_h": 1.0}, "2024-01-31T11:05"),
        ("LYR-Sony-111220_200933.png", {"time_pattern": "%d%m%y_%H%M%S", "utc_offset_h": 0.0}, "2020-12-11T20:09:33"),
        ("roof-2024-061-1200.png", {"time_pattern": "%Y-%j-%H%M", "utc_offset_h": 0.0}, "2024-03-01T12:00"),
        ("a_20240230_120000_20240301_120000+0100.png", {"time_pattern": "%Y%m%d_%H%M%S%z"}, "2024-03-01T11:00"),
    ],
)
def test_names_tell_the_time(tmp_path, name, settings, utc):
    found = frame(tmp_path, name, **settings)
    assert found.time == np.datetime64(utc)
    assert found.time_source == "name"
    assert found.shape == (6, 5)


def test_the_zone_is_asked_for_and_never_the_machines(tmp_path, monkeypatch):
    for zone in ("America/Los_Angeles", "UTC"):
        monkeypatch.setitem(os.environ, "TZ", zone)
        time.tzset()
        with pytest.raises(UserError, match="--utc-offset"):
            frame(tmp_path, "image_20250215080830.png")
        with pytest.raises(UserError, match="--utc-offset"):
            frame(tmp_path, "cam4Z_20250215_080830.png")  # no Z of a time
        told = frame(tmp_path, "image_20250215080830.png", utc_offset_h=1.0)
        assert told.time == np.datetime64("2025-02-15T07:08:30")
    monkeypatch.undo()
    time.tzset()


def test_exif_has_a_zone_or_needs_one(tmp_path):
    exif = Image.Exif()
    exif.get_ifd(0x8769).update({0x9003: "2021:11:21 17:07:51", 0x829A: 20.0})
    with pytest.raises(UserError, match="--utc-offset"):
        frame(tmp_path, "sky.jpg", exif)
    assert frame(tmp_path, "sky.jpg", exif, utc_offset_h=2.0).time == np.datetime64("2021-11-21T15:08:01")
    exif.get_ifd(0x8769)[0x9011] = "+01:00"
    found = frame(tmp_path, "sky.jpg", exif)
    assert found.time == np.datetime64("2021-11-21T16:08:01")
    assert "EXIF" in found.time_source
    assert frame(tmp_path, "sky.jpg", exif, utc_offset_h=1.0).doubt == found.doubt == ""
    other = frame(tmp_path, "sky.jpg", exif, utc_offset_h=2.0)
    assert other.time == np.datetime64("2021-11-21T15:08:01")
    assert "EXIF says UTC+01:00, and utc_offset_h 2 " in other.doubt


def test_fits_has_the_start_of_the_exposure(tmp_path):
    path = tmp_path / "008.fits"
    cards = {"DATE-OBS": "'2018-09-14T11:53:22.844'", "EXPTIME": 60.0}
    path.write_bytes(fits((DEEP.astype(np.int32) - 32768).astype(">i2"), 16, BZERO=32768, **cards))
    assert read_frame(path).time == np.datetime64("2018-09-14T11:53:52.844")
    path.write_bytes(fits(DEEP.astype(">f4"), -32, **{"DATE-OBS": "'2018-09-14'", "UTSTART": "'11:53:22.844'"}))
    assert read_frame(path).time == np.datetime64("2018-09-14T11:53:22.844")
    assert read_frame(path, time="2020-01-01T00:00+01:00").time == np.datetime64("2019-12-31T23:00")


@pytest.mark.parametrize(
    ("name", "settings", "says"),
    [
        ("sky.png", {}, "--time"),
        ("sky_20241399_251000.png", {"utc_offset_h": 0.0}, "--time"),
        ("sky_20240230_120000.png", {"utc_offset_h": 0.0}, "--time"),
        ("x_20160901_100000_UTCp1.png", {"utc_offset_h": 2.0}, r"in the camera.s file\) 2: leave that out"),
        ("x_20160901_100000_UTC+99.png", {}, r"UTC\+99, which no clock has"),
        ("x_20160901.png", {"time_pattern": "%d%m%y_%H%M"}, "pattern"),
        ("x_20160901.png", {"time_pattern": "%H%M"}, "a year"),
        ("x_20160901.png", {"time_pattern": "%Y %Q"}, "takes"),
        ("x_20162016.png", {"time_pattern": "%Y%Y"}, "each once"),
        ("00010101_000000.png", {"time_pattern": "%Y%m%d_%H%M%S", "utc_offset_h": 15.0}, "end of all calendars"),
    ],
)
def test_what_tells_no_time_is_refused_in_one_line(tmp_path, name, settings, says):
    with pytest.raises(UserError, match=says) as caught:
        frame(tmp_path, name, **settings)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("date", "seconds", "zone"),
    [("0001-01-01T00:00:00", 0.0, "+05:00"), ("9999-12-31T23:59:59", 0.0, "-05:00"),
     ("9999-12-31T23:59:59", 3000.0, "+00:00")],
)  # fmt: skip
def test_times_beyond_all_calendars_are_refused(tmp_path, date, seconds, zone):
    cards = {"DATE-OBS": f"'{date}{zone}'", "EXPTIME": seconds}
    (tmp_path / "a.fits").write_bytes(fits(DEEP.astype(">f4"), -32, **cards))
    exif = Image.Exif()
    exif.get_ifd(0x8769).update({0x9003: date.replace("-", ":").replace("T", " "), 0x829A: seconds, 0x9011: zone})
    for read in (lambda: read_frame(tmp_path / "a.fits"), lambda: frame(tmp_path, "sky.jpg", exif)):
        with pytest.raises(UserError, match="at the end of all calendars: set the right time"):
            read()


def test_a_day_without_a_time_is_not_midnight(tmp_path):
    (tmp_path / "a.fits").write_bytes(fits(DEEP.astype(">f4"), -32, **{"DATE-OBS": "'2018-09-14'"}))
    with pytest.raises(UserError, match="'2018-09-14' is a day without a time: give time="):
        read_frame(tmp_path / "a.fits")
    both = {"DATE-OBS": "'2018-09-14'", "TIME-OBS": "'11:53:22'"}
    (tmp_path / "a.fits").write_bytes(fits(DEEP.astype(">f4"), -32, **both))
    assert read_frame(tmp_path / "a.fits").time == np.datetime64("2018-09-14T11:53:22")


@pytest.mark.filterwarnings("error")
def test_a_black_frame_of_floats_is_black(tmp_path):
    (tmp_path / "a.fits").write_bytes(fits(np.zeros((12, 10), ">f4"), -32, **{"DATE-OBS": "'2018-09-14T11:53:22'"}))
    black = read_frame(tmp_path / "a.fits")
    camera = Camera.fisheye(0, 0, size=(12, 10))
    Standing().add(black)
    assert not prepared(black, camera).saturated.any()
    assert (prepared(black, camera).linear == 0).all()


def test_counts_that_end_before_their_format_does_are_full(tmp_path):
    """A sensor of 12 bits in a file of 16: the sun is a disc of 4095. Of a sky without a sun nothing is cut off."""
    row, column = np.indices((200, 200))
    away = np.hypot(row - 60, column - 90)
    noise = np.random.default_rng(0).normal(0, 8, away.shape)
    for name, glow, full in (("sun", 9000, 4095.0), ("none", 2000, 0.999 * 65535)):
        light = 900 + glow * np.exp(-away / 6) + noise
        Image.fromarray(np.clip(light, 0, 4095).astype(np.uint16)).save(tmp_path / "a.png")
        seen = read_frame(tmp_path / "a.png", time="2024-06-10T12:00")
        assert seen.saturated == full
        spot = find_spot(seen)
        assert (spot is not None) == (name == "sun")
    assert read_frame(tmp_path / "a.png", "2024-06-10T12:00", FrameSettings(saturated_count=2500)).saturated == 2500


@pytest.mark.parametrize("quality", [None, 95, 75])
@pytest.mark.parametrize("end", [200, 235, 248])
def test_frames_of_bytes_that_end_early_are_full_there(tmp_path, quality, end):
    """The sun as a disc of that count, where a format of 8 bits goes on to 255; not what a sky without a sun, or flat
    fog, has most of. JPEG moves the spot's middle by up to 1.4 pixels of its radius of 33."""
    save = {"format": "PNG"} if quality is None else {"format": "JPEG", "quality": quality}
    row, column = np.indices((400, 400))
    away = np.hypot(row - 130, column - 160)[..., None]
    noise = np.random.default_rng(0).normal(0, 1.5, (400, 400, 3))
    sky = [70, 90, 130] + 30 * (row + column)[..., None] / 600
    for name, light in (("sun", sky + 900 * np.exp(-away / 20)), ("none", sky), ("fog", end - 3 + 0 * sky)):
        Image.fromarray(np.clip(light + noise, 0, end).astype(np.uint8)).save(tmp_path / "a", **save)
        seen = read_frame(tmp_path / "a", time="2024-06-10T12:00")
        spot = find_spot(seen)
        if name == "sun":
            assert seen.saturated == pytest.approx(0.98 * end, abs=1.5)
            assert np.hypot(spot.row - 130, spot.column - 160) < 2.5
        else:
            assert seen.saturated == 0.98 * 255
            assert spot is None


def test_one_of_several_frames_is_not_sent_to_an_option_of_single_ones(tmp_path):
    path = tmp_path / "clear.png"
    Image.fromarray(np.zeros((4, 4, 3), np.uint8)).save(path)
    pattern = FrameSettings(time_pattern="%d%m%y_%H%M")
    for settings, says in ((None, "the frame a name such as sky_20240620_110000.jpg"), (pattern, "another pattern")):
        for alone in (True, False):
            with pytest.raises(UserError, match=says) as caught:
                read_frame(path, settings=settings, alone=alone)
            assert ("--time), or" in str(caught.value)) == alone


def test_frames_of_real_cameras(shared):
    sky = shared / "data/sky"
    for name, settings, utc, shape in (
        ("bretigny/image_20250215080830.jp2", {"utc_offset_h": 0.0}, "2025-02-15T08:08:30", (2056, 2464, 3)),
        ("wolf/Wolf_20160530_094400_UTCp1_sunrow1338_suncol616.jpg", {}, "2016-05-30T08:44", (1920, 1920, 3)),
        ("happyjack/008.fits.bz2", {}, "2018-09-14T11:53:52.844", (1040, 1392)),
    ):
        found = read_frame(sky / name, settings=FrameSettings(**settings))
        assert found.time == np.datetime64(utc)
        assert found.counts.shape == shape
