"""Positions, syncs, and gotos to sky positions or axis readings.

A goto counts as under way just before its command is sent. Its progress is read by ``L``, which may still return 0 for
a while at first. What follows its end (parking, home, drive rate) is a scheduled operation, ``AfterGoto``.
"""

from __future__ import annotations

from gateway.astro.spherical import fold_declination, separation, wrap180, wrap360
from gateway.core import operations as op
from gateway.core.errors import NoAnswer, NotAligned, Unsupported
from gateway.protocols.base.driver import Remark, Schedule, Send, Steps, Wait
from gateway.protocols.nexstar.driver import tracking
from gateway.protocols.nexstar.driver.state import MOTORS, POLE_AXES, NexStar, NexStarGotoState, stop_command

#: Seconds after a goto's acknowledgement in which ``L`` = 0 may mean that it has not begun yet.
START_GRACE = 3.0
#: Seconds to wait for ``L`` = 0 after ``M``.
CANCEL_WAIT = 5.0
#: Degrees by which the axes may be away from the position of park or home when the slew there has ended.
ARRIVAL_TOLERANCE = 0.5
#: At most how many times tracking is turned off after parking if the mount does not answer, and the seconds between.
TRACKING_OFF_TRIES, TRACKING_OFF_INTERVAL = 4, 5.0
MOTOR_DEVICES, SWITCH_FOUND = (16, 17), 255


def position(mount: NexStar, _: op.Position) -> Steps:
    """Return the Equatorial position by ``e`` or ``E``, folded at the pole, plus the offset of an emulated sync."""
    answer = yield Send("e" if mount.supports("e") else "E")
    mount.reports_beyond_pole = abs(wrap180(answer["dec"])) > 90.0
    ra, dec = fold_declination(answer["ra"], answer["dec"])
    if any(mount.sync_offset):
        ra, dec = fold_declination(ra + mount.sync_offset[0], dec + mount.sync_offset[1])
    mount.last_position = op.Equatorial(ra, dec)
    return mount.last_position


def axis_command(mount: NexStar) -> Send:
    """Return the command that reads the axes with the best precision this version has."""
    return Send("z" if mount.supports("z") else "Z")


def axis_position(mount: NexStar, _: op.AxisPosition) -> Steps:
    """Return both axis readings; the first one of a German mount is shifted to what a Celestron would read."""
    answer = yield axis_command(mount)
    az = wrap360(answer["az"] + mount.axis_offset) if mount.axis_offset else answer["az"]
    return op.Horizontal(az, answer["alt"])


def horizontal_position(mount: NexStar, _: op.HorizontalPosition) -> Steps:
    """Return a fork's Horizontal position; None (the controller calculates it) if equatorial or with a sync offset."""
    mode = tracking.native_mode(mount)
    if mount.german or (mode is not None and mode.equatorial) or any(mount.sync_offset):
        return None
    answer = yield axis_command(mount)
    return op.Horizontal(az=wrap360(answer["az"]), alt=max(-90.0, min(90.0, answer["alt"])))


def pier_side(mount: NexStar, _: op.PierSide) -> Steps:
    """Return the pier side by ``p``: "E" or "W"; a fork is always "E".

    On a German mount that lacks ``p`` the declination axis shows it: on the W side it reads beyond the pole. The letter
    then follows the northern rule in both hemispheres, as in these old versions (``NexStar.tube_side``).
    """
    if not mount.german:
        return "E"
    if mount.supports("p"):
        answer = yield Send("p")
        return answer["side"]
    answer = yield axis_command(mount)
    return "W" if wrap180(answer["alt"] - POLE_AXES[1]) > 0.0 else "E"


def sync(mount: NexStar, operation: op.Sync) -> Steps:
    """Send ``s``; before 4.10 store an offset instead, which is added to every position that the mount reports."""
    if mount.supports("s"):
        yield Send("s", {"ra": operation.ra, "dec": operation.dec})
        return
    answer = yield Send("e" if mount.supports("e") else "E")
    ra, dec = fold_declination(answer["ra"], answer["dec"])
    mount.sync_offset = (wrap180(wrap360(operation.ra) - ra), operation.dec - dec)


# --- gotos ------------------------------------------------------------------------------------------------------------


