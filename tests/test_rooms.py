"""The rooms of the house: what may import what, and how full a folder may be. Type-only imports count."""

from __future__ import annotations

import ast
from collections.abc import Iterable, Mapping
from functools import cache
from pathlib import Path

import pytest

SOURCE = Path(__file__).parents[1] / "src"

# A file may import from rooms to the left of its own.
ORDER = (
    "errors",
    "switches",
    "progress",
    "arguments",
    "system",
    "tables",
    "srgb",
    "scene",
    "optics",
    "lights",
    "ground",
    "readers",
    "options",
    "transport",
    "solver",
    "cameras",
    "colour",
    "fluxes",
    "heavens",
    "kept_light",
    "pictures",
    "lighting",
    "rendering",
    "films",
    "satellites",
    "observations",
    "comparison",
    "assimilation",
    "stations",
    "batches",
    "validation",
    "cli",
    "__main__",
)
MOST_MODULES = 20  # in a folder
# And within transport, whose files beside these rooms conduct them all.
TRANSPORT = ("engine", "ice", "march", "air", "medium", "ground_light", "beam", "diffuse", "columns", "lit", "swim",
             "view", "montecarlo", "linear")  # fmt: skip
GROUND_WITHOUT_MAPS = {"fields", "footprints", "hills", "reflectance", "sample", "sky_view", "spectra", "water"}

# =====================================================================================================================
# NOT YET CLEAN: folders whose files and rooms still import each other in circles. To be emptied, never added to.
NOT_YET_CLEAN: tuple[str, ...] = ()
# =====================================================================================================================

FILES = {
    ".".join(path.relative_to(SOURCE).with_suffix("").parts).removesuffix(".__init__"): path
    for path in SOURCE.rglob("*.py")
}
FACES = {name for name, path in FILES.items() if path.name == "__init__.py"}


def _named(tree: ast.AST) -> set[str]:
    """All that a file imports, by its full name."""
    names: set[str] = set()
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            names |= {each.name for each in node.names}
        elif isinstance(node, ast.ImportFrom):
            assert not node.level, f"line {node.lineno}: write the import in full"
            names |= {str(node.module), *(f"{node.module}.{each.name}" for each in node.names)}
    return names


@cache
def trees() -> dict[str, ast.Module]:
    return {name: ast.parse(path.read_text("utf-8")) for name, path in FILES.items()}


@cache
def imports() -> dict[str, set[str]]:
    """Of every file. A folder's face only hands on names of what is within; the package's own hands on everything."""
    return {
        name: {
            each
            for each in _named(tree) & FILES.keys() - {name, "openswim"}
            if not (name in FACES and each.startswith(f"{name}."))
        }
        for name, tree in trees().items()
        if name != "openswim"
    }


def _folder(name: str) -> str:
    """The folder of a file; a file that lies beside the rooms is a room of its own."""
    folder = name if name in FACES else name.rpartition(".")[0]
    return name if folder == "openswim" else folder


def _unclean(name: str) -> bool:
    return any(name == folder or name.startswith(f"{folder}.") for folder in NOT_YET_CLEAN)


def _circles(arrows: Mapping[str, Iterable[str]]) -> list[list[str]]:
    """Sets of nodes that reach each other, each as a sorted list."""

    def reached(start: str) -> set[str]:
        found: set[str] = set()
        left = list(arrows.get(start, ()))
        while left:
            node = left.pop()
            if node not in found:
                found.add(node)
                left += arrows.get(node, ())
        return found

    reach = {node: reached(node) for node in arrows}
    rings = {
        tuple(sorted({node} | {other for other in reach[node] if node in reach.get(other, ())}))
        for node in arrows
        if node in reach[node]
    }
    return sorted(map(list, rings))


def _between_folders() -> dict[str, set[str]]:
    arrows: dict[str, set[str]] = {}
    for name, imported in imports().items():
        for each in imported:
            if _folder(each) != _folder(name):
                arrows.setdefault(_folder(name), set()).add(_folder(each))
    return arrows


def test_circles_are_found() -> None:
    assert _circles({"a": ["b"], "b": ["c"], "c": []}) == []
    assert _circles({"a": ["b"], "b": ["c", "d"], "c": ["a"], "d": ["e"], "e": ["d"]}) == [["a", "b", "c"], ["d", "e"]]


def test_no_circle_between_files() -> None:
    arrows = {name: {each for each in imported if not (_unclean(name) and _unclean(each))}
              for name, imported in imports().items()}  # fmt: skip
    assert _circles(arrows) == []


def test_no_circle_between_folders() -> None:
    arrows = {name: {each for each in imported if not (_unclean(name) and _unclean(each))}
              for name, imported in _between_folders().items()}  # fmt: skip
    assert _circles(arrows) == []


def test_every_room_has_its_place_in_the_order() -> None:
    rooms = {name.split(".")[1] for name in FILES if name != "openswim"}
    assert rooms == set(ORDER)


@pytest.mark.parametrize("room", ORDER)
def test_rooms_import_only_those_before_them(room: str) -> None:
    allowed = ORDER[: ORDER.index(room) + 1]
    wrong = [
        f"{name} imports {each}"
        for name, imported in sorted(imports().items())
        for each in sorted(imported)
        if name.split(".")[1] == room and each.split(".")[1] not in allowed
    ]
    assert wrong == []


def test_the_package_itself_is_asked_by_the_last_rooms_only() -> None:
    """`import openswim` is a way round the order: below the validation and the command line
    it gives its version alone."""
    wrong = [
        f"{name}, line {node.lineno}: openswim.{node.attr}"
        for name, tree in trees().items()
        if name != "openswim" and name.split(".")[1] not in ("validation", "cli")
        for node in ast.walk(tree)
        if isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name) and node.value.id == "openswim"
        if node.attr != "__version__"
    ]
    assert wrong == []


def test_no_folder_is_crowded() -> None:
    count: dict[str, int] = {}
    for name in FILES.keys() - FACES:
        folder = name.rpartition(".")[0]
        count[folder] = count.get(folder, 0) + 1
    assert {folder: n for folder, n in count.items() if n > MOST_MODULES} == {}


@pytest.mark.parametrize("room", TRANSPORT)
def test_rooms_of_transport_import_only_those_before_them(room: str) -> None:
    later = TRANSPORT[TRANSPORT.index(room) + 1 :]
    wrong = [
        f"{name} imports {each}"
        for name, imported in sorted(imports().items())
        for each in sorted(imported)
        if name.startswith(f"openswim.transport.{room}.") and each.split(".")[1:2] == ["transport"]
        and each.split(".")[2] in later
    ]  # fmt: skip
    assert wrong == []


def test_transport_is_handed_matter_and_ground() -> None:
    """It reads no scene, no file and no map."""
    wrong = [
        f"{name} imports {each}"
        for name, imported in sorted(imports().items())
        for each in sorted(imported)
        if name.startswith("openswim.transport.")
        and (
            each in ("openswim.scene", "openswim.scene.scene")
            or each.startswith(("openswim.readers", "openswim.solver"))
            or (each.startswith("openswim.ground.") and each.split(".")[2] not in GROUND_WITHOUT_MAPS)
        )
    ]
    assert wrong == []
