"""Depths to the sun at all wavelengths from few: each wavelength has its own, whatever the others are."""

from __future__ import annotations

import numpy as np
import pytest
from tests.transport.scenes import grid_scene, sun_at_zenith_angle

from openswim import Solver
from openswim.optics.species import scene_optics
from openswim.scene import Optics, Scene
from openswim.scene.phase import HenyeyGreenstein
from openswim.transport.beam.depth_basis import TOLERANCE, factors_of, mixtures

SHAPE, CELL_M = (7, 5, 5), (500.0, 500.0, 200.0)
LAYERS = np.array([0, 0, 1, 1, 0, 0, 0], np.float32)[:, None, None] * np.ones(SHAPE, np.float32)


@pytest.mark.parametrize("species", [0, 1, 2, 3, 7])
def test_all_columns_are_sums_of_few(species: int) -> None:
    """As many as there are species, if these are fewer, and one where columns are in proportion."""
    rng = np.random.default_rng(species)
    extinction = rng.uniform(0.1, 1.0, (species, 5)).astype(np.float32)
    for columns, most in ((extinction, min(species, 5)), (extinction[:, :1] * rng.uniform(1, 1.02, 5), 1)):
        columns = columns.astype(np.float32)
        chosen = mixtures(columns)
        assert chosen[0] == 0
        assert len(chosen) == max(most, 1)
        np.testing.assert_allclose(columns[:, chosen] @ factors_of(columns, chosen), columns, rtol=TOLERANCE)


def test_where_there_is_room_for_few_they_are_the_nearest() -> None:
    """Of two species one is the redder by 2 %: one column in proportion is within 1 % of either."""
    extinction = np.array([[1.0, 1.01, 1.02], [0.5, 0.5, 0.5]], np.float32)
    chosen = mixtures(extinction, 1)
    assert len(chosen) == 1
    np.testing.assert_allclose(extinction[:, chosen] @ factors_of(extinction, chosen), extinction, rtol=0.0105)


def depths(scene: Scene, wavelengths_nm: list[float]) -> np.ndarray:
    """Of the domain, straight up, from how much of the beam of a sun overhead reaches the ground unscattered."""
    return -np.log(Solver().solve(scene, sun_at_zenith_angle(0.0), wavelengths_nm).fluxes()["direct_bottom"])


@pytest.mark.parametrize("gray", [False, True])
@pytest.mark.parametrize("more_percent", [1.5, 2.5])
def test_a_cloud_a_little_redder_or_bluer_has_its_own_depths(more_percent: float, gray: bool) -> None:
    """1.5 % more extinction at 546 than at 615 nm were one depth for both, 2.5 were two; also beside a gray species."""
    exponent = float(np.log(1 + more_percent / 100) / np.log(615 / 546))
    fields = {"cloud": 5e-3 * LAYERS} | ({"dust": 2e-3 * np.roll(LAYERS, 1, axis=0)} if gray else {})
    scene = grid_scene(fields, SHAPE, CELL_M)
    optics = scene.optics["cloud"]
    scene.optics["cloud"] = Optics(1.0, HenyeyGreenstein(0.8), optics.kind, exponent)
    wavelengths = [615.0, 546.0, 450.0]
    expected = 5e-3 * 400 * (np.array(wavelengths) / 550) ** -exponent + (2e-3 * 400 if gray else 0.0)
    np.testing.assert_allclose(depths(scene, wavelengths), expected, rtol=1e-4)


def test_depths_follow_the_droplets_as_these_shrink() -> None:
    """Mie extinction at 450 over that at 615 nm falls from .996 to .980, in small steps: nothing jumps."""
    ratios, expected = [], []
    for radius_um in np.geomspace(30.0, 3.0, 7):
        fields = {
            "liquid_content": 2e-5 * LAYERS, "liquid_effective_radius": radius_um * 1e-6 * np.ones(SHAPE),
            "ice_content": 2e-6 * LAYERS, "ice_effective_radius": 30e-6 * np.ones(SHAPE),
        }  # fmt: skip
        scene = grid_scene({}, SHAPE, CELL_M, fields=fields)
        own = sum(float(s.extinction_per_m.sum()) * s.relative_extinction for s in scene_optics(scene, [615.0, 450.0]))
        found = depths(scene, [615.0, 450.0])
        ratios.append(found[1] / found[0])
        expected.append(own[1] / own[0])
    # what ice scatters forward depends a little on colour: of three kinds of light two sums may do, within 1e-4
    np.testing.assert_allclose(ratios, expected, rtol=4.8e-5)
    assert max(expected) - min(expected) > 0.01
