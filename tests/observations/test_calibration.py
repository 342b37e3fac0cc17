"""Cameras found again from their pictures, and refused where pictures do not give them."""

import re
import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from PIL import Image
from tests.observations.skies import EQUISOLID, LAT, LON, mounted, spot_frame, star_frame

from openswim.cameras import Lens
from openswim.cameras.files import FrameSettings, load_camera, read_camera, write_camera
from openswim.cameras.obstacles import Mask
from openswim.cameras.picture_files import read_picture
from openswim.cli.main import run
from openswim.errors import UserError
from openswim.heavens.bent_rays import Refraction
from openswim.heavens.points import Points, drawn_points, points_over
from openswim.lights import star_positions, sun_position
from openswim.observations.blind import starts
from openswim.observations.calibration import calibrate, check
from openswim.observations.frames import read_frame
from openswim.observations.peaks import find_peaks
from openswim.observations.report import write_report
from openswim.observations.sun_spot import find_spot, stray_deg
from openswim.scene.atmosphere import Atmosphere
from openswim.scene.frame import horizon_vector

NIGHT = "2024-01-15T22:00"
DAY = [np.datetime64("2024-06-10T06:00") + np.timedelta64(55 * i, "m") for i in range(11)]


def worst_deg(camera, optics, lowest_deg=15.0):
    """The largest angle between where two cameras look, over the sky above an altitude."""
    azimuth, altitude = np.meshgrid(np.arange(0, 360, 15.0), np.arange(lowest_deg, 90, 10))
    there = horizon_vector(azimuth, altitude)
    row, column = optics.project(there)
    found = horizon_vector(*camera.direction_of(row, column))
    return float(np.degrees(np.linalg.norm(found - there, axis=-1)).max())


@pytest.fixture(scope="module")
def of_stars(tmp_path_factory):
    """One night's frame of a camera, and what is found in it."""
    path = tmp_path_factory.mktemp("stars") / f"sky_{NIGHT.translate({45: None, 58: None})}00.png"
    star_frame(path, mounted(EQUISOLID), NIGHT)
    return path, calibrate(path, LAT, LON, settings=FrameSettings(utc_offset_h=0.0))


def test_the_camera_of_a_frame_is_found_again(of_stars):
    found_again(of_stars[1], mounted(EQUISOLID), "equisolid")


@pytest.mark.parametrize(
    ("lens", "options", "name"),
    [
        (Lens("stereographic", 225.0), {"mirrored": True, "rotation_deg": -140.0, "tilt_deg": 0.0}, "stereographic"),
        (Lens("kannala-brandt", 230.0, (0.03, -0.015)), {"tilt_deg": 4.0}, "polynomial, 2 coefficients"),
    ],
)
def test_a_known_camera_is_found_again(tmp_path, lens, options, name):
    """To .02 degrees over the sky above 15, from nothing but place and time."""
    optics = mounted(lens, **options)
    found_again(calibrate(star_frame(tmp_path / "stars.png", optics, NIGHT), LAT, LON, time=NIGHT), optics, name)


def found_again(found, optics, name):
    assert found.chosen.name == name
    assert worst_deg(found.camera, optics) < 0.02
    assert found.chosen.held_out_px < 0.15
    assert found.chosen.matches > 3 * found.fit.next_matches


def test_frames_of_two_nights_are_fitted_together_and_one_checks_the_other(of_stars, tmp_path):
    path, one = of_stars
    other = star_frame(tmp_path / "sky_20240320T200000.png", mounted(EQUISOLID), "2024-03-20T20:00", seed=1)
    both = calibrate([path, other], LAT, LON, settings=FrameSettings(utc_offset_h=0.0))
    assert set(both.matched.frame.tolist()) == {0, 1}
    write_camera(one.content, tmp_path / "camera.toml")
    found = check(read_camera(tmp_path / "camera.toml"), other)
    assert found.matches > 60
    assert found.median_px < 0.15
    assert not found.doubt
    late = check(read_camera(tmp_path / "camera.toml"), other, "2024-03-20T21:00")
    assert late.matches < 15
    assert late.doubt == f"no more than {late.matches} stars match"


