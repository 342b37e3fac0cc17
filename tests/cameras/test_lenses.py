"""Lenses and their mounts: formulas of the makers' models, round trips, solid angles."""

import numpy as np
import pytest

from openswim.cameras import Camera, Lens, Optics
from openswim.cameras import panorama as cylinder
from openswim.errors import UserError
from openswim.scene.frame import horizon_vector

LENSES = [
    Lens("equidistant", 150),
    Lens("equisolid", 150),
    Lens("stereographic", 150),
    Lens("orthographic", 150),
    Lens("polynomial", 169.0, (-3.1,)),
    Lens("polynomial", 169.0, (-8.1, 1, -0.5)),  # turns back at 106 degrees
    Lens("kannala-brandt", 150, (0.05, -0.01, 0.002, -0.0005)),
    Lens("ocam", 150, (-1.6e-3, 1.2e-6, -8e-9)),
    Lens("pinhole", 300),
    Lens("pinhole", 300, (-0.28, 0.07, 1e-3, -5e-4, 0.01)),
    Lens("pinhole", 250, (0.1, -0.3)),
]


def mounted(lens, **options):
    settings = {"rotation_deg": 33, "tilt_deg": 12, "tilt_azimuth_deg": 200, "mirrored": True,
                "affine": (1.01, 0.003, -0.002), "fov_deg": 300}  # fmt: skip
    return Optics(lens, 160.3, 203.7, **(settings | options))


@pytest.mark.parametrize("lens", LENSES)
def test_from_pixel_to_direction_and_back(lens):
    optics, shape = mounted(lens), (330, 400)
    pixels = optics.pixels(shape)
    inside = pixels.inside
    assert inside.mean() > 0.3
    row, column = optics.project(pixels.direction[inside])
    true = np.argwhere(inside)
    assert np.abs(row - true[:, 0]).max() < 1e-6
    assert np.abs(column - true[:, 1]).max() < 1e-6
    np.testing.assert_allclose(np.linalg.norm(pixels.direction[inside], axis=-1), 1, atol=1e-12)


@pytest.mark.parametrize("lens", LENSES)
def test_from_direction_to_pixel_and_back(lens):
    random = np.random.default_rng(3)
    optics = mounted(lens)
    vectors = random.normal(size=(4000, 3))
    vectors /= np.linalg.norm(vectors, axis=-1, keepdims=True)
    row, column = optics.project(vectors)
    angle = np.degrees(np.arccos(np.clip(vectors @ optics.axes()[2], -1, 1)))
    seen = angle < min(150.0, np.degrees(lens.limit_rad)) - 0.01
    assert np.isfinite(row[seen]).all()
    assert np.isnan(row[angle > min(150.0, np.degrees(lens.limit_rad)) + 0.01]).all()
    np.testing.assert_allclose(optics.direction(row[seen], column[seen]), vectors[seen], atol=2e-6)


@pytest.mark.parametrize("lens", LENSES)
def test_solid_angle_is_that_between_the_neighbours(lens):
    """The cross product of the steps to places a tenth of a pixel away: no formula of the lens."""
    optics = mounted(lens, fov_deg=160)
    pixels = optics.pixels((330, 400))
    row, column = (v[pixels.inside] for v in np.indices((330, 400)).astype(float))
    down, right = (
        (optics.direction(row + i, column + j) - optics.direction(row - i, column - j)) / 0.2
        for i, j in ((0.1, 0), (0, 0.1))
    )
    area = np.linalg.norm(np.cross(down, right), axis=-1)
    known = np.isfinite(area)
    ratio = area[known] / pixels.solid_angle_sr[pixels.inside][known]
    rim = 0.02 if lens.model == "orthographic" or lens.limit_rad < np.radians(110) else 1e-5  # where pixels run to zero
    assert np.abs(np.percentile(ratio, [0.5, 99.5]) - 1).max() < rim
    assert abs(np.median(ratio) - 1) < 1e-5


@pytest.mark.parametrize("lens", LENSES[:8])
def test_a_fisheye_sees_one_hemisphere(lens):
    optics = Optics(lens, 400, 400, fov_deg=180)
    # of an orthographic lens the outermost half pixel holds 5 % of it, and pixels that lie half outside are left out
    allowed = 0.035 if lens.model == "orthographic" else 3e-3
    assert np.nansum(optics.pixels((801, 801)).solid_angle_sr) == pytest.approx(2 * np.pi, rel=allowed)


