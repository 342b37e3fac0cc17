"""The linear core against itself: transposes, differences, Taylor remainders, threads.

Tolerances of dot products are shares of the sum of absolute products.
"""

import itertools

import numba
import numpy as np
import pytest
from scipy.ndimage import map_coordinates
from tests.transport.linear.scenes import lumpy

from openswim import Scene, Solver
from openswim.errors import UserError
from openswim.scene.phase import HenyeyGreenstein
from openswim.transport.linear import beam_taken, diffuse, sun_depth
from openswim.transport.linear.diffuse import Change
from openswim.transport.linear.images import Images
from openswim.transport.linear.moments import emit, gather
from openswim.transport.linear.optics import mixed
from openswim.transport.linear.sun_depth import depths

EXACT = 1e-12


def _apart(one, two):
    """|<a, b> - <c, d>| over the sum of absolute products, of lists of pairs."""
    left, right = (sum(float((np.ravel(a) * np.ravel(b)).sum()) for a, b in pairs) for pairs in (one, two))
    return abs(left - right) / sum(float(np.abs(np.ravel(a) * np.ravel(b)).sum()) for a, b in (*one, *two))


@pytest.fixture(scope="module")
def linearised():
    core, extinction, albedo = lumpy()
    images, state = core.forward(extinction, albedo)
    return core, extinction, albedo, images, state


def test_depth_to_the_sun_is_transposed(linearised):
    core, rng = linearised[0], np.random.default_rng(3)
    change = rng.standard_normal((2, core.world.nodes))
    bar = rng.standard_normal((core.world.nodes, 2))
    optics = core.optics[0]
    found, back = core._depth(optics, change), core._depth_transposed(optics, bar)
    assert _apart([(found, bar)], [(change, back)]) < EXACT


def test_depth_to_the_sun_is_exact_for_what_is_linear(linearised):
    """Extinction that grows with height alone: the trapezoid is exact, until the ray leaves at a side."""
    world = linearised[0].world
    z, x, y = world.levels_m, *(world.cell_m[a] * np.arange(world.shape[2 - a]) for a in (0, 1))
    field = np.broadcast_to((1e-3 * (1 + z / 100))[:, None, None], world.shape).ravel()
    out, sun = depths(world, np.stack([field, 2 * field], axis=-1)), world.local_sun[0, 0]
    zz, yy, xx = np.meshgrid(z, y, x, indexing="ij")
    way = np.minimum.reduce([(z[-1] - zz) / sun[2], (x[-1] - xx) / sun[0], (y[-1] - yy) / sun[1]])
    exact = 1e-3 * way * (1 + (zz + 0.5 * way * sun[2]) / 100)
    assert np.allclose(out[:, 0], exact.ravel(), rtol=1e-12, atol=1e-14)
    assert np.allclose(out[:, 1], 2 * out[:, 0], rtol=1e-14)


def test_what_cells_take_of_the_beam_is_transposed(linearised):
    core, state, rng = linearised[0], linearised[4], np.random.default_rng(4)
    beam, ext = core._grid(state.terms[0].beam), core._grid(state.terms[0].filled.ext)
    d_beam, d_ext, bar = rng.standard_normal((3, *core.shape))
    found = beam_taken.lit_tangent(beam, ext, *core._cells, d_beam, d_ext)
    by_beam, by_ext = beam_taken.lit_transposed(beam, ext, *core._cells, bar)
    assert _apart([(found, bar)], [(d_beam, by_beam), (d_ext, by_ext)]) < EXACT
    h = 1e-6
    moved = [beam_taken.lit(beam * (1 + s * h * d_beam), ext * (1 + s * h * d_ext), *core._cells) for s in (1, -1)]
    slope = beam_taken.lit_tangent(beam, ext, *core._cells, beam * d_beam, ext * d_ext)
    assert np.abs((moved[0] - moved[1]) / (2 * h) - slope).max() < 1e-7 * np.abs(slope).max()


