"""The gate that every scene passes: the standard atmosphere does, the same in another unit does not."""

from __future__ import annotations

import numpy as np
import pytest
import xarray as xr

from openswim.errors import UserError
from openswim.scene import Grid, Scene
from openswim.scene.atmosphere import us_standard_pressure_temperature
from openswim.scene.plausible import below_the_sea, check_plausible

HEIGHT = np.linspace(10.0, 30_000.0, 31)
LEVELS = ("z", "y", "x")


def scene(height=HEIGHT, x=None, y=None, crs=None, radius=6_371_000.0, **changed) -> Scene:
    """The US standard atmosphere with a cloud of .3 g m-3 from 2 to 4 km; fields by name, profiles or functions."""
    pressure, temperature = us_standard_pressure_temperature(HEIGHT)
    cloud = np.where((HEIGHT > 2e3) & (HEIGHT < 4e3), 3e-4, 0.0)
    fields = {"air_pressure": pressure, "air_temperature": temperature, "liquid_content": cloud,
              "liquid_effective_radius": np.where(cloud > 0, 10e-6, 0.0)}  # fmt: skip
    for name, change in changed.items():
        fields[name] = change(fields[name]) if callable(change) else change
    axes = [np.arange(4) * 1e3 if axis is None else axis for axis in (x, y)]
    spread = {name: (LEVELS, np.broadcast_to(v[:, None, None], (31, 4, 4)).astype("f4")) for name, v in fields.items()}
    return Scene(Grid(*axes, height, crs, radius), xr.Dataset(spread))


def test_air_as_it_is_passes_without_a_word():
    assert scene().notes == []


def test_the_poles_winter_and_a_plateau_called_sea_level_pass():
    """CIRA-86 has 5 hPa at 30 km over the winter pole (standard: 12); Lhasa has 650 hPa."""
    scene(air_pressure=lambda p: p * np.exp(-np.log(12 / 5) * HEIGHT / 3e4))
    scene(air_pressure=lambda p: 0.65 * p)


@pytest.mark.parametrize("times", [0.93, 1.05])
def test_pressures_of_the_antarctic_and_of_siberia_are_not_odd(times):
    assert not any("standard atmosphere" in note for note in scene(air_pressure=lambda p: times * p).notes)


def test_a_slab_is_as_wide_as_it_is_given():
    slab = Grid(1e2 * np.arange(8), 5e4 * np.arange(2), HEIGHT)
    assert not any("same unit" in note for note in check_plausible(xr.Dataset(), slab))


def test_a_radius_at_its_bound_passes_in_single_precision():
    """10 um is 9.9999997 there."""
    assert float(np.float32(10e-6)) < 10e-6
    ice = np.where((HEIGHT > 5e3) & (HEIGHT < 7e3), 1e-4, 0.0)
    scene(graupel_content=ice, graupel_effective_radius=np.where(ice > 0, 10e-6, 0.0))


@pytest.mark.parametrize(
    ("changed", "words"),
    [
        ({"air_pressure": lambda p: p / 100}, "100 times too small"),
        ({"air_pressure": lambda p: p / 1000}, "1000 times too small"),
        ({"air_pressure": lambda p: np.full_like(p, 5e4)}, "air_pressure"),
        ({"air_pressure": lambda p: p[::-1]}, "upside down"),
        ({"air_pressure": lambda p: p[np.r_[0:10, 11, 10, 12:31]]}, "rises with height"),
        ({"air_pressure": lambda p: p[np.r_[0:10, 11, 11, 12:31]]}, "levels 11 and 12"),
        ({"air_temperature": lambda t: np.where(HEIGHT > 9e3, 330.0, t)}, "air_temperature"),
        ({"air_temperature": lambda t: 0.4 * t}, "air_temperature"),
        ({"height": 0.01 * HEIGHT}, "heights in metres"),
        ({"height": 3 * HEIGHT}, "heights in metres"),
        ({"liquid_content": lambda q: 100 * q}, "1000 times too large"),
        ({"liquid_content": lambda q: np.full_like(q, 5e-3)}, "kg m-2"),
        ({"liquid_content": lambda q: q[::-1]}, "28 km in the mean"),
        ({"liquid_effective_radius": lambda r: 1e3 * r}, "1000 times too large"),
        ({"liquid_effective_radius": lambda r: 1e-3 * r}, "1000 times too small"),
        ({"aerosol_extinction": np.full(31, 1e-3)}, "optical depth of 30"),
    ],
)  # fmt: skip
def test_what_no_atmosphere_has_is_refused_with_its_smell(changed, words):
    with pytest.raises(UserError, match=words):
        scene(**changed)


