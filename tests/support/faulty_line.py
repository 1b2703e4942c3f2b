"""A line with every fault a line can have, drawn from a seed, which keeps track of what every byte belongs to.

Behind it is a simulated mount. ``Kind`` lists the faults; each affects one exchange. Every byte delivered carries the
number of its exchange, so that `follow`, which reads the wire log, knows to which exchanges the bytes of a reply
belonged.
"""

from __future__ import annotations

import asyncio
from collections import deque
from collections.abc import Callable
from enum import Enum
from random import Random
from typing import Any

from gateway.core.wire_log import Entry
from gateway.transport.wires import OnData, OnLost


class Kind(Enum):
    """A fault of an exchange."""

    LATE = "late, everything behind it waits"
    OVERTAKEN = "late, overtaken by later answers"
    TRUNCATED = "truncated"
    DOUBLED = "doubled"
    BROKEN = "garbled, form broken"
    ALTERED = "garbled, form kept"
    MISSING = "answer missing"
    UNHEARD = "request missing"
    NOISE = "noise"
    VANISHED = "port vanished"
    HALF = "half a command written"
    MUTE = "mute for a while"
    REBOOT = "mount switched off and on"


#: Faults that take so long that they are drawn more rarely than the others.
RARE = {Kind.VANISHED: 0.1, Kind.HALF: 0.1, Kind.MUTE: 0.03, Kind.REBOOT: 0.01}
#: Seconds that a reply may be late if others overtake it: the longest delay with which a reply is still accepted.
LATE = 5.3
WIRE = 0.001  # seconds a byte takes, 9600 baud
_HEX = b"0123456789ABCDEF"
_DIGITS = b"0123456789"
NOISE = -1