def test_bends_of_the_depth_are_transposed(linearised):
    core, one, rng = linearised[0], linearised[4].terms[0], np.random.default_rng(4)
    ext = mixed(core.optics[0].scaled, one.extinction)
    d_depth, d_ext = rng.standard_normal((2, core.world.nodes)) * np.reshape([1.0, 1e-2], (2, 1))
    bar = rng.standard_normal((core.world.nodes, 3))
    found = sun_depth.bends_tangent(core.world, one.depth, ext, d_depth, d_ext)
    by_depth, by_ext = sun_depth.bends_transposed(core.world, one.depth, ext, bar)
    assert _apart([(found, bar)], [(d_depth, by_depth), (d_ext, by_ext)]) < EXACT
    h = 1e-5
    moved = [sun_depth.bends(core.world, one.depth * (1 + s * h * d_depth), ext * (1 + s * h * d_ext)) for s in (1, -1)]
    slope = sun_depth.bends_tangent(core.world, one.depth, ext, one.depth * d_depth, ext * d_ext)
    assert np.abs((moved[0] - moved[1]) / (2 * h) - slope).max() < 2e-7 * np.abs(slope).max()


@pytest.mark.parametrize(("depth", "bound"), [(0.1, 0.0017), (1.0, 0.0008), (3.0, 0.0028), (10.0, 0.01)])
def test_what_the_sun_loses_is_scattered_and_never_less_than_nothing(depth, bound):
    """Cells of a depth between clear ones, the sun aslant. What is beyond the bound is lost to what is clear."""
    size, sun = 200.0, np.array([0.5, 0.3, 0.66**0.5])
    ext = np.pad(depth / size * np.random.default_rng(5).uniform(0.8, 1.2, (6, 8, 8)), 2)
    places, toward = np.indices(ext.shape), np.reshape(sun[::-1] / size, (3, 1, 1, 1))
    steps = [map_coordinates(ext, places + s * toward, order=1, prefilter=False) for s in np.arange(5.0, 6000.0, 10.0)]
    beam = np.exp(-10.0 * np.sum(steps, axis=0))
    lit = beam_taken.lit(beam, ext, tuple(toward[:, None, 0]), beam_taken.SOFT / size)
    lost = 0.0
    for axis, speed in enumerate(sun[::-1]):
        lower, upper = (_mean_squares(np.sqrt(beam.take(n, axis))).sum() for n in (0, -1))
        lost += speed * size**2 * (upper - lower)
    assert (ext * lit).sum() * size**3 == pytest.approx(lost, rel=bound)
    assert (ext * lit).min() > -1e-5 * (ext * lit).max()


def test_light_is_positive_in_thick_cells_that_the_sun_lights_from_a_side():
    ext = np.zeros((20, 7, 7))
    ext[2:18] = 30.0 / 500.0
    levels = np.concatenate([[0.0, 400.0], 800.0 + 60.0 * np.arange(18)])
    across = 500.0 * np.arange(7)
    scene = Scene.from_arrays(ext, across, across, levels, phase=HenyeyGreenstein(0.85), atmosphere=None)
    core = Solver("linear").linear_core(scene, [0.4, -0.5, 0.77], [550.0], points=[(1500.0, 1500.0)])
    images, state = core.forward(core.extinction, core.albedo)
    one = state.terms[0].swept
    assert min(one.seen[0].min(), one.flux.min(), images.ghi.min()) > 0
    assert max(state.sweeps) < core.most_sweeps


def _mean_squares(corners):
    """Over cells of what is bilinear between values at their corners."""
    a, b, c, d = corners[:-1, :-1], corners[1:, :-1], corners[:-1, 1:], corners[1:, 1:]
    return (a * a + b * b + c * c + d * d + (a + d) * (b + c) + 0.5 * (a * d + b * c)) / 9


def test_sweeps_are_transposed(linearised):
    core, state, rng = linearised[0], linearised[4], np.random.default_rng(5)
    one, sweeps, world = state.terms[0], core._sweeps, core.world
    moments = rng.standard_normal((25, world.nodes))
    bars = [rng.standard_normal((25, world.nodes)) for _ in range(2)]
    of_ground, of_flux = rng.standard_normal((2, world.columns))
    found = sweeps.changed(one.filled, one.swept, moments)
    back, _ = sweeps.transposed(one.filled, one.swept, *bars, of_ground, of_flux)
    pairs = [(found.moments, bars[0]), (found.seen, bars[1]), (found.ground, of_ground), (found.flux, of_flux)]
    assert _apart(pairs, [(moments, back)]) < EXACT
    change = Change(
        1e-3 * rng.standard_normal(world.nodes), 1e-3 * rng.standard_normal((5, world.nodes)),
        rng.standard_normal(world.nodes), *rng.standard_normal((2, world.columns)),
    )  # fmt: skip
    found = sweeps.tangent(one.filled, one.swept, change)
    _, by = sweeps.transposed(one.filled, one.swept, *bars, of_ground, of_flux, gradient=True)
    pairs = [(found.moments, bars[0]), (found.seen, bars[1]), (found.ground, of_ground), (found.flux, of_flux)]
    assert _apart(pairs, list(zip(change, by, strict=True))) < EXACT


