"""The sun's flux in pictures: radiance times solid angle sums to the beam, wherever the sun and whatever the pixels."""

from __future__ import annotations

import numpy as np
import pytest

from openswim import Camera
from openswim.heavens.sun_disc import Disc, beam_of, drawn
from openswim.lights import disc_points, disc_profile

WAVELENGTHS = np.array([450.0, 615.0])
RADIUS_DEG = 0.2666
HERE = {"lat": 47.0, "lon": 11.0}


def open_sky(direction: np.ndarray, width: float) -> tuple[np.ndarray, np.ndarray]:
    return np.full((len(direction), 2), 0.5), np.zeros(len(direction), bool)


def over_horizon(direction: np.ndarray, width: float) -> tuple[np.ndarray, np.ndarray]:
    return np.ones((len(direction), 2)), direction[:, 2] < 0


def above(height: float) -> np.ndarray:
    """Share of the disc's light above a height (in radii), by fine chords."""
    y, x = np.meshgrid(np.linspace(-1, 1, 1601), np.linspace(-1, 1, 1601), indexing="ij")
    light = disc_profile(np.hypot(x, y), WAVELENGTHS)
    return light[y > height].sum(axis=0) / light.sum(axis=(0, 1))


def flux(camera: Camera, sun: tuple[float, float], through=open_sky) -> np.ndarray:
    pixels = camera.pixels()
    row, column, radiance = drawn(camera, pixels, Disc(*sun, RADIUS_DEG, WAVELENGTHS), through)
    return (radiance * pixels.solid_angle_sr[row, column, None]).sum(axis=0) / (4 * np.pi)


@pytest.mark.parametrize("columns", [8, 360, 1440])
@pytest.mark.parametrize(
    "sun", [(130.0, 72.0), (130.0, 85.03), (10.0, 90.0), (77.0, 89.8), (0.05, 20.0), (200.0, -89.9)]
)
def test_a_sphere_holds_the_beam(columns: int, sun: tuple[float, float]) -> None:
    """Near the poles of the picture, at them, and across its seam."""
    np.testing.assert_allclose(flux(Camera.sphere(**HERE, size=columns), sun), 0.5, rtol=1e-9)


@pytest.mark.parametrize("fov_deg", [170.0, 60.0, 5.0, 0.9])
def test_a_perspective_holds_the_beam(fov_deg: float) -> None:
    camera = Camera.perspective(**HERE, azimuth_deg=130.0, altitude_deg=40.0, fov_deg=fov_deg, size=(200, 300))
    aside = 0.45 * min(fov_deg, 100.0) - 0.3 if fov_deg > 1 else 0.0
    np.testing.assert_allclose(flux(camera, (130.0 + aside, 40.0)), 0.5, rtol=2e-3)


@pytest.mark.parametrize("columns", [36, 2000])
@pytest.mark.parametrize("height", [-0.9, -0.3, 0.0, 0.62])
def test_of_a_sun_at_the_pictures_edge_it_holds_what_lies_within(columns: int, height: float) -> None:
    camera = Camera.panorama(**HERE, size=columns, altitude_range_deg=(10.0, 40.0))
    found = flux(camera, (130.3, 10.0 - height * RADIUS_DEG))
    np.testing.assert_allclose(found, 0.5 * above(height), atol=0.5 * 0.005)


@pytest.mark.parametrize("columns", [36, 2000])
@pytest.mark.parametrize("height", [-0.9, -0.3, 0.0, 0.62])
def test_of_a_rising_sun_there_is_what_has_risen(columns: int, height: float) -> None:
    """The same in the picture and in the beam on the observer."""
    sun = 130.3, -height * RADIUS_DEG
    share = above(height)
    np.testing.assert_allclose(flux(Camera.panorama(**HERE, size=columns), sun, over_horizon), share, atol=0.005)
    beam = beam_of(Disc(*sun, RADIUS_DEG, WAVELENGTHS), over_horizon)
    np.testing.assert_allclose(beam.direct, share, atol=0.005)
    assert beam.visible == pytest.approx(share.mean(), abs=0.005)
    assert 0 < beam.altitude_deg < 2 * RADIUS_DEG


def test_it_rises_steadily() -> None:
    altitude = np.linspace(-0.3, 0.3, 61)
    beams = [beam_of(Disc(130.0, a, RADIUS_DEG, WAVELENGTHS), over_horizon) for a in altitude]
    direct = np.array([beam.direct for beam in beams])
    assert direct[0].max() == 0
    np.testing.assert_allclose(direct[-1], 1.0)
    step = np.diff(direct, axis=0)
    assert step.min() >= 0
    assert step.max() < 1.3 * 0.01 * 0.67 / RADIUS_DEG * 1.2  # the widest chord holds .74 of a disc's light per radius
    assert [beam.open.min() for beam in beams] == [1.0] * 61  # a hidden sun's beam is that of the sky above


def test_places_on_the_disc_stand_for_its_light() -> None:
    place, share = disc_points(4096, WAVELENGTHS)
    np.testing.assert_allclose(share.sum(axis=0), 1.0)
    radius = np.hypot(*place.T)
    assert radius.max() <= 1
    inner = share[radius < 0.5].sum(axis=0)
    ring = (np.arange(4000) + 0.5) / 8000
    expected = (2 * ring[:, None] * disc_profile(ring, WAVELENGTHS)).sum(axis=0) / 8000
    np.testing.assert_allclose(inner, expected, rtol=4e-3)


def test_small_pixels_see_the_disc_itself() -> None:
    camera = Camera.perspective(**HERE, azimuth_deg=130.0, altitude_deg=40.0, fov_deg=0.6, size=250)
    pixels = camera.pixels()
    row, column, radiance = drawn(camera, pixels, Disc(130.0, 40.0, RADIUS_DEG, WAVELENGTHS), open_sky)
    away = pixels.angle_to_deg(130.0, 40.0)[row, column] / RADIUS_DEG
    expected = 2 / np.radians(RADIUS_DEG) ** 2 * disc_profile(away, WAVELENGTHS)
    np.testing.assert_allclose(radiance[away < 0.95], expected[away < 0.95], rtol=2e-3)


@pytest.mark.parametrize("fov_deg", [0.1, 0.05, 0.01, 0.001])
@pytest.mark.parametrize("size", [(1, 1), (2, 3), (40, 60)])
@pytest.mark.parametrize("aside", [0.0, 0.7])
def test_within_the_disc_a_narrow_view_is_full_of_sun(fov_deg: float, size: tuple[int, int], aside: float) -> None:
    camera = Camera.perspective(
        **HERE, azimuth_deg=130.0, altitude_deg=40.0 + aside * RADIUS_DEG, fov_deg=fov_deg, size=size
    )
    row, _, radiance = drawn(camera, camera.pixels(), Disc(130.0, 40.0, RADIUS_DEG, WAVELENGTHS), open_sky)
    assert len(row) == size[0] * size[1]
    expected = 2 / np.radians(RADIUS_DEG) ** 2 * disc_profile(aside, WAVELENGTHS)
    np.testing.assert_allclose(radiance.mean(axis=0), expected, rtol=0.07)
    np.testing.assert_allclose(radiance, radiance.mean(axis=0) + 0 * radiance, rtol=0.4)
