"""The source toward an eye, against its definition node by node."""

import numpy as np
import pytest
from tests.transport.scenes import toward

from openswim.scene.procedural import demo_scene
from openswim.solver import Solver
from openswim.transport.engine.ordinates import harmonic_matrix
from openswim.transport.engine.pack import PACK
from openswim.transport.march.volume import DEGREE
from openswim.transport.view.source_function import thickest_around
from openswim.transport.view.toward_eye import aimed


def moments_of_row(kept, coarser, k: int, j: int, nx: int) -> np.ndarray:
    """Moments (M*M, nx) of the kept blocks, elsewhere linearly interpolated between those of the coarser grid."""

    def dense(place, values, row: int) -> np.ndarray:
        blocks = np.where(place[k, row][:, None, None] >= 0, values[place[k, row]], np.nan)
        return blocks.transpose(1, 0, 2).reshape(values.shape[1], -1)

    def places(count: int, most: int) -> np.ndarray:
        return np.clip((np.arange(count) - 0.5 * (coarser.factor - 1)) / coarser.factor, 0, most - 1)

    rows, y = coarser.place.shape[1], places(j + 1, coarser.place.shape[1])[j]
    near, far = (dense(coarser.place, coarser.values, min(int(y) + n, rows - 1)) for n in (0, 1))
    row = (near + (y - int(y)) * (far - near))[:, : coarser.columns]
    x = places(nx, coarser.columns)
    below = np.array([np.interp(x, np.arange(coarser.columns), r) for r in row])
    own = dense(*kept, j)[:, :nx]
    return np.where(np.isnan(own), below, own)


def thickest(extinction: np.ndarray, k: int, j: int, periodic: bool) -> np.ndarray:
    """Extinction (ns, nx) of the nodes of a row, or, at those without cloud, of the thickest around them."""
    around = np.pad(extinction, [(0, 0), (1, 1), (0, 0), (0, 0)])
    around = np.pad(around, [(0, 0), (0, 0), (1, 1), (1, 1)], mode="wrap" if periodic else "constant")
    near = np.stack([
        around[:, k + c, j + b, a : a + extinction.shape[3]] for c in range(3) for b in range(3) for a in range(3)
    ], axis=1)  # fmt: skip
    most = near.sum(axis=0).argmax(axis=0)
    own = extinction[:, k, j]
    return np.where(own.sum(axis=0) > 0, own, np.take_along_axis(near, most[None, None], 1)[:, 0])


@pytest.mark.parametrize("periodic", [False, True])
def test_nodes_without_cloud_are_stood_for_by_the_thickest_around(periodic: bool) -> None:
    rng = np.random.default_rng(3)
    extinction = rng.uniform(1, 2, (2, 5, 7, 9)).astype(np.float32)
    extinction[:, rng.uniform(size=(5, 7, 9)) < 0.9] = 0
    found = thickest_around(extinction, periodic)
    taken = extinction.reshape(2, -1)[:, found]
    for k, j in np.ndindex(5, 7):
        np.testing.assert_array_equal(taken[:, k, j], thickest(extinction, k, j, periodic))
    alone = extinction.sum(axis=0) > 0
    np.testing.assert_array_equal(found[alone], np.flatnonzero(alone))


@pytest.mark.parametrize(("size", "factor"), [((70, 45, 20), 2), ((40, 25, 20), 4)])
def test_source_is_what_the_moments_scatter_toward_the_eye(size, factor: int) -> None:
    """sum_l sigma_l sum_m Y_lm(v) M_lm per extinction, where moments are kept and where the coarser grid's are."""
    sun = toward(200.0, 40.0)
    field = Solver(tolerance=0.5).solve(demo_scene(*size), sun, [615.0, 450.0]).lit[0]
    light, medium = field.light, field.medium
    nz, ny, nx = medium.shape
    eye = np.array([300.0, -200.0, 2500.0])
    fields = aimed(field, eye, False).fields
    kept = np.repeat(light.moments[0].place >= 0, light.moments[0].values.shape[2], axis=2)[..., :nx]
    assert 0.02 < kept.mean() < 0.98
    orders = np.repeat(np.arange(DEGREE), 2 * np.arange(DEGREE) + 1)
    for k, j in ((2, 0), (nz // 3, ny // 2), (nz // 2, ny - 1), (nz - 2, 7)):
        axes = medium.axes[j].astype(float)
        view = medium.place[j] + medium.levels_m[k] * axes[:, 2] - eye
        view /= np.linalg.norm(view, axis=1, keepdims=True)
        local = np.einsum("iab,ib->ia", axes, view)
        for w in range(2):
            coarser, c = light.coarser[w], light.coefficients[w]
            assert coarser.factor == factor
            moments = moments_of_row(light.moments[w], coarser, k, j, nx)
            cloud = thickest(medium.extinction, k, j, False)
            total = c.scattering.T @ cloud + c.air_scattering[k][:, None]
            diffuse = np.einsum("li,il,li->i", total[orders], harmonic_matrix(local, DEGREE), moments)
            diffuse /= c.scaled @ cloud + c.air_extinction[k]
            np.testing.assert_allclose(fields[k, j, :, PACK + w], diffuse, rtol=2e-4, atol=1e-9)