def test_the_whole_is_transposed_and_linear(linearised):
    core, extinction, albedo, _, state = linearised
    rng = np.random.default_rng(6)
    change = 3e-3 * rng.standard_normal(extinction.shape)
    of_ground = 0.1 * rng.standard_normal(albedo.shape)
    found = core.tangent(state, change, of_ground)
    residual = found.like(rng.standard_normal(found.flat().size))
    bar, ground_bar = core.adjoint(state, residual)
    pair = [(found.flat(), residual.flat())]
    assert _apart(pair, [(change, bar), (of_ground, ground_bar)]) < EXACT
    assert not core.tangent(state, 0 * change, 0 * of_ground).flat().any()
    twice = core.tangent(state, 2 * change, 2 * of_ground).flat()
    assert np.abs(twice - 2 * found.flat()).max() < 1e-12 * np.abs(twice).max()
    sweeps = [np.mean(n) for n in (state.sweeps, state.adjoint_sweeps)]
    assert sweeps[1] <= 1.3 * sweeps[0]


def test_the_gradient_is_that_of_differences(linearised):
    """Of a misfit, at nodes of both kinds, clear ones among them, and of the ground; the steps' error is h^4."""
    core, extinction, albedo, images, state = linearised
    rng = np.random.default_rng(7)
    wanted = images.flat() * (1 + 0.2 * rng.standard_normal(images.flat().size))

    def cost(of, ground):
        return 0.5 * float(((core.forward(of, ground, start=state)[0].flat() - wanted) ** 2).sum())

    bar, ground_bar = core.adjoint(state, images.like(images.flat() - wanted))
    clear = np.flatnonzero((extinction == 0).ravel())
    some = np.concatenate([rng.choice(clear, 6), rng.choice(extinction.size, 6)])
    scale = [np.abs(bar[:, kind]).max() for kind in (0, 1)]
    for n in some:
        kind = np.unravel_index(n, extinction.shape)[1]
        h = 1e-3 * max(extinction.ravel()[n], 5e-3)
        costs = []
        for step in (h, -h, 2 * h, -2 * h):
            moved = extinction.copy()
            moved.ravel()[n] += step
            costs.append(cost(moved, albedo))
        found = (8 * (costs[0] - costs[1]) - (costs[2] - costs[3])) / (12 * h)
        assert abs(found - bar.ravel()[n]) < 1e-11 * scale[kind]  # what rounding of the costs makes
    costs = [cost(extinction, albedo + step) for step in (1e-3, -1e-3, 2e-3, -2e-3)]
    found = (8 * (costs[0] - costs[1]) - (costs[2] - costs[3])) / 0.012
    assert found == pytest.approx(ground_bar.sum(), rel=1e-11)


def test_what_is_left_of_a_first_order_expansion_falls_tenfold(linearised):
    core, extinction, albedo, images, state = linearised
    change = 0.05 * np.random.default_rng(8).standard_normal(extinction.shape) * np.maximum(extinction, 1e-3)
    slope = core.tangent(state, change).flat()
    left = []
    for h in (1.0, 0.1, 0.01, 0.001):
        moved = core.forward(extinction + h * change, albedo, start=state)[0].flat()
        left.append(np.linalg.norm(moved - images.flat() - h * slope) / (h * np.linalg.norm(slope)))
    falls = [a / b for a, b in itertools.pairwise(left)]
    assert all(9 < fall < 11 for fall in falls), falls


