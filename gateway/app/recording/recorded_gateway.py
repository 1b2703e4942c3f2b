"""Sets up the recording of a gateway: its clock, its entrance, its file.

All input enters at the beginning of a turn of the event loop, and is recorded when it enters. Everything the gateway
does is determined by this input and its turns and times, so a replay repeats it.
"""

from __future__ import annotations

import asyncio
import time
from collections.abc import Awaitable, Callable, Sequence
from itertools import chain, count
from pathlib import Path
from typing import TypeVar

import msgspec
from msgspec.structs import replace

from gateway.app.gateway import Gateway
from gateway.app.recording.entrance import Admitting, Entrance, Work
from gateway.app.recording.format import escape
from gateway.app.recording.recorder import LONGEST, Recorder
from gateway.app.recording.turns import BASE, TurnLoop
from gateway.core.about import commit, version
from gateway.core.requests import Request, encode
from gateway.core.waiting import result_of
from gateway.core.wire_log import MOUNT
from gateway.mount.motion.reconciler import Announce
from gateway.transport import ConnectionHandler
from gateway.transport.handler import Accept, Connected
from gateway.transport.wires import OnData, OnLost, Transport

_T = TypeVar("_T")


class RecordedEntrance(Entrance):
    """Lets input enter at the beginning of a turn, and has ``recorder`` write it down."""

    def __init__(self, loop: TurnLoop, recorder: Recorder) -> None:
        self._loop, self.recorder = loop, recorder
        self._wait_numbers = count(1)
        self._present: set[str] = set()

    def accept(self, acceptor: Admitting) -> Accept:
        def accept(connected: Connected) -> ConnectionHandler:
            acceptor.admit(connected)
            connected = replace(connected, name=self._unique(connected.name))
            connection = _RecordedConnection(self._loop, self.recorder, connected, self._present.discard)
            self._loop.enter(connection.enter, acceptor)
            return connection

        return accept

    def _unique(self, name: str) -> str:
        """Return a name that no open connection has: clients of two surfaces may have the same host and port."""
        unique = next(one for one in chain([name], (f"{name}/{n}" for n in count(2))) if one not in self._present)
        self._present.add(unique)
        return unique

    def wire(self, wire: Transport) -> Transport:
        return _RecordedTransport(wire, self)

    def announcers(self, announcers: Sequence[Announce]) -> Sequence[Announce]:
        """In a recording they are one wait."""

        async def all_of_them() -> None:
            for announce in announcers:
                await announce()

        return [lambda: self.wait_outside(all_of_them())]

    async def begin(self, begin: Callable[[], None]) -> None:
        begun = self._loop.create_future()

        def go() -> None:
            begin()
            begun.set_result(None)

        self.apply_event("b", go)
        await begun

    def apply_event(self, arrow: str, act: Callable[[], None]) -> None:
        def go() -> None:
            self.recorder.line(MOUNT, arrow)
            act()

        self._loop.enter(go)

    async def carry_out(self, arrow: str, work: Work[_T], request: Request | None = None) -> _T:
        text = "" if request is None else encode(request)
        begun: asyncio.Future[asyncio.Task[_T]] = self._loop.create_future()

        def go() -> None:
            self.recorder.line(MOUNT, arrow, text)
            task = self._loop.create_task(work())
            if begun.cancelled():
                task.add_done_callback(lambda done: done.cancelled() or done.exception())
            else:
                begun.set_result(task)

        self._loop.enter(go)
        return await result_of(await begun)  # a caller that gives up waiting does not cancel a stop

    async def wait_outside(self, work: Awaitable[None]) -> None:
        """Wait for something outside, and continue at the beginning of a turn. Raises OSError if it failed."""
        number, failure = next(self._wait_numbers), ""
        try:
            await work
        except Exception as error:  # pyserial has more kinds of failure than OSError
            failure = str(getattr(error, "strerror", None) or error or type(error).__name__).replace("\n", " ").strip()
        gate = self._loop.create_future()

        def go() -> None:
            if not gate.done():
                self.recorder.line(MOUNT, "g", f"{number} {failure}")
                gate.set_result(None)

        self._loop.enter(go)
        await gate
        if failure:
            raise OSError(failure)


class _RecordedConnection:
    """One connection at the entrance. Replies to the commands of one chunk of bytes are sent as one."""

    def __init__(
        self, loop: TurnLoop, recorder: Recorder, connected: Connected, release_name: Callable[[str], None]
    ) -> None:
        self._loop, self._recorder, self._connected, self._release_name = loop, recorder, connected, release_name
        self._name, self._write = connected.name, connected.write
        self._handler: ConnectionHandler | None = None
        self._replies: list[bytes] | None = None
        #: How many received chunks have not entered yet.
        self._waiting = 0

    @property
    def answered(self) -> bool:
        return self._handler is not None and not self._waiting and self._handler.answered

    def enter(self, acceptor: Admitting) -> None:
        self._handler = acceptor.create(replace(self._connected, write=self._reply))

    def feed(self, data: bytes) -> None:
        self._waiting += 1
        self._loop.enter(self._feed, data)

    def _feed(self, data: bytes) -> None:
        assert self._handler is not None
        self._waiting -= 1
        self._recorder.line(self._name, ">", escape(data))
        replies: list[bytes] = []
        self._replies = replies
        try:
            self._handler.feed(data)
        finally:
            self._replies = None
            if replies:
                self._write(b"".join(replies))

    def _reply(self, data: bytes) -> int | None:
        if self._replies is None:
            return self._write(data)
        self._replies.append(data)
        return None

    def peer_closed(self) -> None:
        self._loop.enter(self._end_of_input)

    def _end_of_input(self) -> None:
        assert self._handler is not None
        self._recorder.line(self._name, "e")
        self._handler.peer_closed()

    def close(self) -> None:
        self._write = lambda data: None
        self._loop.enter(self._close)

    def _close(self) -> None:
        assert self._handler is not None
        self._handler.close()
        self._release_name(self._name)


class _RecordedTransport:
    """A transport whose bytes, losses and failures enter at the beginning of a turn."""

    def __init__(self, wire: Transport, entrance: RecordedEntrance) -> None:
        self._wire, self._entrance = wire, entrance
        self.name, self.newest_only = wire.name, getattr(wire, "newest_only", False)
        self._loop, self._recorder = entrance._loop, entrance.recorder
        self._written = 0

    async def open(self, on_data: OnData, on_lost: OnLost) -> None:
        def lost(reason: str) -> None:
            reason = reason.replace("\n", " ").strip()
            self._recorder.line(MOUNT, "l", reason)
            on_lost(reason)

        def arrived(data: bytes, written: int) -> None:
            if not self.newest_only or written == self._written:
                on_data(data)

        enter = self._loop.enter
        await self._entrance.wait_outside(
            self._wire.open(lambda data: enter(arrived, data, self._written), lambda reason: enter(lost, reason))
        )

    def write(self, data: bytes) -> None:
        self._written += 1
        try:
            self._wire.write(data)
        except Exception as error:  # the transport's own kinds, in words that fit on a line of the recording
            reason = str(error).replace("\n", " ").strip()
            self._recorder.line(MOUNT, "w", reason)
            raise OSError(reason) from error

    async def close(self) -> None:
        await self._entrance.wait_outside(self._wire.close())


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
