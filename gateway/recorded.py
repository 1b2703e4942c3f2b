"""A recorded mount: its port opens and is lost as it was, its bytes come as they came, nothing is asked out of turn."""

from __future__ import annotations

import asyncio
import heapq
from collections import deque
from collections.abc import Callable

from gateway.driver import Ask
from gateway.errors import Fault
from gateway.line import Dialogue, Job, Line
from gateway.recording import MOUNT, Event
from gateway.transcript import Transcript
from gateway.wires import OnData, OnLost

#: Half of the recorded times' last digit, seconds.
ROUNDED = 1e-6


class RecordedWire:
    """The mount as it was recorded. Bytes that answer a request wait for it."""

    name = "recording"

    def __init__(self, events: list[Event], now: Callable[[], float]) -> None:
        self.script = deque(event.data for event in events if event.side == MOUNT and event.arrow == ">")
        self.allowed = 0
        self.strayed: list[str] = []
        self._now = now
        self._held: list[bytes] = []
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

    def deliver(self, data: bytes) -> None:
        """Bytes as they arrived then."""
        if self.allowed > 0:
            self._held.append(data)
        elif self._on_data is not None:
            self._on_data(data)

    def write(self, data: bytes) -> None:
        wanted = self.script.popleft() if self.script else b""
        if data != wanted:
            self.strayed.append(f"{self._now():.3f} s: asked {data!r}, then {wanted!r}")
        self.allowed -= 1
        if self.allowed <= 0:
            held, self._held = self._held, []
            for chunk in held:
                asyncio.get_running_loop().call_soon(self.deliver, chunk)

    async def close(self) -> None:
        self._on_data = None


class RecordedLine(Line):
    """A line that sends what was sent then, when it was sent."""

    def __init__(self, wire: RecordedWire, dialogue: Dialogue, transcript: Transcript) -> None:
        super().__init__(wire, dialogue, transcript)
        self._recorded = wire

    def allow(self) -> None:
        """The moment of the next request has come."""
        self._recorded.allowed += 1
        self._wake.set()

    async def _next(self) -> Job | None:
        if self._recorded.allowed > 0 and self._recorded.script:
            for item in sorted(self._queue):
                if not item[2].future.done() and self._bytes(item[2].ask) == self._recorded.script[0]:
                    self._queue.remove(item)
                    heapq.heapify(self._queue)
                    return item[2]
        self._wake.clear()
        await self._wake.wait()
        return None

    def _bytes(self, ask: Ask) -> bytes:
        try:
            return self.dialogue.encode(ask)
        except Fault:
            return b""
