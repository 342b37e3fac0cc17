"""The observation operator on a plain core: all of its own chain is exact."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import xarray as xr
from scipy.sparse.linalg import lsqr
from tests.assimilation.toy import cloud, flat_scene, toy_core

from openswim import Camera, UserError
from openswim.assimilation import observe
from openswim.assimilation.observing.observations import check_observed

SUN = (140.0, 50.0)
CAMERAS = [Camera.allsky(x_m=200.0, y_m=260.0, size=9, fov_deg=150.0),
           Camera.perspective(x_m=450.0, y_m=100.0, azimuth_deg=300.0, altitude_deg=40.0, size=(6, 8))]  # fmt: skip
POINTS = [(200.0, 300.0), (250.0, 100.0)]


def operator(quantity="radiance", controls=("extinction_cloud", "albedo", "scale"), wavelengths=(550.0, 650.0)):
    scene = flat_scene()
    core = toy_core(scene, CAMERAS, POINTS, len(wavelengths))
    return observe(scene, CAMERAS, POINTS, wavelengths, sun=SUN, controls=controls, quantity=quantity, core=core)


@pytest.mark.parametrize("quantity", ["radiance", "log_radiance", "reflectance_factor", "ratio"])
def test_the_four_tests_of_a_linearisation(quantity: str) -> None:
    op = operator(quantity)
    found = op.linearize(op.first()).check()
    assert found.zero == 0
    assert found.linear < 1e-14
    assert found.dot < 1e-14
    first, second, third = found.remainder
    assert second < 0.11 * first
    assert third < 0.11 * second
    assert found.passed()
    assert "dot product" in str(found)


def test_values_are_those_of_the_light() -> None:
    op = operator()
    lin = op.linearize(op.first())
    light = lin.images.radiance[0]
    sky, tilted = op.pictures(lin.value)
    assert sky.shape == (9, 9, 2)
    assert tilted.shape == (6, 8, 2)
    inside = op.instruments[0].inside
    want = light[0] * op.instruments[0].quantity.toa[0] / (4 * np.pi)
    assert np.allclose(sky.values[inside, 0], want, rtol=1e-12)
    assert np.isnan(sky.values[~inside]).all()
    assert op.irradiance_w_m2(lin.value).shape == (2,)
    # all the sun's light falls on a black ground below clear air that absorbs nothing
    assert op.watts[:, 0].sum() == pytest.approx(1361.1 * 0.987 / op.daylight.distance_au**2, rel=2e-3)


def test_jacobian_rows_are_gradients() -> None:
    op = operator()
    lin = op.linearize(op.first())
    rows = lin.jacobian([3, op.size - 1])
    change = 0 * lin.state
    change["extinction_cloud"][4, 5, 6] = 1.0
    column = lin.jvp(change).values
    assert np.allclose(rows["extinction_cloud"][:, 4, 5, 6], column[[3, -1]], rtol=1e-12)


def test_a_state_that_was_changed_since_is_an_error() -> None:
    op = operator()
    state = op.first()
    lin = op.linearize(state)
    lin.vjp(lin.value)
    state["extinction_cloud"][3, 3, 3] += 1e-3
    with pytest.raises(UserError, match="linearize again"):
        lin.vjp(lin.value)


def test_nothing_is_below_the_floor_and_nothing_changes_elsewhere() -> None:
    op = operator(controls=("extinction_cloud",))
    state = op.first()
    where = op.controls.where
    assert state["extinction_cloud"].values[where].min() == op.controls.floor_per_m
    assert (state["extinction_cloud"].values[~where] == 0).all()
    assert where.any()
    assert not where.all()
    below = state - 1.0
    assert np.array_equal(op(below), op(0 * state))  # less than nothing is nothing
    bars = op.linearize(state).vjp(np.ones(op.size))
    assert (bars["extinction_cloud"].values[~where] == 0).all()


def test_scipy_takes_it() -> None:
    op = operator()
    lin = op.linearize(op.first())
    matrix = lin.as_linear_operator()
    found = lsqr(matrix, np.ones(op.size), iter_lim=3)
    assert found[3] < np.sqrt(op.size)


def test_an_ensemble_is_member_by_member() -> None:
    op = operator()
    states = [op.first(), op.first() * 1.5]
    rows = op.ensemble(states)
    assert rows.dims == ("member", "observation")
    assert np.array_equal(rows[1], op(states[1]))
    with pytest.raises(UserError, match="no states"):
        op.ensemble([])


def test_pixels_near_the_sun_and_low_ones_are_not_used() -> None:
    op = operator()
    each = op.instruments[0]
    pixels = each.camera.pixels()
    angle = pixels.angle_to_deg(*SUN)[each.inside]
    assert not each.usable[angle < 10].any()
    assert each.usable[(angle > 10) & (pixels.altitude_deg[each.inside] > 5)].all()


def test_mass_content_with_its_own_radius() -> None:
    """d beta/beta = dq/q - dr/r away from what Mie theory adds, and a clamp of the radius has no slope."""
    field = cloud()
    radius = np.where(field > 0, 1.03e-5, 0.0)  # between the knots of the table of Mie theory
    radius[4, 5, 6] = 1e-4  # beyond the largest droplets there are
    scene = flat_scene(0 * field, fields={"liquid_content": field * 1e-2, "liquid_effective_radius": radius})
    scene = type(scene)(scene.grid, scene.data.drop_vars("extinction_cloud"), scene.atmosphere)
    core = toy_core(scene, CAMERAS, POINTS)
    op = observe(scene, CAMERAS, POINTS, sun=SUN, controls=("cloud_liquid", "liquid_effective_radius"), core=core)
    state = op.controls.lifted(op.first())
    beta, slopes = op.controls.fill(state).extinction["liquid"], op.controls.slopes(state)
    thick = (field > 1e-3) & op.controls.where
    thick[4, 5, 6] = False
    relative = {name: (slopes[name] * state[name].values)[thick] / beta[thick] for name in slopes}
    assert np.allclose(relative["liquid_content"], 1.0, rtol=1e-6)
    assert np.allclose(relative["liquid_effective_radius"], -1.0, atol=0.05)
    assert slopes["liquid_effective_radius"][4, 5, 6] == 0
    found = op.linearize(op.first()).check()
    assert found.dot < 1e-14
    assert found.remainder[-1] < 1e-3
    floor = op.controls.floors["liquid_content"]
    assert np.allclose(op.controls.particles("liquid").extinction_per_m(content=floor), 2e-5, rtol=1e-6)


def test_number_raises_extinction_by_its_cube_root() -> None:
    field = cloud()
    fields = {"liquid_content": field * 1e-2, "liquid_number": np.full(field.shape, 1e8)}
    scene = flat_scene(0 * field, fields=fields)
    scene = type(scene)(scene.grid, scene.data.drop_vars("extinction_cloud"), scene.atmosphere)
    core = toy_core(scene, CAMERAS, POINTS)
    op = observe(scene, CAMERAS, POINTS, sun=SUN, controls=("cloud_liquid", "liquid_number"), core=core)
    assert core.names == ("liquid, small", "liquid, large")  # which share what a state holds as the scene's do
    state = op.first()
    beta, slopes = op.controls.fill(state).extinction["liquid"], op.controls.slopes(state)
    assert np.allclose(op.filled(op.controls.fill(state))[0].sum(axis=1)[0], beta, rtol=1e-6)
    thick = (field > 5e-3) & op.controls.where
    for name, power in (("liquid_content", 2 / 3), ("liquid_number", 1 / 3)):
        relative = (slopes[name] * state[name].values)[thick] / beta[thick]
        assert np.allclose(relative, power, atol=0.02), name
    assert op.linearize(state).check().remainder[-1] < 1e-3


def test_wrong_requests_are_one_line() -> None:
    scene, core = flat_scene(), toy_core(flat_scene(), CAMERAS, POINTS)
    for words, match in (
        ({"controls": ("cloud_liqid",)}, "did you mean cloud_liquid"),
        ({"controls": ("cloud_liquid",)}, "has no liquid_content; controls that it has: extinction_cloud, albedo"),
        ({"controls": ()}, "missing"),
        ({"quantity": "colour"}, "unknown"),
        ({"sun": (140.0, -5.0)}, "sun is down"),
        ({"heights_m": (5000.0, 6000.0)}, "no node"),
        ({"floor_per_km": 0.0}, "small positive"),
        ({"where": np.ones((2, 2, 2))}, "where has shape"),
        ({"where": np.zeros((8, 10, 12))}, "nowhere true"),
        ({"where": "cloud"}, "must be numbers"),
        ({"wavelengths_nm": ["red"]}, "must be numbers"),
        ({"wavelengths_nm": [550.0, 550.0]}, "give each once"),
        ({"heights_m": 500.0}, "lowest, highest"),
        ({"heights_m": ("a", "b")}, "must be numbers"),
        ({"controls": 3}, "controls is 3: give a list"),
        ({"quantity": 3}, "quantity is 3: give text or a list"),
        ({"quantity": ["radiance"]}, "1 quantities"),
        ({"tolerance": "small"}, "tolerance is 'small': give a number"),
        ({"tolerance": 0.0}, "small positive"),
        ({"irradiance": [(1e6, 0.0)]}, "pyranometer at 1e.06, 0 is outside the domain: choose x in"),
    ):
        given = {"sun": SUN, "controls": ("extinction_cloud",), "irradiance": POINTS, **words}
        with pytest.raises(UserError, match=match):
            observe(scene, CAMERAS, core=core, **given)
    op = operator()
    with pytest.raises(UserError, match="is missing"):
        op(xr.Dataset())
    with pytest.raises(UserError, match="give"):
        op(op.first().isel(z=slice(0, 2)))
    with pytest.raises(UserError, match="no numbers"):
        op(op.first() * np.nan)
    with pytest.raises(UserError, match="Dataset such as"):
        op(3)
    with pytest.raises(UserError, match="like a state"):
        op.linearize(op.first()).jvp(np.zeros(3))
    with pytest.raises(UserError, match="cameras is 3"):
        observe(scene, 3, sun=SUN, core=core)
    images = [image.values for image in op.pictures(op(op.first()))]
    for given, match in (
        ({"noise": -0.1}, "share of 0 or more"),
        ({"representation": "much"}, "must be numbers"),
        ({"representation": [0.1]}, "for each of 2"),
        ({"saturated": "white"}, "must be a number"),
        ({"use": [np.zeros((9, 9)), None]}, "no pixel of camera 0"),
        ({"use": [None, np.ones((9, 9))]}, r"use of camera 1 is \(9, 9\); give \(6, 8\)"),
        ({"irradiance_w_m2": [0.5, 0.6]}, "is it in kW m-2"),
    ):
        with pytest.raises(UserError, match=match):
            op.observations(images, **{"irradiance_w_m2": [500.0, 600.0]} | given)


def test_what_a_linearisation_is_not_asked_is_one_line() -> None:
    op = operator()
    lin = op.linearize(op.first())
    cloud_alone, ground = op.first()[["extinction_cloud"]], op.first()[["surface_albedo"]]
    for call, match in (
        (lambda: lin.jvp(cloud_alone.rename(extinction_cloud="extinction_fog")), "'extinction_fog' is no control"),
        (lambda: lin.jvp(op.first().assign(fog=("q", np.zeros(3)))), "'fog' is no control: those of this operator are"),
        (lambda: lin.jvp(ground.isel(y=slice(0, 2))), "change: surface_albedo is"),
        (lambda: lin.jvp(np.nan * cloud_alone), "change: extinction_cloud has values"),
        (lambda: lin.jacobian([10**6]), f"no observation 1000000: they are numbered from 0 to {op.size - 1}"),
        (lambda: lin.jacobian([0.5]), "whole number"),
        (lambda: lin.jacobian(3), "by their numbers"),
        (lambda: lin.jacobian([]), "by their numbers"),
        (lambda: lin.vjp(np.full(op.size, np.nan)), "vjp: bar has values that are no numbers"),
        (lambda: lin.vjp("all"), "must be numbers"),
        (lambda: lin.vjp(np.zeros(3)), "this operator has"),
    ):
        with pytest.raises(UserError, match=match):
            call()
    parts = [lin.jvp(part) for part in (cloud_alone, ground)]
    assert np.allclose(sum(parts), lin.jvp(op.first()[["extinction_cloud", "surface_albedo"]]), rtol=1e-12)
    row = lin.jacobian([op.size - 1])["extinction_cloud"]
    assert np.array_equal(row, lin.jacobian([-1])["extinction_cloud"])


def test_states_and_rows_of_another_shape_are_one_line() -> None:
    op = operator()
    state, row = op.first(), op(op.first())
    assert all(np.array_equal(op.unpacked(op.packed(state))[name], state[name]) for name in state)
    turned = state.transpose("x", ...)
    assert np.array_equal(op.packed(turned), op.packed(state))
    for call, match in (
        (lambda: op.packed(state.drop_vars("camera_scale")), "state: camera_scale is missing"),
        (lambda: op.packed(state.isel(z=slice(0, 2))), "state: extinction_cloud is"),
        (lambda: op.packed(row), "state is .*: give an xarray.Dataset"),
        (lambda: op.unpacked(op.packed(state)[:-1]), r"unpacked: the row has shape \(\d+,\); the controls"),
        (lambda: op.unpacked(np.append(op.packed(state), 0)), "unpacked: the row has shape"),
        (lambda: op.unpacked("all"), "unpacked: row must be numbers"),
        (lambda: op.pictures(row[:-1]), "this operator has"),
        (lambda: op.irradiance_w_m2(np.append(row, 0.0)), "this operator has"),
    ):
        with pytest.raises(UserError, match=match):
            call()


def test_albedo_alone_may_change_below_clear_air() -> None:
    clear = flat_scene(0 * cloud())
    op = observe(clear, CAMERAS, POINTS, sun=SUN, controls="albedo", core=toy_core(flat_scene(), CAMERAS, POINTS))
    assert list(op.first()) == ["surface_albedo"]
    assert op.linearize(op.first()).check().passed()


def test_all_controls_and_kinds_of_observations_together() -> None:
    """Contents, sizes, numbers, extinction, the aerosol's factor, albedo and scales, by four quantities and watts."""
    field, rng = cloud(), np.random.default_rng(1)
    some = field > 0
    fields = {
        "liquid_content": 1e-2 * field, "liquid_number": np.where(some, 1e8, 0.0),
        "ice_content": 2e-2 * field, "ice_effective_radius": np.where(some, 3.1e-5, 0.0),
        "aerosol_extinction": 1e-4 * (0.5 + rng.random(field.shape)),
    }  # fmt: skip
    scene = flat_scene(0.3 * field, fields=fields)
    cameras = [*CAMERAS, *(type(one)(**{**one.__dict__, "x_m": one.x_m + 40.0}) for one in CAMERAS)]
    controls = ("cloud_liquid", "liquid_number", "cloud_ice", "ice_effective_radius", "extinction_cloud",
                "aerosol_factor", "albedo", "scale")  # fmt: skip
    quantities = ["radiance", "log_radiance", "reflectance_factor", "ratio"]
    op = observe(scene, cameras, POINTS, (550.0, 650.0), sun=SUN, controls=controls, quantity=quantities,
                 core=toy_core(scene, cameras, POINTS, 2))  # fmt: skip
    state = op.first()
    state["camera_scale"].values[:] = 0.8 + 0.4 * rng.random((4, 2))
    state["aerosol_factor"] = 1.3 + 0 * state["aerosol_factor"]
    lin = op.linearize(state)
    found = lin.check()
    assert found.zero == 0
    assert found.linear < 1e-13
    assert found.dot < 1e-13
    assert found.remainder[-1] < 0.11 * found.remainder[-2] < 0.013 * found.remainder[-3]
    row = rng.standard_normal(op.size)
    back = lin.vjp(row)
    for name in back:  # and each by itself
        change = state[[name]] * rng.random(state[name].shape)
        right = float((change[name] * back[name]).sum())
        seen = lin.jvp(change).values
        assert np.abs(seen).max() > 0, name
        assert float(seen @ row) == pytest.approx(right, abs=1e-13 * float(np.abs(seen) @ np.abs(row))), name


