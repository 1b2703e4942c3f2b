"""Altitude and azimuth from the axis readings: on an alt-azimuth NexStar they overrule the calculated ones.

The axis readings are right whatever the mount assumes about the sky: a sync, a wrong alignment, and a wrong site or
clock change what right ascension and declination mean, but they do not move the tube. If the calculated altitude
differs from the axis reading by more than an alignment explains, it is corrected. So is the azimuth, by which the Sun
is avoided.
"""

from __future__ import annotations

from collections.abc import Iterator
from math import asin, cos, degrees, radians, sin

from gateway.astro.spherical import fold_declination, wrap180
from gateway.core import operations as op
from gateway.mount.context import Context
from gateway.mount.motion.seen import Observed
from gateway.mount.readings.cache import Readings
from gateway.mount.site.astrometry import Shift

#: Degrees by which alignment, cone error and refraction may let an axis reading differ from the calculated altitude.
TOLERANCE = 1.0
#: Degrees: above this altitude a small error on the sky is large in azimuth, so that nothing can be said of it.
TOO_HIGH = 80.0
#: Seconds of motion by which the two may also differ: they are read in turn, and motors accelerate.
READ_APART = 0.3
#: Seconds between two readings of the axes: while the mount moves, and while it rests with a difference.
IN_MOTION, AT_REST = 1.0, 5.0
#: Seconds for which the mount's status ("alt-azimuth") is still trusted when the axis contradicts the calculation.
STATUS_AGE = 2.0


def altitude_of(reading: float) -> float:
    """Return the altitude for an axis reading in degrees, which may lie beyond the zenith."""
    return degrees(asin(sin(radians(reading))))


def corrected(
    known: float | None, difference: float, speed: float, speed_factor: float = 1.0, altitude: float = 0.0
) -> float | None:
    """Return the new correction of the calculated altitude, or azimuth, degrees; None if it is not known.

    ``known`` is the present correction, None if there is none yet. ``difference`` is the axis reading minus the
    corrected value. ``speed`` is that of the mount, degrees a second; a simulated mount that runs ``speed_factor``
    times faster moves so much farther before its speed has been measured.

    What counts is the difference on the sky: that of an azimuth is smaller the higher the tube points (``altitude``).
    There a difference that is known is kept unless this reading contradicts it.
    """
    across, before, high = cos(radians(altitude)), known or 0.0, altitude > TOO_HIGH
    explained = abs(wrap180(difference)) * across <= TOLERANCE * speed_factor + speed * READ_APART
    if explained and (speed or high or not before):
        return None if high and not before else before
    new = wrap180(before + difference)
    return new if abs(new) * across > TOLERANCE else None if high else 0.0


