"""Machine code that an earlier version of the kernels left in Numba's cache on disk.

Numba stamps what it keeps of a kernel with the kernel's own file; what it inlines from others may have changed since.
"""

from __future__ import annotations

import hashlib
import json
import re
import sys
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any

from openswim.errors import UserError
from openswim.scene.files import written_whole
from openswim.system.compiling import heal, tell_first_time

_STAMP = "openswim-sources.json"
# At the top of a module only. What functions import no kernel holds, and it is loaded in one process, not in another.
_IMPORT = re.compile(r"^from ([\w.]+) import (\([^)]*\)|[^\n]*)", re.MULTILINE)


def drop_stale(package: str, alone: bool = False) -> None:
    """Remove what Numba keeps of those kernels of a package, whose own file or any that it imports of the same
    distribution has changed since; where nothing may be written, nothing is done.

    package: dotted name, such as "openswim.transport"; its modules with kernels have been imported. alone: without what
    it holds of other rooms, for a room that is imported late, when the others' kernels have been looked at.
    """
    digests = _Digests()
    kernels = list(_kernels(package))
    if alone:
        kernels = [kernel for kernel in kernels if str(kernel.__module__).startswith(f"{package}.")]
    else:
        tell_first_time(kernels)
    heal(kernels)
    for folder, modules in _cache_folders(kernels).items():
        _drop(folder, {name.rpartition(".")[2]: digests.of(name) for name in modules})


def _kernels(package: str) -> Iterator[Any]:
    """The kernels that a package's modules hold and that Numba keeps, of their own distribution; what is compiled here
    may be written in another room."""
    root = package.partition(".")[0]
    seen: set[int] = set()
    for name, module in list(sys.modules.items()):
        if name == package or name.startswith(f"{package}."):
            for kernel in list(vars(module).values()):
                kept = getattr(getattr(kernel, "stats", None), "cache_path", None) is not None
                own = str(getattr(kernel, "__module__", "")).partition(".")[0] == root
                if kept and own and id(kernel) not in seen:
                    seen.add(id(kernel))
                    yield kernel


def _cache_folders(kernels: Iterable[Any]) -> dict[Path, set[str]]:
    """Where Numba keeps kernels, and the modules they are of."""
    out: dict[Path, set[str]] = {}
    for kernel in kernels:
        out.setdefault(Path(kernel.stats.cache_path), set()).add(str(kernel.__module__))
    return out


def _drop(folder: Path, digests: dict[str, str]) -> None:
    """Remove the kernels of modules in a folder of the cache unless they were compiled from what has these digests."""
    stamp = folder / _STAMP
    try:
        kept = json.loads(stamp.read_text()) if stamp.is_file() else {}
    except (OSError, ValueError):
        kept = {}
    if kept == digests:
        return
    try:
        # the index first: what it names and is gone Numba compiles anew, as another process may at this moment
        for pattern in ("*.nbi", "*.nbc"):
            for file in folder.glob(pattern):
                module = file.name.partition(".")[0]
                if module not in digests or kept.get(module) != digests[module]:
                    file.unlink(missing_ok=True)
        with written_whole(stamp) as partial:
            partial.write_text(json.dumps(digests))
    except (OSError, UserError):
        pass


class _Digests:
    """Digests of modules' sources, each with the sources of all that it imports of its own distribution."""

    def __init__(self) -> None:
        self._own: dict[str, str] = {}
        self._imports: dict[str, list[str]] = {}

    def of(self, name: str) -> str:
        found = hashlib.sha256()
        for module in sorted(self._with_imports(name)):
            found.update(f"{module} {self._own[module]} ".encode())
        return found.hexdigest()

    def _with_imports(self, name: str) -> set[str]:
        seen: set[str] = set()
        left = [name]
        while left:
            module = left.pop()
            if module not in seen and self._read(module):
                seen.add(module)
                left += self._imports[module]
        return seen

    def _read(self, name: str) -> bool:
        """Whether a module has a source; reads it once."""
        if name not in self._own:
            module = sys.modules.get(name)
            path = getattr(module, "__file__", None) if module else None
            source = Path(path).read_bytes() if path and Path(path).is_file() else b""
            self._own[name] = hashlib.sha256(source).hexdigest() if source else ""
            self._imports[name] = list(_imported(source.decode(), name.partition(".")[0]))
        return bool(self._own[name])


def _imported(source: str, root: str) -> Iterator[str]:
    """Modules of the distribution ``root`` that a source may import: names that are none are told by their absence."""
    for module, names in _IMPORT.findall(source):
        if module.partition(".")[0] == root:
            yield module
            yield from (f"{module}.{name}" for name in _names(names))


def _names(text: str) -> Iterable[str]:
    return re.findall(r"\b([a-z_]\w*)\b(?!\s+as)", text)
