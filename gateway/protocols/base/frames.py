"""Frames: what a protocol's framing cuts out of a client's bytes.

A frame is ``bytes``, one whole command. Two kinds say more than their bytes: a command with an argument that lost its
end, which nobody carries out because nobody can tell where it ended, and a command that came together with such a one,
which is answered but begins no motion. A framer is told the time with the bytes, because quiet on the line is what
tells two commands apart when nothing else does.
"""

from __future__ import annotations

from typing import Protocol


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


class Framer(Protocol):
    """Cuts a protocol's commands out of a byte stream. ``idle``: what comes next stands alone, whatever came before."""

    dropped: Dropped

    @property
    def idle(self) -> bool: ...

    def feed(self, data: bytes, now: float) -> list[bytes]: ...

    def end(self) -> list[Unterminated]: ...
