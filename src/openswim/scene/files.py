"""Writing files whole or not at all."""

from __future__ import annotations

import os
import shutil
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from openswim.errors import UserError

ZARR_MARKS = (".zgroup", ".zmetadata", "zarr.json")


@contextmanager
def written_whole(path: str | os.PathLike[str]) -> Iterator[Path]:
    """Yield a temporary name in the folder of `path`; on success it is renamed to `path`, on failure removed.

    Works for files and for Zarr folders. Raises UserError where the name cannot be written.
    """
    target = Path(path)
    if target.is_dir() and not any((target / mark).exists() for mark in ZARR_MARKS):
        raise UserError(f"{target}: is a folder: choose another name")  # and not ours to replace
    try:
        workshop = Path(tempfile.mkdtemp(prefix=f".{target.name}.", dir=target.parent))
    except OSError as error:
        raise UserError(
            f"{target}: cannot be written ({error.strerror}): choose a folder that exists and that "
            "you may write to"
        ) from error
    try:
        partial = workshop / target.name
        yield partial
        if target.is_dir() and partial.is_dir():
            _replace_folder(partial, target, workshop / "previous")
        else:
            os.replace(partial, target)
    except OSError as error:
        raise UserError(f"{target}: cannot be written ({error.strerror or error})") from error
    finally:
        shutil.rmtree(workshop, ignore_errors=True)


def _replace_folder(new: Path, target: Path, aside: Path) -> None:
    # a folder cannot be replaced in one step
    os.replace(target, aside)
    try:
        os.replace(new, target)
    except OSError:
        os.replace(aside, target)
        raise
