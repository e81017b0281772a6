"""Errors that a user can cause, and the exit code each kind has on the command line.

Every error a user can cause is one of these, with a message of one line that names the file or the
option, the cause and, where there is one, the remedy.
"""


class DvrError(Exception):
    """Base of all errors that are the input's or the call's fault, not a defect of dvr."""

    exit_code = 2


class UsageError(DvrError):
    """An option or argument is wrong (exit code 2)."""

    exit_code = 2


class InputError(DvrError):
    """The input is missing, unreadable, invalid or unsupported (exit code 3)."""

    exit_code = 3


class OutputError(DvrError):
    """The output could not be written (exit code 4)."""

    exit_code = 4
