"""A rainbow in thin rain without air: where it stands, and how bright, in both solvers."""

import numpy as np
import pytest

from openswim import Camera, Solver, light
from openswim.optics import scene_optics
from openswim.scene import Scene

SUN_DEG = 15.0


def shower() -> Scene:
    x, z = np.linspace(0, 8e3, 9), np.array([0.0, 1e3, 2e3, 3e3, 4e3])
    rain = np.zeros((5, 9, 9))
    rain[2] = 5e-6
    return Scene.from_arrays(None, x, x, z, fields={"rain_content": rain}, periodic=True)


def brightness(radius_deg: np.ndarray, wavelength_nm: float, solver: Solver | str = "fast") -> np.ndarray:
    """L' straight above the point opposite the sun, at angles from it."""
    lit = light(shower(), solver, [wavelength_nm], sun=(180.0, SUN_DEG))
    return lit.viewpoint(Camera.allsky(x_m=4e3, y_m=4e3, size=2)).look(0.0, radius_deg - SUN_DEG)[:, 0]


def test_the_rainbow_that_an_eye_sees() -> None:
    radius = np.arange(32.0, 58.0, 0.1)
    places = []
    for wavelength in (615.0, 450.0):
        # a layer is the thicker, the lower it is looked at
        seen = brightness(radius, wavelength) * np.sin(np.radians(radius - SUN_DEG))
        primary, secondary = (np.where((radius > a) & (radius < b), seen, 0) for a, b in ((38, 45), (48, 58)))
        places.append([radius[np.argmax(primary)], radius[np.argmax(secondary)]])
        inside, band = (np.median(seen[(radius > a) & (radius < b)]) for a, b in ((32, 36), (44, 48.5)))
        assert inside > 5 * band
    # Mie theory of drops of 500 um with the disc of the sun
    np.testing.assert_allclose(places, [[41.84, 51.3], [40.90, 53.06]], atol=0.3)


def test_the_reference_sees_the_same() -> None:
    radius = np.array([41.6, 38.0])
    ours, theirs = (brightness(radius, 546.0, solver) for solver in ("fast", Solver("reference", paths=30_000)))
    np.testing.assert_allclose(ours, theirs, rtol=0.06)
    phase, depth = scene_optics(shower(), [546.0])[0], 1e3
    depth *= float(phase.extinction_per_m[2, 0, 0])
    once = depth * phase.phase[0].value(-np.cos(np.radians(radius))) / np.sin(np.radians(radius - SUN_DEG))
    assert ours[0] / ours[1] == pytest.approx(once[0] / once[1], rel=0.03)
