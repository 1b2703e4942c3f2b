"""Whether the observed motion may continue: pure rules over the positions, the orders and the limits.

A rule is a pure function from a ``View`` to a ``Verdict``, evaluated at every position. It may only restrict motion,
and it never forbids a motion that leads out of a forbidden region. A moving mount must not pass an altitude limit, come
near the Sun, or go past the meridian, where the tube of an equatorial mount meets its pier. Gotos are also checked
before they begin, without a margin for their speed (``admission/motions.py``). A motion must be stopped early enough to
end before the limit (``StopTiming``), which depends on the exchanges of this line, the inertia of motors, and rates
that may still grow.
"""

from __future__ import annotations

from msgspec import Struct

from gateway.astro.axes import Pair
from gateway.astro.spherical import separation
from gateway.core import operations as op
from gateway.mount.motion.seen import Observed
from gateway.mount.motion.wanted import Moving
from gateway.mount.policy import Limits

#: Positions closer together than this, in seconds, give no reliable rate.
MIN_INTERVAL = 0.15
#: Exchanges until a stop takes effect: that of the position, a command already sent, and the first of the stop.
EXCHANGES = 3
#: Seconds at full speed that a motor runs on after a stop: one that slows down evenly within a second covers half a
#: second's way. Mounts do not report how they slow down; owners see about a second from full speed, and less below it.
RUN_ON = 0.5
#: Exchanges between the stops of the two axes, which alone may lead where both together do not.
BETWEEN_AXES = 2.0
#: Seconds until motors have reached their speed; the rate that is measured earlier is too low.
RUN_UP = 1.0
#: The part of the commanded speed above which a rate shows an approach; a slower change means moving along the limit.
APPROACH = 0.2
#: Degrees a second, faster than any tracking: the mount is moved, or a coarse position changed by a digit.
FASTER_THAN_TRACKING = 0.1
#: Degrees by which a goto that brakes before a limit stays behind what its last speed lets expect.
BRAKED = 0.75
#: Degrees by which a goto on its way may be seen beyond a limit, and seconds of its speed: the two coordinates of a
#: position are read in turn while the tube moves.
OVERSHOOT, APART = 0.1, 0.2
#: Degrees below the lowest point of its ways, and below the horizon, at which a goto is lost.
LOST = 10.0
#: Degrees by which the Sun must have come nearer before it counts as an approach; less is jitter.
NEARER = 0.05


class StopTiming(Struct, frozen=True):
    """Timing of a mount: ``exchange`` seconds each, ``reads`` per position, ``period`` seconds between positions;
    after a stop it runs on for ``run_on`` seconds at full speed.
    """

    exchange: float
    reads: int
    period: float
    run_on: float = RUN_ON

    @property
    def lag(self) -> float:
        """How much older the first coordinate of a position is than the second, when the second arrives, seconds."""
        return 2.0 * (self.reads - 1) * self.exchange

    @property
    def interval(self) -> float:
        """Seconds between two positions. While the mount moves, each coordinate is read twice."""
        return max(self.period, 2.0 * self.reads * self.exchange)

    @property
    def to_stop(self) -> float:
        """Seconds from the moment at which a position was true until the stop that it triggers has ended the motion."""
        return (EXCHANGES + self.reads - 1) * self.exchange + self.run_on

    @property
    def reaction(self) -> float:
        """Seconds from one position until the stop that the next position triggers has ended the motion."""
        return self.interval + self.to_stop

    def overdue(self, elapsed: float) -> float:
        """Like ``reaction``, if the last two positions were ``elapsed`` seconds apart: the next position may be as
        late.
        """
        return max(self.reaction, elapsed + EXCHANGES * self.exchange + self.run_on)


def ahead(rate: float, earlier: float | None, commanded: float, first: float, last: float) -> float:
    """Return how fast the mount may approach a limit from now on, degrees a second.

    ``rate`` was seen between the last two positions, ``earlier`` before that in the same motion; ``first`` and ``last``
    are the seconds from the beginning of the motion to the two. ``commanded`` is the speed ordered, 0 if unknown.
    """
    grown = max(0.0, rate - earlier) if earlier is not None else 0.0
    if first < RUN_UP and rate > APPROACH * commanded * _run_up(first, last):
        return max(rate + grown, commanded)
    return rate + grown


def _run_up(first: float, last: float) -> float:
    """The mean speed of a motor between two moments (seconds after its start) as a part of its full speed."""
    if last >= RUN_UP or last <= max(0.0, first):
        return 1.0
    return (max(0.0, first) + last) / 2.0 / RUN_UP


class PastNow(Struct, frozen=True):
    """How far the tube is past the meridian, towards the pier; negative on the free side. ``rate``: how fast that
    changes, degrees a second; ``earlier``: its rate before that, None if unknown.
    """

    degrees: float
    rate: float
    earlier: float | None = None


class Verdict(Struct, frozen=True):
    """``reason`` says why the motion must end; empty if it may continue.

    It may continue for ``within`` seconds (None: without limit). If no new position arrives in that time, it must stop,
    because it may have reached ``limit``.
    """

    reason: str = ""
    within: float | None = None
    limit: str = ""


