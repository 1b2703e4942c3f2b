"""The host's clock, as a gateway that is recorded sees it."""

from __future__ import annotations

from collections.abc import Callable

from gateway.app.recording.recorder import Recorder
from gateway.app.recording.turns import BASE, TurnLoop
from gateway.core.wire_log import MOUNT

#: The host's clock was set when it has gone this much more or less than time has passed, seconds.
SET = 0.01


class HostClock:
    """The host's own clock in Unix seconds, as it was at the beginning of the turn; that it was set is written down.

    ``show`` is the real one, ``steady`` a clock that nobody sets.
    """

    def __init__(self, loop: TurnLoop, show: Callable[[], float], steady: Callable[[], float]) -> None:
        self._loop, self._show, self._steady = loop, show, steady
        self._ahead = show() - steady()
        self._began = show() - loop.real
        self._tell: Callable[[str], object] = lambda began: None

    def __call__(self) -> float:
        return self._began + self._loop.time() - BASE

    def watch(self, recorder: Recorder) -> None:
        """From now on ``recorder`` is told when it is set."""
        self._tell = lambda began: recorder.line(MOUNT, "k", began)
        self._loop.on_time.append(self._look)
        self._tell(repr(self._began))

    def _look(self) -> None:
        ahead = self._show() - self._steady()
        if abs(ahead - self._ahead) > SET:
            self._began += ahead - self._ahead
            self._ahead = ahead
            self._tell(repr(self._began))
