"""Damage that shows in one field: told where it is, and not in weather as models and large-eddy simulations have it."""

from __future__ import annotations

import numpy as np
import pytest
import xarray as xr
from scipy.ndimage import gaussian_filter

from openswim.scene.oddities.damage import damaged_fields, highest_values

LEVELS = ("z", "y", "x")


def _cloud() -> np.ndarray:
    """(6, 24, 24) of water: lumps of some six nodes that a wind which grows with height leans over."""
    lumps = gaussian_filter(np.random.default_rng(1).normal(size=(24, 24)), 2.0, mode="wrap")
    return np.array([3e-3 * np.maximum(np.roll(lumps, k, axis=1), 0) for k in range(6)], "f4")


def _told(content, ground=None) -> list[str]:
    fields = {"liquid_content": (LEVELS, content)}
    if ground is not None:
        fields["surface_altitude"] = (LEVELS[1:], ground.astype("f4"))
    return damaged_fields(xr.Dataset(fields), 3000.0)


@pytest.mark.parametrize("how", ["noise", "turned", "of another level"])
def test_a_level_unlike_those_around_it_is_told(how):
    spoilt = _cloud()
    random = np.random.default_rng(2)
    spoilt[3] = {
        "noise": 3e-4 * random.random((24, 24)), "turned": spoilt[3, ::-1], "of another level": spoilt[3].T
    }[how]  # fmt: skip
    assert _told(_cloud()) == []
    assert [note for note in _told(spoilt) if note.startswith("liquid_content of level 4 is unlike")]


def test_two_decks_with_clear_air_between_are_weather():
    content = _cloud()
    content[2:4] = 0
    assert _told(content) == []


def test_many_nodes_at_the_highest_value_are_told():
    content = _cloud()
    assert highest_values("water", content) == []
    content[2, 5:8, :20] = content[2].max() * np.float32(1.02)
    assert highest_values("water", content)[0].startswith("water of level 3 holds its highest value")
    flat = np.where(content > 1e-4, np.float32(2e-4), np.float32(0))  # one value and none: a made-up cloud
    assert highest_values("water", flat) == []


def test_ground_of_noise_is_told_and_mountains_are_not():
    """Ridges of 2 km every 12 km, as steep as the Karakoram's, and an island of one node."""
    x = np.mgrid[:24, :24][1]
    ridges = 3000.0 + 1000.0 * np.cos(0.5 * np.pi * x)
    ridges[12, 12] = 6500.0
    assert _told(_cloud(), ridges) == []
    noise = ridges.copy()
    noise[6:9] = 5000 * np.random.default_rng(3).random((3, 24))
    assert any("surface_altitude jumps up and down" in note for note in _told(_cloud(), noise))
