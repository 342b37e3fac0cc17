"""Errors that are the user's to mend."""

from unicodedata import category

_UNSEEN = ("Cc", "Cf", "Cs")
_LONGEST, _END = 600, 150  # characters of a message, and of what is kept of its end


class UserError(Exception):
    """Bad input or a wrong request: one line that says what, where, and what to do (exit code 2).

    What a file says of itself may be very long: of a long message its beginning and its end are kept. Names that are no
    text are shown with backslashes, and so is what a terminal would obey, or read from right to left.
    """

    def __init__(self, message: object = "") -> None:
        text = " ".join(part.strip() for part in str(message).splitlines())
        text = "".join(repr(c)[1:-1] if category(c) in _UNSEEN else c for c in text)
        if len(text) > _LONGEST:
            text = f"{text[: _LONGEST - _END]} ... {text[-_END:]}"
        super().__init__(text)
