"""A mount that hibernates is left alone: what it would not answer in its sleep is refused without asking.

Stops are sent all the same, and the position is asked for now and then: somebody may have woken it at its keys, and the
first answer that no sleeper gives ends this. What a sleeper does not hear costs the line seconds, each time.
"""

from __future__ import annotations

from gateway.core.errors import Asleep
from gateway.mount.context import Context
from gateway.mount.link.queue import POSITION, STOP
from gateway.mount.motion.wanted import WantedState
from gateway.protocols.base.driver import Send

#: Seconds from one position that is tried to the next: no longer than where nobody asks a mount that is awake.
TRY_AGAIN = 5.0


class HibernationGate:
    """Asks the driver whether its mount sleeps, and tells it when the mount is heard to be awake.

    Where ``wanted`` says that it is being woken, what is asked for after that is asked of a mount that is awake.
    """

    def __init__(self, context: Context, wanted: WantedState) -> None:
        self._driver, self._now, self._wanted = context.driver, context.now, wanted
        self._next = 0.0

    def begun(self) -> None:
        """The mount has just been sent to sleep."""
        self._next = self._now() + TRY_AGAIN

    def doubt(self) -> None:
        """The line was lost, and the mount perhaps switched off: the next read is tried."""
        self._next = 0.0

    @property
    def deep(self) -> bool:
        """Whether nothing would come of a read now."""
        return self._driver.asleep and self._now() < self._next and not self._wanted.waking

    def admit(self, ask: Send, rank: int) -> None:
        """Whether to ask this of a mount that sleeps, now. Raises Asleep."""
        if rank == STOP or self._heard(ask) or self._wanted.waking:
            return
        if self.deep or rank != POSITION:
            raise Asleep
        self._next = self._now() + TRY_AGAIN

    def _heard(self, ask: Send) -> bool:
        """Whether the mount hears this in its sleep."""
        return bool(self._driver.protocol.commands[ask.command].while_asleep)

    def answered(self, ask: Send) -> None:
        """A mount that sleeps has answered."""
        if not self._heard(ask):
            self._driver.asleep = False
