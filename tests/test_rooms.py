"""Nobody reaches back: which rooms of the house may import which, imports for annotation alone included."""

import ast
from collections.abc import Iterator
from pathlib import Path

import pytest

import openswim

SOURCE = Path(openswim.__file__).parent

# each may import those before it and itself
ROOMS = ["errors", "arguments", "progress", "scene", "ground", "optics", "lights", "readers", "cameras", "colour",
         "fluxes", "transport", "solver", "outlines", "rendering", "validation", "cli", "__main__"]  # fmt: skip
IN_TRANSPORT = ["engine", "march", "air", "medium", "ground_light", "beam", "diffuse", "columns", "view", "swim"]
OF_GROUND = {"fields", "hills", "reflectance", "sample", "sky_view", "spectra", "water"}  # without maps, and any scene


def imports(file: Path) -> Iterator[str]:
    """Modules that a file imports of the package, inside functions and for annotation, too."""
    for node in ast.walk(ast.parse(file.read_text())):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names if alias.name.startswith("openswim."))
        elif isinstance(node, ast.ImportFrom) and node.module and node.module.split(".")[0] == "openswim":
            for alias in node.names:
                inner = SOURCE.parent.joinpath(*node.module.split("."), alias.name)
                is_module = inner.is_dir() or inner.with_suffix(".py").is_file()
                yield f"{node.module}.{alias.name}" if is_module else node.module


def arrows(folder: Path, depth: int) -> Iterator[tuple[str, str, str]]:
    """(room, imported room, file) of all files in a folder, rooms named by the ``depth``-th part of their name."""
    for file in sorted(folder.rglob("*.py")):
        own = ("openswim", *file.relative_to(SOURCE).with_suffix("").parts)
        for name in imports(file):
            theirs = name.split(".")
            if len(own) > depth and len(theirs) > depth and own[:depth] == tuple(theirs[:depth]):
                yield own[depth], theirs[depth], "/".join(own)


@pytest.mark.parametrize(("folder", "depth", "order"), [(SOURCE, 1, ROOMS), (SOURCE / "transport", 2, IN_TRANSPORT)])
def test_rooms_import_only_those_before_them(folder: Path, depth: int, order: list[str]) -> None:
    back = [
        f"{file} imports {there}"
        for here, there, file in arrows(folder, depth)
        if here in order and there in order and order.index(there) > order.index(here)
    ]
    assert not back


def test_transport_is_handed_matter_and_ground() -> None:
    for file in (SOURCE / "transport").rglob("*.py"):
        for name in imports(file):
            parts = name.split(".")[1:]
            assert parts[0] != "readers", file
            assert parts[:2] not in (["scene", "scene"], ["scene"]), file
            assert parts[0] != "ground" or set(parts[1:]) <= OF_GROUND, (file, name)
