"""The sun in eclipse over a scene: what is left of it from place to place, its picture, and the light from around."""

from dataclasses import dataclass

import numpy as np
import pytest

import openswim
from openswim.cameras import Camera, Rays
from openswim.heavens.corona import FARTHEST, brightness, drawn_corona
from openswim.heavens.sun_disc import Bite, Disc, beam_of, drawn
from openswim.lighting import daylight
from openswim.lights.eclipses import MoonShadow, light_left, solar_eclipse
from openswim.lights.eclipses import shadow as shadows
from openswim.lights.eclipses.solar import discs
from openswim.scene import Scene
from openswim.scene.frame import Frame, azimuth_altitude, horizon_vector, scene_frame
from openswim.solver import Solver
from openswim.transport.montecarlo.covered import cover, covered_by

WAVELENGTHS = np.array([450.0, 546.0, 615.0])


@dataclass(frozen=True)
class MadeUp:
    """A shadow that leaves ``whole`` of the sun, and so much more a metre to the east and up."""

    whole: float
    east_per_m: float = 0.0
    up_per_m: float = 0.0

    def left(self, place_m, wavelengths_nm):
        found = self.whole + place_m[:, 0] * self.east_per_m + place_m[:, 2] * self.up_per_m
        return np.repeat(found[:, None], len(wavelengths_nm), axis=1)


@pytest.mark.parametrize("second", [0, 60, 600])
def test_the_shadow_over_a_scene_is_that_of_each_place(second):
    """Against sun and moon as skyfield has them for places up to 260 km away, and high ones (to .01 % of the sun)."""
    lat, lon = 43.36, -5.0
    time = np.datetime64("2026-08-12T18:27:00") + np.timedelta64(second, "s")
    shadow, frame = MoonShadow.over(time, lat, lon), Frame(6.371e6, lat, lon)
    for north, east, height_m in ((0, 0, 0), (1, 1, 0), (0.5, -2, 5e3), (2, 3, 1e4)):
        own = light_left(discs(time, lat + north, lon + east, height_m), WAVELENGTHS, 400)[0]
        found = shadow.left(frame.position(lat + north, lon + east, height_m)[None], WAVELENGTHS)[0]
        assert found == pytest.approx(own, abs=1.4e-4)
    assert shadow.touches(0.0)
    assert not MoonShadow.over("2026-08-13T12:00", lat, lon).touches(1e6)


def test_an_even_shadow_takes_from_all_light_alike():
    """Where the moon leaves three tenths everywhere, the sky has three tenths of its light, from zenith to horizon."""
    scene = Scene.clear(40.0, 10.0)
    frame = scene_frame(scene)
    sun = frame.direction(150.0, 35.0, 40.0, 10.0)
    rays = Rays(frame.position(40.0, 10.0, 100.0), frame.direction([0, 90, 150, 260], [90, 3, 20, -8], 40.0, 10.0))
    whole = Solver().solve(scene, sun, WAVELENGTHS).view(rays).radiance
    seen = Solver().solve(scene, sun, WAVELENGTHS, shadow=MadeUp(0.3)).view(rays).radiance
    assert seen / whole == pytest.approx(0.3, rel=0.0015)
    # and where a deep one has an edge, light comes from beyond it
    dark = Solver().solve(scene, sun, WAVELENGTHS, shadow=MadeUp(1e-6)).view(rays).radiance
    assert dark / whole == pytest.approx(1e-6, rel=0.007)


