"""A line to a simulated mount on which a play's faults happen, each at its moment, to the request that is sent then.

Nothing a line does here lasts longer than 8 s. ``spoilt`` are the stretches of time that a fault has made useless.
"""

from __future__ import annotations

import asyncio
from collections.abc import Callable

from msgspec import Struct

from gateway.transport.wires import OnData, OnLost, SimulatedConnection

#: What can happen: to one exchange, or (busy, late, cut) for some seconds.
KINDS = ("unheard", "lost", "broken", "altered", "doubled", "late", "busy", "cut")
LONGEST = 8.0


class Fault(Struct, frozen=True):
    """``at`` seconds from the beginning of the play, or with the next request after that; ``seconds`` it lasts.

    With ``order`` it waits for a request that changes something.
    """

    at: float
    kind: str
    seconds: float = 0.0
    order: bool = False

    def words(self) -> str:
        return f"{self.at:7.2f} s  line       {self.kind} {self.seconds:g}{' (the next order)' if self.order else ''}"


class FaultyLine:
    """A wire; ``began`` is the loop time that the faults are counted from."""

    name = "a line of faults"

    def __init__(
        self, connection: SimulatedConnection, latency: float, faults: tuple[Fault, ...], busy: Callable[[float], bool]
    ) -> None:
        self._feed = connection(self._later)
        self._latency, self._busy = latency, busy
        self._ahead = sorted(faults, key=lambda fault: fault.at)
        self._now = asyncio.get_running_loop().time
        self.began = 1e12
        self.spoilt: list[tuple[float, float]] = []
        self._on_data: OnData | None = None
        self._on_lost: OnLost | None = None
        self._free = self._deaf_until = self._gone_until = 0.0
        self._opening = 0

    async def open(self, on_data: OnData, on_lost: OnLost) -> None:
        if self._now() < self._gone_until:
            raise OSError(2, "no such port")
        self._opening += 1
        self._on_data, self._on_lost = on_data, on_lost

    async def close(self) -> None:
        self._on_data = None

    def write(self, data: bytes) -> None:
        now = self._now()
        if now < self._gone_until:
            raise OSError(5, "gone")
        kind = self._what_happens(now, data)
        if now < self._deaf_until or kind == "unheard":
            return
        answer = self._feed(data)
        if not answer or kind == "lost":
            return
        if kind == "broken":
            answer = bytes((answer[0] ^ 0x80, *answer[1:]))
        elif kind == "altered":
            answer = altered(answer)
        self._send(answer, 2 if kind == "doubled" else 1)

    def heal(self) -> None:
        """Nothing more happens but what has begun, and the end of all orders may meet one last fault."""
        self._ahead = self._ahead[:1] if self._ahead and self._ahead[0].order else []

    def _what_happens(self, now: float, data: bytes) -> str | None:
        due = [fault for fault in self._ahead if now >= self.began + fault.at and (not fault.order or is_order(data))]
        if not due:
            return None
        fault = due[0]
        self._ahead.remove(fault)
        self.spoilt.append((now, now + fault.seconds))
        if fault.kind == "late":
            self._free = max(self._free, now + fault.seconds)
        elif fault.kind == "busy" and not self._busy(fault.seconds):
            self._deaf_until = now + fault.seconds
        elif fault.kind == "cut":
            self._gone_until = now + fault.seconds
            lost, self._on_data, self._on_lost = self._on_lost, None, None
            self._opening += 1
            if lost is not None:
                lost("unplugged")
            raise OSError(5, "gone")
        return fault.kind

    def _send(self, answer: bytes, times: int = 1) -> None:
        due = self._free = max(self._free, self._now() + self._latency)
        for _ in range(times):
            asyncio.get_running_loop().call_at(due, self._deliver, answer, self._opening)

    def _later(self, seconds: float, answer: bytes) -> None:
        """Some answers come after a while."""
        asyncio.get_running_loop().call_later(self._latency + seconds, self._deliver, answer, self._opening)

    def _deliver(self, answer: bytes, opening: int) -> None:
        if self._on_data is not None and opening == self._opening:
            self._on_data(answer)


def is_order(data: bytes) -> bool:
    """Whether a request changes something, in either protocol."""
    if data[:1] == b"P":
        return data[3] in (6, 7, 36, 37, 38)
    return data[:1] in b"TMrRsSWH" or data[:2] in (b":M", b":Q", b":A", b":S", b":C", b":T")


def altered(answer: bytes) -> bytes:
    """The first digit is another one: the form is kept."""
    for place, byte in enumerate(answer):
        if byte in b"12345678":
            return answer[:place] + bytes((byte ^ 1,)) + answer[place + 1 :]
    return answer
