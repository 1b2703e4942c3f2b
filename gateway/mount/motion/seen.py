"""What was seen of a mount's motion: its last two positions, and what they and those before them tell together.

Frozen values, folded with every position by ``see``. Angles are degrees, times seconds of the event loop's clock.
"""

from __future__ import annotations

from msgspec import Struct
from msgspec.structs import replace

from gateway.astro.spherical import separation, wrap180
from gateway.core import operations as op
from gateway.mount.motion.ends import Sample
from gateway.mount.site.astrometry import SiteAstrometry

#: Degrees of right ascension between two looks that no motor turns: a sync, or the pole was passed.
JUMP = 30.0
#: The least that a position can show, degrees: a second of right ascension, a 16-bit reading; in low precision more.
DIGIT, COARSE_DIGIT = 0.006, 0.025
#: Degrees between two looks that tell which way a motor turns the tube.
RISEN = 0.2
NEVER = -1e9


class PositionSample(Struct, frozen=True):
    """Where it pointed; altitude and hour angle (None without a site), distances from the Suns.

    ``lifting`` is what moved the second axis by hand then.
    """

    at: float
    place: op.Equatorial
    altitude: float | None = None
    hour_angle: float | None = None
    suns: tuple[float, ...] = ()
    lifting: op.Move | op.MoveAxis | None = None


class Changes(Struct, frozen=True):
    """How fast that changed from one position to the next, degrees a second, never negative."""

    altitude: float = 0.0
    hour_angle: float = 0.0
    suns: tuple[float, ...] = ()


class Seen(Struct, frozen=True):
    """``before`` and ``last`` are the last two positions, ``changes`` what passed between them, ``earlier`` before.

    ``began`` is when the last motion began and ``told`` its speed where it is known. ``across`` is the speed on the
    sky. ``farthest`` are the distances from which each Sun is being approached. ``upright`` is False from when the tube
    was seen to sink when it was lifted, beyond the pole or the zenith, to the end of the next goto.
    """

    before: PositionSample | None = None
    last: PositionSample | None = None
    changes: Changes | None = None
    earlier: Changes | None = None
    began: float = NEVER
    told: float = 0.0
    across: float = 0.0
    farthest: tuple[float, ...] = ()
    upright: bool = True

    @property
    def elapsed(self) -> float:
        """Seconds from one position to the other; 0 where there are not two."""
        return self.last.at - self.before.at if self.last is not None and self.before is not None else 0.0


def begin(seen: Seen, now: float, told: float, at_rest: bool) -> Seen:
    """A motion has begun; what was seen last is where it began, if the mount was at rest."""
    last = replace(seen.last, at=now) if seen.last is not None and at_rest else seen.last
    return replace(seen, last=last, changes=None, earlier=None, began=now, told=told)


def first(seen: Seen, sample: PositionSample) -> Seen:
    """A position that cannot be compared with the one before it."""
    return replace(seen, before=None, last=sample, farthest=sample.suns)


def see(seen: Seen, sample: PositionSample) -> Seen:
    """A position that can be compared with the last one."""
    before = seen.last
    assert before is not None
    elapsed = sample.at - before.at
    across = separation(before.place.ra, before.place.dec, sample.place.ra, sample.place.dec) / elapsed
    changes = Changes(
        abs((sample.altitude or 0.0) - (before.altitude or 0.0)) / elapsed,
        abs(wrap180((sample.hour_angle or 0.0) - (before.hour_angle or 0.0))) / elapsed,
        tuple(abs(now - then) / elapsed for then, now in zip(before.suns, sample.suns, strict=True)),
    )
    return replace(seen, before=before, last=sample, changes=changes, earlier=seen.changes, across=across)


def lifted(seen: Seen, equatorial: bool, speed: float) -> Seen:
    """Whether the second motor lifts the tube as it should; what tells no axis may be over the pole or zenith.

    ``speed`` is that of the motor in degrees a second.
    """
    before, last = seen.before, seen.last
    if before is None or last is None or last.lifting is None or last.lifting is not before.lifting:
        return seen
    rose = last.place.dec - before.place.dec if equatorial else (last.altitude or 0.0) - (before.altitude or 0.0)
    if abs(rose) > RISEN and 0.4 < abs(rose) / (speed * seen.elapsed) < 2.0:  # else something else has moved it
        return replace(seen, upright=rose * last.lifting.sense > 0)
    return seen


def at_once(now: float, place: op.Equatorial, before: PositionSample, lag: float) -> op.Equatorial:
    """Where the mount is when the second half of its position is told: the first has gone on meanwhile."""
    turned = wrap180(place.ra - before.place.ra)
    if not lag or abs(turned) > JUMP:
        return place
    return replace(place, ra=(place.ra + turned / (now - before.at) * lag) % 360.0)


def axis_sample(
    astrometry: SiteAstrometry, status: op.Status | None, coarse: bool, now: float, place: op.Equatorial
) -> Sample:
    """A position as the readings of the two axes that are ended one by one."""
    digit = COARSE_DIGIT if coarse else DIGIT
    if status is None or status.equatorial or astrometry.site_clock.site() is None:
        return Sample(now, (place.ra, place.dec), digit)
    there = astrometry.horizon(place)
    return Sample(now, (there.az, there.alt), digit)
