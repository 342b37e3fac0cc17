"""What `swim` sees: single scattering, clouds from above, mixtures, and the clear sky around them."""

import numpy as np
import pytest
import xarray as xr
from scipy.ndimage import zoom
from tests.transport.scenes import (
    WAVELENGTH_NM,
    aimed_at,
    box,
    down_on,
    grid_scene,
    sky_directions,
    slab,
    sun_at_zenith_angle,
    toward,
)

from openswim.cameras import Rays
from openswim.optics.aerosol import aerosol_type, spectral_phase
from openswim.scene import Grid, Scene
from openswim.scene.atmosphere import Atmosphere
from openswim.scene.phase import HenyeyGreenstein, PhaseFunction
from openswim.solver import Solver
from openswim.transport.engine.pack import PACK
from openswim.transport.engine.scalar import share_of_step
from openswim.transport.swim.near_side import near_side
from openswim.transport.swim.phase import anisotropy, broadened, shaded_phase, thin_phase
from openswim.transport.swim.view import clear_share

SWIM = Solver("swim")


@pytest.mark.parametrize(("near", "far"), [(0.02, 0.02), (0.0, 0.03), (0.03, 0.0), (0.01, 0.05)])
@pytest.mark.parametrize("part", [0.1, 0.5, 0.99])
def test_depth_is_met_within_a_step(near: float, far: float, part: float) -> None:
    step = 200.0
    depth = step * (near * part + (far - near) * part**2 / 2)
    f32 = np.float32
    assert share_of_step(f32(near), f32(far), f32(step), f32(depth)) == pytest.approx(part, rel=1e-3)


@pytest.mark.parametrize("tau", [0.5, 1.5, 9.0])
@pytest.mark.parametrize("zenith", [0.0, 60.0])
def test_near_sides_of_even_cloud(tau: float, zenith: float) -> None:
    """Eq. 12 of a source that is the extinction, 1 - e^-min(tau, 2); the first unit of depth is half-way at half of
    it, and the whole ray counts for what is dimmed."""
    lit = SWIM.solve(slab(tau, levels=41), sun_at_zenith_angle(30.0), [WAVELENGTH_NM]).lit[0]
    volume = aimed_at(lit).volume
    volume.fields[..., PACK : 2 * PACK] = volume.fields[..., [volume.cloud_channel]]
    volume.fields[..., 2 * PACK + volume.species : volume.cloud_channel] = 0  # no depth to the sun: T = 1
    along = sun_at_zenith_angle(zenith)
    seen = near_side(np.zeros((1, 3)), along[None], lit.shells, volume, 1.0, None)
    slant = tau / along[2]
    assert seen.species_depth[0, 0] == pytest.approx(slant, rel=3e-6)
    assert seen.full[0, 0] == pytest.approx(np.exp(-slant), abs=2e-5)
    assert seen.lit[0, 0] == pytest.approx(1 - np.exp(-min(slant, 2)), rel=2e-5)
    assert seen.cloud_m[0] == pytest.approx(0.5 * min(1 / slant, 1) * 1000.0 / along[2], rel=3e-6)
    assert (seen.front == 0).all()