def test_a_picture_of_another_time_is_refused() -> None:
    """Where it says when it was lit, and the camera has a time and no sun of its own."""
    noon, op = np.datetime64("2024-06-21T12:00", "ms"), operator()
    images = [image.to_dataset(name="radiance") for image in op.pictures(op(op.first()))]
    images[1].attrs["light_time"] = "2024-06-21T12:06:00Z"
    op.observations(images, [500.0, 600.0])
    replace(op, time=noon + np.timedelta64(2, "m"), sun=None).observations(images, [500.0, 600.0])
    with pytest.raises(UserError, match=r"image 1 was lit at 2024-06-21T12:06:00.000, its camera here at 2024"):
        replace(op, time=noon, sun=None).observations(images, [500.0, 600.0])


def test_pictures_are_taken_by_their_dimensions_units_and_masks() -> None:
    op = operator()
    images, watts = op.pictures(op(op.first())), [500.0, 600.0]
    want = op.observations(images, watts)
    turned = [image.transpose("wavelength", "x", "y") for image in images]  # of the first y and x are as many
    milli = [(1e3 * image).assign_attrs(units="mW m-2 sr-1 nm-1").to_dataset(name="radiance") for image in images]
    micro = [image.assign_coords(wavelength=("wavelength", [0.55, 0.65], {"units": "um"})) for image in images]
    for given in (turned, milli, micro):
        assert op.observations(given, watts).identical(want) or np.allclose(
            op.observations(given, watts).value, want.value
        )
    with pytest.raises(UserError, match="image 0: radiance is in 'K'"):
        op.observations([image.assign_attrs(units="K") for image in images], watts)
    hidden = np.zeros((9, 9, 2), bool)
    hidden[4, 5] = True
    masked = [np.ma.array(images[0].values, mask=hidden), images[1]]
    found = op.observations(masked, np.ma.array(watts, mask=[False, True]))
    assert int(want.use.sum() - found.use.sum()) == 3  # two channels of a pixel, and a pyranometer


