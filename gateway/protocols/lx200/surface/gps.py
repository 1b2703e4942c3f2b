"""The GPS of an LX200GPS: sentences made from the site and the clock in force."""

from __future__ import annotations

from typing import Any

from gateway.operations import ClockFromGps, GetClock, GetSite, Moment, Place
from gateway.protocols.lx200.nmea import rmc
from gateway.surface import Handling, Session
from gateway.tables import Command


def sentence(session: Session, command: Command, values: dict[str, Any]) -> Handling:
    """:gps - one RMC sentence."""
    place: Place = yield GetSite()
    moment: Moment = yield GetClock()
    return {"text": rmc(place.latitude, place.longitude, moment.unix)}


def set_clock(session: Session, command: Command, values: dict[str, Any]) -> Handling:
    """:gT - 1 when the mount's clock was set from its GPS unit, 0 when there is none or it has no fix."""
    yield ClockFromGps()
