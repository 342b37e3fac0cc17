"""The table of a validation, for people and for scripts."""

import json
import math
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any

from openswim.scene.files import written_whole
from openswim.validation.reference import Row

if TYPE_CHECKING:
    from rich.table import Table


def as_table(rows: list[Row]) -> "Table":
    """A rich table of the rows in the given order; relative numbers in per cent."""
    from rich.table import Table

    table = Table(box=None, pad_edge=False)
    for heading in ("case", "quantity"):
        table.add_column(heading, overflow="fold")
    own = any(math.isfinite(row.sigma) for row in rows)  # there are standard errors to tell
    for heading in ("RMSE %", "bias %", "corr.", "n", "CPU s", *(("sigma %", "in 3 s. %") if own else ())):
        table.add_column(heading, justify="right", no_wrap=True)
    for row in rows:
        numbers = (
            _text(100 * row.relative_rmse, ".2f"),
            _text(100 * row.bias, "+.2f"),
            _text(row.correlation, ".4f"),
        )
        errors = (_text(100 * row.sigma, ".2f"), _text(100 * row.within_3_sigma, ".1f")) if own else ()
        table.add_row(row.case, row.quantity, *numbers, str(row.n), f"{row.cpu_seconds:.2f}", *errors)
    return table


def write_json(rows: list[Row], path: Path) -> None:
    """A JSON list of rows with the fields of `Row`, errors where there are any; what is not a number becomes null."""
    with written_whole(path) as partial:
        partial.write_text(json.dumps([_plain(asdict(row)) for row in rows], indent=1) + "\n")


def _text(value: float, form: str) -> str:
    return format(value, form) if math.isfinite(value) else "-"


def _plain(row: dict[str, Any]) -> dict[str, Any]:
    for name in ("sigma", "within_3_sigma"):  # of solvers with a standard error alone
        if not math.isfinite(row[name]):
            del row[name]
    return {k: None if isinstance(v, float) and not math.isfinite(v) else v for k, v in row.items()}
