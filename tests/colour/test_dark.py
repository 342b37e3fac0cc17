"""Dim light: lux and candelas, a camera's settings, and what a dark-adapted eye sees."""

import numpy as np
import pytest
import xarray as xr

from openswim.colour.dark_eye import mesopic
from openswim.colour.photometry import illuminance_lx, luminance_cd_m2
from openswim.colour.rgb import exposure_for, to_rgb
from openswim.errors import UserError


def flat(value, wavelengths=(615.0, 546.0, 450.0), **attrs):
    light = np.broadcast_to(np.asarray(value, np.float32), (2, 2, len(wavelengths)))
    coords = {"wavelength": np.array(wavelengths)}
    return xr.Dataset({"solar_relative_radiance": (("y", "x", "wavelength"), light)}, coords, attrs)


def test_a_white_wall_in_the_sun():
    """133 klx on it, so 133 000 / pi cd/m2; at 1.02 au a twenty-fifth less."""
    assert luminance_cd_m2(flat(4.0))[0, 0] == pytest.approx(133e3 / np.pi, rel=0.02)
    assert luminance_cd_m2(flat(4.0, sun_distance_au=1.02))[0, 0] == pytest.approx(133e3 / np.pi / 1.02**2, rel=0.02)
    assert illuminance_lx([1.0, 1.0, 1.0], [615.0, 546.0, 450.0]) == pytest.approx(133e3, rel=0.02)
    assert illuminance_lx([0.0, 0.0, 0.0], [615.0, 546.0, 450.0]) == 0.0


def test_sunny_sixteen():
    """f/16 and one over the speed: a wall in sunlight that has come through air is just below white."""
    wall = flat(4.0 * 0.75)  # of the light outside of the air
    assert 0.7 < 3.0 * exposure_for(wall, "1/100s f/16 ISO100") < 1.3
    assert exposure_for(wall, ".02 s, f16, iso 100") == pytest.approx(2 * exposure_for(wall, "1/100s f/16 ISO100"))
    assert exposure_for(wall, "1/50s f/16 ISO 100") == exposure_for(wall, "1/100s f/16 ISO 200")
    assert exposure_for(flat(3.0, sun_distance_au=1.02), "1s f/4 ISO50") == pytest.approx(
        exposure_for(wall, "1s f/4 ISO50") / 1.02**2
    )


@pytest.mark.parametrize("text", ["1s f/2.8 ISO0", "1/0s f/2.8 ISO100", "1..s f/2.8 ISO100", "1s f/0 ISO100", "1s f/4"])
def test_no_camera(text):
    with pytest.raises(UserError, match="ISO1600"):
        to_rgb(flat(1.0), text)


def test_colours_fade_and_blue_stays():
    """By day nothing changes. Under stars red and blue of one luminance differ in brightness, not in colour."""
    white, red, blue = (np.array(c, np.float32) for c in ((0.95, 1.0, 1.09), (1.6, 1.0, 0.1), (0.9, 1.0, 3.0)))
    assert mesopic(100 * red) == pytest.approx(100 * red)
    dim_red, dim_blue, dim_white = (mesopic(np.float32(1e-4) * each) for each in (red, blue, white))
    assert dim_red / dim_red[1] == pytest.approx(dim_blue / dim_blue[1], abs=1e-3)
    assert dim_blue[1] > 2 * dim_red[1]
    # of white light the rods see about as much: scotopic over photopic is 2.3 for daylight, and 1 W is 1699 lm to them
    assert dim_white[1] == pytest.approx(1e-4 * 2.3 * 683 / 1699, rel=0.15)
    picture = to_rgb(flat([4e-9, 1e-9, 1e-9]), 5e7, eye=True, dither=False)[0, 0].astype(int)
    assert picture[2] > picture[0]
    assert np.ptp(to_rgb(flat([4e-9, 1e-9, 1e-9]), 5e7, dither=False)[0, 0].astype(int)) > 80
