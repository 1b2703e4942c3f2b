"""Sets up the recording of a gateway: its clock, its entrance, its file."""

from __future__ import annotations

import asyncio
import time
from collections.abc import Callable
from pathlib import Path

import msgspec

from gateway.app.gateway import Gateway
from gateway.app.recording.recorded_entrance import RecordedEntrance
from gateway.app.recording.recorder import LONGEST, Recorder
from gateway.app.recording.turns import BASE, TurnLoop
from gateway.core.about import RULES, commit, version
from gateway.core.wire_log import MOUNT

#: The host's clock counts as set when it differs by so many seconds from the time that has passed.
SET = 0.01


class HostClock:
    """The host's clock in Unix seconds at the beginning of the turn; changes by setting it are recorded.

    ``show`` is the real clock, ``steady`` a monotonic one.
    """

    def __init__(self, loop: TurnLoop, show: Callable[[], float], steady: Callable[[], float]) -> None:
        self._loop, self._show, self._steady = loop, show, steady
        self._ahead = show() - steady()
        self._began = show() - loop.real
        self._record: Callable[[str], object] = lambda began: None

    def __call__(self) -> float:
        return self._began + self._loop.time() - BASE

    def watch(self, recorder: Recorder) -> None:
        """Record the clock now, and from now on whenever it is set."""
        self._record = lambda began: recorder.line(MOUNT, "k", began)
        self._loop.on_time.append(self._check)
        self._record(repr(self._began))

    def _check(self) -> None:
        ahead = self._show() - self._steady()
        if abs(ahead - self._ahead) > SET:
            self._began += ahead - self._ahead
            self._ahead = ahead
            self._record(repr(self._began))


def host_clock() -> Callable[[], float]:
    """Return the host's clock, in Unix seconds, for a gateway that will be recorded."""
    loop = asyncio.get_running_loop()
    return HostClock(loop, time.time, time.monotonic) if isinstance(loop, TurnLoop) else time.time


def record(path: Path, gateway: Gateway, longest: int = LONGEST, turns: TurnLoop | None = None) -> Recorder:
    """Record what happens from now on, in files of ``longest`` bytes. Raises UserError."""
    now = asyncio.get_running_loop().time
    config = {"mount": gateway.config, "surface": gateway.surfaces}
    settings = {
        "began": gateway.clock(),
        "config": config,
        "past": gateway.previous_run,
        "version": version(),
        "commit": commit(),
        "rules": RULES,
    }
    keep = gateway.config.record_keep
    recorder = Recorder(path, now, msgspec.to_builtins(settings), longest, keep, gateway.warn, turns)
    gateway.wire_log.sinks.append(recorder.put)
    return recorder


def record_whole(path: Path, gateway: Gateway, longest: int = LONGEST) -> Recorder:
    """Record a gateway from before it is opened, with turns if the loop is a ``TurnLoop``. Raises UserError."""
    loop = asyncio.get_running_loop()
    if not isinstance(loop, TurnLoop):
        return record(path, gateway, longest)
    recorder = record(path, gateway, longest, loop)
    gateway.entrance = RecordedEntrance(loop, recorder)
    if isinstance(gateway.clock, HostClock):
        gateway.clock.watch(recorder)
    return recorder
