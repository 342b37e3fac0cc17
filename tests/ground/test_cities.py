"""Light of towns: where they are, the watts of the user's map, and what air and cloud make of it."""

import numpy as np
import pytest

from openswim.errors import UserError
from openswim.ground.cities import BAND_NM, city_radiance, lamp_spectrum, sodium_tint
from openswim.ground.maps import maps_of
from openswim.ground.streets import lamps_seen
from openswim.lights.units import magnitude_of_luminance
from openswim.scene.ground import Ground
from openswim.solver import Solver
from openswim.validation.night.sky_glow import zenith_luminance


def test_lamps_have_the_watts_that_are_measured():
    """1 nW cm-2 sr-1 is 1e-5 W m-2 sr-1, all of it between 500 and 900 nm."""
    wavelengths = np.arange(BAND_NM[0], BAND_NM[1], 2.0)
    assert lamp_spectrum(wavelengths).sum() * 2.0 == pytest.approx(1e-5, rel=1e-6)


def test_towns_are_where_they_are():
    """Berlin, Vienna and Denver are bright, the Atlantic and the Sahara dark."""
    assert (city_radiance([52.52, 48.21, 39.74], [13.40, 16.37, -104.99]) > 10).all()
    assert (city_radiance([40.0, 25.0, -80.0], [-40.0, 10.0, 0.0]) < 0.1).all()
    assert city_radiance(10.0, 179.999) == pytest.approx(city_radiance(10.0, -179.999), abs=1e-3)


def test_the_users_map_goes_before(tmp_path):
    from PIL import Image, TiffImagePlugin

    tags = TiffImagePlugin.ImageFileDirectory_v2()
    tags[33550] = (0.01, 0.01, 0.0)
    tags[33922] = (0.0, 0.0, 0.0, 10.0, 0.0, 0.0)
    tags.tagtype[33550] = tags.tagtype[33922] = 12
    tags[34735] = (1, 1, 0, 3, 1024, 0, 1, 2, 1025, 0, 1, 1, 2048, 0, 1, 4326)
    tags.tagtype[34735] = 3
    values = np.full((50, 50), 7.0, np.float32)
    Image.fromarray(values).save(tmp_path / "viirs.tif", tiffinfo=tags)
    ground = Ground(lights=tmp_path / "viirs.tif")
    found = city_radiance([-0.25, 20.0], [10.25, 10.25], ground)
    assert found == pytest.approx([7.0, float(city_radiance(20.0, 10.25))], abs=1e-5)


@pytest.mark.slow
def test_clouds_over_a_city():
    """Inside a city of some millions the zenith is at 18 to 19.3 when clear, and 6 to 15 times brighter below cloud."""
    solver = Solver(quality="preview")
    clear, overcast = (zenith_luminance(solver, 52.52, 13.4, cloud, nodes=7) for cloud in ("clear", "overcast"))
    assert 18.0 < magnitude_of_luminance(clear) < 19.3
    assert 6 < overcast / clear < 15


@pytest.mark.parametrize("radiance_nw", [0.1, 3.0, 50.0])
@pytest.mark.parametrize("footprint_m", [1.0, 40.0])
def test_lamps_have_the_light_of_the_map_in_the_mean(footprint_m, radiance_nw):
    """Over places in a quarter each, of Europe."""
    rng = np.random.default_rng(5)
    lat, lon = 40.0 + 10 * rng.random(200_000), 1.0 + 10 * rng.random(200_000)
    seen, sodium = lamps_seen(lat, lon, footprint_m, radiance_nw)
    error = seen.std() / np.sqrt(seen.size)
    assert error < 0.05
    assert seen.mean() == pytest.approx(1.0, abs=0.01 + 3 * error)
    assert sodium.mean() == pytest.approx(0.5, abs=0.002)
    assert seen.min() >= 0
    assert sodium.min() > 0
    assert sodium.max() < 1


def test_lamps_stand_on_dark_land_and_merge_in_wide_pixels():
    rng = np.random.default_rng(6)
    lat, lon = 48.0 + rng.random(20_000), 2.0 + rng.random(20_000)
    village, city = (lamps_seen(lat, lon, 1.0, nw)[0] for nw in (0.1, 50.0))
    assert (village < 0.01).mean() > 0.9
    assert (city < 0.01).mean() > 0.3
    assert city.max() > 15
    spread = [lamps_seen(lat, lon, width, 50.0)[0].std() for width in (1.0, 30.0, 100.0, 300.0)]
    assert (np.diff(spread) < 0).all()
    np.testing.assert_allclose(lamps_seen(lat, lon, 2000.0, 0.1)[0], 1.0, atol=1e-6)


def test_nothing_of_a_town_is_cut():
    """Along lines through a city light has no steps, but where two roads with different lamps meet."""
    north = 48.0 + np.linspace(0.0, 0.05, 55_001)  # 10 cm apart
    for lon in (2.1, 2.2, 2.3):
        seen, _ = lamps_seen(north, lon, 1.0, 50.0)
        steps = np.abs(np.diff(seen))
        assert (steps > 0.05 * seen.max()).sum() < 10  # in 5.5 km


def test_lamps_are_between_sodium_and_diodes():
    tint = sodium_tint([450.0, 546.0, 590.0, 615.0])
    assert tint[0] < tint[1] < 0 < tint[3] < tint[2] < 1


def test_a_users_map_is_asked_at_places_of_any_shape(tmp_path):
    """Inside it and beside it."""
    from PIL import Image, TiffImagePlugin

    tags = TiffImagePlugin.ImageFileDirectory_v2()
    tags[33550], tags[33922] = (0.1, 0.1, 0.0), (0.0, 0.0, 0.0, 10.0, 48.0, 0.0)
    tags[34735] = (1, 1, 0, 3, 1024, 0, 1, 2, 1025, 0, 1, 1, 2048, 0, 1, 4326)
    Image.fromarray(np.full((20, 20), 7.0, np.float32)).save(tmp_path / "lights.tif", tiffinfo=tags)
    ground = Ground(lights=tmp_path / "lights.tif")
    north, east = np.meshgrid([-0.2, 0.0, 0.2], [-0.3, 0.0, 30.0])
    found = city_radiance(47.0 + north, 11.0 + east, ground)
    assert found.shape == (3, 3)
    np.testing.assert_allclose(found[:2], 7.0, rtol=1e-3)


def test_a_map_of_lights_that_is_none_is_told_by_day_too():
    """All maps are opened when a scene is, though lamps are seen by night alone."""
    with pytest.raises(UserError, match=r"none\.tif: no such file"):
        maps_of(Ground(lights="none.tif"))
