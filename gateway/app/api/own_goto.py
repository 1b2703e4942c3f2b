"""What became of the goto that the embedding program ordered last, whether or not it was waiting when that happened.

The mount's state tells what moves now. A goto that a stop ended, or that another program's goto replaced, is not to be
seen there any more; so every change of what is wanted is looked at while the goto is under way.
"""

from __future__ import annotations

from gateway.core import operations as op
from gateway.mount.motion.wanted import ByHand, Slew, Wanted, WantedState
from gateway.mount.presence import HostActivity


class OwnGoto:
    """``why`` the last goto of ``host`` ended before its goal, in words; empty while it is under way, or if it did not.

    ``known``: there was one. ``replaced``: something else moves the mount in its place.
    """

    def __init__(self, state: WantedState, host: HostActivity) -> None:
        self._state, self._host = state, host
        self._slew: Slew | None = None
        self._stops = self._slews = 0
        self._over = self.replaced = False
        self.why = ""
        state.changed.connect(self._changed)

    @property
    def known(self) -> bool:
        return self._slew is not None

    @property
    def under_way(self) -> bool:
        """Whether it has not ended yet."""
        return self._slew is not None and not self._over

    def _changed(self, wanted: Wanted) -> None:
        motion = wanted.motion
        if isinstance(motion, Slew) and motion.by is self._host and motion is not self._slew:
            self._slew, self._stops, self._slews = motion, wanted.stops, wanted.slews
            self._over, self.replaced, self.why, self._state.stopped_by = False, False, "", ""
        elif self._slew is not None and not self.why:
            self.why = self._ended(wanted)
            self._over |= motion is not self._slew

    def _ended(self, wanted: Wanted) -> str:
        """Return why the goto has ended before its goal; empty if it has not."""
        motion = wanted.motion
        if self._over:  # only how far from its goal it ended can still be found out
            return wanted.short if (wanted.stops, wanted.slews) == (self._stops, self._slews) else ""
        if wanted.stops != self._stops:
            return wanted.short or f"Stopped{_by(self._state.stopped_by)}"
        halt = next((one for one in wanted.pending if isinstance(one.operation, op.AbortSlew)), None)
        if halt is not None:
            return f"Stopped{_by(halt.by.who if halt.by is not None else '')}"
        if isinstance(motion, Slew) and motion is not self._slew:
            self.replaced = True
            return f"Another goto came{_by(motion.by.who if motion.by is not None else '', 'from')}"
        if isinstance(motion, ByHand):
            self.replaced = True
            whose = next((one.by.who for _, one in motion if one.by is not None), "")
            return f"An arrow was pressed{_by(whose)}"
        return wanted.short if motion is not self._slew else ""


def _by(who: str, word: str = "by") -> str:
    return f" {word} {who}" if who else ""
