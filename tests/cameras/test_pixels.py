import numpy as np
import pytest

from openswim.cameras import Camera
from openswim.errors import UserError

WHOLE, HALF = 4 * np.pi, 2 * np.pi


@pytest.mark.parametrize(
    ("camera", "solid_angle"),
    [
        (Camera.sphere(0, 0, size=240), WHOLE),
        (Camera.panorama(0, 0, size=240, altitude_range_deg=(0, 90)), HALF),
        (Camera.panorama(0, 0, size=(40, 240), altitude_range_deg=(-30, 30)), WHOLE / 2),
        (Camera.allsky(0, 0, size=301), HALF),
        (Camera.allsky(0, 0, size=301, centre="nadir"), HALF),
        (Camera.allsky(0, 0, size=401, fov_deg=360), WHOLE),
        # A pyramid of 90 x 90 degrees is one face of a cube.
        (Camera.perspective(0, 0, fov_deg=90, size=(200, 200)), WHOLE / 6),
    ],
)
def test_pixels_tile_their_part_of_the_sphere(camera, solid_angle):
    assert np.nansum(camera.pixels().solid_angle_sr) == pytest.approx(solid_angle, rel=2e-3)


ALL = [
    Camera.sphere(0, 0, size=72),
    Camera.allsky(0, 0, size=51),
    Camera.allsky(0, 0, size=51, centre="nadir"),
    Camera.perspective(0, 0, azimuth_deg=200, altitude_deg=35, fov_deg=70, size=(40, 60), roll_deg=25),
    Camera.satellite(40, -90, 1.5e9, size=40),
]


@pytest.mark.parametrize("camera", ALL)
def test_directions_and_angles_say_the_same(camera):
    pixels = camera.pixels()
    inside = pixels.inside
    assert np.isnan(pixels.azimuth_deg[~inside]).all()
    assert np.isnan(pixels.altitude_deg[~inside]).all()
    direction = pixels.direction[inside]
    np.testing.assert_allclose(np.linalg.norm(direction, axis=1), 1, atol=1e-14)
    azimuth, altitude = np.radians(pixels.azimuth_deg[inside]), np.radians(pixels.altitude_deg[inside])
    expected = np.stack(
        [np.cos(altitude) * np.sin(azimuth), np.cos(altitude) * np.cos(azimuth), np.sin(altitude)], axis=-1
    )
    np.testing.assert_allclose(direction, expected, atol=1e-13)


@pytest.mark.parametrize("camera", ALL)
def test_solid_angle_is_that_between_the_neighbours(camera):
    """The cross product of the steps to the neighbours: an independent measure of the pixel."""
    pixels = camera.pixels()
    d = pixels.direction
    across, down = (d[1:-1, 2:] - d[1:-1, :-2]) / 2, (d[2:, 1:-1] - d[:-2, 1:-1]) / 2
    area = np.linalg.norm(np.cross(across, down), axis=-1)
    inner = pixels.solid_angle_sr[1:-1, 1:-1]
    known = np.isfinite(area) & np.isfinite(inner) & (np.abs(pixels.altitude_deg[1:-1, 1:-1]) < 80)
    if camera.view != "panorama":
        known = np.isfinite(area) & np.isfinite(inner)
    np.testing.assert_allclose(area[known] / inner[known], 1, atol=0.01)


def test_sky_above_has_north_on_top_and_east_on_the_left():
    pixels = Camera.allsky(0, 0, size=101).pixels()
    assert pixels.altitude_deg[50, 50] == pytest.approx(90)
    assert pixels.azimuth_deg[5, 50] == pytest.approx(0)
    assert pixels.azimuth_deg[50, 5] == pytest.approx(90)
    assert pixels.azimuth_deg[95, 50] == pytest.approx(180)
    assert pixels.azimuth_deg[50, 95] == pytest.approx(270)


def test_map_below_has_north_on_top_and_east_on_the_right():
    pixels = Camera.allsky(0, 0, size=101, centre="nadir").pixels()
    assert pixels.altitude_deg[50, 50] == pytest.approx(-90)
    assert pixels.azimuth_deg[5, 50] == pytest.approx(0)
    assert pixels.azimuth_deg[50, 95] == pytest.approx(90)


def test_allsky_is_equidistant():
    pixels = Camera.allsky(0, 0, size=180).pixels()
    y, x = np.indices((180, 180)) - 89.5
    np.testing.assert_allclose(
        90 - pixels.altitude_deg[pixels.inside], np.hypot(x, y)[pixels.inside], atol=1e-10
    )


def test_panorama_has_no_seam():
    pixels = Camera.panorama(0, 0, size=360, azimuth_deg=180).pixels()
    azimuth = pixels.azimuth_deg[0]
    np.testing.assert_allclose(azimuth, np.arange(360) + 0.5, atol=1e-10)
    gap = (azimuth[0] - azimuth[-1]) % 360
    assert gap == pytest.approx(1.0)
    # The altitudes descend from row to row and centre on the range.
    assert pixels.altitude_deg[0, 0] == pytest.approx(89.5)
    assert pixels.altitude_deg[-1, 0] == pytest.approx(-29.5)


def test_perspective_points_where_it_is_told():
    pixels = Camera.perspective(0, 0, azimuth_deg=70, altitude_deg=20, fov_deg=50, size=(101, 151)).pixels()
    assert pixels.azimuth_deg[50, 75] == pytest.approx(70)
    assert pixels.altitude_deg[50, 75] == pytest.approx(20)
    left, right = pixels.direction[50, 0], pixels.direction[50, -1]
    width = np.degrees(np.arccos(left @ right))
    assert width == pytest.approx(50, abs=0.4)  # between the outer pixels' centres
    assert pixels.azimuth_deg[50, 100] > 70  # looking clockwise to the right
    assert pixels.altitude_deg[20, 75] > 20


def test_rolling_clockwise_drops_the_right_hand_side_of_the_camera():
    level = Camera.perspective(0, 0, altitude_deg=0, size=(101, 101)).pixels()
    rolled = Camera.perspective(0, 0, altitude_deg=0, size=(101, 101), roll_deg=90).pixels()
    np.testing.assert_allclose(rolled.direction[50, 100], level.direction[100, 50], atol=1e-12)


def test_straight_lines_stay_straight_in_perspective():
    pixels = Camera.perspective(0, 0, altitude_deg=0, fov_deg=100, size=(61, 91)).pixels()
    np.testing.assert_allclose(pixels.altitude_deg[30], 0, atol=1e-12)  # the horizon is one row


def test_angle_between_close_directions_is_exact():
    camera = Camera.perspective(0, 0, azimuth_deg=10, altitude_deg=45, fov_deg=1e-3, size=(1, 101))
    angle = camera.pixels().angle_to_deg(10, 45)
    assert angle[0, 50] == pytest.approx(0, abs=1e-12)
    assert angle[0, 51] == pytest.approx(1e-5, rel=0.02)


def test_values_return_to_their_pixels():
    pixels = Camera.allsky(0, 0, size=21).pixels()
    picture = pixels.image(pixels.altitude_deg[pixels.inside][:, None])
    np.testing.assert_array_equal(picture[..., 0], pixels.altitude_deg)


@pytest.mark.parametrize("camera", ALL)
def test_places_and_directions_come_in_pairs(camera):
    for asked in (camera.pixel_of, camera.direction_of):
        assert asked([10, 20], 30)[0].shape == (2,)
        with pytest.raises(UserError, match="give one number, or as many"):
            asked([0, 90], [10, 20, 30])
