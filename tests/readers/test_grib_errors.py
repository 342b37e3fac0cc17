"""Bad GRIB files: one line that names the file and the remedy, or a repair that is stated."""

from __future__ import annotations

import builtins
import struct
import sys

import numpy as np
import pytest
from tests.readers import grib_files as gf

from openswim.errors import UserError
from openswim.readers import describe, open_scene
from openswim.readers.grib.images import fits


def _error(path, **options) -> str:
    with pytest.raises(UserError) as caught:
        open_scene(path, **options)
    message = str(caught.value)
    assert "\n" not in message
    assert message.count(str(path)) == 1
    return message


def _changed(tmp_path, product, parameter, level=None, **change):
    for one in product.messages:
        if one.parameter == parameter and level in (None, one.level[1]):
            for name, value in change.items():
                setattr(one, name, value)
    return gf.write(tmp_path / "file", product)


@pytest.mark.parametrize("kept", [40, 3000, -3])
def test_truncated(tmp_path, kept):
    path = gf.write(tmp_path / "file", gf.hrrr(levels=3))
    path.write_bytes(path.read_bytes()[:kept])
    assert "download it again" in _error(path)


@pytest.mark.parametrize("edition", [1, 2])
def test_damage_between_messages(tmp_path, edition):
    product = gf.ifs(gf.AROME, levels=3, edition=edition)
    parts = [gf.encode(product, one) for one in product.messages]
    path = tmp_path / "file"
    path.write_bytes(parts[0] + b"rubbish" * 200_000 + b"".join(parts[1:]))
    assert "no GRIB message 2" in _error(path)
    path.write_bytes(parts[0][:-4] + b"777x" + b"".join(parts[1:]))
    assert "no end mark" in _error(path)


def test_padding_and_bulletin_headings_are_skipped(tmp_path):
    product = gf.hrrr(levels=3)
    parts = [gf.encode(product, one) for one in product.messages]
    path = tmp_path / "file"
    path.write_bytes(b"\r\n".join(b"ZYXW01 KWBC 211200\r\r\n" + part for part in parts) + b"\0" * 5000)
    assert open_scene(path).grid.shape[0] == 3


def test_a_grid_of_terabytes_is_refused_before_it_is_decoded(tmp_path):
    product = gf.hrrr(levels=3)
    message = bytearray(gf.encode(product, gf.Message((0, 0, 0), (105, 1), lambda lat, lon: 260.0)))
    at = message.index((31).to_bytes(4, "big") + (23).to_bytes(4, "big"))
    message[at : at + 8] = (1_000_000).to_bytes(4, "big") * 2
    points = message.index((31 * 23).to_bytes(4, "big"))
    message[points : points + 4] = (0xFFFFFFF0).to_bytes(4, "big")
    path = tmp_path / "file"
    path.write_bytes(bytes(message))
    assert "points" in _error(path)


def test_negative_noise_is_clipped_and_said_more_is_refused(tmp_path):
    path = _changed(tmp_path, gf.hrrr(), (0, 1, 22), 4, values=lambda lat, lon: -1e-9 * np.ones(lat.shape))
    scene = open_scene(path)
    assert float(scene.data.liquid_content.min()) == 0.0
    assert any("set to 0" in note for note in scene.notes)
    path = _changed(tmp_path, gf.hrrr(), (0, 1, 22), values=lambda lat, lon: -1e-3 * np.ones(lat.shape))
    assert "liquid_content runs from" in _error(path)


def test_smoke_below_zero_is_refused(tmp_path):
    path = _changed(tmp_path, gf.hrrr(), (0, 20, 0), 4, values=lambda lat, lon: -np.ones(lat.shape))
    assert "smoke runs from -1" in _error(path)


@pytest.mark.parametrize("gap", ["bitmap", "1e20", "-9999"])
def test_gaps_in_contents_are_no_cloud_and_said(tmp_path, gap):
    def west(lat, lon):
        return lon < 237.5

    product = gf.hrrr()
    for one in product.messages:
        if one.parameter == (0, 1, 22) and one.level[1] == 4:
            if gap == "bitmap":
                one.missing = west
            else:
                one.values = lambda lat, lon: np.where(west(lat, lon), float(gap), 1e-4)
    product.packing = "grid_simple" if gap == "bitmap" else "grid_ieee"
    scene = open_scene(gf.write(tmp_path / "file", product))
    lon, lat = scene.grid.lonlat(np.arange(31), np.arange(23)[:, None])
    missing = west(lat, lon % 360)
    assert 0 < missing.sum() < missing.size
    level = scene.data.liquid_content.values[3]
    assert not level[missing].any()
    assert (level[~missing] > 0).all()
    assert any(f"liquid_content: {missing.sum()} missing values" in note for note in scene.notes)


