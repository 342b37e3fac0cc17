"""What is drawn over a picture of the sky."""

import re
from itertools import combinations

import pytest

from openswim import Camera
from openswim.comparison.report.marks import overlay


@pytest.mark.parametrize("camera", [Camera.allsky(47, 8, size=320), Camera.panorama(47, 8, size=640)])
def test_names_of_close_bodies_cover_each_other_nowhere(camera):
    """The evening of a thin moon near the sun and planets, and two planets a degree apart."""
    places = {"sun": (200.0, 30.0), "moon": (202.0, 31.0), "Venus": (203.0, 31.0), "Mercury": (198.0, 29.0),
              "Mars": (90.0, 60.0), "Jupiter": (91.0, 60.5)}  # fmt: skip
    drawn = overlay(camera, places).split('class="bodies"')[1]
    names = re.findall(r'<text x="(.*?)" y="(.*?)" font-size="(.*?)">(.*?)</text>', drawn)
    assert {name for *_, name in names} == set(places)
    boxes = [(float(x), float(y), 0.3 * len(name) * float(size), 0.5 * float(size)) for x, y, size, name in names]
    for (x, y, wide, high), (u, v, wide_2, high_2) in combinations(boxes, 2):
        assert abs(x - u) > wide + wide_2 - 0.2 or abs(y - v) > high + high_2 - 0.2
