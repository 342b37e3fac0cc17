"""Maps and free rays; what hides the sky."""

import numpy as np
import pytest

from openswim.cameras import Camera
from openswim.cameras.obstacles import Mask
from openswim.errors import UserError
from openswim.scene.frame import Frame, horizon_vector

FISHEYE = Camera.fisheye(0, 0, lens="equisolid", size=(80, 100), rotation_deg=20, tilt_deg=4, tilt_azimuth_deg=50)


def mapped(camera=FISHEYE, **options):
    pixels = camera.pixels()
    return Camera.from_map(pixels.azimuth_deg, 90 - pixels.altitude_deg, 0, 0, **options)


def test_a_map_of_a_lens_is_that_lens():
    camera, true = mapped(), FISHEYE.pixels()
    pixels = camera.pixels()
    np.testing.assert_allclose(pixels.direction, true.direction, atol=1e-12)
    inner = true.altitude_deg > 8  # at the rim, which is tilted, neighbours are missing
    np.testing.assert_allclose(pixels.solid_angle_sr[inner], true.solid_angle_sr[inner], rtol=2e-3)
    assert np.nansum(pixels.solid_angle_sr) == pytest.approx(np.nansum(true.solid_angle_sr), rel=3e-3)


def test_a_map_finds_directions_between_its_pixels():
    camera = mapped()
    row, column = np.array([20.3, 40.0, 61.75]), np.array([30.8, 50.5, 44.1])
    azimuth, altitude = FISHEYE.direction_of(row, column)
    found = camera.pixel_of(azimuth, altitude)
    np.testing.assert_allclose(found[0], row, atol=0.01)
    np.testing.assert_allclose(found[1], column, atol=0.01)
    back = camera.direction_of(row, column)
    np.testing.assert_allclose(horizon_vector(*back), horizon_vector(azimuth, altitude), atol=1.6e-4)  # chords
    assert np.isnan(camera.pixel_of(0.0, -60.0)[0])
    assert np.isnan(camera.direction_of(-3, 10)[0])


def test_rays_are_unit_vectors_with_a_width():
    camera = Camera.from_rays([[0, 0, 5.0], [1, 1, 0]], 10, 20, width_deg=2.0)
    assert camera.shape == (1, 2)
    np.testing.assert_allclose(camera.pixels().altitude_deg[0], [90, 0], atol=1e-12)
    np.testing.assert_allclose(camera.pixels().half_width_deg, 1.0)
    grid = Camera.from_rays(FISHEYE.pixels().direction, 0, 0)
    assert np.nansum(grid.pixels().solid_angle_sr) == pytest.approx(2 * np.pi, rel=3e-3)


def test_rays_toward_places_arrive_there():
    """A ray's line, from 800 km up, meets the sphere at the latitude and longitude asked for, on any sphere."""
    lat, lon = np.array([40.2, 41.0, 38.5]), np.array([-3.1, -4.0, -5.5])
    camera = Camera.from_rays(towards=(lat, lon, 0.0), lat=40.0, lon=-4.0, height_m=8e5, above="sea level")
    for radius in (6_370_000.0, 6_371_229.0):
        frame = Frame(radius, 39.0, -3.0)
        rays = camera.rays(frame)
        up = rays.origin_m + np.array([0, 0, radius])
        along = -(rays.direction @ up)
        hit = along - np.sqrt(along**2 - (up @ up - radius**2))
        found = frame.latlon(rays.origin_m + hit[:, None] * rays.direction)
        np.testing.assert_allclose(found[0], lat, atol=1e-9)
        np.testing.assert_allclose(found[1], lon, atol=1e-9)
    # and the pixels say the same of the direction
    np.testing.assert_allclose(camera.pixels().direction[0] @ frame.enu(40.0, -4.0), rays.direction, atol=3e-4)