def test_gaps_below_the_terrain_are_filled_from_above(tmp_path):
    product = gf.on_pressure(gf.AROME)
    whole = open_scene(gf.write(tmp_path / "whole", product))
    for one in product.messages:
        if one.level[1] >= 95_000:
            one.missing = lambda lat, lon, p=one.level[1]: gf.terrain_m(lat, lon) > gf.height_at(p)
    scene = open_scene(gf.write(tmp_path / "file", product))
    np.testing.assert_allclose(scene.data.air_temperature, gf.TEMPERATURE_K, atol=1e-3)
    assert any("temperature:" in note and "filled" in note for note in scene.notes)
    # 1000 hPa lies below the ground nearly everywhere: left out; where 950 hPa does, its height is extended down
    assert scene.grid.shape[0] == whole.grid.shape[0] - 1
    assert any("1 pressure levels without data" in note for note in scene.notes)
    np.testing.assert_allclose(scene.grid.height_m, whole.grid.height_m[1:], atol=2.0)
    kept = whole.data.liquid_content.values[1:] + whole.data.ice_content.values[1:]
    above = scene.grid.height_m > scene.data.surface_altitude.values
    found = (scene.data.liquid_content + scene.data.ice_content).values
    np.testing.assert_allclose(found[above], kept[above], rtol=1e-4)
    assert not found[~above & (scene.data.air_pressure.values > 94_000)].any()


def test_a_level_all_missing_is_refused(tmp_path):
    path = _changed(tmp_path, gf.hrrr(), (0, 0, 0), 5, missing=lambda lat, lon: lat < 99)
    assert "temperature on level 5 is missing" in _error(path)


def test_levels_that_cross_are_refused(tmp_path):
    path = _changed(tmp_path, gf.hrrr(), (0, 3, 5), 6, values=lambda lat, lon: 100.0)
    assert "heights are not monotonic" in _error(path)


def test_contents_without_temperature(tmp_path):
    product = gf.hrrr()
    product.messages = [one for one in product.messages if not (one.parameter == (0, 0, 0) and one.level[1] == 2)]
    scene = open_scene(gf.write(tmp_path / "file", product))
    assert scene.grid.shape[0] == 11
    assert any("liquid_content on levels 2 is left out" in note for note in scene.notes)
    product.messages = [one for one in product.messages if not (one.parameter == (0, 0, 0) and one.level[1] > 5)]
    assert "have no temperature" in _error(gf.write(tmp_path / "file", product))


def test_repeated_messages_count_once(tmp_path):
    product = gf.hrrr()
    once = open_scene(gf.write(tmp_path / "once", product))
    product.messages = product.messages * 2
    twice = open_scene(gf.write(tmp_path / "twice", product))
    np.testing.assert_array_equal(once.data.liquid_content, twice.data.liquid_content)
    assert any("come twice" in note for note in twice.notes)


def test_one_level_that_comes_twice_is_one_level(tmp_path):
    product = gf.hrrr()
    warm = next(one for one in product.messages if one.parameter == (0, 0, 0))
    product.messages = [one for one in product.messages if one.level[0] != warm.level[0]] + [warm, warm]
    scene = open_scene(gf.write(tmp_path / "file", product))
    assert any("no temperature on levels" in note for note in scene.notes)


@pytest.mark.parametrize("look", [open_scene, describe])
def test_faults_of_parsing_are_one_line(tmp_path, monkeypatch, look):
    path = gf.write(tmp_path / "file", gf.hrrr(levels=3))

    def fails(columns):
        raise IndexError("list index out of range")

    monkeypatch.setattr("openswim.readers.grib.reader.air_of", fails)
    with pytest.raises(UserError, match=r"file: cannot be read: damaged"):
        look(path)


def test_hybrid_levels_without_a_surface(tmp_path):
    product = gf.ifs(gf.AROME, levels=4)
    product.messages = [one for one in product.messages if one.parameter != (0, 3, 25)]
    assert "add surface pressure" in _error(gf.write(tmp_path / "file", product))
    product = gf.ifs(gf.AROME, levels=4)
    product.messages = [one for one in product.messages if one.parameter != (0, 3, 4)]
    scene = open_scene(gf.write(tmp_path / "file", product))
    assert any("no surface geopotential" in note for note in scene.notes)


def test_files_without_anything_on_levels(tmp_path):
    product = gf.hrrr()
    product.messages = [one for one in product.messages if one.level[0] != 105]
    scene = open_scene(gf.write(tmp_path / "file", product))
    assert scene.species == []
    assert any("no clouds" in note for note in scene.notes)
    product.messages = [gf.Message((0, 16, 196), (10, 0), lambda lat, lon: 5.0)]
    path = gf.write(tmp_path / "file", product)
    assert "0.16.196" in _error(path)
    with pytest.raises(UserError, match="no field a scene can use"):
        describe(path)


def test_a_time_that_is_not_there(tmp_path):
    path = gf.write(tmp_path / "file", gf.hrrr(levels=3))
    assert "it has 2024-06-21T12:00:00" in _error(path, time="2024-06-21T13:00")


