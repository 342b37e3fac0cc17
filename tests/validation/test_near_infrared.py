"""Clouds at 1.6 um against discrete ordinates, with single scattering by another's Mie code and index of water."""

import numpy as np
import pytest
import xarray as xr

from openswim import Scene, Solver
from openswim.optics import hydrometeors
from openswim.scene.grid import Grid
from openswim.validation.slabs import flux, radiance

# Effective radius (um), optical depth at 550 nm, cosine of the sun's zenith angle; share of the sun's flux that a cloud
# over black ground sends up at 1610 nm, and pi L / (mu0 E) seen from straight above: PythonicDISORT 1.8 (48 streams,
# delta-M, Nakajima-Tanaka) with miepython 3.3 and the index 1.317 (Hale & Querry 1973) - 8.85e-5i (Segelstein 1981).
TRUTH = [
    (6, 5, 0.5, 0.4939, 0.2935), (6, 5, 0.87, 0.3377, 0.3048), (6, 20, 0.5, 0.7022, 0.5510),
    (6, 20, 0.87, 0.6154, 0.6492), (12, 5, 0.5, 0.4300, 0.2351), (12, 5, 0.87, 0.2711, 0.2339),
    (12, 20, 0.5, 0.6049, 0.4487), (12, 20, 0.87, 0.5034, 0.5197), (20, 5, 0.5, 0.3873, 0.1956),
    (20, 5, 0.87, 0.2311, 0.1824), (20, 20, 0.5, 0.5338, 0.3731), (20, 20, 0.87, 0.4255, 0.4208),
]  # fmt: skip
THICKNESS_M, LEVELS = 1000.0, 65


def cloud(radius_um, tau):
    """A layer of droplets of one size from the ground to 1 km, without air."""
    radius_m = radius_um * 1e-6
    extinction = tau / THICKNESS_M / hydrometeors.extinction_factor("liquid", 550.0, radius_m)
    content = float(extinction) * radius_m * 1000.0 / 1.5
    shape = (LEVELS, 4, 4)
    dims, step = ("z", "y", "x"), THICKNESS_M / (LEVELS - 1)
    grid = Grid(step * np.arange(4), step * np.arange(4), step * np.arange(LEVELS), periodic=True)
    fields = {"liquid_content": content, "liquid_effective_radius": radius_m}
    return Scene(grid, xr.Dataset({n: (dims, np.full(shape, v, np.float32)) for n, v in fields.items()}))


def reflected(radius_um, tau, mu0):
    sun = np.array([np.sqrt(1 - mu0**2), 0.0, mu0])
    solved = Solver(detail=False).solve(cloud(radius_um, tau), sun, [1610.0])
    up, _ = flux(solved, "up_top", per=mu0)
    above, _ = radiance(solved, np.array([0.0]), np.array([0.0]), upward=True)
    return up, float(above[0]) / (4 * mu0)


@pytest.mark.slow
def test_clouds_at_1610_nm():
    """Reflected flux within 1.3 %, radiance from above within 4 % root mean square (6 % in a bow)."""
    found = np.array([reflected(*case[:3]) for case in TRUTH])
    error = found / np.array(TRUTH)[:, 3:] - 1
    assert np.abs(error[:, 0]).max() < 0.013
    assert np.sqrt((error[:, 1] ** 2).mean()) < 0.041
