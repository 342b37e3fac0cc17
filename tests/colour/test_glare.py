"""The sun's glare in pictures, from made-up discs in real cameras."""

import numpy as np
import pytest
import xarray as xr

from openswim import Camera, to_rgb
from openswim.colour.glare import glare_of_sun, spread
from openswim.lights import disc_coverage
from openswim.scene.frame import horizon_vector

SUN = (200.0, 35.0)
RADIUS_DEG = 0.266
IRRADIANCE = 4 * np.pi  # L' sr, of the bare sun
HERE = {"lat": 47.0, "lon": 11.0}
CAMERAS = {
    "allsky": Camera.allsky(**HERE, size=501),
    "coarse allsky": Camera.allsky(**HERE, size=60),
    "panorama over the seam": Camera.panorama(**HERE, azimuth_deg=20.0, size=(200, 800)),
    "perspective": Camera.perspective(**HERE, azimuth_deg=190.0, altitude_deg=30.0, fov_deg=50.0, size=(300, 400)),
}


def image_of(camera: Camera, sun: tuple[float, float] = SUN, sky: float = 0.1) -> xr.Dataset:
    """An even sky with the sun's disc in it."""
    pixels = camera.pixels()
    angle = np.broadcast_to(pixels.angle_to_deg(*sun), pixels.inside.shape)
    half = np.broadcast_to(pixels.half_width_deg, angle.shape)
    wavelengths = np.array([615.0, 546.0, 450.0])
    disc = np.zeros((*angle.shape, 3))
    near = (angle < RADIUS_DEG + 3 * half + 0.05) & pixels.inside
    disc[near] = disc_coverage(angle[near], half[near], RADIUS_DEG, wavelengths)
    return xr.Dataset(
        {
            "solar_relative_radiance": (("y", "x", "wavelength"), sky + disc),
            "azimuth": (("y", "x"), np.broadcast_to(pixels.azimuth_deg, angle.shape)),
            "altitude": (("y", "x"), np.broadcast_to(pixels.altitude_deg, angle.shape)),
        },
        coords={"wavelength": wavelengths},
        attrs={"sun_azimuth_deg": sun[0], "sun_altitude_deg": sun[1]},
    )


@pytest.mark.parametrize("name", CAMERAS)
def test_every_camera_gets_the_suns_irradiance(name: str) -> None:
    found = glare_of_sun(image_of(CAMERAS[name], sky=0.0))
    assert found is not None
    np.testing.assert_allclose(found[1], IRRADIANCE, rtol=0.04)


def test_a_lens_scatters_little_more_than_one_per_cent() -> None:
    angle = np.geomspace(0.5, 90.0, 500)
    scattered = np.trapezoid(2 * np.pi * np.sin(np.radians(angle)) * spread(angle), np.radians(angle))
    assert 0.01 < scattered < 0.015


def test_the_sky_around_the_sun_is_white_and_far_from_it_what_it_was() -> None:
    image = image_of(CAMERAS["perspective"])
    plain, glared = (to_rgb(image, exposure=0.5, dither=False, glare=glare).astype(int) for glare in (False, True))
    angle = CAMERAS["perspective"].pixels().angle_to_deg(*SUN)
    assert glared[(angle > 0.6) & (angle < 1.2)].min() > 230
    assert plain[(angle > 0.6) & (angle < 1.2)].max() < 80
    assert np.abs(glared - plain)[angle > 25].max() <= 6
    assert (glared >= plain).all()


@pytest.mark.parametrize("sun", [(20.0, 30.0), (200.0, -20.0)], ids=["behind", "below the frame"])
def test_a_sun_out_of_the_picture_has_no_glare(sun: tuple[float, float]) -> None:
    assert glare_of_sun(image_of(CAMERAS["perspective"], sun)) is None


