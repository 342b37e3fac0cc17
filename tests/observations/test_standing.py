"""Trees before the sky of made-up clear days."""

from pathlib import Path

import numpy as np
import pytest

from openswim import Camera
from openswim.observations import SkyFrame
from openswim.observations.standing import Standing

CAMERA = Camera.fisheye(47.0, 8.0, size=240, lens="equidistant")
PIXELS = CAMERA.pixels()
AZIMUTH, ALTITUDE = np.nan_to_num(PIXELS.azimuth_deg), np.nan_to_num(PIXELS.altitude_deg, nan=-90.0)


def frame(sun_azimuth: float, dark: np.ndarray, seed: int) -> SkyFrame:
    """A sky four times as bright around the sun as opposite, leaves of a twentieth, noise, sRGB's curve roughly."""
    away = PIXELS.angle_to_deg(sun_azimuth, 40.0)
    light = 0.1 + 0.3 * np.exp(-np.nan_to_num(away) / 40.0)
    leaves = 0.005 * np.random.default_rng(seed).uniform(0.3, 3.0, light.shape)
    counts = 255 * np.where(dark, leaves, light) ** (1 / 2.2)
    counts = np.where(PIXELS.inside, counts, 0.0)[..., None].repeat(3, axis=-1).astype(np.uint8)
    return SkyFrame(Path("day.png"), counts, np.datetime64("2024-06-01T12:00"), "name", 255.0, 250.0)


def found(dark: np.ndarray) -> np.ndarray | None:
    day = Standing()
    for n, azimuth in enumerate((100.0, 130.0, 160.0, 190.0)):
        day.add(frame(azimuth, dark, n))
    return day.hidden(CAMERA)


@pytest.mark.parametrize("height", [12.0, 35.0])
def test_trees_on_the_horizon_are_found_to_their_edges(height: float) -> None:
    trees = (height > ALTITUDE) & (AZIMUTH > 200) & (AZIMUTH < 300)
    hidden = found(trees)
    assert hidden is not None
    above = PIXELS.inside & (ALTITUDE > 0)
    assert hidden[trees & above].mean() > 0.98
    near = (height + 2.5 > ALTITUDE) & (AZIMUTH > 185) & (AZIMUTH < 315)
    assert not hidden[above & ~near].any()


def test_a_free_horizon_and_dark_spots_in_the_sky_are_no_trees() -> None:
    for dark in (np.zeros(ALTITUDE.shape, bool), PIXELS.angle_to_deg(250.0, 50.0) < 6.0):
        assert found(dark) is None


def test_a_picture_that_is_nearly_all_dark_is_no_clear_day() -> None:
    wood = (ALTITUDE < 60.0) & (AZIMUTH > 20.0)
    assert found(wood) is None
