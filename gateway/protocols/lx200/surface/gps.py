"""The GPS of an LX200GPS: the mount's own unit. Without one, or without a fix, nothing says that there is one."""

from __future__ import annotations

from gateway.core.errors import NoDevice, Unsupported
from gateway.core.operations import ClockFromGps, GetClock, GetGps, GetSite, Gps, Moment, Place, Values
from gateway.protocols.base.surface import Handling
from gateway.protocols.lx200.nmea import rmc
from gateway.protocols.lx200.session import LxSession
from gateway.protocols.wireformat.command import Command


def sentence(session: LxSession, command: Command, values: Values) -> Handling:
    """:gps - one RMC sentence; without a fix one that says so (V), with the site and the clock in force."""
    try:
        seen: Gps = yield GetGps()
    except (Unsupported, NoDevice):
        seen = Gps(linked=False)
    place: Place = seen.place or (yield GetSite())
    moment: Moment = yield GetClock()
    return {"text": rmc(place.latitude, place.longitude, seen.unix or moment.unix, seen.linked)}


def set_clock(session: LxSession, command: Command, values: Values) -> Handling:
    """:gT - 1 when the mount's clock was set from its GPS unit, 0 when there is none or it has no fix."""
    yield ClockFromGps()