@pytest.mark.parametrize(
    ("changed", "words"),
    [
        ({"liquid_content": lambda q: 1e-4 * q}, "next to nothing"),
        ({"cloud_area_fraction": np.full(31, 1e-9)}, "zero where 100 % of the cloud's water is"),
        ({"air_temperature": lambda t: 1.06 * t}, "0.947 times as warm"),
        ({"air_temperature": lambda t: np.where(np.arange(31) == 5, 0.8 * t, t)}, "times as warm"),
        ({"air_temperature": np.full(31, 250.0), "air_pressure": 1e5 * np.exp(-HEIGHT / 7315.0)}, "250 K everywhere"),
        ({"liquid_effective_radius": lambda r: np.where(HEIGHT < 3e3, 0.0, r)}, "default sizes there"),
        ({"liquid_content": np.where(abs(HEIGHT - 1e4) < 1e3, 1e-4, 0.0)}, "% of liquid_content is in air colder"),
        ({"ice_content": np.where(HEIGHT < 1.5e3, 1e-4, 0.0)}, "% of ice_content is in air warmer than 3 degC"),
        ({"liquid_number": np.full(31, 1e11)}, "liquid_number is 1e+11 m-3 at most"),
        ({"height": HEIGHT + 900.0}, "the lowest level is 910 m above sea level"),
        ({"crs": "EPSG:4326", "x": 2.5 * np.arange(4), "y": 0.25 * np.arange(4)}, "cells of 2.5 x 0.25 degrees"),
        ({"aerosol_extinction": 4e-3 * np.exp(-HEIGHT / 1e3)}, "aerosol has an optical depth of 4"),
        ({"y": 1e4 * np.arange(4)}, "cells of 1e+03 x 1e+04 m"),
        ({"air_pressure": lambda p: 0.87 * p}, "0.87 times that of the standard atmosphere at 10 m"),
    ],
)
def test_what_is_odd_is_told(changed, words):
    from pyproj import CRS

    if "crs" in changed:
        changed = changed | {"crs": CRS.from_user_input(changed["crs"])}
    assert any(words in note for note in scene(**changed).notes)


@pytest.mark.parametrize(
    ("factor", "words"), [(1.0, None), (0.1, None), (1e-3, "next to nothing"), (100.0, "more than any cloud has")]
)
def test_ice_that_does_not_go_with_the_cloud_fraction_is_told(factor, words):
    """Clouds under 235 K have 5 to 20 mg m-3 of ice in the mean of ERA5's, IFS's, UM's and GFS's files."""
    cirrus = np.where(abs(HEIGHT - 1e4) < 1.1e3, 1.0, 0.0)
    notes = scene(cloud_area_fraction=cirrus, ice_content=factor * 1e-5 * cirrus, liquid_content=lambda q: 0 * q).notes
    told = [note for note in notes if "where the cloud fraction says cloud" in note]
    assert [words in note for note in told] == ([True] if words else [])


@pytest.mark.parametrize(("zero", "step", "told"), [(0, 1, True), (273.15, 1, True), (0, 0.5, False), (0, 0.1, False)])
def test_temperatures_without_decimals_are_told(zero, step, told):
    """Of kelvins or of degrees Celsius; files with a decimal, or with every second one, pass."""
    notes = scene(air_temperature=lambda t: zero + np.round((t - zero) / step) * step).notes
    assert any("whole degrees alone" in note for note in notes) == told


@pytest.mark.parametrize(
    ("x", "y", "words"),
    [
        (np.arange(4.0), 88.0 + np.arange(4.0), "latitudes run from 88 to 91"),
        (np.arange(4.0), 350.0 + np.arange(4.0), "latitudes"),
        (1e5 + np.arange(4.0), np.arange(4.0), "longitudes"),
    ],
)
def test_places_that_are_not_on_earth(x, y, words):
    from pyproj import CRS

    with pytest.raises(UserError, match=words):
        scene(x=x, y=y, crs=CRS.from_epsg(4326))


def test_another_planet_has_its_own_air():
    """The gate knows the Earth's air only: that of Mars, 600 Pa at the ground, passes on Mars's sphere."""
    scene(radius=3.39e6, air_pressure=lambda p: 0.006 * p)


def test_the_core_of_a_storm_is_borne_where_the_domain_is_narrow():
    """40 kg m-2 of hail and rain over 20 km: told; over 500 km, or as cloud water: refused."""
    heights = np.linspace(100.0, 12_000.0, 25)

    def scene(species: str, step_m: float) -> Scene:
        content = np.zeros((25, 5, 5), np.float32)
        content[:17] = 5e-3
        axis = step_m * np.arange(5)
        return Scene(Grid(axis, axis, heights), xr.Dataset({f"{species}_content": (("z", "y", "x"), content)}))

    assert any("hurricanes have 5" in note for note in scene("graupel", 4e3).notes)
    for species, step_m in (("graupel", 1e5), ("liquid", 4e3)):
        with pytest.raises(UserError, match="hurricanes have 5"):
            scene(species, step_m)


