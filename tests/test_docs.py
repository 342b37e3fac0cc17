"""Pages for people: files, names and links that they mention exist; the picture of the rooms is that of today."""

from __future__ import annotations

import ast
import re
import runpy
import tomllib
from functools import cache
from pathlib import Path

import pytest
from tests import test_rooms

ROOT = Path(__file__).parents[1]
PAGES = sorted([*ROOT.glob("*.md"), *ROOT.glob("docs/**/*.md"), *ROOT.glob("benchmarks/*.md")])
NAMES = [str(page.relative_to(ROOT)) for page in PAGES]

_FENCE = re.compile(r"^```.*?^```", re.MULTILINE | re.DOTALL)
_CODE = re.compile(r"`([^`\n]+(?:\n[^`\n]+)?)`")
_LINK = re.compile(r"!?\[[^\]]*\]\(([^)\s]+)\)")
_PATH = re.compile(r"(?<![\w/.*<-])([\w.-]+/)*[\w*-]+\.py\b")
_DOTTED = re.compile(r"(?<![\w./*\"'-])([A-Za-z_]\w*(?:/\w+)*)((?:\.[A-Za-z_]\w*)+)(?![\w/*-])")
# Dotted words that are not ours: data files, other people's packages, and what some variable of an example has.
_SUFFIXES = {"hdr", "exr", "rad", "cal",
             "nc", "csv", "grib2", "png", "jpg", "tif", "zarr", "json", "jsonl", "txt", "md", "yml", "sh", "toml",
             "svg", "npz", "mp4"}  # fmt: skip
_OTHERS = {"xarray", "numpy", "numba", "np", "xr", "library", "CRS", "ghi", "world", "red"}
# Variables of the pages, by their classes.
_OURS = {"report": "Report", "field": "Field", "scene": "Scene", "lit": "LitScene", "viewpoint": "Viewpoint",
         "op": "Operator", "lin": "Linearization"}


def _prose(page: Path) -> str:
    return _FENCE.sub("", page.read_text("utf-8"))


def _words(page: Path) -> list[str]:
    """What stands between backquotes outside of blocks."""
    return [" ".join(found.split()) for found in _CODE.findall(_prose(page))]


@cache
def _files() -> tuple[str, ...]:
    """Every file of the repository that a page may name, as /path."""
    skipped = {".git", "__pycache__", ".mypy_cache", ".ruff_cache", ".pytest_cache", ".hypothesis", ".venv", "venv"}
    return tuple(
        f"/{path.relative_to(ROOT).as_posix()}"
        for path in ROOT.rglob("*")
        if path.is_file() and not skipped & set(path.relative_to(ROOT).parts)
    )


def _names_in(body: list[ast.stmt]) -> set[str]:
    """What a module or a class defines, or has imported; attributes that methods set, too."""
    names: set[str] = set()
    for node in body:
        if isinstance(node, ast.FunctionDef | ast.ClassDef):
            names.add(node.name)
            if isinstance(node, ast.ClassDef):
                names |= {f"{node.name}.{name}" for name in _names_in(node.body)}
        elif isinstance(node, ast.Assign | ast.AnnAssign):
            targets = node.targets if isinstance(node, ast.Assign) else [node.target]
            names |= {each.id for target in targets for each in ast.walk(target) if isinstance(each, ast.Name)}
        elif isinstance(node, ast.Import | ast.ImportFrom):
            names |= {(each.asname or each.name) for each in node.names}
        elif isinstance(node, ast.If):
            names |= _names_in(node.body)
    return names


@cache
def _modules() -> dict[str, set[str]]:
    """Dotted name of each module: what is in it."""
    return {name: _names_in(tree.body) for name, tree in test_rooms.trees().items()}


@cache
def _classes() -> dict[str, set[str]]:
    """What each class of the package has, by the class's name; what it inherits included."""
    found = [node for tree in test_rooms.trees().values() for node in tree.body if isinstance(node, ast.ClassDef)]
    own: dict[str, set[str]] = {}
    for node in found:
        own.setdefault(node.name, set()).update(_names_in(node.body))
    for node in found:
        for base in node.bases:
            own[node.name] |= own.get(base.id, set()) if isinstance(base, ast.Name) else set()
    return own