@pytest.mark.parametrize("zenith", [0.0, 60.0])
@pytest.mark.parametrize("falling", [0.0, 60.0])
def test_near_side_of_a_cloud_whose_top_is_one_thick_cell(zenith: float, falling: float) -> None:
    """Eq. 12 in a cloud that thins out from 2 to 4 km, 30 units of depth: int e^-x/(1 + b x mu/mu_0) dx."""
    across = np.arange(3) * 1000.0
    extinction = np.array([0.03, 0.03, 0.0], np.float32)[:, None, None] * np.ones((3, 3), np.float32)
    scene = Scene.from_arrays(
        extinction, across, across, np.array([0.0, 2000.0, 4000.0]), kind="liquid", phase=HenyeyGreenstein(0.85),
        periodic=True, surface_albedo=0.0,
    )  # fmt: skip
    lit = SWIM.solve(scene, sun_at_zenith_angle(zenith), [WAVELENGTH_NM]).lit[0]
    eye, mu, mu_0 = np.array([[0.0, 0.0, 4001.0]]), np.cos(np.radians(falling)), np.cos(np.radians(zenith))
    seen = near_side(eye, -sun_at_zenith_angle(falling)[None], lit.shells, aimed_at(lit).volume, 1.0, None)
    x = np.linspace(0.0, 2.0, 2001)
    light = np.exp(-x) / (1 + lit.medium.species[0].backscatter_fraction * x * mu / mu_0)
    assert seen.lit[0, 0] == pytest.approx(np.trapezoid(light, x), rel=8e-3)


@pytest.mark.parametrize(
    ("altitude", "above", "lit_side", "below"), [(90.0, 0.003, 0.036, 0.003), (40.0, 0.0045, 0.026, 0.02)]
)
def test_a_cloud_in_thick_cells_looks_like_the_same_cloud_in_thin_ones(
    altitude: float, above: float, lit_side: float, below: float
) -> None:
    """Five to one along every axis; means of what is seen from above, on the side of the sun and from the ground."""
    shape = (9, 11, 11)
    thick = box(shape, (slice(3, 6), slice(3, 8), slice(3, 8)), 1.0)
    thick *= 0.01 + 0.02 * np.random.default_rng(1).random(shape).astype(np.float32)
    thin = np.maximum(zoom(thick, [(5 * (n - 1) + 1) / n for n in shape], order=1), 0)
    down = down_on(*np.meshgrid(*2 * [np.linspace(-1200.0, 1200.0, 25)]), 6000.0)
    side = Rays(np.array([6000.0, 0.0, 2000.0]), np.array([toward(270.0, a) for a in np.linspace(-12, 12, 60)]))
    up = Rays(np.array([0.0, 0.0, 1.0]), sky_directions(np.linspace(0.0, 40.0, 10), np.arange(0.0, 360.0, 30.0)))
    found = []
    for cloud, cell_m in ((thick, 500.0), (thin, 100.0)):
        field = SWIM.solve(grid_scene(cloud, cloud.shape, (cell_m,) * 3), toward(90.0, altitude), [WAVELENGTH_NM])
        found.append([field.view(rays).radiance.mean() for rays in (down, side, up)])
    for own, true, part in zip(*found, (above, lit_side, below), strict=True):
        assert own == pytest.approx(true, rel=part)


@pytest.mark.parametrize("levels_m", [[0, 1e3, 2e3, 4e3, 6e3, 8e3], np.arange(0, 8100, 250)], ids=["km", "250 m"])
@pytest.mark.parametrize("zenith", [0.0, 60.0])
def test_thick_water_is_as_white_from_above_as_fast_has_it(levels_m: list[float], zenith: float) -> None:
    """.3 g/m3 between 1 and 4 km, seen 30 degrees off the vertical on both sides, in levels of any thickness."""
    across, height_m = np.arange(4) * 1000.0, np.array(levels_m)
    water = 3e-4 * ((height_m >= 1000) & (height_m <= 4000))[:, None, None] * np.ones((4, 4))
    scene = Scene.from_arrays(
        None, across, across, height_m, fields={"liquid_content": water}, atmosphere=Atmosphere.us_standard(),
        surface_albedo=0.1, periodic=True,
    )  # fmt: skip
    rays = Rays(np.array([0.0, 0.0, 7900.0]), np.array([[x, 0.0, -np.sqrt(0.75)] for x in (0.5, -0.5)]))
    swim, fast = (view(scene, zenith, rays, Solver(name)) for name in ("swim", "fast"))
    np.testing.assert_allclose(swim, fast, rtol=0.07)


