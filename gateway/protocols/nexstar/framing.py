"""Framing of NexStar requests: the first byte gives the length; neither ``#`` nor the boundaries of a read count.

``#`` is a legal data byte; only replies have a terminator. The table holds the length of every opcode of any hand
control, even if the presented one lacks it, so that its data bytes are never read as commands. Stray bytes that
programs are known to send are dropped one by one. Any other byte that begins no command drops everything after it
until the line has been quiet for 0.1 s. A partial command is dropped after one second of quiet, so the buffer never
holds more than one command.
"""

from __future__ import annotations

from functools import lru_cache

from gateway.core.errors import MappingError
from gateway.protocols.base.frames import LengthFramer
from gateway.protocols.wireformat.command_set import load

#: Lengths of later hand controls' opcodes, as programs send them; the gateway does not answer these. That of ``c`` is
#: not known.
UNANSWERED = {ord("g"): 18, ord("n"): 1, ord("o"): 1, ord("Y"): 1}
#: Bytes that programs send around their commands: terminators, line ends, padding, ``?`` to wake the oldest mounts.
STRAY = frozenset(b"#? \r\n\0")
#: Extra bytes that some programs send right after a command, and at most how many: a number after ``y``, the mode that
#: belongs to ``T`` after ``t``, and four digits too many after a ``B`` below the horizon.
STRAY_AFTER = {ord("y"): (b"01", 1), ord("t"): (b"\0\1\2\3", 1), ord("B"): (b"0123456789ACDF", 4)}


@lru_cache(maxsize=1)
def all_lengths() -> dict[int, int]:
    """Return the length of every request by its first byte. Raises MappingError if one first byte has two lengths."""
    found = dict(UNANSWERED)
    for command in load("nexstar").commands.values():
        width = command.request.width
        if width is None:
            raise MappingError("mappings/nexstar/commands.toml", command.name, "the request must have a fixed length")
        first = command.request.prefix[0]
        if found.setdefault(first, width) != width:
            reason = f"requests that begin with {chr(first)!r} are {found[first]} bytes long, not {width}"
            raise MappingError("mappings/nexstar/commands.toml", command.name, reason)
    return found


class Framer(LengthFramer):
    """Cuts whole requests out of a byte stream, whether or not the presented hand control knows them."""

    noise = "no NexStar command begins like this; bytes are ignored until the line has been quiet for 0.1 s"
    half = "incomplete command: the rest did not arrive within a second"
    cut_off = "incomplete command: the rest did not arrive"

    def __init__(self) -> None:
        super().__init__()
        self._lengths = all_lengths()
        #: Stray bytes allowed after the last request, and how many more of them.
        self._stray, self._stray_left = b"", 0

    def _cut(self, data: bytes) -> list[bytes]:
        frames: list[bytes] = []
        pending = self._pending
        rest = iter(data)
        for byte in rest:
            if pending or byte in self._lengths:
                pending.append(byte)
                if len(pending) == self._lengths[pending[0]]:
                    frames.append(bytes(pending))
                    self._stray, self._stray_left = STRAY_AFTER.get(pending[0], (b"", 0))
                    pending.clear()
            elif self._stray_left and byte in self._stray:
                self._stray_left -= 1
            elif byte not in STRAY:
                self._dropping = True
                self.dropped.add(bytes((byte, *rest)), self.noise)
        return frames
