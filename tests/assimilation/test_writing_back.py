"""Increments put back into WRF files: nothing changes nothing, mass is kept, vapour goes with cloud."""

from __future__ import annotations

import re
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import netCDF4
import numpy as np
import pytest
from tests.readers.conftest import WRFSpec, stacked, write_wrf

from openswim import Scene, UserError, open_scene
from openswim.assimilation import Analysis, write_back
from openswim.assimilation.observing.controls import Controls
from openswim.assimilation.writing_back import check_write_back
from openswim.cli.main import run
from openswim.readers.fields.increments import vapour_beside_cloud
from openswim.readers.wrf.increments import put_increments

SECOND = "2005-08-28T15:00"
LEVELS = ("bottom_top", "south_north", "west_east")
NODES = (12, 6, 7)


def wrf(folder: Path, **more: Any) -> Path:
    """Snow-cold above, mild below; 1 g/kg of liquid on the second level, as much ice on the ninth, and numbers."""
    ice = np.zeros(NODES)
    ice[8] = 1e-3
    extra = {"QICE": (LEVELS, ice, "kg kg-1"), "QNICE": (LEVELS, 1e8 * ice, "kg-1")}
    cooler, drier = np.linspace(0, 120, NODES[0])[:, None, None], np.geomspace(0.2, 2e-4, NODES[0])[:, None, None]
    cold = {"T": lambda theta: theta - cooler, "QVAPOR": lambda q: q * drier}
    return write_wrf(folder / "wrfout_d01_test", WRFSpec(nz=NODES[0], extra=extra, change=cold, **more))


def analysis_of(scene: Scene, changes: dict[str, Any], controls: tuple[str, ...] = ("cloud_liquid",)) -> Analysis:
    """One that has found the first guess with some changes (functions of fields)."""
    assert scene.grid is not None
    wavelengths = np.array([550.0])
    where, albedo = np.ones(scene.grid.shape, bool), np.full((1, *scene.grid.shape[1:]), 0.2)
    held = Controls.of(scene, controls, wavelengths, where, albedo, 0)
    first = held.first()
    state = first.copy(deep=True)
    for name, change in changes.items():
        state[name].values[:] = change(state[name].values)
    rows: Any = SimpleNamespace(scene=scene, controls=held, wavelengths_nm=wavelengths)
    nothing: Any = None
    return Analysis(rows, state, first, nothing, np.zeros(1), nothing, nothing, "linear")


def fields(path: Path) -> dict[str, np.ndarray]:
    with netCDF4.Dataset(path) as file:
        file.set_auto_maskandscale(False)
        return {name: np.asarray(variable[:]) for name, variable in file.variables.items()}


def different(one: Path, other: Path) -> set[str]:
    before, after = fields(one), fields(other)
    assert before.keys() == after.keys()
    return {name for name in before if before[name].tobytes() != after[name].tobytes()}


def humidity(path: Path, ice: bool = False) -> np.ndarray:
    """Of both times, over water or ice, by the formulae of Murphy and Koop (2005), not those of the package."""
    f = fields(path)
    pressure = (f["P"] + f["PB"]).astype(float)
    t = (f["T"] + 300.0) * (pressure / 1e5) ** (2 / 7)
    over_ice = np.exp(9.550426 - 5723.265 / t + 3.53068 * np.log(t) - 0.00728332 * t)
    over_water = np.exp(
        54.842763 - 6763.22 / t - 4.21 * np.log(t) + 0.000367 * t
        + np.tanh(0.0415 * (t - 218.8)) * (53.878 - 1331.22 / t - 9.44523 * np.log(t) + 0.014025 * t)
    )  # fmt: skip
    vapour = f["QVAPOR"] * pressure / (0.622 + f["QVAPOR"])
    return np.asarray(vapour / np.where(ice & (t < 273.15), over_ice, over_water))


def liquid_added(model: Path, out: Path, time: int) -> np.ndarray:
    """kg m-3 of liquid more in the dry air of the model, whose mass an increment does not change."""
    f = fields(model)
    pressure = (f["P"] + f["PB"]).astype(float)
    t = (f["T"] + 300.0) * (pressure / 1e5) ** (2 / 7)
    density = pressure / (287.0 * t * (1 + f["QVAPOR"] * 461.6 / 287.0))
    return np.asarray((density * (fields(out)["QCLOUD"] - f["QCLOUD"]))[time])