def test_air_in_front_of_cloud_ends_at_its_first_unit_of_depth() -> None:
    """Upward into a cloud that grows to .01/m from 1100 to 1200 m: half a unit there, the whole at 1250 m."""
    shape = (31, 12, 12)
    scene = grid_scene(box(shape, (slice(12, 20), slice(0, 12), slice(0, 12)), 0.01), shape, curved=True, air=True)
    lit = SWIM.solve(scene, toward(90.0, 40.0), [WAVELENGTH_NM]).lit[0]
    volume, eye, up = aimed_at(lit).volume, np.zeros((1, 3)), np.array([[0.0, 0.0, 1.0]])
    seen = near_side(eye, up, lit.shells, volume, 1.0, None)
    assert seen.cloud_m[0] == pytest.approx(1195.8, abs=4.8)  # by the middles of steps
    volume.fields[..., 2 * PACK :] = 0
    clear, further = (near_side(eye, up, lit.shells, volume, 1.0, np.array([-end])) for end in (1250.0, 1350.0))
    assert seen.front[0, 0] == pytest.approx(clear.front[0, 0], rel=3e-4)
    assert further.front[0, 0] > 1.05 * clear.front[0, 0]


@pytest.mark.parametrize("g", [0.3, 0.85, 0.95])
@pytest.mark.parametrize("s", [1.0, 2.0, 4.0])
def test_broadening_is_that_of_the_paper_for_its_own_phase_functions(g: float, s: float) -> None:
    """p(theta, g^s) of Eqs 18 and B1-B3."""
    mu = np.cos(np.radians(np.linspace(0, 180, 50)))
    expected = HenyeyGreenstein(g**s).value(mu)
    # linear interpolation of the peak between the table's angles: 3 %
    np.testing.assert_allclose(broadened(HenyeyGreenstein(g), mu, np.full_like(mu, s)), expected, rtol=0.03, atol=2e-3)


def test_thick_clouds_are_darker_toward_the_horizon_from_below_and_forward_bright_from_above() -> None:
    np.testing.assert_allclose(shaded_phase(np.array([1.0, 0.5, 0.0, -0.3])), [1, 2 / 3, 1 / 3, 1 / 3])  # Eq. 20
    # Eq. 25 overhead: (1.48 + 7.76 + P(180))/8, P of g = .7, f_b = .4: .51/1.7^3 + .4 x .51/1.49^1.5 = .2160
    assert float(anisotropy(np.array(-1.0), np.array(1.0), np.array(1.0))) == pytest.approx(9.456 / 8, rel=1e-3)
    forward, back = anisotropy(np.array([0.6, -1.0]), np.array([0.4, 0.4]), np.array([0.4, 0.4]))
    assert forward > back


def view(scene, zenith: float, rays: Rays, solver: Solver = SWIM) -> np.ndarray:
    return solver.solve(scene, sun_at_zenith_angle(zenith), [WAVELENGTH_NM]).view(rays).radiance[:, 0]


PHASES: dict[str, PhaseFunction] = {
    "cloud": HenyeyGreenstein(0.85),
    "colorado": spectral_phase(aerosol_type("colorado_dust"), [WAVELENGTH_NM])[0],
    "saudi": spectral_phase(aerosol_type("saudi_dust_pollution"), [WAVELENGTH_NM])[0],
}


@pytest.mark.parametrize("name", PHASES)
@pytest.mark.parametrize("omega", [1.0, 0.9])
@pytest.mark.parametrize("upward", [True, False], ids=["from below", "from above"])
def test_thin_layers_scatter_once(name: str, omega: float, upward: bool) -> None:
    """Eq. 11: L' = P(theta) omega tau_o, with the phase functions of Eqs 9-10 and 27-29 (Table 3)."""
    tau, zenith = 0.002, np.array([10.0, 40.0, 60.0])
    scene = slab(tau, omega=omega, phase=PHASES[name])
    z = np.radians(zenith)
    d = np.stack([np.sin(z), 0 * z, np.cos(z) if upward else -np.cos(z)], axis=-1)
    seen = view(scene, 30.0, Rays(np.array([0, 0, 0.0 if upward else 1001.0]), d))
    expected = PHASES[name].value(d @ sun_at_zenith_angle(30.0)) * omega * tau / np.cos(z)
    # what is scattered again, and 1 - c1, are of the order of tau and b tau
    np.testing.assert_allclose(seen, expected, rtol=0.03, atol=0.05 * tau)


