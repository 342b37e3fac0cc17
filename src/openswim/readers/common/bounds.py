"""What is found out of a file before anything of it is read: that it is one, that it ends, how much it would take."""

from __future__ import annotations

import os
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from functools import cache
from math import prod
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from openswim.errors import UserError
from openswim.readers.common import probe
from openswim.readers.common.kept import first_bytes
from openswim.readers.common.prober import prober
from openswim.readers.common.references import LEFT_OUT
from openswim.system.inputs import check_ordinary
from openswim.system.machine import free_memory

if TYPE_CHECKING:
    import netCDF4
    import xarray as xr
    import zarr

MAX_ELEMENTS = 2_000_000_000  # of one variable at one time: 8 GB as float32
PLAUSIBLE_ELEMENTS = 20_000_000  # up to here no file is doubted
_VALUES_PER_BYTE = 300  # zlib packs no better than 1032 to 1
_PLAUSIBLE_BYTES = 300_000_000  # of all variables together
_DENSEST = 500  # bytes of values in one byte of a file: weather has never been packed like that
_LONGEST_AXIS = 20_000_000  # values of a coordinate, which are read when a file is opened
_MOST_PIECES = 10_000  # in which a coordinate may lie in a Zarr store: each takes its time
_LARGEST_CHUNK = 1 << 30  # bytes
_BYTES_PER_VALUE = 12  # while a field is read: as stored, as float32, and what is made of it
_MOST_FILES = 1_000_000  # in a folder
_HDF5 = b"\x89HDF\r\n\x1a\n"

_anywhere: ContextVar[bool] = ContextVar("openswim_allow_references", default=False)


@contextmanager
def references_allowed(allowed: bool) -> Iterator[None]:
    """Within the block files may point to other files, out of their folder and into the network, or not."""
    token = _anywhere.set(allowed)
    try:
        yield
    finally:
        _anywhere.reset(token)


def may_point_anywhere() -> bool:
    return _anywhere.get()


def check_path(path: Path) -> None:
    """Refuse what is no ordinary file, and folders that hold something else or point out of themselves."""
    check_ordinary(path)
    if not path.is_dir():
        return
    home, count, folders = os.path.realpath(path), 0, [os.fspath(path)]
    while folders:
        try:
            entries = list(os.scandir(folders.pop()))
        except OSError as error:
            raise UserError(f"{path}: cannot be read ({error.strerror})") from None
        for entry in entries:
            if entry.is_symlink() and not may_point_anywhere():
                target = os.path.realpath(entry.path)
                if os.path.commonpath((home, target)) != home:
                    raise UserError(f"{path}: {entry.name} points out of the folder, to {target}: {LEFT_OUT}")
            if not _is_ordinary(entry):
                raise UserError(f"{entry.path}: a pipe, device or link to nowhere: take it out of the folder")
        folders += [entry.path for entry in entries if entry.is_dir(follow_symlinks=False)]
        count += len(entries)
        if count > _MOST_FILES:
            raise UserError(f"{path}: over {_MOST_FILES} files: give a model's file, or write larger chunks")


def _is_ordinary(entry: os.DirEntry[str]) -> bool:
    try:
        return entry.is_file() or entry.is_dir()
    except OSError:  # a link that leads to itself
        return False


def check_container(path: Path) -> None:
    """Refuse an HDF5 file that never ends, that crashes the library, or whose data lies in other files; looked at by a
    process of its own, once a file."""
    if not first_bytes(path).startswith(_HDF5):
        return
    found = path.stat()
    answer = _probed(os.path.realpath(path), found.st_mtime_ns, found.st_size)
    if answer == probe.POINTS_ELSEWHERE and not may_point_anywhere():
        raise UserError(f"{path}: its data lies in other files: {LEFT_OUT}")
    if answer not in (probe.SAFE, probe.UNKNOWN, probe.POINTS_ELSEWHERE):
        raise UserError(f"{path}: truncated or damaged netCDF file: copy or download it again")


