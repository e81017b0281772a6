"""The page of the documentation about options, from their table: python -m dvr_cli.cli.options_page."""

from __future__ import annotations

from dvr_cli.options import TABLE
from dvr_cli.options.record import Option

_HEAD = """# Options

This page is made from the table in `dvr_cli/options`:
`python -m dvr_cli.cli.options_page > docs/options.md`.

`dvr COMMAND --help` says the same of one command. In Python the options of `dvr smooth` and `dvr untangle`
are keywords of the functions of these names, with `_` for `-`.

"""
_COMMANDS = {"quality": "report quality", "compare": "report compare"}  # of which names are longer


def options_page() -> str:
    """The page, in Markdown: the options under their headings, each with its default in every command."""
    panels = list(dict.fromkeys(option.panel for option in TABLE))
    return _HEAD + "\n".join(
        f"## {panel}\n\n| option | commands, default | meaning |\n| --- | --- | --- |\n"
        + "".join(_row(option) for option in TABLE if option.panel == panel)
        for panel in panels
    )


def _row(option: Option) -> str:
    names = option.flags or (f"--{option.label}",)
    value = "" if option.values.type is bool else f" {option.metavar or _kind(option)}"
    commands = [f"{_command(name)}{_default(option.of(name))}" for name in option.commands]
    texts: dict[str, list[str]] = {}
    for name in option.commands:
        texts.setdefault(option.of(name).help, []).append(_command(name))
    meaning = next(iter(texts))
    for text, others in list(texts.items())[1:]:
        meaning += f" {', '.join(others)}: {text}"
    cells = ("`" + ", ".join(names) + value + "`", ", ".join(commands), _listed(option) + meaning)
    return f"| {' | '.join(cell.replace('|', chr(92) + '|') for cell in cells)} |\n"


def _command(name: str) -> str:
    return f"`{_COMMANDS.get(name, name)}`"


def _kind(option: Option) -> str:
    return "NAME" if option.values.names else "X"


def _default(option: Option) -> str:
    nothing = option.default is None or option.default is False or option.default in (..., ())
    if nothing or not option.shown:
        return ""
    return " (on)" if option.default is True else f" ({option.default})"


def _listed(option: Option) -> str:
    """The values there are, where help alone would not say."""
    return "".join(f"`{name}` " for name in option.values.names if name not in option.help)


if __name__ == "__main__":
    print(options_page(), end="")