@pytest.mark.parametrize(("zenith", "disort"), [(0.0, 3.96), (60.0, 1.70)])
def test_thick_clouds_are_white_from_above(zenith: float, disort: float) -> None:
    """Eqs 24-26 straight down on tau = 100; DISORT's values for a Mie cloud."""
    down = Rays(np.array([0.0, 0.0, 1001.0]), np.array([[0.0, 0.0, -1.0]]))
    assert view(slab(100.0, levels=129, kind="liquid"), zenith, down)[0] == pytest.approx(disort, rel=0.1)


def test_clouds_from_above_have_no_seam_where_from_below_begins() -> None:
    altitude = np.linspace(-25.0, 8.0, 67)
    shape = (31, 31, 31)
    cloud = np.zeros(shape, np.float32)
    cloud[8:26, 8:23, 8:23] = 0.03
    scene = grid_scene(cloud, shape)
    radiance = Solver("swim").solve(scene, toward(90.0, 40.0), [WAVELENGTH_NM]).view(
        Rays(np.array([-3000.0, 0.0, 2000.0]), np.array([toward(90.0, a) for a in altitude]))
    )
    inside = radiance.species_depth[:, 0] > 20
    assert inside.sum() > 20
    steps = np.abs(np.diff(np.log(radiance.radiance[inside, 0])))
    assert steps.max() < 0.12  # half a degree apart


@pytest.mark.parametrize("azimuth", [0.0, 90.0, 180.0])
def test_there_is_no_line_at_the_level_of_an_eye_within_cloud(azimuth: float) -> None:
    """The light of the sky that clouds mirror passes smoothly into that of the ground."""
    shape = (31, 31, 31)
    cloud = np.zeros(shape, np.float32)
    cloud[8:26, 8:23, 8:23] = 0.03
    lit = Solver("swim").solve(grid_scene(cloud, shape, air=True), toward(90.0, 40.0), [WAVELENGTH_NM])
    just = Rays(np.array([0.0, 0.0, 2050.0]), np.array([toward(azimuth, a) for a in (-0.01, 0.01)]))
    below, above = lit.view(just).radiance[:, 0]
    assert below == pytest.approx(above, rel=2e-3)


def test_absorbing_layers_are_darker_on_both_sides() -> None:
    up = Rays(np.zeros(3), sky_directions([5.0, 50.0], [0.0, 90.0]))
    down = Rays(np.array([0.0, 0.0, 1001.0]), -sky_directions([5.0, 50.0], [0.0, 90.0]))
    for rays in (up, down):
        by_omega = [view(slab(8.0, omega=o, phase=PHASES["saudi"]), 40.0, rays) for o in (0.86, 0.94, 1.0)]
        assert (np.diff(by_omega, axis=0) > 0).all()


