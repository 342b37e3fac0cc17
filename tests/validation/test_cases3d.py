"""3-D cases: axes, units, footprints and ground of a written file arrive unchanged at the solver."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray as xr
from tests.validation.fakes import FakeSolver

from openswim.errors import UserError
from openswim.scene.phase import HenyeyGreenstein
from openswim.validation.cases3d import _FINE_CELLS, _LENGTHS, case_scene, compare, in_kilometres, matches
from openswim.validation.reference import Reference
from openswim.validation.reference.phases import PhaseTables

SUN = np.array([-0.6, 0.0, 0.8])


def _case(tmp_path: Path, image: np.ndarray, **attributes: Any) -> Reference:
    """12 x 8 pixels looking down from 3 km, 0.1 km apart, over a field that differs along every axis."""
    i, j = np.meshgrid(np.arange(12.0), np.arange(8.0), indexing="ij")
    origin = np.stack([0.1 * i, 0.1 * j, np.full_like(i, 3.0)], axis=-1)
    direction = np.broadcast_to([0.0, 0.0, -1.0], origin.shape).copy()
    origin[11, 7] = direction[11, 7] = np.nan
    x, y, z = 0.1 * np.arange(6), 0.1 * np.arange(5), 0.5 + 0.1 * np.arange(4)
    field = 1.0 + x[:, None, None] + 10 * y[None, :, None] + 100 * z[None, None]
    data = xr.Dataset(
        {
            "radiance": (("i", "j", "surface_albedo"), image),
            "sigma": (("i", "j", "surface_albedo"), 0 * image),
            "ray_origin": (("i", "j", "xyz"), origin),
            "ray_direction": (("i", "j", "xyz"), direction),
            "pixel_u": ("xyz", [0.1, 0.0, 0.0]),
            "pixel_v": ("xyz", [0.0, 0.1, 0.0]),
            "sun_direction": ("xyz", SUN),
            "extinction": (("x", "y", "z"), field),
        },
        coords={"surface_albedo": [0.0, 0.3], "x": x, "y": y, "z": z},
        attrs={"geometry": "grid", "boundary": "open", "surface": "infinite Lambertian plane at z = 0"}
        | {"phase_function": "Henyey-Greenstein", "asymmetry_parameter": 0.8, "single_scattering_albedo": 0.9}
        | attributes,
    )
    return Reference(tmp_path / "any_name.nc", data)


def _plane(scene: Any, sun: np.ndarray, origin: np.ndarray, direction: np.ndarray) -> np.ndarray:
    """A radiance that is linear in place, quadratic in x across a pixel, and brighter over bright ground."""
    x, y = origin[:, 0] / 1000, origin[:, 1] / 1000
    return 1 + x + 2 * y + 40 * x**2 + float(scene.data["surface_albedo"].mean())


def _image() -> np.ndarray:
    """`_plane` averaged over the sub-rays of each pixel, per ground albedo."""
    x, y = 0.1 * np.arange(12.0)[:, None], 0.1 * np.arange(8.0)
    square = x**2 + 0.025**2  # mean of (x +- 0.025)^2
    image = np.stack([1 + x + 2 * y + 40 * square + albedo for albedo in (0.0, 0.3)], axis=-1)
    image[11, 7] = np.nan
    return image


def test_a_perfect_solver_scores_perfectly(tmp_path: Path) -> None:
    reference, solver = _case(tmp_path, _image()), FakeSolver(_plane)
    assert matches(reference)
    rows = list(compare(reference, solver, PhaseTables([])))
    assert [row.quantity for row in rows] == ["radiance, albedo 0", "radiance, albedo 0.3"]
    for row in rows:
        assert row.case == "any_name"
        assert row.n == 6  # 3 x 2 blocks
        assert row.relative_rmse < 1e-6
        assert row.correlation == pytest.approx(1.0)


def test_lengths_and_extinction_may_be_in_metres(tmp_path: Path) -> None:
    """They were taken for kilometres, whatever the file said."""
    plain, solver = _case(tmp_path, _image()), FakeSolver(_plane)
    data = plain.data
    for name, factor, units in (*((name, 1e3, "m") for name in _LENGTHS), ("extinction", 1e-3, "1/m")):
        data = data.assign({name: (factor * data[name]).assign_attrs(units=units)})
    metres = Reference(plain.path, data)
    for row in compare(metres, solver, PhaseTables([])):
        assert row.relative_rmse < 1e-6
    there, here = case_scene(plain, 0.0), case_scene(in_kilometres(metres), 0.0)
    np.testing.assert_allclose(here.data["extinction_cloud"], there.data["extinction_cloud"], rtol=1e-6)
    for name, units in (("x", "feet"), ("radiance", "W m-2 sr-1")):
        wrong = data.assign({name: data[name].assign_attrs(units=units)})
        with pytest.raises(UserError, match=f"any_name.nc: {name} is in '{units}': give"):
            in_kilometres(Reference(plain.path, wrong))


def test_the_scene_is_the_file_in_metres(tmp_path: Path) -> None:
    solver = FakeSolver(_plane)
    list(compare(_case(tmp_path, _image(), surface="plane z = 0.2"), solver, PhaseTables([])))
    scene = solver.scenes[1]
    assert scene.grid.x == pytest.approx(100.0 * np.arange(6))
    assert scene.grid.height_m == pytest.approx([500, 600, 700, 800])
    extinction = scene.data["extinction_cloud"].transpose("z", "y", "x").values
    assert extinction[2, 3, 1] == pytest.approx((1 + 0.1 + 10 * 0.3 + 100 * 0.7) / 1000)
    assert scene.optics["cloud"].phase == HenyeyGreenstein(0.8)
    assert scene.optics["cloud"].single_scattering_albedo == pytest.approx(0.9)
    assert scene.data["surface_albedo"].values == pytest.approx(0.3)
    assert scene.data["surface_altitude"].values == pytest.approx(200.0)
    assert not scene.grid.periodic


def test_a_repeated_side_of_a_periodic_field_is_dropped(tmp_path: Path) -> None:
    reference = _case(tmp_path, _image(), boundary="periodic in x and y")
    reference.data.extinction[{"x": -1}] = reference.data.extinction[{"x": 0}]
    solver = FakeSolver(_plane)
    list(compare(reference, solver, PhaseTables([])))
    assert solver.scenes[0].grid.periodic
    assert solver.scenes[0].grid.shape == (4, 5, 5)


def test_a_sphere_in_words_becomes_a_field(tmp_path: Path) -> None:
    reference = _case(tmp_path, _image(), geometry="sphere: centre (0.2,0,1) km radius 0.3 extinction 15/km")
    solver = FakeSolver(_plane)
    list(
        compare(Reference(reference.path, reference.data.drop_dims(["x", "y", "z"])), solver, PhaseTables([]))
    )
    scene = solver.scenes[0]
    extinction = scene.data["extinction_cloud"].values
    dx, dy = scene.grid.spacing_m()
    volume = extinction.sum() / 0.015 * dx * dy * np.diff(scene.grid.height_m)[0]
    assert volume == pytest.approx(4 / 3 * np.pi * 300.0**3, rel=2e-3)
    assert len(solver.rays) == 2 * 9  # 3x3 sub-rays of a sharp-edged body, two grounds


@pytest.mark.parametrize("edge_km", [0.1, 1.0])
def test_a_box_in_words_becomes_the_field_that_reference_asks_for(tmp_path: Path, edge_km: float) -> None:
    """However fine its cells, its depth across is edge times extinction."""
    reference = _case(tmp_path, _image(), geometry=f"cube: centre (0,0,1) km edge {edge_km} km extinction 20/km")
    words = Reference(reference.path, reference.data.drop_dims(["x", "y", "z"]))
    scene = case_scene(words, 0.0, _FINE_CELLS)
    assert scene.grid is not None
    depth = np.trapezoid(scene.data["extinction_cloud"].values, scene.grid.height_m, axis=0)
    np.testing.assert_allclose(depth, 20.0 * edge_km, rtol=3e-4)
