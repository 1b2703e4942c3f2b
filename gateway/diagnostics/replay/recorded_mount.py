"""A recorded mount: its port opens and fails, and its bytes arrive, as recorded; requests wait for their moment."""

from __future__ import annotations

import asyncio
from bisect import bisect_left
from collections import deque
from collections.abc import Callable
from typing import Any

from gateway.app.recording.format import Event
from gateway.core.errors import Fault
from gateway.core.wire_log import MOUNT, show
from gateway.diagnostics.virtual_time import VirtualLoop
from gateway.mount.link.queue import Request, RequestQueue
from gateway.protocols.base.driver import Send
from gateway.protocols.base.reply_rules import ReplyRules
from gateway.transport.wires import OnData, OnLost

#: The rounding of recorded times, seconds.
ROUNDED = 1e-6
#: Waits of at least so many seconds are deadlines; by how many seconds one may have been noticed late.
DEADLINE, LATE = 1.0, 0.05


class RecordedLoop(VirtualLoop):
    """Virtual time in which deadlines expire as late as in the recording.

    A busy computer wakes up late, and what a client sends meanwhile is handled first. If the gateway sent or logged
    something shortly after a deadline, the deadline was its cause. Shorter waits lead to requests, which are held back
    until their recorded moment anyway.
    """

    def __init__(self, events: list[Event]) -> None:
        super().__init__()
        self.began = self.time()
        said = {MOUNT: ">!"}
        self._left = [self.began + event.at for event in events if event.arrow in said.get(event.side, "<!")]

    def call_at(  # type: ignore[override]  # the library's own signature needs a newer Python to be written down
        self, when: float, callback: Callable[..., object], *args: Any, context: Any = None
    ) -> object:
        number = bisect_left(self._left, when - ROUNDED)
        deadline = when - self.time() >= DEADLINE and isinstance(getattr(callback, "__self__", None), asyncio.Timeout)
        late = deadline and number < len(self._left) and self._left[number] - when <= LATE
        return super().call_at(self._left[number] if late else when, callback, *args, context=context)

    async def until(self, at: float) -> None:
        """Wait for this moment of the recording, in seconds from its beginning."""
        arrived = self.create_future()
        super().call_at(self.began + at, arrived.set_result, None)
        await arrived


class RecordedWire:
    """The transport of the recorded mount. Bytes that answer a request are held until it has been sent."""

    name = "recording"

    def __init__(self, events: list[Event], now: Callable[[], float]) -> None:
        self.script = deque(event.data for event in events if event.side == MOUNT and event.arrow == ">")
        self.granted = self.written = 0
        self.strayed: list[str] = []
        self._now = now
        self._held: list[tuple[int, bytes]] = []
        self._port = deque(event for event in events if event.side == MOUNT and event.arrow in "^v")
        self._on_data: OnData | None = None
        self._on_lost: OnLost = lambda reason: None

    async def open(self, on_data: OnData, on_lost: OnLost) -> None:
        while not self._port:
            await asyncio.sleep(3600.0)
        event = self._port.popleft()
        if event.at > self._now() + ROUNDED:
            await asyncio.sleep(event.at - self._now())
        if event.arrow == "v":
            raise OSError(event.data.decode("latin-1"))
        self._on_data, self._on_lost = on_data, on_lost

    def lost(self, event: Event) -> None:
        """Lose the port as recorded; that it could not be opened was raised by ``open``."""
        if self._on_data is not None and self._port and self._port[0] is event:
            self._port.popleft()
            self._on_data = None
            self._on_lost(event.data.decode("latin-1"))

    def deliver(self, after: int, data: bytes) -> None:
        """Deliver recorded bytes once ``after`` requests have been written."""
        if self.written < after or self._held:
            self._held.append((after, data))
        elif self._on_data is not None:
            self._on_data(data)

    def _release(self) -> None:
        while self._held and self.written >= self._held[0][0]:
            data = self._held.pop(0)[1]
            if self._on_data is not None:
                self._on_data(data)

    def write(self, data: bytes) -> None:
        wanted = self.script.popleft() if self.script else b""
        if data != wanted:
            self.strayed.append(f"{self._now():.3f} s: asked '{show(data)}', then '{show(wanted)}'")
        self.written += 1
        if self._held:
            asyncio.get_running_loop().call_soon(self._release)

    async def close(self) -> None:
        """The gateway closes the port, which is recorded as a loss."""
        if self._on_data is not None and self._port and self._port[0].arrow == "v":
            self._port.popleft()
        self._on_data = None


class RecordedQueue(RequestQueue):
    """Releases each recorded request at its recorded moment."""

    def __init__(self, wire: RecordedWire, reply_rules: ReplyRules) -> None:
        super().__init__()
        self._recorded, self._reply_rules = wire, reply_rules

    def allow(self, requests: int) -> None:
        """Release the next requests."""
        self._recorded.granted += requests
        self.wake()

    async def next(
        self, typical_rtt: float, quiet_needed: Callable[[Send], float], answered: bool = False
    ) -> Request | None:
        if answered:
            await self._let_clients_follow_up()
        if self._recorded.granted > self._recorded.written and self._recorded.script:
            for request in self.by_turn():  # of two candidates, the one whose bytes were recorded goes first
                if not request.future.done() and self._bytes(request.command) == self._recorded.script[0]:
                    self.take(request)
                    return request
        await self.wait_for_change()
        return None

    def _bytes(self, command: Send) -> bytes:
        try:
            return self._reply_rules.encode(command)
        except Fault:
            return b""
