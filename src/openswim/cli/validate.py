"""`openswim validate`: how far the model is from reference files."""

import os
from pathlib import Path

import click

from openswim.cli.render import check_solver
from openswim.errors import UserError


def run(directory: Path, solver: str, json_path: Path | None) -> None:
    """Compare, print the table, write the JSON; files that cannot be compared are named on stderr."""
    check_solver(solver)
    if json_path is not None:
        _check_folder(json_path)

    from rich.console import Console

    from openswim.transport import Solver
    from openswim.validate import as_table, validate, write_json

    rows, skipped = validate(directory, Solver(solver))
    for line in skipped:
        click.echo(f"skipped: {line}", err=True)
    if json_path is not None:
        write_json(rows, json_path)
    if not rows:
        raise UserError(f"{directory}: nothing in it could be compared; name a folder with reference files")
    console = Console(width=None if os.isatty(1) else 140, soft_wrap=False)
    console.print(as_table(rows))


def _check_folder(path: Path) -> None:
    if path.is_dir() or not path.parent.is_dir() or not os.access(path.parent, os.W_OK):
        raise UserError(
            f"--json {path}: cannot be written; name a file in a folder that exists and is writable"
        )
