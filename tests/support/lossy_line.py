"""A line that loses replies and bytes of requests, to a simulated mount that hears as badly as its manual says.

A hand control drops the bytes that arrive while it works on a command, up to 3.5 s if a device on its bus does not
answer, and keeps half a command until its other half arrives (NexStar protocol, Timeouts). A Meade hears all the time.
"""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Container

from gateway.protocols.mechanics.simulated import TimedFramer
from gateway.protocols.nexstar.framing import NexStarFramer
from tests.support.in_process_gateway import Bridge

#: Seconds that one byte takes at 9600 baud, and that a hand control waits for a device that does not answer.
BYTE, NO_DEVICE = 10.0 / 9600.0, 3.5


class KeepsHalf(NexStarFramer):
    """The input of a hand control that waits for the other half of a command without end."""

    def _drop_partial(self) -> None:
        pass


class LossyLine:
    """``lose_replies`` and ``lose_bytes`` lose what comes next; ``heard`` is every write, with its loop time.

    ``keeps_half``: the hand control waits for the other half of a command without end, instead of for a second.
    """

    def __init__(self, bridge: Bridge, latency: float, keeps_half: bool = True) -> None:
        self._bridge, self._latency, self._loop = bridge, latency, asyncio.get_running_loop()
        self._wire = bridge.controller.line.wire
        self._framer: TimedFramer = bridge.sim.new_framer()
        self._hand_control = isinstance(self._framer, NexStarFramer)
        if self._hand_control and keeps_half:
            self._framer = KeepsHalf(drops_late_ends=False)
        self._busy_until = 0.0
        self.heard: list[tuple[float, bytes]] = []
        self._replies = 0
        self._then: Callable[[], object] = lambda: None
        self._bytes: Container[int] = ()
        self._counted = -1
        self._wire.feed = self._hear  # type: ignore[attr-defined]

    def lose_replies(self, number: int, then: Callable[[], object]) -> None:
        """Lose the next replies, and call ``then`` when the request was written whose reply is the last one lost."""
        self._replies, self._then = number, then

    def lose_bytes(self, places: Container[int]) -> None:
        """Lose these bytes of the requests from now on; the first is 0."""
        self._bytes, self._counted = places, 0

    @property
    def written(self) -> int:
        """How many bytes were written since ``lose_bytes``."""
        return self._counted

    def _hear(self, data: bytes) -> bytes:
        self.heard.append((self._loop.time(), data))
        if self._counted >= 0:
            first, self._counted = self._counted, self._counted + len(data)
            data = bytes(byte for place, byte in enumerate(data, first) if place not in self._bytes)
        replies = self._carry_out(data)
        if self._replies and replies:
            self._replies -= 1
            replies = []
            if not self._replies:
                self._loop.call_soon(self._then)
        for seconds, reply in replies:
            self._later(seconds, reply)
        return b""

    def _later(self, seconds: float, reply: bytes) -> None:
        """Deliver a reply so many seconds after a usual one."""
        self._loop.call_later(self._latency + seconds, self._wire.deliver, reply)  # type: ignore[attr-defined]

    def _carry_out(self, data: bytes) -> list[tuple[float, bytes]]:
        """Let the mount carry out what it hears; return its replies and the seconds that each takes more than usual."""
        if not self._hand_control:
            answer = self._bridge.sim.feed(data, self._framer, self._later)
            return [(0.0, answer)] if answer else []
        replies, now = [], self._loop.time()
        for place, byte in enumerate(data):
            at = now + place * BYTE
            if at < self._busy_until:
                continue
            answer = self._bridge.sim.feed(bytes((byte,)), self._framer)
            if self._framer.idle:  # type: ignore[attr-defined]
                takes = NO_DEVICE if data[:1] == b"P" and _nobody(data, answer) else 0.0
                self._busy_until = at + self._latency + takes if answer else at
                if answer:
                    replies.append((at - now + takes, answer))
        return replies


def _nobody(request: bytes, answer: bytes) -> bool:
    """Whether the answer to a pass-through command says that no device has answered."""
    return len(answer) == request[-1] + 2


def is_stop(data: bytes) -> bool:
    """Whether a write ends motion, whatever stands before it."""
    words = (b":Q", b"M", b"put abortslew", b"put moveaxis")
    rate_0 = data[:1] == b"P" and data[3:5] in (b"\x24\0", b"\x25\0", b"\x06\0", b"\x07\0", b"\x26\0")
    return rate_0 or (data.lstrip(b"#\n").startswith(words) and (b"moveaxis" not in data or b"Rate=0" in data))
