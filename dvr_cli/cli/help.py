"""Help of a command: options under headings and examples at the end; coloured where the terminal has it."""

from __future__ import annotations

import sys
from typing import Any

from typer.core import TyperCommand


def example(command: str, meaning: str) -> str:
    """A line of the examples at the end of a command's help."""
    return f"{command}  # {meaning}"


class Command(TyperCommand):
    """A command whose epilog is its examples, a line each, made by ``example``."""

    def format_help(self, ctx: Any, formatter: Any) -> None:
        """Write the help: in a terminal by rich, elsewhere plain and without importing rich."""
        if not sys.stdout.isatty():
            super().format_help(ctx, formatter)
            return
        from rich.console import Console
        from rich.markup import escape
        from rich.panel import Panel
        from rich.text import Text

        examples, self.epilog = self.epilog, None
        self.rich_markup_mode = "rich"
        described: list[Any] = self.params
        for parameter in described:
            parameter.help = escape(parameter.help or "")  # dvr-cli[plot] is no markup
        super().format_help(ctx, formatter)
        if examples:
            lines = [line.partition("  # ") for line in examples.splitlines()]
            text = Text("\n").join(
                Text.assemble((command, "bold cyan"), (f"\n    {meaning}", "dim"))
                for command, _, meaning in lines
            )
            Console().print(Panel(text, title="Examples", title_align="left", border_style="dim"))

    def format_options(self, ctx: Any, formatter: Any) -> None:
        """Write arguments and options, these by panel, in the order of the first of each."""
        panels: dict[str, list[tuple[str, str]]] = {}
        for parameter in self.get_params(ctx):
            record = parameter.get_help_record(ctx)
            if record is not None:
                is_argument = parameter.param_type_name == "argument"
                panel = "Arguments" if is_argument else getattr(parameter, "rich_help_panel", None)
                panels.setdefault(panel or "Options", []).append(record)
        for title, records in panels.items():
            with formatter.section(title):
                formatter.write_dl(records)

    def format_epilog(self, ctx: Any, formatter: Any) -> None:
        """Write the examples, each on a line of its own with its meaning below."""
        if self.epilog:
            with formatter.section("Examples"):
                for line in self.epilog.splitlines():
                    command, _, meaning = line.partition("  # ")
                    formatter.write(f"{'':{formatter.current_indent}}{command}\n")
                    formatter.write(f"{'':{formatter.current_indent + 4}}{meaning}\n")
