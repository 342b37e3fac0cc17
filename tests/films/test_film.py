"""Films of small skies by the quickest solver."""

import dataclasses
from pathlib import Path
from typing import Any

import numpy as np
import pandas
import pytest
import xarray as xr
from PIL import Image
from scipy.ndimage import median_filter

import openswim
from openswim import Camera, Ground, Scene, Solver, UserError, open_scene, readers
from openswim.colour.rgb import exposure_for
from openswim.films import CameraPath, Weather, film, making
from openswim.films.keogram import keogram
from openswim.films.kept_frames import KeptFrame
from openswim.films.titles import title, titled
from openswim.films.video import write_video
from openswim.films.whereabouts import told_of_places, told_of_times
from openswim.progress import spoken

NOON = np.datetime64("2024-06-01T12:00", "ms")
CLEAR = Scene.clear(47.0, 11.0, time=NOON)
CAMERA = Camera.allsky(47.0, 11.0, size=32)


def _scenes(minutes: list[float]) -> list[Scene]:
    return [dataclasses.replace(CLEAR, time=NOON + np.timedelta64(round(60e3 * m), "ms")) for m in minutes]


@pytest.mark.parametrize("suffix", [".mp4", ".webm"])
def test_videos_hold_every_frame_in_its_colours(tmp_path: Path, suffix: str) -> None:
    av = pytest.importorskip("av")
    colours = [(200, 60, 40), (30, 90, 200), (128, 128, 128), (20, 160, 70)] * 12
    pictures = (np.broadcast_to(np.array(c, np.uint8), (64, 96, 3)) for c in colours)
    path = tmp_path / f"film{suffix}"
    assert write_video(path, pictures, 24, "title", "comment") == 48
    with av.open(str(path)) as container:
        stream = container.streams.video[0]
        assert (stream.codec_context.colorspace, stream.codec_context.color_range) == (1, 1)
        frames = [
            f.reformat(format="rgb24", src_colorspace="ITU709", dst_colorspace="ITU709").to_ndarray()
            for f in container.decode(video=0)
        ]
        assert container.metadata["title"] == "title"
    assert len(frames) == 48
    off = [np.abs(f.astype(int) - np.array(c)).max() for f, c in zip(frames, colours, strict=True)]
    assert max(off) <= 4


@pytest.mark.slow
def test_frames_of_videos_are_off_by_a_part_of_what_their_codec_loses(tmp_path: Path) -> None:
    from openswim.colour.rgb import developed
    from openswim.lighting import light
    from openswim.scene.procedural import demo_scene

    av = pytest.importorskip("av")
    scene = demo_scene(64, 64, 20)
    lights = [(1.0, light(scene, Solver("fast", quality="preview")))]
    shot = making.Shot(NOON, Camera.allsky(*scene.place, size=256))

    def shown(kind: str) -> np.ndarray:
        return developed(making._frame(lights, shot, kind, 1.0, False).light.astype(np.float32), 1.0)

    exact, video = shown("radiance"), shown("video")

    def off(picture: np.ndarray) -> float:
        return float(np.sqrt(np.mean((picture.astype(float) - exact) ** 2)))

    write_video(tmp_path / "exact.mp4", [exact] * 2, 24)
    with av.open(str(tmp_path / "exact.mp4")) as container:
        decoded = next(container.decode(video=0))
    decoded = decoded.reformat(format="rgb24", src_colorspace="ITU709", dst_colorspace="ITU709").to_ndarray()
    assert 0 < off(shown("pictures")) < 0.135
    assert off(video) < 0.13 * off(decoded)  # rms adds by squares: a hundredth of the whole


def test_static_film_does_not_flicker(tmp_path: Path) -> None:
    scenes, lines = _scenes([0, 1, 2, 3]), tmp_path / "k.png"
    folder = film(scenes, CAMERA, tmp_path / "frames", title=False, solver="swim", keogram=lines)
    files = sorted(folder.glob("*.png"))
    assert len(files) == 4
    means = np.array([np.asarray(Image.open(f), float).mean() for f in files])
    assert np.abs(np.diff(means) / means[:-1]).max() < 0.005
    kept = np.asarray(Image.open(lines))
    np.testing.assert_array_equal(kept[:, 0], np.asarray(Image.open(files[0]))[:, 16])
    assert not list(tmp_path.glob(".*"))


