"""Errors that are the user's to mend."""


class UserError(Exception):
    """Bad input or a wrong request: one line that says what, where, and what to do (exit code 2)."""
