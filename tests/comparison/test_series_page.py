"""The page of a series and names that are no friend's."""

import numpy as np
import pytest
import xarray as xr

from openswim.comparison.report.series_page import _table


@pytest.mark.parametrize(
    ("name", "link"),
    [
        ("javascript:alert(1);.png", 'href="javascript%3Aalert%281%29%3B.html"'),
        ("a#b?100%.png", 'href="a%23b%3F100%25.html"'),
        ('"><script>.png', 'href="%22%3E%3Cscript%3E.html"'),
        ("a\u202e\nb\x1b.png", 'href="a%E2%80%AE%0Ab%1B.html">a\\u202e b\\x1b.png<'),
    ],
)
def test_links_lead_to_the_frames_own_page(name: str, link: str):
    dims = ("time", "light", "weighting", "sun_mask", "score_channel")
    coords = {"light": ["as stored", "response undone"], "weighting": ["solid angle"], "sun_mask": [12.0],
              "score_channel": ["mean"], "time": [np.datetime64("2024-06-21", "ns")],
              "frame": ("time", [name])}  # fmt: skip
    table = _table(xr.Dataset({"r": (dims, np.zeros((1, 2, 1, 1, 1)))}, coords, {"sun_mask_deg": 12.0}))
    assert link in table
    assert "<script>" not in table
