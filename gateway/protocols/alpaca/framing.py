"""Framing of the lines into which requests are written: each ends with a line feed.

What is longer than any request is dropped up to its end, and so is a line that is not finished.
"""

from __future__ import annotations

from gateway.protocols.base.frames import Dropped, Unterminated

#: Bytes of the longest line.
LONGEST = 4096
#: Why bytes are of no use.
TOO_LONG = "no request is as long as this"
CUT_OFF = "half a request, whose end did not come"


class Framer:
    """Bytes in, whole lines out."""

    def __init__(self) -> None:
        self._pending = bytearray()
        #: What comes is the rest of a line that was too long.
        self._lost = False
        self.dropped = Dropped()

    @property
    def idle(self) -> bool:
        """Whether the next byte begins a line."""
        return not (self._pending or self._lost)

    def feed(self, data: bytes, now: float) -> list[bytes]:
        """The lines that these bytes complete, in order."""
        self.dropped.clear()
        *whole, rest = (bytes(self._pending) + data).split(b"\n")
        frames = [line + b"\n" for line in whole]
        if self._lost and frames:
            self.dropped.add(frames.pop(0), TOO_LONG)
            self._lost = False
        if len(rest) > LONGEST:
            self.dropped.add(rest, TOO_LONG)
            rest, self._lost = b"", True
        self._pending = bytearray(rest)
        return frames

    def end(self) -> list[Unterminated]:
        """Half a request asks for nothing."""
        self.dropped.clear()
        if self._pending:
            self.dropped.add(bytes(self._pending), CUT_OFF)
        return []
