"""What simulated mounts of every protocol are: one clock, one mount's mechanics, and as many ways in as programs want.

Bytes in, bytes out, at the time that the clock shows; nothing sleeps.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from functools import cached_property
from typing import Protocol

from gateway.astro.axes import Pair
from gateway.protocols.mechanics.mount import Mechanics

#: Takes an answer that comes after a while: seconds, bytes.
Later = Callable[[float, bytes], None]


class Framer(Protocol):
    """Cuts commands out of the bytes of one connection; it is told when they came."""

    def feed(self, data: bytes, now: float) -> list[bytes]: ...


class Simulated(ABC):
    """A simulated mount; ``now`` is the time up to which everything has happened, Unix seconds by ``clock``."""

    clock: Callable[[], float]
    now: float
    mechanics: Mechanics

    @abstractmethod
    def come_to_now(self) -> None:
        """Let time pass, with all that happens meanwhile."""

    @abstractmethod
    def framer(self) -> Framer:
        """What cuts the commands out of a connection's bytes."""

    @abstractmethod
    def _answer(self, frame: bytes, later: Later | None) -> bytes:
        """Carry out a command -> what is answered to it at once."""

    @cached_property
    def _framer(self) -> Framer:
        """That of the first connection."""
        return self.framer()

    def feed(self, data: bytes, framer: Framer | None = None, later: Later | None = None) -> bytes:
        """Bytes from the port -> what is answered to them now; ``later`` is given what comes afterwards."""
        self.come_to_now()
        return b"".join([self._answer(frame, later) for frame in (framer or self._framer).feed(data, self.now)])

    def connection(self, later: Later | None = None) -> Callable[[bytes], bytes]:
        """One more way in, for another program on the same mount: its half commands are its own."""
        framer = self.framer()
        return lambda data: self.feed(data, framer, later)

    def truth(self) -> Pair:
        """Right ascension and declination of date that the tube really points at, degrees."""
        self.come_to_now()
        return self.mechanics.truth(self.now)

    @property
    def tracking(self) -> bool:
        """Whether the mount follows the sky at this moment."""
        self.come_to_now()
        return self.mechanics.tracking(self.now)

    @property
    def slewing(self) -> bool:
        self.come_to_now()
        return self.mechanics.slewing(self.now)
