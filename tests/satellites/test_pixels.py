"""Pixels seen from L1, as EPIC sees them: where they lie, and bands that have their own times."""

from __future__ import annotations

import numpy as np
import pytest

from openswim.comparison.response import fit_curve
from openswim.errors import UserError
from openswim.satellites import FixedGrid, Pixels, band, reflectance, reflectance_by_band
from openswim.scene import Scene
from openswim.scene.atmosphere import Atmosphere

L1_M = 1.5e9
TIMES = {"443": "2021-06-21T17:00:00", "551": "2021-06-21T17:01:30", "680": "2021-06-21T17:05:00"}


def test_from_above_the_equator_pixels_are_those_of_a_fixed_grid() -> None:
    grid = FixedGrid(0.002 * np.arange(-60, 61, 12), 0.002 * np.arange(60, -61, -12), -75.0)
    lat, lon = grid.latlon()
    pixels = Pixels(lat, lon, 0.0, -75.0, grid.height_m + grid.semi_major_m)
    there = np.isfinite(lat)
    (zenith, azimuth), (known, turned) = pixels.view(lat, lon), grid.view(lat, lon)
    np.testing.assert_allclose(zenith[there], known[there], atol=1e-6)
    around = (azimuth - turned)[there & (known > 0.1)]
    np.testing.assert_allclose((around + 180) % 360, 180, atol=1e-6)


def test_a_disc_from_l1_has_rays_through_its_pixels() -> None:
    """Of an ideal lens: tangents of angles to the middle, east and north, are even in columns and rows."""
    pixels = Pixels.disc(20.0, -80.0, L1_M, 0.5, 64)
    lat, lon = pixels.latlon()
    there = np.isfinite(lat)
    assert there.mean() == pytest.approx(np.pi * (6.371e6 / (L1_M * np.tan(np.radians(0.25)) * 2)) ** 2, rel=0.02)
    geod = pyproj_ecef(lat[there], lon[there])
    la, lo = np.radians(20.0), np.radians(-80.0)
    up = np.array([np.cos(la) * np.cos(lo), np.cos(la) * np.sin(lo), np.sin(la)])
    east = np.array([-np.sin(lo), np.cos(lo), 0.0])
    far = (L1_M - geod @ up)[:, None]
    right, north = (geod @ np.stack([east, np.cross(up, east)], axis=1) / far).T
    step = 2 * np.tan(np.radians(0.25)) / 64
    row, column = np.nonzero(there)
    np.testing.assert_allclose(right / step, column - 31.5, atol=1e-5)
    np.testing.assert_allclose(north / step, 31.5 - row, atol=1e-5)


def pyproj_ecef(lat: np.ndarray, lon: np.ndarray) -> np.ndarray:
    from pyproj import Transformer

    place = Transformer.from_crs("EPSG:4979", "EPSG:4978", always_xy=True).transform(lon, lat, np.zeros(lat.shape))
    return np.stack(place, axis=-1)


def test_bands_of_epic_have_light_of_their_own_times_and_stretched_pictures_are_undone() -> None:
    pixels = Pixels.disc(20.0, -75.0, L1_M, 0.5, 40)
    bare = Scene.clear(20.0, -75.0, None, 0.6)
    epic = reflectance_by_band(bare, pixels, [band("dscovr epic", name) for name in TIMES], list(TIMES.values()))
    assert [str(time)[11:19] for time in epic.band_time.values] == [time[11:] for time in TIMES.values()]
    high = (epic.satellite_zenith < 80).values
    expected = 0.6 * np.cos(np.radians(epic.sun_zenith))
    for found, own in zip(epic.reflectance_factor.values, expected.values, strict=True):
        np.testing.assert_allclose(found[high], own[high], atol=1.3e-5)
    apart = np.abs(epic.sun_zenith[2] - epic.sun_zenith[0]).values[high].max()
    assert apart == pytest.approx(1.25 * np.cos(np.radians(23.44)), rel=0.005)  # degrees in five minutes
    red = epic.reflectance_factor.values[2][high]
    web = np.round(255 * (1.4 * red) ** (1 / 2.2)) / 255  # stretched, as a picture of eight bits
    curve = fit_curve(web[::2], red[::2], np.ones(red[::2].size))
    assert curve is not None
    left = (curve(web) - red)[1::2]
    assert np.abs(web - red).max() > 0.3
    assert np.sqrt((left**2).mean()) < 0.0019


def test_air_is_seen_from_l1_as_from_geostationary_height() -> None:
    """Straight down, where distance does not matter."""
    air = Scene.clear(0.0, -75.0, Atmosphere.us_standard(), 0.1, time=np.datetime64("2021-06-21T17:00"))
    lat, lon = np.meshgrid([0.02, 0.0, -0.02], [-75.02, -75.0, -74.98], indexing="ij")
    found = [
        reflectance(air, Pixels(lat, lon, 0.0, -75.0, far), [band("dscovr epic", "443")]).reflectance_factor[0]
        for far in (4.2164e7, L1_M)
    ]
    np.testing.assert_allclose(found[1], found[0], rtol=1e-3)


def test_a_satellite_within_the_earth_is_refused() -> None:
    with pytest.raises(UserError, match="6\\.6e6 to 2e9"):
        Pixels(np.zeros((2, 2)), np.zeros((2, 2)), 0.0, 0.0, 1.5e6)
