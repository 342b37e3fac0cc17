"""Light on the ground under clouds: the clear sky's share of it, and all of it by Monte Carlo."""

from __future__ import annotations

import numpy as np
import pytest
from tests.transport.scenes import grid_scene, toward
from tests.transport.scenes import medium_of as drawn

from openswim.scene import Scene
from openswim.solver import Solver
from openswim.transport import ReferenceField
from openswim.transport.engine.ordinates import Ordinates, lebedev
from openswim.transport.ground_light.clear_share import clear_share
from openswim.transport.medium.medium import Medium

WAVELENGTHS_NM = [615.0, 546.0, 450.0]
MARK = 0.01


def overcast(columns: int, depth: float, periodic: bool = False) -> Scene:
    """A deck from 275 to 825 m over black ground, in cells for which the sweeps take Lebedev's ordinates."""
    shape = (21, columns, columns)
    field = np.zeros(shape, np.float32)
    field[6:17] = depth / 550.0
    return grid_scene(field, shape, (200.0, 200.0, 50.0), air=True, periodic=periodic)


def broken() -> Scene:
    """Forty cumuli that cover a third of the sky."""
    shape, rng = (21, 48, 48), np.random.default_rng(3)
    field = np.zeros(shape, np.float32)
    y, x = np.mgrid[:48, :48]
    for _ in range(40):
        place, radius = rng.uniform(0, 48, 2), rng.uniform(1.5, 4)
        inside = np.hypot(y - place[0], x - place[1]) < radius
        field[8 : int(rng.uniform(11, 16)), inside] = 0.02
    return grid_scene(field, shape, (200.0, 200.0, 100.0), curved=True, air=True)


def medium_of(scene: Scene) -> Medium:
    return drawn(scene, np.full(4, 546.0), 1.0, refine=False)


@pytest.mark.parametrize("periodic", [False, True])
def test_through_an_even_deck_it_fades_by_the_cosine(periodic: bool) -> None:
    medium, ordinates = medium_of(overcast(9, 2.0, periodic)), lebedev(50)
    share = clear_share(medium, np.ones(1, np.float32), ordinates, np.ones((50, 2), np.float32), np.full((2, 2), False))
    mu = ordinates.direction[:, 2]
    weight, down = ordinates.weight * mu, mu > 0
    expected = (weight[down] * np.exp(-2.0 / mu[down])).sum() / weight[down].sum()
    assert share.shape == (2, *medium.shape[1:])
    np.testing.assert_allclose(share, expected, rtol=0.01)  # levels have a little more than the deck


@pytest.mark.parametrize("east_ends", [False, True])
def test_a_cloud_hides_the_sky_where_its_shadow_falls(east_ends: bool) -> None:
    """Along one direction, east at 45 degrees: a wall 1000 m up hides it 1000 m to the west, beyond a side none."""
    shape = (13, 5, 21)
    field = np.zeros(shape, np.float32)
    field[10, :, 12] = field[10, :, 20] = 1.0
    medium = medium_of(grid_scene(field, shape, (100.0, 100.0, 100.0)))
    ends = np.array([[False, east_ends], [False, False]])
    east = Ordinates(np.array([[0.5**0.5, 0.0, 0.5**0.5]]), np.ones(1))
    share = clear_share(medium, np.ones(1, np.float32), east, np.ones((1, 1), np.float32), ends)[0]
    hidden = np.zeros(21, bool)
    hidden[[2, 10]] = True
    if not east_ends:  # what is at the side goes on
        hidden[11:] = True
    np.testing.assert_array_equal(share[2] < 1e-6, hidden)
    np.testing.assert_array_equal(share[2][~hidden], 1.0)


@pytest.mark.parametrize("periodic", [False, True])
def test_no_sky_is_seen_through_black_smoke(periodic: bool) -> None:
    """What ordinates miss of the clear sky's light, a hundredth and more, does not come through either: smoke that
    scatters nothing, of depth 20 from the ground on, leaves nothing."""
    smoke = np.zeros((12, 9, 9), np.float32)
    smoke[:8] = 20 / 350.0
    scene = grid_scene(
        smoke, smoke.shape, (200.0, 200.0, 50.0), air=True, periodic=periodic, single_scattering_albedo=0.0
    )
    diffuse = Solver().solve(scene, toward(70.0, 25.0), WAVELENGTHS_NM).lit[0].lighting.diffuse
    middle = diffuse[..., diffuse.shape[1] // 2, diffuse.shape[2] // 2]
    assert (middle < 6e-10).all()


def flux_down(field: ReferenceField, place: np.ndarray, up: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Mean diffuse and direct flux (nw,) to the ground at places (n, 3), and the standard error of the first."""
    diffuse, beam = field._half_space(place + 0.02 * up, up, 1)
    return diffuse[0].mean(axis=0), beam[0].mean(axis=0), np.sqrt((diffuse[1] ** 2).sum(axis=0)) / len(place)


def test_ground_under_an_overcast_by_monte_carlo() -> None:
    """In the middle of an open domain, away from the lit sides."""
    scene, sun, part = overcast(32, 5.0), toward(70.0, 25.0), slice(10, 22)
    reference = Solver("reference", paths=2500).solve(scene, sun, WAVELENGTHS_NM)
    medium = reference.medium
    place, axes = medium.place[part, part].reshape(-1, 3), medium.axes[part, part].reshape(-1, 3, 3)
    diffuse, beam, sigma = flux_down(reference, place, axes[:, 2].astype(float))
    expected = diffuse + beam
    lighting = Solver().solve(scene, sun, WAVELENGTHS_NM).packs[0].lighting
    seen = [(lighting.direct_horizontal(w) + lighting.diffuse[w])[part, part].mean() for w in range(3)]
    assert (sigma < 0.0045 * expected).all()
    assert (np.abs(seen - expected) < MARK * expected + 2 * sigma).all()


def test_ground_under_an_endless_overcast_by_monte_carlo() -> None:
    """With a high sun."""
    scene, sun = overcast(6, 5.0, periodic=True), toward(70.0, 60.0)
    _compare(scene, sun, 200)


def test_ground_under_broken_clouds_by_monte_carlo() -> None:
    """The mean diffuse light: .6 % too little in red, 1.5 % in blue (noise .5)."""
    _compare(broken(), toward(70.0, 25.0), 160, 0.0135)


def _compare(scene: Scene, sun: np.ndarray, paths: int, mark: float = MARK) -> None:
    """Mean diffuse flux of a domain."""
    reference = Solver("reference", paths=paths).solve(scene, sun, WAVELENGTHS_NM)
    expected, _, sigma = flux_down(reference, *reference._columns()[:2])
    seen = Solver().solve(scene, sun, WAVELENGTHS_NM).fluxes()["down_bottom"]
    assert (np.abs(seen - expected) < mark * expected + 2 * sigma).all(), (seen / expected, sigma / expected)
