"""Level plates and columns in a thin veil without air: what single scattering says, by both solvers."""

import numpy as np
import pytest
from scipy.ndimage import uniform_filter

from openswim import Camera, Solver, light
from openswim.optics import scene_optics
from openswim.optics.displays.shapes import with_shapes
from openswim.scene import Scene
from openswim.transport.ice import level

SUN_DEG = 20.0


def veil() -> Scene:
    x, z = np.linspace(0, 8e3, 9), np.array([0.0, 4e3, 5e3, 6e3, 7e3])
    ice = np.zeros((5, 9, 9))
    ice[2] = 3e-7
    scene = Scene.from_arrays(None, x, x, z, fields={"ice_content": ice}, periodic=True)
    return with_shapes(scene, pristine=0.2, plates=0.3, columns=0.2)


@pytest.fixture(scope="module")
def plates_and_columns() -> np.ndarray:
    return 0.6 * level.phase_map(546.0, SUN_DEG) + 0.4 * level.phase_map(546.0, SUN_DEG, shape="column")


@pytest.mark.parametrize("solver", ["fast", Solver("reference", paths=20_000)])
def test_brightness_of_a_sundog(solver, plates_and_columns) -> None:
    """Of `reference` the standard error of the mean of all rays is 1 %."""
    scene, ratio = veil(), []
    aside = np.array([24.5, 24.9, 25.3])  # degrees
    azimuth, altitude = (each.ravel() for each in np.meshgrid(aside, SUN_DEG + aside - aside[1]))
    lit = light(scene, solver, [546.0], sun=(180.0, SUN_DEG))
    seen = lit.viewpoint(Camera.allsky(x_m=4e3, y_m=4e3, size=2)).look(180.0 + azimuth, altitude)[:, 0]
    ice, afloat = scene_optics(scene, [546.0])
    sun, diffracted = np.radians(SUN_DEG), afloat.phase[0]
    for here, up, turn in zip(seen, np.radians(altitude), np.radians(azimuth), strict=True):
        cosine = np.sin(up) * np.sin(sun) + np.cos(up) * np.cos(sun) * np.cos(turn)
        row = (np.degrees(up) / 180 + 0.5) * level.ALTITUDES - 0.5
        column = abs(np.degrees(turn)) / 180 * level.AZIMUTHS - 0.5
        i, j, f, g = int(row), int(column), row % 1, column % 1
        table = plates_and_columns[i : i + 2, j : j + 2]
        aligned = np.array([1 - f, f]) @ table @ np.array([1 - g, g])
        forward = zip(diffracted.weights[::2], diffracted.phases[::2], strict=True)
        peak = sum(weight * phase.value(cosine) for weight, phase in forward)
        # a layer of hat-like profile 1 km high, whose depth is that of its middle node; half of what it takes out
        # of the beam and of the way to the eye stays within a fraction of a degree
        depth = [1e3 * float(one.extinction_per_m[2, 0, 0]) for one in (ice, afloat)]
        once = (depth[0] * ice.phase[0].value(cosine) + depth[1] * (aligned + peak)) / np.sin(up)
        ratio.append(here / (once * np.exp(-0.5 * sum(depth) / np.sin(up))))
    each, mean = (0.011, 0.0095) if solver == "fast" else (0.1, 0.03)
    assert np.mean(ratio) == pytest.approx(1.0, abs=mean)
    np.testing.assert_allclose(ratio, 1.0, atol=each)


def test_the_train_of_a_subparhelion_has_few_speckles() -> None:
    """Below a sun of 22 degrees, outward of 26: bins of .2 degrees against means over a degree; with twenty times the
    rays 6 % are left, which are the crystals'."""
    train = level.phase_map(546.0, 22.0)[300:375, 130:175]
    assert train.mean() == pytest.approx(8.2, rel=0.01)
    assert (train - uniform_filter(train, 5)).std() < 0.13 * train.mean()
