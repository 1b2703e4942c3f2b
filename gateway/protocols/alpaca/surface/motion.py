"""Gotos, motion by hand, guiding, parking, tracking and its rates.

The reply to a request that begins a motion is sent when the motion has begun. Programs poll other members to notice its
end, or ``http/programs.py`` does this for them (``arrival`` in ``members.toml``).
"""

from __future__ import annotations

from contextlib import suppress

from gateway.astro.spherical import SIDEREAL_ARCSEC_PER_S
from gateway.core import operations as op
from gateway.core.errors import Fault, Invalid, NoAnswer, NoTarget, Unsupported
from gateway.core.operations import Values
from gateway.protocols.alpaca.surface.client import AlpacaSession, axis_number, target_coordinates, value_in_range
from gateway.protocols.alpaca.tables import Parked
from gateway.protocols.base.wants import Handling, Note, decoded
from gateway.protocols.wireformat.command import Command

#: The directions in the order of ASCOM's numbers.
DIRECTIONS = (op.Direction.NORTH, op.Direction.SOUTH, op.Direction.EAST, op.Direction.WEST)
NO_PARK_MESSAGE = "This mount cannot be parked."
#: A requested speed that differs by less than this fraction from a speed of the mount counts as that speed.
SPEED_TOLERANCE = 0.01
#: The sidereal rate, degrees per second.
SIDEREAL_RATE = SIDEREAL_ARCSEC_PER_S / 3600.0
#: ASCOM's number of a drive rate -> its name in operations, and its multiple of the sidereal rate.
RATES = {0: ("sidereal", 1.0), 1: ("lunar", 14.685 / SIDEREAL_ARCSEC_PER_S), 2: ("solar", 15.0 / SIDEREAL_ARCSEC_PER_S)}


def slew(session: AlpacaSession, values: Values) -> Handling:
    yield op.Goto(*_target(session, values))


def slew_altaz(values: Values) -> Handling:
    az = value_in_range(values, "az", "Azimuth", 0.0, 360.0) % 360.0
    yield op.GotoHorizontal(az, value_in_range(values, "alt", "Altitude", -90.0, 90.0))


def sync(session: AlpacaSession, values: Values) -> Handling:
    yield op.Sync(*_target(session, values))


def _target(session: AlpacaSession, values: Values) -> tuple[float, float]:
    """Return the program's target (RA, dec), degrees; coordinates in the command set it. Raises NoTarget if unset."""
    if values:
        session.client.ra, session.client.dec = target_coordinates(values)
    if session.client.ra is None or session.client.dec is None:
        raise NoTarget("Set TargetRightAscension and TargetDeclination first.")
    return session.client.ra, session.client.dec


def slewing() -> Handling:
    return (yield from _is_slewing((yield op.GetActivity())))


def _is_slewing(activity: op.Activity) -> Handling:
    """Return whether a motion of a program, or a goto of the hand control, is under way. Raises NoAnswer if unknown."""
    if activity.unknown:
        raise NoAnswer(
            "It is not known whether the mount moves: it has not reported its position since it was stopped."
        )
    return activity.goto or activity.by_hand or activity.ends or (yield op.Slewing())


def is_pulse_guiding() -> Handling:
    return (yield op.GetActivity()).pulse


def at_park() -> Handling:
    """Return whether the mount is parked and at rest: some mounts report that they are parked while they still move."""
    moves: op.Activity = yield op.GetActivity()
    return moves.parked and not (yield from _is_slewing(moves))


def at_home() -> Handling:
    return (yield op.GetActivity()).homed and (yield op.HomeState()) == 1


def find_home() -> Handling:
    yield from _require_ability(op.Home, "This mount has no home position.")
    yield op.Home()


def park() -> Handling:
    """Park the mount, unless it is parked already."""
    yield from _require_ability(op.Park, NO_PARK_MESSAGE)
    if not (yield op.GetActivity()).parked:
        yield op.Park()


def unpark() -> Handling:
    """Unpark the mount, and turn tracking on if possible. Raises Unsupported for a mount that cannot be parked."""
    yield from _require_ability(op.Park, NO_PARK_MESSAGE)
    if not (yield op.GetActivity()).parked:
        return
    yield op.Unpark()
    if (yield op.GetStatus()).tracking is op.Tracking.OFF:
        with suppress(Fault):  # it is unparked all the same
            yield op.SetTracking(True)


