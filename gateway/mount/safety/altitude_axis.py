"""The altitude from the axis reading: on an alt-azimuth NexStar it overrules the calculated altitude.

The axis reading is right whatever the mount believes about the sky: a sync, a wrong alignment, and a wrong site or
clock change what right ascension and declination mean, but they do not move the tube. If the altitude that is
calculated from them differs from the axis reading by more than an alignment explains, it is corrected.
"""

from __future__ import annotations

from math import asin, degrees, radians, sin

from gateway.core import operations as op
from gateway.mount.context import Context
from gateway.mount.motion.seen import Seen
from gateway.mount.readings.reader import Reader

#: Degrees by which alignment, cone error and refraction may let an axis reading differ from the calculated altitude.
TOLERANCE = 1.0
#: Seconds of motion by which the two may also differ: they are read one after the other, and motors accelerate.
READ_APART = 0.3
#: Seconds between two readings of the axes: while the mount moves, and while it rests with a difference.
IN_MOTION, AT_REST = 1.0, 5.0
#: Seconds for which the mount's status ("alt-azimuth") is still trusted when the axis contradicts the calculation.
STATUS_AGE = 2.0


def altitude_of(reading: float) -> float:
    """Return the altitude for an axis reading in degrees, which may lie beyond the zenith."""
    return degrees(asin(sin(radians(reading))))


def corrected(tilt: float | None, difference: float, speed: float, speed_factor: float = 1.0) -> float:
    """Return the new correction of the calculated altitude, degrees.

    ``tilt`` is the present correction, None if there is none yet. ``difference`` is the axis reading minus the
    corrected altitude. ``speed`` is that of the mount, degrees a second; a simulated mount that runs
    ``speed_factor`` times faster moves so much farther before its speed has been measured.
    """
    before = tilt or 0.0
    if abs(difference) <= TOLERANCE * speed_factor + speed * READ_APART and (speed or not before):
        return before
    new = before + difference
    return new if abs(new) > TOLERANCE else 0.0


class AltitudeAxis:
    """Compares the altitude axis of one mount with the calculated altitude.

    ``tilt`` is the difference in degrees, None until both are known. ``synced`` is whether the mount was synced since.
    """

    def __init__(self, mount: Context) -> None:
        self._mount = mount
        self.tilt: float | None = None
        self.synced = False
        self._status: op.Status | None = None

    @property
    def available(self) -> bool:
        """Whether the axis gives the altitude: on an aligned alt-azimuth mount whose axes can be read.

        A change of the tracking mode invalidates the cached status; until it has been read again the last one counts.
        """
        driver = self._mount.driver
        status = self._status = self._mount.cache.value(op.GetStatus) or self._status
        if status is None or status.equatorial or not status.aligned or driver.german:
            return False
        return (
            self._mount.astrometry.site_clock.site() is not None and driver.implementation(op.AxisPosition) is not None
        )

    def interval(self, moves: bool) -> float | None:
        """Return how often to read the axes, seconds; None if that is not needed."""
        if not (moves or self.tilt is None or self.tilt) or not self.available:
            return None
        return IN_MOTION if moves or self.tilt is None else AT_REST

    def forget(self, synced: bool = False) -> None:
        """Forget the difference after a sync, a change of site or clock, or on a mount that is not alt-azimuth."""
        self.tilt, self.synced = None, self.synced or synced

    async def current_tilt(self, ask: Reader) -> float:
        """Return the tilt in degrees. After a sync, at rest, read the mount first to measure it again. Raises Fault."""
        if self.synced and not self._mount.movement.anything:
            await ask.read_now(op.GetStatus())
            await ask.read(op.Position())
            await ask.read_now(op.AxisPosition())
        return self.tilt or 0.0

    def take_reading(self, axes: op.Horizontal, seen: Seen, now: float, moves: bool) -> float | None:
        """Take an axis reading and return by how much the tilt changed; None if the status must be read again first.

        The status may be too old: on a mount that was put on a wedge meanwhile, the axes give no altitude.
        """
        last, before = seen.last, self.tilt or 0.0
        if last is None or last.altitude is None or not self.available:
            return 0.0
        if moves:
            calculated = last.altitude + _climb(seen) * (now - last.at)
        else:
            calculated = (self._mount.astrometry.altitude(last.place.ra, last.place.dec) or 0.0) + before
        speed, speed_factor = (seen.across, self._mount.driver.speed_factor) if moves else (0.0, 1.0)
        tilt = corrected(self.tilt, altitude_of(axes.alt) - calculated, speed, speed_factor)
        if tilt != before and self._mount.cache.age(op.GetStatus, now) > STATUS_AGE:
            return None
        self.tilt, self.synced = tilt, False
        return tilt - before


def _climb(seen: Seen) -> float:
    before, last = seen.before, seen.last
    if before is None or last is None or before.altitude is None or last.altitude is None:
        return 0.0
    return (last.altitude - before.altitude) / seen.elapsed
