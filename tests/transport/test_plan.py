"""Plan and values: with the plan given nothing is decided anew, and light is a smooth function of what clouds hold."""

import numpy as np
import pytest
from tests.transport.scenes import LAT, LON, WAVELENGTH_NM, box, grid_scene, laid_scene

from openswim.cameras import Camera
from openswim.errors import UserError
from openswim.ground.surface import surface_of
from openswim.optics.matter import matter_of
from openswim.scene import Scene
from openswim.solver import Solver
from openswim.transport import Field
from openswim.transport.engine.decisions import Decisions
from openswim.transport.medium import levels
from openswim.transport.medium.plan import Fineness, fineness_of, plan_medium
from openswim.transport.plan import plan_of

SHAPE, CELL_M = (14, 28, 28), 60.0
SUN = np.array([0.6, 0.2, 0.775])
SUN /= np.linalg.norm(SUN)


def cumuli(share: float = 1.0) -> Scene:
    """Flat-based clouds of up to a fifth of a gram of water per cubic metre, times a share, in air over the Earth."""
    nz, ny, nx = SHAPE
    z, y, x = CELL_M * np.mgrid[0:nz, 0:ny, 0:nx]
    rng, water = np.random.default_rng(5), np.zeros(SHAPE)
    for _ in range(9):
        (cx, cy), r = rng.uniform(300, 1300, 2), rng.uniform(100, 300)
        wide = np.clip(1 - ((x - cx) ** 2 + (y - cy) ** 2) / r**2, 0, 1)
        water += 1.65e-4 * wide * np.clip((z - 200) / 400, 0, 1) * (z < 300 + 1.5 * r)
    fields = {"liquid_content": (share * water).astype(np.float32)}
    return grid_scene({}, SHAPE, (CELL_M,) * 3, curved=True, air=True, surface_albedo=0.2, fields=fields)


def seen(field: Field) -> list[np.ndarray]:
    """L' of some hundred pixels, from the ground, from aloft and from space."""
    cameras = (
        Camera.panorama(LAT, LON, size=(24, 12)),
        Camera.perspective(LAT, LON, 3000.0, 0.0, -60.0, 50.0, size=(12, 9)),
        Camera.satellite(LAT, LON, 3e5, 0.5, 10),
    )
    return [field.view(c.rays(field.frame)).radiance.ravel().astype(float) for c in cameras]


def solved(scene: Scene, **more: object) -> Field:
    found = Solver().solve(scene, SUN, (615.0, 546.0, 450.0), **more)  # type: ignore[arg-type]
    assert isinstance(found, Field)
    return found


@pytest.fixture(scope="module")
def first() -> Field:
    return solved(cumuli())


def test_light_by_its_own_plan_is_the_same_bit_for_bit(first: Field) -> None:
    again = solved(cumuli(), plan=first.plan)
    for ours, theirs in zip(seen(again), seen(first), strict=True):
        np.testing.assert_array_equal(ours, theirs)
    for name, flux in first.fluxes().items():
        np.testing.assert_array_equal(again.fluxes()[name], flux)


def test_nothing_is_decided_anew(first: Field) -> None:
    """Half the water would have fewer levels and sweeps."""
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


def test_light_is_smooth_by_a_plan(first: Field) -> None:
    """What a cubic leaves of L', water changed by up to 5 %: without the plan levels and halvings change on the way.

    From the ground the aureole, up to 70 times as bright as the mean, is read from a table of peaks in float32.
    """
    change, plan = np.linspace(-0.05, 0.05, 9), first.plan
    powers = np.vander(change / 0.05, 4)
    views = [seen(solved(cumuli(1 + x), plan=plan)) for x in change]
    for values, bound in zip(map(np.array, zip(*views, strict=True)), (4.8e-5, 1e-5, 1e-5), strict=True):
        left = np.abs(values - powers @ np.linalg.lstsq(powers, values, rcond=None)[0]).max(axis=0)
        light = np.maximum(values.mean(axis=0), values.mean()) if bound > 1e-5 else values.mean()
        assert (left / light).max() < bound
    ends = [seen(solved(cumuli(1 + x)))[1] for x in change[[0, -1]]]
    steps = [np.abs(free - planned[1]).max() for free, planned in zip(ends, (views[0], views[-1]), strict=True)]
    assert max(steps) > 1e-3 * views[4][1].mean()


@pytest.mark.parametrize(
    ("cell_m", "columns", "curved", "parts"),
    [(20_000.0, 12, True, 8), (20_000.0, 32, False, 8), (20_000.0, 12, False, 16), (800.0, 12, True, 16)],
)
def test_columns_lit_each_by_itself_need_fewer_levels(cell_m: float, columns: int, curved: bool, parts: int) -> None:
    """A deck of an optical depth of 200 in each of its layers."""
    field = np.zeros((6, columns, columns), np.float32)
    field[2:5] = 0.1
    scene = grid_scene(field, field.shape, (cell_m, cell_m, 2000.0), curved=curved)
    terrain = surface_of(scene, WAVELENGTH_NM).terrain_m
    plan = plan_medium(matter_of(scene, WAVELENGTH_NM), terrain, 0.7, Fineness(divide=False))
    assert plan.stands_alone == (parts == 8)
    layers = np.diff(plan.own_levels_m)
    assert layers.min() == pytest.approx(2000.0 / parts)


