"""Framing of the lines into which requests are written: each ends with a line feed.

What is longer than any request is dropped up to its end, and so is a line that is not finished.
"""

from __future__ import annotations

from gateway.protocols.base.frames import WholeFramer

#: Bytes of the longest line.
LONGEST = 4096
#: Why bytes are of no use.
TOO_LONG = "no request is as long as this"


class Framer(WholeFramer):
    """Bytes in, whole lines out."""

    cut_off = "half a request, whose end did not come"

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
