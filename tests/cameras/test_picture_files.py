"""Counts of picture files come back as they were put in."""

import bz2
import gzip
import struct
import zlib

import numpy as np
import pytest
from PIL import Image

from openswim.cameras.picture_files import read_picture
from openswim.errors import UserError

COLOUR = (np.arange(6 * 5 * 3).reshape(6, 5, 3) * 2).astype(np.uint8)
DEEP = (np.arange(6 * 5).reshape(6, 5) * 2000).astype(np.uint16)


def png(values, depth, kind):
    """A PNG by its specification, without a library that might cut depths."""
    rows = b"".join(b"\0" + row.astype(f">u{depth // 8}").tobytes() for row in values)

    def chunk(name, data):
        return struct.pack(">I", len(data)) + name + data + struct.pack(">I", zlib.crc32(name + data))

    header = struct.pack(">IIBBBBB", values.shape[1], values.shape[0], depth, kind, 0, 0, 0)
    return b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", header) + chunk(b"IDAT", zlib.compress(rows)) + chunk(b"IEND", b"")


def fits(values, bitpix, **cards):
    lines = {"SIMPLE": "T", "BITPIX": bitpix, "NAXIS": values.ndim}
    lines |= {f"NAXIS{i + 1}": n for i, n in enumerate(values.shape[::-1])} | cards
    text = "".join(f"{key:8}= {value:>20}".ljust(80) for key, value in lines.items()) + "END".ljust(80)
    data = values.tobytes()
    return text.ljust(-(-len(text) // 2880) * 2880).encode() + data.ljust(-(-len(data) // 2880) * 2880, b"\0")


def test_what_is_transparent_is_black(tmp_path):
    """As of frames that are cut to the circle of their lens; of eight and of sixteen bits, grey and in colours."""
    whole = np.arange(30).reshape(6, 5, 1) % 3 > 0
    cut = np.concatenate([COLOUR, np.where(whole, 255, 90).astype(np.uint8)], axis=-1)
    Image.fromarray(cut).save(tmp_path / "a.png")
    np.testing.assert_array_equal(read_picture(tmp_path / "a.png").counts, COLOUR * whole)
    share = np.where(whole, 65535, 90).astype(np.uint16)
    grey = np.concatenate([DEEP[..., None], share], axis=-1)
    (tmp_path / "b.png").write_bytes(png(grey.reshape(6, -1).reshape(6, 5, 2), 16, 4))
    found = read_picture(tmp_path / "b.png")
    np.testing.assert_array_equal(found.counts, DEEP * whole[..., 0])
    assert found.full_scale == 65535
    deep = np.concatenate([np.repeat(DEEP[..., None], 3, axis=-1), share], axis=-1)
    (tmp_path / "c.png").write_bytes(png(deep, 16, 6))
    np.testing.assert_array_equal(read_picture(tmp_path / "c.png").counts, deep[..., :3] * whole)


def test_eight_bits(tmp_path):
    for suffix in ("png", "tif", "bmp"):
        Image.fromarray(COLOUR).save(tmp_path / f"a.{suffix}")
        picture = read_picture(tmp_path / f"a.{suffix}")
        np.testing.assert_array_equal(picture.counts, COLOUR)
        assert picture.full_scale == 255
    Image.fromarray(COLOUR).save(tmp_path / "a.jp2", irreversible=False)
    np.testing.assert_array_equal(read_picture(tmp_path / "a.jp2").counts, COLOUR)
    smooth = np.full((16, 16, 3), (90, 120, 200), np.uint8)
    Image.fromarray(smooth).save(tmp_path / "a.jpg", quality=95)
    np.testing.assert_allclose(read_picture(tmp_path / "a.jpg").counts, smooth, atol=2)


def test_sixteen_bits(tmp_path):
    for suffix in ("png", "tif", "jp2"):
        Image.fromarray(DEEP).save(tmp_path / f"a.{suffix}")
        picture = read_picture(tmp_path / f"a.{suffix}")
        np.testing.assert_array_equal(picture.counts, DEEP)
        assert picture.full_scale == 65535


def test_sixteen_bits_in_three_channels(tmp_path):
    """Pillow would make eight of a PNG and an interleaved TIFF without a word, and does not know a planar one."""
    rasterio = pytest.importorskip("rasterio")
    deep = np.stack([DEEP, DEEP + 7, DEEP + 700], axis=-1)
    (tmp_path / "a.png").write_bytes(png(deep.reshape(6, -1).reshape(6, 5, 3), 16, 2))
    np.testing.assert_array_equal(read_picture(tmp_path / "a.png").counts, deep)
    for interleave in ("pixel", "band"):
        with pytest.warns(rasterio.errors.NotGeoreferencedWarning), rasterio.open(
            tmp_path / "a.tif", "w", driver="GTiff", width=5, height=6, count=3, dtype="uint16",
            interleave=interleave, photometric="RGB",
        ) as file:  # fmt: skip
            file.write(np.moveaxis(deep, -1, 0))
        np.testing.assert_array_equal(read_picture(tmp_path / "a.tif").counts, deep)


# as EXIF 2.32 says of tag 274 which side of the upright picture the stored row 0 and column 0 are
STORED = {
    1: lambda up: up, 2: np.fliplr, 3: lambda up: np.rot90(up, 2), 4: np.flipud, 5: lambda up: np.swapaxes(up, 0, 1),
    6: lambda up: np.rot90(up, 1), 7: lambda up: np.rot90(np.swapaxes(up, 0, 1), 2), 8: lambda up: np.rot90(up, -1),
}  # fmt: skip


@pytest.mark.parametrize("orientation", STORED)
def test_pictures_are_read_upright(tmp_path, orientation):
    """By the orientation that EXIF states: of 8 and 16 bits, with transparency, and once only where Pillow turns."""
    stored, exif = STORED[orientation], Image.Exif()
    exif[274] = orientation
    cut = np.concatenate([COLOUR, np.full((6, 5, 1), 255, np.uint8)], axis=-1)
    for name, upright in (("a.png", COLOUR), ("b.tif", COLOUR), ("c.png", DEEP), ("d.tif", DEEP), ("e.png", cut)):
        Image.fromarray(np.ascontiguousarray(stored(upright))).save(tmp_path / name, exif=exif)
        expected = COLOUR if upright is cut else upright
        np.testing.assert_array_equal(read_picture(tmp_path / name).counts, expected, name)
    smooth = np.linspace(0, 200, 24)[:, None, None] + np.linspace(0, 50, 16)[:, None] * np.ones(3)
    kept = np.ascontiguousarray(stored(smooth)).astype(np.uint8)
    Image.fromarray(kept).save(tmp_path / "f.jpg", exif=exif, quality=95)
    np.testing.assert_allclose(read_picture(tmp_path / "f.jpg").counts, smooth, atol=6)


@pytest.mark.parametrize("orientation", STORED)
def test_deep_pictures_are_read_upright(tmp_path, orientation):
    """Those that Pillow cuts to 8 bits (PNG, interleaved TIFF), or does not know (planar TIFF)."""
    rasterio = pytest.importorskip("rasterio")
    deep = np.stack([DEEP, DEEP + 7, DEEP + 700], axis=-1)
    stored, exif = np.ascontiguousarray(STORED[orientation](deep)), Image.Exif()
    exif[274] = orientation
    rows, columns = stored.shape[:2]
    whole, tags = png(stored.reshape(rows, -1).reshape(rows, columns, 3), 16, 2), exif.tobytes()[6:]
    chunk = struct.pack(">I", len(tags)) + b"eXIf" + tags + struct.pack(">I", zlib.crc32(b"eXIf" + tags))
    (tmp_path / "a.png").write_bytes(whole[:33] + chunk + whole[33:])
    np.testing.assert_array_equal(read_picture(tmp_path / "a.png").counts, deep)
    for interleave in ("pixel", "band"):
        with pytest.warns(rasterio.errors.NotGeoreferencedWarning), rasterio.open(
            tmp_path / "a.tif", "w", driver="GTiff", width=columns, height=rows, count=3, dtype="uint16",
            interleave=interleave, photometric="RGB",
        ) as file:  # fmt: skip
            file.write(np.moveaxis(stored, -1, 0))
        with_tag(tmp_path / "a.tif", orientation)
        np.testing.assert_array_equal(read_picture(tmp_path / "a.tif").counts, deep)


def with_tag(path, orientation):
    """Put the orientation into a TIFF: its directory anew at the end of the file, with one entry more."""
    content = path.read_bytes()
    (at,) = struct.unpack_from("<I", content, 4)
    (count,) = struct.unpack_from("<H", content, at)
    entries = [content[at + 2 + 12 * i : at + 14 + 12 * i] for i in range(count)]
    entries.append(struct.pack("<HHII", 274, 3, 1, orientation))
    entries.sort(key=lambda entry: struct.unpack_from("<H", entry))
    directory = struct.pack("<H", count + 1) + b"".join(entries) + b"\0" * 4
    path.write_bytes(content[:4] + struct.pack("<I", len(content)) + content[8:] + directory)


def test_fits_of_every_kind(tmp_path):
    path = tmp_path / "a.fits"
    signed = (DEEP.astype(np.int32) - 32768).astype(">i2")
    for pack in (bytes, bz2.compress, gzip.compress):
        path.write_bytes(pack(fits(signed, 16, BZERO=32768, **{"DATE-OBS": "'2018-09-14T11:53:22.8'"})))
        picture = read_picture(path)
        np.testing.assert_array_equal(picture.counts, DEEP)
        assert picture.counts.dtype == np.uint16
        assert picture.full_scale == 65535
        assert picture.header["DATE-OBS"] == "2018-09-14T11:53:22.8"
    path.write_bytes(fits(DEEP.astype(">f4"), -32))
    np.testing.assert_array_equal(read_picture(path).counts, DEEP)
    over = DEEP.astype(">f4")
    over[0, 0] = np.inf  # one that overflowed is as bright as the brightest, and no scale for the others
    path.write_bytes(fits(over, -32))
    assert read_picture(path).full_scale == read_picture(path).counts[0, 0] == DEEP.ravel()[1:].max()
    path.write_bytes(fits((DEEP // 10).astype(">i2"), 16, BSCALE=0.5, BZERO=3.0))
    np.testing.assert_array_equal(read_picture(path).counts, DEEP // 10 * 0.5 + 3)
    path.write_bytes(fits(np.moveaxis(COLOUR, -1, 0), 8))
    np.testing.assert_array_equal(read_picture(path).counts, COLOUR)


def test_the_time_in_exif(tmp_path):
    exif = Image.Exif()
    exif.get_ifd(0x8769).update({0x9003: "2021:11:21 17:07:51", 0x9011: "+01:00", 0x829A: 20.0})
    Image.fromarray(COLOUR).save(tmp_path / "a.jpg", exif=exif)
    assert read_picture(tmp_path / "a.jpg").exif == {
        "DateTimeOriginal": "2021:11:21 17:07:51", "OffsetTimeOriginal": "+01:00", "ExposureTime": "20.0",
    }  # fmt: skip


def test_damaged_files_are_refused_in_one_line(tmp_path):
    Image.fromarray(np.random.default_rng(0).integers(0, 255, (64, 64, 3)).astype(np.uint8)).save(tmp_path / "good.png")
    good = (tmp_path / "good.png").read_bytes()
    header = fits(DEEP.astype(">i2"), 16)
    cases = {
        "empty.png": b"", "text.jpg": b"a sky", "cut.png": good[:300], "cut.fits": header[:2900],
        "no_end.fits": header[:160].ljust(2880 * 40), "raw.arw": b"II*\0 nothing",
        "gz.fits": b"\x1f\x8b\x08" + b"\0" * 40, "vast.fits": header.replace(b"6".rjust(20), b"999999999".rjust(20), 1),
        "strange.fits": header.replace(b"16".rjust(20), b"17".rjust(20), 1),
        "vast.png": png(np.zeros((1, 1)), 8, 0)[:16] + struct.pack(">II", 60000, 60000) + good[24:],
    }  # fmt: skip
    for name, content in cases.items():
        (tmp_path / name).write_bytes(content)
        with pytest.raises(UserError) as caught:
            read_picture(tmp_path / name)
        assert name in str(caught.value)
        assert "\n" not in str(caught.value)
    for path in (tmp_path / "missing.png", tmp_path, "/dev/zero"):
        with pytest.raises(UserError):
            read_picture(path)


def dng(counts, black, white, orientation=1):
    """The least Digital Negative: one strip of 16-bit counts behind red, green, green, blue filters."""
    rows, columns = counts.shape
    ascii_, short, long_, byte, signed, ratio = 2, 3, 4, 1, 10, 5
    unit = b"".join(struct.pack("<ii", int(i == j), 1) for i in range(3) for j in range(3))
    tags = [
        (254, long_, 1, 0), (256, long_, 1, columns), (257, long_, 1, rows), (258, short, 1, 16), (259, short, 1, 1),
        (262, short, 1, 32803), (271, ascii_, 5, b"Test\0"), (272, ascii_, 5, b"Test\0"), (273, long_, 1, "strip"),
        (274, short, 1, orientation), (277, short, 1, 1), (278, long_, 1, rows), (279, long_, 1, counts.size * 2),
        (284, short, 1, 1),
        (33421, short, 2, struct.pack("<HH", 2, 2)), (33422, byte, 4, b"\0\1\1\2"), (50706, byte, 4, b"\1\4\0\0"),
        (50708, ascii_, 5, b"Test\0"), (50714, short, 1, black), (50717, short, 1, white), (50721, signed, 9, unit),
        (50728, ratio, 3, struct.pack("<IIIIII", 1, 1, 1, 1, 1, 1)), (50778, short, 1, 21),
    ]  # fmt: skip
    start = 8 + 2 + 12 * len(tags) + 4
    extra = b"".join(v + b"\0" * (len(v) % 2) for *_, v in tags if isinstance(v, bytes) and len(v) > 4)
    strip, entries, at = start + len(extra), b"", start
    for tag, kind, count, value in tags:
        if isinstance(value, bytes) and len(value) > 4:
            field, at = struct.pack("<I", at), at + len(value) + len(value) % 2
        elif isinstance(value, bytes):
            field = value.ljust(4, b"\0")
        else:
            field = struct.pack("<I", strip if value == "strip" else value)
        entries += struct.pack("<HHI", tag, kind, count) + field
    return b"II*\0" + struct.pack("<IH", 8, len(tags)) + entries + b"\0" * 4 + extra + counts.astype("<u2").tobytes()


@pytest.mark.parametrize("green", [0.75, 0.95])  # a bright frame keeps its white, too
def test_raw_files_are_linear(tmp_path, green):
    """Counts above black, as shares of those from black to white: no white balance, no gamma."""
    pytest.importorskip("rawpy")
    counts = np.empty((64, 80), np.uint16)
    counts[::2, ::2], counts[1::2, 1::2] = 1512, 2512  # red, blue
    counts[::2, 1::2] = counts[1::2, ::2] = 512 + 4000 * green
    (tmp_path / "a.dng").write_bytes(dng(counts, 512, 4512))
    picture = read_picture(tmp_path / "a.dng")
    assert picture.counts.shape == (64, 80, 3)
    np.testing.assert_allclose(picture.counts[20:40, 20:40].mean(axis=(0, 1)) / 65535, [0.25, green, 0.5], atol=0.002)


@pytest.mark.parametrize("orientation", [1, 3, 6, 8])  # what cameras write
def test_raw_files_are_read_upright(tmp_path, orientation):
    pytest.importorskip("rawpy")
    upright = np.add.outer(np.arange(64) * 30, np.arange(80) * 10) + 512
    (tmp_path / "a.dng").write_bytes(dng(STORED[orientation](upright), 512, 4512, orientation))
    counts = read_picture(tmp_path / "a.dng").counts[8:-8, 8:-8, 1] / 65535
    np.testing.assert_allclose(counts, (upright[8:-8, 8:-8] - 512) / 4000, atol=0.01)
