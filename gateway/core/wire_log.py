"""The wire log: every command, reply and fault on either side, as it happened.

Entries are values, and sinks are functions that take them. Without a sink nothing is recorded and nothing is spent.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from typing import NamedTuple

#: Different things that are said once; with more than that somebody sends noise, and no more is said.
MOST = 1000
#: Refusals, and notes on the mount, that are remembered for whoever asks what has happened lately.
REMEMBERED = 64


class Entry(NamedTuple):
    """One thing that happened.

    ``arrow`` is ``>`` for a command towards the mount, ``<`` for a reply, ``raw`` for bytes as they arrived, ``!`` for
    a note, ``+`` and ``-`` for a connection that comes and goes, ``~`` for the protocol
    that it turns out to speak (with the reason behind a comma), ``^`` and ``v`` for the mount's port opened and lost,
    ``r`` for the controller's decision to read something anew, ``x`` for bytes of a program that are dropped, with the
    reason.
    """

    time: float
    side: str
    arrow: str
    data: bytes
    note: str = ""


class Word(NamedTuple):
    """Something was refused, or done with the mount for a reason: when (Unix seconds), whose it is, and in words."""

    time: float
    side: str
    text: str


#: The side of the mount. Any other side is a program, or a part of the gateway itself.
MOUNT = "mount"
#: The note that says from when on the sky is no longer approximate.
SKY_READY = "astronomy is exact from now on"


def show(data: bytes) -> str:
    """Bytes with everything unprintable as ``\\xHH``."""
    return "".join(chr(byte) if 32 <= byte < 127 and byte != 92 else f"\\x{byte:02x}" for byte in data)


Sink = Callable[[Entry], None]


class WireLog:
    """Hands entries to its sinks. ``clock`` gives Unix seconds."""

    def __init__(self, clock: Callable[[], float]) -> None:
        self.clock = clock
        self.sinks: list[Sink] = []
        self._said: set[tuple[str, str]] = set()
        #: The last of them, with a log or without one.
        self.lately: deque[Word] = deque(maxlen=REMEMBERED)
        #: How many refusals there were, said or not.
        self.refusals = 0

    def leave(self, sink: Sink) -> None:
        """Take a sink out, if it is still there: one that fails is taken out by itself."""
        if sink in self.sinks:
            self.sinks.remove(sink)

    def put(self, side: str, arrow: str, data: bytes = b"", note: str = "") -> None:
        """Record bytes that passed, or a note."""
        if self.sinks:
            entry = Entry(self.clock(), side, arrow, data, note)
            for sink in list(self.sinks):
                try:
                    sink(entry)
                except OSError:  # a log that cannot be written any more must not cost the mount its line
                    self.leave(sink)

    def note(self, side: str, text: str) -> None:
        """Record a fault or a decision in words."""
        if side == MOUNT and text != SKY_READY:
            self.lately.append(Word(self.clock(), side, text))
        self.put(side, "!", note=text)

    def note_once(self, side: str, text: str, of: str = "") -> None:
        """The same, but only the first time these words are said of somebody."""
        if (of, text) not in self._said and len(self._said) < MOST:
            self._said.add((of, text))
            self.note(side, text)

    def refused(self, side: str, text: str, once_of: str | None = None) -> None:
        """Something that a program asked for is not done; ``once_of`` names who hears of it once only."""
        self.lately.append(Word(self.clock(), side, text))
        self.refusals += 1
        if once_of is None:
            self.note(side, text)
        else:
            self.note_once(side, text, once_of)


class ClientLog:
    """The wire log for the client of this name, which is its host and its port.

    Without ``sinks`` nobody listens, and nothing need be worked out for it.
    """

    def __init__(self, name: str, wire_log: WireLog) -> None:
        self.name, self.wire_log, self.sinks = name, wire_log, wire_log.sinks
        self._host = name.rpartition(":")[0]

    def put(self, arrow: str, data: bytes, note: str = "") -> None:
        self.wire_log.put(self.name, arrow, data, note)

    def note(self, text: str) -> None:
        self.wire_log.note(self.name, text)

    def note_once(self, text: str) -> None:
        """For every host."""
        self.wire_log.note_once(self.name, text, self._host)

    def refused(self, text: str) -> None:
        self.wire_log.refused(self.name, text)

    def refused_once(self, text: str) -> None:
        """The same, noted once for every host."""
        self.wire_log.refused(self.name, text, self._host)
