"""Reference files as tables, the phase functions that they name, and scores against them."""

from openswim.validation.reference.files import (
    Reference,
    Row,
    Solver,
    Stopwatch,
    groups,
    read_reference,
    with_sigma,
)

__all__ = ["Reference", "Row", "Solver", "Stopwatch", "groups", "read_reference", "with_sigma"]
