"""One frame beside one sky: known cameras found again, real frames' scores, and what cannot be told."""

import os
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from tests.comparison.skies import LAT, LON, NAME, TIME, clear_radiance, small_camera, write_frame

import openswim
from openswim.cameras.files import CameraFile, FrameSettings, ResponseSettings, read_camera, write_camera
from openswim.cli.compare import Progress, line_of
from openswim.comparison.cloud_rules import NO_AIR
from openswim.comparison.one_frame import rounded
from openswim.comparison.report.page import with_bounds, write_page
from openswim.comparison.response import Curve, decoded, encoded, fit_curve
from openswim.comparison.settings import camera_content, frame_of, known_camera, settings_of, skies_of
from openswim.errors import UserError
from openswim.lights import moon_position
from openswim.observations import read_frame

SHARED = Path(os.environ.get("OPENSWIM_SHARED", Path(__file__).parents[3] / "shared")) / "data" / "sky"
CAMERA = small_camera()


@pytest.fixture(scope="module")
def sky():
    return clear_radiance(CAMERA.camera)


@pytest.fixture(scope="module")
def srgb_frame(sky, tmp_path_factory):
    return write_frame(tmp_path_factory.mktemp("frames") / NAME, sky)


def test_curves_of_counts_and_their_inverse():
    share = np.linspace(0, 1, 256)
    for encoding in ("srgb", "linear", 2.2, 0.7):
        np.testing.assert_allclose(encoded(decoded(share, encoding), encoding), share, atol=1e-6)
    assert float(decoded(0.5, "srgb")) == pytest.approx(0.214041, abs=1e-6)  # IEC 61966-2-1


def test_a_camera_object_takes_the_zone_that_its_file_would(srgb_frame, tmp_path):
    """That of the frame's name; where nothing tells it, it is asked for."""
    camera = CAMERA.camera
    path = tmp_path / "camera.toml"
    write_camera(CameraFile(camera), path)
    zoned = tmp_path / "sky_20240620_080000_UTCp1.png"
    zoned.write_bytes(srgb_frame.read_bytes())
    for each in (camera, path):
        assert frame_of(zoned, camera_content(each)).time == np.datetime64("2024-06-20T07:00")
        with pytest.raises(UserError, match=r"not in which zone: give time=.*utc_offset_h \(--utc-offset"):
            openswim.compare(None, srgb_frame, each)
        with pytest.raises(UserError, match="not in which zone: give time="):
            openswim.correct_clouds(openswim.Scene.clear(LAT, LON), [srgb_frame], [each])
        with pytest.raises(UserError, match="not in which zone: give utc_offset_h"):
            openswim.compare(None, zoned, each, clear_frame=srgb_frame)


def test_pictures_are_kept_to_twelve_bits():
    light = np.r_[0.0, np.nan, np.inf, -np.inf, np.random.default_rng(0).lognormal(0, 5, 10_000)].astype(np.float32)
    kept = rounded(light)
    np.testing.assert_allclose(kept, light, rtol=2.0**-13)
    assert not (kept.view(np.uint32)[4:] % 2**11).any()
    np.testing.assert_array_equal(rounded(kept), kept)
    assert abs(np.mean(kept[4:] / light[4:] - 1)) < 2.0**-13 / 30  # neither up nor down in the mean


def test_a_leap_of_a_curve_makes_no_seam():
    """One by .4 in ln radiance, spread over .15 of ln light, adds a slope of 1.06 at most. A power law stays one."""
    light = np.geomspace(0.005, 1, 4000)
    power = 0.2 * light**1.3
    at = np.geomspace(1e-4, 2, 2000)
    np.testing.assert_allclose(Curve(light, power, 1.3, 0.0).smooth(at), 0.2 * at**1.3, rtol=3e-3)
    leap = Curve(light, np.where(light > 0.14, np.exp(0.4), 1.0) * power, 1.3, 0.0)
    slope = np.diff(np.log(leap.smooth(at))) / np.diff(np.log(at))
    assert slope.min() > 1.2
    assert slope.max() < 1.3 + 0.4 / (0.15 * np.sqrt(2 * np.pi)) + 0.1