def test_without_eccodes(tmp_path, monkeypatch):
    path = gf.write(tmp_path / "file", gf.hrrr(levels=3))
    real = builtins.__import__

    def refuse(name, *args, **kwargs):
        if name == "eccodes":
            raise ImportError(name)
        return real(name, *args, **kwargs)

    monkeypatch.delitem(sys.modules, "eccodes")
    monkeypatch.setattr(builtins, "__import__", refuse)
    assert "pip install --force-reinstall eccodes" in _error(path)


@pytest.mark.parametrize("seed", range(60))
def test_random_damage_is_an_error_or_a_scene(tmp_path, seed):
    """Bytes changed anywhere: a UserError, or a scene whose fields have passed every check."""
    rng = np.random.default_rng(seed)
    product = [gf.hrrr(levels=2), gf.ifs(gf.AROME, levels=2, edition=1), gf.icon(gf.AROME, levels=2)][seed % 3]
    whole = bytearray(gf.write(tmp_path / "file", product).read_bytes())
    for at in rng.integers(0, len(whole), 6):
        whole[at] = rng.integers(0, 256)
    starts = [at for at in range(len(whole) - 4) if whole[at : at + 4] == b"GRIB"]
    whole[rng.choice(starts) + rng.integers(4, 150)] = rng.integers(0, 256)
    (tmp_path / "file").write_bytes(bytes(whole))
    try:
        scene = open_scene(tmp_path / "file")
    except UserError:
        return
    assert all(np.isfinite(field).all() for field in scene.data.values())


@pytest.mark.parametrize("percent", [-1.0, 300.0])
def test_snow_that_covers_less_than_nothing_or_more_than_all_is_told(tmp_path, percent):
    product = gf.hrrr(levels=6)
    for message in product.messages:
        if message.parameter == (0, 1, 42):
            message.values = lambda lat, lon: percent * (1 + 0.01 * lat)
    notes = open_scene(gf.write(tmp_path / "file.grib", product)).notes
    assert any(note.startswith("snow_cover runs from ") for note in notes)


def test_an_image_larger_than_its_grid_is_refused(tmp_path):
    """ecCodes writes past its memory then, and ends the program."""
    good = gf.write(tmp_path / "good", gf.hrrr(levels=4, packing="grid_jpeg")).read_bytes()
    at = good.index(b"\xff\x4f\xff\x51") + 14
    assert good[at : at + 2] == (23).to_bytes(2, "big")  # rows, the lower half of four bytes
    path = tmp_path / "spoilt"
    path.write_bytes(good[:at] + b"\x40" + good[at + 1 :])
    with pytest.raises(UserError, match="the image of its data is not its grid's"):
        open_scene(path)


def test_a_png_has_a_pixel_for_each_value():
    head = b"\x89PNG\r\n\x1a\n" + (13).to_bytes(4, "big") + b"IHDR" + struct.pack(">2I", 31, 23) + b"\x10\0\0\0\0"
    for template, count, fit in ((41, 713, True), (41, 712, False), (40, 713, False), (0, 712, True)):
        section5 = b"\0\0\0\0\5" + count.to_bytes(4, "big") + template.to_bytes(2, "big")
        assert fits(section5, b"\0\0\0\0\7" + head) is fit


@pytest.mark.parametrize(("edition", "hours", "told"), [(1, 240, ""), (1, 1000, "42"), (2, 384, ""), (2, 1000, "42")])
def test_a_forecast_for_longer_than_weather_is_told(tmp_path, edition, hours, told):
    product = gf.on_pressure(gf.AROME, edition=edition)
    for one in product.messages:
        one.keys = {"stepRange" if edition == 1 else "forecastTime": hours}
    notes = [note for note in open_scene(gf.write(tmp_path / "file", product)).notes if "after its analysis" in note]
    assert notes == ([f"valid {told} days after its analysis: is that what the file means?"] if told else [])


@pytest.mark.parametrize(("unit", "count"), [(255, 0), (3, 2**31 - 1), (2, 2**31 - 1)])
def test_forecasts_for_ages_are_refused_before_their_days_are_counted(tmp_path, unit, count):
    """eccodes counts them one by one, for minutes, or without end."""
    product = gf.on_pressure(gf.AROME, edition=2)
    product.messages[0].keys = {"indicatorOfUnitOfTimeRange": unit, "forecastTime": count}
    with pytest.raises(UserError, match=f"message 1 is a forecast of {count} times unit {unit}: damaged"):
        open_scene(gf.write(tmp_path / "file", product))


def test_an_analysis_of_edition_1_needs_no_unit(tmp_path):
    product = gf.on_pressure(gf.AROME, edition=1)
    for one in product.messages:
        one.keys = {"indicatorOfUnitOfTimeRange": 255}
    assert open_scene(gf.write(tmp_path / "file", product)).time == np.datetime64("2024-06-21T12:00")


@pytest.mark.parametrize("edition", [1, 2])
def test_an_hour_that_no_day_has_is_refused(tmp_path, edition):
    product = gf.on_pressure(gf.AROME, edition=edition)
    for one in product.messages:
        one.keys = {"dataTime": 2500}
    with pytest.raises(UserError, match="message 1 begins at 2500"):
        open_scene(gf.write(tmp_path / "file", product))
