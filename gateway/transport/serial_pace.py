"""The pace of a serial line: bytes go through one after the other, each in the time of ten bits.

Ports in memory and on a network hand over any number of bytes at once. A real line at 9600 baud takes a millisecond for
every one of them, in either direction, and what is told of the times of a mount without that flatters.
"""

from __future__ import annotations

import asyncio
from collections.abc import Callable

#: A start bit, eight bits of data and a stop bit.
BITS = 10
#: So many bytes may wait in one direction; beyond that they are lost, as where nobody reads a port in time.
LONGEST = 65536


class Pace:
    """One direction of a line; ``deliver`` is called with bytes when they have arrived at its other end."""

    def __init__(self, baud: int, deliver: Callable[[bytes], object]) -> None:
        self._byte = BITS / baud
        self._deliver = deliver
        self._waiting = bytearray()
        self._timer: asyncio.TimerHandle | None = None
        self._due = 0.0  # when the first byte that waits has arrived

    def send(self, data: bytes) -> None:
        """Put bytes on the line, behind those that are on it."""
        self._waiting += data[: LONGEST - len(self._waiting)]
        if self._timer is None and self._waiting:
            loop = asyncio.get_running_loop()
            self._due = loop.time() + self._byte
            self._timer = loop.call_at(self._due, self._arrived)

    def _arrived(self) -> None:
        """One byte has, and those besides whose time came while the computer was busy."""
        loop = asyncio.get_running_loop()
        count = min(len(self._waiting), 1 + int(max(0.0, loop.time() - self._due) / self._byte))
        data = bytes(self._waiting[:count])
        del self._waiting[:count]
        self._timer = None
        self._due += (count - 1) * self._byte
        if self._waiting:
            self._due += self._byte
            self._timer = loop.call_at(self._due, self._arrived)
        self._deliver(data)

    def close(self) -> None:
        """Forget what is still on the line."""
        self._waiting.clear()
        if self._timer is not None:
            self._timer.cancel()
            self._timer = None
