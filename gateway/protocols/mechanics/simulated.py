"""The base class of simulated mounts: one clock, the mechanics of one mount, any number of connections.

It turns bytes from clients into replies, at the time that the clock shows. Nothing here waits.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from functools import cached_property
from typing import Protocol

from gateway.astro.axes import Pair
from gateway.protocols.mechanics.mount import Mechanics

#: Function that sends a reply later: (delay in seconds, bytes).
SendLater = Callable[[float, bytes], None]


class TimedFramer(Protocol):
    """Cuts commands out of the bytes of a connection; ``now`` is when they arrived."""

    def feed(self, data: bytes, now: float) -> list[bytes]: ...


class Simulated(ABC):
    """A simulated mount."""

    clock: Callable[[], float]  # returns Unix seconds
    now: float  # the time up to which it has been simulated, by ``clock``
    mechanics: Mechanics

    @abstractmethod
    def advance_to_now(self) -> None:
        """Advance to the present time of the clock."""

    @abstractmethod
    def new_framer(self) -> TimedFramer:
        """Make the framer of a connection."""

    @abstractmethod
    def answer(self, frame: bytes, send_later: SendLater | None) -> bytes:
        """Carry out a command and return its immediate reply."""

    @cached_property
    def _framer(self) -> TimedFramer:
        """The framer of the first connection."""
        return self.new_framer()

    def feed(self, data: bytes, framer: TimedFramer | None = None, send_later: SendLater | None = None) -> bytes:
        """Process bytes of a client and return the immediate replies; delayed replies are passed to ``send_later``."""
        self.advance_to_now()
        return b"".join([self.answer(frame, send_later) for frame in (framer or self._framer).feed(data, self.now)])

    def connection(self, send_later: SendLater | None = None) -> Callable[[bytes], bytes]:
        """Open another connection to this mount. Return a function from bytes of the client to immediate replies."""
        framer = self.new_framer()
        return lambda data: self.feed(data, framer, send_later)

    def true_position(self) -> Pair:
        """Return the true right ascension and declination of date, degrees."""
        self.advance_to_now()
        return self.mechanics.true_position(self.now)

    @property
    def tracking(self) -> bool:
        """Whether the mount is tracking at this moment."""
        self.advance_to_now()
        return self.mechanics.tracking(self.now)

    @property
    def slewing(self) -> bool:
        self.advance_to_now()
        return self.mechanics.slewing(self.now)
