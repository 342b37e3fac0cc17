"""`openswim validate`: how far the model is from reference files."""

import os
from pathlib import Path

import click

from openswim.errors import UserError
from openswim.scene.files import check_target

REFERENCE_S = 3.0  # CPU seconds of Monte Carlo per view and flux


def run(
    directory: Path, solver: str, json_path: Path | None, seconds: float | None = None, quality: str | None = None
) -> None:
    """Compare, print the table, write the JSON; files that cannot be compared are named on stderr."""
    from rich.console import Console

    from openswim.solver import Solver
    from openswim.validation import as_table, reference_files, validate, write_json

    if quality is not None and solver != "fast":
        raise UserError(f"--quality belongs to --solver fast; leave it out with {solver}")
    if solver == "reference":
        chosen = Solver(solver, seconds=REFERENCE_S if seconds is None else seconds)
    elif seconds is None:
        chosen = Solver(solver, quality=quality or "standard")
    else:
        raise UserError(f"--seconds belongs to --solver reference; leave it out with {solver}")
    if json_path is not None:
        files = reference_files(directory)
        check_target(json_path, [*files, *(path.with_suffix(".json") for path in files)], "--json")
    rows, skipped = validate(directory, chosen)
    for line in skipped:
        click.echo(f"skipped: {line}", err=True)
    if not rows:
        raise UserError(f"{directory}: nothing in it could be compared; name a folder with reference files")
    if json_path is not None:
        write_json(rows, json_path)
    console = Console(width=None if os.isatty(1) else 140, soft_wrap=False)
    console.print(as_table(rows))