def blob(shape: tuple[int, ...] = NODES) -> np.ndarray:
    z, y, x = (np.arange(n) for n in shape)
    bump = np.exp(-(((z[:, None, None] / shape[0] - 0.35) / 0.12) ** 2) - ((y[:, None] - 3) ** 2 + (x - 3) ** 2) / 3)
    return np.where(bump > 0.1, 4e-4 * bump, 0.0)


@pytest.mark.parametrize("format", ["NETCDF4", "NETCDF3_64BIT_OFFSET"])
def test_nothing_found_changes_no_bit(tmp_path: Path, format: str) -> None:
    model, out = wrf(tmp_path, format=format), tmp_path / "out.nc"
    found = analysis_of(open_scene(model, time=SECOND), {}, ("cloud_liquid", "cloud_ice", "ice_number"))
    assert write_back(found, model, out) == {}
    assert different(model, out) == set()
    assert out.read_bytes() == model.read_bytes()


def test_an_added_blob_keeps_its_mass_in_saturated_air(tmp_path: Path) -> None:
    model, out = wrf(tmp_path), tmp_path / "out.nc"
    scene = open_scene(model, time=SECOND)
    kept = model.read_bytes()
    changed = write_back(analysis_of(scene, {"liquid_content": lambda q: np.maximum(q, blob())}), model, out)
    assert model.read_bytes() == kept
    assert set(changed) == {"QCLOUD", "QVAPOR"} == different(model, out)
    before, after = fields(model), fields(out)
    for name in changed:
        np.testing.assert_array_equal(before[name][0], after[name][0])  # the other time
    added = blob() > 0
    np.testing.assert_array_equal(before["QVAPOR"][1][~added], after["QVAPOR"][1][~added])
    assert (humidity(model)[1][added] < 0.9).any()
    np.testing.assert_allclose(humidity(out)[1][added], 1.0, atol=0.008)  # two formulae of saturation
    np.testing.assert_allclose(liquid_added(model, out, 1), blob(), rtol=1e-5, atol=1e-9)
    # read again, dry air is a little thinner at the same pressure, since vapour is more
    again = open_scene(out, time=SECOND)
    column = (again.data.liquid_content - scene.data.liquid_content).values.sum(axis=0)
    want = blob().sum(axis=0)
    np.testing.assert_allclose(column[want > 0], want[want > 0], rtol=0.02)


def test_of_an_ensemble_in_one_file_one_member_is_changed(tmp_path: Path) -> None:
    model = stacked(wrf(tmp_path), tmp_path / "ensemble.nc", lambda dims: ("member", *dims), [3, 7])
    out, scene = tmp_path / "out.nc", open_scene(model, time=SECOND, member=7)
    found = analysis_of(scene, {"liquid_content": lambda q: np.maximum(q, blob())})
    changed = write_back(found, model, out, member=7)
    assert set(changed) == {"QCLOUD", "QVAPOR"} == different(model, out)
    before, after = fields(model), fields(out)
    for name in changed:
        rest = np.ones(before[name].shape[:2], bool)
        rest[1, 1] = False
        np.testing.assert_array_equal(before[name][rest], after[name][rest])
    np.testing.assert_array_equal(after["QCLOUD"][1, 1] > before["QCLOUD"][1, 1], blob() > scene.data.liquid_content)