class AltitudeAxis:
    """Compares the two axes of a mount with the calculated altitude and azimuth.

    ``tilt`` is the difference of the altitude in degrees, None until both are known; ``turn`` that of the azimuth, None
    if it is not known. ``synced`` is whether the mount was synced since.
    """

    def __init__(self, mount: Context) -> None:
        self._mount = mount
        self.tilt: float | None = None
        self.turn: float | None = None
        self.synced = False
        self._status: op.Status | None = None
        #: The difference that the last reading in motion has shown, of azimuth and altitude.
        self._found: tuple[float, float] | None = None

    @property
    def available(self) -> bool:
        """Whether the axes give the direction: on an aligned alt-azimuth mount whose axes can be read.

        A change of the tracking mode invalidates the cached status; until the next read the last status counts.
        """
        driver = self._mount.driver
        status = self._status = self._mount.cache.value(op.GetStatus) or self._status
        if status is None or status.equatorial or not status.aligned or driver.german:
            return False
        return (
            self._mount.astrometry.site_clock.site() is not None and driver.implementation(op.AxisPosition) is not None
        )

    @property
    def shifts(self) -> tuple[Shift, ...]:
        """The possible pointing errors of syncs if the axes do not show them; empty without a site."""
        mount, shifts = self._mount, self._mount.frame().shifts
        if not shifts or self.available or mount.sources.site() is None:
            return ()
        return shifts

    def interval(self, moves: bool) -> float | None:
        """Return how often to read the axes, seconds; None if that is not needed."""
        if not (moves or self.tilt is None or self.tilt or self.turn) or not self.available:
            return None
        return IN_MOTION if moves or self.tilt is None else AT_REST

    def forget(self, synced: bool = False) -> None:
        """Forget the differences after a sync, a change of site or clock, or on a mount that is not alt-azimuth."""
        self.tilt, self.turn, self.synced = None, None, self.synced or synced
        self._mount.frame.measured = None

    async def measure(self, ask: Readings) -> None:
        """Read the mount at rest after a sync, which measures the differences again. Raises Fault."""
        if self.synced and not self._mount.movement.anything:
            await ask.read_now(op.GetStatus())
            await ask.read(op.Position())
            await ask.read_now(op.AxisPosition())

    def take_reading(
        self, axes: op.Horizontal, observed: Observed, now: float, moves: bool
    ) -> tuple[float, float] | None:
        """Take an axis reading and return by how many degrees the differences of azimuth and altitude have changed.

        None if the status must be read first: it may be too old, and on a mount that was put on a wedge meanwhile the
        axes show neither altitude nor azimuth.
        """
        last, before, turned = observed.last, self.tilt or 0.0, self.turn or 0.0
        if last is None or last.altitude is None or not self.available:
            return 0.0, 0.0
        axes_then = self._mount.astrometry.horizon(last.place)
        if moves:
            drift, climb = _rates(self._mount, observed)
            calculated, azimuth = last.altitude + climb * (now - last.at), axes_then.az + drift * (now - last.at)
        else:
            calculated, azimuth = axes_then.alt + before, axes_then.az
        speed, speed_factor = (observed.across, self._mount.driver.speed_factor) if moves else (0.0, 1.0)
        tilt = corrected(self.tilt, altitude_of(axes.alt) - calculated, speed, speed_factor) or 0.0
        read, height = fold_declination(axes.az, axes.alt)  # an axis beyond the zenith points the other way
        turn = corrected(self.turn, read - azimuth - turned, speed, speed_factor, height)
        change = wrap180((turn or 0.0) - turned), tilt - before
        if any(change) and self._mount.cache.age(op.GetStatus, now) > STATUS_AGE:
            return None
        if not self._lasts((turn or 0.0, tilt), self._mount.movement.slewing and any(change)):
            return 0.0, 0.0
        self.tilt, self.turn, self.synced = tilt, turn, False
        self._mount.frame.measured = turn, tilt
        return change

    def _lasts(self, rates: tuple[float, float], doubtful: bool) -> bool:
        """Whether a difference counts. During a goto two readings in a row must show it: position and axes are read at
        two instants, and a simulated mount may slew many times faster than the gateway assumes.
        """
        before, self._found = self._found, rates if doubtful else None
        return not doubtful or (
            before is not None and all(abs(wrap180(a - b)) <= TOLERANCE for a, b in zip(before, rates, strict=True))
        )

    def messages(self, turned: float, tilted: float) -> Iterator[str]:
        """Yield the messages for the user about these changes."""
        reads, given = "axis reads {:+.1f} degrees from the", "that position, site and clock give"
        if tilted:
            yield f"the altitude {reads.format(self.tilt)} altitude {given}; the altitude limits use the axis"
        if turned:
            yield f"the azimuth {reads.format(self.turn or 0.0)} azimuth {given}; the Sun is avoided by the axis"


def _rates(mount: Context, observed: Observed) -> tuple[float, float]:
    """Return how fast azimuth and altitude change between the last two positions, degrees a second."""
    before, last = observed.before, observed.last
    if before is None or last is None or before.altitude is None or last.altitude is None:
        return 0.0, 0.0
    then, now = (mount.astrometry.horizon(sample.place).az for sample in (before, last))
    return wrap180(now - then) / observed.elapsed, (last.altitude - before.altitude) / observed.elapsed
