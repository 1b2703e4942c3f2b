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


def record(path: Path, gateway: Gateway, longest: int = LONGEST, turns: TurnLoop | None = None) -> Recorder:
    """Write down what happens from now on, in files of ``longest`` bytes. Raises UserError."""
    now = asyncio.get_running_loop().time
    config = {"mount": gateway.config, "surface": gateway.surfaces}
    settings = {"began": gateway.clock(), "config": config, "past": gateway.past, "version": VERSION}
    keep = gateway.config.record_keep
    recorder = Recorder(path, now, msgspec.to_builtins(settings), longest, keep, gateway.warn, turns)
    gateway.wire_log.sinks.append(recorder.put)
    return recorder


def record_whole(path: Path, gateway: Gateway, longest: int = LONGEST) -> Recorder:
    """Record a gateway before it is opened, with its turns where the loop can tell them apart. Raises UserError."""
    loop = asyncio.get_running_loop()
    if not isinstance(loop, TurnLoop):
        return record(path, gateway, longest)
    recorder = record(path, gateway, longest, loop)
    gateway.entrance = RecordedEntrance(loop, recorder)
    if isinstance(gateway.clock, HostClock):
        gateway.clock.watch(recorder)
    return recorder
