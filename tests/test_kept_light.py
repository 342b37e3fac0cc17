"""Light that was kept on disk gives the pictures of that which was saved, bit for bit; what does not fit is told."""

from __future__ import annotations

import json
import shutil
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from tests.transport.scenes import grid_scene

import openswim
from openswim import Camera, Solver, UserError
from openswim.kept_light import checksum_of
from openswim.pictures.viewpoint import LitScene
from openswim.scene import Scene
from openswim.scene.procedural import demo_scene

WAVELENGTHS = (640.0, 615.0, 546.0, 500.0, 450.0)  # two packs


@pytest.fixture(autouse=True)
def undivided(monkeypatch: pytest.MonkeyPatch) -> None:
    """Cells stay as they are: light is the same bit for bit whether there are few nodes or many."""
    monkeypatch.setattr("openswim.transport.medium.levels.MOST_RESOLVED_NODES", 1)


def cloud(shape: tuple[int, int, int]) -> np.ndarray:
    out = np.zeros(shape, np.float32)
    out[shape[0] // 2, 3:-3, 3:-3] = 3e-3
    return out


@cache
def scenes() -> dict[str, Scene]:
    wide = grid_scene(cloud((6, 12, 12)), (6, 12, 12), (10_000.0, 10_000.0, 500.0), curved=True, air=True)
    return {
        "demo": demo_scene(32, 32, 16),
        "clear": Scene.clear(47.0, 8.0, time=np.datetime64("2024-06-21T10:00")),
        "wide cells": wide,
        "flat": grid_scene(cloud((6, 12, 12)), (6, 12, 12), (100.0, 100.0, 100.0)),
    }


CASES = [("demo", "fast"), ("demo", "swim"), ("clear", "fast"), ("wide cells", "fast"), ("flat", "fast")]


def pictures(lit: LitScene) -> list[np.ndarray]:
    frame = lit.field.frame
    lat, lon = lit.scene.place if frame.curved else (0.0, 0.0)
    place: dict[str, Any] = {"lat": lat, "lon": lon} if frame.curved else {"x_m": 10.0, "y_m": -20.0}
    return [
        openswim.render(lit, camera)["radiance"].values
        for camera in (Camera.panorama(**place, size=(12, 24)), Camera.allsky(**place, height_m=900.0, size=12))
    ]


@pytest.mark.parametrize(("which", "name"), CASES)
def test_pictures_from_kept_light_are_the_same(which: str, name: str, tmp_path: Path) -> None:
    solver = Solver(name, tolerance=0.3) if name == "fast" else Solver(name)
    wavelengths = WAVELENGTHS[1:4] if which == "demo" else WAVELENGTHS
    lit = openswim.light(scenes()[which], solver, wavelengths, sun=(200.0, 40.0))
    lit.save(tmp_path / "light.zarr")
    kept = openswim.open_light(tmp_path / "light.zarr")
    for own, theirs in zip(pictures(lit), pictures(kept), strict=True):
        np.testing.assert_array_equal(own, theirs)
    assert kept.field.fluxes().keys() == lit.field.fluxes().keys()  # type: ignore[union-attr]
    for own, theirs in zip(lit.field.fluxes().values(), kept.field.fluxes().values(), strict=True):  # type: ignore[union-attr]
        np.testing.assert_array_equal(own, theirs)


@pytest.mark.parametrize(("which", "time", "names"), [
    ("demo", "2024-04-08T18:10", "sun"), ("clear", "2024-04-08T18:42", "sun"),
    ("wide cells", "2024-02-10T17:55", "sun sky"),
])  # fmt: skip
def test_eclipses_and_nights_are_kept(which: str, time: str, names: str, tmp_path: Path) -> None:
    """Dallas half an hour before totality and in it, and a late dusk with lamps on the ground; also from so high that
    the air on all sides of the Earth is seen."""
    if which == "demo":
        scene = demo_scene(16, 16, 16, latitude=32.8, longitude=-96.8)
    else:
        scene = Scene.clear(32.8, -96.8) if which == "clear" else scenes()[which]
    lit = openswim.light(scene, Solver(tolerance=0.3), time=time)
    assert [light.name for light in lit.lights] == names.split()
    lit.save(tmp_path / "light.zarr")
    kept = openswim.open_light(tmp_path / "light.zarr")
    far = Camera.allsky(*scene.place, height_m=8e5, size=10)
    every = [[*pictures(each), openswim.render(each, far)["radiance"].values] for each in (lit, kept)]
    for own, theirs in zip(*every, strict=True):
        np.testing.assert_array_equal(own, theirs)
    eclipse = lit.field.lit[0].eclipse  # type: ignore[union-attr]
    assert (eclipse is not None and eclipse.dimmed.here.max() < 0.7) == (names == "sun")


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("kept") / "light.zarr"
    openswim.light(scenes()["flat"], Solver(tolerance=0.3), sun=(200.0, 40.0)).save(path)
    return path


@pytest.fixture
def copy(folder: Path, tmp_path: Path) -> Path:
    return Path(shutil.copytree(folder, tmp_path / "light.zarr"))


def changed(path: Path, **new: Any) -> Path:
    """With other attributes, and the checksum of these."""
    attributes = path / ".zattrs"
    about = json.loads(attributes.read_text()) | new
    del about["checksum"]
    attributes.write_text(json.dumps(about | {"checksum": checksum_of(about)}))
    return path


def test_light_of_another_scene_or_layout_is_refused(copy: Path) -> None:
    other = grid_scene(2 * cloud((6, 12, 12)), (6, 12, 12), (100.0, 100.0, 100.0))
    with pytest.raises(UserError, match="of another scene"):
        openswim.open_light(copy, other)
    with pytest.raises(UserError, match="layout 99, this OpenSWIm reads 9"):
        openswim.open_light(changed(copy, version=99))
    with pytest.raises(UserError, match="no kept light"):
        openswim.open_light(changed(copy, kind="something else"))
    with pytest.raises(UserError, match="no folder of kept light"):
        openswim.open_light(copy / "none")


def nested(tree: Any) -> list[dict[str, Any]]:
    """All mappings within a description."""
    if isinstance(tree, dict):
        return [tree, *(each for value in tree.values() for each in nested(value))]
    return [each for value in tree for each in nested(value)] if isinstance(tree, list) else []


@pytest.mark.parametrize("seed", range(12))
def test_a_changed_description_is_refused(copy: Path, seed: int) -> None:
    """Names of arrays that are exchanged, kinds that are none: never a kernel that reads beside its arrays."""
    rng = np.random.default_rng(seed)
    light = json.loads((copy / ".zattrs").read_text())["lights"]
    arrays = [each for each in nested(light) if "array" in each]
    kinds = [each for each in nested(light) if "kind" in each]
    if seed % 3 == 0:
        kinds[rng.integers(len(kinds))]["kind"] = "Path"
    elif seed % 3 == 1:
        del kinds[rng.integers(len(kinds))]["kind"]
    else:
        light[0]["packs"][0][0]["channels"]["beam"] = arrays[rng.integers(len(arrays))]
        light[0]["packs"][0][0]["channels"]["forward_depth"] = arrays[rng.integers(len(arrays))]
    with pytest.raises(UserError, match="damaged"):
        openswim.open_light(changed(copy, lights=light))


def test_light_from_above_of_another_shape_is_refused(tmp_path: Path) -> None:
    """Kernels read it by the sun over each column."""
    path = tmp_path / "light.zarr"
    openswim.light(scenes()["wide cells"], sun=(200.0, 40.0)).save(path)
    lights = json.loads((path / ".zattrs").read_text())["lights"]
    above = lights[0]["packs"][0][0]["light"]["columns"]["above"]
    for name in ("inflow", "lacking", "sun_table", "missed"):
        own, above[name] = above[name], lights[0]["packs"][0][0]["medium"]["terrain_m"]
        with pytest.raises(UserError, match="damaged"):
            openswim.open_light(changed(path, lights=lights))
        above[name] = own
    openswim.open_light(changed(path, lights=lights))


@pytest.mark.parametrize("checksum", ["kept", "gone"])
def test_a_changed_number_of_the_description_is_refused(copy: Path, checksum: str) -> None:
    """Such as the width of cells, of which the arrays know nothing."""
    about = json.loads((copy / ".zattrs").read_text())
    about["lights"][0]["packs"][0][0]["medium"]["cell_m"]["tuple"][0] += 1.0
    if checksum == "gone":
        del about["checksum"]
    (copy / ".zattrs").write_text(json.dumps(about))
    with pytest.raises(UserError, match=r"damaged .*description"):
        openswim.open_light(copy)


def test_missing_arrays_are_refused(copy: Path) -> None:
    shutil.rmtree(next((copy / "arrays").rglob("beam")))
    with pytest.raises(UserError, match="damaged"):
        openswim.open_light(copy)


def test_lost_and_changed_pieces_of_arrays_are_refused(copy: Path) -> None:
    """Of a chunk that is not there Zarr makes zeros; a chunk of zeros, it does not write. One after another is lost or
    changed."""
    pieces = sorted(each for each in (copy / "arrays").rglob("*") if each.is_file() and not each.name.startswith("."))
    assert len(pieces) > 20
    for number, piece in enumerate(pieces[::3]):
        kept = piece.read_bytes()
        lost = number % 2 == 0 and any(kept)
        if lost:
            piece.unlink()
        else:
            piece.write_bytes(bytes([kept[0] ^ 1]) + kept[1:])
        with pytest.raises(UserError, match="is not what was saved" if lost else "damaged"):
            openswim.open_light(copy)
        piece.write_bytes(kept)
    openswim.open_light(copy)


def test_what_keeps_no_light_says_so(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    scene = scenes()["flat"]
    with pytest.raises(UserError, match="reference keeps no light"):
        openswim.light(scene, Solver("reference", paths=2), sun=(200.0, 40.0)).save(tmp_path / "a")

    monkeypatch.setattr("openswim.transport.medium.plan.LARGE_COLUMNS", 100)
    large = openswim.light(scenes()["wide cells"], sun=(200.0, 40.0))
    with pytest.raises(UserError, match="so many columns"):
        large.save(tmp_path / "b")
    assert not list(tmp_path.iterdir())


def test_the_users_own_ground_is_kept_but_for_its_maps(tmp_path: Path) -> None:
    """A name of a file that is never opened: maps are not of this place, and not asked for."""
    scene = replace(scenes()["clear"], ground=openswim.Ground(chlorophyll_mg_m3=3.0, mountains=False))
    openswim.light(scene, sun=(200.0, 40.0)).save(tmp_path / "light.zarr")
    assert openswim.open_light(tmp_path / "light.zarr").scene.ground.chlorophyll_mg_m3 == 3.0  # type: ignore[union-attr]
    about = json.loads((tmp_path / "light.zarr" / ".zattrs").read_text())
    about["ground"][0]["maps"] = 1
    changed(tmp_path / "light.zarr", ground=about["ground"])
    with pytest.raises(UserError, match=r"own maps.*open_light\(path, scene\)"):
        openswim.open_light(tmp_path / "light.zarr")


def test_light_of_bands_is_kept_by_its_terms(tmp_path: Path) -> None:
    lit = openswim.light(scenes()["clear"], "fast", (550.0, 940.0), sun=(200.0, 40.0))  # five terms
    lit.save(tmp_path / "light.zarr")
    own, theirs = (pictures(one)[0] for one in (lit, openswim.open_light(tmp_path / "light.zarr")))
    assert own.shape == (12, 24, 2)
    np.testing.assert_array_equal(own, theirs)