def _exists(dotted: str) -> bool:
    """Whether a dotted name is a module, a name in one, or what a class has; modules by the end of their names."""
    parts = dotted.replace("/", ".").split(".")
    first = _OURS.get(parts[0], parts[0])
    if len(parts) == 2 and parts[1] in _classes().get(first, set()):
        return True
    for n in range(len(parts), 0, -1):
        start, rest = ".".join(parts[:n]), ".".join(parts[n:])
        for module, names in _modules().items():
            if f".{module}".endswith(f".{start}") and (not rest or rest in names or rest.split(".")[0] in names):
                return True
    return False


def _missing(page: Path) -> list[str]:
    wrong = []
    for word in _words(page):
        for match in _PATH.finditer(word):
            path = match.group().lstrip("./")
            if not any(re.fullmatch(rf".*/{re.escape(path)}".replace(r"\*", "[^/]*"), file) for file in _files()):
                wrong.append(match.group())
        for match in _DOTTED.finditer(_PATH.sub("", word)):
            dotted = match.group()
            if dotted.rpartition(".")[2] not in _SUFFIXES and match.group(1) not in _OTHERS and not _exists(dotted):
                wrong.append(dotted)
    return wrong


@pytest.mark.parametrize("name", NAMES)
def test_files_and_names_that_a_page_mentions_exist(name: str) -> None:
    assert _missing(ROOT / name) == []


def test_what_does_not_exist_is_found(tmp_path: Path) -> None:
    page = tmp_path / "page.md"
    page.write_text(
        "`sweep.py` and `engine/pack.py`, `pack.PACK`, `Field.view(rays)`, `openswim.render`, `data.nc`; `swept.py`\n"
        "`march/pack.py`, `pack.PECK`, `Field.viewed`, `openswim.rendered(scene)`, `sun.sweeps`\n"
        "```\n`in_blocks.py`\n```\n"
    )
    wrong = ["swept.py", "march/pack.py", "pack.PECK", "Field.viewed", "openswim.rendered", "sun.sweeps"]
    assert _missing(page) == wrong


def _anchors(page: Path) -> set[str]:
    """The names of a page's headings in links, as GitHub makes them."""
    headings = re.findall(r"^#+ (.*)$", page.read_text("utf-8"), re.MULTILINE)
    return {re.sub(r"[^\w\- ]", "", heading.strip().lower()).replace(" ", "-") for heading in headings}


@pytest.mark.parametrize("name", NAMES)
def test_links_lead_somewhere(name: str) -> None:
    page = ROOT / name
    wrong = []
    for link in _LINK.findall(_prose(page)):
        if link.startswith(("http://", "https://", "mailto:")):
            continue
        path, _, anchor = link.partition("#")
        target = page if not path else page.parent / path
        if not target.exists() or (anchor and anchor not in _anchors(target)):
            wrong.append(link)
    assert wrong == []


def test_every_page_is_reached_from_the_readme() -> None:
    reached, left = set(), [ROOT / "README.md"]
    while left:
        page = left.pop()
        if page in reached or page.suffix != ".md":
            continue
        reached.add(page)
        for link in _LINK.findall(_prose(page)):
            target = (page.parent / link.partition("#")[0]).resolve()
            left += sorted(target.glob("*.md")) if target.is_dir() else [target] if target.is_file() else []
    assert {page.resolve() for page in PAGES} - reached == set()


def test_modules_named_in_the_settings_exist() -> None:
    settings = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))
    named = {
        module
        for each in settings["tool"]["mypy"]["overrides"]
        for module in each["module"]
        if module.startswith("openswim.") and not module.endswith("*")
    }
    assert named - _modules().keys() == set()


@cache
def _pictures() -> dict[str, str]:
    return runpy.run_path(str(ROOT / "tools/make_rooms_picture.py"))["pictures"](vars(test_rooms))


@pytest.mark.parametrize("name", ["rooms.svg", "transport.svg"])
def test_the_picture_of_the_rooms_is_that_of_today(name: str) -> None:
    drawn = (ROOT / "docs/images" / name).read_text("utf-8")
    assert _pictures()[name] == drawn, "run python tools/make_rooms_picture.py"