def test_a_simulated_sky_is_drawn_as_its_camera_would_store_it_though_the_fit_is_poor():
    """Light that falls off to the edge scatters pixels about any curve: the one that tells radiance from light,
    turned round, would draw a sky of half as much contrast again."""
    random = np.random.default_rng(3)
    sky = random.lognormal(0, 0.5, 20_000)
    light = 0.3 * sky**0.6 * random.lognormal(0, 0.3, sky.size)
    answer, curve = fit_curve(sky, light, np.ones(sky.size)), fit_curve(light, sky, np.ones(sky.size))
    inner = np.linspace(*np.quantile(sky, [0.1, 0.9]), 50)
    contrast = np.polyfit(np.log(inner), np.log(answer.smooth(inner)), 1)[0]
    assert contrast == pytest.approx(0.6, abs=0.05)
    turned = np.interp(inner, curve.radiance, curve.light)
    assert np.polyfit(np.log(inner), np.log(turned), 1)[0] > 0.9


def test_a_simulated_camera_is_found_again(sky, tmp_path):
    """Exposure and gamma within 2 %, white balance within 1 %, from 8 bits."""
    gamma, exposure = 1.8, np.array([3.1, 2.7, 2.2])
    frame = write_frame(tmp_path / NAME, sky, exposure, gamma)
    found = openswim.compare(None, frame, CAMERA, encoding=gamma, aod_range=False)
    np.testing.assert_allclose(found.response_gamma, gamma, rtol=0.02)
    np.testing.assert_allclose(found.response_exposure, exposure, rtol=0.02)
    np.testing.assert_allclose(found.white_balance, exposure / exposure[1], rtol=0.01)
    assert found.attrs["red_blue_of_this_frame"] == pytest.approx(np.log(3.1 / 2.2), abs=0.01)


def test_r_of_the_same_sky_is_one_and_aerosol_is_left_alone(srgb_frame):
    found = openswim.compare(None, srgb_frame, CAMERA)
    r = found.r.sel(weighting="solid angle", sun_mask=12, score_channel="mean")
    assert float(r.sel(light="decoded")) > 0.9995
    assert float(r.sel(light="response undone")) > 0.998
    assert 0.9 < float(r.sel(light="as stored")) < 0.995  # counts are no radiance
    assert found.attrs["aerosol_optical_depth_550"] == pytest.approx(0.1)
    np.testing.assert_allclose(found.aod, (0.05, 0.1, 0.2))
    # half or twice the haze fits nearly as well once the response is undone
    assert found.r_by_aod.min() > 0.96
    assert "never says which aerosol" in found.attrs["aerosol_note"]


def test_what_is_not_known_is_nan_with_a_reason(srgb_frame):
    found = openswim.compare(None, srgb_frame, CAMERA, aod_range=False)
    assert np.isnan(found.rmse).all()
    assert np.isnan(found.observed_cover.sel(rule="clear sky"))
    assert np.isnan(found.fss).all()
    assert np.isnan(found.r_below).all()
    reasons = found.attrs["reasons"]
    for part in ("scale is not known", "white balance is not known", "too little land"):
        assert part in reasons


def test_a_frame_without_a_valid_pixel_has_scores_of_nan(sky, tmp_path):
    frame = write_frame(tmp_path / NAME, np.full_like(sky, 9.0))
    found = openswim.compare(None, frame, CAMERA)
    assert np.isnan(found.r).all()
    assert "no pixel is left" in found.attrs["reasons"]
    assert found.attrs["share_of_sky_used"] == 0
    write_page(found, CAMERA.camera, tmp_path / "page.html")
    text = (tmp_path / "page.html").read_text("utf-8")
    assert "There is no r." in text
    assert "No r, pod, far, ets, observed cover, simulated cover: no pixel is left." in text
    assert np.median(found.simulated_as_stored.values[CAMERA.camera.pixels().inside]) > 0.2  # the sky is shown
    assert "no r: no pixel is left, of 0 % of the sky" in line_of(found)


def test_too_few_pixels_for_a_response_are_told(srgb_frame):
    """Above 84 degrees no half of what is left has pixels enough for a curve."""
    found = openswim.compare(None, srgb_frame, CAMERA, aod_range=False, lowest_deg=84)
    assert 0 < found.valid.sum() < 100
    told = r"r -?0\.\d+ as stored, none with the response undone \(too few pixels are left to find the response\)"
    assert re.search(told, line_of(found))
    assert "no contrast" not in found.attrs["reasons"]