@cache
def _probed(path: str, changed_ns: int, size: int) -> int:
    with prober() as own:
        return own.verdict(path)


def check_size(path: Path, name: str, shape: tuple[int, ...]) -> None:
    """Refuse a variable whose declared size could not be held in memory, before reading it."""
    elements = prod(int(n) for n in shape)
    if elements > MAX_ELEMENTS:
        raise UserError(
            f"{path}: {name} declares {_text(shape)} values, more than {MAX_ELEMENTS:.0e}: damaged header, "
            "or crop the file first"
        )
    if elements > PLAUSIBLE_ELEMENTS:
        if elements > _VALUES_PER_BYTE * _packed_bytes(path):
            raise UserError(
                f"{path}: {name} declares {_text(shape)} values, more than the file can hold: damaged header"
            )
        taken, free = elements * _BYTES_PER_VALUE / 1e9, free_memory() / 1e9
        if taken > free:
            raise UserError(
                f"{path}: {name} of {_text(shape)} values takes {taken:.1f} GB to read, and {free:.1f} GB are free: "
                "read a part (around a place), or crop the file"
            )


def check_sizes(path: Path, data: xr.Dataset) -> None:
    """Refuse a file with such a variable, for readers that take all of it at once."""
    for name in data.variables:
        check_size(path, str(name), data[name].shape)


def check_header(path: Path, file: netCDF4.Dataset) -> None:
    """Refuse a netCDF file by what its header declares: more than it can hold, or an axis without end."""
    total = 0
    for name, variable in file.variables.items():
        kind = variable.dtype
        elements = prod(variable.shape)
        total += elements * (kind.itemsize if isinstance(kind, np.dtype) else 8)
        if variable.dimensions == (name,):
            _check_axis(path, name, elements)
    if total > _PLAUSIBLE_BYTES and total > _DENSEST * _packed_bytes(path):
        held = path.stat().st_size / 1e6
        raise UserError(
            f"{path}: declares {total / 1e9:.2g} GB of values in a file of {held:.2g} MB: damaged, or made "
            "to fill the memory; if it is meant, write it without packing (nccopy -d 0)"
        )


def check_group(path: Path, group: zarr.Group) -> None:
    """The same of a Zarr store, whose chunks may lie anywhere or be missing."""
    with warnings.catch_warnings():  # newer Zarr reads chunks without values as if they were missing
        warnings.filterwarnings("error", ".*stored chunk shape.*is invalid")
        arrays = list(group.arrays())
    for name, array in arrays:
        dims = array.attrs.get("_ARRAY_DIMENSIONS", array.metadata.to_dict().get("dimension_names"))
        if array.ndim == 1 and dims in ([name], (name,)):
            _check_axis(path, name, array.shape[0])
            if array.nchunks > _MOST_PIECES:
                raise UserError(f"{path}: coordinate {name} lies in {array.nchunks} pieces: write it in one")
        if min(array.chunks, default=1) < 1:
            raise UserError(f"{path}: {name} has chunks without values: damaged metadata: copy or download it again")
        chunk = prod(array.chunks) * array.dtype.itemsize
        if chunk > max(_LARGEST_CHUNK, 4 * prod(array.shape) * array.dtype.itemsize) or chunk > free_memory():
            raise UserError(f"{path}: {name} has chunks of {chunk / 1e9:.1f} GB: damaged, or write smaller ones")


def _check_axis(path: Path, name: str, length: int) -> None:
    if length > _LONGEST_AXIS:
        raise UserError(f"{path}: coordinate {name} declares {length} values: damaged header, or no axis of a grid")


def _packed_bytes(path: Path) -> float:
    """Size of a netCDF or HDF5 file; infinite for anything else, whose data may lie elsewhere."""
    try:
        packed = first_bytes(path).startswith((b"CDF\x01", b"CDF\x02", b"CDF\x05", b"\x89HDF"))
        return path.stat().st_size if packed and not may_point_anywhere() else np.inf
    except OSError:
        return np.inf


def _text(shape: tuple[int, ...]) -> str:
    return " x ".join(map(str, shape))
