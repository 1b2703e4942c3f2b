"""Where the mount points and where it is sent: positions, syncs, and gotos to the sky or to readings of the axes.

A goto is started at once, watched by ``L``, ended by the last word. It counts as under way from the moment the hand
control acknowledged it; ``L`` may still say 0 for a while.
"""

from __future__ import annotations

from gateway.astro.spherical import fold_declination, wrap180, wrap360
from gateway.core import operations as op
from gateway.core.errors import NoAnswer, NotAligned, Unsupported
from gateway.protocols.base.driver import Schedule, Send, Steps, Wait
from gateway.protocols.nexstar.driver import tracking
from gateway.protocols.nexstar.driver.state import AXES, POLE_AXES, GotoState, NexStar, rest

START_GRACE = 3.0
CANCEL_WAIT = 5.0
#: How often a parked mount is told not to track, where it does not answer, and how many seconds apart.
TELLS, TELL_AGAIN = 4, 5.0
MOTORS, FOUND = (16, 17), 255


def position(mount: NexStar, _: op.Position) -> Steps:
    """``e`` or ``E``, folded past the pole, with the offset of a sync that the hand control could not take."""
    answer = yield Send("e" if mount.supports("e") else "E")
    mount.beyond_pole = abs(wrap180(answer["dec"])) > 90.0
    ra, dec = fold_declination(answer["ra"], answer["dec"])
    ra, dec = fold_declination(ra + mount.offset[0], dec + mount.offset[1])
    mount.last = op.Equatorial(ra, dec)
    return mount.last


def axis_readings(mount: NexStar) -> Send:
    """The readings of the axes, as precisely as this version tells them."""
    return Send("z" if mount.supports("z") else "Z")


def horizontal_position(mount: NexStar, _: op.HorizontalPosition) -> Steps:
    """A fork's own azimuth and altitude; None where the axes are equatorial (the controller derives it then)."""
    mode = tracking.native_mode(mount)
    if mount.german or (mode is not None and mode.equatorial) or mount.has_sync_offset:
        return None
    answer = yield axis_readings(mount)
    return op.Horizontal(az=wrap360(answer["az"]), alt=max(-90.0, min(90.0, answer["alt"])))


def pier_side(mount: NexStar, _: op.PierSide) -> Steps:
    """``p``: E or W; a fork is always E.

    A German mount before ``p`` tells it by its declination axis: on the W side that reads beyond the pole. The letter
    is then that of its age, which is the northern one everywhere (``NexStar.tube_side``).
    """
    if not mount.german:
        return "E"
    if mount.supports("p"):
        answer = yield Send("p")
        return answer["side"]
    answer = yield axis_readings(mount)
    return "W" if wrap180(answer["alt"] - POLE_AXES[1]) > 0.0 else "E"


def sync(mount: NexStar, operation: op.Sync) -> Steps:
    """``s`` or ``S``; before 4.10 an offset kept here and added to everything the mount says."""
    if mount.supports("s"):
        yield Send("s", {"ra": operation.ra, "dec": operation.dec})
        return
    answer = yield Send("e" if mount.supports("e") else "E")
    ra, dec = fold_declination(answer["ra"], answer["dec"])
    mount.offset = (wrap180(wrap360(operation.ra) - ra), operation.dec - dec)


# --- gotos ------------------------------------------------------------------------------------------------------------


def goto(mount: NexStar, operation: op.Goto) -> Steps:
    """``r`` or ``R``, less the offset of a sync that the hand control could not take."""
    yield from need_alignment(mount)
    yield from stop_current_motion(mount)
    if operation.track and mount.tracking is op.Tracking.OFF and tracking.native_mode(mount) and mount.supports("T"):
        yield from tracking.set_tracking(mount, op.SetTracking(on=True))
    ra, dec = fold_declination(operation.ra - mount.offset[0], operation.dec - mount.offset[1])
    yield from _begin(mount, Send("r" if mount.supports("r") else "R", {"ra": ra, "dec": dec}))


def need_alignment(mount: NexStar) -> Steps:
    """A hand control without alignment would only say ``#`` and do nothing, so it is asked first. Raises NotAligned."""
    answer = yield Send("J")
    mount.aligned = bool(answer["aligned"])
    if not mount.aligned:
        raise NotAligned


def goto_axes(mount: NexStar, operation: op.GotoAxes) -> Steps:
    """``b`` or ``B``."""
    yield from stop_current_motion(mount)
    yield from to_axes(mount, operation.az, operation.alt, None)


def to_axes(mount: NexStar, az: float, alt: float, then: str | None) -> Steps:
    yield from _begin(mount, Send("b" if mount.supports("b") else "B", {"az": az, "alt": alt}), then)


def _begin(mount: NexStar, command: Send, then: str | None = None) -> Steps:
    def sent() -> Steps:
        yield command

    yield from mount.begin_goto(GotoState(since=mount.now(), then=then), sent(), _slews)