def test_without_air_clouds_of_a_black_sky_are_not_told_and_nothing_fails(sky, tmp_path, recwarn):
    """The clear sky is black, and so is that of a model without a cloud."""
    axis, cloud = np.arange(9) * 500.0, np.zeros((4, 9, 9))
    cloud[1:3, 3:6, 3:6] = 0.005
    frame = write_frame(tmp_path / NAME, sky)
    camera = replace(CAMERA.camera, lat=None, lon=None, x_m=2000.0, y_m=2000.0)
    content = CameraFile(camera, "", CAMERA.frames, response=ResponseSettings(red_blue=0.0))
    for extinction in (cloud, 0 * cloud):
        scene = openswim.Scene.from_arrays(extinction, axis, axis, np.arange(500.0, 2001.0, 500.0), place=(LAT, LON),
                                           time=TIME, surface_albedo=0.15)  # fmt: skip
        found = openswim.compare(scene, frame, content, solver="swim")
        assert np.isnan(found.observed_cover.sel(rule="clear sky"))
        assert np.isfinite(found.simulated_as_stored).all()
        assert line_of(found).endswith(f"; no cloud masks: {NO_AIR}")
        write_page(found, camera, tmp_path / "page.html")
    assert not [each for each in recwarn if issubclass(each.category, RuntimeWarning)]