def test_a_hidden_sun_has_none_to_speak_of() -> None:
    image = image_of(CAMERAS["perspective"])
    image["solar_relative_radiance"][:] = np.linspace(0.1, 2.0, 400)[:, None]  # a sky that brightens to one side
    plain, glared = (to_rgb(image, exposure=0.5, dither=False, glare=glare).astype(int) for glare in (False, True))
    assert np.abs(glared - plain).max() <= 1
    assert glare_of_sun(image["solar_relative_radiance"]) is None  # which tells no directions


def test_no_glow_is_painted_on_the_ground() -> None:
    low = 200.0, 2.0
    level = Camera.perspective(**HERE, azimuth_deg=200.0, altitude_deg=0.0, fov_deg=50.0, size=(300, 400))
    image = image_of(level, low)
    plain, glared = (to_rgb(image, exposure=0.5, dither=False, glare=glare).astype(int) for glare in (False, True))
    ground = image["altitude"].values < 0
    np.testing.assert_array_equal(glared[ground], plain[ground])
    assert (glared - plain)[~ground].max() > 100
    image.coords["latitude"] = (("y", "x"), np.where(image["altitude"].values < 1.0, 47.0, np.nan))  # a hill
    np.testing.assert_array_equal(to_rgb(image, exposure=0.5, dither=False)[image["altitude"].values < 1.0],
                                  plain[image["altitude"].values < 1.0])  # fmt: skip


def test_from_orbit_neither_land_nor_clouds_get_any() -> None:
    """Land knows its place and dense cloud over it does not: nothing of their edges is in the glare."""
    view = {"azimuth_deg": 200.0, "altitude_deg": -15.0, "fov_deg": 60.0, "size": (300, 400)}
    image = image_of(Camera.perspective(**HERE, height_m=4e5, **view), (200.0, -12.0)).assign_attrs(height_m=4e5)
    altitude, azimuth = image["altitude"].values, image["azimuth"].values
    image.coords["latitude"] = (("y", "x"), np.where((altitude < -20.0) & (azimuth > 205.0), 47.0, np.nan))
    found = glare_of_sun(image)
    assert found is not None
    edge_deg = -np.degrees(np.arccos(6371.0 / 6771.0))
    np.testing.assert_array_equal(found[0] > 0, altitude >= edge_deg)


@pytest.mark.parametrize("lit", ["all", "right half", "crescent"])
def test_glare_is_what_each_part_of_the_disc_spreads(lit: str) -> None:
    """Summed pixel by pixel of what is seen: no round spot beside a crescent, no seam where the sum is shortened."""
    camera = Camera.perspective(**HERE, azimuth_deg=SUN[0], altitude_deg=SUN[1], fov_deg=8.0, size=(321, 321))
    image = image_of(camera, sky=0.0)
    row, column = np.mgrid[-160:161, -160:161] * 8.0 / 321 / RADIUS_DEG
    hidden = {"all": row > 9, "right half": column < 0, "crescent": np.hypot(row + 0.3, column - 0.3) < 1}[lit]
    light = np.where(hidden[..., None], 0.0, image["solar_relative_radiance"])
    image["solar_relative_radiance"][:] = light
    found = glare_of_sun(image)
    assert found is not None
    toward = horizon_vector(image["azimuth"].values, image["altitude"].values)
    shining = np.argwhere(light[..., 1] > 0)
    expected = sum(light[j, i, 1] * spread(np.degrees(np.arccos(np.clip(toward @ toward[j, i], -1, 1))))
                   for j, i in shining) / light[..., 1].sum()  # fmt: skip
    np.testing.assert_allclose(found[0], expected, rtol=0.08)


@pytest.mark.parametrize("wide_deg", [12.0, 20.0, 50.0])
def test_pictures_with_the_sun_do_not_burn_out(wide_deg: float) -> None:
    """Automatic exposure knows of the glare: white is the sun with little around it, and the sky has a colour."""
    camera = Camera.perspective(**HERE, azimuth_deg=SUN[0], altitude_deg=SUN[1], fov_deg=wide_deg, size=(150, 200))
    shown = to_rgb(image_of(camera, sky=0.2), dither=False)
    assert (shown.min(axis=-1) > 250).mean() < 0.03
    assert 50 < np.median(shown) < 200
