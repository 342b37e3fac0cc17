import numpy as np
import pytest

from openswim.cameras import Camera, Rays
from openswim.errors import UserError

RADIUS_M = 6_371_000.0


class Globe:
    """A sphere in Earth-centred axes: what a camera asks of a scene's frame."""

    curved = True

    def enu(self, lat, lon):
        p, q = np.radians([lat, lon])
        return np.array(
            [
                [-np.sin(q), np.cos(q), 0],
                [-np.sin(p) * np.cos(q), -np.sin(p) * np.sin(q), np.cos(p)],
                [np.cos(p) * np.cos(q), np.cos(p) * np.sin(q), np.sin(p)],
            ]
        )

    def position(self, lat, lon, height_m):
        return self.enu(lat, lon)[2] * (RADIUS_M + height_m)


class Plain:
    """A flat frame, its origin at x = 10 m, y = 20 m; places are given as y, x."""

    curved = False

    def enu(self, y, x):
        return np.eye(3)

    def position(self, y, x, height_m):
        return np.array([x - 10.0, y - 20.0, height_m])


def lowest_height_m(rays):
    """Least distance of each ray's line from the globe's surface; negative where it hits."""
    along = -(rays.origins() * rays.directions()).sum(axis=1)
    closest = rays.origins() + along[:, None] * rays.directions()
    return np.linalg.norm(closest, axis=1) - RADIUS_M


