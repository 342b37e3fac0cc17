"""Some species of a scene alone."""

import numpy as np
import pytest

from openswim.errors import UserError
from openswim.scene import Scene, only
from openswim.scene.atmosphere import Atmosphere

SHAPE = (3, 4, 5)


def scene() -> Scene:
    axes = (100.0 * np.arange(n) for n in (5, 4, 3))
    some = np.full(SHAPE, 1e-5, np.float32)
    return Scene.from_arrays(
        {"fog": some, "soot": some}, *axes, kind={"fog": "other", "soot": "aerosol"},
        atmosphere=Atmosphere.us_standard(),
        fields={"liquid_content": some, "liquid_number": 1e13 * some, "ice_content": some, "aerosol_extinction": some},
    )


@pytest.mark.parametrize(
    ("names", "kept", "background"),
    [
        (("clouds",), {"liquid", "ice", "fog"}, False),
        (("aerosol",), {"aerosol", "soot"}, True),
        (("liquid",), {"liquid"}, False),
        (("ice", "aerosol"), {"ice", "aerosol", "soot"}, True),
        (("soot",), {"soot"}, False),
    ],
)
def test_what_is_named_is_kept(names: tuple[str, ...], kept: set[str], background: bool) -> None:
    given = scene()
    found = only(given, *names)
    assert set(found.species) == kept
    assert bool(found.atmosphere.layers) == background
    assert ("liquid_number" in found.data) == ("liquid" in kept)
    assert set(found.optics) == kept & {"fog", "soot"}
    assert set(given.species) == {"liquid", "ice", "aerosol", "fog", "soot"}  # which stays as it was
    assert found.notes[-1].startswith("only ")


def test_what_is_not_there_is_refused() -> None:
    with pytest.raises(UserError, match="the scene has liquid, ice, aerosol, fog, soot, clouds"):
        only(scene(), "snow")
    with pytest.raises(UserError, match="has aerosol"):
        only(Scene.clear(47.0, 11.0), "clouds")
    assert only(Scene.clear(47.0, 11.0), "aerosol").atmosphere.layers