def test_what_only_absorbs_is_black() -> None:
    """Alone, and of finite light beside white cloud and air."""
    sky = sky_directions([5.0, 50.0, 85.0], [0.0, 90.0])
    for height, direction in ((1.0, sky), (1001.0, -sky)):
        black = view(slab(8.0, omega=0.0), 40.0, Rays(np.array([0.0, 0.0, height]), direction))
        np.testing.assert_array_equal(black, 0.0)
    soot = box((9, 8, 8), (slice(2, 6), slice(0, 8), slice(0, 5)), 0.02)
    cloud = box((9, 8, 8), (slice(4, 8), slice(0, 8), slice(3, 8)), 0.01)
    scene = grid_scene(
        {"soot": soot, "cloud": cloud}, soot.shape, curved=True, air=True, surface_albedo=0.3,
        single_scattering_albedo={"soot": 0.0, "cloud": 1.0},
    )  # fmt: skip
    field = SWIM.solve(scene, toward(90.0, 40.0), [WAVELENGTH_NM])
    through_soot, _, through_cloud = seen = field.view(down_on([-200.0, 0.0, 300.0], 0.0, 3000.0)).radiance[:, 0]
    assert np.isfinite(seen).all()
    assert 0 < through_soot < 0.5 * through_cloud
    for values in field.fluxes().values():
        assert np.isfinite(values).all()
        assert (values >= 0).all()


def test_dark_smoke_dims_the_ground_as_two_streams_do() -> None:
    """tau = 10, g = .85, omega = .95, sun overhead: DISORT lets .437 of the conservative layer's light through."""
    light = [
        sum(SWIM.solve(slab(10.0, omega=o), sun_at_zenith_angle(0.0), [WAVELENGTH_NM]).fluxes()[name][0]
            for name in ("down_bottom", "direct_bottom"))
        for o in (0.95, 1.0)
    ]  # fmt: skip
    assert light[0] / light[1] == pytest.approx(0.437, abs=0.03)


def test_mixtures_lie_between_their_parts() -> None:
    """Appendix B: interpolation between the results for the species."""
    share, d = 0.3, sky_directions([20.0, 60.0], [0.0, 120.0])
    across = np.full((65, 3, 3), 1.0, np.float32) * 5e-4
    phases = {"a": HenyeyGreenstein(0.6), "b": HenyeyGreenstein(0.9)}

    def sky(parts: dict[str, float]) -> np.ndarray:
        scene = slab(1.0)
        mixed = type(scene).from_arrays(
            {name: across * part for name, part in parts.items()}, scene.grid.x, scene.grid.y, scene.grid.height_m,
            phase={name: phases[name] for name in parts}, kind="liquid", periodic=True,
        )  # fmt: skip
        return view(mixed, 40.0, Rays(np.zeros(3), d))

    mixed, a, b = sky({"a": share, "b": 1 - share}), sky({"a": 1.0}), sky({"b": 1.0})
    np.testing.assert_allclose(mixed, share * a + (1 - share) * b, rtol=1e-3)


def test_papers_thin_phases_are_an_option() -> None:
    rays = Rays(np.zeros(3), sun_at_zenith_angle(35.0)[None])
    scene = slab(0.5, kind="liquid", phase=HenyeyGreenstein(0.85))
    own, paper = view(scene, 30.0, rays), view(scene, 30.0, rays, Solver("swim", paper_phases=True))
    mu = np.cos(np.radians([5.0]))
    expected = thin_phase("liquid", mu, np.ones(1), WAVELENGTH_NM) / HenyeyGreenstein(0.85).value(mu)
    assert paper[0] / own[0] == pytest.approx(float(expected[0]), rel=0.02)


def test_clear_sky_shows_in_front_of_clouds_and_through_them() -> None:
    """Eq. 32 corrected: f_front + (1 - f_front) e^-tau."""
    air = np.full(4, 0.2)
    tau, front = np.array([0.0, 50.0, 50.0, 1.0]), np.array([0.0, 0.0, 0.2, 0.1])
    half = (1 - np.exp(-0.1)) / (1 - np.exp(-0.2))
    np.testing.assert_allclose(
        clear_share(tau, front, air), [1.0, 0.0, 1.0, half + (1 - half) * np.exp(-1)], atol=1e-9
    )


