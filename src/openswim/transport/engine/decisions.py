"""What thresholds decide, by name: anew, or as a plan has it, with which light is a smooth function of values."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeVar

T = TypeVar("T")


class Decisions:
    """Decisions by name, those of one name in the order in which they are made.

    Where ``made`` has one, it stands; else it is made now, and added. ``made`` holds numbers, truths, and arrays.
    """

    def __init__(self, made: dict[str, list[Any]] | None = None, under: str = "") -> None:
        self.made: dict[str, list[Any]] = {} if made is None else made
        self._under = under
        self._asked: dict[str, int] = {}

    def __call__(self, name: str, decide: Callable[[], T]) -> T:
        """The next decision of a name."""
        found = self.made.setdefault(f"{self._under}{name}", [])
        n = self._asked.get(name, 0)
        self._asked[name] = n + 1
        if n == len(found):
            found.append(decide())
        return found[n]

    def within(self, name: str) -> Decisions:
        """Those of a part of what is solved; of several of one name each has its own."""
        n = self._asked.get(f"{name}/", 0)
        self._asked[f"{name}/"] = n + 1
        return Decisions(self.made, f"{self._under}{name} {n}/")
