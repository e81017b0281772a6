"""The options of commands, made from the table of options for Typer."""

from __future__ import annotations

import inspect
import math
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Annotated, Any, Literal

import typer

from dvr_cli.errors import DvrError, InputError
from dvr_cli.options import TABLE
from dvr_cli.options.record import Option


class Vector(tuple[float, ...]):
    """Coordinates given as X,Y or X,Y,Z."""


def number(low: float, high: float = math.inf) -> Callable[[str], float]:
    """A parser for numbers of which only finite ones from ``low`` to ``high`` are taken."""
    bounds = f"of at least {low:g}" if high == math.inf else f"from {low:g} to {high:g}"

    def parse(text: str) -> float:
        try:
            value = float(text)
        except ValueError:
            value = math.nan
        if not (math.isfinite(value) and low <= value <= high):
            raise typer.BadParameter(f"{text!r} is not a number {bounds}")
        return value

    return parse


def vector(*lengths: int) -> Callable[[str], Vector]:
    """A parser for that many finite numbers, separated by commas."""

    def parse(text: str) -> Vector:
        try:
            value = Vector(float(part) for part in text.split(","))
        except ValueError:
            value = Vector()
        if len(value) not in lengths or not all(math.isfinite(x) for x in value):
            wanted = " or ".join(str(n) for n in lengths)
            raise typer.BadParameter(f"{text!r} is not {wanted} numbers separated by commas")
        return value

    return parse


def takes_options(command: str) -> Callable[[Callable[..., int]], Callable[..., int]]:
    """A decorator for the function of a command: gives it the options that the table has for the command.

    The function takes the command's arguments by name, and all options as keywords.
    """

    def with_options(function: Callable[..., int]) -> Callable[..., int]:
        signature = inspect.signature(function, eval_str=True)
        arguments = [p for p in signature.parameters.values() if p.kind is not p.VAR_KEYWORD]
        options = [_parameter(option, command) for option in TABLE if command in option.commands]
        function.__signature__ = signature.replace(parameters=[*arguments, *options])  # type: ignore[attr-defined]
        function.__annotations__ = {p.name: p.annotation for p in (*arguments, *options)} | {"return": int}
        return function

    return with_options


def _parameter(option: Option, command: str) -> inspect.Parameter:
    """The parameter of a command that Typer makes an option of."""
    option = option.of(command)
    values, default, names = option.values, option.default, option.values.names
    kind: Any = Path if values.type == "path" else values.type
    more: dict[str, Any] = {}
    flags = option.flags
    if values.lengths:
        kind, more["parser"] = Vector, vector(*values.lengths)
    elif values.names:
        kind, more["metavar"] = Literal[names], "|".join(names)
    elif values.type is float:
        more["parser"] = number(values.low, values.high)
    elif values.type is int:
        more["min"] = int(values.low)
    elif values.type is bool and not flags:
        flags = (f"--{option.label}",) if default is not None else (f"--{option.label}/--no-{option.label}",)
    if values.many:
        kind, default = list[str], None
    if default is None:
        kind = kind | None
    if option.metavar:
        more["metavar"] = option.metavar
    spec = typer.Option(
        *flags, help=option.help, show_default=option.shown, rich_help_panel=option.panel, **more
    )
    return inspect.Parameter(
        option.name,
        inspect.Parameter.KEYWORD_ONLY,
        default=inspect.Parameter.empty if default is ... else default,
        annotation=Annotated[kind, spec],
    )


@contextmanager
def naming(path: Path | str, kind: type[DvrError] = InputError) -> Iterator[None]:
    """Put the name of the file before the message of an error of this kind."""
    try:
        yield
    except kind as error:
        stream = "standard input" if kind is InputError else "standard output"
        raise kind(f"{stream if path == Path('-') else path}: {error}") from error