def _wide(change=None) -> Scene:
    """The standard atmosphere over 12 x 12 columns; `change` spoils its pressure, temperature and heights (z, y, x)."""
    pressure, temperature = us_standard_pressure_temperature(HEIGHT)
    fields = [np.repeat(v, 144).reshape(31, 12, 12) for v in (pressure, temperature, HEIGHT)]
    if change:
        change(*fields)
    grid = Grid(np.arange(12) * 1e3, np.arange(12) * 1e3, fields[2])
    names = zip(("air_pressure", "air_temperature"), fields, strict=False)
    return Scene(grid, xr.Dataset({name: (LEVELS, values.astype("f4")) for name, values in names}))


def _at_one_node(which, factor):
    def change(*fields):
        fields[which][10, 5, 6] *= factor

    return change


@pytest.mark.parametrize(("which", "factor"), [(0, 1.03), (1, 1.15), (2, 1.02)])
def test_one_damaged_node_is_told(which, factor):
    """Layers are as thick as pressure and temperature make them, to some per cent, in every column."""
    assert any("disagree between some levels" in note for note in _wide(_at_one_node(which, factor)).notes)


def test_noise_in_pressure_is_told_and_a_cyclone_is_not():
    """Whole columns of another pressure agree with themselves, not with those beside them."""
    factor = np.ones((12, 12))
    factor[3:5] += 0.02 * np.random.default_rng(1).uniform(-1, 1, (2, 12))
    spoilt = _wide(lambda p, t, z: np.multiply(p, factor, out=p))
    assert any("jumps up and down" in note for note in spoilt.notes)
    away = np.hypot(*(np.mgrid[:12, :12] - 5.5))
    eye = 1 - 0.1 * np.exp(-away / 2)  # 100 hPa, as deep as any, and its core at four nodes
    assert _wide(lambda p, t, z: np.multiply(p, eye, out=p)).notes == _wide().notes == []


@pytest.mark.parametrize(
    ("time", "odd"),
    [("1970-01-01T00:00:00.500", True), ("1970-01-01", True), ("1969-12-31T21:13:21", True),
     ("2024-06-21T12:00:00.25", True), ("0001-01-01", True), ("2024-06-21T12:00", False), ("1836-01-01", False),
     ("1800-01-01T01", True), ("1900-01-01T00:30", True), ("1899-12-31T20:59", False), ("1900-06-01", False)],
)  # fmt: skip
def test_times_of_no_weather_are_told(time, odd):
    one = Scene.clear(0.0, 0.0, time=np.datetime64(time))
    assert any("odd for weather" in note for note in one.notes) == odd


def test_winds_of_two_units_single_values_and_strips_are_told():
    cloud = np.where((HEIGHT > 2e3) & (HEIGHT < 4e3), 3e-4, 0.0)[:, None, None] * np.ones((31, 6, 6))
    axis = np.arange(6) * 1e3
    winds = {"wind_east_10m": np.full((6, 6), 5.0), "wind_north_10m": np.linspace(4, 5, 36).reshape(6, 6)}
    told = Scene.from_arrays(None, axis, axis, HEIGHT, fields={"liquid_content": cloud} | winds).notes
    assert any("wind_east_10m is 5 m s-1 everywhere" in note for note in told)
    winds["wind_east_10m"] = 1e-3 * winds["wind_north_10m"]
    told = Scene.from_arrays(None, axis, axis, HEIGHT, fields=winds).notes
    assert any("both in the same unit" in note for note in told)
    strip = {name: field[:3] for name, field in winds.items()}
    told = Scene.from_arrays(None, axis, axis[:3], HEIGHT, fields=strip).notes
    assert any("a strip of 6 x 3 columns" in note for note in told)


@pytest.mark.parametrize(("per_m", "told"), [(1e-9, True), (1e-6, False)])
def test_aerosol_that_is_next_to_nothing_is_told(per_m, told):
    """Three species of .00009, and of .09."""
    axis, every = np.arange(4) * 1e3, np.full((31, 4, 4), per_m, np.float32)
    data = xr.Dataset({f"extinction_{kind}": (LEVELS, every) for kind in ("dust", "smoke", "sea_salt")})
    notes = check_plausible(data, Grid(axis, axis, HEIGHT))
    assert any("next to nothing" in note for note in notes) == told


@pytest.mark.parametrize(
    ("ground_m", "told"), [((-150.0, -40.0), True), ((-28.0, -1.0), False), ((-400.0, 300.0), False)]
)
def test_ground_below_the_sea_everywhere_is_told(ground_m, told):
    """The shore of the Caspian Sea lies at -28 m."""
    ground = np.linspace(*ground_m, 16, dtype=np.float32).reshape(4, 4)
    assert bool(below_the_sea(ground)) == told
