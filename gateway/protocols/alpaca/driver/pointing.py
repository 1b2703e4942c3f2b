"""Positions, gotos, syncs, park and home.

A server reports a parked mount by an error number. After any other refusal the driver reads what may be the reason, and
adds the server's text. If a server does not answer an order soon, it may still have accepted the order: old servers
answer when the motion has ended. So the driver then reads whether the mount slews.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from contextlib import suppress
from typing import Any

from gateway.astro.spherical import fold_declination, hour_angle_to_horizon, wrap180
from gateway.core import operations as op
from gateway.core.errors import BelowHorizon, Fault, Invalid, NoAnswer, Refused, Silence, Unsupported
from gateway.protocols.alpaca.driver.contradictions import CompareEquinox, check_sense
from gateway.protocols.alpaca.driver.identify import read_status
from gateway.protocols.alpaca.driver.state import AlpacaDriver, read_member, read_member_again, read_state
from gateway.protocols.alpaca.tables import Parked
from gateway.protocols.base.driver import GotoUnderWay, Remark, Schedule, Send, Steps, Wait

#: Seconds that the driver waits for the answer to an order before it reads whether the mount slews: meanwhile it
#: cannot send a stop.
MAX_WAIT = 1.5
#: Seconds after the beginning of a goto in which the server may still report that the mount does not slew.
START_GRACE = 2.0
#: Seconds from the end of the first goto to the comparison of the declared equinox.
EQUINOX_CHECK_DELAY = 3.0
#: Seconds from the end of a motion until the driver reads whether the mount tracks; seconds after which it trusts the
#: reports of tracking again even without that check.
TRACKING_CHECK_DELAY, TRACKING_CHECK_DEADLINE = 1.0, 3.0
#: Seconds that a goto waits for the end of an earlier motion, and between two checks of that.
MOTION_END_TIMEOUT, END_CHECK_PERIOD = 10.0, 0.5
#: Degrees from the meridian within which a German mount may go to either side of the pier.
EITHER_SIDE_ANGLE = 10.0
#: Orders that ASCOM allows only while the mount tracks; those that it allows while the mount is parked.
TRACKING_ONLY_ORDERS = ("slewtocoordinates", "slewtocoordinatesasync", "synctocoordinates")
ALLOWED_WHILE_PARKED = ("unpark", "set_tracking")
#: The messages for a parked mount, and for a refusal without a known reason.
PARKED_MESSAGE = "The mount is parked: unpark it first (mount-gateway unpark)."
REFUSED_MESSAGE = "The mount refused this."


def position(mount: AlpacaDriver, _: op.Position) -> Steps:
    """Return the Equatorial position, as the server reports it."""
    place, state = None, {}
    if mount.lists_state:
        state, mount.read_at = (yield from read_state(mount)), None
        place = _numbers(state, "RightAscension", "Declination")
        if place is not None and not (0.0 <= place[0] <= 24.0 and abs(place[1]) <= 90.0):
            place = None
        mount.lists_state = place is not None or not state  # a single failure is no reason never to ask again
    if place is None:
        ra, since = (yield Send("rightascension"))["ra"], mount.now()
        place = ra / 15.0, (yield Send("declination"))["dec"]
        mount.read_at = since, mount.now()
    present = op.Equatorial(*fold_declination(place[0] * 15.0, place[1]))
    if mount.sense_checks and (contradiction := check_sense(mount, present, _numbers(state, "Azimuth", "Altitude"))):
        yield Remark(contradiction)
    return present


def _numbers(state: Mapping[str, Any], *names: str) -> tuple[float, ...] | None:
    """Return the values of these names in a device state; None if any is missing or not a finite number."""
    try:
        values = tuple(float(state[name]) for name in names)
    except (KeyError, TypeError, ValueError):
        return None
    return values if all(map(math.isfinite, values)) else None


def horizontal_position(mount: AlpacaDriver, _: op.HorizontalPosition) -> Steps:
    """Return None, so that the gateway calculates azimuth and altitude with the site and clock used for its limits."""
    yield from ()


def pier_side(mount: AlpacaDriver, _: op.PierSide) -> Steps:
    """Return the tube's side of the pier, E or W. Raises Unsupported if it is unknown or the mount is not German."""
    ask = read_member if mount.hides_pier_side else read_member_again
    side = (yield from ask(mount, "sideofpier")) if mount.german else None
    if side not in (0, 1):
        raise Unsupported("The server does not report the side of the pier.")
    return "W" if side else "E"


