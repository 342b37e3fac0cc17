"""What every reader owes: places, heights, orientation, mass, wind, time, as the files were made."""

from __future__ import annotations

import numpy as np
import pytest
from tests.readers.model_files import MAKERS, TEMPERATURE, Truth

from openswim.readers import describe, open_scene


def _heights(scene):
    height = scene.grid.height_m
    return np.broadcast_to(height if height.ndim == 3 else height[:, None, None], scene.grid.shape)


@pytest.fixture(scope="module", params=list(MAKERS))
def case(request, tmp_path_factory):
    truth = MAKERS[request.param](tmp_path_factory.mktemp("model"))
    return truth, open_scene(truth.paths)


def test_places_within_a_tenth_of_a_cell(case):
    truth, scene = case
    if truth.lonlat is None:
        assert scene.grid.crs is None
        np.testing.assert_allclose(np.diff(scene.grid.x), np.diff(truth.extra["x"]), rtol=1e-5)
        np.testing.assert_allclose(np.diff(scene.grid.y), np.diff(truth.extra["y"]), rtol=1e-5)
        return
    ix, iy = scene.grid.index(*truth.lonlat)
    _, ny, nx = scene.grid.shape
    assert np.abs(ix - np.arange(nx)).max() < 0.1
    assert np.abs(iy - np.arange(ny)[:, None]).max() < 0.1


def test_heights_rise_and_are_the_models(case):
    truth, scene = case
    height = _heights(scene)
    assert (np.diff(height, axis=0) > 0).all()
    np.testing.assert_allclose(height, truth.height_m, atol=truth.height_tolerance_m)


def test_contents_and_orientation(case):
    """Each node: a turned axis, a wrong density or a wrong unit cannot pass."""
    truth, scene = case
    for name, expected in truth.fields.items():
        found = scene.data[name].transpose("z", "y", "x").values
        np.testing.assert_allclose(
            found, expected, rtol=truth.content_tolerance, atol=truth.content_tolerance * expected.max(), err_msg=name
        )


def test_mass_is_kept(case):
    truth, scene = case
    height = _heights(scene)
    for name, expected in truth.fields.items():
        found = np.trapezoid(scene.data[name].values, height, axis=0).sum()
        wanted = np.trapezoid(expected, truth.height_m, axis=0).sum()
        assert found == pytest.approx(wanted, rel=max(2 * truth.content_tolerance, 5e-3)), name


def test_no_species_out_of_nothing(case):
    truth, scene = case
    found = {name for name in scene.data.data_vars if str(name).endswith("_content") and scene.data[name].any()}
    assert found <= set(truth.fields)


def test_state(case):
    _, scene = case
    if "air_temperature" in scene.data:
        temperature = float(scene.data.air_temperature.mean())
        assert temperature == pytest.approx(TEMPERATURE, abs=0.5)  # RAMS has its own gas constant
        assert (scene.data.air_pressure.diff("z") < 0).all()


def test_terrain_and_wind(case):
    truth, scene = case
    if truth.terrain_m is not None:
        np.testing.assert_allclose(scene.data.surface_altitude, truth.terrain_m, atol=0.5)
    if truth.wind is not None:
        east, north = truth.wind
        np.testing.assert_allclose(scene.data.wind_east_10m, east, atol=0.02)
        np.testing.assert_allclose(scene.data.wind_north_10m, north, atol=0.02)


def test_time(case):
    truth, scene = case
    assert abs(scene.time - truth.time) <= np.timedelta64(2, "s")


def test_description_names_what_was_found(case):
    truth, _ = case
    text = str(describe(truth.paths))
    for name in truth.fields:
        assert name.removesuffix("_content") in text.split("missing")[0]
    for label in ("model", "grid", "projection", "levels", "times", "missing", "assumed"):
        assert f"\n{label}" in text


def test_description_tells_what_opening_will_assume(case):
    """But for what only the values of a time can tell."""
    truth, scene = case
    said = describe(truth.paths).assumed
    of_values = ("values below 0", "set to 0", "missing values", "are zero", "where the Earth has sea")
    assert [note for note in scene.notes if note not in said and not any(text in note for text in of_values)] == []


def test_around_a_place_keeps_the_place(case):
    """Cut or laid around a place: the fields at nodes that are there are the same."""
    truth, scene = case
    if truth.lonlat is None:
        laid = open_scene(truth.paths, around=(51.0, 3.0))
        np.testing.assert_allclose(laid.place, (51.0, 3.0), atol=1e-6)
        np.testing.assert_array_equal(laid.data.liquid_content, scene.data.liquid_content)
        return
    lon, lat = (float(a[a.shape[0] // 2, a.shape[1] // 2]) for a in truth.lonlat)
    part = open_scene(truth.paths, around=(lat, lon))
    i, j = (float(v) for v in part.grid.index(lon, lat))
    whole_i, whole_j = (float(v) for v in scene.grid.index(lon, lat))
    column = part.data.liquid_content.values[:, round(j), round(i)]
    expected = scene.data.liquid_content.values[:, round(whole_j), round(whole_i)]
    if not any("resampled" in note for note in part.notes):
        np.testing.assert_allclose(column, expected, rtol=1e-5, atol=1e-9)
    else:
        np.testing.assert_allclose(column, expected, rtol=0.1, atol=0.02 * expected.max())


def test_truth_is_asymmetric():
    """Else turned axes would pass."""
    assert Truth  # what the makers return
    from tests.readers.model_files import cloud

    field = cloud(np.broadcast_to(np.linspace(0, 9000, 5)[:, None, None], (5, 6, 7)))
    for axis in range(3):
        assert np.abs(field - np.flip(field, axis)).max() > 0.2 * field.max()
