import numpy as np
import pytest
import xarray as xr

from openswim import Camera, Scene, UserError
from openswim.films import Weather
from openswim.films.between import Motion, between
from openswim.films.making import shots_of
from openswim.scene import Grid
from openswim.scene.procedural.cumulus import cumulus_field
from openswim.transport.engine.drift import drift_of

NOON = np.datetime64("2024-06-01T12:00", "ms")
MINUTES = np.timedelta64(60_000, "ms")
X = 200.0 * np.arange(96)
Z = 200.0 * np.arange(1, 16)
WIND = np.stack([4.0 + 2e-3 * Z, 1.0 + 0.5e-3 * Z])  # m/s along x and y at heights: sheared


def _state(minutes: float, wind: bool = True) -> Scene:
    """Cumulus that drifts with a sheared wind and grows, on a period."""
    made = cumulus_field(X, X, Z, seed=3)
    content = np.asarray(made[0] if isinstance(made, tuple) else made, float)
    seconds = 60.0 * minutes
    moved = np.empty_like(content)
    k = np.fft.fftfreq(X.size, 200.0)
    for level, (u, v) in enumerate(WIND.T):
        phase = np.exp(-2j * np.pi * seconds * (u * k[None, :] + v * k[:, None]))
        moved[level] = np.fft.ifft2(np.fft.fft2(content[level]) * phase).real
    fields = {"liquid_content": np.maximum(moved, 0) * (1 + 0.03 * minutes)}
    if wind:
        for name, speed in zip(("wind_east", "wind_north"), WIND, strict=True):
            fields[name] = np.broadcast_to(speed[:, None, None], content.shape)
    data = xr.Dataset({name: (("z", "y", "x"), np.asarray(values, np.float32)) for name, values in fields.items()})
    return Scene(Grid(X, X, Z, periodic=True), data, time=NOON + np.timedelta64(round(seconds * 1e3), "ms"))


def _columns(scene: Scene) -> np.ndarray:
    return scene.data["liquid_content"].values.sum(axis=0)


def _r(one: np.ndarray, other: np.ndarray) -> float:
    return float(np.corrcoef(one.ravel(), other.ravel())[0, 1])


def _fss(one: np.ndarray, other: np.ndarray, width: int = 5) -> float:
    from scipy.ndimage import uniform_filter

    level = 0.1 * other.max()
    p, q = (uniform_filter((field > level).astype(float), width, mode="wrap") for field in (one, other))
    return float(1 - ((p - q) ** 2).sum() / ((p**2).sum() + (q**2).sum()))


@pytest.mark.parametrize("wind", [True, False])
def test_weather_between_two_times_is_nearer_the_truth_than_neighbours_and_their_fade(wind: bool) -> None:
    before, truth, after = (_state(minutes, wind) for minutes in (0.0, 7.0, 15.0))
    found, seen = _columns(between(before, after, truth.time)), _columns(truth)
    others = [_columns(before), _columns(after), (8 * _columns(before) + 7 * _columns(after)) / 15]
    assert _r(found, seen) > (0.98 if wind else 0.95)
    assert _r(found, seen) > max(_r(each, seen) for each in others) + 0.2
    assert _fss(found, seen) > max(_fss(each, seen) for each in others) + 0.1
    assert found.sum() == pytest.approx(seen.sum(), rel=0.01)  # a cloud that grows evenly


def test_ends_are_the_model_states_and_nothing_is_made_of_clear_air() -> None:
    before, after = _state(0.0), _state(15.0)
    assert between(before, after, before.time) is before
    assert between(before, after, after.time) is after
    middle = between(before, after, NOON + 5 * MINUTES).data["liquid_content"].values
    assert middle.min() >= 0
    most = max(scene.data["liquid_content"].values.max() for scene in (before, after))
    assert middle.max() <= most * (1 + 1e-6)


def test_drift_of_clouds_is_found_to_a_fraction_of_a_cell() -> None:
    before, after = (_state(minutes).data["liquid_content"].values for minutes in (0.0, 5.0))
    cloudy = np.flatnonzero(before.max(axis=(1, 2)) > 0)
    found = drift_of(before, after, periodic=True)[cloudy]
    np.testing.assert_allclose(found, WIND.T[cloudy] * 300 / 200.0, atol=0.15)