def test_a_clock_that_is_off_looks_like_a_tilt_and_the_page_says_so(tmp_path):
    """A vertical camera whose clock is some minutes off: the fit is as good, and the words give the minutes back."""
    optics = mounted(EQUISOLID, tilt_deg=0.0)
    frame = star_frame(tmp_path / "stars.png", optics, NIGHT)
    told = np.datetime64(NIGHT) - np.timedelta64(6, "m")
    found = calibrate(frame, LAT, LON, time=told)
    assert found.chosen.held_out_px < 0.2
    minutes, way = re.search(r"([\d.]+) minutes (\w+)", found.cannot_tell[0]).groups()
    assert float(minutes) == pytest.approx(6.0, abs=0.15)
    assert way == "slow"


def test_a_frame_that_was_cut_on_one_side_gives_the_same_camera(of_stars, tmp_path):
    """Its axis is far from its middle, by .4 of half of its shorter side."""
    whole = read_picture(of_stars[0]).counts
    cut = 220
    Image.fromarray(np.ascontiguousarray(whole[:, cut:])).save(tmp_path / "cut.png")
    found = calibrate(tmp_path / "cut.png", LAT, LON, time=NIGHT)
    assert worst_deg(found.camera, mounted(EQUISOLID, centre_column=371.0 - cut), 25.0) < 0.05


def test_guesses_score_how_near_their_stars_lie_to_points():
    """As each point's distance says, to a cell of the table (2 of the 18 pixels of reach); the far ones begin where the
    near ones end, so that no guess is refined twice."""
    shape, reach = (600, 640), 18.0
    stars = star_positions(NIGHT, LAT, LON, magnitude=3.6, above_deg=12)
    direction = horizon_vector(stars.azimuth_deg, stars.refracted_altitude_deg)
    points = np.random.default_rng(2).uniform(0, 600, (90, 2))
    near, far = starts(direction, points, shape)
    assert len(near) == len(far) == 25
    for each in (*near, *far):
        places = np.stack(each.optics.project(direction[:40]), axis=-1)
        away = np.linalg.norm(places[:, None] - points, axis=-1).min(axis=1)
        assert each.score == pytest.approx(np.clip(1 - away / reach, 0, 1).sum(), abs=1.0)
    off = [max(abs(s.optics.centre_row - 299.5), abs(s.optics.centre_column - 319.5)) / 300 for s in (*near, *far)]
    assert max(off[:25]) < 0.155 < 0.19 < min(off[25:])


def test_points_anywhere_are_refused(tmp_path):
    for peaks, says in ((120, "match"), (9, "bright points")):
        frame = star_frame(tmp_path / "points.png", mounted(EQUISOLID), NIGHT, peaks=peaks)
        with pytest.raises(UserError, match=says) as caught:
            calibrate(frame, LAT, LON, time=NIGHT)
        assert "\n" not in str(caught.value)


def day_frames(tmp_path, optics, body="sun", times=DAY, **options):
    names = [f"cam_{str(t).replace('-', '').replace(':', '').replace('T', '_')}00.png" for t in times]
    return [spot_frame(tmp_path / name, optics, time, body, **options) for name, time in zip(names, times, strict=True)]


SMALL = {"centre_row": 236.0, "centre_column": 254.0, "rotation_deg": -20.0, "tilt_deg": 0.0}
UTC = FrameSettings(utc_offset_h=0.0)


@pytest.fixture(scope="module")
def day(tmp_path_factory):
    """A camera, and its frames of a day."""
    optics = mounted(Lens("equidistant", 160.0), **SMALL)
    return optics, day_frames(tmp_path_factory.mktemp("day"), optics)