def test_the_beam_in_a_grid_has_what_is_left_at_each_node():
    x, z = np.arange(12) * 1000.0, np.arange(0, 4001, 250.0)
    extinction = np.zeros((17, 10, 12), np.float32)
    extinction[6:9, 3:7, 4:8] = 0.01
    scene = Scene.from_arrays(extinction, x, x[:10], z, surface_albedo=0.2)
    sun, shadow = np.array([0.3, 0.2, 0.93]), MadeUp(0.5, 3e-5, 2e-5)
    solver = Solver("fast", quality="preview")
    whole, part = (solver.solve(scene, sun, [546.0], shadow=each).packs[0] for each in (None, shadow))
    medium = whole.medium
    for k in (0, 7, 16):
        place = (medium.place + medium.levels_m[k] * medium.axes[..., 2, :]).reshape(-1, 3)
        left = shadow.left(place, [546.0]).reshape(medium.shape[1:])
        assert part.light.beams[0][k] / whole.light.beams[0][k] == pytest.approx(left, rel=2e-4)
        assert part.channels.beam[k, ..., 0] ** 2 == pytest.approx(part.light.beams[0][k], rel=1e-4)
    ground = shadow.left(medium.place.reshape(-1, 3), [546.0]).reshape(medium.shape[1:])
    assert part.lighting.direct[0] / whole.lighting.direct[0] == pytest.approx(ground, rel=2e-4)


def test_the_disc_is_bitten_on_the_side_of_the_moon():
    """Half an hour before totality in Texas: all of the light that is left, and none where the moon stands."""
    lat, lon, time = 31.0, -99.0, np.datetime64("2024-04-08T18:05")
    shadow = MoonShadow.over(time, lat, lon)
    origin = np.zeros(3)
    left = shadow.left(origin[None], WAVELENGTHS)[0]
    bite = Bite.of(shadow, origin, np.eye(3), left)
    sun = azimuth_altitude(shadow.to_sun_m / np.linalg.norm(shadow.to_sun_m))
    disc = Disc(*sun, float(shadow.discs(origin[None]).sun_deg[0]), WAVELENGTHS, bite)
    camera = Camera.perspective(lat, lon, azimuth_deg=sun[0], altitude_deg=sun[1], fov_deg=2.0, size=(160, 160))
    pixels = camera.pixels()

    def open_sky(direction, width):
        return np.ones((len(direction), 3)), np.zeros(len(direction), bool)

    row, column, radiance = drawn(camera, pixels, disc, open_sky)
    got = (radiance * pixels.solid_angle_sr[row, column][:, None]).sum(axis=0) / (4 * np.pi)
    assert got == pytest.approx(left, rel=0.01)
    assert beam_of(disc, open_sky).direct == pytest.approx(left, rel=1e-6)
    moon = camera.pixel_of(*azimuth_altitude(shadow.to_moon_m / np.linalg.norm(shadow.to_moon_m)))
    at = (row == round(float(moon[0]))) & (column == round(float(moon[1])))
    assert at.sum() == 1
    assert not radiance[at].any()


@pytest.mark.parametrize("size", [(12, 12), (400, 400)])
def test_the_corona_has_a_millionth_of_the_suns_light(size):
    """1.1e-6 beyond the limb by Baumbach's law, in wide pixels and in small ones."""
    camera = Camera.perspective(40.0, 10.0, azimuth_deg=180, altitude_deg=40, fov_deg=9.0, size=size)
    away = Bite(0.0, 0.0, 1.0, np.ones(3))
    disc = Disc(180.0, 40.0, 0.2666, WAVELENGTHS, away)
    pixels = camera.pixels()

    def open_sky(direction, width):
        return np.ones((len(direction), 3)), np.zeros(len(direction), bool)

    found = drawn_corona(disc, horizon_vector(180.0, 60.0), 0.0, camera, pixels, open_sky)
    got = (found.radiance * pixels.solid_angle_sr[found.row, found.column][:, None]).sum(axis=0) / (4 * np.pi)
    radius = np.linspace(1, FARTHEST, 200_001)
    beyond = 2 * np.trapezoid(radius * brightness(radius, 0 * radius), radius)
    assert beyond == pytest.approx(1.1e-6, rel=0.043)
    assert got == pytest.approx(beyond, rel=0.017)


