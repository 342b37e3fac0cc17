"""The wheel by itself, outside of the tree: all modules, their data, and the command."""

import os
import subprocess
import sys
import zipfile
from email.parser import Parser
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
PACKAGE = ROOT / "src" / "openswim"

# All modules are imported, and everything that ships as a table is read once.
USE = """
import pkgutil, sys
from importlib import import_module
import openswim
assert openswim.__file__.startswith(sys.argv[1]), openswim.__file__
for module in pkgutil.walk_packages(openswim.__path__, "openswim."):
    if not module.name.endswith("__main__"):
        import_module(module.name)
from openswim.colour.cie import standard_observer
from openswim.colour.spectrum import green_canopy
from openswim.fluxes.gases import ozone_optical_depth
from openswim.lights import solar_irradiance
from openswim.lights.stars import catalogue
from openswim.optics import aerosol_type
from openswim.optics.mie import phase_function
from openswim.optics.ozone import ozone_cross_section_m2
assert 0.9 < standard_observer()[1].max() < 2.0 and green_canopy()[1].max() < 1.0
assert ozone_optical_depth(600.0, 0.3) > 0 and ozone_cross_section_m2(600.0) > 0
assert len(catalogue()) == 8404
assert 1.5 < solar_irradiance(550.0) < 2.1
assert aerosol_type("dust").phase[550.0].asymmetry > 0.6 and phase_function("liquid", 550.0).asymmetry > 0.8
openswim.Scene.clear(47.0, 11.0).to_netcdf("clear.nc")
assert openswim.open_scene("clear.nc").atmosphere is not None
"""


@pytest.fixture(scope="module")
def unpacked(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The wheel's content in a folder of its own."""
    folder = tmp_path_factory.mktemp("wheel")
    build = [sys.executable, "-m", "hatchling", "build", "-t", "wheel", "-d", str(folder)]
    subprocess.run(build, cwd=ROOT, check=True, capture_output=True)
    (wheel,) = folder.glob("*.whl")
    with zipfile.ZipFile(wheel) as packed:
        packed.extractall(folder / "site")
    return folder / "site"


def _run(site: Path, *arguments: str) -> str:
    environment = os.environ | {"PYTHONPATH": str(site)}
    done = subprocess.run(
        [sys.executable, *arguments], cwd=site.parent, env=environment, capture_output=True, text=True
    )
    assert done.returncode == 0, done.stderr
    return done.stdout


def test_it_holds_every_module_and_all_data(unpacked: Path) -> None:
    def files(folder: Path) -> set[str]:
        return {
            str(path.relative_to(folder))
            for path in folder.rglob("*")
            if path.is_file() and "__pycache__" not in path.parts
        }

    packed = files(unpacked / "openswim")
    assert packed == files(PACKAGE)
    assert {Path(name).suffix for name in packed} >= {".py", ".csv", ".npz", ".typed"}


def test_it_works_outside_of_the_tree(unpacked: Path) -> None:
    _run(unpacked, "-c", USE, str(unpacked))


def test_its_command_answers(unpacked: Path) -> None:
    (described,) = unpacked.glob("openswim-*.dist-info")
    assert "openswim = openswim.cli.main:main" in (described / "entry_points.txt").read_text()
    assert "render" in _run(unpacked, "-m", "openswim", "--help")


def test_a_plain_installation_reads_grib(unpacked: Path) -> None:
    (described,) = unpacked.glob("openswim-*.dist-info")
    needs = Parser().parsestr((described / "METADATA").read_text("utf-8")).get_all("Requires-Dist")
    assert any(line.startswith("eccodes") and "extra" not in line for line in needs or [])