def test_doubles_keep_their_bits_and_packed_water_is_refused(tmp_path: Path) -> None:
    model, out = wrf(tmp_path), tmp_path / "out.nc"
    with netCDF4.Dataset(model, "r+") as file:
        for name in ("QCLOUD", "QVAPOR"):
            file.renameVariable(name, f"single_{name}")
            double = file.createVariable(name, "f8", ("Time", *LEVELS))
            double.units = "kg kg-1"
            double[:] = np.asarray(file[f"single_{name}"][:], float) * (1 + 1e-9)
    found = analysis_of(open_scene(model, time=SECOND), {"liquid_content": lambda q: np.maximum(q, blob())})
    changed = write_back(found, model, out)
    before, after = fields(model), fields(out)
    assert {name: np.count_nonzero(before[name] != after[name]) for name in changed} == changed
    with netCDF4.Dataset(model, "r+") as file:
        file["QVAPOR"].least_significant_digit = 4
    with pytest.raises(UserError, match=r"QVAPOR has .* would be rounded.*ncatted -a least_significant_digit,QVAPOR"):
        check_write_back([model], tmp_path / "other.nc", "cloud_liquid")
    with netCDF4.Dataset(model, "r+") as file:
        file["QVAPOR"].delncattr("least_significant_digit")
        file["QCLOUD"].scale_factor = 2.0
    with pytest.raises(UserError, match=r"QCLOUD is packed.*ncpdq"):
        check_write_back([model], tmp_path / "other.nc", "cloud_liquid")


def test_numbers_of_the_other_byte_order_are_put_back(tmp_path: Path) -> None:
    model, out = wrf(tmp_path), tmp_path / "out.nc"
    with netCDF4.Dataset(model, "r+") as file:
        for name in ("QCLOUD", "QVAPOR"):
            file.renameVariable(name, f"own_{name}")
            other = file.createVariable(name, ">f4", ("Time", *LEVELS), endian="big")
            other.units = "kg kg-1"
            other[:] = file[f"own_{name}"][:]
    found = analysis_of(open_scene(model, time=SECOND), {"liquid_content": lambda q: np.maximum(q, blob())})
    changed = write_back(found, model, out)
    before, after = fields(model), fields(out)
    assert {name: np.count_nonzero(before[name] != after[name]) for name in changed} == changed
    assert changed["QCLOUD"] > 0
    with netCDF4.Dataset(out) as file:
        assert file["QCLOUD"].endian() == "big"


@pytest.mark.parametrize("wrong", [np.nan, np.inf, 1e300])
def test_what_is_no_number_is_not_put_back(tmp_path: Path, wrong: float) -> None:
    model, out = wrf(tmp_path), tmp_path / "out.nc"
    out.write_text("as it was")
    scene = open_scene(model, time=SECOND)
    assert scene.grid is not None
    more = np.zeros(scene.grid.shape)
    more[1, 2, 3] = wrong
    with pytest.raises(UserError, match="write-back: QCLOUD would not be finite"), np.errstate(all="ignore"):
        put_increments(model, out, scene.grid, {"liquid_content": more}, scene.time)
    assert out.read_text() == "as it was"
    assert {each.name for each in tmp_path.iterdir()} == {model.name, "out.nc"}


def test_removed_cloud_leaves_air_below_saturation(tmp_path: Path) -> None:
    model, out = wrf(tmp_path), tmp_path / "out.nc"
    with netCDF4.Dataset(model, "r+") as file:
        moist = 0.015 * np.geomspace(1, 1e-3, NODES[0])
        file["QVAPOR"][:] = np.broadcast_to(moist[:, None, None], (2, *NODES))
    assert humidity(model)[1, 1].min() > 1
    assert humidity(model, ice=True)[1, 8].min() > 1
    scene = open_scene(model, time=SECOND)
    controls = ("cloud_liquid", "cloud_ice")
    gone = {"liquid_content": lambda q: 0 * q, "ice_content": lambda q: np.where(np.arange(7) < 3, 0.6 * q, 0 * q)}
    write_back(analysis_of(scene, gone, controls), model, out)
    before, after = fields(model), fields(out)
    assert not after["QCLOUD"][1].any()
    np.testing.assert_allclose(after["QICE"][1, 8, :, :3], 0.6 * before["QICE"][1, 8, :, :3], rtol=1e-6)
    assert not after["QICE"][1, ..., 3:].any()
    np.testing.assert_allclose(humidity(out)[1, 1], 0.95, atol=0.008)
    np.testing.assert_allclose(humidity(out, ice=True)[1, 8, :, 3:], 0.95, atol=0.008)
    np.testing.assert_array_equal(after["QVAPOR"][1, 8, :, :3], before["QVAPOR"][1, 8, :, :3])  # some ice is left
    np.testing.assert_array_equal(after["QVAPOR"][1, 3], before["QVAPOR"][1, 3])  # clear before and after


