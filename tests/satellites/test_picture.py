"""Pictures from space: known ground without air, sea and deep cloud, and the row's own time."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import xarray as xr

from openswim.cli.main import run
from openswim.errors import UserError
from openswim.lights.eclipses import light_left
from openswim.lights.eclipses.solar import discs
from openswim.satellites import FixedGrid, band, imagers, reflectance
from openswim.satellites.files import write
from openswim.scene import Scene
from openswim.scene.atmosphere import Atmosphere

LAT, LON = 20.0, -75.0
WHOLE = FixedGrid(2.8e-5 * np.arange(-5400, 5401, 5), 2.8e-5 * np.arange(5400, -5401, -5), -75.0)
NOON = np.datetime64("2021-06-21T17:00")  # the sun 3.5 degrees from the zenith there


def _grid(half: int = 5) -> FixedGrid:
    row, column = (round(float(v)) for v in WHOLE.index(LAT, LON))
    return WHOLE.part(slice(row - half, row + half + 1), slice(column - half, column + half + 1))


def _scene(water: float = 0.0, ice: float = 0.0, **more) -> Scene:
    axis = np.linspace(-60_000, 60_000, 7)
    z = np.array([0.0, 1000, 2000, 4000, 6000, 9000, 12_000, 14_000, 15_000])
    fields = {name: np.zeros((z.size, 7, 7), np.float32) for name in ("liquid_content", "ice_content")}
    fields["liquid_content"][1:4] = water
    fields["ice_content"][4:7] = ice
    surface = {"land_area_fraction": 0.0, "wind_east_10m": 5.0, "wind_north_10m": 0.0}
    fields |= {name: np.full((7, 7), value, np.float32) for name, value in surface.items()}
    crs = f"+proj=lcc +lat_1=15 +lat_2=25 +lat_0={LAT} +lon_0={LON} +R=6371000"
    scene = Scene.from_arrays({}, axis, axis, z, crs=crs, time=NOON, fields=fields,
                              atmosphere=Atmosphere.us_standard(), **more)  # fmt: skip
    if "surface_albedo" not in more and "surface_albedo" in scene.data:
        scene.data = scene.data.drop_vars("surface_albedo")
    return scene


def test_white_ground_without_air_has_its_albedo_times_the_height_of_the_sun() -> None:
    bare = Scene.clear(LAT, LON, None, 0.6, time=np.datetime64("2021-06-21T14:00"))
    found = reflectance(bare, _grid(1), [band("goes-16 abi", "C02"), band("goes-16 abi", "C03")])
    expected = 0.6 * np.cos(np.radians(found.sun_zenith))
    np.testing.assert_allclose(found.reflectance_factor, np.stack([expected] * 2), rtol=0.005)
    np.testing.assert_allclose(found.bidirectional_reflectance, 0.6, rtol=0.005)


def test_one_band_need_not_be_in_a_list() -> None:
    bare = Scene.clear(LAT, LON, None, 0.6, time=np.datetime64("2021-06-21T14:00"))
    found = reflectance(bare, _grid(1), band("goes-16 abi", "C02"))
    assert found.band.values.tolist() == ["C02"]
    for wrong in ("C02", 2, []):
        with pytest.raises(UserError, match="give a list of bands"):
            reflectance(bare, _grid(1), wrong)


@pytest.mark.slow
def test_the_sea_away_from_glint_and_deep_cloud_below_a_high_sun() -> None:
    red = band("goes-16 abi", "C02")
    sea = reflectance(_scene(), _grid(), [red], time="2021-06-21T13:00").bidirectional_reflectance
    assert float(sea.min()) > 0.03
    assert float(sea.max()) < 0.06
    storm = reflectance(_scene(1e-3, 3e-4), _grid(), [red]).bidirectional_reflectance
    assert 0.95 < float(storm.mean()) < 1.15


def test_in_an_eclipse_the_ground_has_what_the_moon_leaves() -> None:
    """Of white ground without air, against sun and moon where each pixel is."""
    time, lat, lon = "2024-04-08T18:00", 31.0, -99.0
    row, column = (round(float(v)) for v in WHOLE.index(lat, lon))
    grid = WHOLE.part(slice(row - 20, row + 21, 20), slice(column - 20, column + 21, 20))
    found = reflectance(Scene.clear(lat, lon, None, 0.6), grid, [band("goes-16 abi", "C02")], time)
    there, over = grid.latlon()
    each = [discs(time, float(a), float(b)) for a, b in zip(there.ravel(), over.ravel(), strict=True)]
    left = np.reshape([light_left(one, [640.0])[0, 0] for one in each], there.shape)
    assert np.ptp(left) > 0.1
    np.testing.assert_allclose(found.bidirectional_reflectance[0], 0.6 * left, rtol=6e-4)


def test_rows_have_the_light_of_their_own_time() -> None:
    bare = Scene.clear(LAT, LON, None, 0.6)
    found = reflectance(bare, _grid(2), [band("goes-16 abi", "C02")], "2021-06-21T13:00", "2021-06-21T13:10")
    np.testing.assert_allclose(found.bidirectional_reflectance, 0.6, rtol=0.005)
    assert float(found.sun_zenith[0, 0] - found.sun_zenith[-1, 0]) == pytest.approx(2.3, abs=0.5)


def test_bands_weigh_to_one_and_unknown_ones_are_refused() -> None:
    for imager, names in imagers().items():
        for name in names:
            one = band(imager, name)
            assert one.weight.sum() == pytest.approx(1, abs=2e-4)
            assert one.weight @ one.wavelength_nm == pytest.approx(one.centre_nm, abs=1.0)
            assert one.error < 0.0035
    # centres as the agencies give them
    for imager, name, centre in (("terra modis", "1", 645), ("terra modis", "2", 858), ("himawari-8 ahi", "2", 510),
                                 ("meteosat-11 seviri", "VIS08", 810), ("noaa-20 viirs", "M05", 667)):  # fmt: skip
        assert band(imager, name).centre_nm == pytest.approx(centre, abs=4)
    with pytest.raises(UserError, match="C09"):
        band("goes-16 abi", "C09")
    with pytest.raises(UserError, match="no pixel"):
        reflectance(_scene(), WHOLE.part(slice(0, 9), slice(0, 9)), [band("goes-16 abi", "C02")])


def test_the_command_takes_the_models_time_nearest_to_the_picture(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Clear at first and a deep cloud an hour later, at the picture's time."""
    placed: list[tuple[int, ...]] = []
    places = FixedGrid.latlon
    monkeypatch.setattr(FixedGrid, "latlon", lambda grid: placed.append(grid.shape) or places(grid))
    for hour, water in ((16, 0.0), (17, 1e-3)):
        scene = _scene(water)
        scene.time = np.datetime64(f"2021-06-21T{hour}:00", "ms")
        scene.to_netcdf(tmp_path / f"model_{hour}.nc")
    bare = Scene.clear(LAT, LON, None, 0.6, time=NOON + np.timedelta64(10, "m"))
    seen = reflectance(bare, _grid(1), [band("goes-16 abi", "C02")])
    flags = np.zeros((seen.y.size, seen.x.size), np.uint8)
    flags[0, 0] = 3
    write(seen.assign(DQF=(("y", "x"), flags)), tmp_path / "seen.nc")
    models = [str(tmp_path / f"model_{hour}.nc") for hour in (16, 17)]
    asked = ["satellite", *models, "--like", str(tmp_path / "seen.nc"), "--band", "C02"]
    placed.clear()
    assert run([*asked, "-o", str(tmp_path / "out.nc")]) == 0
    assert placed == 2 * [_grid(1).shape]  # of the observed picture, and of ours
    said = capsys.readouterr()
    assert "note: the model's nearest" not in said.err
    assert "seen.nc: 1 pixels (11 %) are left out: its flags of quality (DQF)" in said.err
    assert "C02, 8 pixels: bias" in said.out
    with xr.open_dataset(tmp_path / "out.nc") as found:
        assert found.attrs["time_coverage_start"].startswith("2021-06-21T17:10")
        assert float(found.reflectance_factor.mean()) > 0.7  # the sea has .08
    elsewhere = WHOLE.part(slice(900, 903), slice(1000, 1003))
    write(reflectance(Scene.clear(LAT, LON, None, 0.6, time=NOON), elsewhere, [band("goes-16 abi", "C02")]),
          tmp_path / "seen.nc")  # fmt: skip
    assert run(asked) == 2
    assert "its pixels are within latitude" in capsys.readouterr().err
