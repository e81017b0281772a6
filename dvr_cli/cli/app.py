"""The Typer application: which commands there are, and how its parser's errors become ours."""

from __future__ import annotations

from collections.abc import Sequence
from importlib import import_module
from typing import Annotated, Any

import typer

from dvr_cli import __version__
from dvr_cli.cli.help import Command
from dvr_cli.cli.streams import emit
from dvr_cli.errors import UsageError

# without markup, help and errors do not import rich, which would double the time they take
_SETTINGS: dict[str, Any] = {
    "rich_markup_mode": None,
    "add_completion": False,
    "context_settings": {"help_option_names": ["-h", "--help"]},
}
# typer >= 0.26 keeps click in a private place; this is click's UsageError wherever that is
_ParserError: type[Exception] = typer.BadParameter.__bases__[0]

# the first word names the module, the last one the function and its examples
_COMMANDS = (
    ("smooth",),
    ("untangle",),
    ("morph",),
    ("warm-up",),
    ("report", "quality"),
    ("report", "compare"),
)


def _print_version(wanted: bool) -> None:
    if wanted:
        emit(f"dvr {__version__}")
        raise typer.Exit


def _dvr(
    version: Annotated[
        bool, typer.Option("--version", help="Print the version.", callback=_print_version, is_eager=True)
    ] = False,
) -> None:
    """Improve a mesh by moving its vertices, and nothing else: better worst elements, never a worse mesh.

    Exit codes: 0 done; 1 quality gate failed; 2 usage; 3 input missing, unreadable or unsupported; 4 output
    could not be written; 130 interrupted.
    """


def _app(arguments: Sequence[str]) -> typer.Typer:
    """The application with the command that ``arguments`` begin with, or with all of them.

    To read the options of one command takes as long as to read a small mesh.
    """
    app = typer.Typer(**_SETTINGS)
    app.callback()(_dvr)
    report = typer.Typer(help="Measure the quality of meshes.", **_SETTINGS)
    named = [words for words in _COMMANDS if tuple(arguments[: len(words)]) == words]
    for words in named or _COMMANDS:
        module, name = words[0].replace("-", "_"), words[-1].replace("-", "_")
        command = import_module(f"dvr_cli.cli.{module}")
        epilog = "\n".join(getattr(command, f"{name.upper()}_EXAMPLES"))
        group = app if len(words) == 1 else report
        group.command(cls=Command, epilog=epilog)(getattr(command, name))
    if report.registered_commands:
        app.add_typer(report, name="report")
    return app


def run(arguments: list[str]) -> int:
    """Run the command that ``arguments`` name and return its exit code; errors are raised as DvrError."""
    command = typer.main.get_command(_app(arguments))
    try:
        with command.make_context("dvr", arguments) as context:
            return command.invoke(context) or 0
    except typer.Exit as done:
        return done.exit_code
    except _ParserError as error:
        raise UsageError(_one_line(error)) from error


def _one_line(error: Exception) -> str:
    """The error of the parser in one line, with the help that explains it."""
    said = " ".join(error.format_message().split()).rstrip(".")  # type: ignore[attr-defined]
    context = getattr(error, "ctx", None)
    command = context.command_path if context else "dvr"
    return f"{said[:1].lower()}{said[1:]} (see '{command} --help')"
