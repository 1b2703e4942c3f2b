"""Which sky the positions are of: when site or clock were set, those before and after mean other altitudes.

The mount hears of them bit by bit: while nobody moves it, what changes meanwhile is no motion.
"""

from __future__ import annotations

from gateway.core import operations as op
from gateway.core.signals import Signal
from gateway.mount.motion.seen import NEVER
from gateway.mount.safety.inputs import MountInputs

#: A clock that is set by more than that means another sky, seconds.
SET_ANEW = 30.0
#: For so many seconds after that a mount at rest may tell of the old sky, of the new one, and of half of each.
SETTLES = 3.0


class MeantSky:
    """``changed`` is emitted when another one is meant from now on and the mount rests."""

    def __init__(self, mount: MountInputs) -> None:
        self._mount = mount
        self._frame: tuple[op.Place | None, float] = None, 0.0
        self._settles_until = NEVER
        self.changed: Signal[None] = Signal()

    def is_another(self, now: float, restless: bool) -> bool:
        """Whether a position of now cannot be compared with the one before."""
        mount, (place, ahead) = self._mount, self._frame
        known = mount.astrometry.site_clock
        self._frame = known.site(), known.unix() - now
        changed = place is not None and (place != self._frame[0] or abs(ahead - self._frame[1]) > SET_ANEW)
        if changed or mount.being_set():
            self._settles_until = now + SETTLES
        moves = mount.moving().anything
        if changed and not moves:
            self.changed.emit(None)
        return changed or (now < self._settles_until and not moves and not restless)
