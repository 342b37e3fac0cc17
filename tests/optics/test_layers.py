"""Background aerosol as layers: depths, mixtures, the ground they count from, and fields that they stand for."""

import numpy as np
import pytest
import xarray as xr

import openswim
from openswim.errors import UserError
from openswim.ground.surface import settled
from openswim.optics import aerosol_optics, aerosol_profile, background, scene_optics
from openswim.optics.aerosol import aerosol_type, spectral_albedo
from openswim.optics.aerosol_depth import aerosol_depth
from openswim.optics.chosen import with_aerosol, with_stratosphere
from openswim.optics.climatology import climatological_depth, depth_of_turbidity, water_column_cm
from openswim.optics.layers import share_within
from openswim.optics.matter import matter_of
from openswim.scene import Grid, Scene
from openswim.scene.aerosol import AerosolProfile
from openswim.scene.atmosphere import Atmosphere

WAVELENGTHS = [450.0, 550.0, 615.0]
STRATOSPHERIC = {10_000.0: 0.0, 18_000.0: 1.0, 30_000.0: 0.0}


def test_layers_are_added() -> None:
    low, high = aerosol_profile("dust", 0.3, base_height_m=0.0), aerosol_profile("sulphate", 0.1, profile=STRATOSPHERIC)
    height = np.arange(0.0, 40_001.0, 50.0)
    air = background(Atmosphere.us_standard(aerosol=[low, high]), WAVELENGTHS, height)
    depths = np.array([one.optical_depth_at(WAVELENGTHS) for one in (low, high)])
    np.testing.assert_allclose(np.trapezoid(air.aerosol_per_m, height, axis=1), depths.sum(axis=0), rtol=1e-3)
    albedo = np.array([spectral_albedo(aerosol_type(name), WAVELENGTHS) for name in ("dust", "sulphate")])
    scattered = (depths * albedo).sum(axis=0)
    np.testing.assert_allclose(np.trapezoid(air.aerosol_scattering_per_m, height, axis=1), scattered, rtol=1e-3)
    asymmetry = np.array([[p.asymmetry for p in _phases(name)] for name in ("dust", "sulphate")])
    expected = (depths * albedo * asymmetry).sum(axis=0) / scattered
    np.testing.assert_allclose([p.asymmetry for p in air.aerosol_phase], expected, rtol=1e-6)
    at = int(np.searchsorted(height, 20_000.0))
    share = air.aerosol_scattering_per_m[0, at] / air.aerosol_per_m[0, at]
    assert share == pytest.approx(albedo[1, 0], abs=1e-3)  # nothing but sulphate is left there


def _phases(name: str) -> list:
    return background(Atmosphere.us_standard(aerosol=aerosol_profile(name, 1.0)), WAVELENGTHS, [0.0]).aerosol_phase


def test_a_table_of_heights_has_its_depth() -> None:
    layer = AerosolProfile(0.2, profile={0.0: 2.0, 1000.0: 1.0, 3000.0: 0.0})
    extinction = layer.extinction_per_m([-10.0, 0.0, 500.0, 3000.0, 5000.0], 550.0)[0]
    np.testing.assert_allclose(extinction, [0.0, 2 * 8e-5, 1.5 * 8e-5, 0.0, 0.0], rtol=1e-12)
    assert layer.depth_above(-100.0) == pytest.approx(0.2)
    assert layer.depth_above(1000.0) == pytest.approx(0.2 * 1000.0 / 2500.0)


@pytest.mark.parametrize("bad", [{}, {0.0: 1.0}, {0.0: -1.0, 1e3: 1.0}, {"low": 1.0, "high": 0.0}, [1.0]])
def test_refuses_tables_that_are_none(bad) -> None:
    with pytest.raises(UserError, match="aerosol profile"):
        AerosolProfile(profile=bad)


