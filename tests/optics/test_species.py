"""From a scene's fields to optical species."""

from types import SimpleNamespace

import numpy as np
import pytest
import xarray as xr

from openswim.errors import UserError
from openswim.optics.aerosol import aerosol_profile
from openswim.optics.phase import HenyeyGreenstein
from openswim.optics.species import scene_optics
from openswim.scene.atmosphere import Atmosphere

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
    np.testing.assert_allclose(liquid.extinction_per_m, 1.5 / 11, rtol=1e-5)
    np.testing.assert_allclose(rain.extinction_per_m, 2e-3, rtol=1e-5)
    for s in species:
        assert len(s.phase) == s.relative_extinction.size == s.single_scattering_albedo.size == 3
        assert (s.relative_extinction == 1).all()
        assert s.backscatter_fraction == 0.063


def test_radius_of_the_model_counts():
    (liquid,) = scene_optics(
        fake_scene({"liquid_content": 1e-3, "liquid_effective_radius": 20e-6}), WAVELENGTHS
    )
    np.testing.assert_allclose(liquid.extinction_per_m, 0.075, rtol=1e-5)


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
    own = SimpleNamespace(single_scattering_albedo=0.8, phase=HenyeyGreenstein(0.5), kind="aerosol")
    (given,) = scene_optics(fake_scene({"aerosol_extinction": 1e-4}, {"aerosol": own}), WAVELENGTHS)
    assert given.phase == [HenyeyGreenstein(0.5)] * 3
    np.testing.assert_allclose(given.single_scattering_albedo, 0.8)


def test_direct_extinction():
    cloud = SimpleNamespace(
        single_scattering_albedo=np.array([0.9, 1.0, 1.0]), phase=HenyeyGreenstein(0.85), kind="other"
    )
    (species,) = scene_optics(fake_scene({"extinction_cloud": 0.02}, {"cloud": cloud}), WAVELENGTHS)
    assert species.name == "cloud"
    np.testing.assert_allclose(species.extinction_per_m, 0.02)
    np.testing.assert_allclose(species.single_scattering_albedo, [0.9, 1, 1])
    assert species.backscatter_fraction == pytest.approx(0.075)


def test_direct_extinction_refusals():
    with pytest.raises(UserError, match="needs its optics"):
        scene_optics(fake_scene({"extinction_cloud": 0.02}), WAVELENGTHS)
    two = SimpleNamespace(single_scattering_albedo=np.ones(2), phase=HenyeyGreenstein(0.85), kind="other")
    with pytest.raises(UserError, match="2 single-scattering albedos for 3"):
        scene_optics(fake_scene({"extinction_cloud": 0.02}, {"cloud": two}), WAVELENGTHS)


def test_nothing_there():
    assert scene_optics(fake_scene({"ice_content": 0.0}), WAVELENGTHS) == []
