"""The observed motion of the mount: its last two positions, and the speeds that follow from them.

Frozen values, updated with every position by ``add_position``. Angles are degrees, times are seconds of the event
loop's clock.
"""

from __future__ import annotations

from msgspec import Struct
from msgspec.structs import replace

from gateway.astro.spherical import separation, wrap180
from gateway.core import operations as op
from gateway.mount.motion.ends import AxisSample
from gateway.mount.site.astrometry import SiteAstrometry

#: A change of right ascension in degrees that no motor makes between two positions: a sync, or the pole was passed.
JUMP_DEGREES = 30.0
#: The resolution of positions in degrees: a second of right ascension or a 16-bit reading; that of low precision.
POSITION_RESOLUTION, COARSE_RESOLUTION = 0.006, 0.025
#: Degrees between two positions that show the direction of a motion; declination or altitude above which none do.
MIN_DIRECTION_STEP, NEAR_POLE_LAT = 0.2, 85.0
#: When the tube passes the pole or the zenith, the first axis seems to turn by half a circle: the degrees that count as
#: such, and the declination or altitude above which they do.
POLE_PASSAGE_TURN, PASSAGE_LAT = 90.0, 60.0
NEVER = -1e9


class PositionSample(Struct, frozen=True):
    """A position of the mount, with its altitude and hour angle (None without a site). Its distances from each possible
    position of the Sun are ``sun_distances``, degrees.

    ``other_altitudes`` are the altitudes by other sources of site and time, and as if the syncs were wrong. The first
    ``own_altitude_count`` of ``altitudes`` are by the mount's own site and clock. ``axis2_move`` is the motion by hand
    of the second axis at that time. Samples with equal ``comparison_key`` can be compared.
    """

    time: float
    position: op.Equatorial
    altitude: float | None = None
    hour_angle: float | None = None
    sun_distances: tuple[float, ...] = ()
    axis2_move: op.Move | op.MoveAxis | None = None
    comparison_key: object = 0
    other_altitudes: tuple[float, ...] = ()
    own_altitude_count: int = 1

    @property
    def altitudes(self) -> tuple[float, ...]:
        """Every altitude that the limits judge; none without a site."""
        return () if self.altitude is None else (self.altitude, *self.other_altitudes)


class Rates(Struct, frozen=True):
    """How fast these values changed between two positions, degrees a second, never negative."""

    altitudes: tuple[float, ...] = ()
    sun_distances: tuple[float, ...] = ()


class ObservedMotion(Struct, frozen=True):
    """The last two positions, the ``rates`` of change between them, and ``prev_rates``, the rates before these.

    ``began_at`` is when the last motion began, ``ordered_speed`` its speed if known, ``sky_speed`` the speed on the
    sky. ``farthest_from_suns``: for each possible position of the Sun, the greatest distance since the tube came near.
    ``upright`` becomes False when the tube passes the pole or the zenith, or moves against the ordered direction, and
    True again when it has returned or the next goto has ended.
    """

    previous: PositionSample | None = None
    last: PositionSample | None = None
    rates: Rates = Rates()
    prev_rates: Rates = Rates()
    began_at: float = NEVER
    ordered_speed: float = 0.0
    sky_speed: float = 0.0
    farthest_from_suns: tuple[float, ...] = ()
    upright: bool = True

    @property
    def elapsed(self) -> float:
        """Seconds between the last two positions; 0 if there are not two."""
        return self.last.time - self.previous.time if self.last is not None and self.previous is not None else 0.0


def begin_motion(observed: ObservedMotion, now: float, ordered_speed: float, at_rest: bool) -> ObservedMotion:
    """Note that a motion begins now; if the mount was ``at_rest``, it begins at the last position."""
    last = replace(observed.last, time=now) if observed.last is not None and at_rest else observed.last
    return replace(observed, last=last, rates=Rates(), prev_rates=Rates(), began_at=now, ordered_speed=ordered_speed)


def add_first_position(observed: ObservedMotion, sample: PositionSample) -> ObservedMotion:
    """Add a position that cannot be compared with the last position."""
    return replace(observed, previous=None, last=sample, farthest_from_suns=sample.sun_distances)


def add_position(observed: ObservedMotion, sample: PositionSample) -> ObservedMotion:
    """Add a position that can be compared with the last position, and calculate the speeds."""
    before = observed.last
    assert before is not None
    elapsed = sample.time - before.time
    across = separation(before.position.ra, before.position.dec, sample.position.ra, sample.position.dec) / elapsed
    changes = Rates(
        tuple(abs(now - then) / elapsed for then, now in zip(before.altitudes, sample.altitudes, strict=False)),
        tuple(abs(now - then) / elapsed for then, now in zip(before.sun_distances, sample.sun_distances, strict=True)),
    )
    return replace(observed, previous=before, last=sample, rates=changes, prev_rates=observed.rates, sky_speed=across)


def set_upright(observed: ObservedMotion, equatorial: bool, speed: float) -> ObservedMotion:
    """Update ``upright``: False if the tube moves against the ordered direction of the second axis, so that it must be
    beyond the pole or the zenith. ``speed`` is the motor's, degrees a second.
    """
    before, last = observed.previous, observed.last
    if before is None or last is None or last.axis2_move is None or last.axis2_move is not before.axis2_move:
        return observed
    was, now = (sample.position.dec if equatorial else sample.altitude or 0.0 for sample in (before, last))
    if max(abs(was), abs(now)) > NEAR_POLE_LAT:
        return observed
    rose = now - was
    # otherwise something else moved the tube
    if abs(rose) > MIN_DIRECTION_STEP and 0.4 < abs(rose) / (speed * observed.elapsed) < 2.0:
        return replace(observed, upright=rose * last.axis2_move.sense > 0)
    return observed


def update_upright_by_passage(
    observed: ObservedMotion,
    last: PositionSample | None,
    sample: PositionSample,
    astrometry: SiteAstrometry,
    status: op.Status | None,
) -> ObservedMotion:
    """Flip ``upright`` if the tube has passed the pole or zenith between two positions; not to be used in a goto."""
    if last is None or status is None:
        return observed
    before, after = (axis_sample(astrometry, status, False, each.time, each.position).angles for each in (last, sample))
    passes = abs(wrap180(after[0] - before[0])) > POLE_PASSAGE_TURN and min(abs(before[1]), abs(after[1])) > PASSAGE_LAT
    return replace(observed, upright=not observed.upright) if passes else observed


def extrapolate_ra(now: float, position: op.Equatorial, previous: PositionSample, lag: float) -> op.Equatorial:
    """Return the position with the right ascension, read ``lag`` seconds earlier, as of the time of the declination."""
    turned = wrap180(position.ra - previous.position.ra)
    if not lag or abs(turned) > JUMP_DEGREES:
        return position
    return replace(position, ra=(position.ra + turned / (now - previous.time) * lag) % 360.0)


def axis_sample(
    astrometry: SiteAstrometry, status: op.Status | None, low_precision: bool, now: float, position: op.Equatorial
) -> AxisSample:
    """Return a position as readings of the two axes: right ascension and declination, or azimuth and altitude."""
    resolution = COARSE_RESOLUTION if low_precision else POSITION_RESOLUTION
    if status is None or status.equatorial or astrometry.site_clock.site() is None:
        return AxisSample(now, (position.ra, position.dec), resolution)
    horizon = astrometry.horizontal(position)
    return AxisSample(now, (horizon.az, horizon.alt), resolution)
