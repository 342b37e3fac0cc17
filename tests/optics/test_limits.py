"""Wavelengths at which nothing right can be said are refused, with the reason."""

import numpy as np
import pytest

from openswim import Scene, Solver
from openswim.errors import UserError
from openswim.optics.limits import stated
from openswim.scene.atmosphere import Atmosphere


@pytest.mark.parametrize(("wavelength_nm", "reason"), [(1701.0, "heat"), (2130.0, "bands of gases"), (270.0, "ozone")])
def test_beyond_what_is_known_is_refused_with_the_reason(wavelength_nm, reason):
    with pytest.raises(UserError, match=reason):
        Solver().solve(Scene.clear(45.0, 8.0), np.array([0.0, 0.6, 0.8]), [550.0, wavelength_nm])


@pytest.mark.parametrize("wavelengths_nm", [[], [np.nan], [550.0, np.inf]])
def test_what_is_no_wavelength_is_refused(wavelengths_nm):
    with pytest.raises(UserError, match="wavelength"):
        Solver().solve(Scene.clear(45.0, 8.0), np.array([0.0, 0.6, 0.8]), wavelengths_nm)


def test_what_is_taken_for_granted_is_said():
    assert stated(np.array([450.0, 546.0, 615.0])) == []
    (said,) = stated(np.array([340.0, 550.0, 388.0]))
    assert said.startswith("340, 388 nm:")
    (said,) = stated(np.array([550.0, 760.0, 865.0, 1610.0]), Atmosphere.us_standard())
    assert said.startswith("760, 1610 nm: means over 20 nm")
    assert "1.42 cm" in said


def test_a_picture_states_the_vapour_that_it_is_solved_with() -> None:
    import openswim
    from openswim import Camera, Scene, Solver

    scene = Scene.clear(47.0, 11.0, time=np.datetime64("2024-06-01T10:00"), water_vapour_cm=4.0)
    image = openswim.render(scene, Camera.allsky(47.0, 11.0, size=4), Solver("swim"), wavelengths_nm=[900.0])
    assert "4.00 cm" in image.attrs["assumptions"]
