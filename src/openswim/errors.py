"""Errors that are the user's to mend."""

_LONGEST, _END = 700, 200  # characters; what a file says of itself may be endless


class UserError(Exception):
    """Bad input or a wrong request: one line that says what, where, and what to do (exit code 2)."""

    def __init__(self, message: str) -> None:
        line = " ".join(part.strip() for part in message.splitlines())
        if len(line) > _LONGEST:
            line = f"{line[: _LONGEST - _END]} ... {line[-_END:]}"
        super().__init__(line)
