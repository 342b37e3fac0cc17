"""Opening whatever holds arrays as one lazy xarray.Dataset: netCDF, HDF5, Zarr, kerchunk references, icechunk."""

from __future__ import annotations

import json
import os
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import xarray as xr
from xarray.backends.store import StoreBackendEntrypoint

from openswim.errors import UserError
from openswim.readers.common.base import open_netcdf, unreadable
from openswim.readers.common.bounds import check_group, may_point_anywhere
from openswim.readers.common.kept import leave, take
from openswim.readers.common.references import LEFT_OUT, is_references, is_remote, references
from openswim.scene.files import ZARR_MARKS
from openswim.scene.times import with_signed_zone

if TYPE_CHECKING:
    import netCDF4


@contextmanager
def opened(path: Path, decode: bool = True) -> Iterator[xr.Dataset]:
    """The file as a lazy dataset; missing values become NaN; `decode`: times become datetime64.

    netCDF and HDF5 files, Zarr folders, kerchunk references (JSON, or a Parquet folder) and icechunk
    repositories; the last two need the extra `openswim[references]`.
    """
    data = take("dataset", path, partial(_open, path))
    try:
        yield _dated(path, data) if decode else data
    finally:
        leave("dataset", path, data)


@contextmanager
def outlined(path: Path) -> Iterator[Outline]:
    """What a file holds by name, without a dataset where it is netCDF: that takes as long as to open the file."""
    if not _is_netcdf(path):
        with opened(path, decode=False) as data:
            yield Outline(set(map(str, data.dims)), list(map(str, data.variables)), set(map(str, data.attrs)))
        return
    with _handle(path) as file:
        yield Outline(set(file.dimensions), list(file.variables), set(file.ncattrs()))


@contextmanager
def opened_part(path: Path, names: Sequence[str]) -> Iterator[xr.Dataset]:
    """As `opened`, of netCDF only these variables, of those that it holds."""
    if not _is_netcdf(path):
        with opened(path) as data:
            yield data
        return
    with _handle(path) as file:
        with _opening(path):
            part = _xarray_of(_Part(file, names))
        yield _dated(path, part)


@dataclass
class Outline:
    """The names of what a file holds."""

    dims: set[str]
    variables: list[str]
    attrs: set[str]


class _Part(xr.backends.NetCDF4DataStore):
    """Some variables of a file."""

    def __init__(self, file: netCDF4.Dataset, names: Sequence[str]) -> None:
        super().__init__(file)
        self._names = names

    def get_variables(self) -> dict[str, xr.Variable]:
        found = self.ds.variables
        return {name: self.open_store_variable(name, found[name]) for name in self._names if name in found}


@contextmanager
def _handle(path: Path) -> Iterator[netCDF4.Dataset]:
    file = take("netcdf", path, partial(open_netcdf, path))
    try:
        yield file
    finally:
        leave("netcdf", path, file)


def _xarray_of(store: xr.backends.NetCDF4DataStore) -> xr.Dataset:
    # where no engine is named xarray imports those of all packages, of Zarr and others: .3 s
    own = StoreBackendEntrypoint
    return xr.open_dataset(store, engine=own, decode_timedelta=False, decode_times=False, chunks=None)


def _open(path: Path) -> xr.Dataset:
    """The dataset, times not decoded."""
    engine, target, options = _recognised(path)
    with _opening(path):
        if engine == "zarr":
            check_group(path, _group(target, options))
            return xr.open_dataset(target, engine=engine, decode_timedelta=False, decode_times=False, chunks=None,
                                   **options)  # fmt: skip
        try:
            return _xarray_of(xr.backends.NetCDF4DataStore(target))
        except BaseException:
            target.close()
            raise


def _dated(path: Path, data: xr.Dataset) -> xr.Dataset:
    """With times as datetime64."""
    clocks = [name for name, variable in data.variables.items() if "since" in str(variable.attrs.get("units", ""))]
    with _opening(path):
        own = {name: data.variables[name].copy(deep=False) for name in clocks}
        for variable in own.values():
            variable.attrs["units"] = with_signed_zone(str(variable.attrs["units"]))
        decoded = xr.decode_cf(xr.Dataset(own), mask_and_scale=False,
                               concat_characters=False, decode_timedelta=False)  # fmt: skip
        return data.assign(decoded.variables)


