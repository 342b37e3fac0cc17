"""Pictures of the linear core beside those of `fast`, of cumulus that a large-eddy model made."""

import numpy as np
import pytest

from openswim import Scene, Solver
from openswim.cameras import Rays
from openswim.scene.phase import HenyeyGreenstein

_CUT = 30, 40  # columns to a depth of 17


@pytest.fixture(scope="module")
def extinction(shared):
    """Of RICO (39, 106, 122), 1/m: 1.5 liquid content over effective radius."""
    rows = np.loadtxt(shared / "data/nwp/les_rico_122x106x39.txt", delimiter=",", skiprows=5)
    at = rows[:, :3].astype(int)
    field = np.zeros((39, 106, 122))
    field[at[:, 2] % 39, at[:, 1] % 106, at[:, 0] % 122] = 1.5 * rows[:, 3] / rows[:, 4]
    return field


@pytest.mark.slow
def test_cumulus_from_above_aslant_and_below_is_that_of_fast(extinction):
    y, x = _CUT
    part = np.zeros((55, 48, 48))
    part[11:50, 2:-2, 2:-2] = extinction[:, y + 2 : y + 46, x + 2 : x + 46]
    across, levels = 20.0 * np.arange(48), 40.0 * np.arange(55)
    cloud = {"phase": HenyeyGreenstein(0.85), "surface_albedo": 0.0, "atmosphere": None}
    scene = Scene.from_arrays(part, across, across, levels, **cloud)
    altitude, azimuth, slant = np.radians([40.0, 150.0, 50.0])
    sun = _direction(altitude, azimuth)
    fast, core = (Solver(name, tolerance=1e-3).solve(scene, sun, [550.0]) for name in ("fast", "linear"))
    aslant = -_direction(np.pi / 2 - slant, azimuth)
    views = {
        "above": (_parallel(np.array([0.0, 0.0, -1.0])), 1.2, 0.46),  # RMSE .91, bias -.35
        "aslant": (_parallel(aslant), 1.25, 0.1),  # .96, -.04
        "below": (_all_sky(sun), 1.22, 0.06),  # .94, -.04
    }
    for name, (rays, most, mean) in views.items():
        theirs, own = (np.ravel(light.view(rays).radiance).astype(float) for light in (fast, core))
        cloud = theirs > (0.05 * theirs.max() if name == "below" else -1.0)  # else the black sky is most of it
        off = 100 * (own - theirs)[cloud] / theirs[cloud].mean()
        assert np.sqrt((off**2).mean()) < most, name
        assert abs(off.mean()) < mean, name
        assert np.corrcoef(own, theirs)[0, 1] > 0.9999, name


def _parallel(down):
    """Rays (120 x 120) through the middle of the field."""
    middle = np.stack([*np.meshgrid(*2 * [np.linspace(60, 880, 120)]), np.full((120, 120), 1000.0)], axis=-1)
    starts = (middle - down * ((1000.0 - 2250.0) / down[2])).reshape(-1, 3)
    return Rays(starts, np.broadcast_to(down, starts.shape).copy())


def _all_sky(sun):
    """Of an eye on the ground, up to 75 degrees from the zenith and down to 10 from the sun."""
    u, v = np.meshgrid(*2 * [(np.arange(70) + 0.5) / 35 - 1])
    zenith, around = np.radians(75.0) * np.hypot(u, v), np.arctan2(v, u)
    up = np.stack([np.sin(zenith) * np.cos(around), np.sin(zenith) * np.sin(around), np.cos(zenith)], axis=-1)
    return Rays(np.array([470.0, 470.0, 2.0]), up[(np.hypot(u, v) < 1) & (up @ sun < np.cos(np.radians(10.0)))])


def _direction(altitude, azimuth):
    level = np.cos(altitude)
    return np.array([level * np.sin(azimuth), level * np.cos(azimuth), np.sin(altitude)])
