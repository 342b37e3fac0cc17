"""Detail below the grid, which is invented, travels with its clouds."""

from __future__ import annotations

from copy import copy
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from pyproj import CRS, Geod
from tests.films.test_between import MINUTES, NOON, WIND, _state
from tests.transport.scenes import toward

from openswim import Scene, Solver, open_light
from openswim.cameras import Rays
from openswim.films import Weather
from openswim.films.between import Motion
from openswim.lighting import light
from openswim.scene.frame import Frame
from openswim.transport.medium.chart import before_drift, fixed_to_earth
from openswim.transport.medium.noise import Octave

CELL_M, SIDE = 200.0, 49
DRIFT_M = (310.0, -170.0)
CLEAR = [-1.0, 800.0, 1200.0, 1600.0, 2000.0]


def deck(drift_m: tuple[float, float] = (0.0, 0.0), crs: str | None = None) -> Scene:
    """The same cloud everywhere, between 800 m and 2 km."""
    x = CELL_M * (np.arange(SIDE) - SIDE // 2)
    z = 200.0 * np.arange(13)
    content = np.interp(z, CLEAR, [0, 0, 2e-4, 2e-4, 0])[:, None, None] * np.ones((SIDE, SIDE))
    found = Scene.from_arrays(
        None, x, x, z, fields={"liquid_content": content}, crs=crs, atmosphere=None, terrain_m=np.zeros((SIDE, SIDE)),
        place=None if crs else (47.0, 11.0), time=NOON, surface_albedo=0.1,
    )  # fmt: skip
    found.drift_m = drift_m
    return found


def seen(scene: Scene, eye_m: tuple[float, float]) -> np.ndarray:
    field = Solver(tolerance=0.3).solve(scene, toward(230.0, 50.0), [546.0])
    azimuth, altitude = np.meshgrid(np.arange(0, 60, 2.0), np.arange(40, 80, 2.0))
    direction = np.stack([toward(a, h) for a, h in zip(azimuth.ravel(), altitude.ravel(), strict=True)])
    return field.view(Rays(np.array([*eye_m, 300.0]), direction, 2e-3)).radiance[:, 0].astype(float)


@pytest.fixture(scope="module")
def still() -> np.ndarray:
    return seen(deck(), (0.0, 0.0))


def test_an_eye_that_drifts_along_sees_the_same_lumps(still: np.ndarray) -> None:
    along, behind = seen(deck(DRIFT_M), DRIFT_M), seen(deck(), DRIFT_M)
    lumps = still.std()
    assert lumps > 0.03 * still.mean()
    assert (along - still).std() < 0.1 * lumps
    assert (behind - still).std() > 0.7 * lumps


def test_on_the_earth_as_well(still: np.ndarray) -> None:
    """Seen from where the frame's axes are those of the grid, turned by 30 degrees from the east."""
    turned = "+proj=omerc +lat_0=47 +lonc=11 +alpha=60 +gamma=0 +R=6371000"
    frame = Frame(6_371_000.0, 47.0, 11.0)
    field = {}
    for drift in ((0.0, 0.0), DRIFT_M):
        medium = light(deck(drift, CRS.from_user_input(turned)), Solver("swim")).field.medium
        assert medium is not None
        field[drift] = np.array(medium.drift_along_axes_m)
        middle = medium.axes[SIDE // 2, SIDE // 2].astype(float)
        east, north, _ = frame.enu(47.0, 11.0)
        np.testing.assert_allclose(field[drift], middle[:2] @ (drift[0] * east + drift[1] * north), atol=0.5)
    assert np.hypot(*field[DRIFT_M]) == pytest.approx(np.hypot(*DRIFT_M), rel=1e-3)


def test_broken_cloud_of_coarse_cells_comes_along() -> None:
    """Noise that belongs to places on the Earth is found, after a drift, so far to the east and north."""
    frame, radius = Frame(6_371_000.0, 47.0, 11.0), 6_371_000.0
    lat, lon = np.meshgrid(np.linspace(46.5, 47.5, 25), np.linspace(10.5, 11.5, 25), indexing="ij")
    to_north, to_east = 8000.0, 15_000.0
    here = fixed_to_earth(frame, frame.position(lat, lon, 0.0))
    there = fixed_to_earth(frame, frame.position(
        lat + np.degrees(to_north / radius), lon + np.degrees(to_east / (radius * np.cos(np.radians(47.0)))), 0.0
    ))  # fmt: skip
    back = before_drift(frame, there, (to_east, to_north))
    assert np.linalg.norm(back - here, axis=-1).max() < 300.0  # meridians meet within the domain
    lon_1, lat_1, _ = Geod(a=radius, b=radius).fwd(
        11.0, 47.0, np.degrees(np.arctan2(to_east, to_north)), np.hypot(to_east, to_north)
    )  # fmt: skip
    ahead = fixed_to_earth(frame, frame.position(np.array([lat_1]), np.array([lon_1]), 0.0))
    assert np.linalg.norm(before_drift(frame, ahead, (to_east, to_north)) - here[12, 12]) < 0.1
    one, other = (Octave(place.reshape(-1, 3), 4000.0, 4000.0).at(1500.0) for place in (here, back))
    assert np.corrcoef(one, other)[0, 1] > 0.99
    assert abs(np.corrcoef(one, Octave(there.reshape(-1, 3), 4000.0, 4000.0).at(1500.0))[0, 1]) < 0.2
    assert before_drift(frame, there, (0.0, 0.0)) is there


def test_weather_carries_detail_at_the_clouds_mean_speed() -> None:
    states = [_state(minutes) for minutes in (0.0, 15.0, 30.0)]
    weather = Weather.of_scenes(states)
    content = states[0].data["liquid_content"].values.sum(axis=(1, 2))
    speed = (WIND * content).sum(axis=1) / content.sum()
    for minutes in (0, 4, 15, 22, 30):
        found = weather.at(NOON + minutes * MINUTES, drifting=True)
        np.testing.assert_allclose(found.drift_m, 60.0 * minutes * speed, rtol=2e-3)
    assert weather.at(NOON + 4 * MINUTES).drift_m == (0.0, 0.0)
    assert states[1].drift_m == (0.0, 0.0)


def test_clouds_around_a_pole_have_one_way() -> None:
    """A wind straight over the pole comes from the south and goes to the south."""
    crs = CRS.from_proj4("+proj=stere +lat_0=90 +lat_ts=90 +lon_0=-45 +R=6371000")
    before, after = deck(crs=crs), deck(crs=crs)
    for scene in (before, after):
        assert scene.grid is not None
        scene.grid = replace(scene.grid, x=scene.grid.x + 700.0, y=scene.grid.y - 400.0)
        angle = scene.grid.axis_angles
        for name, part in (("wind_east", 6.0 * np.cos(angle)), ("wind_north", 6.0 * np.sin(angle))):
            scene.data[name] = ("z", "y", "x"), np.broadcast_to(part, scene.grid.shape).astype(np.float32)
    after.time = NOON + 15 * MINUTES
    grid = before.grid
    assert grid is not None
    found, middle = Motion.between(before, after).of_clouds(before, after), grid.axis_angle(*grid.centre_index)
    np.testing.assert_allclose(found, [6.0 * np.cos(middle), 6.0 * np.sin(middle)], atol=0.01)


def test_kept_light_keeps_its_drift(tmp_path: Path) -> None:
    scene = deck(DRIFT_M)
    light(scene, Solver("swim")).save(tmp_path / "light")
    assert open_light(tmp_path / "light").scene.drift_m == DRIFT_M
    other = copy(scene)
    other.drift_m = (0.0, 0.0)
    with pytest.raises(Exception, match="another scene"):
        open_light(tmp_path / "light", other)
