"""Positions, gotos, syncs, park and home.

A server reports a parked mount by an error number. For any other refusal the driver reads the possible reasons, and
passes on the text of the server unchanged. If an order is not answered soon, the server may still have accepted it: old
servers answer when the motion has ended. So the driver reads whether the mount slews.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from contextlib import suppress
from typing import Any

from gateway.astro.spherical import fold_declination, hour_angle_to_horizon, wrap180
from gateway.core import operations as op
from gateway.core.errors import BelowHorizon, Fault, Invalid, NoAnswer, Refused, Silence, Unsupported
from gateway.protocols.alpaca.driver.contradictions import CompareEquinox, observe
from gateway.protocols.alpaca.driver.identify import read_status
from gateway.protocols.alpaca.driver.state import AlpacaDriver, device_state, read_member, read_member_again
from gateway.protocols.alpaca.tables import Parked
from gateway.protocols.base.driver import GotoUnderWay, Remark, Schedule, Send, Steps, Wait

#: Seconds that the answer to an order may take before the mount is looked at instead: a stop waits behind it.
ORDER = 1.5
#: Seconds after a goto has begun in which the server may still say that the mount does not slew.
START_GRACE = 2.0
#: Seconds after a goto at which its equinox is compared, once.
COMPARE_AFTER = 3.0
#: Seconds after a motion at which tracking is looked at, and within which it should have been.
LOOK_AFTER, LOOKED_AT = 1.0, 3.0
#: Seconds that a motion may take to end before a newer goto is sent all the same, and between two looks.
ENDS_WITHIN, LOOK_AGAIN = 10.0, 0.5
#: Degrees from the meridian within which a German mount may use either side of the pier.
EITHER_SIDE = 10.0
#: Orders that ASCOM allows only while the mount tracks; those whose refusal is not explained by a parked mount.
WHILE_TRACKING = ("slewtocoordinates", "slewtocoordinatesasync", "synctocoordinates")
OF_PARKED = ("unpark", "set_tracking")
#: The messages for a parked mount, and for a refusal without a known reason.
PARKED = "The mount is parked: unpark it first (mount-gateway unpark)."
REFUSED = "The mount refused this."


def position(mount: AlpacaDriver, _: op.Position) -> Steps:
    """Return the Equatorial position, as the server reports it."""
    place, state = None, {}
    if mount.lists_state:
        state, mount.read_at = (yield from device_state(mount)), None
        place = _numbers(state, "RightAscension", "Declination")
        if place is not None and not (0.0 <= place[0] <= 24.0 and abs(place[1]) <= 90.0):
            place = None
        mount.lists_state = place is not None or not state  # a single failure is no reason never to ask again
    if place is None:
        ra, since = (yield Send("rightascension"))["ra"], mount.now()
        place = ra / 15.0, (yield Send("declination"))["dec"]
        mount.read_at = since, mount.now()
    present = op.Equatorial(*fold_declination(place[0] * 15.0, place[1]))
    if mount.expected and (contradiction := observe(mount, present, _numbers(state, "Azimuth", "Altitude"))):
        yield Remark(contradiction)
    return present


def _numbers(state: Mapping[str, Any], *names: str) -> tuple[float, ...] | None:
    """Return these values; None if any is missing or no finite number."""
    try:
        values = tuple(float(state[name]) for name in names)
    except (KeyError, TypeError, ValueError):
        return None
    return values if all(map(math.isfinite, values)) else None


def horizontal_position(mount: AlpacaDriver, _: op.HorizontalPosition) -> Steps:
    """Return None: it is calculated by the same site and clock as the limits."""
    yield from ()


def pier_side(mount: AlpacaDriver, _: op.PierSide) -> Steps:
    """Return the side of the tube of a German mount. Raises Unsupported if it is unknown, or there are no sides."""
    ask = read_member if mount.side_untold else read_member_again
    side = (yield from ask(mount, "sideofpier")) if mount.german else None
    if side not in (0, 1):
        raise Unsupported("The server does not report the side of the pier.")
    return "W" if side else "E"


def slewing(mount: AlpacaDriver, _: op.Slewing) -> Steps:
    """Return whether a goto is under way; during a motion by hand, the server's answer describes that motion."""
    slews = bool((yield Send("slewing"))["value"])
    state = mount.goto
    if state is None:
        mount.by_hand = mount.by_hand and (slews or bool(mount.moving))
        return slews and not mount.by_hand
    if slews:
        state.slew_reported, state.unconfirmed = True, False
        return True
    if not state.slew_reported and mount.now() - state.since < START_GRACE:
        return True
    mount.goto = None
    if state.then == "park":
        mount.parked = bool((yield from read_member(mount, "atpark", True)))
        mount.tracks = mount.tracks and not mount.parked
    elif not mount.compared:
        yield Schedule(COMPARE_AFTER, CompareEquinox())
    if state.then == "home":
        mount.home_state = int(bool((yield from read_member(mount, "athome", True))))
    elif state.then is None:
        yield from look_at_tracking(mount, 0.0)
    return False