ALLOWED = Verdict()


class CheckedPath(Struct):
    """What is known of the goto that is about to begin.

    ``ways`` are the readings of the axes along its paths that keep the limits: empty if it must be watched like a
    motion by hand, None if they are not known. Below ``floor``, degrees, it is lost. ``clear``: it keeps all limits.
    """

    ways: list[Pair] | None = None
    floor: float = -90.0
    clear: bool = False

    def forget(self) -> None:
        """Begin with a new goto, of which nothing is known."""
        self.ways, self.floor, self.clear = None, -90.0, False

    def take(self, ways: list[Pair], zenith: Pair, clear: bool, lost: float) -> None:
        """Take the readings along the paths, and at the ``zenith``. Not ``clear``: the tube may be on another path.

        ``lost`` degrees below them the goto counts as lost.
        """
        self.ways, self.clear = ways if clear else [], clear
        self.floor = min(0.0, 90.0 - max(separation(*direction, *zenith) for direction in ways) - lost)


class View(Struct, frozen=True):
    """The state of a mount that the rules judge.

    ``sun`` is the smallest allowed distance from the Sun, degrees. The first ``own_suns`` of the Suns are by the
    mount's own coordinates or axes, the others by other sources of site and time. ``past`` is how far the tube is past
    the meridian, None if unknown or during a goto. ``astray``: a position showed the goto off its paths; ``floor`` is
    the altitude below which it is lost.
    """

    observed: Observed
    limits: Limits
    timing: StopTiming
    moving: Moving
    sun: float = 0.0
    status: op.Status | None = None
    past: PastNow | None = None
    astray: bool = False
    own_suns: int = 1
    floor: float = -90.0

    @property
    def on_checked_path(self) -> bool:
        """Whether only a checked goto moves the mount: no motion by hand has replaced it, and none of its axes was
        stopped.

        A goto off its paths does not count: it is watched like a motion by hand.
        """
        return self.moving.slewing and self.moving.ordered and not self.moving.by_hand and not self.astray

    @property
    def _second_axis_alone(self) -> float:
        """How far one of two axes moves the tube after the other has stopped, degrees; 0 if at most one moves."""
        return self.observed.across * (BETWEEN_AXES * self.timing.exchange if len(self.moving.by_hand) > 1 else 0.0)

    def ahead(self, rate: float, earlier: float | None) -> float:
        """How fast the mount may approach a limit from now on, after the rates ``earlier`` and ``rate``."""
        observed = self.observed
        if self.moving.slews_by_itself:
            return rate
        assert observed.before is not None
        assert observed.last is not None
        return ahead(
            rate,
            earlier,
            observed.ordered_speed,
            observed.before.at - observed.began,
            observed.last.at - observed.began,
        )

    def margin(self, rate: float) -> float:
        """How far a motion gets before a stop at the next position can end it, degrees; 0 for a goto, which brakes."""
        if self.on_checked_path or self.moving.slews_by_itself:
            return 0.0
        return rate * self.timing.overdue(self.observed.elapsed) + self._second_axis_alone

    def allowed_within(self, room: float, rate: float, limit: str) -> Verdict:
        """Return a verdict that allows the motion while a stop can still end it within ``room`` degrees.

        The mount's own goto may brake and end just before the limit: it is stopped only at the limit.
        """
        if rate <= FASTER_THAN_TRACKING or self.on_checked_path:
            return ALLOWED
        if self.moving.slews_by_itself:
            return Verdict(within=(room + BRAKED) / rate - self.timing.exchange, limit=limit)
        return Verdict(within=(room - self._second_axis_alone) / rate - self.timing.to_stop, limit=limit)


def allow(view: View) -> Verdict:
    """Return the verdict that forbids the motion, else the verdict with the earliest deadline for the next position."""
    soonest = ALLOWED
    for rule in (altitude, near_sun, meridian):
        verdict = rule(view)
        if verdict.reason:
            return verdict
        soonest = _sooner(soonest, verdict)
    return soonest


def first_stretch(view: View, now: float, speed: float) -> Verdict:
    """Return the deadline for the first position after a motion by hand begins, in whatever direction it moves.

    The mount must have reported a position before it can reach any limit. ``speed`` is that of all axes together,
    degrees a second. The first stretch of the motion has been checked already (``admission/by_hand.py``).
    """
    last, limits, timing = view.observed.last, view.limits, view.timing
    if last is None or view.status is None or not view.status.aligned or speed <= FASTER_THAN_TRACKING:
        return Verdict()
    rooms = [distance - view.sun for distance in last.suns]
    rooms += [altitude - limits.lowest for altitude in last.altitudes if limits.lowest > -90.0]
    rooms += [limits.highest - altitude for altitude in last.altitudes if limits.highest < 90.0]
    nearest = min((room for room in rooms if room > 0.0), default=180.0)
    seconds = nearest / speed - timing.to_stop - (now - last.at)
    return Verdict(within=max(seconds, timing.interval + MIN_INTERVAL), limit="a limit")


# --- altitude ---------------------------------------------------------------------------------------------------------