def test_a_day_of_sun_gives_a_camera_and_says_what_it_leaves_open(tmp_path, day):
    optics, frames = day
    grey = spot_frame(tmp_path / "cam_20240610_170000.png", optics, DAY[5], overcast=True)
    found = calibrate([*frames, grey], LAT, LON, settings=UTC)
    assert found.by == "sun"
    assert found.chosen.held_out_px < 1.0
    assert worst_deg(found.camera, optics, 20.0) < 0.4
    assert any("tilt" in line for line in found.cannot_tell)
    assert any("clock" in line for line in found.cannot_tell)
    assert found.fit.left_out == ("cam_20240610_170000.png: no sun in this frame",)
    write_camera(found.content, tmp_path / "camera.toml")
    with pytest.raises(UserError, match="degrees high: a camera is checked by the stars"):
        check(read_camera(tmp_path / "camera.toml"), frames[5])


def test_a_sun_that_is_not_where_camera_and_time_have_it_is_told(tmp_path, day, capsys):
    """As by a clock an hour off; not under cloud, and not where a mask hides the sun."""
    optics, frames = day
    content = calibrate(frames, LAT, LON, settings=UTC).content
    camera, noon = content.camera, DAY[5]
    seen = read_frame(frames[5], settings=UTC)
    for time, low, high in ((noon, 0, 1), (noon + np.timedelta64(60, "m"), 8, 20)):
        sun = sun_position(time, LAT, LON)
        assert low <= stray_deg(seen, camera, sun.azimuth_deg, sun.refracted_altitude_deg) <= high
    hidden = replace(camera, mask=Mask(np.ones(camera.shape, bool), "all"))
    assert np.isnan(stray_deg(seen, hidden, sun.azimuth_deg, sun.refracted_altitude_deg))
    grey = spot_frame(tmp_path / "grey_20240610_120000.png", optics, noon, overcast=True)
    assert np.isnan(stray_deg(read_frame(grey, settings=UTC), camera, sun.azimuth_deg, sun.refracted_altitude_deg))
    write_camera(content, tmp_path / "camera.toml")
    for hour, notes in ((0, 0), (1, 1)):
        options = ["--solver", "swim", "--size", "60", "--utc-offset", str(hour), "-o", str(tmp_path / f"out{hour}")]
        run(["compare", "--clear", str(frames[5]), "--camera", str(tmp_path / "camera.toml"), *options])
        assert capsys.readouterr().err.count("degrees from where its camera and time have the sun") == notes


def test_suns_of_two_seasons_tell_the_tilt(tmp_path):
    optics = mounted(Lens("equisolid", 160.0), **(SMALL | {"tilt_deg": 3.0}))
    winter = [np.datetime64("2024-01-10T08:30") + np.timedelta64(50 * i, "m") for i in range(8)]
    frames = day_frames(tmp_path, optics, times=[*DAY, *winter])
    found = calibrate(frames, LAT, LON, settings=UTC)
    assert found.fit.tilt_told
    assert worst_deg(found.camera, optics, 20.0) < 0.4
    assert not any("tilt" in line for line in found.cannot_tell)


def test_a_night_of_moon_gives_a_camera(tmp_path):
    optics = mounted(Lens("equidistant", 160.0), **SMALL)
    night = [np.datetime64("2023-11-27T18:00") + np.timedelta64(70 * i, "m") for i in range(9)]
    found = calibrate(day_frames(tmp_path, optics, "moon", night), LAT, LON, settings=UTC, by="moon")
    assert found.by == "moon"
    assert worst_deg(found.camera, optics, 25.0) < 0.5