def test_traces_of_cloud_move_vapour_by_their_share(tmp_path: Path) -> None:
    """Cloud is 1e-6 kg/kg: of less, vapour goes its share of the way, up as well as down, in a straight line."""
    dry = np.full(7, 2e-3, np.float32)
    pressure, temperature, zero = np.full(7, 8e4), np.full(7, 280.0), np.zeros(7)
    amounts = np.array([0.0, 1e-12, 1e-8, 2.5e-7, 5e-7, 1e-6, 1e-3])
    shares = [0, 1e-6, 0.01, 0.25, 0.5, 1, 1]

    def vapour(start: np.ndarray, liquid: tuple[Any, Any], ice: tuple[Any, Any] = (0, 0)) -> np.ndarray:
        before, after = ({"liquid": zero + liquid[n], "ice": zero + ice[n]} for n in (0, 1))
        return vapour_beside_cloud(start, pressure, temperature, before, after)

    saturated = 0.622 * 991.9 / (8e4 - 991.9)  # Murphy and Koop (2005) at 280 K
    np.testing.assert_allclose(vapour(dry, (0, amounts)), 2e-3 + shares * (saturated - dry), rtol=2e-3)
    assert vapour(dry, (0, amounts))[0] == dry[0]
    np.testing.assert_array_equal(vapour(dry, (1e-3, 1e-3)), dry)  # cloud as it was
    moist = np.full(7, 9e-3, np.float32)
    lowered = 0.622 * 0.95 * 991.9 / (8e4 - 0.95 * 991.9)
    for taken in ((amounts, 0), (1e-3, 1e-6 - np.minimum(amounts, 1e-6))):  # little was there; little is left
        np.testing.assert_allclose(vapour(moist, taken), 9e-3 + shares * (lowered - moist), rtol=2e-3)
    cold, nothing = np.full(7, 250.0), {"liquid": zero, "ice": zero}
    both = {"liquid": zero + 1e-9, "ice": zero + 1e-4}
    mixed = vapour_beside_cloud(zero.astype(np.float32), pressure, cold, nothing, both)
    np.testing.assert_allclose(mixed, 0.622 * 76.0 / (8e4 - 76.0), rtol=5e-3)  # over ice: the liquid is a trace


def test_numbers_that_are_controlled_are_put_back(tmp_path: Path) -> None:
    model, out = wrf(tmp_path), tmp_path / "out.nc"
    found = analysis_of(open_scene(model), {"ice_number": lambda n: 1.5 * n}, ("cloud_ice", "ice_number"))
    assert write_back(found, model, out) == {"QNICE": NODES[1] * NODES[2]}
    np.testing.assert_allclose(fields(out)["QNICE"][0, 8], 1.5 * fields(model)["QNICE"][0, 8], rtol=1e-6)


def test_categories_of_a_species_share_its_increment(tmp_path: Path) -> None:
    model, out = wrf(tmp_path), tmp_path / "out.nc"
    with netCDF4.Dataset(model, "r+") as file:
        for name, share in (("QGRAUP", 3e-4), ("QHAIL", 1e-4)):
            file.createVariable(name, "f4", ("Time", *LEVELS)).units = "kg kg-1"
            file[name][:] = np.broadcast_to(share * (np.arange(NODES[0]) == 4)[:, None, None], (2, *NODES))
    scene = open_scene(model)
    write_back(analysis_of(scene, {"graupel_content": lambda q: 2 * q}, ("graupel_content",)), model, out)
    np.testing.assert_allclose(fields(out)["QGRAUP"][0, 4], 6e-4, rtol=1e-6)
    np.testing.assert_allclose(fields(out)["QHAIL"][0, 4], 2e-4, rtol=1e-6)
    assert different(model, out) == {"QGRAUP", "QHAIL"}  # precipitation says nothing of vapour


