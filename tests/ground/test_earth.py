"""The default Earth's maps: read once, by whoever is first."""

import threading
import time
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

from openswim.errors import UserError
from openswim.ground import earth


def test_maps_are_read_once_though_several_threads_ask() -> None:
    read = []

    @earth._once
    def slow() -> int:
        read.append(threading.current_thread())
        time.sleep(0.05)
        return len(read)

    with ThreadPoolExecutor(4) as pool:
        assert list(pool.map(lambda _: slow(), range(4))) == [1, 1, 1, 1]


def test_what_cannot_be_read_ahead_is_told_to_who_asks(monkeypatch: pytest.MonkeyPatch) -> None:
    def lost() -> None:
        raise UserError("gone")

    monkeypatch.setattr(earth, "_image", earth._once(lost))
    earth.preload()
    for _ in range(2):
        with pytest.raises(UserError, match="gone"):
            earth._image()


@pytest.mark.parametrize("level", [1, 3, 6])
def test_means_of_the_land_are_those_of_its_pixels(level: int) -> None:
    """Whole cells of 2^level pixels each way; not all land, nor all water."""
    size, rng = 2**level, np.random.default_rng(level)
    row, column = rng.integers(0, (2700 // size, 5400 // size), (40, 2)).T
    pixels = np.stack([row, column], -1)[:, None, None] * size + np.moveaxis(np.indices((size, size)), 0, -1)
    lat, lon = 90 - (pixels[..., 0] + 0.5) / 15, (pixels[..., 1] + 0.5) / 15 - 180
    land = 1.0 - earth.water_at_nearest(lat, lon)[..., None]
    colour = earth.linear_light(earth._image()[pixels[..., 0], pixels[..., 1]])
    wanted = np.concatenate([colour * land, land], axis=-1).mean(axis=(1, 2))
    earth.mean_land(lat.ravel(), lon.ravel(), np.full(lat.size, size * earth.PIXEL_M))
    found = earth._means()[level - 1][row, column]
    assert 0.1 < land.mean() < 0.9
    assert np.array(found) == pytest.approx(wanted, abs=1e-6)


def test_land_far_and_wide_is_continuous_across_strips() -> None:
    """Along a meridian of Africa, where strips of the averaged image meet."""
    lat = np.linspace(24.0, 10.0, 2001)
    for width_m, bound in ((15_000.0, 0.011), (60_000.0, 0.0048), (240_000.0, 0.0014)):
        albedo = earth.land_albedo(lat, np.full(lat.size, 10.0), [550.0], np.full(lat.size, width_m))[:, 0]
        assert np.abs(np.diff(albedo)).max() < bound * albedo.mean()
