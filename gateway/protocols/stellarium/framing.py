"""Framing of Stellarium's messages: by the length that each begins with, whatever type it is.

A message of another type is cut out as a whole and left to the tables, which do not know it. A length that no message
has drops what comes with it, and after half a message nothing counts until the line is quiet.
"""

from __future__ import annotations

from gateway.protocols.base.frames import LengthFramer

#: Bytes of the length and the type, and of the longest message that is believed.
HEADER, LONGEST = 4, 255


class Framer(LengthFramer):
    """Bytes in, whole messages out, of a known type or not."""

    noise = "no message of Stellarium begins so; what follows counts again after 0.1 s of quiet"
    half = "half a message, whose rest did not come within a second"
    cut_off = "half a message, whose rest did not come"
    wary = True

    def _cut(self, data: bytes) -> list[bytes]:
        frames: list[bytes] = []
        self._pending += data
        while len(self._pending) >= HEADER:
            length = int.from_bytes(self._pending[:2], "little")
            if not HEADER <= length <= LONGEST:
                self.dropped.add(bytes(self._pending), self.noise)
                self._pending.clear()
                self._lost = True
            elif len(self._pending) < length:
                break
            else:
                frames.append(bytes(self._pending[:length]))
                del self._pending[:length]
        return frames