def test_the_models_are_those_of_the_books():
    t = np.radians([0.0, 30.0, 60.0, 80.0])
    for model, expected in (
        ("equidistant", t), ("equisolid", 2 * np.sin(t / 2)), ("stereographic", 2 * np.tan(t / 2)),
        ("orthographic", np.sin(t)), ("pinhole", np.tan(t)),
    ):  # fmt: skip
        np.testing.assert_allclose(Lens(model, 100).radius_px(t), 100 * expected, atol=1e-9)
    np.testing.assert_allclose(Lens("polynomial", 337.9, (-6.25,)).radius_px(t), 337.9 * t - 6.25 * t**3, atol=1e-9)
    fisheye = Lens("kannala-brandt", 200, (0.1, -0.02, 0.003, -0.0004))
    opencv = 200 * (t + 0.1 * t**3 - 0.02 * t**5 + 0.003 * t**7 - 0.0004 * t**9)
    np.testing.assert_allclose(fisheye.radius_px(t), opencv, atol=1e-9)
    # Scaramuzza: the ray through (u, v) is (u, v, a0 + a2 q^2 + a3 q^3 + a4 q^4)
    u, v = 30.0, -70.0
    q = np.hypot(u, v)
    ray = np.array([u, v, 150 - 1.6e-3 * q**2 + 1.2e-6 * q**3 - 8e-9 * q**4])
    np.testing.assert_allclose(
        Lens("ocam", 150, (-1.6e-3, 1.2e-6, -8e-9)).direction(u, v), ray / np.linalg.norm(ray), atol=1e-12
    )


def test_brown_and_conrady_by_hand():
    """k1 = -.2, p1 = .01, p2 = -.02 at (.3, -.4) below the axis: r^2 = .25, radial .95; OpenCV's y is down."""
    x, y = Lens("pinhole", 1000, (-0.2, 0.0, 0.01, -0.02)).project(np.array([0.3, 0.4, 1.0]))
    assert x == pytest.approx(1000 * (0.3 * 0.95 + 2 * 0.01 * 0.3 * -0.4 - 0.02 * (0.25 + 2 * 0.09)))
    assert -y == pytest.approx(1000 * (-0.4 * 0.95 + 0.01 * (0.25 + 2 * 0.16) + 2 * -0.02 * 0.3 * -0.4))


def test_the_published_svalbard_convention():
    """row = r0 - d cos(azimuth + rot), column = c0 - d sin(azimuth + rot), d = k (90 - altitude)."""
    optics = Optics(Lens("equidistant", np.degrees(16.288)), 1448.9, 1418.8, rotation_deg=np.degrees(0.491))
    azimuth, altitude = np.array([10.0, 130.0, 250.0]), np.array([20.0, 50.0, 80.0])
    row, column = optics.project(horizon_vector(azimuth, altitude))
    d, turned = 16.288 * (90 - altitude), np.radians(azimuth) + 0.491
    np.testing.assert_allclose(row, 1448.9 - d * np.cos(turned), atol=1e-9)
    np.testing.assert_allclose(column, 1418.8 - d * np.sin(turned), atol=1e-9)


def test_the_axis_leans_where_it_is_told():
    for tilt, azimuth, turn in ((0, 0, 40), (5, 130, -70), (90, 210, 12), (180, 0, 5)):
        optics = Optics(LENSES[0], 100, 120, turn, tilt, azimuth)
        np.testing.assert_allclose(optics.direction(100, 120), horizon_vector(azimuth, 90 - tilt), atol=1e-12)
        axes = optics.axes()
        np.testing.assert_allclose(axes @ axes.T, np.eye(3), atol=1e-12)
        assert np.linalg.det(axes) == pytest.approx(-1)  # right, up, forward are left-handed


def test_a_mirrored_camera_has_east_on_the_right():
    for mirrored, side in ((False, -1), (True, 1)):
        optics = Optics(LENSES[0], 100, 120, mirrored=mirrored)
        row, column = optics.project(horizon_vector([0.0, 90.0], 30.0))
        assert row[0] < 100
        assert side * (column[1] - 120) > 0


@pytest.mark.parametrize(("azimuth", "altitude", "roll"), [(200, 35, 25), (10, -90, 0), (70, 0, -40), (300, -20, 170)])
def test_pointing_is_that_of_perspective(azimuth, altitude, roll):
    """A photographer's axes, by vectors: forward, right along the horizon, up; rolled clockwise."""
    forward, right = horizon_vector(azimuth, altitude), horizon_vector(azimuth + 90, 0.0)
    up = np.cross(right, forward)
    c, s = np.cos(np.radians(roll)), np.sin(np.radians(roll))
    expected = np.stack([c * right - s * up, c * up + s * right, forward])
    np.testing.assert_allclose(Optics.pointing(LENSES[8], (0, 0), azimuth, altitude, roll).axes(), expected, atol=1e-12)


def test_a_coarser_frame_sees_the_same():
    for lens in LENSES:
        optics = mounted(lens)
        there = optics.direction(150.0, 220.0)
        coarse = optics.scaled(0.25)
        np.testing.assert_allclose(coarse.direction((150.5) / 4 - 0.5, 220.5 / 4 - 0.5), there, atol=1e-9)


VIEWS = [
    Camera.allsky(0, 0, size=51),
    Camera.allsky(0, 0, size=51, centre="nadir"),
    Camera.perspective(0, 0, azimuth_deg=200, altitude_deg=35, fov_deg=70, size=(40, 60), roll_deg=25),
    Camera.satellite(40, -90, 8e5, size=40),
    Camera.panorama(0, 0, size=72),
    Camera.fisheye(0, 0, lens="equisolid", size=(40, 60), rotation_deg=20, tilt_deg=4),
    Camera.pinhole(0, 0, focal_px=60, coefficients=(-0.1,), size=(40, 60)),
]


