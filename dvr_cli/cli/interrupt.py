"""Ctrl-C and SIGTERM: the first asks for an end in good order, the second leaves at once."""

from __future__ import annotations

import signal
from types import FrameType, TracebackType

_SIGNALS = (signal.SIGINT, signal.SIGTERM)


class Interrupt:
    """Within this context the first signal only sets ``requested``; a second raises KeyboardInterrupt.

    A process started with SIGINT ignored, as shells start background jobs, goes on ignoring it.
    """

    def __init__(self) -> None:
        """Not requested yet."""
        self.requested = False

    def __enter__(self) -> Interrupt:
        self._previous = {number: signal.getsignal(number) for number in _SIGNALS}
        for number, handler in self._previous.items():
            if handler is not signal.SIG_IGN:
                signal.signal(number, self._handle)
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        for number, handler in self._previous.items():
            signal.signal(number, handler)

    def _handle(self, number: int, frame: FrameType | None) -> None:
        if self.requested:
            raise KeyboardInterrupt
        self.requested = True
