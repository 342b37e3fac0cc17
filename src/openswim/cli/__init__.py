"""The command line: `openswim demo`, `info`, `render`, `validate`."""
