"""Clear skies: angles of the reference files against spherical trigonometry, paths against the sphere."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray as xr
from tests.validation.fakes import FakeSolver

from openswim.validation import clearsky
from openswim.validation.reference import Reference
from openswim.validation.reference.phases import PhaseTables

RADIUS_M = 6_371_000.0
NO_TABLES = PhaseTables([])


def _forward(scene: Any, sun: np.ndarray, origin: np.ndarray, direction: np.ndarray) -> np.ndarray:
    return 2 + direction @ sun


def _radii(points: np.ndarray) -> np.ndarray:
    """Distances from the centre of the Earth, which lies one radius below the frame's origin."""
    return np.linalg.norm(points + np.array([0.0, 0.0, RADIUS_M]), axis=-1)


def _closest(origin: np.ndarray, direction: np.ndarray) -> np.ndarray:
    """Points of the lines that are nearest to the Earth's centre."""
    from_centre = origin + np.array([0.0, 0.0, RADIUS_M])
    return origin - np.sum(from_centre * direction, axis=-1, keepdims=True) * direction


def _cosine(sza: float, zenith: np.ndarray, azimuth: np.ndarray) -> np.ndarray:
    s, z, a = np.radians(sza), np.radians(zenith), np.radians(azimuth)
    return np.cos(s) * np.cos(z) + np.sin(s) * np.sin(z) * np.cos(a)


def _table(**columns: Any) -> Reference:
    size = max(np.size(values) for values in columns.values())
    data = xr.Dataset({name: ("row", np.broadcast_to(values, size)) for name, values in columns.items()})
    return Reference(Path("some_sky.csv"), data)


def test_the_sky_from_the_ground_and_the_air() -> None:
    zenith, azimuth = np.array([0.0, 40.0, 88.0, 120.0]), np.array([0.0, 60.0, 180.0])
    z, a = np.meshgrid(zenith, azimuth, indexing="ij")
    truth = np.stack([2 + _cosine(sza, z, a) for sza in (30.0, 70.0)])[:, None] * np.ones((1, 2, 1, 1))
    data = xr.Dataset(
        {
            "Lp_ground": (("case", "wavelength", "vza_ground", "raa"), truth[:, :, :3]),
            "Lp_10km": (("case", "wavelength", "vza_10km", "raa"), truth),
            "case_sza": ("case", [30.0, 70.0]),
            "case_aod550": ("case", [0.0, 0.3]),
            "case_albedo": ("case", [0.1, 0.0]),
        },
        coords={"wavelength": [450.0, 615.0], "vza_ground": zenith[:3], "vza_10km": zenith, "raa": azimuth},
    )
    reference, solver = Reference(Path("a_sky.nc"), data), FakeSolver(_forward)
    assert clearsky.is_sky_file(reference)
    rows = list(clearsky.compare_sky_file(reference, solver, NO_TABLES))
    assert len(rows) == 2 * 2 * 2
    assert max(row.relative_rmse for row in rows) < 1e-9
    assert "radiance from 10km, 615 nm, sza 70" in {row.quantity for row in rows}
    heights = [_radii(origin) - RADIUS_M for origin, _ in solver.rays]
    assert heights[0] == pytest.approx(1.0, abs=1e-3)
    assert heights[1] == pytest.approx(10_000.0, abs=1e-3)
    assert solver.scenes[0].atmosphere.aerosol is None
    assert solver.scenes[1].atmosphere.aerosol.optical_depth == pytest.approx(0.3)


def test_a_table_of_low_suns_and_a_zenith_only_one() -> None:
    zenith, azimuth = np.array([0.0, 60.0, 88.0]), np.array([0.0, 120.0, 180.0])
    angles = {"sza": 88.0, "aod550": 0.1, "albedo": 0.1, "wl": [450.0, 546.0, 450.0]}
    truth = 2 + _cosine(88.0, zenith, azimuth)
    reference = _table(**angles, obs_alt_m=2600.0, vza=zenith, raa=azimuth, Lp=truth, Lp_stderr=0.0)
    assert clearsky.is_sky_table(reference)
    rows = list(clearsky.compare_sky_table(reference, FakeSolver(_forward), NO_TABLES))
    assert [row.n for row in rows] == [2, 1]
    assert max(row.relative_rmse for row in rows) < 1e-9


def test_a_table_of_zeniths_leaves_out_what_is_noise() -> None:
    truth = 2 + np.cos(np.radians([88.0, 88.0, 101.0]))
    noise = np.array([0.01, 0.09, 0.11]) * truth
    overhead = _table(
        sza=[88.0, 88.0, 101.0], aod550=0.0, albedo=0.1, wl=[450.0, 546.0, 450.0], Lp=truth, Lp_stderr=noise
    )
    (row,) = clearsky.compare_sky_table(overhead, FakeSolver(_forward), NO_TABLES)
    assert row.quantity == "radiance from 0 km, zenith, sza 88"
    assert row.relative_rmse == 0
    assert row.n == 2


def test_views_from_space_meet_the_place_and_the_tangent_height() -> None:
    azimuth = np.array([0.0, 90.0, 180.0, 0.0, 150.0])
    kind = np.array(["nadir", "nadir", "nadir", "limb", "limb"])
    what = np.array([50.0, 20.0, 70.0, 15.0, 60.0])
    nadir = 2 - _cosine(60.0, what, azimuth + 180.0)  # the line of sight is against the light that goes up
    limb = 2 + np.sin(np.radians(60.0)) * np.cos(np.radians(azimuth))
    truth = np.where(kind == "nadir", nadir, limb)
    reference = _table(
        kind=kind, sza=60.0, aod550=0.0, albedo=0.1, wl=546.0, vza_or_tangent_km=what, raa=azimuth, Lp=truth
    )
    assert clearsky.is_space_table(reference)
    assert not clearsky.is_sky_table(reference)
    solver = FakeSolver(_forward)
    rows = list(clearsky.compare_space_table(reference, solver, NO_TABLES))
    assert {row.quantity.split(" ")[0] for row in rows} == {"nadir", "limb"}
    assert max(row.relative_rmse for row in rows) < 1e-9

    origins, directions = (np.concatenate(each) for each in zip(*solver.rays, strict=True))  # asked one by one
    ground_from, limb_from = origins[: kind.size], origins[kind.size :]
    ground_along, limb_along = directions[: kind.size], directions[kind.size :]
    for origin in (ground_from, limb_from):
        assert _radii(origin) == pytest.approx(RADIUS_M + 800_000.0, rel=1e-9)
    down = ground_along[kind == "nadir"]
    place = (
        -np.array([0.0, 0.0, 0.0]) - ground_from[kind == "nadir"]
    )  # the frame's origin is the ground point
    assert np.cross(place, down) == pytest.approx(0.0, abs=1.0)
    tangent = _closest(limb_from, limb_along)
    assert _radii(tangent) - RADIUS_M == pytest.approx([15_000.0, 60_000.0], abs=1e-2)
    assert tangent[:, :2] == pytest.approx(0.0, abs=1e-2)
    assert np.sum((tangent - limb_from) * limb_along, axis=-1).min() > 0
