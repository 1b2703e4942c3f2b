"""Another baud rate for a client's serial port, on trial: who is not understood at it gets the old one back.

``:SB<n>#`` is acknowledged at the old rate; then both sides change (Meade protocol revision L, :SB). A program that did
not follow, or a cable that cannot, would be lost for good without the way back.
"""

from __future__ import annotations

import asyncio
from collections.abc import Callable

#: Seconds in which a command must be understood at the new rate.
TRIAL = 5.0


class BaudTrial:
    """``change`` sets the port to a rate and says which one it had."""

    def __init__(self, change: Callable[[int], int]) -> None:
        self._change = change
        self._former: int | None = None
        self._timer: asyncio.TimerHandle | None = None

    def begin(self, baud: int) -> None:
        """Go on at this rate. A trial under way falls back to what was before it."""
        former = self._change(baud)
        self._former = former if self._former is None else self._former
        self._stop_timer()
        self._timer = asyncio.get_running_loop().call_later(TRIAL, self._back)

    def understood(self) -> None:
        """A command has arrived whole: the rate stays."""
        self._stop_timer()
        self._former = None

    def _back(self) -> None:
        former, self._former, self._timer = self._former, None, None
        if former is not None:
            self._change(former)

    def _stop_timer(self) -> None:
        if self._timer is not None:
            self._timer.cancel()
            self._timer = None

    def end(self) -> None:
        """The connection is gone."""
        self._stop_timer()