def test_star_trails_turn_about_the_pole_and_irradiance_is_that_of_single_renderings(tmp_path: Path) -> None:
    """A night's frames leave trails that no frame has, each as bright as in its own; the day's frame leaves none."""
    at = [np.datetime64(f"2024-01-10T{time}", "ms") for time in ("12:00", "22:00", "22:30", "23:00")]
    scenes = [dataclasses.replace(CLEAR, time=time) for time in at]
    camera = Camera.perspective(47.0, 11.0, azimuth_deg=0.0, altitude_deg=47.0, fov_deg=60, size=(120, 120))
    trails, curve = tmp_path / "trails.png", tmp_path / "curve.csv"
    exposure = 0.5 * exposure_for(openswim.render(scenes[1], camera, "swim"), "auto")
    also = {"star_trails": trails, "irradiance": curve}
    frames = film(scenes, camera, tmp_path / "frames", title=False, solver="swim", exposure=exposure, **also)
    night = [np.asarray(Image.open(f), float) for f in sorted(frames.glob("*.png"))[1:]]
    found = np.asarray(Image.open(trails), float)
    np.testing.assert_allclose(found, np.max(night, axis=0), atol=2.0)  # two roundings, each with its dither
    grey = [each.mean(axis=-1) for each in (*night, found)]
    stars = [int((each - median_filter(each, 9) > 12).sum()) for each in grey]
    assert stars[-1] > 2 * max(stars[:-1]) > 160
    table = pandas.read_csv(curve, parse_dates=["valid_time"])
    assert [np.datetime64(time.tz_localize(None), "ms") for time in table["valid_time"]] == at
    single = openswim.render(scenes[0], camera, "swim").attrs
    for name in ("global_horizontal_irradiance_w_m2", "sun_altitude_deg"):
        assert table[name][0] == pytest.approx(single[name], rel=1e-6)
    assert table["sun_altitude_deg"][1] < -20
    assert 0 < table["illuminance_lx"][1] < 0.1
    assert 1e-7 < table["global_horizontal_irradiance_w_m2"][1] < 1e-3  # of a night without a moon


def test_star_trails_and_curves_are_refused_before_the_work(tmp_path: Path) -> None:
    scenes = _scenes([0, 1])
    for given, line in (({"star_trails": tmp_path / "t.png"}, "no frame has the sun 8 degrees below"),
                        ({"star_trails": tmp_path / "t.gif"}, "give a picture's name"),
                        ({"irradiance": tmp_path / "t.txt"}, "suffix '.txt' is unknown")):  # fmt: skip
        with pytest.raises(UserError, match=line):
            film(scenes, CAMERA, tmp_path / "frames", solver="swim", **given)
        assert not list(tmp_path.iterdir())


def test_a_film_replaces_nothing_that_it_reads_nor_its_own_outputs(tmp_path: Path) -> None:
    model, way, store = tmp_path / "run.nc", tmp_path / "way.csv", tmp_path / "run.zarr"
    CLEAR.to_netcdf(model)
    CLEAR.to_zarr(store)
    way.write_text("time,lat,lon,height_m\n2024-06-01T12:00:00Z,47,11,900\n2024-06-01T12:00:01Z,47,11.01,900\n")
    before = model.read_bytes(), way.read_bytes()
    frames = tmp_path / "frames"
    frames.mkdir()
    for output, weather, given, line in (
        (frames, model, {"irradiance": model}, "run.nc: would replace .*run.nc, which is needed"),
        (frames, model, {"irradiance": way, "path": way}, "way.csv: would replace .*way.csv, which is needed"),
        (store, store, {}, "film .*run.zarr: would replace .*run.zarr, which is needed"),
        (frames, model, {"keogram": frames / "frame_000001.png"}, "keogram .*: lies in .*frames, another output"),
    ):
        with pytest.raises(UserError, match=line):
            film(weather, CAMERA, output, solver="swim", **given)
    assert (model.read_bytes(), way.read_bytes()) == before
    assert sorted(path.name for path in tmp_path.iterdir()) == ["frames", "run.nc", "run.zarr", "way.csv"]


