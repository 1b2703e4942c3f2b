"""A simulated mount on a 9600-baud wire: a TCP port of this process that records when bytes arrived and left.

A request is carried out once a wire of that rate would have delivered it; the reply begins after the time that a hand
control takes, and leaves byte by byte. Times are those of the event loop in seconds; the client shares this clock.
"""

from __future__ import annotations

import asyncio
import random
import socket
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, cast

#: Seconds for a byte of ten bits.
BYTE = 10 / 9600


@dataclass(slots=True)
class Exchange:
    """A request, the time of its first byte, and its end: the reply's last byte sent, or the request carried out."""

    request: bytes
    came: float
    ended: float | None = None


class PacedMount(asyncio.Protocol):
    """``exchanges`` are those so far, in order; ``passed`` counts the bytes of both directions."""

    def __init__(self, simulator: Any, chance: random.Random, quickest: float = 0.03, slowest: float = 0.12) -> None:
        self.simulator, self._chance, self._span = simulator, chance, (quickest, slowest)
        self.exchanges: list[Exchange] = []
        self.passed = 0
        #: Called with every request when the mount carries it out.
        self.understood: Callable[[bytes], None] = lambda request: None
        self._feed: Callable[[bytes], bytes] = simulator.connection(self._later)
        self._loop = asyncio.get_running_loop()
        self._carried = 0.0
        self._transport: asyncio.Transport | None = None

    async def listen(self) -> int:
        """Wait for the gateway on a TCP port; return the port."""
        server = await self._loop.create_server(lambda: self, "127.0.0.1", 0)
        return int(server.sockets[0].getsockname()[1])

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        self._transport = cast(asyncio.Transport, transport)
        self._transport.get_extra_info("socket").setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)

    def data_received(self, data: bytes) -> None:
        now = self._loop.time()
        self.passed += len(data)
        exchange = Exchange(data, now)
        self.exchanges.append(exchange)
        self._carried = max(now, self._carried) + len(data) * BYTE
        self._loop.call_at(self._carried, self._understand, exchange)

    def _understand(self, exchange: Exchange) -> None:
        answer = self._feed(exchange.request)
        self.understood(exchange.request)
        if answer:
            begin = self._loop.time() + self._chance.uniform(*self._span)
            self._send(answer, begin, exchange)
        else:
            exchange.ended = self._loop.time()

    def _later(self, seconds: float, answer: bytes) -> None:
        """Send the delayed second reply of a classic LX200."""
        self._send(answer, self._loop.time() + seconds, None)

    def _send(self, answer: bytes, begin: float, exchange: Exchange | None) -> None:
        for number in range(len(answer)):
            last = exchange if number == len(answer) - 1 else None
            self._loop.call_at(begin + number * BYTE, self._byte, answer[number : number + 1], last)

    def _byte(self, byte: bytes, last_of: Exchange | None) -> None:
        if last_of is not None:
            last_of.ended = self._loop.time()
        self.passed += 1
        if self._transport is not None and not self._transport.is_closing():
            self._transport.write(byte)
