"""Which reader knows a file."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import suppress
from functools import cache
from pathlib import Path

from openswim.errors import UserError
from openswim.readers.common.base import Reader
from openswim.readers.common.bounds import check_path
from openswim.readers.common.kept import handed_over, looking
from openswim.readers.common.prober import prober

ENTRY_POINT_GROUP = "openswim.readers"


@cache
def readers() -> tuple[Reader, ...]:
    """All readers: those of other packages (entry points "openswim.readers"), then the built-in ones."""
    from importlib.metadata import entry_points

    from openswim.readers.cf.reader import CFReader
    from openswim.readers.grib.reader import GRIBReader
    from openswim.readers.gridded.reader import GriddedReader
    from openswim.readers.models.aerosol_depths import AerosolDepthsReader
    from openswim.readers.models.cosp import COSPReader
    from openswim.readers.models.ifs_columns import IFSColumnsReader
    from openswim.readers.models.laps import LAPSReader
    from openswim.readers.models.les_text import LESTextReader
    from openswim.readers.models.rams import RAMSReader
    from openswim.readers.wrf.reader import WRFReader

    others: list[Reader] = []
    for entry in entry_points(group=ENTRY_POINT_GROUP):
        made = entry.load()
        others.append(made() if isinstance(made, type) else made)
    special = (RAMSReader(), LAPSReader(), COSPReader(), IFSColumnsReader(), LESTextReader(), AerosolDepthsReader())
    return (*others, GRIBReader(), WRFReader(), CFReader(), *special, GriddedReader())


def by_reader(
    paths: Sequence[Path], ask: Callable[[Reader, Path], object] | None = None
) -> dict[Reader, list[Path]]:
    """The files by the readers that know them; one that joins parts may know some by the company they keep only.

    ask : is called for each of several files while it is open, where its reader joins no parts; what is wrong with the
        file will be said when it is asked again.
    """
    for path in paths:
        check_path(path)
    if len(paths) == 1:
        return {_reader_of(paths[0]): list(paths)}
    known: dict[Path, Reader | None] = {}
    with prober():
        for path in paths:
            with handed_over(), looking():  # of many files only one is open
                known[path] = found = next((reader for reader in readers() if reader.detects(path)), None)
                if ask is not None and found is not None and not hasattr(found, "read_parts"):
                    with suppress(UserError):
                        ask(found, path)
    groups: dict[Reader, list[Path]] = {reader: [] for reader in known.values() if reader is not None}
    if not groups:
        raise UserError(_why_unknown(paths[0]))
    for path, reader in known.items():
        if reader is None:
            company = (each for each in groups if hasattr(each, "joins") and each.joins(path))
            reader = next(company, None)
            if reader is None:
                raise UserError(_why_unknown(path))
        groups[reader].append(path)
    return groups


def _reader_of(path: Path) -> Reader:
    with looking():
        for reader in readers():
            if reader.detects(path):
                return reader
        raise UserError(_why_unknown(path))


def _why_unknown(path: Path) -> str:
    from openswim.readers.common.opening import opened

    names = ", ".join(reader.name for reader in readers())
    with opened(path, decode=False) as data:  # raises where the file is damaged or something else
        found = ", ".join(list(map(str, data.variables))[:5]) or "no variables"
    return (
        f"{path}: no reader ({names}) knows this file, which holds {found} ...: docs/models.md says what each takes; "
        "any model can write the layout of docs/scene-format.md"
    )