def test_results_do_not_depend_on_threads():
    core, extinction, albedo = lumpy(omega=(1.0,), tolerance=1e-4)
    threads, found = numba.get_num_threads(), []
    try:
        for count in (1, 2) if threads > 1 else (1, 1):
            numba.set_num_threads(count)
            images, state = core.forward(extinction, albedo)
            change = core.tangent(state, 0.1 * extinction)
            bar, ground_bar = core.adjoint(state, images)
            found.append(np.concatenate([images.flat(), change.flat(), bar.ravel(), ground_bar.ravel()]))
    finally:
        numba.set_num_threads(threads)
    assert (found[0] == found[1]).all()


def test_steps_that_are_not_kept_give_the_same_bits(linearised, monkeypatch):
    core, extinction, albedo, images, state = linearised
    monkeypatch.setattr(diffuse, "KEEP_BYTES", 0)
    again, other = core.forward(extinction, albedo)
    assert state.terms[0].filled.steps is not None
    assert other.terms[0].filled.steps is None
    assert (again.flat() == images.flat()).all()
    for one, two in zip(core.adjoint(other, images), core.adjoint(state, images), strict=True):
        assert (one == two).all()


@pytest.mark.parametrize("threads", [1, 3])
def test_moments_are_made_by_blocks_of_nodes(threads):
    rng = np.random.default_rng(8)
    shares, moments = rng.standard_normal((7, 25)), rng.standard_normal((25, 9001))
    light, back = np.empty((7, 9001)), np.ones((25, 9001))
    for t in range(threads):
        emit(t, threads, shares, moments, light)
    np.testing.assert_allclose(light, np.einsum("nk,kp->np", shares, moments), atol=1e-13)
    for t in range(threads):
        gather(t, threads, shares.T.copy(), light, back)
    np.testing.assert_allclose(back, 1 + np.einsum("nk,np->kp", shares, light), atol=1e-12)


def test_a_state_does_not_change_with_the_array_it_was_made_from():
    core, extinction, albedo = lumpy(omega=(1.0,), tolerance=1e-3)
    images, state = core.forward(extinction, albedo)
    before = core.adjoint(state, images)[0]
    extinction *= 2
    albedo *= 0
    assert (core.adjoint(state, images)[0] == before).all()


def test_an_adjoint_solved_loosely_points_the_same_way(linearised):
    core, _, _, images, state = linearised
    exact, loose = (core.adjoint(state, images, tolerance)[0].ravel() for tolerance in (1e-12, 1e-3))
    cosine = exact @ loose / np.linalg.norm(exact) / np.linalg.norm(loose)
    assert np.degrees(np.arccos(min(cosine, 1.0))) < 8e-5


def test_thin_matter_scatters_as_its_phase_function_says():
    """L' = omega P(Theta) tau where light is scattered once: of both kinds, at all angles from the sun."""
    core, extinction, _ = lumpy(omega=(0.9,), tolerance=1e-3, sky=0.0, below=0.0)
    phase = [HenyeyGreenstein(0.85), HenyeyGreenstein(0.6)]
    for kind, omega in ((0, 0.9), (1, 0.81)):
        thin = np.zeros_like(extinction)
        thin[0, kind] = 1e-9
        images, _ = core.forward(thin)
        for view, seen in zip(core.views, images.radiance, strict=True):
            last = view.place[np.maximum(view.first[1:] - 1, 0), 3] - view.place[view.first[:-1], 3]
            expected = omega * phase[kind].value(view.cosine) * 1e-9 * last
            assert np.allclose(seen[0], expected, rtol=9e-6)  # of the table's angles


def test_fields_of_another_shape_are_refused(linearised):
    core, extinction, *_ = linearised
    with pytest.raises(UserError, match="extinction of"):
        core.forward(extinction[:1])
    with pytest.raises(UserError, match="albedo of"):
        core.forward(extinction, np.zeros(3))


def test_what_is_no_number_or_no_residual_is_refused(linearised):
    """Sweeps went on to their end for it, and gave NaN."""
    core, extinction, albedo, images, state = linearised
    broken = extinction.copy()
    broken[0, 0, 0, 0, 0] = np.nan
    short = Images([one[:, :-1] for one in images.radiance], images.ghi)
    for call, match in (
        (lambda: core.forward(broken, albedo), "extinction has values that are no numbers"),
        (lambda: core.tangent(state, broken), "extinction has values"),
        (lambda: core.tangent(state, extinction, np.inf), "albedo has values"),
        (lambda: core.adjoint(state, images.like(np.nan * images.flat())), "residual has values"),
        (lambda: core.adjoint(state, images.radiance), "residual is list: give Images"),
        (lambda: core.adjoint(state, short), "residual of radiance .* give Images of radiance"),
    ):
        with pytest.raises(UserError, match=match):
            call()


