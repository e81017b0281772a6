"""The table of options: one row each, from which command lines, checks and records are made.

The commands of ``dvr`` get their options from here, the Python API its checks and defaults, and reports the
options they record. Nothing here imports NumPy, as every start of ``dvr`` reads the table.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import fields
from difflib import get_close_matches
from typing import Any

from dvr_cli.errors import UsageError
from dvr_cli.options.freedom import FREEDOM
from dvr_cli.options.motion import MOTION
from dvr_cli.options.output import OUTPUT
from dvr_cli.options.purpose import PURPOSE
from dvr_cli.options.work import WORK

TABLE = (*MOTION, *FREEDOM, *WORK, *PURPOSE, *OUTPUT)  # in the order of help
OPTIONS = {option.name: option for option in TABLE}


def default(name: str, command: str = "smooth") -> Any:
    """The default of an option in a command."""
    return OPTIONS[name].of(command).default


def check_fields(options: Any) -> None:
    """Check the fields of a dataclass that are options of the table; raises UsageError."""
    for each in fields(options):
        if each.name in OPTIONS:
            OPTIONS[each.name].check(getattr(options, each.name))


def check_names(given: Iterable[str], known: Iterable[str]) -> None:
    """Raise UsageError, which tells the nearest name, if one that is ``given`` is not ``known``."""
    known = list(known)
    for name in given:
        if name not in known:
            near = get_close_matches(name, known, 1)
            hint = f"; did you mean {near[0]!r}?" if near else ""
            raise UsageError(f"unknown option {name!r}{hint}")
