"""Sky view of terrain against closed forms and the light that terrain must take in all."""

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter

from openswim.ground.sky_view import Terrain


def sky_view(terrain: np.ndarray, periodic: bool = False) -> np.ndarray:
    light, dark = np.ones(terrain.shape, np.float32), np.array([0.0, 0.0, 0.0])
    return Terrain(terrain.astype(np.float32), (100.0, 100.0), periodic).seen(light, dark)[0]


def test_level_ground_sees_all_of_it() -> None:
    assert Terrain(np.full((5, 6), 300.0, np.float32), (100.0, 100.0), False).level
    assert Terrain(np.zeros((1, 1), np.float32), (100.0, 100.0), False).level
    np.testing.assert_allclose(sky_view(np.full((5, 6), 300.0)), 1.0, atol=1e-6)


@pytest.mark.parametrize("toward", [0.0, 40.0, 90.0, 225.0])
@pytest.mark.parametrize("slope_deg", [10.0, 30.0, 50.0])
def test_an_endless_slope(slope_deg: float, toward: float) -> None:
    """(1 + cos)/2, in the middle of one that is long."""
    y, x = np.mgrid[-60:61, -60:61] * 100.0
    up = np.tan(np.radians(slope_deg))
    terrain = up * (x * np.cos(np.radians(toward)) + y * np.sin(np.radians(toward)))
    found = sky_view(terrain)
    assert found[60, 60] == pytest.approx((1 + np.cos(np.radians(slope_deg))) / 2, abs=0.01)


@pytest.mark.parametrize("wall_deg", [20.0, 45.0, 60.0])
def test_the_bottom_of_a_pit(wall_deg: float) -> None:
    """Level, with a horizon of one height all around: the squared cosine of it."""
    y, x = np.mgrid[-60:61, -60:61] * 100.0
    found = sky_view(np.tan(np.radians(wall_deg)) * np.hypot(x, y))
    assert found[60, 60] == pytest.approx(np.cos(np.radians(wall_deg)) ** 2, abs=0.01)


@pytest.mark.parametrize("seed", range(3))
def test_hills_take_what_comes_down(seed: int) -> None:
    """Per area of the map black hills in a period take as much as a plain, however the light is shared."""
    noise = gaussian_filter(np.random.default_rng(seed).standard_normal((64, 64)), 4.0, mode="wrap")
    terrain = 400.0 * noise / noise.std()
    slope_y, slope_x = (np.gradient(np.pad(terrain, 1, mode="wrap"), 100.0, axis=n)[1:-1, 1:-1] for n in (0, 1))
    found = sky_view(terrain, periodic=True)
    assert found.min() < 0.6
    area = np.sqrt(1 + slope_x**2 + slope_y**2)
    assert (found * area)[2:-2, 2:-2].mean() == pytest.approx(1.0, abs=0.04)


@pytest.mark.parametrize("slope_deg", [20.0, 40.0])
def test_a_slope_lights_the_plain_at_its_foot(slope_deg: float) -> None:
    """Of a long slope that rises from a plain, lit by a sun that stands square to it, the foot gets (1 - cos)/2."""
    x = np.broadcast_to(np.arange(-60.0, 61.0) * 100.0, (121, 121))
    rise = np.radians(slope_deg)
    sun = np.array([-np.sin(rise), 0.0, np.cos(rise)])
    sunlit = np.broadcast_to(np.where(x > 50.0, 1.0, 0.0), (121, 121)).astype(np.float32)
    terrain = Terrain((np.tan(rise) * np.maximum(x, 0.0)).astype(np.float32), (100.0, 100.0), False)
    view, around = terrain.seen(sunlit, sun)
    assert around[60, 58] == pytest.approx((1 - np.cos(rise)) / 2, rel=0.15)
    assert view[60, 58] == pytest.approx((1 + np.cos(rise)) / 2, abs=0.01)
    behind = np.array([np.cos(rise / 2), 0.0, np.sin(rise / 2)])
    assert np.abs(terrain.seen(sunlit, behind)[1][60, 58]) < 0.1 * around[60, 58]
