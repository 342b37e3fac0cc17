"""Damage that shows in one field: told where it is, and not in weather as models and large-eddy simulations have it."""

from __future__ import annotations

import numpy as np
import pytest
import xarray as xr
from scipy.ndimage import gaussian_filter

from openswim.scene.oddities.damage import copied_levels, damaged_fields, held_values
from openswim.scene.oddities.ground import loose_ground
from openswim.scene.oddities.roughness import rough_levels

LEVELS = ("z", "y", "x")


def _cloud() -> np.ndarray:
    """(6, 24, 24) of water: lumps of some six nodes that a wind which grows with height leans over."""
    lumps = gaussian_filter(np.random.default_rng(1).normal(size=(24, 24)), 2.0, mode="wrap")
    return np.array([3e-3 * np.maximum(np.roll(lumps, k, axis=1), 0) for k in range(6)], "f4")


def _told(content, ground=None) -> list[str]:
    fields = {"liquid_content": (LEVELS, content)}
    if ground is not None:
        fields["surface_altitude"] = (LEVELS[1:], ground.astype("f4"))
    return damaged_fields(xr.Dataset(fields), 3000.0, np.arange(6.0))


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
    assert held_values("water", content) == []
    content[2, 5:8, :20] = content[2].max() * np.float32(1.02)
    assert held_values("water", content)[0].startswith("water of level 3 holds its highest value")
    flat = np.where(content > 1e-4, np.float32(2e-4), np.float32(0))  # one value and none: a made-up cloud
    assert held_values("water", flat) == []


def test_many_nodes_at_the_lowest_value_are_told():
    """Where there is something everywhere: bytes that are zero stand for the lowest value of a packed field."""
    deck = 1e-4 * _smooth().astype("f4")
    assert held_values("liquid_content", deck) == []
    deck[2, 5:8, :20] = deck[2].min() * np.float32(0.99)
    assert held_values("liquid_content", deck)[0].startswith("liquid_content of level 3 holds its lowest value")
    assert held_values("surface pressure", deck[2:3])[0].startswith("surface pressure holds its lowest value")
    assert held_values("liquid_number", deck) == []  # of which models keep a least one
    coarse = 1e-5 * np.round(1e5 * deck)  # some 20 values, each of which many nodes share
    assert held_values("liquid_content", coarse.astype("f4")) == []


def _smooth() -> np.ndarray:
    """(8, 24, 32): a field without cloud or clear air, that grows with height."""
    y, x = np.mgrid[:24, :32]
    return np.array([2 + 0.1 * k + np.sin(0.1 * x + 0.2 * k) * np.cos(0.13 * y) for k in range(8)])


@pytest.mark.parametrize("nodes", [1, 60], ids=["one value", "a block of noise"])
@pytest.mark.parametrize("levels", [[3], [7], [4, 5]])
def test_values_that_stand_out_of_a_smooth_level_are_told(nodes, levels):
    spoilt, random = _smooth(), np.random.default_rng(4)
    assert rough_levels("it", spoilt) == []
    for k in levels:
        spoilt[k].flat[400 : 400 + nodes] = spoilt[k].max() - 0.3 * random.random(nodes)
    (note,) = rough_levels("it", spoilt)
    assert note.startswith(f"it of level{'s' * (len(levels) > 1)} {', '.join(str(k + 1) for k in levels)} has values")


def test_roughness_that_levels_share_is_weather():
    """Also the steps of 16 bits over all levels, where most of the range is that of others."""
    random = np.random.default_rng(5)
    assert rough_levels("it", _smooth() + 0.1 * random.random((8, 24, 32))) == []
    falling = _smooth() * np.exp(-1.2 * np.arange(8.0))[:, None, None]
    step = falling.max() / 65535
    assert rough_levels("it", np.round(falling / step) * step, roots=True) == []


def test_a_level_that_comes_twice_is_told():
    field = _smooth().astype("f4")
    assert copied_levels("it", field) == []
    field[6] = field[3]
    assert copied_levels("it", field) == ["it of levels 4 and 7 is the same to the last bit: copied?"]
    assert copied_levels("it", np.repeat(field[:1], 8, axis=0)) == []  # made so
    field[[3, 6]] = 2.0
    assert copied_levels("it", field) == []


def test_a_level_that_is_lost_is_told():
    deck = np.tile(1e-4 + _cloud()[:1], (6, 1, 1))
    deck[2] = 0
    assert [note for note in _told(deck) if note.startswith("liquid_content holds nothing on level 3,")]
    deck[3] = 0
    assert _told(deck) == []
    rain = xr.Dataset({"rain_content": (LEVELS, np.concatenate([np.zeros((1, 24, 24), "f4"), deck[:2]]))})
    (note,) = damaged_fields(rain, 3000.0, np.arange(3.0))
    assert note.startswith("rain_content holds nothing on level 1,")


def test_ground_of_noise_is_told_and_mountains_are_not():
    """Ridges of 2 km every 12 km, as steep as the Karakoram's, and an island of one node."""
    x = np.mgrid[:24, :24][1]
    ridges = 3000.0 + 1000.0 * np.cos(0.5 * np.pi * x)
    ridges[12, 12] = 6500.0
    assert _told(_cloud(), ridges) == []
    noise = ridges.copy()
    noise[6:9] = 5000 * np.random.default_rng(3).random((3, 24))
    assert any("surface_altitude jumps up and down" in note for note in _told(_cloud(), noise))


def test_ground_that_leaves_the_levels_is_told():
    """Levels that follow the ground at 20 m, and at a few metres less over mountains."""
    y, x = np.mgrid[:24, :24]
    ridges = 800 + 700 * np.sin(0.3 * x) * np.cos(0.2 * y)
    lowest = 1.0 + ridges + 20 * (1 - 1e-4 * ridges)
    assert loose_ground(ridges, lowest) == []
    spoilt = ridges.copy()
    spoilt[3, 4:9] = 100.0
    (note,) = loose_ground(spoilt, lowest)
    assert "at 5 nodes" in note
    plain = np.where((x == 5) & (y > 20), 900.0, 10 + 0.1 * y)  # a mountain in a level that follows nothing
    assert loose_ground(plain, np.full((24, 24), 110.0)) == []
