"""Arrays in .npz files that may be damaged, or something else."""

from __future__ import annotations

import os
from collections.abc import Iterable
from typing import Any

import numpy as np
from numpy.typing import NDArray


class Damaged(ValueError):
    """A file that holds no arrays, or not those that it should."""


def arrays_of(
    path: str | os.PathLike[str], names: Iterable[str] | None = None, most_bytes: int | None = None
) -> dict[str, NDArray[Any]]:
    """The arrays of a file by name: those that are asked for, or all. Raises `Damaged`, also where they hold more."""
    try:
        with open(path, "rb") as stream, np.load(stream, allow_pickle=False) as kept:
            size = sum(each.file_size for each in kept.zip.infolist())
            if most_bytes is not None and size > most_bytes:
                raise ValueError(f"{size} bytes of arrays, of {most_bytes} at most")
            return {name: kept[name] for name in (kept.files if names is None else names)}
    except Exception as error:  # of zipfile, its decompressors, numpy or Python's tokenizer: there is no list
        raise Damaged(f"{type(error).__name__}: {error}") from error