def slewing(mount: AlpacaDriver, _: op.Slewing) -> Steps:
    """Return whether a goto is under way, and note its end. Slewing reported during a motion by hand does not count."""
    slews = bool((yield Send("slewing"))["value"])
    state = mount.goto
    if state is None:
        mount.moved_by_hand = mount.moved_by_hand and (slews or bool(mount.hand_rates))
        return slews and not mount.moved_by_hand
    if slews:
        state.slew_reported, state.unconfirmed = True, False
        return True
    if not state.slew_reported and mount.now() - state.began < START_GRACE:
        return True
    mount.goto = None
    if state.purpose == "park":
        mount.parked = bool((yield from read_member(mount, "atpark", True)))
        mount.tracks = mount.tracks and not mount.parked
    elif not mount.equinox_compared:
        yield Schedule(EQUINOX_CHECK_DELAY, CompareEquinox())
    if state.purpose == "home":
        mount.home_state = int(bool((yield from read_member(mount, "athome", True))))
    elif state.purpose is None:
        yield from schedule_tracking_check(mount, 0.0)
    return False


def _begin_goto(mount: AlpacaDriver, steps: Steps, purpose: str | None = None, side: str = "") -> Steps:
    """Begin a goto with these steps; ``side``: the tube's side of the pier at the goal, if the mount does not report
    it. If no answer shows that the goto has begun, send a stop, because the mount may begin it late.
    """
    try:
        yield from mount.begin_goto(GotoUnderWay(purpose=purpose), steps, _is_slewing)
    except NoAnswer:
        with suppress(Fault):
            yield Send("abortslew", timeout=MAX_WAIT)
        raise
    mount.goto_side = side


def _is_slewing(mount: AlpacaDriver) -> Steps:
    return bool((yield Send("slewing"))["value"])


# --- orders -----------------------------------------------------------------------------------------------------------


def send_order(mount: AlpacaDriver, command: str, goal: op.Equatorial | None = None, **values: object) -> Steps:
    """Send a command that changes the mount's state. Raises NoAnswer if no answer arrives soon, and other Faults."""
    try:
        yield Send(command, values, timeout=MAX_WAIT)
    except Silence:
        raise NoAnswer from None
    except Parked as fault:
        mount.parked = True
        raise Parked(_with_server_text(REFUSED_MESSAGE if command == "unpark" else PARKED_MESSAGE, fault)) from None
    except (Refused, Invalid) as fault:
        raise (yield from _explained_refusal(mount, command, fault, goal)) from None


def _explained_refusal(mount: AlpacaDriver, command: str, fault: Fault, goal: op.Equatorial | None) -> Steps:
    """Return a fault whose text explains why the server refused an order, from what the mount reports now."""
    if command not in ALLOWED_WHILE_PARKED and (yield from read_member(mount, "atpark", False)):
        mount.parked = True
        return Parked(_with_server_text(PARKED_MESSAGE, fault))
    if command in TRACKING_ONLY_ORDERS and not (yield from read_member(mount, "tracking", True)):
        return Refused(_with_server_text("The mount does not track: turn tracking on first.", fault))
    if goal is not None:
        sidereal = yield from read_member(mount, "siderealtime")
        latitude = yield from read_member(mount, "sitelatitude")
        if None not in (sidereal, latitude):
            altitude = hour_angle_to_horizon(wrap180(sidereal - goal.ra), goal.dec, latitude)[1]
            if altitude < 0.0:
                return BelowHorizon(_with_server_text("The goal is below the horizon.", fault))
    return type(fault)(_with_server_text(REFUSED_MESSAGE, fault))


def _with_server_text(text: str, fault: Fault) -> str:
    return f'{text} Its server says: "{fault}"'


def goto(mount: AlpacaDriver, operation: op.Goto) -> Steps:
    """Slew to a position, asynchronously if the server can. With ``track``, turn tracking on first if possible."""
    yield from stop_current_motion(mount)
    if mount.now() < mount.tracking_stale_until:
        yield from keep_tracking(mount)
    if operation.track and mount.tracks is False and not mount.parked and mount.supports("set_tracking"):
        yield from send_order(mount, "set_tracking", on=True)
        mount.tracks = True
    goal = op.Equatorial(operation.ra, operation.dec)
    side = (yield from _future_side(mount, goal)) if mount.hides_pier_side else ""
    command = "slewtocoordinatesasync" if mount.supports("slewtocoordinatesasync") else "slewtocoordinates"
    steps = send_order(mount, command, goal, ra=operation.ra, dec=operation.dec)
    yield from _begin_goto(mount, steps, side=side)


def _future_side(mount: AlpacaDriver, goal: op.Equatorial) -> Steps:
    """Return the tube's side of the pier after a goto to this goal; empty near the meridian, where it is uncertain.
    If the present side is unknown, forget which way MoveAxis of the second axis counts: that depends on the side.
    """
    sidereal = yield from read_member(mount, "siderealtime")
    hour_angle = 0.0 if sidereal is None else wrap180(sidereal - goal.ra)
    if abs(hour_angle) < EITHER_SIDE_ANGLE:
        return ""
    if not mount.goto_side:
        mount.signs.pop((2, ""), None)
    return "E" if hour_angle > 0.0 else "W"