def test_in_single_precision_the_whole_is_transposed_and_all_but_the_same(linearised):
    """Rounding alone: 1e-5 of dot products is the mark, found are 2e-9, 6e-7 of what is seen, and 2e-7 of gradients."""
    exact, extinction, albedo, images, _ = linearised
    core, *_ = lumpy(element=np.float32, tolerance=1e-6)
    found, near = core.forward(extinction, albedo)
    assert near.terms[0].swept.moments.dtype == np.float32
    assert np.abs(found.flat() / images.flat() - 1).max() < 8e-7
    rng = np.random.default_rng(6)
    change, of_ground = 3e-3 * rng.standard_normal(extinction.shape), 0.1 * rng.standard_normal(albedo.shape)
    slope = core.tangent(near, change, of_ground)
    residual = slope.like(rng.standard_normal(slope.flat().size))
    bar, ground_bar = core.adjoint(near, residual)
    assert _apart([(slope.flat(), residual.flat())], [(change, bar), (of_ground, ground_bar)]) < 1e-8
    wanted, ground_wanted = exact.adjoint(linearised[4], residual)
    for one, two in ((bar, wanted), (ground_bar, ground_wanted)):
        assert np.linalg.norm(one - two) < 2.5e-7 * np.linalg.norm(two)


def test_what_is_begun_from_earlier_states_finds_the_same_sooner():
    """After two steps of a search: extinction and residual are nearly what those of before tell."""
    core, extinction, albedo = lumpy(tolerance=1e-4)
    rng = np.random.default_rng(9)
    images, state = core.forward(extinction, albedo)
    residual = rng.standard_normal(images.flat().size)
    core.adjoint(state, images.like(residual))
    step = 0.02 * extinction * rng.standard_normal(extinction.shape)
    _, state = core.forward(extinction + step, albedo, start=state)
    moved = extinction + 2.1 * step + 0.1 * np.roll(step, 1, axis=-1)
    residual = images.like(0.9 * residual + 0.02 * rng.standard_normal(residual.size))
    seen_alone, alone = core.forward(moved, albedo)
    seen, after = core.forward(moved, albedo, start=state)
    assert np.abs(seen.flat() / seen_alone.flat() - 1).max() < 1.2e-4  # 9.1e-5
    assert sum(after.sweeps) <= sum(alone.sweeps) - 3 * len(alone.sweeps)
    wanted, found = (core.adjoint(each, residual)[0] for each in (alone, after))
    assert np.linalg.norm(found - wanted) < 4.9e-6 * np.linalg.norm(wanted)  # 4.1e-6
    assert sum(after.adjoint_sweeps) <= sum(alone.adjoint_sweeps) - 2 * len(alone.adjoint_sweeps)


def test_a_state_that_is_asked_for_again_is_begun_from_itself():
    """Steps of no length tell nothing; two of them once made numbers that are none."""
    core, extinction, albedo = lumpy(tolerance=1e-4)
    images, state = core.forward(extinction, albedo)
    bar, _ = core.adjoint(state, images)
    for _ in range(3):
        again, state = core.forward(extinction, albedo, start=state)
        core.adjoint(state, images.like(0.0 * images.flat()))
    np.testing.assert_allclose(again.flat(), images.flat(), rtol=1e-4)
    np.testing.assert_allclose(core.adjoint(state, images)[0], bar, atol=1e-4 * np.abs(bar).max())


def test_what_is_no_number_leaves_nothing_behind(linearised):
    core, extinction, albedo, images, state = linearised
    with np.errstate(all="ignore"):
        found, far = core.forward(np.full_like(extinction, 1e300), albedo)  # which overflows on the way
        core.adjoint(far, images)
    assert not np.isfinite(found.flat()).all()
    again, other = core.forward(extinction, albedo)
    assert (again.flat() == images.flat()).all()
    assert (core.adjoint(other, images)[0] == core.adjoint(state, images)[0]).all()