def test_layers_survive_a_file(tmp_path) -> None:
    layers = [
        aerosol_profile("dust", 0.3, profile={0.0: 1.0, 5e3: 0.1, 6e3: 0.0}),
        aerosol_profile("smoke", 0.1),
        AerosolProfile(0.01, relative_extinction={450.0: 1.4, 700.0: 0.6}, name="stratosphere", beyond=True),
    ]
    scene = Scene.clear(10.0, 10.0, Atmosphere.us_standard(aerosol=layers))
    scene.to_netcdf(tmp_path / "a.nc")
    assert list(openswim.open_scene(tmp_path / "a.nc").atmosphere.layers) == layers


@pytest.mark.parametrize("height", [-400.0, 0.0, 4900.0])
def test_the_default_counts_from_the_ground(height: float) -> None:
    scene = Scene.clear(30.0, 87.0, terrain_m=height)
    air = matter_of(scene, 550.0).air
    z = np.arange(height, 40_000.0, 20.0)
    assert np.trapezoid(air.at(z).aerosol_per_m[0], z) == pytest.approx(0.05, rel=1e-4)
    assert aerosol_depth(settled(scene), height) == pytest.approx(0.05, rel=1e-4)
    fixed = Scene.clear(30.0, 87.0, Atmosphere.us_standard(aerosol=AerosolProfile(base_height_m=0.0)), terrain_m=height)
    thinned = np.exp(-height / 1500.0) if height > 0 else 1 - height / 1500.0
    assert aerosol_depth(fixed, height) == pytest.approx(0.05 * thinned, 1e-3)


def test_a_domains_ground_is_that_about_its_centre() -> None:
    from openswim.optics.layers import ground_of_place_m

    grid = Grid(np.arange(41) * 10e3, np.arange(41) * 10e3, np.array([0.0, 1e4]))
    terrain = np.zeros((41, 41), np.float32)
    terrain[15:26, 15:26] = 4000.0  # 50 km to each side
    scene = Scene(grid, xr.Dataset({"surface_altitude": (("y", "x"), terrain)}), Atmosphere.us_standard())
    assert ground_of_place_m(scene) == 4000.0


@pytest.fixture
def plume() -> Scene:
    """Dust that is thickest at the eastern side, in the midst of what the background stands for."""
    grid = Grid(np.arange(40) * 1e3, np.arange(30) * 1e3, np.arange(0.0, 10_001.0, 500.0))
    layer = aerosol_profile("dust", 0.1, profile={0.0: 1.0, 8000.0: 0.0})
    layer = AerosolProfile(**{n: getattr(layer, n) for n in layer.__dataclass_fields__} | {"beyond": True})
    own = layer.extinction_per_m(grid.height_m, 550.0)[0][:, None, None] * np.ones((21, 30, 40))
    own[2:8, 5:20, 25:] += 1e-4
    return Scene(
        grid, xr.Dataset({"extinction_dust": (("z", "y", "x"), own)}), Atmosphere.us_standard(aerosol=layer),
        {"dust": aerosol_optics("dust")},
    )


def test_field_and_background_are_the_field_within_and_smooth_outward(plume: Scene) -> None:
    (species,) = scene_optics(plume, 550.0)
    air = background(plume.atmosphere, 550.0, plume.grid.height_m).aerosol_per_m[0]
    total = species.extinction_per_m + air[:, None, None]
    own, share = plume.data.extinction_dust.values, share_within(plume.grid)
    within = share == 1
    assert within.mean() > 0.3
    np.testing.assert_allclose(total[within], own[within], rtol=1e-5, atol=1e-10)
    for edge in (np.s_[:, 0], np.s_[:, -1], np.s_[:, :, 0], np.s_[:, :, -1], np.s_[-1]):
        assert not species.extinction_per_m[edge].any()
    along = species.extinction_per_m[4, 12]  # over the plume, cut by the side
    assert along.max() == pytest.approx(1e-4, rel=1e-3)
    assert np.abs(np.diff(along[28:])).max() < 0.3e-4
    assert aerosol_depth(plume, 0.0, (30.0, 12.0)) == pytest.approx(0.1 + 6 * 500 * 1e-4, rel=1e-4)
    assert aerosol_depth(plume, 0.0) == pytest.approx(0.1, rel=1e-4)