def goto_axes(mount: AlpacaDriver, operation: op.GotoAxes | op.GotoHorizontal) -> Steps:
    """Slew to an azimuth and altitude. ASCOM requires tracking to be off: it is turned on again on arrival, or at once
    if the server refuses. Raises Unsupported for axis positions of an equatorial mount.
    """
    if mount.equatorial and isinstance(operation, op.GotoAxes):
        raise Unsupported("Only an alt-az mount can be sent to readings of its axes.")
    yield from stop_current_motion(mount)
    suspends = mount.tracks is not False and mount.supports("set_tracking")
    if suspends:
        yield from send_order(mount, "set_tracking", on=False)
    command = "slewtoaltazasync" if mount.supports("slewtoaltazasync") else "slewtoaltaz"
    try:
        yield from _begin_goto(mount, send_order(mount, command, None, az=operation.az % 360.0, alt=operation.alt))
    except Fault:
        if suspends and mount.tracks:
            with suppress(Fault):
                yield Send("set_tracking", {"on": True}, timeout=MAX_WAIT)
        raise


def stop_current_motion(mount: AlpacaDriver) -> Steps:
    """End a goto or a motion by hand before a newer goto, and wait until the mount rests, as some servers require."""
    moves = bool(mount.hand_rates) or mount.goto is not None
    for axis in sorted(mount.hand_rates):
        yield Send("moveaxis", {"axis": axis - 1, "rate": 0.0})
        mount.hand_rates.pop(axis, None)
    yield from resume_tracking(mount)
    if mount.goto is not None:
        yield from abort_slew(mount, op.AbortSlew())
    until = mount.now() + MOTION_END_TIMEOUT
    while moves and mount.now() < until and (yield from read_member(mount, "slewing", False)):
        yield Wait(END_CHECK_PERIOD)


def abort_slew(mount: AlpacaDriver, _: op.AbortSlew) -> Steps:
    """End the goto under way. This also ends motion by hand."""
    mount.give_up_goto()
    yield Send("abortslew")
    mount.hand_rates.clear()
    yield from resume_tracking(mount)
    yield from schedule_tracking_check(mount)


def resume_tracking(mount: AlpacaDriver) -> Steps:
    """Turn on tracking that was off for slow motion, which counts as ended. If that fails, a later check retries."""
    mount.slow_speeds.clear()
    mount.following_speeds.clear()
    mount.pulse_directions.clear()
    suspended, mount.tracking_paused = mount.tracking_paused, False
    if suspended and mount.tracks:
        with suppress(Fault):
            yield Send("set_tracking", {"on": True}, timeout=MAX_WAIT)
        yield from schedule_tracking_check(mount)


class KeepTracking(op.Operation, frozen=True):
    """Internal: turn tracking on again if it is off after a motion."""

    survives_abort = True


def schedule_tracking_check(mount: AlpacaDriver, delay: float = TRACKING_CHECK_DELAY) -> Steps:
    """Schedule a check of tracking some seconds after a motion, which may have turned it off."""
    mount.tracking_stale_until = mount.now() + TRACKING_CHECK_DEADLINE
    yield Schedule(delay, KeepTracking(), not_while_busy=True)


def keep_tracking(mount: AlpacaDriver, _: KeepTracking | None = None) -> Steps:
    """Turn tracking on again if a motion has turned it off; do nothing if the mount moves again or is parked."""
    if mount.hand_rates or mount.goto is not None or mount.parked or not mount.tracks:
        return
    mount.tracking_stale_until = mount.now()
    yield from read_status(mount)
    if not (mount.tracks or mount.parked) and mount.supports("set_tracking"):
        yield from send_order(mount, "set_tracking", on=True)
        mount.tracks = True
        yield Remark("tracking was off after a motion: it is turned on again")


def sync(mount: AlpacaDriver, operation: op.Sync) -> Steps:
    yield from send_order(mount, "synctocoordinates", None, ra=operation.ra, dec=operation.dec)


def park(mount: AlpacaDriver, _: op.Park) -> Steps:
    """Send the mount to its park position, where it does not track."""
    yield from stop_current_motion(mount)
    yield from _begin_goto(mount, send_order(mount, "park"), purpose="park")


def home(mount: AlpacaDriver, _: op.Home) -> Steps:
    """Send the mount to its home position."""
    yield from stop_current_motion(mount)
    mount.home_state = 0
    yield from _begin_goto(mount, send_order(mount, "findhome"), purpose="home")


def set_home(mount: AlpacaDriver, _: op.SetHome) -> Steps:
    """Raise Unsupported: only the software of the mount stores its home position."""
    yield from ()
    raise Unsupported("The home position of this mount is set by its own software.")


def home_state(mount: AlpacaDriver, _: op.HomeState) -> Steps:
    """Return 2 on the way to the home or park position, 1 at either, else 0."""
    yield from ()
    if mount.goto is not None and mount.goto.purpose in ("home", "park"):
        return 2
    return 1 if mount.parked else mount.home_state
