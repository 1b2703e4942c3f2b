"""What moves the mount: gotos, motion by hand, guiding, parking, tracking and its rates.

A motion is begun here, and followed by what tells whether it lasts.
"""

from __future__ import annotations

from contextlib import suppress

from gateway.astro.spherical import SIDEREAL_ARCSECONDS
from gateway.core import operations as op
from gateway.core.errors import Fault, Invalid, NoTarget, Unsupported
from gateway.core.operations import Values
from gateway.protocols.alpaca.surface.client import AlpacaSession, axis, place, within
from gateway.protocols.alpaca.tables import Parked
from gateway.protocols.base.wants import Handling, given
from gateway.protocols.wireformat.command import Command

#: By ASCOM's numbers.
DIRECTIONS = (op.Direction.NORTH, op.Direction.SOUTH, op.Direction.EAST, op.Direction.WEST)
#: A speed this near to one that the mount has is that one, as a part of it.
NEAR = 0.01
#: Degrees a second.
SIDEREAL = SIDEREAL_ARCSECONDS / 3600.0
#: ASCOM's numbers for drive rates: what the mount is told, and multiples of sidereal.
RATES = {0: ("sidereal", 1.0), 1: ("lunar", 14.685 / SIDEREAL_ARCSECONDS), 2: ("solar", 15.0 / SIDEREAL_ARCSECONDS)}


def slew(session: AlpacaSession, command: Command, values: Values) -> Handling:
    yield op.Goto(*_target(session, values))


def slew_altaz(session: AlpacaSession, command: Command, values: Values) -> Handling:
    az = within(values, "az", "Azimuth", 0.0, 360.0) % 360.0
    yield op.GotoHorizontal(az, within(values, "alt", "Altitude", -90.0, 90.0))


def sync(session: AlpacaSession, command: Command, values: Values) -> Handling:
    yield op.Sync(*_target(session, values))


def _target(session: AlpacaSession, values: Values) -> tuple[float, float]:
    """A place that comes with the command is the target from now on."""
    if values:
        session.kept.ra, session.kept.dec = place(values)
    if session.kept.ra is None or session.kept.dec is None:
        raise NoTarget("Set TargetRightAscension and TargetDeclination first.")
    return session.kept.ra, session.kept.dec


def slewing(session: AlpacaSession, command: Command, values: Values) -> Handling:
    return (yield from _slews((yield op.GetActivity())))


def _slews(moves: op.Activity) -> Handling:
    """From the moment in which a motion was asked for; the mount tells of those of its own hand control."""
    return moves.goto or moves.by_hand or (yield op.Slewing())


def is_pulse_guiding(session: AlpacaSession, command: Command, values: Values) -> Handling:
    return (yield op.GetActivity()).pulse


def at_park(session: AlpacaSession, command: Command, values: Values) -> Handling:
    """Once it stands there: what has acknowledged the end of a park may run down for a moment."""
    moves: op.Activity = yield op.GetActivity()
    return moves.parked and not (yield from _slews(moves))


def at_home(session: AlpacaSession, command: Command, values: Values) -> Handling:
    return (yield op.GetActivity()).homed and (yield op.HomeState()) == 1


def park(session: AlpacaSession, command: Command, values: Values) -> Handling:
    """A mount that is parked stays so."""
    if not (yield op.GetActivity()).parked:
        yield op.Park()


def unpark(session: AlpacaSession, command: Command, values: Values) -> Handling:
    """It tracks again, where it can be told to. Raises Unsupported for a mount that cannot be parked."""
    if "Park" not in (yield op.GetAbilities()).can:
        raise Unsupported("This mount cannot be parked.")
    if not (yield op.GetActivity()).parked:
        return
    yield op.Unpark()
    if (yield op.GetStatus()).tracking is op.Tracking.OFF:
        with suppress(Fault):  # it is in service all the same
            yield op.SetTracking(True)


def move_axis(session: AlpacaSession, command: Command, values: Values) -> Handling:
    """At one of the rates of ``AxisRates``, either way; 0 ends it. Raises Invalid for any other."""
    number, rate = axis(values), given(values)["rate"]
    if number == 2:
        raise Unsupported("This mount has no third axis.")
    if rate == 0.0:
        yield op.StopAxis(number + 1)
        return
    speeds = (yield op.GetAbilities()).speeds
    if not any(low * (1.0 - NEAR) <= abs(rate) <= high * (1.0 + NEAR) for low, high in speeds):
        raise Invalid(f"Rate {rate:g} is none of this axis: AxisRates lists them, in degrees a second.")
    yield op.MoveAxis(number + 1, 1 if rate > 0.0 else -1, op.Rate(degrees=abs(rate)))


def pulse_guide(session: AlpacaSession, command: Command, values: Values) -> Handling:
    """The answer comes when it has begun."""
    direction = DIRECTIONS[within(values, "direction", "Direction", 0, 3)]
    ms = within(values, "ms", "Duration", 0, 600_000)
    if ms:
        yield op.Pulse(direction, ms)


# --- tracking ---------------------------------------------------------------------------------------------------------


def tracking(session: AlpacaSession, command: Command, values: Values) -> Handling:
    """A parked mount does not, whatever it said last."""
    tracks = (yield op.GetStatus()).tracking is not op.Tracking.OFF
    return tracks and not (yield op.GetActivity()).parked


def set_tracking(session: AlpacaSession, command: Command, values: Values) -> Handling:
    on = given(values)["on"]
    if on and (yield op.GetActivity()).parked:
        raise Parked
    yield op.SetTracking(on)


def tracking_rate(session: AlpacaSession, command: Command, values: Values) -> Handling:
    """The nearest of those that have a number."""
    try:
        factor = yield op.DriveRate()
    except Unsupported:
        return 0
    return min(RATES, key=lambda number: abs(RATES[number][1] - factor))


def tracking_rates(session: AlpacaSession, command: Command, values: Values) -> Handling:
    return {"value": (yield from _rates())}


def set_tracking_rate(session: AlpacaSession, command: Command, values: Values) -> Handling:
    """Raises Invalid for a rate that the mount has not."""
    number = given(values)["rate"]
    if number not in (yield from _rates()):
        raise Invalid(f"TrackingRate {number} is not among the rates of this mount (TrackingRates).")
    yield op.TrackRate(name=RATES[number][0])


def _rates() -> Handling:
    """A mount without a way to set one has the sidereal rate alone."""
    return list(RATES) if "TrackRate" in (yield op.GetAbilities()).can else [0]


def guide_rate(session: AlpacaSession, command: Command, values: Values) -> Handling:
    """Degrees a second."""
    return (yield op.GetAbilities()).guides[_axis(command) - 1] * SIDEREAL


def set_guide_rate(session: AlpacaSession, command: Command, values: Values) -> Handling:
    """Up to the sidereal rate."""
    rate = within(values, "rate", "The guide rate", 0.0, SIDEREAL * 1.0001)
    if "SetGuideRate" not in (yield op.GetAbilities()).can:
        raise Unsupported("The guide rates of this mount cannot be set.")
    yield op.SetGuideRate(_axis(command), min(1.0, rate / SIDEREAL))


def _axis(command: Command) -> int:
    return 2 if command.name.endswith("declination") else 1
