"""The three real WRF files: place against their own coordinates, state against their own diagnostics."""

from __future__ import annotations

import netCDF4
import numpy as np
import pytest

from openswim.readers import describe, open_scene

KATRINA = "wrfout_katrina_2005-08-28.nc"
TIBET = "wrfout_tibet_2005-09-21.nc"
ALPS = "wrfinput_switzerland_2023-01-15.nc"


def _all_times(path):
    return [str(time) for time in describe(path).times]


def _field(path, name, time_index=0):
    with netCDF4.Dataset(path) as file:
        variable = file[name]
        return np.asarray(variable[time_index] if variable.dimensions[0] == "Time" else variable[:])


@pytest.mark.parametrize("name", [KATRINA, TIBET, ALPS])
def test_grid_against_own_coordinates_at_every_time(nwp, name):
    """To a tenth of a cell is the promise; these files manage a thousandth. Katrina's nest moves."""
    path = nwp / name
    for index, time in enumerate(_all_times(path)):
        grid = open_scene(path, time).grid
        ix, iy = grid.index(_field(path, "XLONG", index), _field(path, "XLAT", index))
        assert np.abs(ix - np.arange(ix.shape[1])).max() < 1e-3
        assert np.abs(iy - np.arange(iy.shape[0])[:, None]).max() < 1e-3


@pytest.mark.parametrize(("name", "spacing_m"), [(KATRINA, 10_000.0), (TIBET, 30_000.0), (ALPS, 3000.0)])
def test_spacing_by_the_map_factor(nwp, name, spacing_m):
    factor = _field(nwp / name, "MAPFAC_M")
    ny, nx = factor.shape
    middle = factor[(ny - 1) // 2 : ny // 2 + 1, (nx - 1) // 2 : nx // 2 + 1].mean()
    np.testing.assert_allclose(open_scene(nwp / name).grid.spacing_m(), spacing_m / middle, rtol=1e-4)


@pytest.mark.parametrize("name", [TIBET, ALPS])
def test_wind_against_own_rotation(nwp, name):
    path = nwp / name
    u, v, cos, sin = (_field(path, each) for each in ("U10", "V10", "COSALPHA", "SINALPHA"))
    data = open_scene(path).data
    np.testing.assert_allclose(data.wind_east_10m, u * cos - v * sin, atol=1e-3)
    np.testing.assert_allclose(data.wind_north_10m, v * cos + u * sin, atol=1e-3)


def test_dry_density_against_own_specific_volume(nwp):
    """WRF's AL + ALB is the inverse density of dry air; contents are mixing ratios times that density."""
    from openswim.readers.wrf.file import WRFFile
    from openswim.readers.wrf.reader import air_of

    path = nwp / ALPS
    with WRFFile(path) as file:
        _, density, *_ = air_of(file, [])
    np.testing.assert_allclose(density, 1.0 / (_field(path, "AL") + _field(path, "ALB")), rtol=2e-3)


@pytest.mark.parametrize("name", [KATRINA, TIBET, ALPS])
def test_heights_and_state_fit_the_surface(nwp, name):
    path = nwp / name
    scene = open_scene(path)
    above_ground = scene.grid.height_m[0] - _field(path, "HGT")
    assert above_ground.min() > 5.0
    assert above_ground.max() < 60.0
    lowest = scene.data.isel(z=0)
    # hydrostatic pressure difference between the ground and the lowest level
    scale = 287.0 * lowest.air_temperature.values / 9.81
    surface_pressure = (
        _field(path, "PSFC") if name != ALPS else lowest.air_pressure * np.exp(above_ground / scale)
    )
    np.testing.assert_allclose(
        lowest.air_pressure * np.exp(above_ground / scale), surface_pressure, rtol=1e-3
    )
    assert np.abs(lowest.air_temperature - _field(path, "T2")).max() < 12.0


def test_katrina_lacks_ice_and_land_and_says_so(nwp):
    scene = open_scene(nwp / KATRINA, "2005-08-28T18:00")
    assert scene.time == np.datetime64("2005-08-28T18:00")
    assert scene.species == ["liquid", "rain"]
    assert float(scene.data.rain_content.min()) == 0.0
    notes = " | ".join(scene.notes)
    for said in ("no QICE, QSNOW, QGRAUP", "no LANDMASK", "no ALBEDO", "levels end at 5.6 km", "QRAIN"):
        assert said in notes
    # heavy rain of a hurricane: grams per cubic metre, not kilograms
    assert 1e-3 < float(scene.data.rain_content.max()) < 1e-2


def test_tibet_has_everything(nwp):
    scene = open_scene(nwp / TIBET)
    assert scene.species == ["liquid", "ice", "rain", "snow", "graupel"]
    assert {"ice_number", "rain_number", "surface_albedo", "snow_area_fraction", "land_area_fraction"} <= set(
        scene.data.data_vars
    )
    assert 4400 < float(scene.data.surface_altitude.min()) < float(scene.data.surface_altitude.max()) < 5600


def test_the_alps_are_clear(nwp):
    scene = open_scene(nwp / ALPS)
    assert not any(scene.data[f"{species}_content"].any() for species in scene.species)
    assert any("clear sky" in note for note in scene.notes)
    assert 0.0 < float(scene.data.snow_area_fraction.mean()) < 1.0


def test_saved_and_read_again(nwp, tmp_path):
    scene = open_scene(nwp / TIBET, "2005-09-21T06:00")
    for path, save in ((tmp_path / "scene.nc", scene.to_netcdf), (tmp_path / "scene.zarr", scene.to_zarr)):
        save(path)
        again = open_scene(path)
        assert again.data.identical(scene.data)
        assert (again.time, again.source, again.notes) == (scene.time, scene.source, scene.notes)
        np.testing.assert_allclose(again.grid.lonlat(3.3, 4.4), scene.grid.lonlat(3.3, 4.4), atol=1e-9)
