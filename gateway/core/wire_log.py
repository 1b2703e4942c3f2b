"""The wire log: every command, reply and note on either side, as it happens.

Entries are values, sinks are functions that take them. Without a sink no entry is made, so logging costs nothing.
"""

from __future__ import annotations

import re
from collections import deque
from collections.abc import Callable
from functools import partial
from typing import NamedTuple

#: How many different notes `note_once` logs. Further notes are dropped: only a client that sends noise causes so many.
MAX_NOTES_LOGGED_ONCE = 1000
#: How many refusals and notes on the mount are remembered, for clients that ask for recent events.
MAX_REMEMBERED_NOTES = 64
#: Numbers in a refusal: if a program tries many values, its refusals differ only in them, and are logged once.
_NUMBER_PATTERN = re.compile(r"[\d.]+")


class Entry(NamedTuple):
    """An event on a side: the mount's, or a client's.

    ``arrow`` is ``>`` for a command towards the mount, ``<`` for a reply, ``raw`` for bytes as they arrived, ``!`` for
    a note, ``*`` for a person's request that was carried out, ``+`` and ``-`` for a connection opened and closed, ``~``
    for the protocol that was recognised on it (with the reason after a comma), ``^`` and ``v`` for the mount's port
    opened and lost, ``x`` for bytes of a client that are dropped, with the reason.
    """

    time: float  # Unix seconds
    side: str  # `MOUNT_SIDE`, or the client's name
    arrow: str  # the kind of event, as listed above
    data: bytes
    note: str = ""


class Notice(NamedTuple):
    """A refusal or a note on the mount: its time in Unix seconds, its side, and its text."""

    time: float  # Unix seconds
    side: str
    text: str


#: The side of the mount. Any other side is a client, or a part of the gateway itself.
MOUNT_SIDE = "mount"


def printable(data: bytes) -> str:
    """Return the bytes as text, everything unprintable as ``\\xHH``."""
    return "".join(chr(byte) if 32 <= byte < 127 and byte != 92 else f"\\x{byte:02x}" for byte in data)


Sink = Callable[[Entry], None]
#: Makes an entry in half the time of ``Entry(…)``: there are three for each command.
_new_tuple = tuple.__new__


class WireLog:
    """Passes entries to its sinks. ``clock`` returns Unix seconds."""

    def __init__(self, clock: Callable[[], float]) -> None:
        self.clock = clock
        self.sinks: list[Sink] = []
        self._notes_logged_once: set[tuple[str, str]] = set()
        #: The latest refusals and notes on the mount; they are kept even without a sink.
        self.recent_notices: deque[Notice] = deque(maxlen=MAX_REMEMBERED_NOTES)
        #: How many refusals there were, logged or not. ``on_refusal`` is called with each that differs from the last.
        self.refusal_count = 0
        self.on_refusal: Callable[[str], object] | None = None
        self._last_refusal = ""

    def remove_sink(self, sink: Sink) -> None:
        """Remove a sink, if it is still there: a sink that fails has been removed already."""
        if sink in self.sinks:
            self.sinks.remove(sink)

    def put(self, side: str, arrow: str, data: bytes = b"", note: str = "") -> None:
        """Pass bytes or a note to the sinks. A sink that raises OSError is removed."""
        if self.sinks:
            entry: Entry = _new_tuple(Entry, (self.clock(), side, arrow, data, note))
            broken = None
            for sink in self.sinks:
                try:
                    sink(entry)
                except OSError:  # a log that can no longer be written must not disturb the line to the mount
                    broken = sink
            if broken is not None:
                self.remove_sink(broken)

    def note(self, side: str, text: str) -> None:
        """Record a fault or a decision as text."""
        if side == MOUNT_SIDE:
            self.recent_notices.append(Notice(self.clock(), side, text))
        self.put(side, "!", note=text)

    def note_once(self, side: str, text: str, key: str = "", kind: str = "") -> None:
        """Like `note`, but log the text once for each ``key``; of texts with the same ``kind``, only the first."""
        if (key, kind or text) not in self._notes_logged_once and len(self._notes_logged_once) < MAX_NOTES_LOGGED_ONCE:
            self._notes_logged_once.add((key, kind or text))
            self.note(side, text)

    def log_refusal(self, side: str, text: str, once_key: str | None = None) -> None:
        """Record a refusal. With ``once_key`` (a host), texts that differ only in numbers are logged once for it."""
        self.recent_notices.append(Notice(self.clock(), side, text))
        self.refusal_count += 1
        if self.on_refusal is not None and text != self._last_refusal:
            self._last_refusal = text
            self.on_refusal(text)
        if once_key is None:
            self.note(side, text)
        else:
            self.note_once(side, text, once_key, kind=_NUMBER_PATTERN.sub("", text))

    def log_rejection(self, side: str, text: str, host: str) -> None:
        """Record a refused connection; it is logged once for each host."""
        self.remember_notice(host, text)
        self.note_once(side, text, host)

    def remember_notice(self, side: str, text: str) -> None:
        """Add a notice to ``recent_notices`` without logging it. It replaces an earlier notice with the same text."""
        if same := next((old for old in self.recent_notices if old.text == text), None):
            self.recent_notices.remove(same)
        self.recent_notices.append(Notice(self.clock(), side, text))


class ClientLog:
    """The wire log for a client. ``name``: host:port. While ``sinks`` is empty, callers need not prepare entries."""

    def __init__(self, name: str, wire_log: WireLog) -> None:
        self.name, self.wire_log, self.sinks = name, wire_log, wire_log.sinks
        self._host = name.rpartition(":")[0]
        #: `WireLog.put` with this client as the side.
        self.put = partial(wire_log.put, name)

    def note(self, text: str) -> None:
        self.wire_log.note(self.name, text)

    def note_once(self, text: str) -> None:
        """Like `note`, but once per text and host."""
        self.wire_log.note_once(self.name, text, self._host)

    def log_refusal(self, text: str) -> None:
        self.wire_log.log_refusal(self.name, text)

    def log_refusal_once(self, text: str) -> None:
        """Like `log_refusal`, but once per text and host; texts that differ only in numbers count as the same."""
        self.wire_log.log_refusal(self.name, text, self._host)
