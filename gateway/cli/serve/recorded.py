"""A gateway that is recorded: its clock, its entrance, its file."""

from __future__ import annotations

import asyncio
import time
from collections.abc import Callable
from pathlib import Path

import msgspec

from gateway.app.gateway import Gateway
from gateway.app.recording.host_clock import HostClock
from gateway.app.recording.recorded_entrance import RecordedEntrance
from gateway.app.recording.recorder import LONGEST, Recorder
from gateway.app.recording.turns import TurnLoop
from gateway.core.about import VERSION


def host_clock() -> Callable[[], float]:
    """The host's clock for a gateway that is going to be recorded, Unix seconds."""
    loop = asyncio.get_running_loop()
    return HostClock(loop, time.time, time.monotonic) if isinstance(loop, TurnLoop) else time.time


def record(path: str, gateway: Gateway, longest: int = LONGEST) -> Recorder:
    """Record a gateway, before it is opened, in files of ``longest`` bytes. Raises UserError."""
    loop, clock = asyncio.get_running_loop(), gateway.clock
    config = {"mount": gateway.config, "surface": gateway.surfaces}
    settings = {"began": clock(), "config": config, "past": gateway.past, "version": VERSION}
    recorder = Recorder(
        Path(path), loop.time, msgspec.to_builtins(settings), longest, gateway.config.record_keep, gateway.warn, loop
    )
    gateway.wire_log.sinks.append(recorder.put)
    if isinstance(loop, TurnLoop):
        gateway.entrance = RecordedEntrance(loop, recorder)
        if isinstance(clock, HostClock):
            clock.watch(recorder)
    return recorder