def _begin(mount: AlpacaDriver, steps: Steps, then_command: str | None = None, side: str = "") -> Steps:
    """Begin a goto, to this side of the pier if known. If given up it is ended as well: it may begin after that."""
    try:
        yield from mount.begin_goto(GotoUnderWay(then=then_command), steps, _slews)
    except NoAnswer:
        with suppress(Fault):
            yield Send("abortslew", patience=ORDER)
        raise
    mount.goto_side = side


def _slews(mount: AlpacaDriver) -> Steps:
    return bool((yield Send("slewing"))["value"])


# --- orders -----------------------------------------------------------------------------------------------------------


def order(mount: AlpacaDriver, command: str, goal: op.Equatorial | None = None, **values: object) -> Steps:
    """Send an order that begins or ends something. Raises NoAnswer if it is not answered soon, and other Faults."""
    try:
        yield Send(command, values, patience=ORDER)
    except Silence:
        raise NoAnswer from None
    except Parked as fault:
        mount.parked = True
        raise Parked(_with_text(REFUSED if command == "unpark" else PARKED, fault)) from None
    except (Refused, Invalid) as fault:
        raise (yield from _reason(mount, command, fault, goal)) from None


def _reason(mount: AlpacaDriver, command: str, fault: Fault, goal: op.Equatorial | None) -> Steps:
    """Return the refusal of an order with its reason, by the present reports of the mount."""
    if command not in OF_PARKED and (yield from read_member(mount, "atpark", False)):
        mount.parked = True
        return Parked(_with_text(PARKED, fault))
    if command in WHILE_TRACKING and not (yield from read_member(mount, "tracking", True)):
        return Refused(_with_text("The mount does not track: turn tracking on first.", fault))
    if goal is not None:
        sidereal = yield from read_member(mount, "siderealtime")
        latitude = yield from read_member(mount, "sitelatitude")
        if None not in (sidereal, latitude):
            altitude = hour_angle_to_horizon(wrap180(sidereal - goal.ra), goal.dec, latitude)[1]
            if altitude < 0.0:
                return BelowHorizon(_with_text("The goal is below the horizon.", fault))
    return type(fault)(_with_text(REFUSED, fault))


def _with_text(text: str, fault: Fault) -> str:
    return f'{text} Its server says: "{fault}"'


def goto(mount: AlpacaDriver, operation: op.Goto) -> Steps:
    """Slew, by a request that is answered at once if the server has it; tracking is turned on first if possible."""
    yield from stop_current_motion(mount)
    if mount.now() < mount.doubted_until:
        yield from keep_tracking(mount)
    if operation.track and mount.tracks is False and not mount.parked and mount.supports("set_tracking"):
        yield from order(mount, "set_tracking", on=True)
        mount.tracks = True
    goal = op.Equatorial(operation.ra, operation.dec)
    side = (yield from _side_of(mount, goal)) if mount.side_untold else ""
    command = "slewtocoordinatesasync" if mount.supports("slewtocoordinatesasync") else "slewtocoordinates"
    steps = order(mount, command, goal, ra=operation.ra, dec=operation.dec)
    yield from _begin(mount, steps, side=side)


def _side_of(mount: AlpacaDriver, goal: op.Equatorial) -> Steps:
    """Return the future pier side of the tube, and forget the senses of arrows measured on an unknown side."""
    sidereal = yield from read_member(mount, "siderealtime")
    hour_angle = 0.0 if sidereal is None else wrap180(sidereal - goal.ra)
    if abs(hour_angle) < EITHER_SIDE:
        return ""
    if not mount.goto_side:
        mount.senses.pop((2, ""), None)
    return "E" if hour_angle > 0.0 else "W"


