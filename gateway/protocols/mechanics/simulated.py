"""The base class of simulated mounts: one clock, the mechanics of one mount, any number of connections.

Bytes in, bytes out, at the time that the clock shows; nothing here sleeps.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from functools import cached_property
from typing import Protocol

from gateway.astro.axes import Pair
from gateway.protocols.mechanics.mount import Mechanics

#: Called with a delayed reply: seconds of delay, bytes.
Later = Callable[[float, bytes], None]


class TimedFramer(Protocol):
    """Cuts commands out of the bytes of a connection; ``now`` is when they arrived."""

    def feed(self, data: bytes, now: float) -> list[bytes]: ...


class Simulated(ABC):
    """A simulated mount; ``now`` is the time up to which it has been simulated, Unix seconds by ``clock``."""

    clock: Callable[[], float]
    now: float
    mechanics: Mechanics

    @abstractmethod
    def advance_to_now(self) -> None:
        """Advance to the present time of the clock."""

    @abstractmethod
    def framer(self) -> TimedFramer:
        """Make the framer of a connection."""

    @abstractmethod
    def answer(self, frame: bytes, send_later: Later | None) -> bytes:
        """Carry out a command and return its immediate reply."""

    @cached_property
    def _framer(self) -> TimedFramer:
        """The framer of the first connection."""
        return self.framer()

    def feed(self, data: bytes, framer: TimedFramer | None = None, send_later: Later | None = None) -> bytes:
        """Process bytes from the port and return the immediate replies; delayed ones go to ``send_later``."""
        self.advance_to_now()
        return b"".join([self.answer(frame, send_later) for frame in (framer or self._framer).feed(data, self.now)])

    def connection(self, send_later: Later | None = None) -> Callable[[bytes], bytes]:
        """Return the ``feed`` of another connection to the same mount, with its own framer."""
        framer = self.framer()
        return lambda data: self.feed(data, framer, send_later)

    def truth(self) -> Pair:
        """Return the true right ascension and declination of date, degrees."""
        self.advance_to_now()
        return self.mechanics.truth(self.now)

    @property
    def tracking(self) -> bool:
        """Whether the mount is tracking at this moment."""
        self.advance_to_now()
        return self.mechanics.tracking(self.now)

    @property
    def slewing(self) -> bool:
        self.advance_to_now()
        return self.mechanics.slewing(self.now)
