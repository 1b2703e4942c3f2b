"""The baud rate of a serial line: timing of bytes, the effect of a wrong rate, and a change of rate on trial.

A byte is ten bits: a start bit (0), eight data bits, lowest first, and a stop bit (1); the idle line is 1. Ports in
memory and on a network deliver bytes at once, at any rate: timings measured there look better than they are.
"""

from __future__ import annotations

import asyncio
import math
from collections.abc import Callable

#: A start bit, eight bits of data and a stop bit.
BITS_PER_BYTE = 10
#: Maximum number of bytes on the line in one direction; more are lost, as on a port that is not read in time.
MAX_WAITING_BYTES = 65536
#: Seconds until the old rate is restored, unless a command is understood at the new rate.
TRIAL_TIME = 5.0


class PacedLine:
    """One direction of a serial line; ``deliver`` is called with bytes when they arrive at the other end."""

    def __init__(self, baud: int, deliver: Callable[[bytes], object]) -> None:
        self._byte_time = BITS_PER_BYTE / baud
        self._deliver = deliver
        self._in_transit = bytearray()
        self._timer: asyncio.TimerHandle | None = None
        self._due_at = 0.0  # when the first waiting byte arrives

    def send(self, data: bytes) -> None:
        """Put bytes on the line, after the bytes that are still on it."""
        self._in_transit += data[: MAX_WAITING_BYTES - len(self._in_transit)]
        if self._timer is None and self._in_transit:
            loop = asyncio.get_running_loop()
            self._due_at = loop.time() + self._byte_time
            self._timer = loop.call_at(self._due_at, self._deliver_due_bytes)

    def _deliver_due_bytes(self) -> None:
        """Deliver the byte that is due, and those that became due while the computer was busy."""
        loop = asyncio.get_running_loop()
        count = min(len(self._in_transit), 1 + int(max(0.0, loop.time() - self._due_at) / self._byte_time))
        data = bytes(self._in_transit[:count])
        del self._in_transit[:count]
        self._timer = None
        self._due_at += (count - 1) * self._byte_time
        if self._in_transit:
            self._due_at += self._byte_time
            self._timer = loop.call_at(self._due_at, self._deliver_due_bytes)
        self._deliver(data)

    def close(self) -> None:
        """Discard the bytes on the line."""
        self._in_transit.clear()
        if self._timer is not None:
            self._timer.cancel()
            self._timer = None


class BaudTrial:
    """Changes the baud rate of a client's port, and changes it back if no command is understood at the new rate.

    ``:SB<n>#`` is acknowledged at the old rate; then both sides change (Meade protocol revision L, :SB). The change
    back serves a client that has kept the old rate. ``change_baud`` sets the rate and returns the old rate.
    """

    def __init__(self, change_baud: Callable[[int], int]) -> None:
        self._change_baud = change_baud
        self._old_baud: int | None = None
        self._timer: asyncio.TimerHandle | None = None

    def begin(self, baud: int) -> None:
        """Change the rate on trial. If a trial is under way, the rate before that trial remains the fallback."""
        previous = self._change_baud(baud)
        self._old_baud = previous if self._old_baud is None else self._old_baud
        self.cancel_fallback()
        self._timer = asyncio.get_running_loop().call_later(TRIAL_TIME, self._restore)

    def confirm(self) -> None:
        """Keep the new rate, because a command was understood."""
        self.cancel_fallback()
        self._old_baud = None

    def _restore(self) -> None:
        previous, self._old_baud, self._timer = self._old_baud, None, None
        if previous is not None:
            self._change_baud(previous)

    def cancel_fallback(self) -> None:
        """Cancel the change back to the old rate; also called when the connection ends."""
        if self._timer is not None:
            self._timer.cancel()
            self._timer = None


def garble(data: bytes, send_baud: int, receive_baud: int) -> bytes:
    """Return what a receiver at ``receive_baud`` gets of bytes sent without gaps at ``send_baud``; all if a rate is 0.
    The receiver waits for the falling edge of a start bit and samples the middle of every bit by its own clock. A byte
    with a missing stop bit (framing error) is delivered all the same. Rates that differ by a few percent work.
    """
    if send_baud == receive_baud or not send_baud or not receive_baud:
        return data
    wire = [bit for byte in data for bit in (0, *(byte >> place & 1 for place in range(8)), 1)]
    width = send_baud / receive_baud  # length of the receiver's bits, in bits of the sender
    wire += [1] * (1 + int(BITS_PER_BYTE * width))  # idle after the last byte
    received = bytearray()
    at = 0.0
    while (start := _next_falling_edge(wire, at)) is not None:
        samples = [wire[int(start + (bit + 0.5) * width)] for bit in range(1, 9)]
        received.append(sum(level << place for place, level in enumerate(samples)))
        at = start + (BITS_PER_BYTE - 0.5) * width
    return bytes(received)


def _next_falling_edge(bits: list[int], start: float) -> float | None:
    """Return the index of the first 0 that follows a 1, from index ``start`` on; None if there is none."""
    falls = (bit for bit in range(math.ceil(start - 1e-9), len(bits)) if bits[bit] == 0 and (not bit or bits[bit - 1]))
    return next(map(float, falls), None)
