"""Bodies from words: volume and extent against geometry."""

import numpy as np
import pytest

from openswim.errors import UserError
from openswim.validation.geometry import cells_across, grid_body, parse_body

SPHERE = "sphere: centre (0,0,1) km radius 0.5 extinction 20/km"


def _volume(text: str) -> tuple[float, np.ndarray]:
    """Volume and centre of mass of the gridded extinction, which is linear between nodes."""
    body = parse_body(text)
    *axes, extinction = grid_body(body)
    width = [np.convolve(np.diff(a), [0.5, 0.5]) for a in axes]
    share = np.einsum("kji,i,j,k->kji", extinction / body.extinction, *width)
    total = share.sum()
    centre = np.array([share.sum(other) @ a for other, a in zip([(0, 1), (0, 2), (1, 2)], axes, strict=True)]) / total
    return float(total), centre


def test_a_sphere_has_its_volume_and_centre() -> None:
    volume, centre = _volume(SPHERE)
    assert volume == pytest.approx(4 / 3 * np.pi * 0.5**3, rel=2e-3)
    assert centre == pytest.approx([0, 0, 1], abs=1e-9)


@pytest.mark.parametrize(
    "text",
    [
        "box: centre (0.5,0,1) km size (1,2,0.5) km extinction 10/km",
        "box: centre (0.5, 0, 1) km half-size (0.5, 1, 0.25) extinction 10 /km",
        "box: corners (0,-1,0.75) (1,1,1.25) km extinction 10/km",
        "homogeneous box from (0,-1,.75) to (1,1,1.25) km, extinction = 10 per km",
    ],
)
def test_a_box_however_it_is_worded(text: str) -> None:
    volume, centre = _volume(text)
    assert parse_body(text).extinction == 10
    assert volume == pytest.approx(1.0, rel=1e-4)
    assert centre == pytest.approx([0.5, 0, 1], abs=1e-9)


def test_a_cube_by_its_edge() -> None:
    volume, _ = _volume("cube: centre (0,0,1) km edge 0.5 extinction 3e1/km")
    assert volume == pytest.approx(0.125, rel=1e-4)


def test_a_box_ends_on_its_faces_and_at_once() -> None:
    x, y, z, extinction = grid_body(parse_body("box: centre (0,0,1) km edge 1 km extinction 20/km"))
    assert (x[0], x[-1], y[0], y[-1]) == pytest.approx((-0.5, 0.5, -0.5, 0.5))
    assert (z[1], z[-2]) == pytest.approx((0.5, 1.5))
    assert z[1] - z[0] == pytest.approx(z[-1] - z[-2]) == pytest.approx(1e-5, rel=0.1)
    assert (extinction[1:-1] == 20).all()
    assert not extinction[[0, -1]].any()


@pytest.mark.parametrize(
    "text", ["torus: radius 1", "sphere: radius 1 extinction 2/km", "box: centre (0,0,1)"]
)
def test_what_is_not_understood_is_said(text: str) -> None:
    with pytest.raises(UserError, match=text[:6]):
        parse_body(text)


def test_thick_bodies_have_more_cells() -> None:
    counts = [cells_across(parse_body(SPHERE.replace("20/km", f"{k}/km"))) for k in (1, 20, 34, 60)]
    assert counts[:2] == [97, 97]
    assert counts == sorted(counts)
    assert counts[2] < counts[3] == 145
    assert all(n % 2 for n in counts)
