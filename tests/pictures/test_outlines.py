"""Outlines: where they are, and that a pixel across one is the mean of both sides by their shares."""

from types import SimpleNamespace

import numpy as np
import pytest

from openswim.cameras import Rays
from openswim.pictures.outlines import outlines, outlines_of, softened
from openswim.scene.frame import Frame

FRAME = Frame(6_371_000.0, 40.0, 10.0)


def test_outlines_are_where_the_ground_leaps() -> None:
    distance = np.array([[-1.0, -1.0, -1.0], [900.0, 5000.0, -1.0], [890.0, 900.0, 4800.0], [100.0, 101.0, 102.0]])
    inside = np.ones((4, 3), bool)
    expected = np.array([[1, 1, 0], [1, 1, 1], [1, 1, 1], [1, 1, 1]], bool)
    bright = np.where(np.indices((4, 3)).sum(axis=0) % 2, 1.0, 1.1)
    np.testing.assert_array_equal(outlines(distance.ravel(), bright.ravel(), inside).reshape(4, 3), expected)
    assert not outlines(distance.ravel(), np.full(12, 1.0), inside).any()  # nobody sees them
    smooth = np.tile(np.geomspace(100.0, 300.0, 12), (5, 1))
    assert not outlines(smooth.ravel(), np.tile([1.0, 1.1], 30), np.ones((5, 12), bool)).any()


def test_pixels_outside_the_picture_have_no_outline() -> None:
    """In a round picture the corners are no pixels."""
    inside = np.array([[False, True, False], [True, True, True]])
    assert not outlines(np.full(4, 700.0), np.ones(4), inside).any()


@pytest.mark.parametrize("slope", [0.0, 0.3, -2.0])
def test_a_pixel_across_a_ridge_is_the_mean_of_both_sides(slope: float) -> None:
    """Sky of 1 over ground of 0 along a slanting line, pixels of 2 mrad: right to an eighth of a pixel."""
    width, n = 2e-3, 40
    x, z = np.meshgrid((np.arange(n) - 0.5 * n) * width, -(np.arange(n) - 0.5 * n) * width)

    def look(directions: np.ndarray) -> np.ndarray:
        return directions[:, 2] > slope * directions[:, 0] + 0.3e-3

    direction = np.stack([x, np.ones_like(x), z], axis=-1).reshape(-1, 3)
    rays = Rays(np.array([0.0, 0.0, 100.0]), direction / np.linalg.norm(direction, axis=-1, keepdims=True), width)
    sky = look(rays.directions())
    eye = SimpleNamespace(view=lambda r: SimpleNamespace(radiance=look(r.directions())[:, None].astype(np.float32)))
    distance_m = np.where(sky, -1.0, 500.0)
    edge = outlines(distance_m, 1.0 * sky, np.ones((n, n), bool))
    radiance = sky[:, None].astype(np.float32)
    radiance[edge] = softened(eye, rays[np.flatnonzero(edge)], FRAME)
    u, v = np.meshgrid(np.linspace(-0.5, 0.5, 41) * width, np.linspace(-0.5, 0.5, 41) * width)
    above = z.ravel() - slope * x.ravel() - 0.3e-3
    share = np.mean([above + dv - slope * du > 0 for du, dv in zip(u.ravel(), v.ravel(), strict=True)], axis=0)
    assert np.abs(radiance[edge, 0] - share[edge]).max() <= 0.25
    assert np.abs(radiance[edge, 0] - share[edge]).mean() < 0.07
    assert np.abs(sky[edge] - share[edge]).mean() > 0.1


def test_bright_and_dark_ground_are_mixed_but_not_clouds() -> None:
    """1 and 2 on either side of a column: ground, and an opaque cloud."""
    width, n = 2e-3, 20
    x, z = np.meshgrid((np.arange(n) - 0.5 * n) * width, -np.arange(1, n + 1) * width)
    direction = np.stack([x, np.ones_like(x), z], axis=-1).reshape(-1, 3)
    rays = Rays(np.array([0.0, 0.0, 100.0]), direction / np.linalg.norm(direction, axis=-1, keepdims=True), width)

    def look(directions: np.ndarray) -> np.ndarray:
        return np.where(directions[:, 0] > 0.3e-3, 2.0, 1.0)[:, None].astype(np.float32)

    eye = SimpleNamespace(view=lambda r: SimpleNamespace(radiance=look(r.directions())))
    for through, distance_m, expected in ((1.0, 500.0, {1.0, 1.25, 2.0}), (0.0, -1.0, {1.0, 2.0})):
        radiance = look(rays.directions())
        view = SimpleNamespace(
            distance_m=np.full(n * n, distance_m), transmittance=np.full((n * n, 1), through), radiance=radiance
        )
        edge = np.flatnonzero(outlines_of(view, np.ones((n, n), bool)))
        radiance[edge] = softened(eye, rays[edge], FRAME)
        assert set(np.unique(radiance)) == expected


def test_the_horizon_is_an_outline_before_opaque_cloud_too() -> None:
    """Three columns of sky over sea: open, behind a thin cloud, behind an opaque one. And cloud before the ground."""
    inside = np.ones((2, 4), bool)
    view = SimpleNamespace(
        distance_m=np.array([[-1.0, -1.0, -1.0, 800.0], [900.0, 900.0, 900.0, 900.0]]).ravel(),
        transmittance=np.array([[0.9, 0.1, 0.0, 1e-4], [1.0, 1.0, 1.0, 1.0]]).reshape(-1, 1),
        radiance=np.array([[2.0, 2.0, 2.0, 2.0], [0.5, 0.5, 0.5, 0.5]]).reshape(-1, 1),
    )
    found = outlines_of(view, inside).reshape(2, 4)
    np.testing.assert_array_equal(found, np.array([[1, 1, 1, 0], [1, 1, 1, 0]], bool))
