"""Plan and values: with the plan given nothing is decided anew, and light is a smooth function of what clouds hold."""

import numpy as np
import pytest
from tests.transport.scenes import LAT, LON, WAVELENGTH_NM, box, grid_scene

from openswim.cameras import Camera
from openswim.errors import UserError
from openswim.scene import Scene
from openswim.solver import Solver
from openswim.transport import Field
from openswim.transport.engine.decisions import Decisions

SHAPE = (14, 20, 20)
SUN = np.array([0.6, 0.2, 0.775])
SUN /= np.linalg.norm(SUN)


def cumuli(share: float = 1.0) -> Scene:
    """Flat-based clouds of up to a gram of water per cubic metre, times a share, in air over the Earth."""
    nz, ny, nx = SHAPE
    z, y, x = np.meshgrid(100.0 * np.arange(nz), 100.0 * (np.arange(ny) - 9.5), 100.0 * (np.arange(nx) - 9.5),
                          indexing="ij")  # fmt: skip
    rng, water = np.random.default_rng(5), np.zeros(SHAPE)
    for _ in range(9):
        (cx, cy), r = rng.uniform(-700, 700, 2), rng.uniform(150, 400)
        wide = np.clip(1 - ((x - cx) ** 2 + (y - cy) ** 2) / r**2, 0, 1)
        water += 1e-3 * wide * np.clip((z - 400) / 600, 0, 1) * (z < 500 + 1.5 * r)
    fields = {"liquid_content": (share * water).astype(np.float32)}
    return grid_scene({}, SHAPE, curved=True, air=True, surface_albedo=0.2, fields=fields)


def seen(field: Field) -> np.ndarray:
    """L' of some hundred pixels, from the ground, from aloft and from space."""
    cameras = (
        Camera.panorama(LAT, LON, size=(24, 12)),
        Camera.perspective(LAT, LON, 3000.0, 0.0, -60.0, 50.0, size=(12, 9)),
        Camera.satellite(LAT, LON, 3e5, 0.5, 10),
    )
    return np.concatenate([field.view(c.rays(field.frame)).radiance.ravel() for c in cameras]).astype(float)


def solved(scene: Scene, **more: object) -> Field:
    found = Solver().solve(scene, SUN, (615.0, 546.0, 450.0), **more)  # type: ignore[arg-type]
    assert isinstance(found, Field)
    return found


def test_light_by_its_own_plan_is_the_same_bit_for_bit() -> None:
    first = solved(cumuli())
    again = solved(cumuli(), plan=first.plan)
    np.testing.assert_array_equal(seen(again), seen(first))
    for name, flux in first.fluxes().items():
        np.testing.assert_array_equal(again.fluxes()[name], flux)


def test_nothing_is_decided_anew() -> None:
    """Half the water would have fewer levels and sweeps."""
    first = solved(cumuli())
    assert first.plan is not None
    seen(first)
    count = {name: len(made) for name, made in first.plan.decided.items()}
    thin = solved(cumuli(0.3), plan=first.plan)
    seen(thin)
    assert {name: len(made) for name, made in first.plan.decided.items()} == count
    assert thin.lit[0].sweeps == first.lit[0].sweeps
    assert thin.medium is not None
    assert first.medium is not None
    assert thin.medium.shape == first.medium.shape
    free = solved(cumuli(0.3))
    assert free.lit[0].sweeps != first.lit[0].sweeps


def test_plans_of_something_else_are_refused() -> None:
    scene = grid_scene(box((6, 8, 8), (slice(2, 4), slice(2, 6), slice(2, 6)), 0.02), (6, 8, 8))
    plan = Solver("swim").solve(scene, SUN, [WAVELENGTH_NM]).plan  # type: ignore[union-attr]
    other = grid_scene(np.zeros((6, 8, 9), np.float32), (6, 8, 9))
    with pytest.raises(UserError, match="the plan is of a grid of"):
        Solver("swim").solve(other, SUN, [WAVELENGTH_NM], plan)
    with pytest.raises(UserError, match="name = swim"):
        Solver().solve(scene, SUN, [WAVELENGTH_NM], plan)
    nothing = grid_scene(np.zeros((6, 8, 8), np.float32), (6, 8, 8))
    with pytest.raises(UserError, match="the plan is of cloud, the scene has none"):
        Solver("swim").solve(nothing, SUN, [WAVELENGTH_NM], plan)


def test_decisions_are_made_once() -> None:
    made: dict = {}
    first = Decisions(made)
    assert [first("level", lambda n=n: n) for n in range(3)] == [0, 1, 2]
    assert [first.within("part")("level", lambda n=n: n) for n in (7, 8)] == [7, 8]
    again = Decisions(made)
    assert [again("level", lambda: -1) for _ in range(4)] == [0, 1, 2, -1]
    assert [again.within("part")("level", lambda: -1) for _ in range(2)] == [7, 8]


def test_light_is_smooth_by_a_plan() -> None:
    """Water changed by up to 5 %: what a cubic leaves of L', by the plan of the middle; without it steps remain."""
    change = np.linspace(-0.05, 0.05, 21)
    plan = solved(cumuli()).plan
    values = np.array([seen(solved(cumuli(1 + x), plan=plan)) for x in change])
    powers = np.vander(change / 0.05, 4)
    left = values - powers @ np.linalg.lstsq(powers, values, rcond=None)[0]
    assert np.abs(left).max() < 1e-5 * values.mean()