def test_a_day_of_sun_at_a_wrong_place_or_time_gives_no_camera(tmp_path):
    """The way of the sun is much the same arc elsewhere, and a lens can be shifted until it lies on it."""
    times = [np.datetime64("2024-05-01T09:00") + np.timedelta64(40 * i, "m") for i in range(7)]
    frames = day_frames(tmp_path, mounted(Lens("equidistant", 160.0), **SMALL), times=times)
    assert calibrate(frames, LAT, LON, settings=UTC).chosen.held_out_px < 1.0
    for lat, settings in ((-LAT, UTC), (LAT, FrameSettings(utc_offset_h=-3.0))):
        with pytest.raises(UserError, match="from its middle: a wrong time, date or place"):
            calibrate(frames, lat, LON, settings=settings)
    with pytest.raises(UserError, match="the sun is up in all frames"):  # whose spot would be taken for the moon
        calibrate(frames, LAT, LON, settings=UTC, by="moon")


def test_a_dark_frame_of_a_place_where_it_is_day_is_told_so(of_stars, tmp_path, day):
    """A starry frame with another zone, alone and among others; a grey day keeps its own line."""
    noon = "2024-01-15T12:00"
    up = f"{sun_position(noon, LAT, LON).refracted_altitude_deg:.1f} degrees up at that place and time"
    with pytest.raises(UserError, match=f"no sun in this frame, which is dark, while the sun is {up}: the time, "):
        calibrate(of_stars[0], LAT, LON, time=noon)
    copies = [tmp_path / f"sky_20240115T{hour}0000.png" for hour in (11, 12)]
    for copy in copies:
        shutil.copy(of_stars[0], copy)
    with pytest.raises(UserError, match=r"found in 0 of 2 .*which is dark, while the sun is"):
        calibrate(copies, LAT, LON, settings=UTC)
    grey = spot_frame(tmp_path / "grey_20240610_120000.png", day[0], DAY[5], overcast=True)
    with pytest.raises(UserError, match="no sun in this frame; give 6 frames"):
        calibrate(grey, LAT, LON, settings=UTC)


def test_what_gives_no_camera_is_refused(tmp_path, day):
    optics, frames = day
    with pytest.raises(UserError, match="one sun tells no camera"):
        calibrate(frames[5], LAT, LON, settings=UTC)
    with pytest.raises(UserError, match="one moon tells no camera; give 6 frames or more of a clear night"):
        calibrate(frames[5], LAT, LON, time="2023-11-27T22:00", by="moon")
    grey = spot_frame(tmp_path / "grey_20240610_120000.png", optics, DAY[5], overcast=True)
    with pytest.raises(UserError, match="no sun in this frame"):
        calibrate(grey, LAT, LON, settings=UTC)
    with pytest.raises(UserError, match="found in 3 of 4"):
        calibrate([*frames[:3], grey], LAT, LON, settings=UTC)
    with pytest.raises(UserError, match=r"spans|needs"):
        calibrate(frames[4:6] * 4, LAT, LON, settings=UTC)
    with pytest.raises(UserError, match="neither sun nor stars"):
        calibrate(frames[0], LAT, LON, time="2024-06-10T19:45")
    order = np.random.default_rng(3).permutation(len(frames))
    scrambled = [Path(shutil.copy(frames[k], tmp_path / name.name)) for name, k in zip(frames, order, strict=True)]
    with pytest.raises(UserError, match=r"follow the sun's way|left out lie"):
        calibrate(scrambled, LAT, LON, settings=UTC)


def test_overexposed_frames_are_called_so(tmp_path, day):
    """With an exposure twice as long the sun is found as well; with six times nothing shows but white."""
    optics, frames = day
    for gain in (2, 6):
        for path in frames:
            counts = np.asarray(Image.open(path)).astype(float) * gain
            Image.fromarray(np.clip(counts, 0, 255).astype(np.uint8)).save(tmp_path / path.name, compress_level=1)
        again = [tmp_path / path.name for path in frames]
        if gain == 2:
            assert worst_deg(calibrate(again, LAT, LON, settings=UTC).camera, optics, 20.0) < 0.4
    for given in (again, again[0]):
        with pytest.raises(UserError, match=r"overexposed, every channel is full in 100 % of it.*give"):
            calibrate(given, LAT, LON, settings=UTC)


