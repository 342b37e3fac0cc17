import csv

import numpy as np
import pytest
import xarray as xr

from openswim.colour import auto_exposure, to_linear_rgb, to_rgb, to_xyz
from openswim.colour.cie import standard_observer, xyz_weights
from openswim.colour.rgb import PAPER_MATRIX, encode, exposure_for, into_gamut, quantise, rgb_matrix, shoulder
from openswim.errors import UserError

THREE = np.array([615.0, 546.0, 450.0])


def picture_of(values, wavelengths=THREE):
    """An image of L' (y, x, wavelength)."""
    return xr.DataArray(
        np.asarray(values, dtype=float), dims=("y", "x", "wavelength"), coords={"wavelength": wavelengths}
    )


def chromaticity(xyz):
    """x, y (..., 2) of X, Y, Z (..., 3)."""
    return xyz[..., :2] / xyz.sum(axis=-1, keepdims=True)


def rayleigh(wavelength_nm):
    return 0.2 * (550 / wavelength_nm) ** 4


def sky_with_clouds(size=60):
    """Left two thirds blue sky, right third cloud of L' = 2."""
    image = np.broadcast_to(rayleigh(THREE) * 1.2, (size, size, 3)).copy()
    image[:, 2 * size // 3 :] = 2.0
    return image


def test_the_observer_is_the_standard_one():
    wavelength, matching = standard_observer()
    np.testing.assert_allclose(chromaticity(matching.sum(axis=0)), [1 / 3, 1 / 3], atol=1e-5)
    # CIE illuminant A, a black body of 2856 K, has x = .44758, y = .40745.
    nm = wavelength * 1e-9
    black = nm**-5 / np.expm1(1.435e-2 / (nm * 2848.0))
    np.testing.assert_allclose(chromaticity(black @ matching), [0.44758, 0.40745], atol=1e-4)


def test_the_chain_reproduces_the_reference_colours(shared):
    path = shared / "reference/clearsky/colour_reference.csv"
    rows = {row["name"]: row for row in csv.DictReader(path.read_text().splitlines())}
    for name, spectrum in {"white reflector x1": np.ones_like, "rayleigh l^-4 (550->0.2)": rayleigh}.items():
        row = rows[name]
        wavelength, weights = xyz_weights()
        xyz = spectrum(wavelength) @ weights
        np.testing.assert_allclose(xyz, [float(row[k]) for k in "XYZ"], atol=2e-3)
        np.testing.assert_allclose(chromaticity(xyz), [float(row[k]) for k in "xy"], atol=5e-4)
        from_three = to_xyz(picture_of([[spectrum(THREE)]]))[0, 0]
        np.testing.assert_allclose(chromaticity(from_three), [float(row[k]) for k in "xy"], atol=1e-3)
    for row in rows.values():
        xyz = np.array([float(row[k]) for k in "XYZ"])
        rgb = [float(row[f"{c}_lin"]) for c in "rgb"]
        np.testing.assert_allclose(rgb_matrix("paper") @ xyz, rgb, atol=1e-3)
        np.testing.assert_allclose(
            encode(np.clip(rgb, 0, 1), 2.2), [float(row[f"{c}_g22"]) for c in "rgb"], atol=2e-5
        )


def test_the_papers_rayleigh_sky():
    # Albers et al. 2020, Sect. 3.8: x = y = .235.
    sky = to_xyz(picture_of([[rayleigh(THREE)]]))[0, 0]
    np.testing.assert_allclose(chromaticity(sky), [0.235, 0.235], atol=1e-3)


def test_a_sunlit_white_wall_is_neutral_in_srgb_and_bluish_in_the_paper():
    wall = picture_of(np.full((1, 1, 3), 4.0))
    np.testing.assert_allclose(to_linear_rgb(wall)[0, 0], 4.0, rtol=1e-5)
    np.testing.assert_allclose(to_linear_rgb(wall, "paper")[0, 0] / 4, [1.015, 0.987, 1.113], atol=3e-3)
    shades = to_rgb(picture_of(np.linspace(0.01, 4, 200)[None, :, None] * np.ones(3)), 0.25, dither=False)
    assert (shades.max(axis=-1) == shades.min(axis=-1)).all()


def test_srgb_primaries_keep_their_hue_under_the_adapted_white():
    # The adaptation from the sun's white (.3234, .3327) to D65 (.3127, .3290) is small.
    unadapted = np.array([[3.2405, -1.5371, -0.4985], [-0.9693, 1.8760, 0.0416], [0.0556, -0.2040, 1.0572]])
    np.testing.assert_allclose(rgb_matrix("srgb"), unadapted, atol=0.12)
    assert np.linalg.det(rgb_matrix("srgb")) > 0


def test_wavelengths_may_be_many_and_in_any_order():
    many = np.array([500.0, 400.0, 700.0, 450.0, 650.0, 550.0, 600.0])
    exact = xyz_weights()
    expected = rayleigh(exact[0]) @ exact[1]
    found = to_xyz(picture_of([[rayleigh(many)]], many))[0, 0]
    np.testing.assert_allclose(found, expected, rtol=5e-3)


def test_srgb_curve_at_the_standards_values():
    # IEC 61966-2-1: linear .0031308 is .04045; .21404 is one half.
    np.testing.assert_allclose(encode(np.array([0, 0.0031308, 0.21404, 1])), [0, 0.04045, 0.5, 1], atol=1e-4)


def test_highlights_roll_off_without_changing_hue():
    ramp = np.linspace(0, 30, 3000)[:, None] * np.array([1.0, 0.6, 0.3])
    rolled = shoulder(ramp)
    below = ramp[:, 0] < 0.5
    np.testing.assert_array_equal(rolled[below], ramp[below])
    assert (np.diff(rolled[:, 0]) >= 0).all()
    assert (rolled <= 1).all()
    slope = np.diff(rolled[:, 0])
    assert np.abs(np.diff(slope)).max() < 0.05 * slope[0]  # no kink where the shoulder begins
    bright = rolled[ramp[:, 0] > 0]
    # Hue: the middle component stays at the same place between the least and the largest.
    place = (bright[:, 1] - bright[:, 2]) / (bright[:, 0] - bright[:, 2])
    np.testing.assert_allclose(place, (0.6 - 0.3) / (1 - 0.3), rtol=1e-9)


def test_colours_beyond_the_screen_move_toward_grey_of_their_luminance():
    luminance = np.array([[0.3]])
    colour = np.array([[-0.2, 0.5, 0.9]])
    moved = into_gamut(colour, luminance)
    assert moved.min() == pytest.approx(0, abs=1e-12)
    direction, before = moved - luminance, colour - luminance
    np.testing.assert_allclose(direction / np.linalg.norm(direction), before / np.linalg.norm(before))
    inside = np.array([[0.1, 0.5, 0.9]])
    np.testing.assert_array_equal(into_gamut(inside, luminance), inside)


def test_dither_keeps_the_mean_and_hides_the_steps():
    level = 100.3 / 255
    flat = quantise(np.full((256, 256, 3), level))
    assert flat.mean(axis=(0, 1)) == pytest.approx(np.full(3, 100.3), abs=0.02)
    assert set(np.unique(flat)) == {100, 101}
    ramp = np.broadcast_to(np.linspace(100, 103, 600)[None, :, None] / 255, (64, 600, 3))
    plain, dithered = quantise(ramp, dither=False), quantise(ramp)
    smoothed = dithered.mean(axis=0)
    error = np.abs(smoothed - ramp[0] * 255)
    assert error.max() < 0.25 < np.abs(plain[0] - ramp[0] * 255).max()
    np.testing.assert_array_equal(dithered, quantise(ramp))


def test_black_and_white_are_exact_under_dither():
    assert not quantise(np.zeros((64, 64, 3))).any()
    assert (quantise(np.ones((64, 64, 3))) == 255).all()


def test_auto_exposure_follows_the_light():
    image = sky_with_clouds()
    assert auto_exposure(picture_of(image * 1e-3)) == pytest.approx(
        1e3 * auto_exposure(picture_of(image)), rel=1e-4
    )


def test_auto_exposure_ignores_the_suns_disc_black_space_and_what_is_outside():
    image = sky_with_clouds()
    plain = auto_exposure(picture_of(image))
    with_sun = image.copy()
    with_sun[10:12, 10:12] = 1.8e5
    assert auto_exposure(picture_of(with_sun)) == pytest.approx(plain, rel=0.02)
    framed = np.full((120, 120, 3), np.nan)
    framed[:60, :60] = image
    assert auto_exposure(picture_of(framed)) == pytest.approx(plain, rel=1e-6)
    framed = np.nan_to_num(framed)
    assert auto_exposure(picture_of(framed)) == pytest.approx(plain, rel=1e-6)


@pytest.mark.parametrize("side", [4, 6, 8])  # of 60 x 60: a thin crescent, a half moon, a full one, 3 degrees wide
def test_a_disc_that_a_long_lens_sees_alone_is_exposed_for(side):
    """And lamps of all strengths in the dark are not, nor those of a village in the distance."""
    night = np.full((60, 60, 3), 1e-6)
    night[20 : 20 + side, 20 : 20 + side] = 1.0
    assert auto_exposure(picture_of(night)) == pytest.approx(0.33, rel=0.01)
    lamps = np.full((60, 60, 3), 1e-6)
    lamps[20 : 20 + side, 20 : 20 + side] = np.logspace(-6, 0, side * side).reshape(side, side, 1)
    assert auto_exposure(picture_of(lamps)) > 100
    lamps = np.full((60, 60, 3), 1e-6)
    lamps[30, ::2] = 1.0
    assert auto_exposure(picture_of(lamps)) > 100


@pytest.mark.parametrize(
    ("dimmer", "darkest", "brightest"),
    # clear skies by `fast`, over that of day; a night's has moon and stars, and is shown at less than half
    [(5e3, 200, 240), (3e4, 200, 240), (2e5, 160, 200), (2e7, 100, 135)],
    ids=["sun at -8 degrees", "-10", "-12", "-18"],
)
def test_twilight_is_seen_and_night_is_darker(dimmer, darkest, brightest):
    picture = to_rgb(picture_of(sky_with_clouds()[:, :40] / dimmer), dither=False)  # blue sky
    assert darkest <= picture[30, 10].max() <= brightest


def test_dark_land_between_towns_is_dark():
    """From space at night: not the grey that land below a low sun is given, for which towns would burn out."""
    towns = np.full((60, 60, 3), 4e-8)
    towns[:15] = np.geomspace(1e-7, 6e-6, 15)[:, None, None]
    shown = to_rgb(picture_of(towns), dither=False)
    assert shown[30, 0].max() < 32
    assert (shown.min(axis=-1) > 240).mean() < 0.05


def test_blue_sky_is_blue_and_clouds_are_white_but_not_burnt():
    picture = to_rgb(picture_of(sky_with_clouds()))
    red, green, blue = picture[30, 10].astype(int)
    assert blue > green > red
    assert blue - red > 40
    assert 90 < blue < 250
    cloud = picture[30, 50].astype(int)
    assert 215 < cloud.min() <= cloud.max() < 255
    assert np.ptp(cloud) <= 2


def test_a_fixed_exposure_is_proportional_below_the_shoulder():
    dark = to_rgb(picture_of(np.full((1, 1, 3), 0.5)), 0.25, gamma=1.0, dither=False)[0, 0, 0]
    light = to_rgb(picture_of(np.full((1, 1, 3), 1.0)), 0.25, gamma=1.0, dither=False)[0, 0, 0]
    assert (int(dark), int(light)) == (32, 64)
    hard = to_rgb(picture_of(np.full((1, 1, 3), 4.0)), 0.25, roll_off=False, dither=False)
    assert (hard == 255).all()


def test_pictures_are_the_same_every_time_and_nan_is_black():
    image = sky_with_clouds()
    image[0, 0] = np.nan
    first = to_rgb(picture_of(image))
    np.testing.assert_array_equal(first, to_rgb(picture_of(image)))
    assert first.dtype == np.uint8
    assert first.shape == (60, 60, 3)
    assert not first[0, 0].any()
    assert not to_rgb(picture_of(np.full((4, 4, 3), np.nan))).any()
    assert not to_rgb(picture_of(np.zeros((4, 4, 3)))).any()


def test_a_dataset_serves_as_well_as_its_radiance():
    image = picture_of(sky_with_clouds())
    dataset = xr.Dataset({"solar_relative_radiance": image.transpose("wavelength", "y", "x")})
    np.testing.assert_array_equal(to_rgb(dataset), to_rgb(image))


@pytest.mark.parametrize(
    "wrong",
    [
        lambda: to_rgb(xr.Dataset({"other": ("y", [1.0])})),
        lambda: to_rgb(xr.DataArray(np.ones((2, 2, 3)), dims=("y", "x", "band"))),
        lambda: to_rgb(picture_of(np.ones((2, 2, 3))), exposure=-1),
        lambda: to_rgb(picture_of(np.ones((2, 2, 3))), exposure=float("nan")),
        lambda: to_rgb(picture_of(np.ones((2, 2, 3))), matrix="adobe"),
        lambda: to_rgb(picture_of(np.ones((2, 2, 3))), exposure="x"),
        lambda: to_rgb(picture_of(np.ones((2, 2, 3))), gamma=0),
        lambda: to_rgb(picture_of(np.ones((2, 2, 3))), gamma=float("nan")),
        lambda: to_rgb(picture_of(np.ones((2, 2, 3))), gamma="x"),
    ],
)
def test_wrong_requests_are_refused_in_one_line(wrong):
    with pytest.raises(UserError) as caught:
        wrong()
    assert "\n" not in str(caught.value)


def test_the_papers_matrix_has_its_white():
    white = np.linalg.solve(PAPER_MATRIX, np.ones(3))
    np.testing.assert_allclose(chromaticity(white), [0.3292, 0.3449], atol=1e-4)  # errata, Eq. 36


def test_what_is_brighter_is_never_less_white():
    """The glare of a reddish sun over a whitish sky: inward, past the first white, every colour only grows."""
    away = np.linspace(12.0, 0.25, 400)
    for sun in ([1.0, 0.9, 0.75], [1.0, 0.55, 0.2]):
        light = np.outer(1 / (1 + away), [0.9, 0.95, 1.0]) + np.outer(8 / away**2.5, sun)
        rolled = shoulder(light)
        white = rolled.max(axis=1) > 0.97
        assert white.sum() > 50
        assert (np.diff(rolled[white], axis=0) >= -0.002).all()
        assert rolled[-1].min() > 0.995


def low_sun(ground=0.02, share=0.4):
    """Sky of 0.3, aureole of 6 in a twentieth of it, and dark land."""
    image = np.full((100, 100, 3), 0.3)
    image[:8, :40] = 6.0
    image[int(100 * (1 - share)) :] = ground
    return image


def test_a_low_suns_landscape_can_be_read():
    shown = to_rgb(picture_of(low_sun()), dither=False)
    assert (shown.max(axis=-1) < 40).mean() < 0.01
    assert (shown.min(axis=-1) > 250).mean() < 0.15
    blue = to_rgb(picture_of(sky_with_clouds()), dither=False)  # by day nothing burns out for it
    assert blue.max() < 255


def test_a_series_has_one_exposure_by_the_suns_height():
    found = []
    for altitude in (-12.0, -3.0, 1.0, 20.0, 60.0):
        for brightness in (0.2, 2.0):
            image = picture_of(np.full((2, 2, 3), brightness)).to_dataset(name="solar_relative_radiance")
            found.append(exposure_for(image.assign_attrs(sun_altitude_deg=altitude), "sun"))
    assert found[::2] == found[1::2]
    assert (np.diff(found[::2]) < 0).all()
    given = image.assign_attrs(sun_altitude_deg=10.0)
    assert exposure_for(given, "0:8,20:2") == pytest.approx(4.0)
    assert exposure_for(given, "-5:8, 5:2") == pytest.approx(2.0)  # as at its end
    with pytest.raises(UserError, match="altitude the image does not have"):
        exposure_for(picture_of(np.ones((2, 2, 3))), "sun")
    for wrong in ("0:", "3", "0:-1", "100:3", "0:1,x", "moon"):
        with pytest.raises(UserError, match="ALTITUDE:EXPOSURE"):
            exposure_for(given, wrong)