def test_an_aerosol_of_ones_own(plume: Scene) -> None:
    chosen = with_aerosol(plume, "smoke", 0.2)
    assert chosen.species == []
    assert (chosen.atmosphere.aerosol.name, chosen.atmosphere.aerosol.optical_depth) == ("smoke", 0.2)
    assert plume.species == ["dust"]
    with pytest.raises(UserError, match="choose one of"):
        with_aerosol(plume, "fog")
    with pytest.raises(UserError, match="day of the year"):
        with_aerosol(plume, "climatology")


def test_a_stratosphere_beside_what_the_scene_has(plume: Scene) -> None:
    high = with_stratosphere(plume, "pinatubo")
    assert [each.name for each in high.atmosphere.layers] == ["dust", "stratosphere"]
    layer = high.atmosphere.layers[1]
    assert layer.depth_above(14e3) == pytest.approx(0.15, rel=1e-3)
    assert layer.depth_above(30e3) == pytest.approx(0.0, abs=1e-9)
    assert layer.phase is not None
    assert [each.optical_depth for each in with_stratosphere(high, "smoke", 0.03).atmosphere.layers[1:]] == [0.03]
    assert with_stratosphere(high, "none").atmosphere.layers == plume.atmosphere.layers
    with pytest.raises(UserError, match="choose one of background, pinatubo, smoke"):
        with_stratosphere(plume, "ash")


def test_purple_light_while_the_sun_reaches_a_layer_high_up() -> None:
    """20 degrees up toward a sun that is 4 degrees down, the Earth's shadow stands below a layer at 20 km. It is lit by
    a sun that the air has reddened: 2.33 times the red and .436 of the blue without it by Monte Carlo, noise 1.5 %."""
    clear = Scene.clear(40.0, 0.0)
    camera = openswim.Camera.perspective(40.0, 0.0, azimuth_deg=250.0, altitude_deg=20.0, fov_deg=2.0, size=(2, 2))
    with_layer, without = (
        openswim.render(scene, camera, sun=(250.0, -4.0), wavelengths_nm=[615.0, 450.0]).radiance.values.mean((0, 1))
        for scene in (with_stratosphere(clear, "pinatubo"), clear)
    )
    np.testing.assert_allclose(with_layer / without, [2.33, 0.436], rtol=0.08)


def test_turbidity_of_a_known_sky() -> None:
    """Ineichen 2008's relation the other way round: T_L of his polynomials' kind, 3 for .1 and 1.4 cm at sea level."""
    linke = 3.91 * np.exp(0.689) * 0.1 + 0.376 * np.log(1.42) + 2.2
    assert depth_of_turbidity(linke, 1.42, 0.0) == pytest.approx(0.1, rel=1e-9)
    assert linke == pytest.approx(3.1, abs=0.05)


def test_climatology_knows_places_and_seasons() -> None:
    pytest.importorskip("pvlib")
    india, alps = (climatological_depth(*p, "2020-05-15", z) for p, z in (((27, 80), 120.0), ((46.5, 8), 3500.0)))
    assert india > 0.2  # AERONET, Kanpur in May: .6; the map is known to be low there
    assert alps < 0.08  # Jungfraujoch: .02-.05
    winter, summer = (climatological_depth(48.2, 11.6, f"2020-{m:02d}-15", 500.0) for m in (1, 7))
    assert winter < summer < 0.3  # AERONET, Munich: .1 and .2
    july = np.datetime64("2020-07-20")
    assert water_column_cm(45.0, july, 0.0) == pytest.approx(2.93, rel=0.01)
    assert water_column_cm(-45.0, july, 0.0) == pytest.approx(0.85, rel=0.01)
