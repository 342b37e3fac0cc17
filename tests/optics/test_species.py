"""From a scene's fields to optical species."""

from types import SimpleNamespace

import numpy as np
import pytest
import xarray as xr
from hypothesis import given
from hypothesis import strategies as st

from openswim.errors import UserError
from openswim.optics import mie
from openswim.optics.aerosol import aerosol_profile
from openswim.optics.cover import cloud_cover
from openswim.optics.species import scene_optics, size_bins
from openswim.scene import Optics
from openswim.scene.atmosphere import Atmosphere
from openswim.scene.phase import HenyeyGreenstein

SHAPE = (3, 4, 5)
WAVELENGTHS = (615.0, 546.0, 450.0)


def fake_scene(fields, optics=None, atmosphere=None):
    data = xr.Dataset(
        {name: (("z", "y", "x"), np.full(SHAPE, value, np.float32)) for name, value in fields.items()}
    )
    return SimpleNamespace(data=data, optics=optics or {}, atmosphere=atmosphere)


def test_hydrometeors():
    species = scene_optics(
        fake_scene({"liquid_content": 1e-3, "rain_content": 1e-3, "snow_content": 0}), WAVELENGTHS
    )
    assert [s.name for s in species] == ["liquid", "rain"]
    liquid, rain = species
    assert liquid.extinction_per_m.shape == SHAPE
    assert liquid.extinction_per_m.dtype == np.float32
    np.testing.assert_allclose(liquid.extinction_per_m, 1.5 / 11 * edge(11e-6), rtol=0.005)
    np.testing.assert_allclose(rain.extinction_per_m, 2e-3 * edge(750e-6), rtol=0.002)
    for s in species:
        assert len(s.phase) == s.relative_extinction.size == s.single_scattering_albedo.size == 3
        assert s.backscatter_fraction == 0.063
        assert s.relative_extinction[0] > 1 > s.relative_extinction[2]  # the edge is wider in the red


def edge(radius_m):
    """Extinction over the large-particle limit: 1 + x^-2/3 (van de Hulst 1957), for the distribution's mean."""
    return 1 + 1.0 * (2 * np.pi * radius_m / 550e-9) ** (-2 / 3)


def test_radius_of_the_model_counts():
    (liquid,) = scene_optics(
        fake_scene({"liquid_content": 1e-3, "liquid_effective_radius": 20e-6}), WAVELENGTHS
    )
    np.testing.assert_allclose(liquid.extinction_per_m, 0.075 * edge(20e-6), rtol=0.003)


def droplets(radii_m, own=True):
    scene = fake_scene({"liquid_content": 1e-4, "liquid_effective_radius": 1e-5})
    scene.data["liquid_effective_radius"].values[:] = np.resize(np.asarray(radii_m, np.float32), SHAPE)
    if not own:
        content = np.resize(np.asarray([1e-6, 1e-3], np.float32), SHAPE)
        scene.data["liquid_content"].values[:] = content
        scene.data = scene.data.drop_vars("liquid_effective_radius")
    return scene_optics(scene, WAVELENGTHS)


def test_one_species_at_the_mean_radius_where_droplets_are_alike():
    (liquid,) = droplets([7e-6, 9e-6])
    expected = mie.phase_function("liquid", 546.0, 8e-6)
    assert liquid.name == "liquid"
    assert liquid.phase[1].asymmetry == pytest.approx(expected.asymmetry, abs=1e-3)


def test_a_diagnosed_radius_is_no_reason_for_two_species():
    assert len(droplets([], own=False)) == 1


def test_two_species_where_droplets_differ():
    radii = [4e-6, 9e-6, 20e-6]
    small, large = droplets(radii)
    assert (small.kind, large.kind) == ("liquid", "liquid")
    total = small.extinction_per_m + large.extinction_per_m
    expected = np.resize([1.5e-4 / (r * 1e3) * edge(r) for r in radii], SHAPE)
    np.testing.assert_allclose(total, expected, rtol=0.01)
    share = (large.extinction_per_m / total).ravel()[:3]
    assert 0 <= share[0] < share[1] < share[2] <= 1
    # bow and glory of each place are nearer to its own than one species at the mean radius would be
    (_, mean_m, _), = size_bins("liquid", np.array(radii), expected.ravel()[:3], np.inf)
    mu = np.cos(np.radians(np.arange(130, 181, 1.0)))
    two = one = 0.0
    for r, large_share in zip(radii, share, strict=True):
        own = mie.phase_function("liquid", 546.0, r).value(mu)
        mixed = (1 - large_share) * small.phase[1].value(mu) + large_share * large.phase[1].value(mu)
        two += np.abs(mixed - own).mean()
        one += np.abs(mie.phase_function("liquid", 546.0, mean_m).value(mu) - own).mean()
    assert two < 0.6 * one