def test_other_levels_keep_the_mass_of_columns(tmp_path: Path) -> None:
    """An analysis on level nodes of 200 m in part of the domain's columns; the file's levels are 1 km apart, uneven."""
    from openswim.scene import Grid

    model, out = wrf(tmp_path), tmp_path / "out.nc"
    scene = open_scene(model)
    assert scene.grid is not None
    z = np.arange(0.0, 11_800.0, 200.0)
    grid = Grid(scene.grid.x[1:6], scene.grid.y[:5], z, scene.grid.crs, scene.grid.earth_radius_m)
    more = 1e-4 * np.exp(-(((z - 5000) / 1500) ** 2))[:, None, None] * np.ones((1, 5, 5))
    put_increments(model, out, grid, {"liquid_content": more}, scene.time)
    found = np.trapezoid(liquid_added(model, out, 0), scene.grid.height_m, axis=0)
    np.testing.assert_allclose(found[:5, 1:6], np.trapezoid(more, z, axis=0), rtol=1e-3)
    assert np.abs(found[5:]).max() == 0


def test_what_cannot_be_put_back_is_told_in_a_line(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    model, out = wrf(tmp_path), tmp_path / "out.nc"
    scene = open_scene(model)
    found = analysis_of(scene, {"liquid_content": lambda q: q + blob()})
    with pytest.raises(UserError, match="would replace"):
        write_back(found, model, model)
    link = tmp_path / "link.nc"
    link.hardlink_to(model)
    with pytest.raises(UserError, match="would replace"):
        write_back(found, model, link)
    with pytest.raises(UserError, match="surface_albedo cannot be put back"):
        write_back(analysis_of(scene, {}, ("albedo",)), model, out)
    (tmp_path / "elsewhere").mkdir()
    other = wrf(tmp_path / "elsewhere", attributes=dict(DX=4000.0, DY=4000.0))
    wider = analysis_of(open_scene(other), {})
    with pytest.raises(UserError, match="columns are not those"):
        write_back(wider, model, out)
    scene.to_netcdf(tmp_path / "scene.nc")
    with pytest.raises(UserError, match="those of WRF can"):
        write_back(found, tmp_path / "scene.nc", out)
    assert not out.exists()
    config = tmp_path / "analysis.toml"
    config.write_text('openswim_analysis = 1\nmodel = "scene.nc"\n[background]\nlength_m = 300\n')
    asked = ["analyse", str(config), "-o", str(tmp_path / "found.nc"), "--write-back"]
    capsys.readouterr()
    assert run([*asked, str(out)]) == 2
    said = capsys.readouterr().err.strip()
    assert "those of WRF can" in said
    assert "\n" not in said
    config.write_text('openswim_analysis = 1\nmodel = "wrfout_d01_test"\n[background]\nlength_m = 300\n')
    assert run([*asked, str(model)]) == 2
    assert "would replace" in capsys.readouterr().err


@pytest.mark.slow
def test_the_command_line_writes_back(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    model, out = wrf(tmp_path, map_proj=0, attributes=dict(DX=500.0, DY=500.0)), tmp_path / "back.nc"
    with netCDF4.Dataset(model, "a") as file:  # a cloud through which the sun comes
        file["QCLOUD"][:] *= 0.03
    config = tmp_path / "analysis.toml"
    config.write_text(
        'openswim_analysis = 1\nmodel = "wrfout_d01_test"\ntime = "2005-08-28T15:00"\nsun = [140.0, 50.0]\n'
        '[observe]\ncontrols = ["cloud_liquid", "cloud_ice"]\n[background]\nlength_m = 800\n[analyse]\niterations = 4\n'
        "[[pyranometer]]\nx_m = 0.0\ny_m = 0.0\nw_m2 = 200.0\n"
    )
    target = tmp_path / "found.nc"
    assert run(["analyse", str(config), "-o", str(target), "--write-back", str(out)]) == 0
    said = capsys.readouterr().out
    assert "QCLOUD at" in said
    told = re.search(r"departures of ([0-9.]+) errors before, ([0-9.]+) after", said)
    assert told
    before, after = map(float, told.groups())
    assert after < 0.011 * before
    assert different(model, out) == {"QCLOUD", "QICE", "QVAPOR"}
    first, found, back = open_scene(model, time=SECOND).data, open_scene(target).data, open_scene(out, time=SECOND).data
    for name in ("liquid_content", "ice_content"):  # but for the density of dry air beside more vapour
        moved, left = (np.abs(one[name].values - found[name].values).sum() for one in (first, back))
        assert left < 0.016 * moved