@pytest.mark.parametrize("camera", VIEWS)
def test_every_view_knows_its_pixels(camera):
    pixels = camera.pixels()
    true = np.argwhere(pixels.inside)
    row, column = camera.pixel_of(pixels.azimuth_deg[pixels.inside], pixels.altitude_deg[pixels.inside])
    np.testing.assert_allclose(row, true[:, 0], atol=1e-6)
    np.testing.assert_allclose(column, true[:, 1], atol=1e-6)
    azimuth, altitude = camera.direction_of(true[:, 0], true[:, 1])
    np.testing.assert_allclose(altitude, pixels.altitude_deg[pixels.inside], atol=1e-6)
    apart = (azimuth - pixels.azimuth_deg[pixels.inside] + 180) % 360 - 180
    np.testing.assert_allclose(apart * np.cos(np.radians(altitude)), 0, atol=1e-6)


def test_a_fisheye_fills_its_frame_by_itself():
    for lens in ("equidistant", "equisolid", "stereographic", "orthographic"):
        camera = Camera.fisheye(0, 0, lens=lens, size=(200, 300))
        row, column = camera.pixel_of([0.0, 90.0, 180.0], 0.0)
        np.testing.assert_allclose(row, [-0.5, 99.5, 199.5], atol=1e-6)
        np.testing.assert_allclose(column, [149.5, 49.5, 149.5], atol=1e-6)
    assert Camera.fisheye(0, 0, size=51).pixels().direction == pytest.approx(
        Camera.allsky(0, 0, size=51).pixels().direction, abs=1e-12, nan_ok=True
    )


def test_beyond_a_panorama_is_nothing():
    row, _ = cylinder.project(horizon_vector([0.0, 10.0], [-40.0, 20.0]), (40, 120), 180.0, (-30.0, 90.0))
    assert np.isnan(row[0])
    assert np.isfinite(row[1])


def test_a_resized_camera_looks_the_same_way():
    for camera in VIEWS:
        if camera.name == "satellite":
            continue
        small = camera.resized(camera.shape[1] // 2)
        assert small.shape[1] == camera.shape[1] // 2
        whole, half = (np.nansum(c.pixels().solid_angle_sr) for c in (camera, small))
        assert half == pytest.approx(whole, rel=0.08)
    with pytest.raises(UserError, match="columns alone"):
        VIEWS[5].resized((50, 60))


@pytest.mark.parametrize(("lens", "fov_deg"), [("equidistant", 360), ("equisolid", 360), ("stereographic", 358)])
def test_a_field_of_view_just_fits_the_shorter_side(lens, fov_deg):
    row, column = Camera.fisheye(0, 0, size=(100, 160), lens=lens, fov_deg=fov_deg).optics.project(
        horizon_vector(0.0, 90.0 - fov_deg / 2 + 1e-7)
    )
    assert (row, column) == pytest.approx((-0.5, 79.5), abs=1e-3)


@pytest.mark.parametrize(
    "wrong",
    [
        lambda: Lens("fisheye", 100),
        lambda: Lens("equidistant", 0),
        lambda: Lens("equidistant", float("nan")),
        lambda: Lens("equidistant", 100, (1.0,)),
        lambda: Lens("polynomial", 100, (1, 2, 3, 4)),
        lambda: Lens("polynomial", 100, (float("inf"),)),
        lambda: Lens("polynomial", 100, "abc"),
        lambda: Lens([], 100),
        lambda: Camera.fisheye(0, 0, lens="nonsense"),
        lambda: Camera.fisheye(0, 0, lens="orthographic", fov_deg=270),
        lambda: Camera.fisheye(0, 0, lens="stereographic", fov_deg=360),
        lambda: Camera.fisheye(0, 0, lens="polynomial", coefficients=(1.0,)),
        lambda: Camera.fisheye(0, 0, tilt_deg=-1),
        lambda: Camera.fisheye(0, 0, centre=(float("nan"), 0)),
        lambda: Camera.fisheye(0, 0, centre=(1e9, 0)),
        lambda: Camera.fisheye(0, 0, affine=(0, 0, 0)),
        lambda: Camera.fisheye(0, 0, affine=(1, 0)),
        lambda: Camera.fisheye(0, 0, mirrored="yes"),
        lambda: Camera.fisheye(0, 0, fov_deg=0),
        lambda: Camera.pinhole(0, 0, focal_px=-3),
        lambda: Camera("fisheye", (10, 10), 0, 0),
        lambda: Camera("map", (10, 10), 0, 0),
    ],
)
def test_nonsense_is_refused_in_one_line(wrong):
    with pytest.raises(UserError) as caught:
        wrong()
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("model", ["polynomial", "kannala-brandt", "ocam", "pinhole"])
@pytest.mark.parametrize("coefficients", [(1e308, 1e308, 1e308), (1.0, 1e-320), (np.nan, 1.0)])
def test_coefficients_that_no_lens_has_are_refused(model, coefficients):
    with pytest.raises(UserError, match=r"coefficients .* must be numbers within"):
        Lens(model, 150.0, coefficients)