def test_rays_toward_places_of_a_flat_scene():
    camera = Camera.from_rays(towards=([100.0], [300.0], [0.0]), x_m=100.0, y_m=0.0, height_m=300.0)
    np.testing.assert_allclose(camera.pixels().direction[0, 0], [0, np.sqrt(0.5), -np.sqrt(0.5)], atol=1e-6)


def test_a_horizon_and_a_mask_hide_the_sky():
    hidden = np.zeros(FISHEYE.shape, bool)
    hidden[:, :20] = True
    whole = Camera(**(vars(FISHEYE) | {"horizon_deg": ((350.0, 10.0), (90.0, 40.0)), "mask": Mask(hidden)}))
    clear = whole.open_sky()
    pixels = FISHEYE.pixels()
    assert not clear[:, :20].any()
    free = pixels.inside & ~hidden
    # from 350 over north to 90 the line climbs by .3 degrees per degree, and falls back over south
    line = np.where(
        (pixels.azimuth_deg + 10) % 360 <= 100, 10 + 0.3 * ((pixels.azimuth_deg + 10) % 360),
        40 - 30 / 260 * (pixels.azimuth_deg - 90),
    )  # fmt: skip
    far = free & (np.abs(pixels.altitude_deg - line) > 1e-6)
    np.testing.assert_array_equal(clear[far], (pixels.altitude_deg > line)[far])
    small = whole.resized(50)
    assert small.open_sky().sum() == pytest.approx(clear.sum() / 4, rel=0.05)
    with pytest.raises(UserError, match="mask is 3x2 pixels"):
        Camera(**(vars(FISHEYE) | {"mask": Mask(np.zeros((2, 3), bool))})).open_sky()


@pytest.mark.parametrize(
    "wrong",
    [
        lambda: Camera.from_map(np.zeros((3, 3)), np.zeros((3, 4)), 0, 0),
        lambda: Camera.from_map(np.full((3, 3), np.nan), np.zeros((3, 3)), 0, 0),
        lambda: Camera.from_map(np.zeros((3, 3)), np.full((3, 3), 200.0), 0, 0),
        lambda: Camera.from_map(np.full((3, 3), 20.0), np.full((3, 3), 30.0), 0, 0),
        lambda: Camera.from_map(np.arange(9.0).reshape(3, 3), np.zeros((3, 3)), 0, 0),
        lambda: Camera.from_rays(np.ones((3, 3, 3)), 0, 0),
        lambda: Camera(**(vars(FISHEYE) | {"mask": np.zeros(FISHEYE.shape, bool)})),
        lambda: Camera(**(vars(FISHEYE) | {"lens_optics": 5})),
        lambda: Camera("map", (3, 3), 0, 0, given=5),
        lambda: Camera("allsky", 8, 0, 0),
        lambda: Camera("panorama", (True, 8), 0, 0),
        lambda: Mask([[True, False]]),
        lambda: Camera.from_map("azimuth.png", "zenith.png", 0, 0),
        lambda: Camera.from_rays(None, 0, 0),
        lambda: Camera.from_rays([[0, 0, 0]], 0, 0),
        lambda: Camera.from_rays([1, 2, 3], 0, 0),
        lambda: Camera.from_rays([[0, 0, 1]], 0, 0, width_deg=0),
        lambda: Camera.from_rays(towards=(1, 2), lat=0, lon=0),
        lambda: Camera.from_rays(towards=([1], [2], [np.nan]), lat=0, lon=0),
        lambda: Camera.from_rays(towards=([1], [2], [3])),
        lambda: Camera(**(vars(FISHEYE) | {"horizon_deg": [1, 2, 3]})),
        lambda: Camera(**(vars(FISHEYE) | {"horizon_deg": [(0, 100)]})),
        lambda: Camera(**(vars(FISHEYE) | {"horizon_deg": "flat"})),
    ],
)
def test_nonsense_is_refused_in_one_line(wrong):
    with pytest.raises(UserError) as caught:
        wrong()
    assert "\n" not in str(caught.value)
