"""Variables of the environment that switch something on or off."""

import os

from openswim.errors import UserError

_WORDS = {"1": True, "on": True, "yes": True, "true": True, "0": False, "off": False, "no": False, "false": False}


def switched(variable: str) -> bool | None:
    """Whether a variable says on or off; None where it is not set, or empty."""
    told = os.environ.get(variable, "").strip()
    if told and told.lower() not in _WORDS:
        raise UserError(f"{variable} is {told!r}: set it to 1 (on, yes, true) or 0 (off, no, false), or not at all")
    return _WORDS.get(told.lower())
