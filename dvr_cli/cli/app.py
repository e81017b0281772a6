"""The Typer application: which commands there are, and how its parser's errors become ours."""

from __future__ import annotations

from typing import Annotated, Any

import typer

from dvr_cli import __version__
from dvr_cli.cli.help import Command
from dvr_cli.cli.morph import MORPH_EXAMPLES, morph
from dvr_cli.cli.report import COMPARE_EXAMPLES, QUALITY_EXAMPLES, compare, quality
from dvr_cli.cli.smooth import SMOOTH_EXAMPLES, smooth
from dvr_cli.cli.streams import emit
from dvr_cli.cli.untangle import UNTANGLE_EXAMPLES, untangle
from dvr_cli.cli.warm_up import WARM_UP_EXAMPLES, warm_up
from dvr_cli.errors import UsageError

# without markup, help and errors do not import rich, which would double the time they take
_SETTINGS: dict[str, Any] = {
    "rich_markup_mode": None,
    "add_completion": False,
    "context_settings": {"help_option_names": ["-h", "--help"]},
}
# typer >= 0.26 keeps click in a private place; this is click's UsageError wherever that is
_ParserError: type[Exception] = typer.BadParameter.__bases__[0]

app = typer.Typer(**_SETTINGS)
report = typer.Typer(help="Measure the quality of meshes.", **_SETTINGS)
app.add_typer(report, name="report")
for group, function, examples in (
    (app, smooth, SMOOTH_EXAMPLES),
    (app, untangle, UNTANGLE_EXAMPLES),
    (app, morph, MORPH_EXAMPLES),
    (app, warm_up, WARM_UP_EXAMPLES),
    (report, quality, QUALITY_EXAMPLES),
    (report, compare, COMPARE_EXAMPLES),
):
    group.command(cls=Command, epilog="\n".join(examples))(function)


def _print_version(wanted: bool) -> None:
    if wanted:
        emit(f"dvr {__version__}")
        raise typer.Exit


@app.callback()
def dvr(
    version: Annotated[
        bool, typer.Option("--version", help="Print the version.", callback=_print_version, is_eager=True)
    ] = False,
) -> None:
    """Improve a mesh by moving its vertices, and nothing else: better worst elements, never a worse mesh.

    Exit codes: 0 done; 1 quality gate failed; 2 usage; 3 input missing, unreadable or unsupported; 4 output
    could not be written; 130 interrupted.
    """


def run(arguments: list[str]) -> int:
    """Run the command that ``arguments`` name and return its exit code; errors are raised as DvrError."""
    command = typer.main.get_command(app)
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