def test_mountains_and_valleys_have_the_air_that_fast_gives_them() -> None:
    """A ridge hides the air behind it, and an observer below the plain around the grid still has a sky."""
    shape, cell = (25, 21, 61), 500.0
    x = cell * (np.arange(shape[2]) - 30)
    terrain = np.broadcast_to(600.0 + 2500.0 * np.exp(-(((x - 9000.0) / 2500.0) ** 2)), shape[1:]).copy()
    terrain[:, 10:20] = 100.0
    scene = grid_scene({}, shape, (cell, cell, 200.0), curved=True, air=True, terrain_m=terrain)
    sun = toward(200.0, 50.0)
    swim, fast = (Solver(name).solve(scene, sun, [450.0]) for name in ("swim", "fast"))
    eye = np.array([-7500.0, 0.0, 200.0])
    for azimuth, altitude in ((90.0, 2.0), (90.0, 5.0), (0.0, 30.0), (0.0, 80.0)):
        rays = Rays(eye[None], toward(azimuth, altitude)[None])
        a, b = (field.view(rays) for field in (swim, fast))
        assert a.hit[0] == b.hit[0] == (altitude < 10 and azimuth > 45)
        # the shadows of ridges and the sky's shading are only in `fast`
        assert a.radiance[0, 0] == pytest.approx(b.radiance[0, 0], rel=0.2)


def test_nothing_negative_and_no_nan_from_random_scenes() -> None:
    rng = np.random.default_rng(3)
    shape = (12, 14, 13)
    for zenith in (0.0, 60.0, 88.0, 95.0):
        extinction = {
            "a": rng.exponential(0.02, shape) * (rng.random(shape) > 0.7),
            "b": rng.exponential(1e-4, shape),
        }
        scene = grid_scene(
            extinction, shape, curved=True, air=True, single_scattering_albedo={"a": 1.0, "b": 0.88}, surface_albedo=0.3
        )
        field = SWIM.solve(scene, toward(150.0, 90.0 - zenith))
        for height, sign in ((2.0, 1), (5000.0, -1), (600.0, 1)):
            d = sign * sky_directions([0.0, 30.0, 70.0, 89.0], [0.0, 77.0, 150.0, 200.0])
            seen = field.view(Rays(np.array([30.0, -20.0, height]), d))
            assert np.isfinite(seen.radiance).all()
            assert (seen.radiance >= 0).all()


@pytest.mark.parametrize("cloudy", [True, False], ids=["cloud", "water"])
def test_the_night_side_is_dark(cloudy: bool) -> None:
    """From noon far into the night: cloud and sea are lit where the sun is up, black 40 degrees past the terminator."""
    from pyproj import CRS

    radius, nodes = 6.371e6, 41
    axis = np.linspace(-1, 1, nodes) * 2 * radius * np.sin(np.radians(80) / 2)
    cloud = np.zeros((5, nodes, nodes), np.float32)
    cloud[2] = 2e-4 * cloudy
    level, plane = ("z", "y", "x"), ("y", "x")
    data = xr.Dataset({"liquid_content": (level, cloud), "land_area_fraction": (plane, np.zeros((nodes, nodes)))})
    crs = CRS.from_proj4(f"+proj=laea +lat_0=10 +lon_0=20 +R={radius}")
    scene = Scene(Grid(axis, axis, np.arange(5) * 2000.0, crs, radius), data, Atmosphere.us_standard())
    field = SWIM.solve(scene, np.array([np.cos(0.4), 0.0, np.sin(0.4)]), [WAVELENGTH_NM])
    eye = np.array([0.0, 0.0, 4e7])
    for angle_deg, low, high in ((50.0, 0.1, 5.0), (0.0, 0.1, 5.0), (-63.0, 0.0, 1e-3)):
        angle = np.radians(angle_deg)
        place = radius * np.array([np.sin(angle), 0.0, np.cos(angle) - 1])
        along = (place - eye) / np.linalg.norm(place - eye)
        seen = field.view(Rays(eye, np.stack([along, along * [1.0, 1.0, 1.000001]]))).radiance[0, 0]
        assert low <= seen <= high, (angle_deg, seen)
