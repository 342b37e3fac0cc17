"""The source toward an eye, against its definition node by node."""

import numpy as np
from scipy.special import eval_legendre
from tests.transport.scenes import toward

from openswim.scene.procedural import demo_scene
from openswim.transport import Solver
from openswim.transport.moments import moment_row
from openswim.transport.ordinates import harmonic_matrix
from openswim.transport.pack import PACK
from openswim.transport.volume import DEGREE


def test_source_is_what_the_moments_and_the_beam_scatter_toward_the_eye() -> None:
    """sum_l sigma_l (sum_m Y_lm(v) M_lm + (2l+1) P_l T), where moments are kept and where the coarser grid's are."""
    sun = toward(200.0, 40.0)
    field = Solver(tolerance=0.5).solve(demo_scene(70, 45, 20), sun, [615.0, 450.0])._first
    light, medium = field.light, field.medium
    nz, ny, nx = medium.shape
    eye = np.array([300.0, -200.0, 2500.0])
    light.aim(field.volume, eye, False)
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
            moments = np.empty((DEGREE**2, nx), np.float32)
            scratch = np.empty((DEGREE**2, coarser.columns), np.float32)
            moment_row(*light.moments[w], coarser, k, j, scratch, moments)
            cloud = c.scattering.T @ medium.extinction[:, k, j]
            total = cloud + c.air_scattering[k][:, None]
            diffuse = np.einsum("li,il,li->i", total[orders], harmonic_matrix(local, DEGREE), moments)
            once = sum(
                (2 * n + 1) * cloud[n] * eval_legendre(n, view @ field.sun) * light.beams[w][k, j]
                for n in range(DEGREE)
            )
            np.testing.assert_allclose(
                field.volume.fields[k, j, :, PACK + w], diffuse + once, rtol=2e-4, atol=1e-9
            )
