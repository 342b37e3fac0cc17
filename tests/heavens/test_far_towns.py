"""Domes of towns beyond the domain, against the transport in a domain that has them within."""

import numpy as np
import pytest

from openswim.cameras import Rays
from openswim.ground import cities
from openswim.heavens.far_towns import Air, domes_of, far_sources
from openswim.scene import Scene
from openswim.scene.atmosphere import AerosolProfile, Atmosphere
from openswim.scene.frame import scene_frame
from openswim.solver import Solver

WAVELENGTHS = np.array([615.0, 546.0, 450.0])
LAT, LON = 50.0, 10.0
KM_PER_LON = 71.5
SOLVER = Solver("fast", quality="preview")


@pytest.fixture(scope="module")
def dark():
    """A scene, and its light of no lamps, which is that whatever town there is."""
    nodes, z = np.arange(-18, 19) * 4.0, np.array([0.0, 500.0, 1000.0, 1500.0, 2000.0, 3000.0])
    air = Atmosphere.us_standard(300.0, AerosolProfile(0.15))
    scene = Scene.from_arrays(
        np.zeros((6, 37, 37), np.float32), LON + nodes / KM_PER_LON, LAT + nodes / 111.2, z, crs="latlon",
        surface_albedo=0.15, atmosphere=air,
    )  # fmt: skip
    return scene, SOLVER.solve_starlit(scene, WAVELENGTHS, np.zeros(3))


@pytest.mark.slow
@pytest.mark.parametrize("away_km", [20.0, 36.0, 60.0])
def test_a_dome_is_as_bright_as_that_of_a_town_within(away_km, dark, monkeypatch):
    """Within a half in green and red up to 45 degrees; what is scattered often makes blue ones brighter."""

    def town(lat, lon):
        north, east = (lat - LAT) * 111.2 - away_km, (lon - LON) * KM_PER_LON
        return 30.0 * np.exp(-0.5 * (north**2 + east**2) / 6.0**2)

    monkeypatch.setattr(cities, "_coarse", town)
    scene, without = dark
    frame = scene_frame(scene)
    up = frame.direction(0.0, np.array([2.0, 5.0, 10.0, 20.0, 30.0, 45.0]), LAT, LON)
    rays = Rays(frame.position(LAT, LON, 2.0), up)
    bright = SOLVER.solve_starlit(scene, WAVELENGTHS, 1e9 * cities.lamp_spectrum(WAVELENGTHS))
    within = (bright.view(rays).radiance.astype(float) - without.view(rays).radiance) / 1e9
    sources = far_sources(frame, LAT, LON, lambda lat, lon: np.zeros(np.shape(lat), bool), None)
    domes = domes_of(Air.of(bright), frame, LAT, LON, 2.0, 0.0, WAVELENGTHS, sources)
    ratio = domes.toward(up) / within
    assert ratio[:, :2].min() > 0.5
    assert ratio[:, :2].max() < 1.6
    assert ratio[:, 2].min() > 0.4
    assert ratio[:, 2].max() < 1.3
    # away from the town next to nothing comes
    assert domes.toward(frame.direction(180.0, 5.0, LAT, LON)[None])[0, 1] < 0.3 * domes.toward(up)[1, 1]


def test_what_the_domain_has_is_left_out():
    frame = scene_frame(Scene.clear(52.5, 13.4))
    every = far_sources(frame, 52.5, 13.4, lambda lat, lon: np.zeros(np.shape(lat), bool), None)
    none = far_sources(frame, 52.5, 13.4, lambda lat, lon: np.ones(np.shape(lat), bool), None)
    assert every[1].sum() > 0
    assert not none[1].size
