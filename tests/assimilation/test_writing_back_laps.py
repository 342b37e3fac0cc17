"""Increments put back into LAPS products: as for WRF, in copies of several files."""

from __future__ import annotations

from pathlib import Path

import netCDF4
import numpy as np
import pytest
import xarray as xr
from tests.assimilation.test_writing_back import analysis_of
from tests.readers.model_files import NX, NY, NZ, laps

from openswim import UserError, open_scene
from openswim.assimilation import write_back
from openswim.assimilation.config import read_config
from openswim.readers.models.laps_increments import check_files

FLOOR = 2e-6  # kg m-3: liquid, and a fifth of it as ice, that an analysis does not take for clear air


def products(folder: Path) -> list[Path]:
    """lwc, lt1 and lq3: dry, cold aloft, no cloud in the west, nothing known of one column's lowest level."""
    folder.mkdir()
    paths = laps(folder).paths[:3]
    with netCDF4.Dataset(paths[0], "r+") as file:
        for name in ("lwc", "ice"):
            file[name][0, :, :, :4] = 0.0
        for name in ("lwc", "ice", "rai", "sno", "pic"):
            file[name][0, 0, 0, 5] = 1e37
    with netCDF4.Dataset(paths[1], "r+") as file:
        file["t3"][0] = np.linspace(285.0, 235.0, NZ)[:, None, None]
    with netCDF4.Dataset(paths[2], "r+") as file:
        file["sh"][0] = np.geomspace(1.5e-3, 5e-5, NZ)[:, None, None]
    return paths


def fields(path: Path) -> dict[str, np.ndarray]:
    with netCDF4.Dataset(path) as file:
        file.set_auto_maskandscale(False)
        return {name: np.asarray(variable[:]) for name, variable in file.variables.items()}


def humidity(folder: Path, ice: bool = False) -> np.ndarray:
    """Over water or ice (nz, ny, nx), by Murphy and Koop (2005)."""
    air, vapour = fields(folder / "241731200.lt1"), fields(folder / "241731200.lq3")
    t, q = air["t3"][0].astype(float), vapour["sh"][0].astype(float)
    pressure = 100.0 * fields(folder / "241731200.lwc")["level"].astype(float)[:, None, None]
    over_ice = np.exp(9.550426 - 5723.265 / t + 3.53068 * np.log(t) - 0.00728332 * t)
    over_water = np.exp(
        54.842763 - 6763.22 / t - 4.21 * np.log(t) + 0.000367 * t
        + np.tanh(0.0415 * (t - 218.8)) * (53.878 - 1331.22 / t - 9.44523 * np.log(t) + 0.014025 * t)
    )  # fmt: skip
    return np.asarray(q * pressure / (0.622 + 0.378 * q) / np.where(ice & (t < 273.15), over_ice, over_water))


def test_water_and_humidity_are_put_into_their_own_products(tmp_path: Path) -> None:
    paths = products(tmp_path / "in")
    kept = [path.read_bytes() for path in paths]
    out = tmp_path / "out"
    out.mkdir()
    more = np.zeros((NZ, NY, NX))
    more[3:6, 2:5, 1:3] = 2e-4
    found = analysis_of(
        open_scene(paths),
        {"liquid_content": lambda q: np.where(more > 0, more, np.where(np.arange(NX) == 7, 0.0, q)),
         "ice_content": lambda q: np.where(np.arange(NX) == 7, 0.0, q)},
        ("cloud_liquid", "cloud_ice"),
    )  # fmt: skip
    changed = write_back(found, paths, out)
    assert set(changed) == {"lwc", "ice", "sh"}
    assert [path.read_bytes() for path in paths] == kept
    assert (out / paths[1].name).read_bytes() == kept[1]
    before, after = (fields(folder / paths[0].name) for folder in (tmp_path / "in", out))
    assert after["lwc"][0][more > 0] == pytest.approx(2e-4, rel=1e-5)
    assert after["lwc"][0][..., 7].max() < FLOOR
    same = (more == 0) & (np.arange(NX) != 7)
    assert np.array_equal(after["lwc"][0][same], before["lwc"][0][same])  # where nothing is known as well
    for name in ("rai", "sno", "pic", "level", "valtime", "La1"):
        assert after[name].tobytes() == before[name].tobytes()
    assert (humidity(tmp_path / "in")[more > 0] < 0.5).all()
    assert humidity(out)[more > 0] == pytest.approx(1.0, abs=0.008)  # two formulae of saturation
    was, now = (fields(folder / paths[2].name)["sh"][0] for folder in (tmp_path / "in", out))
    assert np.array_equal(was[more == 0], now[more == 0])  # where cloud went, the air was dry enough
    again = open_scene([out / path.name for path in paths]).data["liquid_content"].values
    assert again == pytest.approx(found.state["liquid_content"].values, abs=5e-8)  # the floor


def test_air_that_lost_its_cloud_is_left_below_saturation(tmp_path: Path) -> None:
    paths = products(tmp_path / "in")
    out = tmp_path / "out"
    out.mkdir()
    with netCDF4.Dataset(paths[2], "r+") as file:
        file["sh"][0] = 1.1 * file["sh"][0] / humidity(tmp_path / "in")
    assert humidity(tmp_path / "in").min() > 1.05
    gone = {name: (lambda q: np.where(np.arange(NX) == 7, 0.0, q)) for name in ("liquid_content", "ice_content")}
    write_back(analysis_of(open_scene(paths), gone, ("cloud_liquid", "cloud_ice")), paths, out)
    lost = fields(paths[0])["lwc"][0] > FLOOR
    lost[..., :7] = lost[..., 8:] = False
    assert lost.sum() > 20
    assert humidity(out)[lost] == pytest.approx(0.95, abs=0.008)  # more liquid than ice was there