def test_effective_radius_keeps_extinction() -> None:
    scenes = []
    for minutes, radius in ((0.0, 8e-6), (10.0, 16e-6)):
        scene = _state(minutes)
        content = scene.data["liquid_content"]
        data = scene.data.assign(liquid_effective_radius=content.copy(data=np.full(content.shape, radius, np.float32)))
        scenes.append(Scene(scene.grid, data, time=scene.time))
    middle = between(*scenes, NOON + 5 * MINUTES)
    content, radius = (middle.data[f"liquid_{name}"].values for name in ("content", "effective_radius"))
    still = Motion.between(*scenes)
    parts = [between(_with(s, "liquid_content", s.data["liquid_content"].values / r), _with(o, "liquid_content",
             o.data["liquid_content"].values / q), NOON + 5 * MINUTES, still)
             for s, o, r, q in [(*scenes, 8.0, 16.0)]]  # fmt: skip
    cloudy = content > 1e-5
    optical = parts[0].data["liquid_content"].values[cloudy]
    np.testing.assert_allclose((content[cloudy] / (radius[cloudy] * 1e6)), optical, rtol=2e-2)


def _with(scene: Scene, name: str, values: np.ndarray) -> Scene:
    data = scene.data[[name, "wind_east", "wind_north"]].assign({name: scene.data[name].copy(data=values)})
    return Scene(scene.grid, data, time=scene.time)


def test_grids_and_times_that_do_not_fit_are_refused() -> None:
    before, after = _state(0.0), _state(15.0)
    with pytest.raises(UserError, match="not between"):
        between(before, after, NOON + 20 * MINUTES)
    moved = Scene(Grid(X + 500.0, X, Z, periodic=True), after.data.drop_vars(["x", "y"], errors="ignore"),
                  time=after.time)  # fmt: skip
    with pytest.raises(UserError, match="leave out --every"):
        between(before, moved, NOON + 5 * MINUTES)


def test_sizes_that_nobody_knows_stay_unknown() -> None:
    scenes = []
    for minutes in (0.0, 10.0):
        scene = _state(minutes)
        content = scene.data["liquid_content"]
        radius = np.zeros(content.shape, np.float32)
        radius[:, :48] = 10e-6
        data = scene.data.assign(liquid_effective_radius=content.copy(data=radius))
        scenes.append(Scene(scene.grid, data, time=scene.time))
    found = between(*scenes, NOON + 5 * MINUTES).data["liquid_effective_radius"].values
    known = found > 0
    np.testing.assert_allclose(found[known], 10e-6, rtol=1e-3)
    assert not known[:, 60:90].any()


def test_a_nest_that_moves_says_between_which_times() -> None:
    scenes = [Scene.from_arrays(np.zeros((3, 4, 4), np.float32), np.arange(4) * 1e3 + shift, np.arange(4) * 1e3,
                                np.array([0.0, 1e3, 2e3]), time=f"2026-07-10T1{hour}:00")
              for hour, shift in ((2, 0.0), (3, 5e3))]  # fmt: skip
    with pytest.raises(UserError, match=r"grid at 2026-07-10T12.* is not that at 2026-07-10T13.*leave out --every"):
        Motion.between(*scenes)


def test_times_in_between_of_a_moving_nest_are_refused_before_a_scene_is_read() -> None:
    def unread(_: np.datetime64) -> Scene:
        raise AssertionError

    def grids(time: np.datetime64) -> list[tuple[str, Grid]]:
        east = 9e3 * float((time - NOON) / np.timedelta64(1, "h"))
        return [("wrfout", Grid(np.arange(4) * 9e3 + east, np.arange(4) * 9e3, np.arange(3) * 1e3))]

    times = NOON + np.arange(4) * np.timedelta64(1, "h")
    nest = Weather(times, unread, ["a nest"], grids)
    still = Weather(times, unread, ["a domain"], lambda _: grids(NOON))
    camera = Camera.allsky(47.0, 11.0, size=8)
    with pytest.raises(UserError, match=r"^wrfout: its grid at .*leave out --every"):
        shots_of(nest, camera, 300.0, None, 25.0, 1.0, None, None)
    assert len(shots_of(still, camera, 300.0, None, 25.0, 1.0, None, None)) == 37
    assert len(shots_of(nest, camera, None, None, 25.0, 1.0, None, None)) == 4
    assert len(shots_of(nest, camera, 3600.0, None, 25.0, 1.0, None, None)) == 4  # the model's own
