"""The site, the clock, and the target that a program sets before a goto."""

from __future__ import annotations

from gateway.core import operations as op
from gateway.core.errors import NoTarget
from gateway.core.operations import Values
from gateway.protocols.alpaca.surface.client import AlpacaSession, value_in_range
from gateway.protocols.base.wants import Handling, decoded
from gateway.protocols.wireformat.command import Command

#: Member that only changes the program's own settings -> field of its settings, name in messages, range, and the
#: divisor that converts a value to the unit of messages.
CLIENT_VALUES = {
    "siteelevation": ("elevation", "SiteElevation", -300.0, 10000.0, 1.0),
    "targetrightascension": ("ra", "TargetRightAscension", 0.0, 360.0, 15.0),
    "targetdeclination": ("dec", "TargetDeclination", -90.0, 90.0, 1.0),
}


def stored_value(session: AlpacaSession, command: Command) -> float:
    """Return the site elevation or target coordinate that the program has set. Raises NoTarget for an unset target."""
    field, name, *_ = CLIENT_VALUES[command.name]
    value: float | None = getattr(session.client, field)
    if value is None:
        raise NoTarget(f"{name} has not been set.")
    return value


def store_value(session: AlpacaSession, command: Command, values: Values) -> None:
    """Store a site elevation or target coordinate for this program only."""
    field, name, *bounds = CLIENT_VALUES[command.name.removeprefix("set_")]
    value = value_in_range(values, field, name, *bounds)
    setattr(session.client, field, value % 360.0 if field == "ra" else value)


def set_latitude(values: Values) -> Handling:
    yield op.SetSite(latitude=value_in_range(values, "latitude", "SiteLatitude", -90.0, 90.0))


def set_longitude(values: Values) -> Handling:
    """Set the longitude, east positive."""
    yield op.SetSite(longitude=value_in_range(values, "longitude", "SiteLongitude", -180.0, 180.0))


def set_clock(values: Values) -> Handling:
    """Set UTC, with the UTC offset unchanged. Raises Refused if the mount refuses it."""
    unix = decoded(values)["unix"]
    before: op.Moment = yield op.GetClock()
    yield op.SetClock(unix, before.offset, before.dst, heard=True)
