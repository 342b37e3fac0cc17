"""Errors that are the user's to mend, and foreign words in what is told."""

from unicodedata import category

_UNSEEN = ("Cc", "Cf", "Cs")
_LONGEST, _END = 600, 150  # characters of a message, and of what is kept of its end


def one_line(text: str) -> str:
    """Words of a file or its name, on one line; backslashes for what is no text, what a terminal would obey, or read
    from right to left."""
    line = " ".join(part.strip() for part in text.splitlines())
    line = "".join(repr(c)[1:-1] if category(c) in _UNSEEN else c for c in line)
    return line if len(line) <= _LONGEST else f"{line[: _LONGEST - _END]} ... {line[-_END:]}"


class UserError(Exception):
    """Bad input or a wrong request: one line that says what, where, and what to do (exit code 2).

    What a file says of itself may be very long: of a long message its beginning and its end are kept.
    """

    def __init__(self, message: object = "") -> None:
        super().__init__(one_line(str(message)))
