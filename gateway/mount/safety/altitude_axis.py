"""An axis that tells the altitude decides alone: an alt-az NexStar tells where its axes stand, whatever it believes.

Syncs, a wrong alignment, a wrong site or clock move what right ascension and declination mean, never the tube. So what
is reckoned from them is corrected by what the axis tells, where the two differ by more than an alignment explains.
"""

from __future__ import annotations

from math import asin, degrees, radians, sin

from gateway.core import operations as op
from gateway.mount.context import Context
from gateway.mount.motion.seen import Seen
from gateway.mount.readings.reader import Reader

#: Degrees by which an alignment, cone error and refraction may let an axis differ from the altitude that is reckoned.
MATTERS = 1.0
#: By how many seconds of its motion the two may seem to differ: they are told one after the other, and motors ramp.
APART = 0.3
#: Seconds between two readings of the axes, while the mount moves and while it rests in spite of a difference.
IN_MOTION, AT_REST = 1.0, 5.0
#: How old the word of the mount may be that it is an alt-az one, when its altitude axis contradicts what is reckoned.
STATUS_AGE = 2.0


def told(reading: float) -> float:
    """The altitude that an axis means, also beyond the zenith."""
    return degrees(asin(sin(radians(reading))))


def corrected(tilt: float | None, difference: float, speed: float, speed_factor: float = 1.0) -> float:
    """How far what is reckoned is off, degrees, when the axis differs by so much from what was corrected so far.

    ``tilt`` is that correction, None where there was none yet; ``speed`` that of the mount in degrees a second. A
    simulated mount with a ``speed_factor`` goes that many times farther before its speed was seen.
    """
    before = tilt or 0.0
    if abs(difference) <= MATTERS * speed_factor + speed * APART and (speed or not before):
        return before
    new = before + difference
    return new if abs(new) > MATTERS else 0.0


class AltitudeAxis:
    """``tilt`` is by how many degrees it differs from what is reckoned; None until both have been told.

    ``synced`` is whether a sync has come since.
    """

    def __init__(self, mount: Context) -> None:
        self._mount = mount
        self.tilt: float | None = None
        self.synced = False
        self._status: op.Status | None = None

    @property
    def tells(self) -> bool:
        """Whether an axis tells the altitude: on an alt-az mount that is asked for them, once it is aligned.

        Tracking that was switched has its status asked anew; until that comes the last one counts.
        """
        driver = self._mount.driver
        status = self._status = self._mount.cache.value(op.GetStatus) or self._status
        if status is None or status.equatorial or not status.aligned or driver.german:
            return False
        return (
            self._mount.astrometry.site_clock.site() is not None and driver.implementation(op.AxisPosition) is not None
        )

    def every(self, moves: bool) -> float | None:
        """How often the axes are to be read, seconds; None where that is not needed."""
        if not (moves or self.tilt is None or self.tilt) or not self.tells:
            return None
        return IN_MOTION if moves or self.tilt is None else AT_REST

    def forget(self, synced: bool = False) -> None:
        """What is reckoned has changed: a sync, another sky, another kind of mount."""
        self.tilt, self.synced = None, self.synced or synced

    async def asked(self, ask: Reader) -> float:
        """The tilt, degrees; after a sync what it follows from is asked of the mount before. Raises Fault."""
        if self.synced and not self._mount.movement.anything:
            await ask.anew(op.GetStatus())
            await ask.read(op.Position())
            await ask.anew(op.AxisPosition())
        return self.tilt or 0.0

    def read(self, axes: op.Horizontal, seen: Seen, now: float, moves: bool) -> float | None:
        """A reading has come -> by how much the tilt has changed; None where it must be asked again what it stands on.

        On a wedge, where it may have been put since the status was told, the axes tell no altitude.
        """
        last, before = seen.last, self.tilt or 0.0
        if last is None or last.altitude is None or not self.tells:
            return 0.0
        if moves:
            reckoned = last.altitude + _climb(seen) * (now - last.at)
        else:
            reckoned = (self._mount.astrometry.altitude(last.place.ra, last.place.dec) or 0.0) + before
        speed, speed_factor = (seen.across, self._mount.driver.speed_factor) if moves else (0.0, 1.0)
        tilt = corrected(self.tilt, told(axes.alt) - reckoned, speed, speed_factor)
        if tilt != before and self._mount.cache.age(op.GetStatus, now) > STATUS_AGE:
            return None
        self.tilt, self.synced = tilt, False
        return tilt - before


def _climb(seen: Seen) -> float:
    before, last = seen.before, seen.last
    if before is None or last is None or before.altitude is None or last.altitude is None:
        return 0.0
    return (last.altitude - before.altitude) / seen.elapsed
