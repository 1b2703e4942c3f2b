"""The site, the clock, and the target that a program sets before it sends the mount there."""

from __future__ import annotations

from gateway.core import operations as op
from gateway.core.errors import NoTarget
from gateway.core.operations import Values
from gateway.protocols.alpaca.surface.client import AlpacaSession, within
from gateway.protocols.base.wants import Handling, given
from gateway.protocols.wireformat.command import Command


def elevation(session: AlpacaSession, command: Command, values: Values) -> float:
    return _known(session.kept.elevation, "SiteElevation")


def set_elevation(session: AlpacaSession, command: Command, values: Values) -> None:
    session.kept.elevation = within(values, "elevation", "SiteElevation", -300.0, 10000.0)


def set_latitude(session: AlpacaSession, command: Command, values: Values) -> Handling:
    yield op.SetSite(latitude=within(values, "latitude", "SiteLatitude", -90.0, 90.0))


def set_longitude(session: AlpacaSession, command: Command, values: Values) -> Handling:
    """East counts positive."""
    yield op.SetSite(longitude=within(values, "longitude", "SiteLongitude", -180.0, 180.0))


def set_clock(session: AlpacaSession, command: Command, values: Values) -> Handling:
    """UTC; local time stays as far from it as it was."""
    unix = given(values)["unix"]
    before: op.Moment = yield op.GetClock()
    yield op.SetClock(unix, before.offset, before.dst)


def target_ra(session: AlpacaSession, command: Command, values: Values) -> float:
    return _known(session.kept.ra, "TargetRightAscension")


def set_target_ra(session: AlpacaSession, command: Command, values: Values) -> None:
    session.kept.ra = within(values, "ra", "TargetRightAscension", 0.0, 360.0, per=15.0) % 360.0


def target_dec(session: AlpacaSession, command: Command, values: Values) -> float:
    return _known(session.kept.dec, "TargetDeclination")


def set_target_dec(session: AlpacaSession, command: Command, values: Values) -> None:
    session.kept.dec = within(values, "dec", "TargetDeclination", -90.0, 90.0)


def _known(value: float | None, name: str) -> float:
    if value is None:
        raise NoTarget(f"{name} has not been set.")
    return value