def test_a_film_that_was_stopped_goes_on_with_the_same_frames(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from openswim.films import making

    scenes = _scenes([0, 60, 120])
    whole = film(scenes, CAMERA, tmp_path / "whole", solver="swim")
    real, calls = making._frame, []

    def stops(*arguments: object) -> KeptFrame:
        calls.append(1)
        if len(calls) == 3:
            raise KeyboardInterrupt
        return real(*arguments)

    monkeypatch.setattr(making, "_frame", stops)
    with pytest.raises(KeyboardInterrupt):
        film(scenes, CAMERA, tmp_path / "film", solver="swim")
    assert not (tmp_path / "film").exists()
    found = film(scenes, CAMERA, tmp_path / "film", solver="swim")
    assert len(calls) == 4  # the one that was cut, again
    for one in sorted(whole.glob("*.png")):
        np.testing.assert_array_equal(np.asarray(Image.open(one)), np.asarray(Image.open(found / one.name)))


def test_a_model_that_changes_meanwhile_is_not_mixed_with_itself(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    model, real, frames = tmp_path / "run.nc", making._frame, []
    CLEAR.to_netcdf(model)

    def changes(*arguments: object) -> KeptFrame:
        CLEAR.to_netcdf(model)
        frames.append(1)
        return real(*arguments)

    later: Any = dict(solver="swim", path=CameraPath(NOON + np.arange(2) * np.timedelta64(80, "ms"),
                                                     np.array([[47.0, 11.0, 900.0]] * 2), np.full((2, 4), np.nan)))
    monkeypatch.setattr(making, "_frame", changes)
    with pytest.raises(UserError, match=r"run.nc: has changed while the film was made: make it again"):
        film(model, CAMERA, tmp_path / "film", **later)
    assert len(frames) == 1  # the others are not made in vain
    assert not (tmp_path / "film").exists()
    monkeypatch.setattr(making, "_frame", real)
    assert film(model, CAMERA, tmp_path / "film", **later).is_dir()
    assert not list(tmp_path.glob(".*"))


def test_radiance_of_all_frames_is_that_of_single_pictures(tmp_path: Path) -> None:
    import openswim

    scenes = _scenes([0, 240])
    path = film(scenes, CAMERA, tmp_path / "film.zarr", solver="swim")
    with xr.open_dataset(path, engine="zarr") as found:
        assert found.radiance.dims == ("frame", "y", "x", "wavelength")
        np.testing.assert_array_equal(found.time.values, [s.time for s in scenes])
        single = openswim.render(scenes[1], CAMERA, Solver("swim"))
        np.testing.assert_allclose(found.radiance[1].values, single.radiance.values, rtol=1e-6)


def test_tables_along_a_path_have_its_own_times_and_places(tmp_path: Path) -> None:
    """The weather is of one time, and so is the light of so short a path; places are as decimal as the path's."""
    curve = tmp_path / "curve.csv"
    film(CLEAR, CAMERA, tmp_path / "f.zarr", path=_way([8.4, 8.47, 8.56]), frames_per_second=2, solver="swim",
         irradiance=curve)  # fmt: skip
    lines = [line.split(",") for line in curve.read_text().splitlines()]
    column = {name: [line[n] for line in lines[1:]] for n, name in enumerate(lines[0])}
    assert column["time"] == [f"2024-06-01T12:00:0{n / 2:.3f}Z" for n in range(5)]
    assert set(column["valid_time"]) == {"2024-06-01T12:00:00Z"}
    assert set(column["light_time"]) == {"2024-06-01T12:00:01Z"}
    assert column["longitude"][::2] == ["8.4", "8.47", "8.56"]
    assert max(len(each) for name in ("longitude", "latitude", "height_m") for each in column[name]) <= 12
    with xr.open_dataset(tmp_path / "f.zarr", engine="zarr") as found:
        np.testing.assert_array_equal(found.time.values, NOON + np.timedelta64(500, "ms") * np.arange(5))


def test_a_film_over_another_ground_is_another_film(tmp_path: Path) -> None:
    """Maps count by what they hold, not by their names."""
    names = [tmp_path / name for name in ("one.tif", "same.tif", "other.tif")]
    for name, content in zip(names, (b"grass", b"grass", b"snow"), strict=True):
        name.write_bytes(content)
    scenes = [dataclasses.replace(CLEAR, ground=Ground(albedo=name)) for name in (*names, tmp_path / "none.tif")]
    one, same, other, none = (Weather.of_scenes([scene]).identity for scene in scenes)
    assert one == same
    assert len({tuple(each) for each in (one, other, none)}) == 3


def test_what_cannot_be_a_film_is_refused_before_any_work(tmp_path: Path) -> None:
    with pytest.raises(UserError, match="suffix"):
        film(CLEAR, CAMERA, tmp_path / "film.avi")
    with pytest.raises(UserError, match=r"no frames --from 2134-[^ ]*; the model's times are 20\d\d-.* to 20\d\d-"):
        film(_scenes([0, 600]), CAMERA, tmp_path / "film", from_time="2134-01-01")
    with pytest.raises(UserError, match="at most"):
        film(_scenes([0, 600]), CAMERA, tmp_path / "film.zarr", every_s=0.001)
    with pytest.raises(UserError, match=r"film .*none/der: folder .*none does not exist; make it first"):
        film(CLEAR, CAMERA, tmp_path / "none" / "der")
    (tmp_path / "mine").mkdir()
    (tmp_path / "mine" / "letter.txt").write_text("x")
    with pytest.raises(UserError, match="which is no frame"):
        film(CLEAR, CAMERA, tmp_path / "mine")


def test_titles_say_time_place_and_model() -> None:
    facts = {"valid_time": "2024-06-01T12:00:00Z", "light_time": "2024-06-01T13:00:00Z", "latitude": 47.0,
             "longitude": 371.0, "height_m": 2.0, "source": "wrfout_d01: WRF V4"}  # fmt: skip
    times = ["2024-06-01 12:00:00 UTC", "light of 2024-06-01 13:00:00 UTC"]
    assert title(facts) == [*times, "47.00 N 11.00 E", "wrfout_d01", "2 m"]
    soon = facts | {"light_time": "2024-06-01T12:02:00Z", "height_above": "sea level"}
    assert title(soon) == [times[0], "47.00 N 11.00 E", "wrfout_d01", "2 m above sea level"]
    along = [facts | {"time": f"2024-06-01T{own}Z"} for own in ("12:57:07.500", "12:20:00.000")]
    assert [title(each)[1] for each in along] == ["light of 2024-06-01 12:57:07 UTC", times[1]]
    for metres, text in ((84.4, "84 m"), (1234.0, "1.2 km"), (12345.0, "12 km")):
        assert title(facts | {"ahead": "liquid", "ahead_m": metres})[-2:] == ["2 m", f"liquid {text} ahead"]
    picture = np.full((120, 320, 3), 90, np.uint8)
    drawn = titled(picture, facts)
    assert drawn.shape == picture.shape
    assert drawn[-9:].max() > 150
    np.testing.assert_array_equal(drawn[:90], 90)
    # where room ends whole parts are left out, the last ones first: the model does not go with what is ahead
    near, far = (titled(picture, facts | {"ahead": "liquid", "ahead_m": m}) for m in (84.4, 12345.0))
    np.testing.assert_array_equal(near, far)


def test_outputs_of_a_film_have_names_of_their_own(tmp_path: Path) -> None:
    name = tmp_path / "k.png"
    with pytest.raises(UserError, match=r"star trails .*k\.png: another output has this name"):
        film(CLEAR, CAMERA, tmp_path / "f.mp4", keogram=name, star_trails=name)


def test_keogram_fills_its_width() -> None:
    lines = [np.full((10, 3), 10 * n, np.uint8) for n in range(4)]
    found = keogram(lines, 8)
    assert found.shape == (10, 8, 3)
    np.testing.assert_array_equal(found[0, :, 0], [0, 0, 10, 10, 20, 20, 30, 30])


def test_frames_of_other_weather_are_not_taken(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Scenes of the same source, times and camera, over dark and over bright ground."""
    from openswim.films import making

    def stops(*_: object) -> None:
        raise KeyboardInterrupt

    dark, bright = (Scene.clear(47.0, 11.0, time=NOON, surface_albedo=albedo) for albedo in (0.05, 0.9))
    camera = Camera.allsky(47.0, 11.0, height_m=500.0, size=16, centre="nadir")
    monkeypatch.setattr(making, "write_film", stops)
    with pytest.raises(KeyboardInterrupt):
        film(dark, camera, tmp_path / "film", solver="swim", exposure=1.0)
    monkeypatch.undo()
    found = film(bright, camera, tmp_path / "film", solver="swim", exposure=1.0)
    expected = film(bright, camera, tmp_path / "new", solver="swim", exposure=1.0)
    one, other = (np.asarray(Image.open(folder / "frame_000001.png")) for folder in (found, expected))
    np.testing.assert_array_equal(one, other)


def test_a_blend_of_two_lights_says_its_own_time_and_sun() -> None:
    from openswim.films.making import _between

    noon = "2024-06-01T12:00:00Z"
    one = {"valid_time": noon, "light_time": noon, "sun_azimuth_deg": 359.0, "n": 1.0}
    other = {"valid_time": noon, "light_time": "2024-06-01T12:05:00Z", "sun_azimuth_deg": 1.0, "n": 3.0}
    found = _between(one, other, 0.5, np.datetime64("2024-06-01T12:02:30"))
    assert found["light_time"] == "2024-06-01T12:02:30Z"
    assert "valid_time" not in found
    assert found["n"] == 2.0
    for before, after, expected in ((359.5, 0.7, 0.1), (0.7, 359.5, 0.1), (359.0, 0.4, 359.7)):
        one["sun_azimuth_deg"], other["sun_azimuth_deg"] = before, after
        found = _between(one, other, 0.5, np.datetime64("2024-06-01T12:02:30"))
        assert found["sun_azimuth_deg"] == pytest.approx(expected)


def test_a_short_path_is_lit_once_and_a_long_one_again_and_again() -> None:
    from openswim.films.making import Shot, _Lights
    from openswim.films.weather import Weather

    for seconds, count in ((120, 1), (240, 2), (1500, 6)):
        times = NOON + np.timedelta64(1000, "ms") * np.arange(0, seconds + 1, 10)
        lights = _Lights(Weather.of_scenes([CLEAR]), Solver("swim"), [550.0], [Shot(t, CAMERA) for t in times], 300.0)
        assert len(lights._nodes) == count
        assert lights._nodes[0] - NOON == times[-1] - lights._nodes[-1]
        shares = lights.at(times[len(times) // 3])
        assert sum(share for share, _ in shares) == pytest.approx(1.0)
        assert len(shares) == min(count, 2)


def test_light_that_is_not_shown_any_more_is_not_held_while_other_light_is_solved(monkeypatch, request) -> None:
    import gc
    import weakref

    from openswim.films import making
    from openswim.films.weather import Weather

    gc.collect()
    gc.freeze()  # what other tests have left in this process is not looked through each time
    request.addfinalizer(gc.unfreeze)
    held: list[weakref.ref] = []
    alive = []
    solve = making.light

    def solved(*args, **options):
        gc.collect()
        alive.append(sum(ref() is not None for ref in held))
        found = solve(*args, **options)
        held.append(weakref.ref(found))
        return found

    monkeypatch.setattr(making, "light", solved)
    times = NOON + np.timedelta64(600_000, "ms") * np.arange(3)
    shots = [making.Shot(time, CAMERA) for time in times]
    lights = making._Lights(Weather.of_scenes([CLEAR]), Solver("swim"), [550.0], shots, None)
    for time in times:
        lights.at(time)
    assert alive == [0, 0, 0]
    alive.clear()
    held.clear()
    blended = making._Lights(Weather.of_scenes([CLEAR]), Solver("swim"), [550.0], shots, 300.0)
    for minutes in (2, 4, 8, 12):
        blended.at(NOON + np.timedelta64(60_000 * minutes, "ms"))
    assert alive == [0, 1, 1]


def _boxes(centres: list[float]) -> Weather:
    """Cloudless scenes an hour apart, 2 degrees wide, about latitude 47 and longitudes that are the centres."""
    axis = np.linspace(-1.0, 1.0, 5)
    return Weather.of_scenes([
        Scene.from_arrays(None, lon + axis, 47.0 + axis, [500.0, 3000.0], crs="+proj=longlat +R=6371000",
                          time=NOON + np.timedelta64(n, "h"))
        for n, lon in enumerate(centres)
    ])  # fmt: skip


def _way(lon: list[float], height_m: float = 2000.0) -> CameraPath:
    times = NOON + np.timedelta64(1000, "ms") * np.arange(len(lon))
    place = np.column_stack([np.full(len(lon), 47.0), lon, np.full(len(lon), height_m)])
    return CameraPath(times, place, np.full((len(lon), 4), np.nan))


def _told(sky: Weather, way: CameraPath) -> str:
    return told_of_places(sky, way.time, way.camera(CAMERA, way.time))


def test_a_path_far_outside_the_domain_is_refused_before_any_light_is_solved(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(making, "light", None)
    line = r"at latitude 47.00, longitude 84.00 at 2024-06-01T12:00:01Z, \d+ km outside .* longitude 10.00 to 12.00"
    with pytest.raises(UserError, match=line):
        film(_boxes([11.0]), CAMERA, tmp_path / "film", path=_way([11.0, 84.0]), frames_per_second=1)
    with pytest.raises(UserError, match="the observer is outside the domain: it covers"):
        film(_boxes([11.0]), Camera.allsky(47.0, 13.0, size=32), tmp_path / "film")
    assert not list(tmp_path.iterdir())


def test_a_path_beside_the_domain_is_told_as_far_as_clouds_are_seen() -> None:
    """A degree of longitude is 75.8 km there; clouds show well up to 200 km beyond the horizon of the eye, which is
    160 km away at 2000 m and 357 km at 10 km."""
    sky = _boxes([11.0])
    assert _told(sky, _way([10.0, 12.0])) == ""
    told = _told(sky, _way([11.0, 12.1, 16.0]))
    assert told.startswith("2 of 3 frames are outside the domain, the first at latitude 47.00, longitude 12.10 at 2024")
    with pytest.raises(UserError, match="too far to see its clouds"):
        _told(sky, _way([11.0, 17.0]))
    assert _told(sky, _way([11.0, 17.0], 10_000.0))
    assert _told(sky, _way([11.0, 170.0], 4e5)) == ""  # from space all is seen that there is


def test_a_camera_that_a_nest_leaves_is_refused_beforehand() -> None:
    sky = _boxes([11.0, 14.0])
    cameras = [Camera.allsky(47.0, 11.5, size=32)] * 2
    assert told_of_places(sky, sky.times[:1], cameras[:1]) == ""
    with pytest.raises(UserError, match=r"that the model has from 2024-06-01T13:00.*longitude 13.00 to 15.00"):
        told_of_places(sky, sky.times, cameras)


def test_tables_of_frames_between_times_say_that_clouds_have_drifted(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(making, "_plan", lambda *_: 1 / 0)  # after what is told
    for times, every_s, curve, told in (
        ([0, 240], 600.0, "curve.csv", 1), ([0, 240], None, "curve.csv", 0), ([0, 240], 600.0, None, 0),
        ([0], 600.0, "curve.csv", 0),
    ):  # fmt: skip
        irradiance = None if curve is None else tmp_path / curve
        with spoken(), pytest.raises(ZeroDivisionError):
            film(_scenes(times), CAMERA, tmp_path / "film", every_s=every_s, irradiance=irradiance)
        assert capsys.readouterr().err.count("lie elsewhere than in a picture of the same time") == told


def test_weather_that_is_of_another_time_is_told() -> None:
    def told(hours: list[float], asked: list[float]) -> str:
        return told_of_times(*(NOON + np.array([round(3.6e6 * h) for h in each], "timedelta64[ms]")
                               for each in (hours, asked)))  # fmt: skip

    assert told([0], [-2.9, 2.9]) == told([0, 1], [-0.9, 0.5, 1.9]) == told([0, 6], [-5, 11]) == ""
    assert told([0], [3.5, 11]) == (
        "weather of 2024-06-01T12:00:00Z, light of 2024-06-01T23:00:00Z, 11.0 hours after it: clouds do not move "
        "between them"
    )
    assert "light of 2024-06-01T10:30:00Z, 1.5 hours before it" in told([0, 1], [-1.5, 0.5])


@pytest.mark.parametrize(("altitude", "ahead"), [(-30.0, "land"), (30.0, None)])
def test_a_camera_that_looks_one_way_knows_what_is_ahead(tmp_path: Path, altitude: float, ahead: str | None) -> None:
    from openswim.films.making import Shot, _frame
    from openswim.lighting import light

    camera = Camera.perspective(47.0, 11.0, height_m=500.0, altitude_deg=altitude, size=16)
    facts = _frame([(1.0, light(CLEAR, Solver("swim")))], Shot(NOON, camera), "pictures", 1.0, False).facts
    assert facts.get("ahead") == ahead
    assert ahead is None or facts["ahead_m"] == pytest.approx(1000.0, rel=1e-3)


def test_of_many_files_each_time_opens_its_own(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for n, scene in enumerate(_scenes([0, 5, 10])):
        scene.to_netcdf(tmp_path / f"sky_{n}.nc")
    asked: list[list[str]] = []

    def counted(path: list[Path], **options: object) -> Scene:
        asked.append([each.name for each in path])
        return open_scene(path, **options)

    monkeypatch.setattr(readers, "open_scene", counted)
    weather = Weather.of_files(tmp_path / "sky_*.nc")
    assert [weather.at(time).time for time in weather.times] == list(weather.times)
    assert asked == [["sky_0.nc"], ["sky_1.nc"], ["sky_2.nc"]]
