"""What the releases of arrows end that one connection sends: the motion of an axis, a tap that waits, or all motion.

The release of an arrow whose press still waits for its turn makes it a tap, which is carried out in its turn. RTS2 has
no stop but the releases of all four arrows.
"""

from __future__ import annotations

from gateway.clients.commands.turn import Inbox, Turn
from gateway.core.operations import AbortMotion, Direction, StopAxis
from gateway.mount.controller import MountController
from gateway.mount.motion.taps import over
from gateway.protocols.base.surface import Ending, Surface

#: Seconds within which the releases of all four arrows are a stop.
ALL_AT_ONCE = 0.3


class Releases:
    """The releases of one connection, whose commands wait in ``inbox``.

    ``by_stop``: the program releases its arrows by a full stop.
    """

    def __init__(self, controller: MountController, surface: Surface, inbox: Inbox, by_stop: bool) -> None:
        self._controller, self._surface, self._inbox, self.by_stop = controller, surface, inbox, by_stop
        #: The releases a moment ago, with the loop times of their arrival.
        self._recent: dict[bytes, float] = {}

    def ends(self, frame: bytes, ending: Ending, now: float, under_way: Turn | None) -> Ending | None:
        """Return what a command ends; None if it releases only an arrow whose press waits behind ``under_way``."""
        release = ending.operation
        if not isinstance(release, StopAxis):
            return ending
        self._recent = {one: at for one, at in self._recent.items() if now - at <= ALL_AT_ONCE} | {frame: now}
        if len(self._recent) == len(Direction):
            self._recent.clear()
            return Ending(AbortMotion(), ending.takes_back)
        tapped = (
            self._inbox and self._only_taps(release.axis, under_way) and self._inbox.release(ending.takes_back, now)
        )
        return None if tapped else ending

    def _only_taps(self, axis: int, under_way: Turn | None) -> bool:
        """Whether nothing moves the axis, or is about to, that the release of an arrow would end."""
        wanted = self._controller.wanted.value
        if not over(wanted, axis) or wanted.waiting_gotos or self._controller.slewing:
            return False
        waiting = [*self._inbox, under_way] if under_way is not None else self._inbox
        return not any(self._surface.begins_goto(turn.frame) for turn in waiting)
