"""Peaks of light on a frame."""

import numpy as np
import pytest
from scipy import ndimage

from openswim.observations import peaks
from openswim.observations.peaks import find_peaks


@pytest.mark.parametrize("shape", [(40, 61), (5, 7), (1, 30)])
def test_medians_are_those_of_scipy(shape: tuple[int, int]) -> None:
    blocks = np.random.default_rng(3).gamma(2.0, size=shape).astype(np.float32)
    expected = ndimage.median_filter(blocks, peaks._MEDIAN_BLOCKS, mode="nearest")
    np.testing.assert_array_equal(peaks._medians(blocks), expected)


def test_points_on_an_uneven_sky_are_found_and_nothing_else() -> None:
    """Forty points on a sky that brightens twentyfold to one side."""
    rng = np.random.default_rng(5)
    rows, columns = np.mgrid[:480, :640]
    sky = 10.0 + 200.0 * (columns / 640) ** 2
    place = np.stack(np.meshgrid(np.arange(40, 480, 90), np.arange(40, 640, 80)), axis=-1).reshape(-1, 2)
    place = place + rng.uniform(-8, 8, place.shape)
    frame = sky + rng.normal(0.0, 1.0, sky.shape)
    for row, column in place:
        frame += 30.0 * np.exp(-((rows - row) ** 2 + (columns - column) ** 2) / (2 * 1.2**2))
    found = find_peaks(frame.astype(np.float32)).place
    assert len(found) == len(place)
    apart = np.linalg.norm(found[:, None] - place[None, :], axis=-1)
    assert apart.min(axis=1).max() < 0.125  # pixels; measured .096
