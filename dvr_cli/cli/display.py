"""The line of progress on a terminal, drawn by rich; importing this module imports it."""

from __future__ import annotations

import sys
from collections.abc import Callable

from rich.console import Console
from rich.live import Live
from rich.spinner import Spinner
from rich.text import Text

_STYLES = ("bold", "", "cyan")  # of the first pieces
_SPINNER = 3  # columns of it, with a gap, and of the one that stays free
_A_SECOND = 4  # times that the line is drawn anew: it shows the time


class Display:
    """A line on stderr that is drawn anew at intervals, until ``stop`` wipes it."""

    def __init__(self, pieces: Callable[[int], list[str]]) -> None:
        """Begin; pieces: gives what is to be shown, in so many columns."""
        self._pieces = pieces
        self._console = Console(file=sys.stderr, highlight=False)
        self._spinner = Spinner("dots" if self._console.encoding.startswith("utf") else "line")
        self._live = Live(
            console=self._console,
            get_renderable=self._line,
            refresh_per_second=_A_SECOND,
            transient=True,
            redirect_stdout=False,
            redirect_stderr=False,
        )
        self._live.start()

    def _line(self) -> Spinner:
        line = Text()
        for number, piece in enumerate(self._pieces(self._console.width - _SPINNER)):
            style = _STYLES[number] if number < len(_STYLES) else "dim"
            line.append("  " if number else "").append(piece, style)
        self._spinner.update(text=line)
        return self._spinner

    def refresh(self) -> None:
        """Draw the line now."""
        self._live.refresh()

    def stop(self) -> None:
        """Wipe the line."""
        self._live.stop()
