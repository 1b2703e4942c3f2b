"""Frames: the commands that a protocol's framer cuts out of a client's byte stream.

A frame is ``bytes``, one whole command. It has two subclasses. ``Unterminated`` is a command whose terminator was lost:
it is never carried out, because its argument may be incomplete. ``Suspect`` is a command that arrived together with an
unterminated command: it is answered but may not begin a motion. A framer receives the time with the bytes, because a
pause may be all that separates two commands. A framer for commands of known lengths drops an incomplete command whose
rest is late. If bytes begin no command, it drops them and all bytes that arrive with them. A framer buffers one command
at most.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import Protocol

#: Seconds of quiet after which the rest of a command is no longer expected.
QUIET_GAP = 1.0
#: Seconds without bytes after which a framer that drops bytes expects the beginning of a command again.
RESYNC_GAP = 0.1


class Unterminated(bytes):
    """A command without its terminator, and all bytes up to the next terminator: refused as a whole.

    ``command_names``: the commands found in it, in order, with "" for an unknown one. ``late`` means that the client
    has sent nothing for a while, and no longer waits for a reply.
    """

    command_names: tuple[str, ...]
    late: bool

    def __new__(cls, data: bytes, command_names: tuple[str, ...], late: bool = False) -> Unterminated:
        frame = super().__new__(cls, data)
        frame.command_names, frame.late = command_names, late
        return frame

    @property
    def refusal_text(self) -> str:
        """The log message that says why the command is refused."""
        text = bytes(self)
        if self.late:
            return f"{text!r} arrived without its end (#): the gateway ignores it, and clears what it would have set"
        return (
            f"{text!r} is refused as a whole: the first command in it arrived without its end (#). What it would have "
            "set is cleared. Until the client pauses for 0.1 s its commands begin no motion; stops are carried out"
        )


class Suspect(bytes):
    """A command that arrived in one burst of bytes with an unterminated command: it may not begin a motion."""


class DroppedBytes(dict[str, bytearray]):
    """Reason -> the bytes that a framer has dropped in the last call of ``feed`` or ``end``; only for the log."""

    def add(self, data: bytes, reason: str) -> None:
        self.setdefault(reason, bytearray()).extend(data)


class WholeCommandFramer:
    """Base of framers that drop an incomplete command at the end of a connection."""

    #: Why an incomplete command is dropped at the end of a connection, for the log.
    cut_off_reason: str

    def __init__(self) -> None:
        self._pending = bytearray()
        #: Whether the next bytes are dropped, because they may belong to what was dropped before.
        self._dropping = False
        self.dropped = DroppedBytes()

    @property
    def idle(self) -> bool:
        """Whether the next byte begins a command that does not depend on earlier bytes."""
        return not (self._pending or self._dropping)

    @property
    def holds_bytes(self) -> bool:
        """Whether bytes wait in the framer until the client has sent nothing for ``RESYNC_GAP`` seconds."""
        return False

    def end(self) -> list[Unterminated]:
        """Drop an incomplete command at the end of the connection. Return an empty list: no command is unterminated."""
        self.dropped.clear()
        if self._pending:
            self.dropped.add(bytes(self._pending), self.cut_off_reason)
        return []


class LengthFramer(WholeCommandFramer, ABC):
    """Base of framers for commands whose length is known from their beginning, and that have no terminator."""

    #: Why bytes that begin no command are dropped, for the log.
    noise_reason: str
    #: Why an incomplete command is dropped when its rest is late, for the log.
    partial_reason: str
    #: Whether the bytes after a dropped incomplete command are dropped too, until a pause: they may be its rest.
    drops_after_partial = False

    def __init__(self) -> None:
        super().__init__()
        self._last_byte_at = 0.0

    def feed(self, data: bytes, now: float) -> list[bytes]:
        """Return the commands that these bytes complete, in order. ``now`` is a monotonic time in seconds."""
        if not data:
            return []
        self.dropped.clear()
        quiet, self._last_byte_at = now - self._last_byte_at, now
        if quiet >= RESYNC_GAP:
            self._dropping = False
        if quiet >= QUIET_GAP and self._pending:
            self._drop_partial()
        if self._dropping:
            self.dropped.add(data, self.noise_reason)
            return []
        return self._cut_commands(data)

    def _drop_partial(self) -> None:
        self.dropped.add(bytes(self._pending), self.partial_reason)
        self._pending.clear()
        self._dropping = self.drops_after_partial

    @abstractmethod
    def _cut_commands(self, data: bytes) -> list[bytes]:
        """Return the commands that these bytes complete."""


class Framer(Protocol):
    """Cuts a protocol's commands out of a client's byte stream."""

    dropped: DroppedBytes

    @property
    def holds_bytes(self) -> bool:
        """Whether bytes wait in the framer. If none follow for ``RESYNC_GAP``, the caller must ``feed`` empty bytes."""

    @property
    def idle(self) -> bool:
        """Whether the next byte begins a command that does not depend on earlier bytes."""

    def feed(self, data: bytes, now: float) -> list[bytes]:
        """Return the commands that these bytes complete, in order. ``now`` is a monotonic time in seconds."""

    def end(self) -> list[Unterminated]:
        """Handle the end of the connection; return the unterminated commands."""
