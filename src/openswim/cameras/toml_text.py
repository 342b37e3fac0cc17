"""Tables of plain values as TOML, and back."""

import json
import math
import re
import stat
import tomllib
from pathlib import Path
from typing import Any

import numpy as np

from openswim.errors import UserError

_LARGEST_BYTES = 1_000_000
_IN_KEYS, _MOST_DOTS = re.compile(r"""[\w"'-][ \t]*\."""), 100


def read_toml(path: Path, what: str = "a camera's TOML file") -> dict[str, Any]:
    """The tables of a file; raises UserError with the line where it is not TOML. what: it is called in messages."""
    try:
        status = path.stat()
        if not stat.S_ISREG(status.st_mode):
            raise UserError(f"{path}: is no file: give {what}")
        if status.st_size > _LARGEST_BYTES:
            raise UserError(f"{path}: is larger than {what} can be ({_LARGEST_BYTES // 1000} kB)")
        text = path.read_text("utf-8-sig")  # editors of Windows begin a file with a mark
        if any(len(_IN_KEYS.findall(part)) > _MOST_DOTS for part in re.split("[,=\n]", text)):
            raise ValueError("a name with endless dots")  # its time grows by their square
        return tomllib.loads(text)
    except (OSError, ValueError, RecursionError) as error:  # ValueError: not UTF-8, not TOML, numbers without end
        why = getattr(error, "strerror", None) or " ".join(str(error).split())[:120]
        raise UserError(f"{path}: cannot be read as {what} ({why})") from None


def toml_text(tables: dict[str, Any]) -> str:
    """Plain values first, then a table for each dictionary, one level deep or more."""
    return "\n".join(_lines(tables, ())) + "\n"


def _lines(table: dict[str, Any], path: tuple[str, ...]) -> list[str]:
    plain = {key: value for key, value in table.items() if not isinstance(value, dict)}
    lines = [f"[{'.'.join(path)}]"] if path and plain else []
    lines += [f"{_key(key)} = {_value(value)}" for key, value in plain.items() if value is not None]
    for key, value in table.items():
        if isinstance(value, dict):
            inner = _lines(value, (*path, _key(key)))
            lines += ([""] if lines and inner else []) + inner
    return lines


def _key(key: str) -> str:
    bare = key and all(c.isascii() and (c.isalnum() or c in "-_") for c in key)
    return key if bare else json.dumps(key, ensure_ascii=False)


def _value(value: Any) -> str:
    if isinstance(value, (bool, np.bool_)):
        return "true" if value else "false"
    if isinstance(value, (int, np.integer)):
        return str(int(value))
    if isinstance(value, (float, np.floating)):
        if not math.isfinite(value):
            return "nan" if math.isnan(value) else ("inf" if value > 0 else "-inf")
        text = repr(float(value))
        return text if any(c in text for c in ".en") else f"{text}.0"
    if isinstance(value, str):
        return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007f")
    if isinstance(value, (list, tuple, np.ndarray)):
        return "[" + ", ".join(_value(each) for each in value) + "]"
    raise TypeError(f"no TOML for {type(value).__name__}")
