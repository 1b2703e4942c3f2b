"""A serial line within the process, at any baud rate: bytes sent at the wrong rate arrive garbled, as with a UART."""

from __future__ import annotations

import asyncio
from collections.abc import Callable

from gateway.transport.baud import garble
from gateway.transport.wires import OnData, OnLost

#: The device at the other end: a function from the bytes that arrive there to its reply.
Device = Callable[[bytes], bytes]


class UartWire:
    """A transport to a device at ``rate``; ``log`` holds the rate and the bytes of everything that was sent to it."""

    name = "test"

    def __init__(self, device: Device, rate: int = 9600, latency: float = 0.1) -> None:
        self.device, self.rate, self.latency = device, rate, latency
        self.baud = 9600
        self.log: list[tuple[int, bytes]] = []
        self.on_data: OnData | None = None
        self.on_lost: OnLost | None = None
        self.is_open = False

    async def open(self, on_data: OnData, on_lost: OnLost) -> None:
        assert not self.is_open
        self.on_data, self.on_lost, self.is_open = on_data, on_lost, True

    def set_baud(self, baud: int) -> None:
        self.baud = baud

    def write(self, data: bytes) -> None:
        self.log.append((self.baud, data))
        answer = self.device(garble(data, self.baud, self.rate))
        if answer:
            asyncio.get_running_loop().call_later(self.latency, self.say, answer)

    def say(self, data: bytes) -> None:
        """Send something from the device, at its own rate."""
        if self.is_open and self.on_data is not None:
            self.on_data(garble(data, self.rate, self.baud))

    def sent(self) -> list[bytes]:
        """Return everything that was sent, in order."""
        return [data for _, data in self.log]

    async def close(self) -> None:
        self.is_open = False