def test_one_file_may_hold_all(tmp_path: Path) -> None:
    """A forecast (fua) has water, temperature and humidity in one file; its levels may go down."""
    paths = products(tmp_path / "in")
    whole = tmp_path / "241731200.fua"
    whole.write_bytes(paths[0].read_bytes())
    with netCDF4.Dataset(whole, "r+") as file:
        for path in paths[1:]:
            for name, values in fields(path).items():
                if name in ("ht", "t3", "sh"):
                    made = file.createVariable(name, "f4", ("record", "z", "y", "x"), fill_value=np.float32(1e37))
                    made.units = {"ht": "meters", "t3": "Kelvins", "sh": "kg/kg"}[name]
                    made[:] = values
        for name in ("lwc", "ice", "rai", "sno", "pic", "ht", "t3", "sh"):
            file[name][:] = file[name][:, ::-1]
        file["level"][:] = file["level"][::-1]
    scene, out = open_scene(whole), tmp_path / "out.nc"
    found = analysis_of(scene, {"liquid_content": lambda q: np.where(np.indices(q.shape)[0] == 4, q + 1e-4, q)})
    assert set(write_back(found, whole, out)) == {"lwc", "sh"}
    before, after = fields(whole)["lwc"][0], fields(out)["lwc"][0]
    assert after[NZ - 5] - before[NZ - 5] == pytest.approx(1e-4, rel=1e-3)
    assert np.array_equal(np.delete(after, NZ - 5, 0), np.delete(before, NZ - 5, 0))
    assert write_back(analysis_of(scene, {}), whole, out) == {}
    assert out.read_bytes() == whole.read_bytes()


def test_other_precisions_signs_and_containers(tmp_path: Path) -> None:
    """Doubles keep their bits, a file's own sign for nothing is heeded; what no copy can be put into is refused."""
    paths = products(tmp_path / "in")
    with netCDF4.Dataset(paths[0], "r+") as file:
        file.renameVariable("lwc", "single")
        double = file.createVariable("lwc", "f8", ("record", "z", "y", "x"), fill_value=-99.0)
        double.units = "kg/m3"
        single = np.asarray(file["single"][:].filled(np.nan), float)
        double[:] = np.where(np.isfinite(single), single * (1 + 1e-9), -99.0)
    out = tmp_path / "out"
    out.mkdir()
    everywhere = analysis_of(open_scene(paths), {"liquid_content": lambda q: q + 1e-5 * (np.indices(q.shape)[2] == 5)})
    write_back(everywhere, paths, out)
    before, after = (fields(folder / paths[0].name)["lwc"][0] for folder in (tmp_path / "in", out))
    assert after[0, 0, 5] == -99
    assert np.count_nonzero(before != after) == NZ * NY - 1
    with xr.open_dataset(paths[2], decode_times=False) as data:
        data[["sh", "level"]].to_zarr(tmp_path / "lq3.zarr", zarr_format=2)
    with pytest.raises(UserError, match=r"lq3\.zarr: only netCDF"):
        check_files([*paths[:2], tmp_path / "lq3.zarr"])
    with netCDF4.Dataset(paths[2], "r+") as file:
        file["sh"].add_offset = 1.0
    with pytest.raises(UserError, match="sh is packed"):
        check_files(paths)


def test_all_products_are_written_or_none(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    paths = products(tmp_path / "in")
    found = analysis_of(open_scene(paths), {"liquid_content": lambda q: q + 1e-5})
    out = tmp_path / "out"
    out.mkdir()
    copied: list[Path] = []

    def full(path: Path, target: Path) -> None:
        copied.append(path)
        if len(copied) == len(paths):
            raise OSError(28, "No space left on device")
        target.write_bytes(path.read_bytes())

    monkeypatch.setattr("openswim.readers.models.laps_increments.shutil.copyfile", full)
    with pytest.raises(UserError, match="No space left"):
        write_back(found, paths, out)
    assert not list(out.iterdir())


def test_what_cannot_be_put_into_laps_is_told_in_a_line(tmp_path: Path) -> None:
    paths = products(tmp_path / "in")
    found = analysis_of(open_scene(paths), {"liquid_content": lambda q: q + 1e-5})
    with pytest.raises(UserError, match="name a folder that exists"):
        write_back(found, paths, tmp_path / "none")
    with pytest.raises(UserError, match="would replace"):
        write_back(found, paths, tmp_path / "in")
    (tmp_path / "out").mkdir()
    with pytest.raises(UserError, match="give the lq3 product"):
        write_back(found, paths[:2], tmp_path / "out")
    config = tmp_path / "in" / "analysis.toml"
    names = ", ".join(f'"{path.name}"' for path in paths)
    config.write_text(f"openswim_analysis = 1\nmodel = [{names}]\n[background]\nlength_m = 300\n")
    assert read_config(config).models == tuple(paths)
    config.write_text('openswim_analysis = 1\nmodel = ["x", 3]\n[background]\nlength_m = 300\n')
    with pytest.raises(UserError, match="no such file"):
        read_config(config)