def goto(mount: NexStar, operation: op.Goto) -> Steps:
    """Slew by ``r`` or ``R``, less an emulated sync's offset. Raises NotAligned; Refused if the mounting is unknown."""
    if mount.native_mode is None:
        mount.check_mounting_known()
    yield from require_alignment(mount)
    yield from stop_current_motion(mount)
    if operation.track and mount.tracking is op.Tracking.OFF and tracking.native_mode(mount) and mount.supports("T"):
        yield from tracking.set_tracking(mount, op.SetTracking(on=True))
    ra, dec = fold_declination(operation.ra - mount.sync_offset[0], operation.dec - mount.sync_offset[1])
    yield from _begin_goto(mount, Send("r" if mount.supports("r") else "R", {"ra": ra, "dec": dec}))


def require_alignment(mount: NexStar) -> Steps:
    """Ask ``J`` first, because an unaligned hand control acknowledges a goto and does nothing. Raises NotAligned."""
    answer = yield Send("J")
    mount.aligned = bool(answer["aligned"])
    if not mount.aligned:
        raise NotAligned


def goto_axes(mount: NexStar, operation: op.GotoAxes) -> Steps:
    """Slew to axis readings by ``b`` or ``B``."""
    yield from stop_current_motion(mount)
    yield from slew_axes(mount, operation.az, operation.alt, None)


def slew_axes(mount: NexStar, az: float, alt: float, purpose: str | None) -> Steps:
    mount.check_mounting_known()
    az -= mount.axis_offset
    yield from _begin_goto(mount, Send("b" if mount.supports("b") else "B", {"az": az, "alt": alt}), purpose)


def _begin_goto(mount: NexStar, command: Send, purpose: str | None = None) -> Steps:
    def send() -> Steps:
        yield command

    yield from mount.begin_goto(NexStarGotoState(purpose=purpose), send(), _is_slewing)


def _is_slewing(_: NexStar) -> Steps:
    """Return whether a goto is under way, by ``L``."""
    return (yield Send("L"))["slewing"] == "1"


def stop_current_motion(mount: NexStar) -> Steps:
    """End all motion, because a new goto replaces it, and resume tracking if it was suspended.

    Rate 0 ends hand motion and guide pulses. ``M`` ends a goto; then wait until ``L`` returns 0.
    """
    mount.small_goto_motions.clear()
    for axis in sorted({*mount.moving, *mount.pulsing, *((1, 2) if mount.added_rates else ())}):
        yield stop_command(axis)
        mount.moving.pop(axis, None)
    mount.pulsing.clear()
    mount.added_rates.clear()
    mount.record_guiding_ended()
    if mount.goto is not None and mount.goto.seeks_switches:
        yield from _stop_seeking(mount)
    elif mount.goto is not None:
        yield from _cancel_goto(mount)
        deadline = mount.now() + CANCEL_WAIT
        while mount.now() < deadline and (yield from _is_slewing(mount)):
            yield Wait(0.1)
        mount.give_up_goto()
    if mount.suspended_mode is not None:
        if mount.suspended_mode is not op.Tracking.OFF:
            yield from tracking.send_mode(mount, mount.suspended_mode)
        mount.suspended_mode = None


def abort_slew(mount: NexStar, _: op.AbortSlew) -> Steps:
    """Send ``M``: a goto ends, hand motion continues, a special drive rate is restored. A home search gets rate 0."""
    going = mount.goto
    if mount.goto is not None and mount.goto.seeks_switches:
        yield from _stop_seeking(mount)
        yield from tracking.resume(mount)
        return
    mount.give_up_goto()
    yield from _cancel_goto(mount)
    if going is not None and mount.rate.name != "sidereal":
        yield Schedule(0.0, AfterGoto(then=""))  # the hand control now tracks at the sidereal rate


def _cancel_goto(mount: NexStar) -> Steps:
    """Send ``M``; to a hand control that may restart the goto, also rate 0 for the axes that are not moved by hand."""
    yield Send("M")
    if "restarts" in mount.model_facts:
        for axis in sorted(MOTORS.keys() - mount.moving.keys()):
            yield stop_command(axis)