class FaultyWire:
    """``feed`` takes the mount's input, ``reboot`` power-cycles it, ``rate`` is the fraction of exchanges disturbed."""

    name = "a bad line"

    def __init__(
        self,
        feed: Callable[[bytes], bytes],
        seed: int,
        rate: float,
        kinds: tuple[Kind, ...],
        reboot: Callable[[], Callable[[bytes], bytes]],
        latency: float = 0.03,
        text: bool = False,
    ) -> None:
        self.feed, self._reboot, self._latency, self._text = feed, reboot, latency, text
        self._random, self.rate, self.kinds = Random(seed), rate, kinds
        self._weights = [RARE.get(kind, 1.0) for kind in kinds]
        self._on_data: OnData | None = None
        self._on_lost: OnLost | None = None
        self._free = self._silent_until = self._gone_until = 0.0
        self._owners: deque[int] = deque()
        self.exchanges = 0
        self.faults: dict[Kind, int] = dict.fromkeys(kinds, 0)
        self._requests: list[bytes] = [b""]
        self.strange: bytes | None = None  # bytes of another exchange that were taken as the reply to the last one
        self._kind_of: dict[int, Kind] = {}
        self._since: tuple[float, Kind] | None = None
        self.sane_after: dict[Kind, list[float]] = {kind: [] for kind in kinds}
        self.last_fault = -1e9
        self.of_other_command = False  # and not of the same command, sent before
        self.proving = False  # replies taken meanwhile are given to no client

    # --- as a transport -----------------------------------------------------------------------------------------------

    async def open(self, on_data: OnData, on_lost: OnLost) -> None:
        if self._now() < self._gone_until:
            raise OSError(2, "no such port")
        self._on_data, self._on_lost = on_data, on_lost

    async def close(self) -> None:
        self._on_data = None

    def write(self, data: bytes) -> None:
        now = self._now()
        if now < self._gone_until:
            raise OSError(5, "gone")
        self.exchanges += 1
        number = self.exchanges
        self._requests.append(data)
        kind = None
        if self._random.random() < self.rate:
            kind = self._random.choices(self.kinds, self._weights)[0]
            self.faults[kind] += 1
            self.last_fault = now
            self._kind_of[number] = kind
            self._since = self._since or (now, kind)
        if kind is Kind.HALF:
            self.feed(data[: self._random.randrange(len(data))])
            self._vanish(0.1)
            raise OSError(5, "half of it")
        if kind is Kind.VANISHED:
            asyncio.get_running_loop().call_later(
                self._random.uniform(0.0, 0.1), self._vanish, self._random.uniform(0.1, 6.0)
            )
        elif kind is Kind.MUTE:
            self._silent_until = now + self._random.uniform(3.0, 30.0)
        elif kind is Kind.REBOOT:
            self.feed, self._silent_until = self._reboot(), now + self._random.uniform(4.0, 12.0)
        if now < self._silent_until or kind is Kind.UNHEARD:
            return
        self._answer(number, self.feed(data), kind)

    # --- faults of a reply --------------------------------------------------------------------------------------------

    def _answer(self, number: int, answer: bytes, kind: Kind | None) -> None:
        draw, now = self._random, self._now()
        due = now + self._latency * draw.uniform(0.7, 2.0)
        if kind is Kind.NOISE:
            noise = draw.randbytes(draw.randint(1, 8))
            self._send(now + draw.uniform(0.0, 0.4), noise, NOISE)
        if not answer or kind is Kind.MISSING:
            return
        if kind is Kind.LATE:
            self._free = max(self._free, now + draw.uniform(0.2, 12.0))
        elif kind is Kind.TRUNCATED:
            answer = answer[: draw.randrange(len(answer))]
        elif kind is Kind.BROKEN:
            answer = self._broken(answer)
        elif kind is Kind.ALTERED:
            answer = self._altered(answer)
        elif kind is Kind.OVERTAKEN:
            self._send(now + draw.uniform(0.2, LATE), answer, number)
            return
        due = self._free = max(due, self._free)
        self._free += WIRE * len(answer)
        if draw.random() < 0.2 and len(answer) > 1:  # in two pieces, which is no fault
            cut = draw.randrange(1, len(answer))
            self._send(due, answer[:cut], number)
            self._send(due + WIRE * cut, answer[cut:], number)
        else:
            self._send(due, answer, number)
        if kind is Kind.DOUBLED:
            self._send(self._free + draw.uniform(0.0, 0.02), answer, number)
            self._free += 0.02 + WIRE * len(answer)

    def _broken(self, answer: bytes) -> bytes:
        """Replace one byte by one that cannot be there: the terminator, or a digit where there must be a digit."""
        place = len(answer) - 1
        digits = [n for n, byte in enumerate(answer) if byte in _HEX]
        if (self._text or len(answer) >= 10) and digits and self._random.random() < 0.7:
            place = self._random.choice(digits)
            if not self._text and place in (6, 7, 15, 16):
                place = 0  # the last two digits of an angle have no meaning
        return answer[:place] + self._random.choice([b"\xff", b"z", b"\x00", b"?"]) + answer[place + 1 :]

    def _altered(self, answer: bytes) -> bytes:
        """Replace one character by another of its class; in a binary reply one byte by any other."""
        if self._text or (len(answer) >= 10 and b"," in answer):
            classes = [_DIGITS if self._text else _HEX, b"ABCDEFGHIJKLMNOPQRSTUVWXYZ"]
            places = [(n, c) for n, byte in enumerate(answer) for c in classes[: 2 if self._text else 1] if byte in c]
        else:
            places = [(n, bytes(range(256))) for n in range(len(answer) - 1)]
            if len(answer) == 2 and answer[:1] in (b"0", b"1"):
                places = [(0, _DIGITS)]
        if not places:
            return answer
        place, choices = self._random.choice(places)
        other = self._random.choice([byte for byte in choices if byte != answer[place]])
        return answer[:place] + bytes((other,)) + answer[place + 1 :]

    def _send(self, when: float, data: bytes, number: int) -> None:
        asyncio.get_running_loop().call_at(when, self._deliver, data, number, self._on_data)

    def _deliver(self, data: bytes, number: int, opened: OnData | None) -> None:
        if opened is not None and opened is self._on_data and data:
            self._owners.extend([number] * len(data))
            opened(data)

    def _vanish(self, seconds: float) -> None:
        self._gone_until = self._now() + seconds
        self._on_data = None
        if self._on_lost is not None:
            self._on_lost("unplugged")

    def _now(self) -> float:
        return asyncio.get_running_loop().time()

    # --- whose bytes were taken ---------------------------------------------------------------------------------------

    def follow(self, entry: Entry) -> None:
        """Follow the wire log as a sink: every byte leaves the buffer here, taken for a reply or discarded."""
        if entry.side != "mount" or entry.arrow != "<":
            return
        owners = {self._owners.popleft() for _ in entry.data}
        if entry.note:
            return
        if owners - {self.exchanges}:
            self.strange = entry.data
            asked = self._requests[self.exchanges]
            self.of_other_command = any(owner < 0 or self._requests[owner] != asked for owner in owners)
        elif self._since is not None and self.exchanges not in self._kind_of:
            self.sane_after[self._since[1]].append(self._now() - self._since[0])
            self._since = None

    def tail(self) -> dict[str, Any]:
        """Return what is needed to tell two runs apart."""
        return {"exchanges": self.exchanges, "faults": {kind.name: count for kind, count in self.faults.items()}}