def test_layers_deep_in_an_overcast_are_divided_less(monkeypatch: pytest.MonkeyPatch) -> None:
    """A deck 5 km tall, uneven across: its fluxes, and what is seen of it from below and above, by half the levels."""
    z, x = np.arange(0.0, 9e3, 500.0), 20e3 * (np.arange(20) - 9.5)
    cloud = np.zeros((len(z), 20, 20), np.float32)
    cloud[2:13] = 0.05 * (1 + 0.5 * np.sin(x / 60e3) * np.cos(x / 45e3)[:, None])
    scene, found = laid_scene(cloud, x, x, z, air=True, surface_albedo=0.2), []
    cameras = (Camera.allsky(LAT, LON, size=24), Camera.perspective(LAT, LON, 15e3, 0.0, -50.0, 60.0, size=(16, 12)))
    for deep in (levels._DEEP, np.inf):
        monkeypatch.setattr(levels, "_DEEP", deep)
        lit = solved(scene)
        assert lit.plan is not None
        assert lit.plan.medium is not None
        assert lit.plan.medium.stands_alone
        views = [lit.view(camera.rays(lit.frame)).radiance for camera in cameras]
        found.append((len(lit.plan.medium.own_levels_m), lit.fluxes(), views))
    (count, fluxes, views), (full_count, full_fluxes, full_views) = found
    assert count < 0.6 * full_count
    for name, flux in full_fluxes.items():
        np.testing.assert_allclose(fluxes[name], flux, rtol=1.8e-5, atol=1e-7)
    for view, full in zip(views, full_views, strict=True):
        np.testing.assert_allclose(view, full, rtol=1.6e-4)


def test_high_quality_divides_wide_cells_once_more_where_nodes_are_few_enough() -> None:
    """Clouds broken by their cover, of cells of 100 km; not where there would be more than are affordable."""
    finer = {}
    for columns in (10, 26, 40):
        shape = (20, columns, columns)
        own = fineness_of(shape, 1e5, True, True)
        finer[columns] = fineness_of(shape, 1e5, True, True, halve=True) / own
        assert 20 * (columns * own * finer[columns]) ** 2 < 15e6
    assert finer == {10: 1, 26: 2, 40: 1}


def test_traces_of_cloud_above_the_air_cost_no_levels() -> None:
    """As IFS has them up to 66 km: light is as without them, on half of the levels; what is seen keeps its own."""
    z = np.concatenate([np.arange(0.0, 6e3, 500.0), np.arange(6e3, 60.1e3, 1500.0)])
    x, cloud = 20e3 * (np.arange(20) - 9.5), np.zeros((len(z), 20, 20), np.float32)
    cloud[3:8, 4:15, 3:12] = 2e-3
    found, plans = {}, {}
    for name, above in (("none", 0.0), ("traces", 1e-9), ("seen", 1e-6)):
        field = cloud.copy()
        field[z > 20e3] = above
        scene = laid_scene(field, x, x, z, air=True, surface_albedo=0.2)
        lit = solved(scene)
        found[name], plans[name] = (lit.fluxes(), len(lit.plan.medium.own_levels_m)), lit.plan  # type: ignore[union-attr]
    with pytest.raises(UserError, match=r"the plan's levels end .* km high, the scene has cloud up to 60\.0 km"):
        solved(scene, plan=plans["none"])
    assert found["traces"][1] == found["none"][1] < found["seen"][1] - 20
    for name, flux in found["none"][0].items():
        np.testing.assert_allclose(found["traces"][0][name], flux, rtol=1e-4, atol=1e-5)


def test_reference_sees_the_clouds_that_fast_invents() -> None:
    """Broken by their cover in cells of 100 km, under traces of ice up to 60 km: on levels and nodes that are alike."""
    z = np.concatenate([np.arange(0.0, 6e3, 500.0), np.arange(6e3, 60.1e3, 1500.0)])
    x, cloud = 1e5 * (np.arange(17) - 8.0), np.zeros((len(z), 17, 17), np.float32)
    cloud[3:8, 4:15, 3:12] = 2e-3
    cloud[z > 20e3] = 1e-9
    scene = laid_scene(cloud, x, x, z, air=True, kind="ice", fields={"cloud_area_fraction": 0.4 * np.sign(cloud)})
    matter, surface = matter_of(scene, WAVELENGTH_NM), surface_of(scene, WAVELENGTH_NM)
    fast, reference = (plan_of(Solver(name), matter, surface, SUN).medium for name in ("fast", "reference"))
    assert fast is not None
    assert reference is not None
    assert fast.fineness == reference.fineness > 4
    np.testing.assert_array_equal(fast.own_levels_m, reference.own_levels_m)


def test_clouds_broken_by_their_cover_are_swept_on_few_nodes_alone() -> None:
    """Of cells of 20 km: 7 x 6 columns are divided until each is lit by itself, and with quality high further."""
    assert [fineness_of((58, 6, 7), 20e3, True, True, halve) for halve in (False, True)] == [16, 32]
