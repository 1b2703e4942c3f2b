"""Site and clock. The time zone is in whole hours east of Greenwich (i and I: quarter hours); UTC is preserved."""

from __future__ import annotations

from contextlib import suppress
from datetime import UTC, datetime

from msgspec.structs import replace

from gateway.core.errors import Fault
from gateway.core.operations import GetClock, Moment, SetClock, SetSite, Values
from gateway.protocols.base.wants import CheckPossible, Handling
from gateway.protocols.nexstar.counting import clock_fields, unix_time
from gateway.protocols.nexstar.session import NexStarSession
from gateway.protocols.wireformat.command import Command


def set_site(values: Values) -> Handling:
    """W - set the site; impossible coordinates, and a refusal by the mount, are ignored."""
    if "fault" in values:
        return
    place = SetSite(latitude=values["latitude"], longitude=values["longitude"])
    yield CheckPossible(place)
    with suppress(Fault):
        yield place


def clock(session: NexStarSession, command: Command) -> Handling:
    """h, i - the local time. Zone (for h in whole hours) and daylight saving are those that a client set, if they still
    make up the mount's offset; else they follow from that offset, and from daylight saving if the mount reports it.
    """
    moment: Moment = yield GetClock()
    quarters = command.name == "i"
    offset, dst = moment.offset, moment.dst or 0
    held = session.shared.zone
    as_set = held is not None and held[0] + held[1] == offset and moment.dst in (None, held[1])
    if held is not None and as_set and (quarters or held[0] == int(held[0])):
        zone, dst = held
    else:
        zone = round((offset - dst) * 4) / 4 if quarters else float(int(offset - dst + 100.5) - 100)
    local = datetime.fromtimestamp(moment.unix + (zone + dst) * 3600.0, UTC)
    return {**clock_fields(local), "zone": int(zone), "quarters": round(zone * 4), "dst": dst}


def set_clock(session: NexStarSession, command: Command, values: Values) -> Handling:
    """H, I - set zone and local time; an impossible time, and a refusal by the mount, are ignored."""
    zone = values["quarters"] / 4.0 if "quarters" in values else float(values["zone"])
    dst = values["dst"]
    if dst not in (0, 1) or not -14 <= zone <= 14 or values["year"] > 99:
        session.refusal_reason = f"{command.help}: no such year, zone or daylight saving"
        return
    try:
        local = unix_time(values)
    except ValueError as error:
        session.refusal_reason = f"{command.help}: {error}"
        return
    offset = zone + dst
    wanted = SetClock(local - offset * 3600.0, offset, dst)
    yield CheckPossible(wanted)
    try:
        yield wanted
    except Fault:
        return
    session.replace_shared(replace(session.shared, zone=(zone, dst)))
