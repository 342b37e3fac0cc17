"""The linear core of a scene: droplets by Mie, ice, air, haze, a hill, a curved Earth, two wavelengths."""

import numpy as np
import pytest
from pyproj import CRS

import openswim
from openswim.cameras import Camera, Rays
from openswim.errors import UserError
from openswim.scene import Scene
from openswim.scene.atmosphere import Atmosphere
from openswim.solver import Solver

WAVELENGTHS_NM = [650.0, 450.0]
SUN = np.array([0.45, 0.46, 0.77])
_CRS = CRS.from_proj4("+proj=lcc +lat_1=30 +lat_2=50 +lat_0=40 +lon_0=10 +R=6371000")


def _scene(**more):
    """A cloud of droplets under a veil of ice, over a hill."""
    nz, ny, nx = shape = (10, 16, 15)
    z, y, x = np.meshgrid(*(np.arange(n) / (n - 1) - 0.5 for n in shape), indexing="ij")
    lump = np.exp(-((z / 0.2) ** 2 + (y / 0.16) ** 2 + (x / 0.16) ** 2))
    veil = np.exp(-(((z - 0.4) / 0.08) ** 2 + ((y + 0.1) / 0.2) ** 2 + (x / 0.2) ** 2))
    fields = {
        "liquid_content": 3e-5 * np.where(lump > 0.05, lump, 0.0), "ice_content": 2e-6 * np.where(veil > 0.05, veil, 0),
        "liquid_effective_radius": np.full(shape, 8e-6), "ice_effective_radius": np.full(shape, 30e-6),
    }  # fmt: skip
    hill = 250 * np.exp(-((y[0] + 0.25) ** 2 + (x[0] - 0.25) ** 2) / 0.03)
    given = {"crs": _CRS, "surface_albedo": 0.2, "atmosphere": Atmosphere.us_standard(), "terrain_m": hill} | more
    return Scene.from_arrays(
        None, 150 * (np.arange(nx) - 7.0), 150 * (np.arange(ny) - 7.5), 100.0 * np.arange(nz), fields=fields, **given
    )


def _eyes():
    u, v = np.meshgrid(*(2 * [(np.arange(16) + 0.5) / 8 - 1]))
    r = np.hypot(u, v)
    zenith, azimuth = np.radians(70) * r[r <= 1], np.arctan2(v, u)[r <= 1]
    up = np.column_stack([np.sin(zenith) * np.cos(azimuth), np.sin(zenith) * np.sin(azimuth), np.cos(zenith)])
    down = -np.array([0.2, 0.3, 0.87**0.5])
    ends = np.stack(np.meshgrid(np.linspace(-700, 700, 12), np.linspace(-700, 700, 12), 0.0), axis=-1).reshape(-1, 3)
    return [Rays(np.array([-400.0, 300.0, 5.0]), up), Rays(ends - 50_000 * down, down)]


@pytest.fixture(scope="module")
def linearised():
    core = Solver("linear").linear_core(_scene(), SUN, WAVELENGTHS_NM, _eyes(), [[40.0, 10.0], [40.003, 9.998]], 1e-4)
    images, state = core.forward(core.extinction, core.albedo)
    return core, images, state


@pytest.fixture(scope="module")
def solved():
    return Solver("fast", tolerance=2e-3, detail=False).solve(_scene(), SUN, WAVELENGTHS_NM)


def test_images_are_those_of_fast(linearised, solved):
    core, images, _ = linearised
    assert core.names == ("liquid", "ice", "air_molecules", "background_aerosol")
    sun = SUN / np.linalg.norm(SUN)
    for n, (rays, bound) in enumerate(zip(_eyes(), (0.02, 0.011), strict=True)):
        aside = rays.directions() @ sun < np.cos(np.radians(10))
        wanted = solved.view(rays).radiance[aside].T.astype(float)
        for own, theirs in zip(images.radiance[n][:, aside], wanted, strict=True):
            assert np.sqrt(((own - theirs) ** 2).mean()) < bound * theirs.mean()
            assert abs(own.mean() / theirs.mean() - 1) < 0.009
            assert np.corrcoef(own, theirs)[0, 1] > 0.998
    lighting = solved.lit[0].lighting
    for w in range(2):
        of_columns = np.ravel(lighting.direct_horizontal(w) + lighting.diffuse[w])
        wanted = (of_columns[core._columns] * core._shares).sum(axis=1)
        assert np.abs(images.ghi[w] / wanted - 1).max() < 0.004


def test_fewer_ordinates_see_the_same_from_below_and_too_much_from_above(solved):
    core = Solver("linear").linear_core(_scene(), SUN, WAVELENGTHS_NM, _eyes(), lean=True)
    assert (len(core.world.weight), core.world.degree) == (26, 4)
    images, _ = core.forward(core.extinction, core.albedo)
    for n, (rays, bound) in enumerate(zip(_eyes(), (0.019, 0.088), strict=True)):
        aside = rays.directions() @ (SUN / np.linalg.norm(SUN)) < np.cos(np.radians(10))
        wanted = solved.view(rays).radiance[aside].T.astype(float)
        for own, theirs in zip(images.radiance[n][:, aside], wanted, strict=True):
            assert np.sqrt(((own - theirs) ** 2).mean()) < bound * theirs.mean()
            assert np.corrcoef(own, theirs)[0, 1] > 0.989