@contextmanager
def _opening(path: Path) -> Iterator[None]:
    try:
        yield
    except UserError:
        raise
    except Exception as error:  # the back ends raise anything on damaged files
        raise UserError(f"{path}: cannot be opened{said(error, ValueError)}: damaged, or no netCDF or Zarr") from error


@contextmanager
def reading(path: Path | str, remedy: str = "damaged, or not as docs/models.md describes") -> Iterator[None]:
    """Turn what the back ends raise on damaged or unexpected content into one line."""
    try:
        yield
    except MemoryError as error:
        raise UserError(f"{path}: takes more memory than there is: damaged, or open a part of it") from error
    except (OSError, RuntimeError, ValueError, LookupError, TypeError, AttributeError, ArithmeticError) as error:
        raise UserError(f"{path}: cannot be read{said(error)}: {remedy}") from error


def said(error: Exception, *also: type[Exception]) -> str:
    """What the library that reads files says of one, in brackets; nothing where it is Python's own text."""
    pythons = isinstance(error, json.JSONDecodeError) or not isinstance(error, (OSError, RuntimeError, *also))
    text = " ".join(str(error).split()).split(". ")[0][:160]
    return f" ({text})" if text and not pythons else ""


def _recognised(path: Path) -> tuple[str, Any, dict[str, Any]]:
    """Engine, what to hand to it, and its options."""
    if path.is_dir():
        if any((path / mark).exists() for mark in ZARR_MARKS):
            if (path / "refs.0.parq").exists() or any(path.glob("*/refs.0.parq")):
                return _references(path)
            return "zarr", path, {"consolidated": _is_consolidated(path)}
        if (path / "snapshots").is_dir() and ((path / "refs").is_dir() or (path / "repo").exists()):
            return _icechunk(path)
        raise UserError(unreadable(path))
    if not _is_netcdf(path):
        return _references(path)
    return "netcdf4", take("netcdf", path, partial(open_netcdf, path)), {}


def _is_netcdf(path: Path) -> bool:
    """Or nothing that is known."""
    return not (path.is_dir() or is_references(path))


def _group(store: Any, options: dict[str, Any]) -> Any:
    import zarr

    return zarr.open_group(
        store, mode="r", zarr_format=options.get("zarr_format"), use_consolidated=options["consolidated"] or None
    )


def _is_consolidated(store: Path) -> bool:
    """Whether a Zarr folder says in one place what it holds; xarray warns at length where it has to find out."""
    try:
        return (store / ".zmetadata").exists() or bool(
            json.loads((store / "zarr.json").read_text("utf-8")).get("consolidated_metadata")
        )
    except (OSError, ValueError, AttributeError):
        return False


def _references(path: Path) -> tuple[str, Any, dict[str, Any]]:
    """A store of what the references lead to; only those that are trusted go by way of fsspec, which follows any."""
    with suppress(ImportError):  # registers how some files' pieces are packed
        import kerchunk.codecs  # noqa: F401
    anywhere = may_point_anywhere()
    if path.is_dir() and not anywhere:
        raise UserError(f"{path}: references in Parquet may lie anywhere: {LEFT_OUT}")
    if path.is_file() and not (anywhere and is_remote(path)):
        from zarr.storage import MemoryStore

        store = MemoryStore(references(path, anywhere), read_only=True)
        return "zarr", store, {"consolidated": False, "zarr_format": 2}
    try:
        from kerchunk.utils import refs_as_store
    except ImportError as error:
        raise UserError(f"{path}: such references need pip install 'openswim[references]'") from error
    try:
        return "zarr", refs_as_store(os.fspath(path)), {"consolidated": False, "zarr_format": 2}
    except ImportError as error:  # of what speaks with the servers
        raise UserError(f"{path}: {error}: pip install what it names") from error


def _icechunk(path: Path) -> tuple[str, Any, dict[str, Any]]:
    try:
        import icechunk
    except ImportError as error:
        raise UserError(f"{path}: an icechunk repository: pip install 'openswim[references]'") from error
    try:
        repository = icechunk.Repository.open(icechunk.local_filesystem_storage(os.fspath(path)))
        store = repository.readonly_session("main").store
    except Exception as error:  # icechunk raises its own kinds
        raise UserError(f"{path}: the icechunk repository cannot be opened{said(error)}: is it whole?") from error
    return "zarr", store, {"consolidated": False}
