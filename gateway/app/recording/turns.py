"""An event loop with numbered iterations (*turns*), so that a recording can be replayed exactly.

The loop's time stands still within a turn, and input enters only at the beginning of one, in the order of its arrival.
This determines everything else that runs on the loop: with the turn and the time of every input, a replay repeats each
callback. Times are whole microseconds, so that writing them as text loses nothing.
"""

from __future__ import annotations

import asyncio
import heapq
import selectors
import time
from collections import deque
from collections.abc import Callable
from itertools import count
from typing import Any

#: The loop's time at its beginning, seconds.
BASE = 1000.0
#: Timers that are less than so many seconds apart are due together.
RESOLUTION = 1e-9

Wait = Callable[[float | None], list[Any]]


class _Turning(selectors.DefaultSelector):
    """A selector that calls its loop's ``begin_turn`` in each iteration."""

    loop: TurnLoop

    def select(self, timeout: float | None = None) -> list[Any]:
        return self.loop.begin_turn(timeout, super().select)


class _Timer(asyncio.TimerHandle):
    """A timer with a number: of two timers that are due at the same time, the older one always runs first."""

    __slots__ = ("number",)

    def __init__(self, number: int, *arguments: Any) -> None:
        super().__init__(*arguments)
        self.number = number

    def __lt__(self, other: object) -> bool:
        assert isinstance(other, _Timer)
        return (self.when(), self.number) < (other.when(), other.number)


class TurnLoop(asyncio.SelectorEventLoop):
    """An event loop with turns: ``turn`` is the current number, ``elapsed`` its time in seconds since the loop began.

    The callbacks ``on_time`` are called whenever the loop's time has advanced. ``clock`` is the real time in seconds.
    """

    def __init__(self, clock: Callable[[], float] = time.monotonic) -> None:
        self._clock, self._origin = clock, clock()
        self.elapsed, self.turn = 0.0, 0
        self.on_time: list[Callable[[], None]] = []
        self._entering: deque[tuple[Callable[..., object], tuple[object, ...]]] = deque()
        self._timers = count()
        selector = _Turning()
        selector.loop = self
        super().__init__(selector)
        self._clock_resolution = RESOLUTION

    def time(self) -> float:
        return BASE + self.elapsed

    @property
    def real(self) -> float:
        """Real seconds since the loop began, which advance within a turn."""
        return self._clock() - self._origin

    def enter(self, callback: Callable[..., object], *arguments: object) -> None:
        """Run a callback for outside input at the beginning of the next turn. Call this on the loop's thread."""
        self._entering.append((callback, arguments))

    def begin_turn(self, timeout: float | None, wait: Wait) -> list[object]:
        """Wait up to ``timeout`` seconds, counted from this turn's time; return the selector's events."""
        idle = timeout != 0 and not self._entering
        if not idle:
            timeout = 0
        elif timeout is not None:
            timeout = max(0.0, timeout - (self.real - self.elapsed))
        events = wait(timeout)
        self.turn += 1
        elapsed = max(self.elapsed, round(self.real, 6))
        if idle or self._entering or self._due(elapsed):
            self.elapsed = elapsed
            for tell in self.on_time:
                tell()
        while self._entering:
            callback, arguments = self._entering.popleft()
            self.call_soon(callback, *arguments)
        return events

    def _due(self, elapsed: float) -> bool:
        timers: list[asyncio.TimerHandle] = self._scheduled  # type: ignore[attr-defined]  # asyncio has no public way
        return bool(timers) and timers[0].when() < BASE + elapsed + RESOLUTION

    def call_at(  # type: ignore[override]  # the library's own signature needs a newer Python to be written down
        self, when: float, callback: Callable[..., object], *args: Any, context: Any = None
    ) -> asyncio.TimerHandle:
        timer = _Timer(next(self._timers), when, callback, args, self, context)
        heapq.heappush(self._scheduled, timer)  # type: ignore[attr-defined]
        timer._scheduled = True  # type: ignore[attr-defined]
        return timer
