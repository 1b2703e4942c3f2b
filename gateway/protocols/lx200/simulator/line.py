"""How a classic LX200 reads its port: a line of 15 characters, seven bits, and no patience.

Its degree sign goes out as 0xDF and must not come back in: bytes above 0x7F, control characters and a sixteenth
character drop the command they stand in, without a word. The other models read as leniently as the gateway does.
"""

from __future__ import annotations

from gateway.protocols.lx200.framing import ACK, Framer, setter

LINE = 15  # characters between the colon and the #
_LOWEST, _HIGHEST = 0x20, 0x7F


class ClassicFramer(Framer):
    """Cuts a byte stream into the commands that a classic would understand."""

    def feed(self, data: bytes, now: float) -> list[bytes]:
        """Take bytes as they came -> the commands that are now complete, in order. ``now``: any clock, in seconds."""
        frames: list[bytes] = []
        for byte in data:
            if _LOWEST <= byte <= _HIGHEST or byte == ACK:
                frames += super().feed(bytes((byte,)), now)
                if len(self._frame) > LINE + 1:
                    self._drop()
            else:
                self._drop()
        return frames

    def _drop(self) -> None:
        """Forget half a command; what comes with one that had an argument is suspect all the same."""
        self._suspect = self._suspect or setter(bytes(self._frame)) is not None
        self._begin()
