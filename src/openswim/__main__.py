"""`python -m openswim`: the same as the `openswim` command."""

from openswim.cli.main import main

main()
