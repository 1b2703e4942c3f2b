"""Framing of Stellarium's messages: by the length that each begins with, whatever type it is.

A message of another type is cut out as a whole and left to the tables, which do not know it. A length that no message
has drops what comes with it, until the line has been quiet for a tenth of a second; so does half a message whose rest
has not come within a second. What waits here is never longer than one message.
"""

from __future__ import annotations

from gateway.protocols.base.frames import Dropped, Unterminated

#: Bytes of the length and the type, and of the longest message that is believed.
HEADER, LONGEST = 4, 255
#: Seconds of quiet after which the rest of a message is no longer expected.
QUIET_GAP = 1.0
#: Seconds of quiet after which bytes may begin a message again, behind some that could not.
RESYNC_GAP = 0.1
#: Why bytes are of no use.
NOISE = "no message of Stellarium begins so; what follows counts again after 0.1 s of quiet"
HALF = "half a message, whose rest did not come within a second"
CUT_OFF = "half a message, whose rest did not come"


class Framer:
    """Bytes in, whole messages out, of a known type or not."""

    def __init__(self) -> None:
        self._pending = bytearray()
        #: Nothing counts until it is quiet.
        self._lost = False
        self._heard = 0.0
        self.dropped = Dropped(NOISE)

    @property
    def idle(self) -> bool:
        """Whether the next byte begins a message, whatever came before."""
        return not (self._pending or self._lost)

    def feed(self, data: bytes, now: float) -> list[bytes]:
        """The messages that these bytes complete, in order. ``now`` is any clock, in seconds."""
        if not data:
            return []
        self.dropped.forget()
        quiet, self._heard = now - self._heard, now
        if quiet >= QUIET_GAP and self._pending:
            self.dropped.add(bytes(self._pending), HALF)
            self._pending.clear()
            self._lost = True  # what comes now may be the other half
        elif quiet >= RESYNC_GAP:
            self._lost = False
        if self._lost:
            self.dropped.noise += data
            return []
        self._pending += data
        return self._cut()

    def _cut(self) -> list[bytes]:
        """Take out of what waits all that is whole."""
        frames: list[bytes] = []
        while len(self._pending) >= HEADER:
            length = int.from_bytes(self._pending[:2], "little")
            if not HEADER <= length <= LONGEST:
                self.dropped.noise += self._pending
                self._pending.clear()
                self._lost = True
            elif len(self._pending) < length:
                break
            else:
                frames.append(bytes(self._pending[:length]))
                del self._pending[:length]
        return frames

    def end(self) -> list[Unterminated]:
        """Half a message asks for nothing."""
        self.dropped.forget()
        if self._pending:
            self.dropped.add(bytes(self._pending), CUT_OFF)
        return []