@given(st.lists(st.floats(2e-6, 60e-6), min_size=1, max_size=12), st.floats(0.0, 1.0))
def test_shares_sum_to_one(radii, split_spread):
    radius = np.array(radii)
    bins = size_bins("liquid", radius, 1e-3 / radius, split_spread)
    assert len(bins) in (1, 2)
    np.testing.assert_allclose(sum(share for _, _, share in bins), 1.0)
    for _, mean, share in bins:
        assert np.isfinite(mean)
        assert np.all((np.asarray(share) >= 0) & (np.asarray(share) <= 1))


def test_rain_is_never_split():
    assert len(size_bins("rain", np.array([1e-4, 1e-3]), np.ones(2), 0.1)) == 1


def test_aerosol_takes_its_character_from_the_background():
    profile = aerosol_profile("colorado_dust", 0.1)
    scene = fake_scene({"aerosol_extinction": 1e-4}, atmosphere=Atmosphere.us_standard(aerosol=profile))
    (dust,) = scene_optics(scene, WAVELENGTHS)
    np.testing.assert_allclose(dust.single_scattering_albedo, [0.935, 0.92, 0.86])
    np.testing.assert_allclose(dust.relative_extinction, (np.array(WAVELENGTHS) / 550) ** -0.6)
    assert dust.phase[1].asymmetry == pytest.approx(0.636, abs=1e-3)


def test_aerosol_is_continental_by_default_and_takes_given_optics():
    (default,) = scene_optics(fake_scene({"aerosol_extinction": 1e-4}), WAVELENGTHS)
    assert default.phase == [HenyeyGreenstein(0.65)] * 3
    own = Optics(0.8, HenyeyGreenstein(0.5), "aerosol")
    (given,) = scene_optics(fake_scene({"aerosol_extinction": 1e-4}, {"aerosol": own}), WAVELENGTHS)
    assert given.phase == [HenyeyGreenstein(0.5)] * 3
    np.testing.assert_allclose(given.single_scattering_albedo, 0.8)


def test_direct_extinction():
    cloud = Optics(np.array([0.9, 1.0, 1.0]), HenyeyGreenstein(0.85))
    (species,) = scene_optics(fake_scene({"extinction_cloud": 0.02}, {"cloud": cloud}), WAVELENGTHS)
    assert species.name == "cloud"
    np.testing.assert_allclose(species.extinction_per_m, 0.02)
    np.testing.assert_allclose(species.single_scattering_albedo, [0.9, 1, 1])
    assert species.backscatter_fraction == pytest.approx(0.075)


def test_direct_extinction_refusals():
    with pytest.raises(UserError, match="needs its optics"):
        scene_optics(fake_scene({"extinction_cloud": 0.02}), WAVELENGTHS)
    two = Optics(np.ones(2), HenyeyGreenstein(0.85))
    with pytest.raises(UserError, match="2 single-scattering albedos for 3"):
        scene_optics(fake_scene({"extinction_cloud": 0.02}, {"cloud": two}), WAVELENGTHS)


def test_nothing_there():
    assert scene_optics(fake_scene({"ice_content": 0.0}), WAVELENGTHS) == []


def test_sizes_are_those_within_cloud():
    """.1 g/m3 over the cell in a quarter of it: droplets of .4 g/m3, and a quarter of their extinction."""
    broken = scene_optics(fake_scene({"liquid_content": 1e-4, "cloud_area_fraction": 0.25}), WAVELENGTHS)[0]
    within = scene_optics(fake_scene({"liquid_content": 4e-4}), WAVELENGTHS)[0]
    np.testing.assert_allclose(broken.extinction_per_m, 0.25 * within.extinction_per_m, rtol=1e-4)
    np.testing.assert_allclose(broken.single_scattering_albedo, within.single_scattering_albedo)


def test_cover_holds_at_most_a_gram_within_cloud():
    cover = cloud_cover(fake_scene({"liquid_content": 3e-4, "ice_content": 1e-4, "cloud_area_fraction": 0.05}))
    np.testing.assert_allclose(cover, 0.4, rtol=1e-5)
    assert cloud_cover(fake_scene({"liquid_content": 3e-4})) is None