def goto_axes(mount: AlpacaDriver, operation: op.GotoAxes | op.GotoHorizontal) -> Steps:
    """Slew over the horizon, for which ASCOM wants tracking off; it is turned on again on arrival, and at once if the
    server refuses. Raises Unsupported for axes of an equatorial mount.
    """
    if mount.equatorial and isinstance(operation, op.GotoAxes):
        raise Unsupported("Only an alt-az mount can be sent to readings of its axes.")
    yield from stop_current_motion(mount)
    suspends = mount.tracks is not False and mount.supports("set_tracking")
    if suspends:
        yield from order(mount, "set_tracking", on=False)
    command = "slewtoaltazasync" if mount.supports("slewtoaltazasync") else "slewtoaltaz"
    try:
        yield from _begin(mount, order(mount, command, None, az=operation.az % 360.0, alt=operation.alt))
    except Fault:
        if suspends and mount.tracks:
            with suppress(Fault):
                yield Send("set_tracking", {"on": True}, patience=ORDER)
        raise


def stop_current_motion(mount: AlpacaDriver) -> Steps:
    """End a goto or a motion by hand before a newer goto, and wait for the rest that some servers need for it."""
    moves = bool(mount.moving) or mount.goto is not None
    for axis in sorted(mount.moving):
        yield Send("moveaxis", {"axis": axis - 1, "rate": 0.0})
        mount.moving.pop(axis, None)
    yield from resume_tracking(mount)
    if mount.goto is not None:
        yield from abort_slew(mount, op.AbortSlew())
    until = mount.now() + ENDS_WITHIN
    while moves and mount.now() < until and (yield from read_member(mount, "slewing", False)):
        yield Wait(LOOK_AGAIN)


def abort_slew(mount: AlpacaDriver, _: op.AbortSlew) -> Steps:
    """End the goto under way. An axis that is moved by hand stands still afterwards."""
    mount.give_up_goto()
    yield Send("abortslew")
    mount.moving.clear()
    yield from resume_tracking(mount)
    yield from look_at_tracking(mount)


def resume_tracking(mount: AlpacaDriver) -> Steps:
    """Turn on tracking that was turned off for slow motion. If that fails, ``look_at_tracking`` tries again."""
    mount.slow.clear()
    mount.following.clear()
    mount.pulsed.clear()
    suspended, mount.suspended = mount.suspended, False
    if suspended and mount.tracks:
        with suppress(Fault):
            yield Send("set_tracking", {"on": True}, patience=ORDER)
        yield from look_at_tracking(mount)


class KeepTracking(op.Operation, frozen=True):
    """Internal: turn tracking on again if it is off after a motion."""

    survives_abort = True


def look_at_tracking(mount: AlpacaDriver, after: float = LOOK_AFTER) -> Steps:
    """Look at tracking some seconds after a motion, which may have turned it off."""
    mount.doubted_until = mount.now() + LOOKED_AT
    yield Schedule(after, KeepTracking(), not_while_busy=True)


def keep_tracking(mount: AlpacaDriver, _: KeepTracking | None = None) -> Steps:
    """Turn tracking on again if it is off after a motion, unless the mount moves again."""
    if mount.moving or mount.goto is not None or mount.parked or not mount.tracks:
        return
    mount.doubted_until = mount.now()
    yield from read_status(mount)
    if not (mount.tracks or mount.parked) and mount.supports("set_tracking"):
        yield from order(mount, "set_tracking", on=True)
        mount.tracks = True
        yield Remark("tracking was off after a motion: it is turned on again")


def sync(mount: AlpacaDriver, operation: op.Sync) -> Steps:
    yield from order(mount, "synctocoordinates", None, ra=operation.ra, dec=operation.dec)


def park(mount: AlpacaDriver, _: op.Park) -> Steps:
    """Send the mount to its park position, where it does not track."""
    yield from stop_current_motion(mount)
    yield from _begin(mount, order(mount, "park"), then_command="park")


def home(mount: AlpacaDriver, _: op.Home) -> Steps:
    """Send the mount to its home position."""
    yield from stop_current_motion(mount)
    mount.home_state = 0
    yield from _begin(mount, order(mount, "findhome"), then_command="home")


def set_home(mount: AlpacaDriver, _: op.SetHome) -> Steps:
    """Raise Unsupported: only the software of the mount stores its home position."""
    yield from ()
    raise Unsupported("The home position of this mount is set by its own software.")


def home_state(mount: AlpacaDriver, _: op.HomeState) -> Steps:
    """Return 2 on the way home or to park, 1 at home or parked, else 0."""
    yield from ()
    if mount.goto is not None and mount.goto.then in ("home", "park"):
        return 2
    return 1 if mount.parked else mount.home_state
