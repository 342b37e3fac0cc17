"""References (kerchunk): a JSON object that says where the pieces of a Zarr store lie in other files.

They are followed here, and not by fsspec: only to local files below the folder of the JSON, and only within what these
files hold. Whoever trusts a file may let it point anywhere (`openswim.open_scene(allow_references=True)`).
"""

from __future__ import annotations

import base64
import json
import os
from collections.abc import Iterator, MutableMapping
from functools import lru_cache
from pathlib import Path
from typing import Any

from openswim.errors import UserError
from openswim.readers.common.kept import first_bytes
from openswim.system.inputs import check_ordinary

_LONGEST = 48_000_000  # bytes of the JSON
_MOST = 500_000  # references
_MARKS = (b'"refs"', b".zgroup", b".zarray", b".zmetadata")
LEFT_OUT = "--allow-references (openswim.open_scene(allow_references=True)) follows it, if you trust the file"


def is_references(path: Path) -> bool:
    """Whether a file begins as such JSON does."""
    try:
        start = first_bytes(path)[:4096].lstrip()
    except OSError:
        return False
    return start.startswith(b"{") and any(mark in start for mark in _MARKS)


class References(MutableMapping[str, Any]):
    """The pieces of the Zarr store by their keys, read when they are asked for; what zarr's MemoryStore takes."""

    def __init__(self, path: Path, anywhere: bool = False) -> None:
        self.path, self._anywhere = path, anywhere
        self._folder = Path(os.path.realpath(path)).parent
        self._found = _described(path)
        self._checked: dict[str, tuple[str, int]] = {}  # name and bytes of files that may be read
        for key, piece in self._found.items():
            if isinstance(piece, dict):
                self._found[key] = json.dumps(piece)
            elif isinstance(piece, list):
                self._place(key, piece)
            elif not isinstance(piece, str):
                raise UserError(f"{path}: {key} is neither text nor a place in a file: write the references again")

    def __getitem__(self, key: str) -> Any:
        from zarr.core.buffer import default_buffer_prototype

        made: Any = default_buffer_prototype().buffer
        return made.from_bytes(self._bytes(key))

    def _bytes(self, key: str) -> bytes:
        piece = self._found[key]
        if isinstance(piece, str):
            return base64.b64decode(piece[7:]) if piece.startswith("base64:") else piece.encode()
        name, start, length = self._place(key, piece)
        with open(name, "rb") as file:
            file.seek(start)
            return file.read(length)

    def _place(self, key: str, piece: list[Any]) -> tuple[str, int, int]:
        """File, first byte and number of bytes of a reference."""
        whole = len(piece) == 1
        if not (whole or len(piece) == 3) or not isinstance(piece[0], str):
            raise UserError(f"{self.path}: {key} is no reference [file, offset, length]: write them again")
        if piece[0] not in self._checked:
            self._checked[piece[0]] = self._file(key, piece[0])
        name, size = self._checked[piece[0]]
        start, length = (0, size) if whole else piece[1:]
        if not (isinstance(start, int) and isinstance(length, int) and 0 <= start <= start + length <= size):
            raise UserError(f"{self.path}: {key} lies beyond the end of {piece[0]}: of another file, or damaged")
        return name, start, length

    def _file(self, key: str, given: str) -> tuple[str, int]:
        name = given.removeprefix("file://").removeprefix("local://")
        if "://" in name or "::" in name:
            raise UserError(f"{self.path}: {key} points into the network, to {given}: {LEFT_OUT}")
        target = os.path.realpath(self._folder / name)
        if not self._anywhere and not Path(target).is_relative_to(self._folder):
            raise UserError(f"{self.path}: {key} points to {given}, out of its folder: {LEFT_OUT}")
        check_ordinary(target, f"{self.path}: {key} points to")
        if not os.path.isfile(target):
            raise UserError(f"{self.path}: {key} points to {given}, a folder: write the references again")
        return target, os.path.getsize(target)

    def __iter__(self) -> Iterator[str]:
        return iter(self._found)

    def __len__(self) -> int:
        return len(self._found)

    def __contains__(self, key: object) -> bool:
        return key in self._found

    def __setitem__(self, key: str, value: Any) -> None:
        raise TypeError("references are read only")

    def __delitem__(self, key: str) -> None:
        raise TypeError("references are read only")


def references(path: Path, anywhere: bool = False) -> References:
    """Those of a file, made once, as long as it does not change: each reader looks at them."""
    found = path.stat()
    made = _made(path, os.getcwd(), found.st_mtime_ns, found.st_size, anywhere)
    if isinstance(made, UserError):
        raise made
    return made


@lru_cache(maxsize=1)
def _made(path: Path, folder: str, changed_ns: int, size: int, anywhere: bool) -> References | UserError:
    try:
        return References(path, anywhere)
    except UserError as error:
        return error


def is_remote(path: Path) -> bool:
    """Whether references point into the network, or must be written out by templates: fsspec's work."""
    about = _json(path)
    refs = about.get("refs", about)
    return bool(about.get("gen")) or any(
        isinstance(piece, list) and piece and isinstance(piece[0], str) and _is_remote(piece[0], about)
        for piece in (refs.values() if isinstance(refs, dict) else ())
    )


def _is_remote(name: str, about: dict[str, Any]) -> bool:
    name = _written_out(name, about.get("templates") or {})
    return "{{" in name or ("://" in name and not name.startswith(("file://", "local://"))) or "::" in name


def _described(path: Path) -> dict[str, Any]:
    """The references by their keys, templates written out."""
    about = _json(path)
    refs, templates = about.get("refs", about), about.get("templates") or {}
    if not isinstance(refs, dict) or not isinstance(templates, dict):
        raise UserError(f"{path}: not kerchunk references: a JSON object of them is needed: write them again")
    if about.get("gen"):
        raise UserError(f"{path}: references made by rules (gen): {LEFT_OUT}, or write them out")
    if len(refs) > _MOST:
        raise UserError(f"{path}: {len(refs)} references, more than {_MOST}: open the files that they point into")
    found: dict[str, Any] = {}
    for key, piece in refs.items():
        if templates and isinstance(piece, list) and piece and isinstance(piece[0], str):
            piece = [_written_out(piece[0], templates), *piece[1:]]
        found[key] = piece
    return found


def _json(path: Path) -> dict[str, Any]:
    if path.stat().st_size > _LONGEST:
        raise UserError(f"{path}: references of over {_LONGEST / 1e6:.0f} MB: open the files that they point into")
    try:
        about = json.loads(path.read_text("utf-8"))
    except (ValueError, RecursionError) as error:
        raise UserError(f"{path}: not JSON: truncated or damaged references: write them again") from error
    if not isinstance(about, dict):
        raise UserError(f"{path}: not kerchunk references: a JSON object of them is needed: write them again")
    return about


def _written_out(name: str, templates: dict[str, Any]) -> str:
    for word, text in templates.items():
        if isinstance(text, str):
            name = name.replace("{{" + word + "}}", text).replace("{{ " + word + " }}", text)
    return name
