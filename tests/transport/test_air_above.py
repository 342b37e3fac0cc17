"""Air above the clouds of a low model: lit by them, as path after path finds it."""

import numpy as np
import pytest
from tests.transport.scenes import toward

from openswim.cameras import Rays
from openswim.scene import Scene
from openswim.scene.atmosphere import Atmosphere
from openswim.solver import Solver
from openswim.transport.air.shells import shell_levels

SUN = toward(90.0, 30.0)
PLACES = np.array([[0, 0, 1500.0], [0, 0, 1500.0], [0, 0, 8000.0], [0, 0, 2e5]])
WAYS = np.array([toward(0.0, altitude) for altitude in (88.0, 30.0, 30.0, -88.0)])


def overcast(single_scattering_albedo: float) -> Scene:
    """Deck of optical depth 20 from 800 to 1200 m, on a grid that ends at 1600 m."""
    across, height = 500.0 * np.arange(6), np.arange(0, 1601, 100.0)
    field = np.zeros((17, 6, 6), np.float32)
    field[8:13] = 20 / 450
    return Scene.from_arrays(
        field, across, across, height, periodic=True, surface_albedo=0.1,
        atmosphere=Atmosphere.us_standard(aerosol=None), single_scattering_albedo=single_scattering_albedo,
    )  # fmt: skip


@pytest.mark.slow
@pytest.mark.parametrize(("albedo", "limit"), [(1.0, 0.06), (0.9, 0.08)])
def test_it_shines_with_the_light_of_clouds(albedo: float, limit: float) -> None:
    scene = overcast(albedo)
    fields = [
        solver.solve(scene, SUN, [615.0, 450.0]) for solver in (Solver(), Solver("reference", paths=24_000, seed=3))
    ]
    for place, way in zip(PLACES, WAYS, strict=True):
        fast, reference = (field.view(Rays(place, way)) for field in fields)
        difference = np.abs(fast.radiance - reference.radiance)
        assert (difference < limit * reference.radiance + 3 * reference.sigma).all()  # errors are 1 %


def test_tall_levels_hold_as_much_air_as_there_is() -> None:
    """Haze, which thins out by half in a kilometre: its values at the levels, linear between, would be too much."""
    across, height = 500.0 * np.arange(6), np.arange(0, 801, 50.0)
    scene = Scene.from_arrays({}, across, across, height, periodic=True, atmosphere=Atmosphere.us_standard())
    pack = Solver().solve(scene, SUN, [550.0]).packs[0]
    levels, shells = pack.medium.levels_m, pack.shells
    fine = np.linspace(levels[0], levels[-1], 20_001)
    exact = np.trapezoid(np.interp(fine, shell_levels(), shells.extinction[:, 0]), fine)
    at_levels = np.trapezoid(np.interp(levels, shell_levels(), shells.extinction[:, 0]), levels)
    assert at_levels > 1.004 * exact
    assert np.trapezoid(pack.volume.air[:, 0], levels) == pytest.approx(exact, rel=2e-4)
