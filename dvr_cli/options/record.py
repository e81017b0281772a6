"""An option: its name, the values it takes, its default, its help, and the commands that have it."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any

from dvr_cli.errors import UsageError


@dataclass(frozen=True)
class Values:
    """The values an option takes.

    type: of one value: float, int, str, bool or "path". low, high: bounds of a number. names: the only ones
    there are. lengths: the option is that many numbers, separated by commas. many: it can be repeated.
    must: what a value has to be, for messages ("be at least 1"); where it is empty the command line alone
    checks.
    """

    type: type | str
    low: float = -math.inf
    high: float = math.inf
    names: tuple[str, ...] = ()
    lengths: tuple[int, ...] = ()
    many: bool = False
    must: str = ""


SWITCH = Values(bool)
TEXT = Values(str)
TEXTS = Values(str, many=True)
FILE = Values("path")
QUALITY = Values(float, -1, 1, must="be a quality, from -1 to 1")
COUNT = Values(int, 0, must="not be negative")
POSITIVE_COUNT = Values(int, 1, must="be at least 1")
NOT_NEGATIVE = Values(float, 0, must="be a number that is not negative")

# commands that have options in common
RUNS = ("smooth", "untangle", "morph")
RELAXING = ("smooth", "morph")
REPORTS = ("quality", "compare")
SMOOTH = ("smooth",)


@dataclass(frozen=True)
class Variant:
    """The differences of an option in one command; None: no difference."""

    default: Any = None
    help: str | None = None


@dataclass(frozen=True)
class Option:
    """One option.

    name: as a keyword in Python, "max_iterations"; the command line has dashes for underscores.
    values: which it takes; None stands for "not given" where the default is None.
    help: one or two sentences. commands: those that have it, "smooth", "untangle", "morph", "quality",
        "compare". variants: what is different in some of them.
    metavar: what help shows for the value. flags: names on the command line other than "--name".
    recorded: whether reports of runs record it. shown: whether help shows the default.
    panel: the heading of help that it stands under.
    """

    name: str
    values: Values
    default: Any
    help: str
    commands: tuple[str, ...]
    metavar: str | None = None
    flags: tuple[str, ...] = ()
    variants: Mapping[str, Variant] = field(default_factory=dict)
    recorded: bool = False
    shown: bool = True
    panel: str = "Options"

    @property
    def label(self) -> str:
        """The name as the command line and messages have it, without dashes in front."""
        return self.name.replace("_", "-")

    def of(self, command: str) -> Option:
        """The option as a command has it."""
        variant = self.variants.get(command)
        if variant is None:
            return self
        return replace(
            self,
            default=self.default if variant.default is None else variant.default,
            help=variant.help or self.help,
        )

    def check(self, value: Any) -> None:
        """Raise UsageError unless the option takes ``value``."""
        if value is None and self.default is None:
            return
        values = self.values
        if values.names and value not in values.names:
            raise UsageError(f"{self.label}: unknown {value!r}; known: {', '.join(values.names)}")
        if not values.must:
            return
        try:
            good = values.low <= value <= values.high and value < math.inf
        except TypeError:
            good = False
        if not good:
            raise UsageError(f"{self.label}: must {values.must}")

    def record(self, value: Any) -> Any:
        """A value of the option as JSON-ready data."""
        if value is None:
            return None
        convert: Any = str if self.values.type == "path" else self.values.type
        if self.values.many:
            return [value] if isinstance(value, str) else list(value)
        return [convert(one) for one in value] if self.values.lengths else convert(value)