def test_pictures_of_other_cameras_and_suns_are_refused() -> None:
    """Of what a picture says; each was taken for that of the camera in its place."""
    op = operator()
    images = [image.to_dataset(name="radiance") for image in op.pictures(op(op.first()))]
    here = [{"x_m": one.x_m, "y_m": one.y_m, "sun_azimuth_deg": SUN[0], "sun_altitude_deg": SUN[1]} for one in CAMERAS]
    pixels = [one.pixels() for one in CAMERAS]
    looks = [
        {"azimuth": (("y", "x"), each.azimuth_deg), "altitude": (("y", "x"), each.altitude_deg)} for each in pixels
    ]
    told = [
        image.assign_coords(look).assign_attrs(place) for image, look, place in zip(images, looks, here, strict=True)
    ]
    op.observations(told, [500.0, 600.0])
    for changed, match in (
        (told[0].assign_attrs(here[1]), "image 0 is of a camera that stands or looks elsewhere than camera 0"),
        (told[0].isel(y=slice(None, None, -1)), "looks elsewhere"),
        (
            told[0].assign_attrs(sun_altitude_deg=20.0),
            "image 0 has the sun at azimuth 140.0, altitude 20.0, its camera",
        ),
    ):
        with pytest.raises(UserError, match=match):
            op.observations([changed, told[1]], [500.0, 600.0])


def test_observations_in_another_order_are_refused() -> None:
    op = operator()
    observed = op.observations(op.pictures(op(op.first())), [500.0, 600.0])
    with pytest.raises(UserError, match="instrument is not that of this operator's rows"):
        check_observed(op, observed.isel(observation=slice(None, None, -1)))
