"""Tracking and its rates, and the rates of guiding."""

from __future__ import annotations

from gateway.astro.spherical import SIDEREAL_ARCSECONDS
from gateway.core import operations as op
from gateway.core.errors import Invalid, Unsupported
from gateway.core.operations import Values
from gateway.protocols.alpaca.surface.client import AlpacaSession, within
from gateway.protocols.alpaca.tables import Parked
from gateway.protocols.base.wants import Handling, given
from gateway.protocols.wireformat.command import Command

#: Degrees a second.
SIDEREAL = SIDEREAL_ARCSECONDS / 3600.0
#: ASCOM's numbers for drive rates: what the mount is told, and multiples of sidereal.
RATES = {0: ("sidereal", 1.0), 1: ("lunar", 14.685 / SIDEREAL_ARCSECONDS), 2: ("solar", 15.0 / SIDEREAL_ARCSECONDS)}


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