def _require_ability(operation: type[op.Operation], reason: str) -> Handling:
    """Raise Unsupported if the mount does not have this operation, at once even if the mount is busy."""
    if operation.__name__ not in (yield op.GetAbilities()).can:
        raise Unsupported(reason)


def move_axis(values: Values) -> Handling:
    """Move an axis at a signed rate of ``AxisRates``, or at the next slower of these; rate 0 ends the motion. Raises
    Unsupported for a third axis, and Invalid for a rate outside ``AxisRates``.
    """
    number, rate = axis_number(values), decoded(values)["rate"]
    if number == 2:
        raise Unsupported("This mount has no third axis.")
    if rate == 0.0:
        yield op.StopAxis(number + 1)
        return
    speed = abs(rate)
    slower = [high for low, high in (yield op.GetAbilities()).speeds if low * (1.0 - SPEED_TOLERANCE) <= speed]
    if not slower or speed > max(high for _, high in (yield op.GetAbilities()).speeds) * (1.0 + SPEED_TOLERANCE):
        raise Invalid(f"Rate {rate:g} is not one of this axis: AxisRates lists them, in degrees per second.")
    if speed > max(slower) * (1.0 + SPEED_TOLERANCE):
        yield Note(f"MoveAxis at {speed:g} degrees a second is done at {max(slower):.4g}: the next slower rate it has")
    yield op.MoveAxis(number + 1, 1 if rate > 0.0 else -1, op.Rate(degrees=min(speed, max(slower))))


def pulse_guide(session: AlpacaSession, values: Values) -> Handling:
    """Send a guide pulse; reply when it has begun. North raises the declination unless configured otherwise."""
    direction = DIRECTIONS[value_in_range(values, "direction", "Direction", 0, 3)]
    ms = value_in_range(values, "ms", "Duration", 0, 600_000)
    if ms:
        yield op.Pulse(direction, ms, session.client_settings.guides_by_sky)


# --- tracking ---------------------------------------------------------------------------------------------------------


def tracking() -> Handling:
    """Return whether the mount tracks; a parked mount does not, whatever it reported last."""
    tracks = (yield op.GetStatus()).tracking is not op.Tracking.OFF
    return tracks and not (yield op.GetActivity()).parked


def set_tracking(session: AlpacaSession, values: Values) -> Handling:
    on = decoded(values)["on"]
    if on and (yield op.GetActivity()).parked:
        raise Parked
    session.client.track_failed = on  # unless it succeeds: a mount that cannot be made to track may go to a target then
    yield op.SetTracking(on, heard=True)
    session.client.track_failed = False


def tracking_rate() -> Handling:
    """Return ASCOM's number of the nearest drive rate; 0 (sidereal) if the mount reports no rate."""
    try:
        factor = yield op.DriveRate()
    except Unsupported:
        return 0
    return min(RATES, key=lambda number: abs(RATES[number][1] - factor))


def tracking_rates() -> Handling:
    return {"value": (yield from _drive_rate_numbers())}


def set_tracking_rate(values: Values) -> Handling:
    """Set a drive rate. Raises Invalid if the mount does not have it."""
    number = decoded(values)["rate"]
    if number not in (yield from _drive_rate_numbers()):
        raise Invalid(f"This mount does not have TrackingRate {number} (see TrackingRates).")
    yield op.TrackRate(name=RATES[number][0])


def _drive_rate_numbers() -> Handling:
    """Return ASCOM's numbers of the mount's drive rates; only sidereal if the rate cannot be set."""
    return list(RATES) if "TrackRate" in (yield op.GetAbilities()).can else [0]


def guide_rate(command: Command) -> Handling:
    """Return the guide rate of the member's axis, degrees per second."""
    return (yield op.GetAbilities()).guides[_guide_rate_axis(command) - 1] * SIDEREAL_RATE


def set_guide_rate(command: Command, values: Values) -> Handling:
    """Set the guide rate, degrees per second, at most sidereal."""
    rate = value_in_range(values, "rate", "The guide rate", 0.0, SIDEREAL_RATE * 1.0001)
    if "SetGuideRate" not in (yield op.GetAbilities()).can:
        raise Unsupported("The guide rates of this mount cannot be set.")
    yield op.SetGuideRate(_guide_rate_axis(command), min(1.0, rate / SIDEREAL_RATE))


def _guide_rate_axis(command: Command) -> int:
    return 2 if command.name.endswith("declination") else 1
