"""Land below its maps: invented patches that keep what the maps say."""

import numpy as np
import pytest

from openswim.ground.patches import patched

WAVELENGTHS = np.array([645.0, 555.0, 469.0])
FARMLAND, FOREST, SAND = (0.081, 0.093, 0.032), (0.028, 0.045, 0.020), (0.42, 0.31, 0.18)


def land(colour, known_m, footprint_m, lat, lon):
    albedo = np.broadcast_to(np.array(colour), (lat.size, 3))
    sizes = (np.full(lat.size, float(size)) for size in (known_m, footprint_m))
    return patched(albedo, lat, lon, WAVELENGTHS, *sizes)


def places(n, extent_deg=8.0):
    rng = np.random.default_rng(4)
    return 45 + rng.uniform(0, extent_deg, n), 5 + rng.uniform(0, extent_deg, n)


@pytest.mark.parametrize("colour", [FARMLAND, FOREST, SAND])
def test_the_mean_is_the_maps_at_any_distance(colour):
    lat, lon = places(100_000)
    for footprint in (0.0, 30.0, 1000.0, 6000.0):
        albedo = land(colour, 7400.0, footprint, lat, lon)
        np.testing.assert_allclose(albedo.mean(axis=0), colour, rtol=0.01)
        assert ((albedo > 0) & (albedo < 0.98)).all()


def test_green_land_is_woods_and_fields_and_sand_is_nearly_even():
    lat, lon = places(50_000)
    green, sand = (land(colour, 7400.0, 0.0, lat, lon) for colour in (FARMLAND, SAND))
    assert (sand.std(axis=0) / SAND).max() < 0.2 < (green.std(axis=0) / FARMLAND).min()
    dark, light = (green[some].mean(axis=0) for some in np.split(np.argsort(green.mean(axis=1)), [10_000]))
    assert dark[1] / dark[0] > 1.2 * light[1] / light[0]  # woods are greener, fields browner


def test_a_pixel_shows_the_mean_of_what_it_covers():
    """What is seen over 600 m is what finer pixels show there on average."""
    lat, lon = places(600)
    away = (np.stack(np.meshgrid(*2 * [np.linspace(-1, 1, 17)])) * 300.0 / 111e3).reshape(2, -1, 1)
    fine = land(FARMLAND, 7400.0, 0.0, (lat + away[0]).ravel(), (lon + away[1] / np.cos(np.radians(lat))).ravel())
    mean = fine.reshape(289, -1, 3).mean(axis=0)[:, 1]
    coarse = land(FARMLAND, 7400.0, 600.0, lat, lon)[:, 1]
    assert np.corrcoef(mean, coarse)[0, 1] > 0.85
    assert mean.std() == pytest.approx(coarse.std(), rel=0.25)


def test_grass_has_tufts_for_who_stands_on_it():
    """Places a hand apart differ to an eye that is near enough to tell them; not to one that sees metres as one."""
    lat, lon = places(5000)
    hand = lat + 0.1 / 111e3
    for footprint, least, most in ((0.01, 0.15, 0.4), (2.0, 0.0, 0.01)):
        one, other = (land(FARMLAND, 7400.0, footprint, at, lon)[:, 1] for at in (lat, hand))
        assert least < (np.log(other / one)).std() / np.sqrt(2) < most


def test_no_grass_grows_on_what_a_fine_map_shows_to_be_paved():
    """Asphalt, new and old, concrete and paint; grass and soil beside them are rough as ever, and so are grey towns."""
    lat, lon = places(4000)

    def roughness(colour, known_m):
        seen = land(colour, known_m, 0.01, lat, lon) / colour
        np.testing.assert_allclose(seen.mean(axis=0), 1.0, rtol=0.03)
        return seen[:, 1].std()

    paved = (0.06, 0.06, 0.06), (0.12, 0.11, 0.10), (0.30, 0.28, 0.24), (0.75, 0.75, 0.72)
    natural = FARMLAND, SAND, (0.07, 0.11, 0.04), (0.18, 0.13, 0.08)
    assert max(roughness(colour, 1.0) for colour in paved) < 0.09
    assert min(roughness(colour, 1.0) for colour in natural) > 0.12
    assert roughness(paved[0], 7400.0) > 0.12


def test_what_is_known_finely_is_left_alone():
    lat, lon = places(100)
    np.testing.assert_allclose(land(FARMLAND, 50.0, 100.0, lat, lon), [FARMLAND] * 100)
    known = np.where(np.arange(100) < 50, 7400.0, 50.0)
    albedo = patched(np.tile(FARMLAND, (100, 1)), lat, lon, WAVELENGTHS, known, np.full(100, 100.0))
    np.testing.assert_allclose(albedo[50:], [FARMLAND] * 50)
    assert np.abs(albedo[:50] / FARMLAND - 1).max() > 0.2
