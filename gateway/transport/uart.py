"""What a serial receiver makes of bytes that were sent at another rate than its own.

A byte is a start bit (0), eight data bits, lowest first, and a stop bit (1); the idle line is 1. A receiver waits for
the fall of a start bit and looks at the middle of every bit by its own clock. Where it finds no stop bit, that is a
framing error, which a port in its usual raw mode hands on as a byte all the same. So rates that differ by a few percent
still understand each other.
"""

from __future__ import annotations

BITS = 10


def misread(data: bytes, sent: int, read: int) -> bytes:
    """Bytes sent one after the other at ``sent`` baud -> what a receiver at ``read`` baud takes them for."""
    if sent == read or not sent or not read:
        return data
    wire = [bit for byte in data for bit in (0, *(byte >> place & 1 for place in range(8)), 1)]
    width = sent / read  # of one of the receiver's bits, in bits of the sender
    received = bytearray()
    at = 0.0
    while True:
        start = _fall(wire, at)
        if start is None:
            return bytes(received)
        samples = [_level(wire, start + (bit + 0.5) * width) for bit in range(BITS)]
        received.append(sum(level << place for place, level in enumerate(samples[1:9])))
        at = start + (BITS - 0.5) * width


def _level(wire: list[int], at: float) -> int:
    """The line at a time in the sender's bits; idle when everything is sent."""
    return wire[int(at)] if at < len(wire) else 1


def _fall(wire: list[int], at: float) -> float | None:
    """When the line next falls from 1 to 0, or None. A line that is low already must rise first."""
    for bit in range(int(at), len(wire)):
        before = wire[bit - 1] if bit else 1
        if wire[bit] == 0 and before == 1 and bit >= at - 1e-9:
            return float(bit)
    return None
