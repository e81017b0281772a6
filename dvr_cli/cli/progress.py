"""Progress on stderr while a mesh is read and relaxed."""

from __future__ import annotations

import sys
from collections.abc import Callable
from dataclasses import asdict
from time import perf_counter
from types import TracebackType
from typing import TYPE_CHECKING, NamedTuple

from dvr_cli.cli.streams import say

if TYPE_CHECKING:
    from dvr_cli.cli.display import Display
    from dvr_cli.relax.sweeps import Sweep


class Known(NamedTuple):
    """Knowledge of a run while it goes on.

    time_limit: seconds that it may sweep. sweeps: how many it makes, where that is fixed. interrupted:
    whether it was asked to end. compiling: whether NumPy works until the compiled engine is there.
    """

    time_limit: float | None = None
    sweeps: int | None = None
    interrupted: Callable[[], bool] = lambda: False
    compiling: Callable[[], bool] = lambda: False


class Piece(NamedTuple):
    """A piece of the line of progress; those of the lowest rank go first where there is no room for all."""

    text: str
    rank: int


_GAP = 2  # columns between pieces


class Progress:
    """Each sweep as a line of its own (verbose), else one line kept up to date on a terminal, else nothing.

    As a context it shows that line, and wipes it when it ends.
    """

    def __init__(self, quiet: bool, verbose: bool, known: Known | None = None) -> None:
        """quiet: nothing at all. verbose: a line for each sweep, terminal or not."""
        self._verbose = verbose
        self._live = not quiet and not verbose and sys.stderr is not None and sys.stderr.isatty()
        self._known = known or Known()
        self._doing = ""
        self._sweep: Sweep | None = None
        self._began = self._sweeping = self._swept = perf_counter()
        self._display: Display | None = None

    def show(self, text: str) -> None:
        """Show what is being done now, on a terminal."""
        self._doing, self._sweep = text, None
        self._renew()

    def sweep(self, sweep: Sweep) -> None:
        """Show what a sweep did."""
        if self._verbose:
            from dvr_cli.report.text.lines import sweep_line  # not before: wrong options need no NumPy

            say(sweep_line(**asdict(sweep)))
        self._swept = perf_counter()
        if sweep.sweep == 1:
            self._sweeping = self._swept - sweep.seconds
        self._doing, self._sweep = sweep.phase, sweep
        self._renew()

    def pieces(self, room: int) -> list[str]:
        """The line as it is now, in pieces that fit into so many columns; the first is cut if need be."""
        fitting = self._all_pieces()
        while len(fitting) > 1 and sum(len(piece.text) + _GAP for piece in fitting) - _GAP > room:
            fitting.remove(min(fitting, key=lambda piece: piece.rank))
        first, *others = (piece.text for piece in fitting)
        return [first if len(first) <= room else f"{first[: room - 3]}...", *others]

    def _all_pieces(self) -> list[Piece]:
        from dvr_cli.report.text.lines import digits

        now, pieces, sweep = perf_counter(), [Piece(self._doing, 9)], self._sweep
        if sweep is not None:
            pieces += [Piece(f"sweep {sweep.sweep}", 6), Piece(f"Q1 {digits(sweep.q1)}", 7)]
            if sweep.below is not None:
                pieces.append(Piece(f"{100 * sweep.below:.2g} % below care", 3))
        if self._known.interrupted():
            pieces.insert(0, Piece("interrupted, about to end", 10))
        elif sweep is not None and (left := self._left(now, sweep)):
            pieces.append(Piece(left, 4))
        if self._known.compiling():
            pieces.append(Piece("compiling", 5))
        return [*pieces, Piece(_clock(now - self._began), 1)]

    def _left(self, now: float, sweep: Sweep) -> str:
        """The time left, as far as it is known: where the number of sweeps or their time is fixed.

        Other runs end when nothing gains, after some tens of sweeps or some hundreds of rounds of patches.
        """
        if self._known.sweeps is not None:
            each = (self._swept - self._sweeping) / sweep.sweep
            return f"{_clock((self._known.sweeps - sweep.sweep) * each - (now - self._swept))} left"
        if self._known.time_limit is not None:
            return f"{_clock(self._known.time_limit - (now - self._sweeping))} left at most"
        return ""

    def _renew(self) -> None:
        if self._display is not None:
            self._display.refresh()

    def __enter__(self) -> Progress:
        if self._live:
            from dvr_cli.cli.display import Display  # rich, which only a terminal needs

            self._display = Display(self.pieces)
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if self._display is not None:
            self._display.stop()


def _clock(seconds: float) -> str:
    """A time as minutes and seconds, or hours as well."""
    minutes, second = divmod(max(0, round(seconds)), 60)
    hour, minute = divmod(minutes, 60)
    return f"{hour}:{minute:02d}:{second:02d}" if hour else f"{minute}:{second:02d}"