def _slews(_: NexStar) -> Steps:
    """-> what ``L`` tells: whether a goto is under way."""
    return (yield Send("L"))["slewing"] == "1"


def stop_current_motion(mount: NexStar) -> Steps:
    """End what moves: the newer goto wins, as at the keypad. Hand motion and pulses: rate 0; ``M`` until ``L`` = 0."""
    mount.steps.clear()
    for axis in sorted({*mount.moving, *mount.pulsing, *((1, 2) if mount.riding else ())}):
        yield rest(axis)
        mount.moving.pop(axis, None)
    mount.pulsing.clear()
    mount.riding.clear()
    mount.not_guided()
    if mount.goto is not None and mount.goto.seeks:
        yield from _stop_seeking(mount)
    elif mount.goto is not None:
        yield Send("M")
        deadline = mount.now() + CANCEL_WAIT
        while mount.now() < deadline and (yield from _slews(mount)):
            yield Wait(0.1)
        mount.give_up_goto()
    if mount.suspended is not None:
        if mount.suspended is not op.Tracking.OFF:
            yield from tracking.send_mode(mount, mount.suspended)
        mount.suspended = None


def abort_slew(mount: NexStar, _: op.AbortSlew) -> Steps:
    """``M``: a goto ends, hand motion goes on, and a special drive rate comes back."""
    going = mount.goto
    if mount.goto is not None and mount.goto.seeks:
        yield from _stop_seeking(mount)
        yield from tracking.resume(mount)
        return
    mount.give_up_goto()
    yield Send("M")
    if going is not None and mount.rate.name != "sidereal":
        yield Schedule(0.0, Arrived(then=""))  # the hand control goes on at the sidereal rate


def _stop_seeking(mount: NexStar) -> Steps:
    """Rate 0 ends a search for the switches, which ``M`` does not know of."""
    mount.goto, mount.home_state = None, 0
    for axis in AXES:
        yield rest(axis)


def slewing(mount: NexStar, _: op.Slewing) -> Steps:
    """-> bool. ``L``, latched from the acknowledgement of the goto until the mount has had time to begin."""
    state = mount.goto
    if state is not None and state.seeks:
        return (yield from _still_seeking(mount, state))
    moving = yield from _slews(mount)
    if mount.goto is not state:
        return mount.goto is not None or moving  # another one was begun, or this one was stopped, meanwhile
    if state is None:
        return moving
    if moving:
        state.seen, state.unconfirmed = True, False
        return True
    if not state.seen and mount.now() - state.since < START_GRACE and not (yield from _arrived(mount, state)):
        return True
    if mount.goto is not state:
        return mount.goto is not None
    if state.unconfirmed:  # nobody has seen it move: what belongs to its end, as the end of tracking, is left
        mount.give_up_goto()
        return False
    mount.goto = None
    yield Schedule(0.0, Arrived(then=state.then or ""))
    return False


def _still_seeking(mount: NexStar, state: GotoState) -> Steps:
    """AUX 0x12 of both motors."""
    for device in MOTORS:
        if (yield Send("level_done", {"device": device}))["done"] != FOUND:
            return mount.goto is not None
    if mount.goto is state:
        mount.goto = None
        yield Schedule(0.0, Arrived(then="home"))
    return mount.goto is not None


class Arrived(op.Operation, frozen=True):
    """Internal: a goto is over; what belongs to its end is done in turn with other motions."""

    then: str
    left: int = TELLS


def _arrived(mount: NexStar, state: GotoState) -> Steps:
    """Whether a short goto was over before it was first looked at."""
    if mount.now() - state.since < 1.0:
        return False
    before = yield Send("E")
    yield Wait(0.3)
    after = yield Send("E")
    return before == after and mount.now() - state.since > 1.5


def arrived(mount: NexStar, operation: Arrived) -> Steps:
    """The goto is over: park, note home, or come back to a special drive rate. Not when something moves again.

    Tracking that goes on at the park position would carry the tube away: it is put off again where that was not heard.
    """
    again = operation.left < TELLS
    if mount.goto is not None or mount.moving or (again and not mount.parked):
        return
    if operation.then == "park":
        if not mount.supports("T"):
            raise Unsupported("It stands at its park position, but this hand control keeps tracking.")
        mount.parked, mount.suspended = True, None
        try:
            yield Send("T", {"mode": 0})
        except NoAnswer:
            if operation.left > 1:
                yield Schedule(TELL_AGAIN, Arrived("park", operation.left - 1))
            raise
        mount.tracking = op.Tracking.OFF
    elif operation.then == "home":
        mount.home_state = 1
        yield from tracking.resume(mount)
    elif mount.rate.name != "sidereal":
        yield from tracking.track_rate(mount, mount.rate)
