"""Site and clock of a Meade. What is preserved is UTC; an LX200GPS takes the UTC date."""

from __future__ import annotations

import calendar
from contextlib import suppress
from datetime import UTC, datetime, timedelta

from gateway.astro.spherical import wrap180
from gateway.core.errors import Busy, Invalid, Refused, Silence, Unsupported
from gateway.core.operations import ClockFromGps, GetClock, GetGps, GetSite, Gps, Moment, Place, SetClock, SetSite
from gateway.protocols.base.driver import Send, Steps
from gateway.protocols.lx200.driver.state import Lx200Driver, ask
from gateway.protocols.lx200.nmea import fix

ARCMINUTE = 1.0 / 60.0
#: Sentences to listen to for one that tells place and time, and seconds for each: they come in blocks.
SENTENCES, NEXT_SENTENCE = 8, 2.5


def get_site(mount: Lx200Driver, _: GetSite) -> Steps:
    """:Gt :Gg -> Place."""
    latitude = (yield from ask(mount, "Gt"))["latitude"]
    longitude = -(yield from ask(mount, "Gg"))["longitude"]
    mount.site = Place(latitude, wrap180(longitude))
    return mount.site


def set_site(mount: Lx200Driver, operation: SetSite) -> Steps:
    """:St :Sg - some answer 0 to a good latitude, so what counts is what they say afterwards."""
    if operation.latitude is None or operation.longitude is None:
        raise Unsupported("A site has a latitude and a longitude.")
    with suppress(Invalid):
        yield from ask(mount, "St", latitude=operation.latitude)
    with suppress(Invalid):
        yield from ask(mount, "Sg", longitude=-operation.longitude)
    place = yield from get_site(mount, GetSite())
    far = max(abs(place.latitude - operation.latitude), abs(wrap180(place.longitude - operation.longitude)))
    if far > 1.01 * ARCMINUTE:
        raise Refused("The mount refused the site.")


def get_clock(mount: Lx200Driver, _: GetClock) -> Steps:
    """:GG :GC :GL, the date again when midnight may have passed between -> Moment."""
    offset = -(yield from ask(mount, "GG"))["offset"]
    day = (yield from ask(mount, "GC"))["date"]
    seconds = (yield from ask(mount, "GL"))["time"]
    if seconds < 5:
        day = (yield from ask(mount, "GC"))["date"]
    return Moment(calendar.timegm(day.timetuple()) + seconds - offset * 3600.0, offset)


def gps(mount: Lx200Driver, _: GetGps) -> Steps:
    """:gps until a sentence tells place and time -> Gps; a receiver that is silent or off has no fix."""
    for _attempt in range(SENTENCES):
        try:
            seen = fix((yield Send("gps", patience=NEXT_SENTENCE))["text"])
        except (Silence, Busy):
            break
        if seen is not None:
            return seen
    return Gps(linked=False)


def clock_from_gps(mount: Lx200Driver, _: ClockFromGps) -> Steps:
    """:gT - minutes on a real one, whose keypad is dead meanwhile: not while anything moves. Raises Busy, NoDevice."""
    if mount.goto is not None or mount.moving or mount.seeking:
        raise Busy("The mount moves: its GPS can be asked when it stands.")
    yield from ask(mount, "gT")


def set_clock(mount: Lx200Driver, operation: SetClock) -> Steps:
    """:SG :SL :SC - quarter hours as the next lower half, with the local time to match."""
    offset, began = operation.offset * 2 // 1 / 2, mount.now()
    yield from ask(mount, "SG", offset=-offset)
    universal = datetime.fromtimestamp(round(operation.unix + mount.now() - began), UTC)  # the line may have been slow
    local = universal + timedelta(hours=offset)
    day = universal.date() if mount.facts["utc_date"] else local.date()
    yield from ask(mount, "SL", time=local.hour * 3600 + local.minute * 60 + local.second)
    yield from ask(mount, "SC", date=day)
