"""A recorded mount: its port opens and is lost as it was, its bytes come as they came, nothing is asked out of turn."""

from __future__ import annotations

import asyncio
from bisect import bisect_left
from collections import deque
from collections.abc import Callable
from typing import Any

from gateway.app.recording.format import Event
from gateway.core.errors import Fault
from gateway.core.wire_log import MOUNT
from gateway.diagnostics.virtual_time import VirtualLoop
from gateway.mount.link.queue import Request, RequestQueue
from gateway.protocols.base.driver import Send
from gateway.protocols.base.reply_rules import ReplyRules
from gateway.transport.wires import OnData, OnLost

#: Half of the recorded times' last digit, seconds.
ROUNDED = 1e-6
#: Waits of so many seconds are deadlines; the latest that one may have been noticed, seconds.
DEADLINE, LATE = 1.0, 0.05


class RecordedLoop(VirtualLoop):
    """Virtual time in which deadlines are as late as they were.

    A busy computer wakes late, and what a client says meanwhile comes first. A deadline shortly before something left
    the gateway, or was noted, was what brought it about. Shorter waits lead to requests, which are held back till then.
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
        """Wait for exactly this moment of the recording, seconds from its beginning."""
        arrived = self.create_future()
        super().call_at(self.began + at, arrived.set_result, None)
        await arrived


class RecordedWire:
    """The mount as it was recorded. Bytes that answer a request wait for it."""

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
        """The port was lost then, or could not be opened, which ``open`` has said."""
        if self._on_data is not None and self._port and self._port[0] is event:
            self._port.popleft()
            self._on_data = None
            self._on_lost(event.data.decode("latin-1"))

    def deliver(self, after: int, data: bytes) -> None:
        """Bytes as they arrived then, once ``after`` requests have been written."""
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
            self.strayed.append(f"{self._now():.3f} s: asked {data!r}, then {wanted!r}")
        self.written += 1
        if self._held:
            asyncio.get_running_loop().call_soon(self._release)

    async def close(self) -> None:
        """Closed by the gateway itself, which is recorded as a loss."""
        if self._on_data is not None and self._port and self._port[0].arrow == "v":
            self._port.popleft()
        self._on_data = None


class RecordedQueue(RequestQueue):
    """Lets go what was sent then, when it was sent."""

    def __init__(self, wire: RecordedWire, dialogue: ReplyRules) -> None:
        super().__init__()
        self._recorded, self._dialogue = wire, dialogue

    def allow(self, requests: int) -> None:
        """The moment of the next requests has come."""
        self._recorded.granted += requests
        self.wake()

    async def next(self, typical: float, gap: Callable[[Send], float], answered: bool = False) -> Request | None:
        if answered:
            await self._what_follows()
        if self._recorded.granted > self._recorded.written and self._recorded.script:
            for request in self.in_turn():  # of two that ask the same the one goes first that did then
                if not request.future.done() and self._bytes(request.ask) == self._recorded.script[0]:
                    self.take(request)
                    return request
        await self.news()
        return None

    def _bytes(self, ask: Send) -> bytes:
        try:
            return self._dialogue.encode(ask)
        except Fault:
            return b""
