"""Progress on stderr while a mesh is read and relaxed."""

from __future__ import annotations

import shutil
import sys
from dataclasses import asdict
from types import TracebackType
from typing import TYPE_CHECKING

from dvr_cli.cli.streams import say

if TYPE_CHECKING:
    from dvr_cli.relax.sweeps import Sweep


class Progress:
    """Each sweep as a line of its own (verbose), else one line rewritten on a terminal, else nothing.

    As a context it wipes that line when it ends.
    """

    def __init__(self, quiet: bool, verbose: bool) -> None:
        """quiet: nothing at all. verbose: a line for each sweep, terminal or not."""
        self._verbose = verbose
        self._live = not quiet and not verbose and sys.stderr is not None and sys.stderr.isatty()
        self._shown = 0

    def show(self, text: str) -> None:
        """Show what is being done now, on a terminal."""
        if self._live:
            line = text[: shutil.get_terminal_size().columns - 1]
            say("\r" + line.ljust(self._shown), end="")
            self._shown = len(line)

    def sweep(self, sweep: Sweep) -> None:
        """Show what a sweep did."""
        if not self._verbose and not self._live:
            return
        from dvr_cli.report.text.lines import sweep_line  # not before: help and wrong options need no NumPy

        if self._verbose:
            say(sweep_line(**asdict(sweep)))
        else:
            self.show(sweep_line(**asdict(sweep)))

    def __enter__(self) -> Progress:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if self._shown:
            say("\r" + " " * self._shown + "\r", end="")