def test_the_corona_has_no_edge():
    """Its light falls evenly to nothing, and near the sun by Baumbach's law; dust at 12 radii has 1e-10."""
    radius = np.linspace(1, FARTHEST, 1000)
    light = brightness(radius, 0 * radius)
    assert (np.diff(light) < 0).all()
    assert light[-1] < 1e-14
    near = radius < 7
    assert light[near] == pytest.approx(
        1e-6 * (2.565 * radius[near] ** -17 + 1.425 * radius[near] ** -7 + 0.0532 * radius[near] ** -2.5)
    )


@pytest.mark.slow
def test_totality_in_texas():
    """A bluish zenith as dark as in dusk, and red light from outside the shadow all around the horizon; as measured in
    eclipses, some lux fall on the ground (0.1 to 10), and the zenith has 12 to 14 magnitudes."""
    from openswim.colour.photometry import luminance_cd_m2
    from openswim.lights.units import magnitude_of_luminance

    lat, lon = 31.0, -99.0
    eclipse = solar_eclipse("2024-04-08T18:40", lat, lon)
    lit = openswim.light(Scene.clear(lat, lon), time=eclipse.greatest)
    image = lit.viewpoint(Camera.allsky(lat, lon, size=41)).view()
    assert 0.1 < image.attrs["illuminance_lx"] < 10
    zenith = magnitude_of_luminance(luminance_cd_m2(image)[20, 20])
    assert 12.0 < zenith < 14.0
    radiance = image.solar_relative_radiance.values
    for edge in (radiance[20, 1], radiance[20, -2], radiance[1, 20], radiance[-2, 20]):
        assert edge[1] > 3 * radiance[20, 20, 1]
        assert edge[0] / edge[2] > 1.5 * radiance[20, 20, 0] / radiance[20, 20, 2]


def test_paths_of_solver_reference_have_what_is_left_of_the_sun_at_each_place():
    lat, lon = 31.0, -99.0
    shadow = MoonShadow.over("2024-04-08T18:38", lat, lon)
    place = np.random.default_rng(5).uniform([-9e5, -9e5, -2e4], [9e5, 9e5, 6e4], (60, 3))
    place[0] = 0.0
    moon, expected = covered_by(shadow, WAVELENGTHS), shadow.left(place, WAVELENGTHS)
    assert expected.min() == pytest.approx(1.1e-6)
    assert expected.max() > 0.2
    for where, left in zip(place, expected, strict=True):
        beam = np.ones(3)
        cover(*where, moon, beam)
        assert beam == pytest.approx(left, rel=1e-9)


def test_both_solvers_in_a_partial_eclipse():
    """Ten minutes after totality a twelfth of the sun is back, and more of it in the west than here. The standard error
    of each value of `reference` is 1 to 2 %."""
    lat, lon = 31.0, -99.0
    scene, time = Scene.clear(lat, lon), np.datetime64("2024-04-08T18:48")
    frame, shadow = scene_frame(scene), MoonShadow.over(time, lat, lon)
    day = daylight(scene, time)
    rays = Rays(frame.position(lat, lon, 500.0), frame.direction([0, 90, 0, 270, 180], [90, 20, 3, 3, -20], lat, lon))
    seen = [Solver(name, paths=paths).solve(scene, day.direction, WAVELENGTHS, shadow=shadow).view(rays)
            for name, paths in (("fast", None), ("reference", 4000))]  # fmt: skip
    ratio = seen[0].radiance / seen[1].radiance
    assert ratio.mean() == pytest.approx(1.0, abs=0.013)
    np.testing.assert_allclose(ratio, 1.0, atol=0.04)
    image = openswim.render(scene, Camera.allsky(lat, lon, size=3), Solver("reference", paths=2), time=time)
    assert "without" not in image.attrs.get("assumptions", "")


def test_by_day_no_table_of_the_shadow_is_made(monkeypatch):
    """Nor is one at new moon, where it falls beside the Earth."""
    monkeypatch.setattr(shadows, "light_left", None)
    scene = Scene.clear(47.7, 11.2)
    for day in ("2024-06-06T12:00", "2024-06-15T12:00"):
        assert openswim.light(scene, time=day).lamps.shadow is None
