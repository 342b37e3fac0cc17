"""Values of a plan's tables, checked."""

from __future__ import annotations

import re
from typing import Any

from openswim.arguments import check_kind, shown
from openswim.errors import UserError

_NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9_.-]{0,63}")


def text_of(table: dict[str, Any], key: str, default: Any) -> Any:
    value = table.get(key, default)
    if value is not default:
        check_kind(key, value, str, "write it in quotes")
        if not re.fullmatch(r"[^\x00-\x1f]{1,1000}", value):
            raise UserError(f"{key} {shown(value)}: give one line of text")
    return value


def texts(table: dict[str, Any], key: str, default: tuple[str, ...]) -> tuple[str, ...]:
    value = table.get(key, list(default))
    listed = value if isinstance(value, list) else [value]
    for each in listed:
        text_of({key: each}, key, None)
    return tuple(listed)


def check_name(what: str, name: Any) -> str:
    """A name that becomes part of files' names."""
    if not isinstance(name, str) or not _NAME.fullmatch(name):
        raise UserError(f"{what} is {shown(name)}: give 1 to 64 letters, digits, _ . or -, a letter or digit first")
    return name
