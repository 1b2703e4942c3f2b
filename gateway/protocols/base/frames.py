"""Frames: what a protocol's framing cuts out of a client's bytes.

A frame is ``bytes``, one whole command. Two kinds say more than their bytes: a command with an argument that lost its
end, which nobody carries out because nobody can tell where it ended, and a command that came together with such a one,
which is answered but begins no motion. A framer is told the time with the bytes, because quiet on the line is what
tells two commands apart when nothing else does: where a command has a length instead of an end, what begins nothing is
dropped with all that comes with it, and so is half a command whose rest has not come. So what waits is never longer
than one command.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import Protocol

#: Seconds of quiet after which the rest of a command is no longer expected.
QUIET_GAP = 1.0
#: Seconds of quiet after which bytes may begin a command again, behind some that could not.
RESYNC_GAP = 0.1


class Unterminated(bytes):
    """A command that lost its end, with everything up to the next end: refused as a whole.

    ``names`` are the rows of ``commands.toml`` that were in it, in order; "" stands for one that nobody knows. It is
    ``late`` when its sender has paused since: whoever waited for an answer does not wait any more.
    """

    names: tuple[str, ...]
    late: bool

    def __new__(cls, data: bytes, names: tuple[str, ...], late: bool = False) -> Unterminated:
        frame = super().__new__(cls, data)
        frame.names, frame.late = names, late
        return frame

    @property
    def words(self) -> str:
        """Why it is refused, for the log."""
        text = bytes(self)
        if self.late:
            return f"{text!r} came without its end (#): it is not done, and what it would have set is cleared"
        return (
            f"{text!r} is refused as a whole: the first command in it came without its end (#). What it would have "
            "set is cleared. Until 0.1 s of quiet nothing that follows begins a motion; stops are carried out"
        )


class Suspect(bytes):
    """A command in one run of bytes with one that lost its end: it begins no motion."""


class Dropped(dict[str, bytearray]):
    """What the bytes fed last have had dropped: reason -> bytes, for the log alone."""

    def add(self, data: bytes, why: str) -> None:
        """More bytes of no use."""
        self.setdefault(why, bytearray()).extend(data)


class WholeFramer:
    """What framers have in common for whose programs half a command asks for nothing; ``cut_off`` says why that is."""

    cut_off: str

    def __init__(self) -> None:
        self._pending = bytearray()
        #: What comes is of no use: it belongs to what was dropped.
        self._lost = False
        self.dropped = Dropped()

    @property
    def idle(self) -> bool:
        """Whether the next byte begins a command, whatever came before."""
        return not (self._pending or self._lost)

    def end(self) -> list[Unterminated]:
        """Nothing more comes: half a command is dropped."""
        self.dropped.clear()
        if self._pending:
            self.dropped.add(bytes(self._pending), self.cut_off)
        return []


class LengthFramer(WholeFramer, ABC):
    """For commands that have a length instead of an end. ``noise`` and ``half`` say why bytes are of no use."""

    noise: str
    half: str
    #: Whether what comes after half a command may be its other half, and counts only after more quiet.
    wary = False

    def __init__(self) -> None:
        super().__init__()
        self._heard = 0.0

    def feed(self, data: bytes, now: float) -> list[bytes]:
        """The commands that these bytes complete, in order. ``now`` is any clock, in seconds."""
        if not data:
            return []
        self.dropped.clear()
        quiet, self._heard = now - self._heard, now
        if quiet >= RESYNC_GAP:
            self._lost = False
        if quiet >= QUIET_GAP and self._pending:
            self.dropped.add(bytes(self._pending), self.half)
            self._pending.clear()
            self._lost = self.wary
        if self._lost:
            self.dropped.add(data, self.noise)
            return []
        return self._cut(data)

    @abstractmethod
    def _cut(self, data: bytes) -> list[bytes]:
        """The commands that are whole with these bytes."""


class Framer(Protocol):
    """Cuts a protocol's commands out of a byte stream. ``idle``: what comes next stands alone, whatever came before."""

    dropped: Dropped

    @property
    def idle(self) -> bool: ...

    def feed(self, data: bytes, now: float) -> list[bytes]: ...

    def end(self) -> list[Unterminated]: ...