def test_it_is_said_when_half_of_the_frame_is_black(sky, tmp_path):
    """The black half counts nowhere: the other is scored, and its share told."""
    half = np.array(sky)
    half[:, : half.shape[1] // 2] = 0
    found = openswim.compare(None, write_frame(tmp_path / NAME, half), CAMERA, aod_range=False, sun_mask_deg=0)
    assert found.attrs["share_of_sky_used"] == pytest.approx(0.5, abs=0.02)
    assert not found.valid.values[:, : half.shape[1] // 2].any()
    assert f"undone, of {100 * found.attrs['share_of_sky_used']:.0f} % of the sky" in line_of(found)


@pytest.mark.parametrize(
    ("waiting", "standing", "told"),
    [
        (10, 0, "10 frames, 0 of them done; 10 to compare by up to 2 processes\n"),
        (2, 1, "3 frames, 1 of them done; 2 to compare by up to 2 processes\n"),
        (1, 2, "3 frames, 2 of them done; 1 to compare\n"),
        (0, 3, "3 frames, 3 of them done; nothing is left to compare\n"),
        (1, 0, ""),
        (0, 1, "this frame is done, with the same settings; nothing is left to compare\n"),
    ],
)
def test_it_is_said_what_there_is_to_do(waiting, standing, told, capsys):
    Progress(2).begin(waiting, standing)
    assert capsys.readouterr().err == told


def test_a_frame_far_from_the_models_time_is_noted(srgb_frame, capsys):
    found = openswim.compare(None, srgb_frame, CAMERA, aod_range=False)
    for model_time, noted in (("2024-06-20T10:00:00Z", False), ("2024-06-21T14:00:00Z", True)):
        Progress(1).tell(found.assign_attrs(model_time=model_time))
        err = capsys.readouterr().err
        assert ("2024-06-21T14:00:00Z, is 30 hours after this frame" in err) is noted


def test_masks_by_one_rule_for_both_pictures(sky, srgb_frame, tmp_path):
    """A third of the sky made grey: it is found, nothing else, and the simulated clear sky has none."""
    pixels = CAMERA.camera.pixels()
    grey = pixels.inside & (np.nan_to_num(pixels.azimuth_deg) < 120)
    cloudy = np.where(grey[..., None], sky.mean(axis=-1, keepdims=True) * 1.5, sky)
    frame = write_frame(tmp_path / NAME, cloudy, (3.0, 3.0, 3.6))
    known = CameraFile(CAMERA.camera, "", CAMERA.frames, response=ResponseSettings(red_blue=float(np.log(3.0 / 3.6))))
    found = openswim.compare(None, frame, known, aod_range=False, lowest_deg=15)
    valid = found.valid.values
    assert (found.observed_cloud.values[valid] == grey[valid]).mean() > 0.99
    assert not found.simulated_cloud.any()
    assert float(found.observed_cover.sel(rule="clear sky")) == pytest.approx(1 / 3, abs=0.06)
    assert float(found.pod.sel(rule="clear sky")) == 0
    assert np.isnan(found.far.sel(rule="clear sky"))
    assert "far: no cloud is simulated" in found.attrs["reasons"]


def test_by_night_no_white_balance_is_proposed_and_it_is_said(sky, tmp_path):
    """At midnight of the longest day (23:30 UTC at 8 E) the sun is 90 - 47 - 23.44 degrees below the horizon.
    Its twilight is bent upward by .2."""
    frame = write_frame(tmp_path / "sky_20240620_233000.png", sky)
    found = openswim.compare(None, frame, CAMERA, aod_range=False)
    assert found.attrs["sun_altitude_deg"] == pytest.approx(-19.36, abs=0.05)
    assert np.isnan(found.attrs["red_blue_of_this_frame"])
    assert found.sizes["rule"] == 5
    for score in ("pod", "far", "ets", "observed_cover", "simulated_cover"):
        assert np.isnan(found[score]).all()
        assert f"{score}: the sun is below the horizon" in found.attrs["reasons"]
    line = line_of(found)
    assert "the sun is 19." in line
    assert "degrees below the horizon" in line
    assert "red_blue" not in line
    write_page(found, CAMERA.camera, tmp_path / "night.html")
    page = (tmp_path / "night.html").read_text()
    assert "degrees below the horizon" in page[: page.index("<h2>Scores")]  # before any score
    assert "red_blue = " not in page
    assert "or more from the sun" not in page
    assert page.count("<td>solid angle</td>") == 3  # no mask of a sun that is down


def doubt_of(frame, time=None):
    found = openswim.compare(None, frame, CAMERA, time=time, aod_range=False, solver="swim")
    return found.attrs["doubt"]


def test_a_sky_by_day_that_is_called_one_by_night_is_told(sky, srgb_frame, tmp_path):
    """At new moon (2024-06-06); not where the full moon stands (2024-01-25), which makes skies as blue."""
    assert doubt_of(srgb_frame) == ""
    assert "as blue as by day" in doubt_of(srgb_frame, "2024-06-06T23:30")
    assert doubt_of(srgb_frame, "2024-01-25T23:30") == ""
    assert doubt_of(srgb_frame, "2024-06-06T20:00") == ""  # twilight
    dim = 0.004 * sky / np.median(sky[sky > 0])
    dim[dim > 0.03] = 0.03  # no sun in it
    assert doubt_of(write_frame(tmp_path / "dim.png", dim, (1.0,) * 3), "2024-06-06T23:30") == ""
    assert doubt_of(write_frame(tmp_path / "grey.png", sky[..., [1, 1, 1]]), "2024-06-06T23:30") == ""


def test_a_bright_spot_by_night_is_that_of_the_moon(sky, tmp_path):
    full = "2024-01-25T23:30"
    moon = moon_position(full, LAT, LON)
    for azimuth, told in ((moon.azimuth_deg, ""), (moon.azimuth_deg + 40, "degrees from the moon")):
        shown = 0.2 * sky[..., [1, 1, 1]]
        row, column = CAMERA.camera.pixel_of(azimuth, moon.refracted_altitude_deg)
        away = np.hypot(*(a - b for a, b in zip(np.indices(sky.shape[:2]), (row, column), strict=True)))
        shown[away < 2.5] = 1.0
        assert told in (said := doubt_of(write_frame(tmp_path / "spot.png", shown), full))
        assert bool(said) == bool(told)
    assert "without a moon" in doubt_of(tmp_path / "spot.png", "2024-06-06T23:30")


def test_a_red_sky_by_day_is_told(sky, tmp_path, capsys):
    """Red and blue swapped, and one of street lamps; not at sunset, and not where the camera's file has it so."""
    swapped = write_frame(tmp_path / NAME, sky[..., ::-1])
    found = openswim.compare(None, swapped, CAMERA, aod_range=False)
    assert "once red and blue are swapped: save it with red first" in found.attrs["doubt"]
    Progress(1).tell(found)
    assert f"note: {NAME}: its sky is red rather than blue" in capsys.readouterr().err
    lamps = np.broadcast_to([0.10, 0.07, 0.03], sky.shape) * np.random.default_rng(1).uniform(0.9, 1.1, sky.shape)
    assert "a frame by night" in doubt_of(write_frame(tmp_path / "lamps.png", lamps), TIME)
    assert doubt_of(swapped, "2024-06-20T19:00") == ""
    known = replace(CAMERA, response=ResponseSettings(red_blue=1.6))
    assert openswim.compare(None, swapped, known, aod_range=False).attrs["doubt"] == ""


def test_radiance_where_the_scale_is_known_or_measured(sky, tmp_path):
    frame = write_frame(tmp_path / NAME, sky, (4, 4, 4))
    known = CameraFile(CAMERA.camera, "", CAMERA.frames, response=ResponseSettings(radiance_per_unit=(0.25,)))
    found = openswim.compare(None, frame, known, aod_range=False)
    mean = found.simulated.where(found.valid).mean(("y", "x")).values
    np.testing.assert_array_less(found.rmse.values, 0.01 * mean)
    bright = openswim.compare(None, frame, CAMERA, aod_range=False,
                              dhi_w_m2=1.1 * found.attrs["diffuse_horizontal_irradiance_w_m2"])  # fmt: skip
    np.testing.assert_allclose(bright.bias.values, 0.1 * mean, rtol=0.05)
    both = found.attrs["global_horizontal_irradiance_w_m2"]
    same = openswim.compare(None, frame, CAMERA, aod_range=False, ghi_w_m2=both)
    np.testing.assert_array_less(np.abs(same.bias.values), 0.01 * mean)
    direct = found.attrs["direct_horizontal_irradiance_w_m2"]
    dim = openswim.compare(None, frame, CAMERA, aod_range=False, ghi_w_m2=direct - 50)  # a cloud before the sun
    assert np.isnan(dim.rmse).all()
    assert f"rmse: diffuse irradiance of -50 W/m2 (--ghi less the simulated direct part, {direct:.0f}; give --dhi)" in (
        dim.attrs["reasons"]
    )


def test_the_page_asks_nothing_of_a_server(srgb_frame, tmp_path):
    found = openswim.compare(None, srgb_frame, CAMERA, aod_range=False)
    write_page(found, CAMERA.camera, tmp_path / "page.html")
    text = (tmp_path / "page.html").read_text("utf-8")
    for outside in ("http://", "https://", "<link", "@import", "src=\"/"):
        assert outside not in text
    for mode in ("swipe", "blink", "difference", "side by side"):
        assert f'data-mode="{mode}"' in text
    assert text.count("data:image/") == 9  # three layers in three views
    assert ">sun</text>" in text
    north = re.findall(r'<text x="([\d.]+)" y="([\d.]+)" font-size="([\d.]+)">N<', text)
    assert len(north) == 9  # in the panorama too, at whose edge north is
    assert all(float(x) > 0.3 * float(size) and float(y) > 0.5 * float(size) for x, y, size in north)
    assert with_bounds(-1e-5, np.array([-4e-4, 4e-4])) == "0.000 <small>0.000 to 0.000</small>"
    assert "names no obstacles" in text  # trees would count as sky, and spoil the response
    hidden = replace(CAMERA.camera, horizon_deg=((0.0, 10.0), (180.0, 10.0)))
    write_page(found, hidden, tmp_path / "page.html")
    assert "names no obstacles" not in (tmp_path / "page.html").read_text("utf-8")


def test_wrong_requests_are_one_line(srgb_frame, tmp_path):
    for wrong in ({"size": 5}, {"sun_mask_deg": 200}, {"encoding": "gamma"}, {"colour": 1}, {"aod": -1}):
        with pytest.raises(UserError):
            openswim.compare(None, srgb_frame, CAMERA, **wrong)
    with pytest.raises(UserError, match="pixels, its camera"):
        openswim.compare(None, srgb_frame, small_camera(64))
    with pytest.raises(UserError, match="no frame"):
        openswim.compare(None, [], CAMERA)
    unnamed = tmp_path / "clear.png"
    unnamed.write_bytes(srgb_frame.read_bytes())
    for given in ({"frames": srgb_frame, "clear_frame": unnamed}, {"frames": [srgb_frame, unnamed]}):
        with pytest.raises(UserError, match=r"clear.png: neither .* give the frame a name such as"):
            openswim.compare(None, camera=CAMERA, **given)


def test_the_response_of_a_camera_is_kept_in_its_file(tmp_path):
    response = ResponseSettings(2.2, 0.12, (0.3, 0.31, 0.4))
    write_camera(CameraFile(CAMERA.camera, "roof", CAMERA.frames, {}, response), tmp_path / "roof.toml")
    assert read_camera(tmp_path / "roof.toml").response == response
    (tmp_path / "bad.toml").write_text((tmp_path / "roof.toml").read_text().replace("encoding = 2.2", "encoding = 99"))
    with pytest.raises(UserError, match="encoding"):
        read_camera(tmp_path / "bad.toml")



@pytest.mark.skipif(not SHARED.exists(), reason="needs the reference data")
def test_a_cloudy_frame_in_the_place_of_a_clear_one_is_told():
    """Hungriger Wolf, trees and all: clear from morning to afternoon; overcast; and of another hour."""
    settings, skies = settings_of({"size": 100}), skies_of(None, "swim", None, None)
    for name in ("Wolf_20160530_094400", "Wolf_20160530_114400", "Wolf_20160530_144900"):
        frame = next(SHARED.glob(f"wolf/{name}*"))
        assert known_camera(wolf_camera(), settings, frame, "swim", skies).doubt == ""
    overcast = next(SHARED.glob("wolf/Image_20160527_144000_UTCp1_3*"))
    assert "is it cloudy" in known_camera(wolf_camera(), settings, overcast, "swim", skies).doubt
    found = openswim.compare(None, frame, wolf_camera(), clear_frame=overcast, solver="swim", size=100, aod_range=False)
    assert "is it cloudy" in found.attrs["response_from"]
    late = replace(read_frame(frame, settings=wolf_camera().frames), time=np.datetime64("2016-05-30T07:49"))
    assert "another camera, time or zone" in known_camera(wolf_camera(), settings, late, "swim", skies).doubt


def wolf_camera():
    camera = openswim.Camera.fisheye(
        53.99777, 9.56673, size=1920, lens="equidistant", focal_px=676.9, centre=(955.7, 959.2), rotation_deg=15.527,
        fov_deg=170.0,
    )  # fmt: skip
    return CameraFile(camera, "Hungriger Wolf 3", FrameSettings(utc_offset_h=1.0, saturated_count=250.0))


@pytest.mark.skipif(not SHARED.exists(), reason="needs the reference data")
@pytest.mark.slow
def test_real_frames():
    """Hungriger Wolf: r of clear frames, cloud masks of clear, overcast and cumulus skies; aerosol as by default."""
    options = {"clear_frame": next(SHARED.glob("wolf/Wolf*_144900_*")), "size": 160, "lowest_deg": 30,
               "aod_range": False}  # fmt: skip
    cover = {}
    for name in ("Wolf_20160530_110600", "Image_20160527_144000_UTCp1_3", "Image_20160531_114000_UTCp1_3"):
        found = openswim.compare(None, next(SHARED.glob(f"wolf/{name}*")), wolf_camera(), **options)
        assert found.attrs["doubt"] == ""
        cover[name] = float(found.observed_cover.sel(rule="clear sky"))
        if name.startswith("Wolf"):
            at = {"weighting": "solid angle", "sun_mask": 12, "light": "response undone", "score_channel": "mean"}
            assert float(found.r.sel(at)) >= 0.95
            held_out = openswim.compare(None, next(SHARED.glob(f"wolf/{name}*")), wolf_camera(),
                                        **(options | {"clear_frame": None}))  # fmt: skip
            assert float(held_out.r.sel(at)) >= 0.95
    clear, overcast, cumulus = cover.values()
    assert clear <= 0.01
    assert overcast >= 0.9
    assert 0.2 <= cumulus <= 0.3
