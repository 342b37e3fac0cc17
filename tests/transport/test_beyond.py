"""Light and shadow of a grid's clouds on the ground beyond its sides."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.interpolate import RegularGridInterpolator
from tests.transport.scenes import WAVELENGTH_NM, box, down_on, grid_scene, sun_at_zenith_angle

from openswim.scene import Scene
from openswim.scene.phase import HenyeyGreenstein
from openswim.solver import Solver
from openswim.transport import Field
from openswim.transport.view import shading
from openswim.transport.view.beyond_sides import Beyond
from openswim.transport.view.shading import _beyond

ALBEDO = 0.2
SHAPE, CELL = (25, 33, 33), 50.0
HALF = CELL * 16


def block(across: slice, extinction_per_m: float, albedo: float = ALBEDO, **more) -> Scene:
    """A block of cloud from 500 to 950 m in a grid 1600 m wide."""
    field = box(SHAPE, (slice(10, 20), slice(12, 21), across), extinction_per_m)
    return grid_scene(field, SHAPE, (CELL,) * 3, surface_albedo=albedo, **more)


def flux(field, x_m, y_m) -> np.ndarray:
    """All that falls on the horizontal ground, by what it reflects, from a metre above."""
    return field.view(down_on(x_m, y_m, 1.0)).radiance[:, 0] / (4 * ALBEDO)


def beyond(field: Field) -> Beyond:
    found = _beyond(field.lit[0])
    assert found is not None
    return found


def diffuse(field: Field, x_m, y_m) -> np.ndarray:
    """Flux of diffuse light at places of a scene without air, whose sky has none."""
    x, y = np.broadcast_arrays(np.asarray(x_m, float), np.asarray(y_m, float))
    inside = field.lit[0].lighting.diffuse
    at = (x.ravel() + HALF) / CELL, (y.ravel() + HALF) / CELL
    return beyond(field).flux(*at, np.zeros((x.size, 4)), inside)[:, 0].reshape(x.shape)


@pytest.fixture(scope="module")
def thin() -> Field:
    """A cloud so thin that light is scattered but once in it, to all sides alike."""
    extinction = box(SHAPE, (slice(10, 20), slice(12, 21), slice(12, 21)), 1e-5)
    x = CELL * (np.arange(33) - 16)
    scene = Scene.from_arrays(extinction, x, x, CELL * np.arange(25), phase=HenyeyGreenstein(0.0), surface_albedo=0.0)
    return Solver().solve(scene, sun_at_zenith_angle(30.0), [WAVELENGTH_NM])


def scattered_once(x, y) -> np.ndarray:
    """Flux on the ground from the nodes of `thin`, each of them E_TOA beta V/(4 pi) strong: cosine over r^2."""
    across, up = CELL * (np.arange(12, 21) - 16), CELL * np.arange(10, 20)
    z, v, u = (n.ravel() for n in np.meshgrid(up, across, across, indexing="ij"))
    square = (x[..., None] - u) ** 2 + (y[..., None] - v) ** 2 + z**2
    return 1e-5 * CELL**3 / (4 * np.pi) * (z / square**1.5).sum(axis=-1)


def test_a_thin_cloud_lights_the_ground_as_its_parts_do(thin: Field) -> None:
    """On rings around it: the light of a small cloud is drawn toward the ordinates, and stays as far away."""
    angle = np.radians(np.arange(0.0, 360.0, 5.0))
    for radius in (1400.0, 1600.0, 2400.0, 4800.0, 8000.0):
        x, y = radius * np.cos(angle), radius * np.sin(angle)
        assert diffuse(thin, x, y).mean() == pytest.approx(scattered_once(x, y).mean(), rel=0.08)


def test_ground_all_around_gets_what_a_thin_cloud_sends_down(thin: Field) -> None:
    """In sum, within 8 km of the grid's middle, less exactly than in places and without a preference for any side."""
    x, y = np.meshgrid(*2 * [np.arange(-8000.0, 8001.0, 100.0)])
    outside = (np.maximum(np.abs(x), np.abs(y)) > HALF) & (np.hypot(x, y) < 8000)
    expected = scattered_once(x, y)
    seen = diffuse(thin, x, y)
    assert seen[outside].sum() == pytest.approx(expected[outside].sum(), rel=0.06)
    for part in (x > np.abs(y), x < -np.abs(y), y > np.abs(x), y < -np.abs(x)):
        assert seen[outside & part].sum() == pytest.approx(expected[outside & part].sum(), rel=0.1)


