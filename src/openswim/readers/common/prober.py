"""The process that has HDF5 files opened by others before this one opens them (`probe`)."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from contextvars import ContextVar
from functools import cache
from pathlib import Path

from openswim.errors import UserError
from openswim.readers.common import probe


class Prober:
    """Starts with the first question."""

    def __init__(self) -> None:
        self._process: subprocess.Popen[bytes] | None = None

    def verdict(self, path: str) -> int:
        """What a file is, as `probe` says it; UNKNOWN where the system lets nobody ask."""
        libraries = _libraries()
        if libraries is None or not sys.executable or getattr(sys, "frozen", False):
            return probe.UNKNOWN
        if self._process is None:
            try:
                self._process = _started(libraries)
            except OSError:
                return probe.UNKNOWN
        answer = b""
        try:
            answer = _asked(self._process, os.fsencode(path))
        finally:
            if not answer:  # it was killed, or this one is interrupted: another is asked for the next file
                self.close()
        if not answer:
            raise UserError(f"{path}: the process that looks at files before they are opened was killed: try again")
        if answer[0] == probe.LATE:
            raise UserError(f"{path}: could not be looked at within {probe.WALL_S:g} s: copy it to a local disk")
        return answer[0]

    def close(self) -> None:
        """End the process, and what it waits for."""
        process, self._process = self._process, None
        if process is not None:
            with suppress(BrokenPipeError), process:
                _write(process, b"")  # a fork of this process may hold its input open


def _started(libraries: tuple[str, str]) -> subprocess.Popen[bytes]:
    command = [sys.executable, "-I", "-S", str(probe.__file__), *libraries]
    return subprocess.Popen(
        command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, bufsize=0
    )


def _asked(process: subprocess.Popen[bytes], name: bytes) -> bytes:
    """One byte; none of a process that has ended."""
    assert process.stdout is not None
    with suppress(BrokenPipeError):
        _write(process, name)
        return process.stdout.read(1)
    return b""


def _write(process: subprocess.Popen[bytes], name: bytes) -> None:
    assert process.stdin is not None
    process.stdin.write(name + b"\0")


_prober: ContextVar[Prober | None] = ContextVar("openswim_prober", default=None)


@contextmanager
def prober() -> Iterator[Prober]:
    """The one of the outermost block, at whose end it is closed."""
    outer = _prober.get()
    if outer is not None:
        yield outer
        return
    own = Prober()
    token = _prober.set(own)
    try:
        yield own
    finally:
        _prober.reset(token)
        own.close()


@cache
def _libraries() -> tuple[str, str] | None:
    """The files of libnetcdf and libhdf5 that this process has loaded; None where the system does not tell."""
    import netCDF4  # noqa: F401

    try:
        names = {line.split(maxsplit=5)[-1] for line in Path("/proc/self/maps").read_text().splitlines() if "/" in line}
    except OSError:
        return None
    netcdf, hdf = (
        sorted(name for name in names if os.path.basename(name).startswith((f"{stem}-", f"{stem}.so")))
        for stem in ("libnetcdf", "libhdf5")
    )
    return (netcdf[0], hdf[0]) if netcdf and hdf else None