def leaving(limits: Limits, before: float, after: float, margin: float = 0.0) -> bool:
    """Whether an altitude is outside the limits, or within ``margin`` degrees of them, and is getting worse.

    Limits of -90 and 90 degrees are off, because nothing lies beyond them.
    """
    sinking = limits.lowest > -90.0 and after < limits.lowest + margin and after < before
    rising = limits.highest < 90.0 and after > limits.highest - margin and after > before
    return sinking or rising


def altitude(view: View) -> Verdict:
    """End a motion before it passes an altitude limit, by the mount's coordinates or by those before its syncs.

    For the arrows of programs, written limits also count by other sources of site and time, as in ``near_sun``. A goto
    may pass the horizon on its way if nobody wrote a limit, but never its ``floor``. If the syncs were wrong, only
    written limits count.
    """
    before, last, changes = view.observed.before, view.observed.last, view.observed.changes
    if before is None or last is None or changes is None:
        return ALLOWED
    earlier, soonest = view.observed.earlier, ALLOWED
    goes = view.moving.slewing and view.moving.ordered and not view.moving.by_hand
    beyond = (OVERSHOOT + APART * view.observed.across) * view.on_checked_path
    own, count = last.own, None if view.moving.by_hand else last.own
    for number, (then, now) in enumerate(zip(before.altitudes[:count], last.altitudes[:count], strict=False)):
        limits = view.limits.written() if goes or number else view.limits
        grew = _earlier(changes.altitudes, None if earlier is None else earlier.altitudes, number)
        rate = view.ahead(changes.altitudes[number], grew)
        if goes and now < min(view.floor, then):
            return Verdict(f"the altitude limit ({now:.1f} degrees, far below its way)")
        if leaving(limits, then, now, view.margin(rate) - beyond):
            by = ", by another site or clock" if number >= own else ", if the syncs were wrong" if number else ""
            return Verdict(f"the altitude limit ({now:.1f} degrees{by})")
        if now < then and limits.lowest > -90.0:
            soonest = _sooner(soonest, view.allowed_within(now - limits.lowest, rate, "the altitude limit"))
        elif now > then and limits.highest < 90.0:
            soonest = _sooner(soonest, view.allowed_within(limits.highest - now, rate, "the altitude limit"))
    return soonest


def _earlier(changes: tuple[float, ...], before: tuple[float, ...] | None, number: int) -> float | None:
    """Return the speed with this number in ``before``; None if the number of speeds was different then."""
    return before[number] if before is not None and len(before) == len(changes) else None


def _sooner(first: Verdict, other: Verdict) -> Verdict:
    """Return the verdict with the earlier deadline."""
    return min(first, other, key=lambda verdict: float("inf") if verdict.within is None else verdict.within)


# --- the Sun ----------------------------------------------------------------------------------------------------------


def near_sun(view: View) -> Verdict:
    """Forbid coming nearer to a Sun than the limit, measured from ``farthest``, so that slow approaches count too.

    Suns of other sources end only the arrows of programs, because a wrong source must not end a motion that is right.
    """
    before, last, soonest = view.observed.before, view.observed.last, ALLOWED
    if before is None or last is None:
        return ALLOWED
    count = len(last.suns) if view.moving.by_hand else view.own_suns
    for number, (then, now) in enumerate(zip(before.suns[:count], last.suns[:count], strict=True)):
        rate = _rate(view, number)
        if now >= view.sun + view.margin(rate):
            soonest = _sooner(soonest, view.allowed_within(now - view.sun, rate, "the Sun") if now < then else ALLOWED)
        elif now < view.observed.farthest[number] - NEARER:
            return Verdict(f"the Sun ({now:.0f} degrees from it)")
    return soonest


def farthest(view: View) -> tuple[float, ...]:
    """Return, for each Sun, the greatest distance since the tube came near it, or the present distance if it is not
    near.
    """
    if view.observed.last is None:
        return ()
    return tuple(
        now if now >= view.sun + view.margin(_rate(view, number)) or now < before - NEARER else max(now, before)
        for number, (now, before) in enumerate(zip(view.observed.last.suns, view.observed.farthest, strict=True))
    )


def _rate(view: View, number: int) -> float:
    """How fast the tube may approach a Sun, degrees a second."""
    changes, earlier = view.observed.changes, view.observed.earlier
    assert changes is not None
    grew = _earlier(changes.suns, None if earlier is None else earlier.suns, number)
    return view.ahead(changes.suns[number], grew)


# --- the meridian -----------------------------------------------------------------------------------------------------


def meridian(view: View) -> Verdict:
    """End a motion at the limit of the hour angle. Gotos are exempt, because they may change the pier side."""
    limit, past = view.limits.hour_angle, view.past
    if limit is None or past is None or past.rate <= 0.0 or view.observed.before is None or view.moving.slewing:
        return ALLOWED
    rate = view.ahead(past.rate, past.earlier)
    if past.degrees > limit - view.margin(rate):
        return Verdict(f"the hour angle limit ({past.degrees / 15.0:.2f} hours past the meridian)")
    return view.allowed_within(limit - past.degrees, rate, "the hour angle limit")