@pytest.mark.slow
def test_it_is_as_monte_carlo_has_it(monkeypatch: pytest.MonkeyPatch) -> None:
    """A block as wide as its grid, by which half of the light on the ground before it is diffuse, and all behind."""
    scene = grid_scene(
        box(SHAPE, (slice(10, 20), slice(None), slice(None)), 0.01), SHAPE, (CELL,) * 3, surface_albedo=ALBEDO
    )
    sun = sun_at_zenith_angle(60.0)
    way = np.array([50.0, 100.0, 200.0, 400.0, 800.0])
    x = np.concatenate([-HALF - way[:-1], HALF + way, 0 * way])
    y = np.concatenate([0 * x[:-5], HALF + way])
    fast, exact = Solver().solve(scene, sun, [550.0]), Solver("reference", paths=32_000).solve(scene, sun, [550.0])
    seen, truth = flux(fast, x, y), flux(exact, x, y)
    np.testing.assert_allclose(seen, truth, atol=0.02)  # noise of .004 to .006 at the foot of the block
    monkeypatch.setattr(shading, "_beyond", lambda lit: None)
    assert np.abs(flux(fast, x, y) - truth).max() > 0.1


@pytest.mark.parametrize("curved", [False, True])
def test_light_goes_on_across_the_sides(curved: bool) -> None:
    """A metre to either side of them, and along the sides farther out, there is no seam."""
    scene = block(slice(22, 33), 0.03, curved=curved, air=True)
    field = Solver().solve(scene, sun_at_zenith_angle(40.0), [550.0])
    along = np.arange(-700.0, 701.0, 50.0)
    for sign in (-1, 1):
        for swap in (False, True):
            before, after = (
                flux(field, *((along, 0 * along + sign * (HALF + d))[:: -1 if swap else 1])) for d in (-1.0, 1.0)
            )
            np.testing.assert_allclose(after, before, rtol=0.01)
    outward = np.arange(10.0, 3000.0, 10.0)
    step = np.diff(flux(field, 0 * outward - 300.0, -HALF - outward))
    assert np.abs(step).max() < 0.004


def test_without_clouds_the_ground_has_the_clear_sky() -> None:
    scene = grid_scene({}, SHAPE, (CELL,) * 3, air=True, curved=True, surface_albedo=ALBEDO)
    field = Solver().solve(scene, sun_at_zenith_angle(40.0), [550.0])
    clear = np.full((3, 4), 0.1)
    at = np.array([-1.0, 40.0, 500.0])
    np.testing.assert_array_equal(beyond(field).flux(at, at, clear, field.lit[0].lighting.diffuse), clear)


def test_clouds_beside_hide_some_of_a_bright_sky() -> None:
    """Black clouds add nothing."""
    scene = block(slice(None), 0.03, air=True, single_scattering_albedo=0.0)
    field = Solver().solve(scene, sun_at_zenith_angle(70.0), [450.0])
    way = np.array([50.0, 200.0, 800.0, 4000.0])
    seen = flux(field, 0 * way, HALF + way)
    far = float(flux(field, [0.0], [60_000.0])[0])
    assert (np.diff(seen) > 0).all()
    assert seen[0] < 0.99 * far
    assert seen[3] == pytest.approx(far, rel=0.01)


def test_far_away_nothing_is_left() -> None:
    field = Solver().solve(block(slice(None), 0.03), sun_at_zenith_angle(30.0), [550.0])
    assert diffuse(field, [0.0, 25_000.0], [-25_000.0, 0.0]).max() == 0.0


@pytest.mark.parametrize("zenith", [60.0, 80.0])
def test_shadows_beyond_are_as_deep_as_the_way_through_cloud(zenith: float) -> None:
    """Black cloud: e^-depth, with extinction linear between nodes."""
    extinction = box(SHAPE, (slice(10, 20), slice(12, 21), slice(4, 21)), 0.003)
    scene = grid_scene(extinction, SHAPE, (CELL,) * 3, surface_albedo=ALBEDO, single_scattering_albedo=0.0)
    sun = sun_at_zenith_angle(zenith)
    field = Solver().solve(scene, sun, [WAVELENGTH_NM])
    place = np.stack(np.meshgrid([-100.0, 20.0, 210.0], np.linspace(-4000.0, -850.0, 80), [1.0]), -1).reshape(-1, 3)
    place = place[:, [1, 0, 2]]
    across, up = CELL * (np.arange(33) - 16), CELL * np.arange(25)
    field_at = RegularGridInterpolator((up, across, across), extinction, bounds_error=False, fill_value=0)
    t = np.linspace(0, 1200.0 / sun[2], 4001)
    depth = [field_at((p + t[:, None] * sun)[:, ::-1]).mean() * t[-1] for p in place]
    expected = sun[2] * np.exp(-np.array(depth))
    assert expected.min() < 0.5 * sun[2]
    np.testing.assert_allclose(flux(field, *place.T[:2]), expected, atol=0.02 * sun[2])


def test_where_the_way_to_the_sun_begins_to_pass_the_grid_nothing_changes() -> None:
    """In clear air the shadow's rays and the shells' table are alike: no line on the ground."""
    scene = block(slice(12, 21), 1e-9, air=True)
    field = Solver().solve(scene, sun_at_zenith_angle(60.0), [550.0])
    seen = flux(field, np.linspace(-6000.0, -850.0, 400), np.zeros(400))
    np.testing.assert_allclose(seen, seen[0], rtol=1e-3)  # the sweeps' own air is .05 % from the shells'
