"""Water mirrors the scene's own sky: calm water like a mirror, rough water smeared, clouds included."""

import numpy as np
import pytest
import xarray as xr
from pyproj import CRS

import openswim
from openswim import Camera, Ground
from openswim.cameras import Rays
from openswim.ground import water
from openswim.scene import Scene
from openswim.scene.atmosphere import Atmosphere
from openswim.scene.frame import horizon_vector
from openswim.scene.grid import Grid
from openswim.scene.procedural import demo_scene
from openswim.solver import Solver
from openswim.transport.engine.pack import PACK
from openswim.transport.engine.types import FLOAT
from openswim.transport.view.mirror import Mirrored, WetRays
from openswim.transport.view.viewer import AimedGrid, looking_from

N, CELL = 25, 500.0
GLOW = {0.008: 0.021, 0.03: 0.022, 0.07: 0.074}  # rms that facets leave of the glow's mean, by slope variance


@pytest.fixture(scope="module")
def lake():
    """Nothing but water, and a thick cloud in the north."""
    x = (np.arange(N) - N // 2) * CELL
    levels = np.linspace(0.0, 4000.0, 9)
    liquid = np.zeros((levels.size, N, N), np.float32)
    liquid[3:6, 18:23, 4:21] = 1e-4
    plane = ("y", "x")
    data = xr.Dataset(
        {
            "liquid_content": (("z", *plane), liquid),
            "land_area_fraction": (plane, np.zeros((N, N), np.float32)),
            "surface_altitude": (plane, np.zeros((N, N), np.float32)),
        }
    )
    crs = CRS.from_proj4("+proj=lcc +lat_1=20 +lat_0=20 +lon_0=-40 +R=6371000")
    scene = Scene(Grid(x, x, levels, crs, 6_371_000.0), data, Atmosphere.us_standard())
    sun = np.array([0.3, -0.6, 0.74])
    return Solver(quality="preview").solve(scene, sun / np.linalg.norm(sun), [615.0, 546.0, 450.0])


def glance(azimuth_deg, depression_deg, height_m=300.0):
    """An eye, directions down from it, and where they meet the water."""
    azimuth, down = np.broadcast_arrays(np.radians(azimuth_deg), np.radians(depression_deg))
    direction = np.stack([np.cos(down) * np.sin(azimuth), np.cos(down) * np.cos(azimuth), -np.sin(down)], axis=-1)
    eye = np.array([0.0, 0.0, height_m])
    return eye, eye + direction * (height_m / np.sin(down))[:, None], direction


def sky(field, place, direction):
    """What an eye at the water sees along the mirrored rays, each for itself."""
    up = direction * [1.0, 1.0, -1.0]
    above = place + np.array([0.0, 0.0, 1.0])
    views = [field.view(Rays(above[n : n + 1], up[n : n + 1])).radiance for n in range(len(place))]
    return np.concatenate(views)


def mirrored(field, eye, place, direction, slope_variance):
    lit = field.lit[0]
    look = looking_from(lit, None, [lit.shells], eye)
    found = Mirrored.of(look, None, lit.frame.radius_m, eye, WetRays(place, direction, slope_variance))
    return found.along(direction)[:, :3]


def mirrored_by(look, eye, place, direction, slope_variance):
    found = Mirrored.of(look, None, 6_371_000.0, eye, WetRays(place, direction, slope_variance))
    return found.along(direction)[:, 0]


def test_calm_water_is_a_mirror(lake) -> None:
    """Away from the cloud the sky is smooth, and slopes of 2 degrees change nothing."""
    eye, place, direction = glance(np.array([150.0, 180.0, 210.0, 240.0]), np.array([20.0, 30.0, 40.0, 25.0]))
    np.testing.assert_allclose(mirrored(lake, eye, place, direction, 0.0), sky(lake, place, direction), rtol=0.0014)


def test_what_is_mirrored_is_where_it_stands(lake) -> None:
    """Up over the northern horizon, under the cloud and past it: as the mirrored rays see it, each for itself."""
    depression = np.arange(8.0, 40.0, 4.0)
    eye, place, direction = glance(np.zeros(depression.size), depression)
    seen = mirrored(lake, eye, place, direction, 0.0)[:, 0]
    turned = [glance(np.zeros(depression.size), depression + tilt)[2] for tilt in (-4.0, 0.0, 4.0)]
    there = np.mean([sky(lake, place, way)[:, 0] for way in turned], axis=0)  # slopes of 2 degrees smear the edge
    assert there.max() > 2 * there.min()  # there is something to be seen
    assert np.corrcoef(seen, there)[0, 1] > 0.95
    np.testing.assert_allclose(seen, there, rtol=0.3)


def test_waves_smear_the_image_and_keep_its_light(lake) -> None:
    depression = np.arange(8.0, 60.0, 1.0)
    eye, place, direction = glance(np.zeros(depression.size), depression)
    calm, rough = (mirrored(lake, eye, place, direction, variance)[:, 0] for variance in (0.0, 0.08))
    assert rough.max() < calm.max()
    assert np.abs(np.diff(rough)).max() < np.abs(np.diff(calm)).max()
    assert rough.mean() == pytest.approx(calm.mean(), rel=0.35)
    assert (rough > 0).all()


def test_from_space_water_mirrors_the_clear_sky(lake) -> None:
    """Finite and dark where nothing but 2 % of a blue sky is mirrored."""
    rays = Rays(np.array([0.0, 0.0, 8e5]), np.array([[0.0, -0.002, -1.0]]) / np.hypot(1, 0.002))
    radiance = lake.view(rays).radiance
    assert np.isfinite(radiance).all()
    assert (radiance[0] < 0.6).all()


def test_the_aureole_is_left_to_the_glitter(lake) -> None:
    """What is scattered close to the sun counts as sunlight on waves: mirrored as sky, too, it would count twice, and a
    wave's facet that meets it would draw a line of light."""
    toward = lake.lit[0].sun * [1.0, 1.0, -1.0]
    eye = np.array([0.0, 0.0, 300.0])
    place = eye + toward * (300.0 / -toward[2])
    seen = mirrored(lake, eye, place[None], toward[None], 0.01)
    whole = sky(lake, place[None], toward[None])
    aside = sky(lake, place[None], (toward + 0.18 * np.cross(toward, [0.0, 0.0, 1.0]))[None])
    assert (seen < 0.9 * whole).all()
    np.testing.assert_allclose(seen, aside, rtol=0.25)


def test_rays_of_a_picture_find_in_it_what_is_mirrored(lake) -> None:
    """Rays between those of a picture see what they would by themselves, and so do those far from them."""
    eye, _, direction = glance(np.repeat(np.arange(-30.0, 31.0, 2.0), 8), np.tile(np.linspace(8.0, 22.0, 8), 31))
    _, _, between = glance(np.linspace(-29.0, 29.0, 40), np.linspace(9.0, 21.0, 40))
    alone = lake.view(Rays(eye, between)).radiance
    picture = lake.viewpoint(Rays(eye, direction))
    np.testing.assert_allclose(picture.view(Rays(eye, between)).radiance, alone, rtol=0.01)
    _, _, behind = glance(np.linspace(150.0, 210.0, 40), np.linspace(9.0, 21.0, 40))
    seen = picture.view(Rays(eye, behind)).radiance
    np.testing.assert_allclose(seen, lake.view(Rays(eye, behind)).radiance, rtol=0.01)


@pytest.fixture(scope="module")
def broken():
    """A lake in the middle of land, under cumulus that covers half of the sky."""
    x = (np.arange(N) - N // 2) * CELL
    levels, cells = np.linspace(0.0, 4000.0, 17), np.arange(N) // 3
    liquid = np.zeros((levels.size, N, N), np.float32)
    liquid[5:8] = np.where(np.add.outer(cells, cells) % 2, 3e-4, 0.0)
    plane = ("y", "x")
    data = xr.Dataset({
        "liquid_content": (("z", *plane), liquid), "surface_altitude": (plane, np.zeros((N, N))),
        "land_area_fraction": (plane, np.where(np.hypot(*np.meshgrid(x, x)) < 2500.0, 0.0, 1.0)),
    })  # fmt: skip
    crs = CRS.from_proj4("+proj=lcc +lat_1=20 +lat_0=20 +lon_0=-40 +R=6371000")
    scene = Scene(Grid(x, x, levels, crs, 6_371_000.0), data, Atmosphere.us_standard(), ground=Ground(mountains=False))
    sun = np.array([0.3, -0.6, 0.74])
    return scene, sun / np.linalg.norm(sun)


@pytest.fixture(scope="module")
def under_cumulus(broken):
    return Solver(quality="preview", detail=False).solve(*broken, [550.0])


def test_a_single_ray_to_water_is_a_pixel_of_a_picture(under_cumulus) -> None:
    """As the picture has it, as a viewpoint that was aimed at something else has it, and by a viewpoint of its own."""
    field = under_cumulus
    eye, _, direction = glance(np.repeat(np.arange(0.0, 90.0), 30), np.tile(np.linspace(3.0, 25.0, 30), 90), 60.0)
    picture = field.viewpoint(Rays(eye, direction))
    some = direction[7::400]
    pixels = picture.view(Rays(eye, direction)).radiance[7::400]
    single = [Rays(eye[None], way[None]) for way in some]
    np.testing.assert_array_equal(np.concatenate([picture.view(ray).radiance for ray in single]), pixels)
    other = field.viewpoint(Rays(eye, glance(np.arange(200.0, 240.0), 20.0)[2]))
    beside = other.view(Rays(eye, some)).radiance
    np.testing.assert_allclose(beside, pixels, rtol=1e-3)
    np.testing.assert_array_equal(np.concatenate([other.view(ray).radiance for ray in single]), beside)
    # its nodes are turned along it, the picture's toward the eye: what the air shines with in between differs
    np.testing.assert_allclose(field.view(single[2]).radiance[0], pixels[2], rtol=3.5e-4)
    looked = picture.of_others(single[2]).view(single[2]).radiance[0]
    np.testing.assert_allclose(looked, pixels[2], rtol=3.5e-4)


@pytest.mark.slow
def test_single_rays_to_water_under_broken_cloud_are_near_reference(broken, under_cumulus) -> None:
    """Within 16 %, as under a clear sky: `reference` leaves out what meets a second wave. By the clear sky in place of
    the clouds they would be 1.8 times too bright."""
    eye, _, direction = glance(np.repeat(np.arange(0.0, 90.0, 6.0), 4), np.tile([6.0, 12.0, 20.0, 28.0], 15), 60.0)
    aside = Rays(eye, glance(np.arange(200.0, 240.0), 20.0)[2])
    found = under_cumulus.viewpoint(aside).view(Rays(eye, direction)).radiance
    true = Solver("reference", paths=1500, seed=2).solve(*broken, [550.0]).view(Rays(eye, direction)).radiance
    assert found.mean() == pytest.approx(true.mean(), rel=0.19)


def test_no_pixel_of_a_picture_is_mirrored_by_itself(monkeypatch: pytest.MonkeyPatch) -> None:
    """One takes as long as the picture of all that is mirrored; water is found by each fourth ray of this picture, as
    of one of 360 x 720 pixels."""

    def alone(*rays):
        raise AssertionError("a ray has been marched by itself")

    monkeypatch.setattr("openswim.transport.view.mirror.Water.by_itself", alone)
    monkeypatch.setattr("openswim.transport.view.mirror._ASKED", 15_000)
    lit = openswim.light(demo_scene(64, 64, 20), Solver(quality="preview"))
    lit.viewpoint(Camera.panorama(*lit.scene.place, size=(180, 360))).view(irradiance=False)


def test_a_pixel_with_a_little_water_is_in_the_picture_of_it(monkeypatch: pytest.MonkeyPatch) -> None:
    """Shores on hills, of which pixels cover much at a glance; each of their heights would have a grid of its own."""
    aims = []
    at = AimedGrid.at
    monkeypatch.setattr(AimedGrid, "at", lambda *given: aims.append(1) or at(*given))
    lit = openswim.light(demo_scene(64, 64, 24), Solver(quality="preview"))
    lit.viewpoint(Camera.allsky(47.7, 11.2, size=256)).view(irradiance=False)
    assert len(aims) == 2  # the eye's and its image's


def test_who_stands_at_a_shore_has_one_grid(lake, monkeypatch: pytest.MonkeyPatch) -> None:
    """Clouds are so far off that the eye's image in the water sees them by the same sources as the eye: within .7 %."""
    aims = []
    at = AimedGrid.at
    monkeypatch.setattr(AimedGrid, "at", lambda *given: aims.append(1) or at(*given))
    azimuth, down = np.meshgrid(np.linspace(0.0, 350.0, 36), np.linspace(2.0, 60.0, 30))
    eye, _, direction = glance(azimuth.ravel(), down.ravel(), 20.0)
    rays = Rays(eye, direction)
    seen = lake.view(rays).radiance
    assert len(aims) == 1
    monkeypatch.setattr("openswim.transport.view.viewer._SAME_IMAGE", -1.0)
    np.testing.assert_allclose(seen, lake.view(rays).radiance, rtol=0.007)
    assert len(aims) == 3


@pytest.mark.parametrize("beyond_deg", [0.0, 6.4])
def test_a_whole_turn_has_no_seam(beyond_deg: float) -> None:
    """Pixels .75 degrees apart lay the mirrored picture out, or every eighth of them; wherever its azimuths begin, rays
    between them are known, too."""

    def look(place, out, image):
        return np.repeat(1.0 + 0.5 * out[:, :1], PACK, axis=1).astype(FLOAT), np.full(len(out), -1.0)

    eye, place, direction = glance(np.arange(0.1, 360.0, 0.75), 5.0, 2.0)
    found = Mirrored.of(look, None, 6_371_000.0, eye, WetRays(place, direction, 0.03, np.radians(beyond_deg)))
    turn = np.arange(0.0, 360.0, 0.05)
    seen = found.along(glance(turn, 5.0, 2.0)[2])[:, 0]
    waves = np.stack([np.ones(turn.size), np.sin(np.radians(turn)), np.cos(np.radians(turn))], axis=-1)
    fitted, *_ = np.linalg.lstsq(waves, seen, rcond=None)
    np.testing.assert_allclose(fitted, [1.0, 0.5, 0.0], atol=0.028)  # steep facets mirror less of what is level
    assert np.abs(seen - waves @ fitted).max() < 0.00026


@pytest.mark.parametrize("slope_variance", [0.008, 0.03, 0.07])
def test_the_glow_of_dusk_is_mirrored_without_stripes(slope_variance: float) -> None:
    """A bright band along the horizon, beside what 40,000 facets mirror of it."""
    from scipy.special import ndtri

    def look(place, out, image):
        glow = 0.05 + np.exp(-0.5 * (np.degrees(np.arcsin(out[:, 2])) / 3.0) ** 2)
        return np.repeat(glow[:, None], PACK, axis=1).astype(FLOAT), np.full(len(out), -1.0)

    depression = np.arange(1.0, 30.0, 0.5)
    eye, place, direction = glance(np.zeros(depression.size), depression, 20.0)
    seen = mirrored_by(look, eye, place, direction, slope_variance)
    along, across = (v.ravel() for v in np.meshgrid(*2 * [ndtri((np.arange(200) + 0.5) / 200)]))
    normal = np.stack([across, -along, np.full(along.size, np.sqrt(2 / slope_variance))], axis=-1)
    normal /= np.linalg.norm(normal, axis=-1, keepdims=True)
    true = []
    for way in direction:
        cos_in = -normal @ way
        out = way + 2 * cos_in[:, None] * normal
        weight = np.maximum(cos_in, 0) / normal[:, 2] * water.fresnel_reflectance(cos_in)
        weight *= water.returned(out[:, 2], -way[2], slope_variance)
        out[:, 2] = np.maximum(out[:, 2], 0)
        true.append((weight * look(None, out, None)[0][:, 0]).sum() / weight.sum())
    assert np.sqrt(np.mean((seen - true) ** 2)) < GLOW[slope_variance] * np.mean(true)


def valley_lake(liquid_content):
    """A valley whose lake lies 200 m lower than the ground beyond, seen at a glance from its shore: eye and rays."""
    n = 25
    x = (np.arange(n) - n // 2) * CELL
    levels = np.linspace(0.0, 4000.0, 17)
    lake = np.hypot(*np.meshgrid(x, x)) < 3000.0
    liquid = np.zeros((levels.size, n, n), np.float32)
    liquid[6:10, 2:23, ::6] = liquid_content
    plane = ("y", "x")
    data = xr.Dataset({
        "liquid_content": (("z", *plane), liquid), "land_area_fraction": (plane, np.where(lake, 0.0, 1.0)),
        "surface_altitude": (plane, np.where(lake, 100.0, 300.0)),
    })  # fmt: skip
    crs = CRS.from_proj4("+proj=lcc +lat_1=20 +lat_0=20 +lon_0=-40 +R=6371000")
    air = Atmosphere.us_standard()
    scene = Scene(Grid(x, x, levels, crs, 6_371_000.0), data, air, ground=Ground(mountains=False))
    azimuth, altitude = (a.ravel() for a in np.meshgrid(np.linspace(81.0, 99.0, 12), [-1.3, -3.0, -4.7]))
    eye = Camera.from_rays(horizon_vector(azimuth, altitude), lat=20.0, lon=-40.0 - 0.024, height_m=5.0)

    def seen(solver):
        return openswim.light(scene, solver, (550.0,), sun=(0.0, 60.0)).viewpoint(eye).look(azimuth, altitude)

    return seen


@pytest.mark.slow
def test_a_lake_below_the_rim_mirrors_the_sky_as_reference_has_it() -> None:
    """By 13,000 paths a ray it is 2 % brighter than theirs. Few of them are bright: by these 3000 it is 3.7 % brighter,
    by 3000 of two other seeds -1 and 2.3 %."""
    seen = valley_lake(4e-4)
    found, true = (
        seen(solver).mean() for solver in (Solver(detail=False, tolerance=0.3), Solver("reference", paths=3000, seed=1))
    )
    assert found == pytest.approx(true, rel=0.048)


def test_water_on_the_slopes_of_a_coarse_grid_is_level_to_reference(monkeypatch: pytest.MonkeyPatch) -> None:
    """The shore's slope, wide on undivided cells, turns away from the eye: paths were up to 1e5 times too bright."""
    monkeypatch.setattr("openswim.transport.medium.levels.MOST_RESOLVED_NODES", 1)
    light = valley_lake(0.0)(Solver("reference", paths=60, seed=1))
    assert light.max() < 0.66
    assert light.mean() == pytest.approx(0.2, rel=0.2)  # as by `fast`; means of six seeds: .167 to .195


@pytest.mark.parametrize(
    ("width_deg", "rows", "columns"), [(0.0, 16, 59), (0.01, 16, 59), (0.1, 4, 59), (1.0, 3, 25), (4.0, 3, 8)]
)
def test_what_is_mirrored_is_no_finer_than_pixels(width_deg: float, rows: int, columns: int) -> None:
    """A sea .2 degrees high and 23 wide, far away."""
    altitude = np.radians(-np.linspace(1.0, 1.2, 50))
    azimuth = np.linspace(-0.2, 0.2, 50)
    toward = np.stack([np.cos(altitude) * np.sin(azimuth), np.cos(altitude) * np.cos(azimuth), np.sin(altitude)], -1)
    eye = np.array([0.0, 0.0, 100.0])
    wet = WetRays(eye + toward * (100.0 / -toward[:, 2:]), toward, 0.02, width_rad=float(np.radians(width_deg)))

    def look(origin, direction, image):
        return np.ones((len(origin), PACK), FLOAT), np.full(len(origin), -1.0)

    made = Mirrored.of(look, None, 6.371e6, eye, wet)
    assert (made.altitude.size, made.azimuth.size) == (rows, columns)
    np.testing.assert_allclose(made.along(toward), 1.0, rtol=1e-5)
