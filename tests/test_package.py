"""The package as a whole: cheap to import, its names in place, its dependencies explained."""

import ast
import importlib
import importlib.util
import re
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

import openswim

ROOT = Path(__file__).parents[1]


def _dependencies() -> set[str]:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    wanted = [
        *project["dependencies"],
        *(d for extra in project["optional-dependencies"].values() for d in extra),
    ]
    return {re.split(r"[<>=!~ ]", line)[0].lower() for line in wanted if not line.startswith("openswim[")}


def test_the_extra_all_has_every_optional_library() -> None:
    extras = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]["optional-dependencies"]
    (line,) = extras["all"]
    assert set(line.removeprefix("openswim[").removesuffix("]").split(",")) == set(extras) - {"all", "dev"}


def test_import_loads_nothing_heavy() -> None:
    code = (
        "import sys, openswim; heavy = {'numpy', 'xarray', 'numba', 'rich', 'click'};"
        "sys.exit(', '.join(sorted(heavy & set(sys.modules))) or 0)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr


@pytest.mark.parametrize("name", sorted(set(openswim.__all__) - {"__version__"}))
def test_public_names_are_there(name: str) -> None:
    assert getattr(openswim, name) is not None
    assert name in dir(openswim)


def test_an_unknown_name_is_an_attribute_error() -> None:
    assert not hasattr(openswim, "camera")


def test_rooms_may_be_named_without_their_own_import() -> None:
    code = (
        "import openswim; openswim.colour.save; openswim.satellites.reflectance\n"
        "assert not hasattr(openswim, '__main__') and not hasattr(openswim, 'color')"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr


def test_every_dependency_has_its_reason() -> None:
    page = (ROOT / "docs" / "dependencies.md").read_text().lower()
    explained = set(re.findall(r"^\| `([^`]+)` \|", page, flags=re.MULTILINE))
    assert explained == _dependencies()


def test_readme_has_exactly_the_two_commands_first() -> None:
    blocks = re.findall(
        r"^```\w*\n(.*?)^```", (ROOT / "README.md").read_text(), flags=re.MULTILINE | re.DOTALL
    )
    commands = blocks[0].strip().splitlines()
    assert commands == ["pip install -e . && openswim demo", 'pip install -e ".[dev]" && tests/run']


def test_every_picture_and_page_the_readme_names_exists() -> None:
    for target in re.findall(r"\]\(([^)#:]+)\)", (ROOT / "README.md").read_text()):
        assert (ROOT / target).exists(), target


def test_tools_import_names_that_there_are() -> None:
    """Scripts that make the pictures of the docs are run by hand alone, long after what they use may have moved."""
    for path in sorted((ROOT / "tools").glob("*.py")):
        for node in ast.walk(ast.parse(path.read_text("utf-8"))):
            if isinstance(node, ast.ImportFrom) and str(node.module).startswith("openswim"):
                module = importlib.import_module(str(node.module))
                for name in node.names:
                    known = hasattr(module, name.name) or importlib.util.find_spec(f"{node.module}.{name.name}")
                    assert known, f"{path.name}: {node.module}.{name.name}"