def _stop_seeking(mount: NexStar) -> Steps:
    """Send rate 0 to both motors, because ``M`` does not end a search for the home switches."""
    mount.goto, mount.home_state = None, 0
    for axis in MOTORS:
        yield stop_command(axis)


def slewing(mount: NexStar, _: op.Slewing) -> Steps:
    """Return whether a goto is under way: by ``L``, or True while an acknowledged goto may not have begun yet."""
    state = mount.goto
    if state is not None and state.seeks_switches:
        return (yield from _is_seeking_switches(mount, state))
    moving = yield from _is_slewing(mount)
    if mount.goto is not state:
        return mount.goto is not None or moving  # meanwhile another goto has begun, or this goto was stopped
    if state is None:
        return moving
    if moving:
        state.slew_reported, state.unconfirmed = True, False
        return True
    if not state.slew_reported and mount.now() - state.began < START_GRACE and not (yield from _arrived(mount, state)):
        return True
    if mount.goto is not state:
        return mount.goto is not None
    if state.unconfirmed:  # no motion was observed: leave out what follows its end, such as turning tracking off
        mount.give_up_goto()
        return False
    mount.goto = None
    yield Schedule(0.0, AfterGoto(then=state.purpose or ""))
    return False


def _is_seeking_switches(mount: NexStar, state: NexStarGotoState) -> Steps:
    """Return whether a motor still seeks its home switch, by AUX 0x12 of both motors."""
    for device in MOTOR_DEVICES:
        if (yield Send("level_done", {"device": device}))["done"] != SWITCH_FOUND:
            return mount.goto is not None
    if mount.goto is state:
        mount.goto = None
        yield Schedule(0.0, AfterGoto(then="home"))
    return mount.goto is not None


class AfterGoto(op.Operation, frozen=True):
    """Internal: finish a goto that has ended; ``then`` is park, home, or empty for a goto to a target."""

    then: str
    tries_left: int = TRACKING_OFF_TRIES


def _arrived(mount: NexStar, state: NexStarGotoState) -> Steps:
    """Return whether a short goto has ended before ``L`` was first read, as two equal positions in a row show."""
    if mount.now() - state.began < 1.0:
        return False
    before = yield Send("E")
    yield Wait(0.3)
    after = yield Send("E")
    return before == after and mount.now() - state.began > 1.5


def _distance_from(mount: NexStar, goal_name: str) -> Steps:
    """Return the distance of the axes from the position of park or home, degrees; 0 if that position is unknown."""
    by_switches = mount.settings.aux_home and mount.has_part("home")  # only the switches define the home position
    operation = op.Park() if goal_name == "park" else op.Home() if goal_name == "home" and not by_switches else None
    goal = None if operation is None else mount.destination(operation)
    if goal is None:
        return 0.0
    axes: op.Horizontal = yield from axis_position(mount, op.AxisPosition())
    return separation(goal.az, goal.alt, axes.az, axes.alt)


def finish_goto(mount: NexStar, operation: AfterGoto) -> Steps:
    """Finish a goto: park, note home, or restore a drive rate, unless the mount moves again or stopped elsewhere.

    Tracking at the park position would carry the tube away, so turning it off is retried if the mount does not answer.
    """
    again = operation.tries_left < TRACKING_OFF_TRIES
    if mount.goto is not None or mount.moving or (again and not mount.parked):
        return
    if not again and (away := (yield from _distance_from(mount, operation.then))) > ARRIVAL_TOLERANCE:
        yield Remark(f"the mount stands {away:.1f} degrees from its {operation.then} position, and tracks as before")
        return
    if operation.then == "park":
        if not mount.supports("T"):
            raise Unsupported("The mount is at its park position, but this hand control cannot turn tracking off.")
        mount.parked, mount.suspended_mode = True, None
        try:
            yield Send("T", {"mode": 0})
        except NoAnswer:
            if operation.tries_left > 1:
                yield Schedule(TRACKING_OFF_INTERVAL, AfterGoto("park", operation.tries_left - 1))
            raise
        mount.tracking = op.Tracking.OFF
    elif operation.then == "home":
        mount.home_state = 1
        yield from tracking.resume(mount)
    elif mount.rate.name != "sidereal":
        yield from tracking.set_drive_rate(mount, mount.rate)
