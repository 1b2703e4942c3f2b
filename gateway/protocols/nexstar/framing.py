"""Framing of NexStar requests: by length from the first byte, never by ``#`` nor by what one read returned.

``#`` is a legal data byte, and a terminator belongs to replies only. Every opcode of any hand control has its length,
known to the one presented or not, so that the data of an unknown one are never read as commands. What programs are
known to send besides is dropped alone; any other byte that begins no command drops what comes with it, until the line
has been quiet for a tenth of a second. A half command is dropped after a second of quiet; so what waits here is never
longer than one command.
"""

from __future__ import annotations

from functools import lru_cache

from gateway.core.errors import MappingError
from gateway.protocols.base.frames import LengthFramer
from gateway.protocols.wireformat.command_set import load

#: Opcodes of later hand controls that nobody here answers, as programs send them. The length of ``c`` is not known.
UNANSWERED = {ord("g"): 18, ord("n"): 1, ord("o"): 1, ord("Y"): 1}
#: What programs put before and behind their commands: terminators, line ends, padding, what wakes the oldest mounts.
STRAY = frozenset(b"#? \r\n\0")
#: What some programs put right behind one command: the bytes, and how many at most. A ``y`` gets a number, ``t`` the
#: mode that belongs to ``T``, and below the horizon ``B`` gets four digits too many.
STRAY_BEHIND = {ord("y"): (b"01", 1), ord("t"): (b"\0\1\2\3", 1), ord("B"): (b"0123456789ACDF", 4)}


@lru_cache(maxsize=1)
def all_lengths() -> dict[int, int]:
    """First byte -> length, of every request there is. Raises MappingError when one first byte has two lengths."""
    found = dict(UNANSWERED)
    for command in load("nexstar").commands.values():
        width = command.request.width
        if width is None:
            raise MappingError("mappings/nexstar/commands.toml", command.name, "a request has a fixed length")
        first = command.request.prefix[0]
        if found.setdefault(first, width) != width:
            reason = f"requests that begin with {chr(first)!r} are {found[first]} bytes long, not {width}"
            raise MappingError("mappings/nexstar/commands.toml", command.name, reason)
    return found


class Framer(LengthFramer):
    """Bytes in, whole requests out, known to this hand control or not."""

    noise = "no command of a NexStar begins so; what follows counts again after 0.1 s of quiet"
    half = "half a command, whose rest did not come within a second"
    cut_off = "half a command, whose rest did not come"

    def __init__(self) -> None:
        super().__init__()
        self._lengths = all_lengths()
        #: Bytes that are dropped alone because of the request before, and how many more of them.
        self._behind, self._more = b"", 0

    def _cut(self, data: bytes) -> list[bytes]:
        frames: list[bytes] = []
        pending = self._pending
        rest = iter(data)
        for byte in rest:
            if pending or byte in self._lengths:
                pending.append(byte)
                if len(pending) == self._lengths[pending[0]]:
                    frames.append(bytes(pending))
                    self._behind, self._more = STRAY_BEHIND.get(pending[0], (b"", 0))
                    pending.clear()
            elif self._more and byte in self._behind:
                self._more -= 1
            elif byte not in STRAY:
                self._lost = True
                self.dropped.add(bytes((byte, *rest)), self.noise)
        return frames