@pytest.mark.parametrize("height_m", [5.0e5, 8.0e5, 3.5786e7, 1.5e9])
def test_the_whole_earth_fills_97_per_cent_of_a_satellites_picture(height_m):
    size = 400
    camera = Camera.satellite(30.0, -100.0, height_m, size=size)
    hits = (lowest_height_m(camera.rays(Globe())) < 0).reshape(size, size)
    middle = hits[size // 2].sum()
    assert middle == pytest.approx(0.97 * size, abs=2)
    assert hits[:, size // 2].sum() == pytest.approx(0.97 * size, abs=2)
    assert hits.sum() == pytest.approx(np.pi / 4 * middle**2, rel=0.01)  # a round disc


def test_from_low_orbits_the_picture_stops_short_of_the_horizon():
    assert Camera.satellite(0, 0, 2.0e5).fov_deg == pytest.approx(140)
    assert Camera.satellite(0, 0, 10.0).fov_deg == pytest.approx(140)


def test_a_distant_satellite_resolves_the_ground_in_float64():
    camera = Camera.satellite(10.0, 20.0, 1.5e9, size=2001)
    pixels = camera.pixels()
    ground = Globe()
    rays = camera.rays(ground)
    # Neighbouring pixels at the centre are 6.6 km apart on the ground: intersect and compare.
    row = slice(1000 * 2001 + 995, 1000 * 2001 + 1006)
    origin, direction = rays.origins()[row], rays.directions()[row]
    along = -(origin * direction).sum(axis=1)
    miss = (origin**2).sum(axis=1) - along**2
    hit = origin + (along - np.sqrt(RADIUS_M**2 - miss))[:, None] * direction
    step = np.linalg.norm(np.diff(hit, axis=0), axis=1)
    np.testing.assert_allclose(step, step.mean(), rtol=1e-4)
    assert step.mean() == pytest.approx(1.5e9 * np.radians(camera.fov_deg) / 2001, rel=1e-3)
    assert pixels.azimuth_deg[500, 1500] == pytest.approx(45, abs=1e-9)
    assert np.unique(pixels.altitude_deg[:1000, 1000]).size == 1000


def test_a_satellites_picture_has_north_on_top_and_east_on_the_right():
    camera = Camera.geostationary(-75.2, size=101)
    assert camera.height_above_sea_m(500.0) == 35_786_000.0
    rays = camera.rays(Globe())
    direction = rays.directions().reshape(101, 101, 3)
    east, north, up = Globe().enu(0, -75.2)
    np.testing.assert_allclose(direction[50, 50], -up, atol=1e-12)
    assert direction[10, 50] @ north > 0.1
    assert direction[50, 90] @ east > 0.1


def test_heights_count_from_the_ground_except_for_satellites():
    on_a_mountain = Camera.allsky(46.5, 8.0, height_m=2).rays(Globe(), ground_height_m=3000.0)
    assert np.linalg.norm(on_a_mountain.origin_m) - RADIUS_M == pytest.approx(3002.0, abs=1e-3)
    above = Camera.satellite(46.5, 8.0, 7e5, fov_deg=10, size=4).rays(Globe(), ground_height_m=3000.0)
    assert np.linalg.norm(above.origin_m) - RADIUS_M == pytest.approx(7e5, abs=1e-3)


def test_rays_leave_out_what_lies_outside_the_image():
    camera = Camera.allsky(46.5, 8.0, size=41)
    pixels = camera.pixels()
    rays = camera.rays(Globe())
    assert len(rays) == pixels.inside.sum() < 41 * 41
    up = Globe().enu(46.5, 8.0)[2]
    altitude = np.degrees(np.arcsin(np.clip(rays.directions() @ up, -1, 1)))
    np.testing.assert_allclose(altitude, pixels.altitude_deg[pixels.inside], atol=1e-6)


def test_flat_scenes_take_x_and_y_and_curved_ones_lat_and_lon():
    view = {"height_m": 10.0, "azimuth_deg": 90.0, "altitude_deg": 0.0, "size": (1, 1)}
    rays = Camera.perspective(x_m=100.0, y_m=-50.0, **view).rays(Plain(), ground_height_m=5.0)
    np.testing.assert_array_equal(rays.origin_m, [90.0, -70.0, 15.0])
    np.testing.assert_allclose(rays.direction, [[1, 0, 0]], atol=1e-15)
    with pytest.raises(UserError, match="flat"):
        Camera.perspective(40.0, 8.0, **view).rays(Plain())
    with pytest.raises(UserError, match="curved"):
        Camera.perspective(x_m=0.0, y_m=0.0, **view).rays(Globe())


def test_sizes_follow_from_a_width():
    assert Camera.panorama(0, 0, size=1440).shape == (480, 1440)
    assert Camera.sphere(0, 0, size=1440).shape == (720, 1440)
    assert Camera.perspective(0, 0, size=900).shape == (600, 900)
    assert Camera.satellite(0, 0, size=(300, 500)).shape == (300, 500)
    for size in ([10, 20], np.array([10, 20]), (np.int64(10), 20)):
        assert Camera.panorama(0, 0, size=size) == Camera.panorama(0, 0, size=(10, 20))
        assert Camera.perspective(0, 0, size=size).shape == Camera.satellite(0, 0, size=size).shape == (10, 20)
    assert Camera.panorama(0, 0, size=np.int64(1440)).shape == (480, 1440)
    assert Camera.allsky(0, 0, size=(300, 300)) == Camera.allsky(0, 0, size=300)


@pytest.mark.parametrize(
    "wrong",
    [
        lambda: Camera.allsky(91, 0),
        lambda: Camera.allsky(float("nan"), 0),
        lambda: Camera.allsky(0, 361),
        lambda: Camera.allsky(),
        lambda: Camera.allsky(10, 10, x_m=0, y_m=0),
        lambda: Camera.allsky(x_m=0),
        lambda: Camera.allsky(x_m=0, y_m=float("inf")),
        lambda: Camera.allsky(0, 0, height_m=-1),
        lambda: Camera.allsky(0, 0, height_m=float("nan")),
        lambda: Camera.allsky(0, 0, size=0),
        lambda: Camera.allsky(0, 0, size=10.5),
        lambda: Camera.allsky(0, 0, size=(300, 400)),
        lambda: Camera.allsky(0, 0, size=1_000_000),
        lambda: Camera.allsky(0, 0, centre="west"),
        lambda: Camera.allsky(0, 0, fov_deg=0),
        lambda: Camera.perspective(0, 0, fov_deg=-10),
        lambda: Camera.perspective(0, 0, fov_deg=180),
        lambda: Camera.perspective(0, 0, altitude_deg=100),
        lambda: Camera.perspective(0, 0, azimuth_deg=float("nan")),
        lambda: Camera.panorama(0, 0, altitude_range_deg=(30, -30)),
        lambda: Camera.panorama(0, 0, size=-5),
        lambda: Camera.satellite(0, 0, 0.0),
        lambda: Camera.satellite(0, 0, 1e12),
        lambda: Camera.satellite(0, 0, size=0),
        lambda: Camera.satellite(0, 0, size=[10]),
        lambda: Camera.satellite(0, 0, size=()),
        lambda: Camera.panorama(0, 0, size="10:20"),
        lambda: Camera.panorama(0, 0, size=None),
        lambda: Camera.perspective(0, 0, size=[10.5, 20]),
        lambda: Camera.perspective(0, 0, size=float("nan")),
    ],
)
def test_nonsense_is_refused_in_one_line(wrong):
    with pytest.raises(UserError) as caught:
        wrong()
    assert str(caught.value)
    assert "\n" not in str(caught.value)


def test_a_lens_that_draws_nothing_is_refused():
    """Rather than a picture without a pixel; one that draws in a corner alone, from beside the frame, is a camera."""
    lens = {"lat": 47, "lon": 11, "size": (12, 16), "lens": "equisolid", "centre": (5.5, 7.5)}
    for wrong in ({"focal_px": 1e-9}, {"focal_px": 5.0, "fov_deg": 1e-9}):
        with pytest.raises(UserError, match="draws nothing on any of 16x12 pixels"):
            Camera.fisheye(**lens | wrong)
    assert Camera.fisheye(**lens | {"focal_px": 5.0, "centre": (-4.0, -4.0)}).pixels().inside.any()


def test_rays_share_an_origin_or_a_direction():
    ring = Rays(np.zeros(3), np.eye(3))
    assert len(ring) == 3
    assert ring.origins().shape == (3, 3)
    assert len(ring[1:]) == 2
    np.testing.assert_array_equal(ring[1:].direction, np.eye(3)[1:])
    beams = Rays(np.arange(12.0).reshape(4, 3), np.array([0, 0, 1.0]))
    assert len(beams) == 4
    assert beams.directions().shape == (4, 3)
    np.testing.assert_array_equal(beams[2:3].origins(), [[6, 7, 8]])
    assert len(Rays(np.zeros(3), np.array([0, 0, 1.0]))) == 1
    with pytest.raises(ValueError, match="three"):
        Rays(np.zeros(2), np.eye(3))


def test_views_are_called_by_their_constructors():
    views = ("allsky", "panorama", "sphere", "perspective", "satellite")
    assert [getattr(Camera, view)(lat=1, lon=2).name for view in views] == list(views)


def test_a_size_in_words_is_that_of_the_command_line() -> None:
    """Columns first; a tuple is the shape of an array."""
    place = {"lat": 47.0, "lon": 11.0}
    assert Camera.panorama(**place, size="1440x720").shape == Camera.panorama(**place, size=(720, 1440)).shape
    assert Camera.panorama(**place, size="360").shape == Camera.panorama(**place, size=360).shape
    assert Camera.perspective(**place, size="1920x1080").resized("960x540").shape == (540, 960)
    for wrong in ("1440,720", "x", "0x5", "1440x720x3"):
        with pytest.raises(UserError, match="image size"):
            Camera.panorama(**place, size=wrong)
