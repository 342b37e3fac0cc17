"""Where Numba keeps compiled kernels: in a place that can be written; what is damaged there is made anew.

Imported only where Numba is needed anyway.
"""

from __future__ import annotations

import hashlib
import os
import tempfile
from collections.abc import Callable, Iterable
from contextlib import ExitStack, suppress
from functools import cache
from pathlib import Path
from typing import Any

from numba import config
from numba.core import event
from numba.core.caching import IndexDataCacheFile
from numba.core.dispatcher import Dispatcher
from numba.misc.appdirs import AppDirs

from openswim.progress import Meter, Quiet, job, tell

_settings: Any = config
_Kernel: Any = Dispatcher
_MARK = b"openswim sha256 "  # before a digest, behind what was kept
_DIGEST = hashlib.sha256().digest_size
_KERNEL_S = 0.35  # CPU seconds to compile one of them, on the average of all: 278 take 80 to 110


@cache
def provide_cache() -> None:
    """Have Numba keep what it compiles in a private folder where neither beside the sources nor in the user's cache a
    file can be written; without such a folder nothing is kept. To be called before kernels are defined."""
    beside = Path(__file__).parent / "__pycache__"
    users = AppDirs(appname="numba", appauthor=False).user_cache_dir
    given = [_settings.CACHE_DIR] if _settings.CACHE_DIR else []
    if any(_writable(Path(folder)) for folder in (*given, beside, users)):
        return
    folder = _private_folder()
    if folder is None:
        _Kernel.enable_caching = lambda self: None
        tell("note: no folder for compiled kernels can be written, so that every start compiles: set NUMBA_CACHE_DIR")
    else:
        _settings.CACHE_DIR = str(folder)


def _writable(folder: Path) -> bool:
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=folder):
            return True
    except OSError:
        return False


def _private_folder() -> Path | None:
    """A folder of temporary files that nobody else can write to: what lies in it will be executed."""
    try:
        folder = Path(tempfile.gettempdir()) / f"openswim-kernels-{os.getuid() if hasattr(os, 'getuid') else 'user'}"
        with suppress(FileExistsError):
            folder.mkdir(mode=0o700)
        found = folder.lstat()
        own = not hasattr(os, "getuid") or (found.st_uid == os.getuid() and not found.st_mode & 0o077)
        if own and folder.is_dir() and not folder.is_symlink() and _writable(folder):
            return folder
        return Path(tempfile.mkdtemp(prefix="openswim-kernels-"))
    except OSError:
        return None


_prepare: Callable[[], None] | None = None
_prepared: set[str] = set()


def prepare_with(prepare: Callable[[], None], indices: set[str]) -> None:
    """Call ``prepare`` once, when one of the kernels that have these files of indices is not found on disk; then it is
    looked for again."""
    global _prepare, _prepared
    _prepare, _prepared = prepare, indices


class _Healing(IndexDataCacheFile):
    """Numba's files of a kernel, each with a digest: one that is damaged is removed, and the kernel compiled anew."""

    def load(self, key: Any) -> Any:
        global _prepare
        found = super().load(key)
        if found is not None or _prepare is None or self._index_path not in _prepared:
            return found
        prepare, _prepare = _prepare, None
        prepare()
        return super().load(key)

    def _load_index(self) -> dict[Any, str]:
        try:
            return dict(super()._load_index())
        except Exception:  # whatever unpickling of anything raises
            _remove(self._index_path)
            return {}

    def _load_data(self, name: str) -> Any:
        path = self._data_path(name)
        kept = Path(path).read_bytes()  # an OSError means that there is none
        try:
            body, mark, digest = kept[: -_DIGEST - len(_MARK)], kept[-_DIGEST - len(_MARK) : -_DIGEST], kept[-_DIGEST:]
            if mark == _MARK and hashlib.sha256(body).digest() != digest:
                raise ValueError("damaged")
            return super()._load_data(name)  # which stops before the digest; nothing but Numba unpickles
        except Exception as error:
            _remove(path)
            raise OSError(f"{path}: damaged") from error

    def _save_data(self, name: str, data: Any) -> None:
        body = self._dump(data)
        with self._open_for_write(self._data_path(name)) as file:
            file.write(body + _MARK + hashlib.sha256(body).digest())

    def save(self, key: Any, data: Any) -> None:
        with suppress(OSError):  # a full disk: it will be compiled again
            super().save(key, data)


def _remove(path: str) -> None:
    with suppress(OSError):
        os.unlink(path)


def heal(kernels: Iterable[Any]) -> None:
    """Let kernels, and other objects that do not matter, mend what is kept of them."""
    for kernel in kernels:
        files = getattr(getattr(kernel, "_cache", None), "_cache_file", None)
        if type(files) is IndexDataCacheFile:
            files.__class__ = _Healing


class _FirstTime(event.Listener):
    """Says that kernels are compiled when the first one is, and about how long it takes, by how many are not kept; then
    counts those that are done."""

    def __init__(self, kernels: Iterable[Any]) -> None:
        self._kernels = {id(kernel): kernel for kernel in kernels}
        self._told, self._done = False, 0
        self._within: list[bool] = []  # what is compiled, callers first: whether it is one of these kernels
        self._shown = ExitStack()
        self._meter: Meter = Quiet()

    def on_start(self, compiling: Any) -> None:
        own = id(compiling.data["dispatcher"]) in self._kernels  # others' may keep nothing and compile at every start
        if own and not self._told:
            self._tell()
        if own and not any(self._within):
            self._meter = self._shown.enter_context(job("kernels compiled"))
            self._meter.advance(self._done)
        self._within.append(own)

    def on_end(self, _: Any) -> None:
        if self._within.pop():
            self._done += 1
            self._meter.advance()
        if not any(self._within):
            self._shown.close()

    def _tell(self) -> None:
        self._told = True
        missing = sum(not os.path.exists(kernel._cache._cache_file._index_path) for kernel in self._kernels.values())
        about = rounded(_KERNEL_S * missing)
        tell(f"note: kernels are compiled for this machine, once: at most about {about} on an idle core")


def rounded(seconds: float) -> str:
    """How long something takes, in words."""
    return f"{round(seconds / 30) / 2:g} minutes" if seconds > 75 else f"{max(5, 5 * round(seconds / 5))} s"


def tell_first_time(kernels: Iterable[Any]) -> None:
    """Have it said when one of these kernels is compiled."""
    kept = [kernel for kernel in kernels if hasattr(getattr(kernel, "_cache", None), "_cache_file")]
    event.register("numba:compile", _FirstTime(kept))
