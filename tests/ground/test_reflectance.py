"""Reflection from the ground: energy, reciprocity, and known angles."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from openswim.ground import spectra, water
from openswim.ground.albedo import SurfaceSample
from openswim.ground.reflectance import (
    bidirectional_reflectance,
    diffuse_reflectance,
    hemispherical_albedo,
    land_factor,
    reflected_radiance,
    snow_factor,
)

WAVELENGTHS = (615.0, 546.0, 450.0)
MU = st.floats(0.0, 1.0)
AZIMUTH = st.floats(0.0, 2 * np.pi)
WIND = st.floats(0.0, 30.0)


def sample(n=1, albedo=(0.3, 0.2, 0.1), wet=0.0, snow=0.0, wind=5.0, lambertian=False):
    full = np.full
    return SurfaceSample(
        np.tile(albedo, (n, 1)), full(n, wet), full(n, snow), np.zeros(n), full(n, wind), full(n, 0.2), lambertian
    )


def hemispherical_mean(factor):
    """(1/pi) integral of factor(mu, azimuth) mu dOmega; the sharp places (grazing, azimuth 0 and pi) get most
    nodes."""
    node, weight = np.polynomial.legendre.leggauss(160)
    mu, mu_weight = 0.5 * (node + 1), 0.5 * weight
    azimuth, azimuth_weight = 0.5 * np.pi * (node + 1), 0.5 * np.pi * weight
    return 2 / np.pi * (factor(mu[:, None], azimuth[None, :]) @ azimuth_weight) @ (mu * mu_weight)


@pytest.mark.parametrize("factor", [land_factor, snow_factor])
@pytest.mark.parametrize("mu_sun", [0.06, 0.13, 0.37, 0.62, 0.81, 1.0])
def test_anisotropy_keeps_the_albedo(factor, mu_sun):
    assert hemispherical_mean(lambda mu, az: factor(mu_sun, mu, az)) == pytest.approx(1.0, abs=2e-3)


@pytest.mark.parametrize("factor", [land_factor, snow_factor])
@given(mu_sun=MU, mu_view=MU, azimuth=AZIMUTH)
def test_land_and_snow_are_reciprocal_and_never_negative(factor, mu_sun, mu_view, azimuth):
    """Helmholtz: sun and viewer may change places."""
    there = factor(mu_sun, mu_view, azimuth)
    assert there == pytest.approx(factor(mu_view, mu_sun, azimuth), rel=1e-9)
    assert 0 < there < 60
    assert np.isfinite(there)


@pytest.mark.parametrize("factor", [land_factor, snow_factor])
def test_isotropic_light_is_reflected_alike_in_all_directions(factor):
    """Which follows from reciprocity and an albedo that does not depend on the sun."""
    for mu_view in (0.1, 0.5, 0.9):
        assert hemispherical_mean(lambda mu, az, view=mu_view: factor(mu, view, az)) == pytest.approx(1, abs=3e-3)


@pytest.mark.parametrize("chlorophyll", [0.03, 0.2, 1.0, 3.0])
def test_water_leaving_light_follows_the_chlorophyll(chlorophyll):
    """Clear water is blue and productive water green; the ocean-colour algorithm OC4 (O'Reilly et al. 2000) finds the
    chlorophyll again to within a factor of two."""
    blue1, blue2, blue3, green = spectra.water_leaving([443.0, 490.0, 510.0, 555.0], chlorophyll)[0]
    ratio = np.log10(max(blue1, blue2, blue3) / green)
    found = 10 ** np.polynomial.polynomial.polyval(ratio, [0.366, -3.067, 1.930, 0.649, -1.532])
    assert 0.5 < found / chlorophyll < 2.0
    assert (spectra.water_leaving(np.arange(400.0, 701.0, 20), chlorophyll) > 0).all()


def test_land_is_brightest_at_the_hot_spot_and_snow_toward_the_sun():
    mu = np.cos(np.radians(np.linspace(0, 85, 35)))[:, None]
    azimuth = np.radians(np.linspace(0, 180, 37))[None, :]
    land = land_factor(mu[20, 0], mu, azimuth)
    assert np.unravel_index(land.argmax(), land.shape) == (20, 0)
    assert snow_factor(0.3, 0.3, np.pi) > 1.3 * snow_factor(0.3, 0.3, 0.0)


@given(MU, MU, AZIMUTH, WIND)
def test_glint_is_reciprocal_finite_and_positive(mu_sun, mu_view, azimuth, wind):
    variance = water.mean_square_slope(wind)
    there = water.glint_reflectance(mu_sun, mu_view, azimuth, variance)
    back = water.glint_reflectance(mu_view, mu_sun, azimuth, variance)
    assert there == pytest.approx(back, rel=1e-9)
    assert np.isfinite(there)
    assert there >= 0


def facet_albedo(mu_sun, wind):
    """Sunlight reflected by all the facets of a Gaussian sea, straight from their slopes."""
    node, weight = np.polynomial.hermite.hermgauss(60)
    slope = node * np.sqrt(water.mean_square_slope(wind))
    along, across = slope[:, None], slope[None, :]
    steepness = np.sqrt(1 + along**2 + across**2)
    cos_incidence = np.maximum(mu_sun - along * np.sqrt(1 - mu_sun**2), 0) / steepness
    reflected = water.fresnel_reflectance(cos_incidence) * cos_incidence * steepness / mu_sun
    return (weight[:, None] * weight[None, :] * reflected).sum() / np.pi


@pytest.mark.parametrize("zenith_deg", [0, 20, 40, 55])
@pytest.mark.parametrize("wind", [0.5, 3.0, 8.0])
def test_glint_integral_is_the_fresnel_albedo(zenith_deg, wind):
    mu_sun = np.cos(np.radians(zenith_deg))
    variance = water.mean_square_slope(wind)
    albedo = hemispherical_mean(lambda mu, az: water.glint_reflectance(mu_sun, mu, az, variance))
    # Light that meets a second wave is left out, which tells from 50 degrees on in a stiff wind.
    tolerance = 0.006 if zenith_deg <= 40 or wind < 5 else 0.07
    assert albedo == pytest.approx(facet_albedo(mu_sun, wind), rel=tolerance)
    assert albedo == pytest.approx(float(water.fresnel_reflectance(mu_sun)), rel=0.09)


def test_slope_density_is_normalised():
    """At nadir view and sun the glint is F p(0) / 4 mu mu0 . pi = F / (4 s^2)."""
    variance = 0.034
    expected = water.fresnel_reflectance(1.0) / (4 * variance)
    assert water.glint_reflectance(1.0, 1.0, 0.0, variance) == pytest.approx(expected)


def test_glint_peaks_at_the_specular_point_in_light_wind():
    zenith = np.radians(np.arange(0.0, 80.0, 0.5))
    azimuth = np.radians(np.arange(0.0, 360.0, 2.0))
    glint = water.glint_reflectance(np.cos(np.radians(40.0)), np.cos(zenith)[:, None], azimuth[None, :], 0.003)
    row, column = np.unravel_index(glint.argmax(), glint.shape)
    assert np.degrees(zenith[row]) == pytest.approx(40, abs=1.0)
    assert np.degrees(azimuth[column]) == pytest.approx(180, abs=2.0)


def test_slopes_of_waves_widen_and_dim_the_glint_and_leave_the_foam_to_the_wind():
    """Of the same slope, however it is told, everything is the same; of twice the slope the glint is half as bright in
    its middle, and its sides are brighter: the ratio of two Gaussians."""
    zenith = np.radians(np.arange(-60.0, 60.5, 0.5))
    views = np.cos(zenith), np.where(zenith > 0, np.pi, 0.0)
    by_wind = sample(zenith.size, wet=1.0, wind=6.0)
    told = replace(by_wind, mean_square_slope=np.full(zenith.size, 0.003 + 0.00512 * 6.0))
    wider = replace(by_wind, mean_square_slope=2 * told.mean_square_slope)
    one, same, wide = (bidirectional_reflectance(s, 1.0, *views, WAVELENGTHS)[:, 0] for s in (by_wind, told, wider))
    np.testing.assert_allclose(same, one, rtol=1e-12)
    for albedo in (hemispherical_albedo, lambda s, nm: diffuse_reflectance(s, views[0], nm)):
        np.testing.assert_allclose(albedo(told, WAVELENGTHS), albedo(by_wind, WAVELENGTHS), rtol=1e-12)
    foam = replace(by_wind, mean_square_slope=np.full(zenith.size, 1e-9))  # no facet faces the side
    body = bidirectional_reflectance(foam, 1.0, *views, WAVELENGTHS)[0, 0]
    glint, wide_glint = one - body, wide - body
    tilt = np.tan(0.5 * zenith)  # slope of the facets that mirror the sun from the zenith
    np.testing.assert_allclose(wide_glint / glint, 0.5 * np.exp(tilt**2 / (2 * told.mean_square_slope)), rtol=1e-6)
    assert wide_glint[0] > 3 * glint[0]


def test_fresnel():
    n = water.REFRACTIVE_INDEX
    assert water.fresnel_reflectance(1.0) == pytest.approx(((n - 1) / (n + 1)) ** 2)
    assert water.fresnel_reflectance(0.0) == pytest.approx(1.0)
    brewster = np.cos(np.arctan(n))
    half_perpendicular = 0.5 * ((n**2 - 1) / (n**2 + 1)) ** 2
    assert water.fresnel_reflectance(brewster) == pytest.approx(half_perpendicular)


def test_foam_covers_what_was_measured():
    """Monahan & O'Muircheartaigh's other fit to the same photographs, 3.84e-6 W^3.41; none in a calm."""
    wind = np.array([5.0, 10.0, 15.0])
    np.testing.assert_allclose(water.foam_fraction(wind), 3.84e-6 * wind**3.41, rtol=0.1)
    assert water.foam_fraction(0.0) == 0


def test_foam_levels_off_without_a_kink():
    """Monahan & O'Muircheartaigh's to 20 m/s; in a hurricane whitecaps and streaks (Holthuijsen et al. 2012)."""
    wind = np.linspace(0.0, 80.0, 801)
    foam = water.foam_fraction(wind)
    measured = wind <= 20
    np.testing.assert_allclose(foam[measured], 2.95e-6 * wind[measured] ** 3.52, rtol=0.02)
    assert (np.diff(foam) > 0).all()
    slope = np.gradient(foam, wind)
    assert np.abs(np.diff(slope)).max() < 0.05 * slope.max()  # within .1 m/s
    assert 0.2 < water.foam_fraction(30.0) < water.foam_fraction(80.0) < 0.4


def test_diffuse_albedo_of_water():
    """.066 calm (the classical value for a flat surface), less when rough, never above the calm one."""
    albedo = water.isotropic_sky_albedo(water.mean_square_slope([0.0, 5.0, 10.0, 20.0]))
    assert albedo[0] == pytest.approx(0.066, abs=0.002)
    assert (np.diff(albedo) < 0).all()
    assert albedo[-1] > 0.045


def test_mirror_is_flat_where_steep_and_raised_at_the_horizon():
    reflectance, sky_mu, kept = water.mirrored_sky([1.0, 0.7, 0.02], water.mean_square_slope(5.0))
    np.testing.assert_allclose(reflectance[:2], water.fresnel_reflectance([1.0, 0.7]), rtol=0.1)
    assert sky_mu[0] > 0.93
    assert 0.1 < sky_mu[2] < 0.35
    assert 0.25 < reflectance[2] < 0.6
    assert kept[0] == pytest.approx(0, abs=1e-9)
    assert kept[2] == 1


def test_water_mirrors_a_sky_as_bright_on_both_sides_of_the_nadir():
    """Whatever the sky is like: facets on all sides are seen there. Seen aslant it mirrors what lies ahead."""
    water_alone = sample(2, wet=1.0)

    def sky(which, mu, azimuth):
        return np.repeat((1 + 0.5 * np.sqrt(1 - mu**2) * np.cos(azimuth))[:, None], 3, axis=1)

    none = np.zeros((2, 3))
    for angle_deg in (0.1, 10.0, 50.0):
        mu = np.cos(np.radians(angle_deg))
        ahead, behind = reflected_radiance(water_alone, WAVELENGTHS, 0.6, [mu, mu], [np.pi, 0.0], none, none, sky)
        leads = 0.5 * np.sin(np.radians(angle_deg))  # on across, as a flat mirror would
        np.testing.assert_allclose(ahead / behind - 1, (1 + leads) / (1 - leads) - 1, rtol=0.1)



def test_lambertian_radiance():
    """L' = 4 mu0 a, exactly, from any direction."""
    ground = sample(4, lambertian=True)
    direct = np.full((4, 3), 0.6)
    radiance = reflected_radiance(
        ground, WAVELENGTHS, 0.6, [0.1, 0.4, 0.7, 1.0], [0, 1, 2, 3], direct, np.zeros((4, 3))
    )
    np.testing.assert_allclose(radiance, 4 * 0.6 * ground.albedo)


def test_sunlit_white_wall():
    wall = sample(albedo=(1.0, 1.0, 1.0), lambertian=True)
    one = np.ones((1, 3))
    np.testing.assert_allclose(reflected_radiance(wall, WAVELENGTHS, 1.0, 0.5, 0.0, one, 0 * one), 4.0)


@given(MU, MU, AZIMUTH, WIND, st.floats(0, 1), st.floats(0, 1))
def test_finite_everywhere(mu_sun, mu_view, azimuth, wind, wet, snow):
    ground = sample(wet=wet, snow=snow, wind=wind)
    flux = np.full((1, 3), 0.5)
    sky = lambda which, mu, az: np.ones((which.size, 3))  # noqa: E731
    for source in (None, sky):
        radiance = reflected_radiance(
            ground, WAVELENGTHS, mu_sun, mu_view, azimuth, flux * mu_sun, flux, source
        )
        assert np.isfinite(radiance).all()
        assert (radiance >= 0).all()


def test_no_sun_below_the_horizon():
    ground = sample(wet=0.5)
    flux = np.ones((1, 3))
    dark = reflected_radiance(ground, WAVELENGTHS, -0.1, 0.5, 1.0, flux, 0 * flux)
    assert not dark.any()


@pytest.mark.parametrize("ground", [sample(), sample(snow=1.0), sample(wet=1.0), sample(wet=0.4, wind=15.0)])
def test_energy_is_conserved_under_any_light(ground):
    assert (hemispherical_albedo(ground, WAVELENGTHS) <= 1).all()
    for mu_sun in (0.3, 0.6, 0.95):

        def brf(mu, azimuth, mu_sun=mu_sun):
            shape = np.broadcast_shapes(mu.shape, azimuth.shape)
            views = np.broadcast_to(mu, shape).ravel(), np.broadcast_to(azimuth, shape).ravel()
            many = SurfaceSample(
                *(
                    np.repeat(getattr(ground, name), views[0].size, axis=0)
                    for name in ("albedo", "water", "snow", "sea_ice", "wind_speed", "chlorophyll")
                )
            )
            return bidirectional_reflectance(many, mu_sun, *views, WAVELENGTHS)[:, 0].reshape(shape)

        assert 0 < hemispherical_mean(brf) < 1


def test_hemispherical_albedo_is_the_mean_of_the_diffuse_reflectance():
    ground = sample(400, wet=0.7, wind=8.0)
    node, weight = np.polynomial.legendre.leggauss(400)
    mu = 0.5 * (node + 1)
    mean = (diffuse_reflectance(ground, mu, WAVELENGTHS) * (mu * weight)[:, None]).sum(axis=0)
    np.testing.assert_allclose(mean, hemispherical_albedo(ground, WAVELENGTHS)[0], rtol=0.01)


def test_water_mirrors_the_sky_it_is_shown():
    """The sky is asked on the far side of the mirror, and an isotropic one gives the isotropic answer."""
    ground = sample(wet=1.0)
    asked = []

    def sky(which, mu, azimuth):
        assert list(which) == [0]
        asked.append((mu, azimuth))
        return np.full((1, 3), 4 * 0.3)

    flux = np.full((1, 3), 0.3)
    given = reflected_radiance(ground, WAVELENGTHS, 0.5, 0.4, 0.7, 0 * flux, flux, sky)
    np.testing.assert_allclose(given, reflected_radiance(ground, WAVELENGTHS, 0.5, 0.4, 0.7, 0 * flux, flux))
    assert asked[0][1] == pytest.approx(np.pi - 0.7)
    assert asked[0][0] == pytest.approx(0.4, abs=0.1)


def test_ocean_is_dark_and_blue_from_above():
    ocean = sample(wet=1.0)
    albedo = hemispherical_albedo(ocean, WAVELENGTHS)[0]
    assert ((albedo > 0.04) & (albedo < 0.09)).all()
    assert albedo[2] > albedo[1] > albedo[0]
