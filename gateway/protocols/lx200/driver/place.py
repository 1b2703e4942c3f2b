"""Site and clock of a Meade. What is preserved is UTC; an LX200GPS takes the UTC date."""

from __future__ import annotations

import calendar
from datetime import UTC, datetime, timedelta

from gateway.driver import Steps
from gateway.errors import Invalid, NoDevice, Refused, Unsupported
from gateway.operations import ClockFromGps, GetClock, GetSite, Moment, Place, SetClock, SetSite
from gateway.protocols.lx200.driver.state import Meade, ask
from gateway.spherical import wrap180

ARCMINUTE = 1.0 / 60.0


def get_site(mount: Meade, _: GetSite) -> Steps:
    """:Gt :Gg -> Place."""
    latitude = (yield from ask(mount, "Gt"))["latitude"]
    longitude = -(yield from ask(mount, "Gg"))["longitude"]
    mount.site = Place(latitude, wrap180(longitude))
    return mount.site


def set_site(mount: Meade, operation: SetSite) -> Steps:
    """:St :Sg - some answer 0 to a good latitude, so what counts is what they say afterwards."""
    if operation.latitude is None or operation.longitude is None:
        raise Unsupported("A site has a latitude and a longitude.")
    for command, values in (("St", {"latitude": operation.latitude}), ("Sg", {"longitude": -operation.longitude})):
        try:
            yield from ask(mount, command, **values)
        except Invalid:
            continue
    place = yield from get_site(mount, GetSite())
    far = max(abs(place.latitude - operation.latitude), abs(wrap180(place.longitude - operation.longitude)))
    if far > 1.01 * ARCMINUTE:
        raise Refused("The mount refused the site.")


def get_clock(mount: Meade, _: GetClock) -> Steps:
    """:GG :GC :GL, the date again when midnight may have passed between -> Moment."""
    offset = -(yield from ask(mount, "GG"))["offset"]
    day = (yield from ask(mount, "GC"))["date"]
    seconds = (yield from ask(mount, "GL"))["time"]
    if seconds < 5:
        day = (yield from ask(mount, "GC"))["date"]
    return Moment(calendar.timegm(day.timetuple()) + seconds - offset * 3600.0, offset)


def clock_from_gps(mount: Meade, _: ClockFromGps) -> Steps:
    """:gT - minutes on a real one; its answer is not waited for longer than any other."""
    if not mount.knows("gT"):
        raise NoDevice("This model has no GPS.")
    yield from ask(mount, "gT")


def set_clock(mount: Meade, operation: SetClock) -> Steps:
    """:SG :SL :SC - quarter hours as the next lower half, with the local time to match."""
    offset = operation.offset * 2 // 1 / 2
    local = datetime.fromtimestamp(round(operation.unix), UTC) + timedelta(hours=offset)
    day = datetime.fromtimestamp(round(operation.unix), UTC).date() if mount.facts["utc_date"] else local.date()
    yield from ask(mount, "SG", offset=-offset)
    yield from ask(mount, "SL", time=local.hour * 3600 + local.minute * 60 + local.second)
    yield from ask(mount, "SC", date=day)