def test_the_command_writes_a_camera_and_its_page(tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    optics = mounted(EQUISOLID)
    star_frame(tmp_path / "stars.png", optics, NIGHT)
    place = ["--lat", str(LAT), "--lon", str(LON)]
    called = ["--name", "roof <1>\n\u202e"]
    assert run(["calibrate", "stars.png", *place, "--time", NIGHT, "-o", "roof.toml", *called]) == 0
    said = capsys.readouterr()
    assert "lens equisolid" in said.out
    assert said.out.endswith("roof.toml, roof.html\n")
    assert "cannot tell the clock" in said.out
    content = read_camera("roof.toml")
    assert content.calibration["lens"] == "equisolid"
    assert content.calibration["held_out_px"] < 0.15
    assert worst_deg(load_camera("roof.toml"), optics) < 0.02
    page = (tmp_path / "roof.html").read_text()
    assert "<title>roof &lt;1&gt; \\u202e</title>" in page  # as a terminal shows it, nothing from right to left
    assert content.name == "roof <1>\n\u202e"
    assert 'src="data:image/jpeg' in page
    assert not re.search(r"(?:src|href)\s*=\s*\"(?!data:)|url\(|@import|<script", page)
    assert page.count("<svg") == 3
    assert page.index("<table") < page.index("<svg") < page.index("<img")  # what was found, before long pictures
    assert "1 frame match" in page
    assert run(["calibrate", "stars.png", "--camera", "roof.toml", "--time", NIGHT]) == 0
    assert re.search(r"\d\d stars match, median distance 0\.\d\d px", capsys.readouterr().out)
    assert run(["calibrate", "stars.png", "--camera", "roof.toml", "--time", "2024-03-15T23:30"]) == 0
    assert re.search(r"no more than \d+ stars match: cloud, .* or another camera", capsys.readouterr().out)
    star_frame(tmp_path / "cloud.png", optics, NIGHT, peaks=9)
    asked = ["calibrate", "stars.png", "--camera", "roof.toml", "--time", NIGHT]
    for more, remedy in ((["-o", "no.toml", "--by", "stars"], "leave out -o, --by"), (["cloud.png"], "--time is")):
        assert run([*asked, *more]) == 2
        assert remedy in capsys.readouterr().err
    for wrong in (
        ["cloud.png", *place, "--time", NIGHT, "-o", "no.toml"],
        ["stars.png", *place, "-o", "no.toml"],
        ["stars.png", "--time", NIGHT, "-o", "no.toml"],
        ["stars.png", *place, "--time", NIGHT],
        ["stars.png", *place, "--time", NIGHT, "-o", "stars.png"],
        ["stars.png", *place, "--time", NIGHT, "-o", "no.html"],
        ["nowhere.png", *place, "--time", NIGHT, "-o", "no.toml"],
        ["stars.png", "--lat", "100", "--lon", "0", "--time", NIGHT, "-o", "no.toml"],
    ):
        assert run(["calibrate", *wrong]) == 2
        assert capsys.readouterr().err.count("\n") == 1
    assert not (tmp_path / "no.toml").exists()


@pytest.mark.parametrize("name", ["camera.json", "camera", "camera.toml.gz"])
def test_a_cameras_file_ends_in_toml(name, tmp_path, capsys):
    """Said before any frame is looked at: there is none."""
    asked = ["calibrate", str(tmp_path / "no.png"), "--lat", "47", "--lon", "8", "--time", NIGHT]
    assert run([*asked, "-o", str(tmp_path / name)]) == 2
    assert capsys.readouterr().err == f"openswim: error: output {tmp_path / name}: a camera's file ends in .toml\n"


def test_a_mask_keeps_lamps_out(tmp_path):

    optics = mounted(EQUISOLID)
    path = star_frame(tmp_path / "stars.png", optics, NIGHT)
    counts = np.array(Image.open(path))
    random = np.random.default_rng(5)
    lamps = random.integers(20, 120, 160), random.integers(300, 700, 160)
    counts[lamps] = 60000
    Image.fromarray(counts).save(path)
    mask = np.full(counts.shape, 255, np.uint8)
    mask[:130, 290:] = 0
    Image.fromarray(mask).save(tmp_path / "mask.png")
    found = calibrate(path, LAT, LON, time=NIGHT, mask=tmp_path / "mask.png")
    assert worst_deg(found.camera, optics) < 0.05
    assert found.camera.mask.hidden.sum() == (mask == 0).sum()


SKY = {
    "svalbard": ("svalbard/LYR-Sony-111220_200933.jpg", 78.2, 15.7, FrameSettings("%d%m%y_%H%M%S", 0.0)),
    "aurora": ("kho/LYR-Sony-211121_170751.jpg", 78.2, 15.7, FrameSettings("%d%m%y_%H%M%S", 0.0)),
    "stars": ("happyjack/008.fits.bz2", 34.7444, -111.4221, None),
    "moon and cloud": ("happyjack/006.fits.bz2", 34.7444, -111.4221, None),
    "twilight": ("happyjack/002.fits.bz2", 34.7444, -111.4221, None),
    "cloud before the moon": ("happyjack/012.fits.bz2", 34.7444, -111.4221, None),
}


def real(shared, name):
    path, lat, lon, settings = SKY[name]
    return calibrate(shared / "data/sky" / path, lat, lon, settings=settings)


def test_the_camera_of_svalbard(shared):
    """Asked for: equisolid, held out .10 degrees; measured .037.  A year later, in aurora and moonlight, the same."""
    first, later = real(shared, "svalbard"), real(shared, "aurora")
    for found in (first, later):
        assert found.chosen.name == "equisolid"
        assert found.content.calibration["held_out_deg"] < 0.048
    assert worst_deg(later.camera, first.camera.optics, 15.0) < 0.15
    assert first.camera.optics.lens.focal_px == pytest.approx(later.camera.optics.lens.focal_px, rel=3e-4)


@pytest.fixture(scope="module")
def happy_jack(shared):
    return real(shared, "stars")


def test_the_camera_of_happy_jack(shared, tmp_path, happy_jack):
    """Asked for: 1.5 px median, and 2 in moonlight; measured .32 and .28, and .30 by the other night's file."""
    first, other = happy_jack, real(shared, "moon and cloud")
    assert first.chosen.held_out_px < 0.47
    assert other.chosen.held_out_px < 0.40
    write_camera(first.content, tmp_path / "camera.toml")
    checked = check(read_camera(tmp_path / "camera.toml"), shared / "data/sky/happyjack/006.fits.bz2")
    assert checked.matches > 45
    assert checked.median_px < 0.39
    write_report(first, tmp_path / "page.html")


@pytest.mark.slow
def test_drawn_stars_lie_on_those_of_the_frame(shared, happy_jack):
    """Stars to magnitude 2.6 more than 15 degrees high, drawn through the fitted camera as a picture draws them: nearly
    all have a bright point of the frame within three of its own residuals, in the median within one. The camera of
    Svalbard does as well."""
    path, lat, lon, _ = SKY["stars"]
    found, height_m, brightest = happy_jack, 2361.0, 2.6
    frame = read_frame(shared / "data/sky" / path)
    peaks = find_peaks(frame.green).place
    refraction = Refraction.at(Atmosphere.us_standard(), height_m)
    every = points_over(frame.time, lat, lon, height_m, refraction)
    bright = np.flatnonzero((every.magnitude < brightest) & (every.altitude_deg > 15))
    stars = Points(*(getattr(every, part)[bright] for part in every.__dataclass_fields__))
    camera = found.camera
    wavelengths, toa = np.array([550.0]), np.array([1.86])

    def open_sky(direction, width):
        return np.ones((len(direction), 1)), np.zeros(len(direction), bool)

    drawn = drawn_points(stars, camera, camera.pixels(), wavelengths, toa, open_sky)
    missed = []
    for star in range(len(bright)):
        row, column = camera.pixel_of(stars.azimuth_deg[star], stars.altitude_deg[star])
        own = np.flatnonzero((abs(drawn.row - row) < 4) & (abs(drawn.column - column) < 4))
        weight = drawn.radiance[own, 0]
        at = np.array([weight @ drawn.row[own], weight @ drawn.column[own]]) / weight.sum()
        missed.append(np.linalg.norm(peaks - at, axis=1).min())
    residual = found.chosen.held_out_px
    assert len(missed) > 15
    assert np.median(missed) < residual
    assert np.mean(np.array(missed) < 3 * residual) > 0.8


@pytest.mark.parametrize("name", ["twilight", "cloud before the moon"])
def test_hopeless_frames_are_refused(shared, name):
    with pytest.raises(UserError, match=r"match|bright points"):
        real(shared, name)


def test_the_camera_of_hungriger_wolf(shared):
    """Asked for: held-out suns within 4 px; measured 3.4, and 2.8 from where people put the sun."""
    wolf = shared / "data/sky/wolf"
    found = calibrate(sorted(wolf.glob("Wolf*.jpg")), 53.99777, 9.56673)
    assert found.chosen.held_out_px < 4.0
    by_hand = np.array([re.search(r"sunrow(\d+)_suncol(\d+)", f.path.name).groups() for f in found.frames], float)
    fitted = np.stack(found.camera.optics.project(found.matched.direction), axis=-1)
    assert np.median(np.linalg.norm(fitted - by_hand[found.matched.frame], axis=-1)) < 3.7
    assert any(line.startswith("the lens") for line in found.cannot_tell)
    assert any(line.startswith("the tilt") for line in found.cannot_tell)
    # trees and sky beside them, as a person sees them in the frames of 1920 x 1920 pixels: row, column
    trees = (300, 1560), (560, 1560), (1160, 1840), (1400, 1800), (1740, 1560), (180, 400), (500, 100), (80, 800)
    sky = (320, 500), (460, 1420), (700, 1600), (1160, 1680), (1560, 1480), (170, 1100), (1000, 140), (1500, 300)
    assert all(found.camera.mask.hidden[at] for at in trees)
    assert not any(found.camera.mask.hidden[at] for at in sky)
    for name in ("Image_20160527_144000_UTCp1_3.jpg", "Image_20160527_144000_UTCp1_4.jpg"):
        with pytest.raises(UserError, match="no sun in this frame"):
            calibrate(wolf / name, 53.99777, 9.56673)


def test_the_sun_of_bretigny(shared, tmp_path):
    """Asked for: 1.0 degree, by the makers' own map; measured .87, of which most is upward: trees cut the spot."""
    folder = shared / "data/sky/bretigny"
    maps = {"azimuth": "0.005625", "zenith": "0.00140625"}
    (tmp_path / "camera.toml").write_text(
        'openswim_camera = 1\n[place]\nlat = 48.6005\nlon = 2.3468\n[frame]\nutc_offset_h = 0\n[view]\nkind = "map"\n'
        + "".join(f'{n} = "{folder}/{n}_visible.jp2"\n{n}_deg_per_count = {s}\n' for n, s in maps.items())
        + "outside_count = 65535\n"
    )
    content = read_camera(tmp_path / "camera.toml")
    frame = read_frame(folder / "image_20250215080830.jp2", settings=content.frames)
    spot = find_spot(frame)
    sun = sun_position(frame.time, 48.6005, 2.3468)
    seen = horizon_vector(*content.camera.direction_of(spot.row, spot.column))
    true = horizon_vector(sun.azimuth_deg, sun.refracted_altitude_deg)
    assert np.degrees(np.linalg.norm(seen - true)) < 1.0
