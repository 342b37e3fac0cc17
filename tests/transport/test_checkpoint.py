"""Checkpoints: sums go on where they ended, each view's by itself, and nothing else is taken for one."""

from __future__ import annotations

import pickle
import zipfile
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from tests.transport.scenes import WAVELENGTH_NM, cloud_scene, down_on, grid_scene, toward

from openswim.errors import UserError
from openswim.scene import Scene
from openswim.solver import Solver
from openswim.transport.montecarlo import reference as montecarlo


def solve(scene: Scene, **options):
    return Solver("reference", **options).solve(scene, toward(200.0, 40.0), [WAVELENGTH_NM])


def test_resumed_is_uninterrupted(tmp_path: Path) -> None:
    rays, file = down_on(np.linspace(-200, 200, 10), 0.0, 2000.0), tmp_path / "sums.npz"
    whole = solve(cloud_scene(), paths=96).view(rays)
    solve(cloud_scene(), paths=32, checkpoint=file).view(rays)
    again = solve(cloud_scene(), paths=96, checkpoint=file).view(rays)
    np.testing.assert_allclose(again.radiance, whole.radiance, rtol=1e-6)
    np.testing.assert_allclose(again.sigma, whole.sigma, rtol=1e-5)
    other = solve(cloud_scene(), paths=8, seed=5, checkpoint=file).view(rays)  # not this view's sums
    assert other.paths == 8
    assert [p.name for p in tmp_path.iterdir()] == ["sums.npz"]


def _fingerprint(tmp_path: Path, scene: Scene) -> set[str]:
    """Names in the checkpoint of a view down on a scene."""
    file = tmp_path / "sums"
    file.unlink(missing_ok=True)
    solve(scene, paths=2, checkpoint=file).view(down_on(np.array([10.0, 60.0]), 0.0, 2000.0))
    with np.load(file) as stored:
        return set(stored)


@pytest.mark.parametrize(
    ("change", "curved"),
    [
        ({"cell_m": (300.0, 300.0, 100.0)}, False), ({"cell_m": (300.0, 300.0, 100.0)}, True),
        ({"periodic": True}, False), ({"wind_speed_m_s": 12.0}, True),
    ],
    ids=["spacing", "spacing on a sphere", "sides", "wind"],
)  # fmt: skip
def test_another_scene_has_another_fingerprint(change: dict, curved: bool, tmp_path: Path) -> None:
    def scene(cell_m=(100.0, 100.0, 100.0), periodic: bool = False, wind_speed_m_s: float = 4.0) -> Scene:
        shape = (4, 5, 5)
        more = {} if curved else {"periodic": periodic}
        made = grid_scene(np.full(shape, 1e-3, np.float32), shape, cell_m, curved=curved, **more)
        for name, value in (("wind_east_10m", wind_speed_m_s), ("wind_north_10m", 0.0), ("land_area_fraction", 0.0)):
            made.data[name] = (("y", "x"), np.full(shape[1:], value, np.float32))
        return made

    one = _fingerprint(tmp_path, scene())
    assert len(one) == 3
    assert _fingerprint(tmp_path, scene()) == one
    assert not _fingerprint(tmp_path, scene(**change)) & one


def _npy(file: Path) -> None:
    with file.open("wb") as out:
        np.save(out, np.zeros(3))


def _pickled(file: Path) -> None:
    file.write_bytes(pickle.dumps({"total": 1}))


def _zipped(file: Path) -> None:
    with zipfile.ZipFile(file, "w") as out:
        out.writestr("word/document.xml", "precious")


def _cut(file: Path) -> None:
    solve(cloud_scene(), paths=4, checkpoint=file).view(_RAYS)
    file.write_bytes(file.read_bytes()[:-100])


def _rewritten(change: Callable[[str, np.ndarray], np.ndarray]) -> Callable[[Path], None]:
    """A checkpoint of this very view, of which what is stored was changed."""

    def write(file: Path) -> None:
        solve(cloud_scene(), paths=4, checkpoint=file).view(_RAYS)
        with np.load(file) as stored:
            sums = {name: change(name, values) for name, values in stored.items()}
        with file.open("wb") as out:
            np.savez(out, **sums)

    return write


_WRONG = {
    "misshapen": lambda name, values: values[..., None],
    "NaN": lambda name, values: np.full_like(values, np.nan) if name.endswith("total") else values,
    "negative squares": lambda name, values: -values if name.endswith("squares") else values,
    "no paths": lambda name, values: 0 * values if name.endswith("paths") else values,
    "text": lambda name, values: values.astype("U"),
}


_RAYS = down_on(np.linspace(-200, 200, 4), 0.0, 2000.0)


def _unclosed(file: Path) -> None:
    """A header that is no Python, in a file whose sums are longer than what is checked with it."""
    with file.open("wb") as out:
        np.savez(out, **{f"{'a' * 16}_total": np.zeros(2000)})
    file.write_bytes(file.read_bytes().replace(b"(2000,)", b"(2000, "))


_WRITERS = {write.__name__.strip("_"): write for write in (Path.touch, _npy, _pickled, _zipped, _cut, _unclosed)}
_WRITERS |= {name: _rewritten(change) for name, change in _WRONG.items()}


@pytest.mark.parametrize("write", _WRITERS.values(), ids=_WRITERS)
def test_files_that_are_no_checkpoints_are_told_and_kept(write, tmp_path: Path) -> None:
    file = tmp_path / "sums"
    write(file)
    before = file.read_bytes()
    with pytest.raises(UserError, match=r"sums: damaged, or no checkpoint; choose"):
        solve(cloud_scene(), paths=4, checkpoint=file).view(_RAYS)
    assert file.read_bytes() == before


def test_a_checkpoint_that_cannot_be_written_is_told_before_any_path(tmp_path: Path, monkeypatch) -> None:
    monkeypatch.setattr(montecarlo, "path_kernel", None)
    with pytest.raises(UserError, match=r"checkpoint .*missing does not exist"):
        solve(cloud_scene(), paths=4, checkpoint=tmp_path / "missing" / "sums").view(_RAYS)
