"""Framing of NexStar requests: by length from the first byte, never by ``#`` nor by what one read returned.

``#`` is a legal data byte, and a terminator belongs to replies only. A byte that begins no command is dropped
in silence, as the hand control does. A half command is dropped when the line has been quiet for a second; so
what waits here is never longer than one command.
"""

from __future__ import annotations

from collections.abc import Iterable
from functools import lru_cache

from gateway.errors import MappingError
from gateway.tables import Command, load

#: Seconds of quiet after which the rest of a command is no longer expected.
QUIET_GAP = 1.0


def lengths(commands: Iterable[Command]) -> dict[int, int]:
    """First byte -> length of the whole request. Raises MappingError when one first byte has two lengths."""
    found: dict[int, int] = {}
    for command in commands:
        width = command.request.width
        if width is None:
            raise MappingError("mappings/nexstar/commands.toml", command.name, "a request has a fixed length")
        first = command.request.literal[0]
        if found.setdefault(first, width) != width:
            reason = f"requests that begin with {chr(first)!r} are {found[first]} bytes long, not {width}"
            raise MappingError("mappings/nexstar/commands.toml", command.name, reason)
    return found


@lru_cache(maxsize=1)
def all_lengths() -> dict[int, int]:
    """The lengths of every request there is."""
    return lengths(load("nexstar").commands.values())


class Framer:
    """Bytes in, whole requests out. ``lengths`` narrows it to the commands that one hand control knows."""

    def __init__(self, lengths: dict[int, int] | None = None) -> None:
        self._lengths = all_lengths() if lengths is None else lengths
        self._pending = bytearray()
        self._heard = 0.0

    def feed(self, data: bytes, now: float) -> list[bytes]:
        """The requests that these bytes complete, in order. ``now`` is any clock, in seconds."""
        if self._pending and now - self._heard >= QUIET_GAP:
            self._pending.clear()
        if data:
            self._heard = now
        frames = []
        for byte in data:
            if not self._pending and byte not in self._lengths:
                continue
            self._pending.append(byte)
            if len(self._pending) == self._lengths[self._pending[0]]:
                frames.append(bytes(self._pending))
                self._pending.clear()
        return frames