def test_tangent_and_adjoint_are_transposed(linearised):
    core, _, state = linearised
    rng = np.random.default_rng(1)
    change = 0.1 * rng.standard_normal(core.extinction.shape) * core.extinction.max(axis=(2, 3, 4), keepdims=True)
    of_ground = 0.1 * rng.standard_normal(core.albedo.shape)
    found = core.tangent(state, change, of_ground, 1e-14)
    residual = found.like(rng.standard_normal(found.flat().size))
    bar, ground_bar = core.adjoint(state, residual, 1e-14)
    products = found.flat() * residual.flat()
    apart = abs(products.sum() - (change * bar).sum() - (of_ground * ground_bar).sum())
    assert apart < 1e-12 * np.abs(products).sum()


def test_fields_of_the_scene_are_drawn_linearly(linearised):
    core = linearised[0]
    rng = np.random.default_rng(2)
    own = rng.standard_normal((2, 10, 16, 15))
    bar = rng.standard_normal((2, *core.shape))
    drawn = core.drawn.to_nodes(own)
    assert (drawn * bar).sum() == pytest.approx((own * core.drawn.from_nodes(bar)).sum(), rel=1e-12)
    theirs, above = core.medium.extinction[0], np.arange(core.shape[0])[:, None, None] >= core.medium.ground_node
    mine = core.extinction[0, 0] / core.medium.species[0].relative_extinction[0]
    assert np.allclose(mine[above], theirs[above], rtol=1e-5, atol=1e-9)


def test_the_solver_lights_and_renders_alone(tmp_path):
    scene, camera = _scene(), Camera.allsky(40.002, 9.998, size=12)
    solvers = ("linear", Solver("fast", detail=False))
    lit = [openswim.light(scene, solver, WAVELENGTHS_NM[:1], sun=(45.0, 50.0)) for solver in solvers]
    own, theirs = (one.viewpoint(camera).view() for one in lit)
    assert own.attrs["solver"] == "linear"
    seen = np.isfinite(theirs.radiance.values)
    assert (np.isfinite(own.radiance.values) == seen).all()
    apart = (own.radiance.values - theirs.radiance.values)[seen]
    assert np.sqrt((apart**2).mean()) < 0.006 * theirs.radiance.values[seen].mean()
    with pytest.raises(UserError, match="keeps no light"):
        lit[0].save(tmp_path / "light")


@pytest.mark.parametrize(
    ("given", "named"),
    [
        ({"views": [Camera.allsky(40.0, 10.0, size=4)]}, r"a view is .*: give Rays, as camera.rays\(scene_frame"),
        ({"views": Camera.allsky(40.0, 10.0, size=4)}, "views is .*: give Rays or a list"),
        ({"points": (40.0, 10.0)}, r"points have shape \(2,\): give \(n, 2\), latitude and longitude"),
        ({"points": [(50.0, 10.0)]}, "pyranometer at 50, 10 is outside of the grid"),
        ({"sun_direction": [0, 0, 0]}, r"sun_direction is \[0, 0, 0\]: give a unit vector"),
        ({"sun_direction": [0, 0, 2]}, "give a unit vector"),
        ({"sun_direction": [0, np.nan, 1]}, "give a unit vector"),
        ({"sun_direction": (180, 45)}, "give a unit vector"),
        ({"sun_direction": "up"}, "sun_direction must be numbers"),
    ],
)
def test_what_the_core_is_called_with_is_looked_at(given, named):
    with pytest.raises(UserError, match=named):
        Solver("linear").linear_core(**{"scene": _scene(), "sun_direction": SUN, "wavelengths_nm": [650.0]} | given)
    if "sun_direction" in given:
        with pytest.raises(UserError, match=named):
            Solver("fast").solve(_scene(), given["sun_direction"])


def test_what_the_core_does_not_follow_is_refused():
    with pytest.raises(UserError, match="the sun is below"):
        Solver("linear").linear_core(_scene(), [1.0, 0.0, 0.01], WAVELENGTHS_NM)
    periodic = _scene(crs=None, periodic=True, terrain_m=None, atmosphere=None)
    with pytest.raises(UserError, match=r"periods.*analyses need a single grid"):
        Solver("linear").linear_core(periodic, SUN, WAVELENGTHS_NM)
    z, x = np.arange(0.0, 3e3, 500.0), 3e3 * np.arange(6)  # as the file has them, not as they would be divided
    wide = Scene.from_arrays({"cloud": np.full((6, 6, 6), 1e-3)}, x, x, z, crs=_CRS, surface_albedo=0.2)
    with pytest.raises(UserError, match=r"6 x 6 columns of 30\d\d m are too wide"):
        Solver("linear").linear_core(wide, SUN, WAVELENGTHS_NM)
    with pytest.raises(UserError, match="knows no eclipse"):
        Solver("linear").solve(_scene(), SUN, shadow=object())
    with pytest.raises(UserError, match="follows no light from the night's sky"):
        Solver("linear").solve_starlit(_scene())


def test_a_linear_solver_s_tolerance_is_its_core_s():
    """Only that of a solver of this name: fast's is of another kind."""
    cores = {
        (name, given): Solver(name, tolerance=2e-4).linear_core(_scene(), SUN, WAVELENGTHS_NM, tolerance=given)
        for name in ("linear", "fast")
        for given in (None, 5e-4)
    }
    assert {key: core.tolerance for key, core in cores.items()} == {
        ("linear", None): 2e-4, ("linear", 5e-4): 5e-4, ("fast", None): 1e-3, ("fast", 5e-4): 5e-4,
    }  # fmt: skip
