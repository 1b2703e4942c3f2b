"""Site and clock of a Meade. Setting the clock preserves UTC; an LX200GPS expects the UTC date with the local time."""

from __future__ import annotations

import calendar
from collections.abc import Callable
from contextlib import suppress
from datetime import UTC, datetime, timedelta

from gateway.astro.spherical import wrap180
from gateway.core.errors import Busy, Invalid, Refused, Silence, Unsupported
from gateway.core.operations import ClockFromGps, GetClock, GetGps, GetSite, Gps, Moment, Place, SetClock, SetSite
from gateway.protocols.base.driver import Send, Steps
from gateway.protocols.lx200.driver.state import Lx200Driver, ask
from gateway.protocols.lx200.nmea import parse_fix

ARCMINUTE = 1.0 / 60.0
#: The forms of a longitude: an unknown controller that refuses the first form may take the other.
LONGITUDE_COMMANDS = ("Sg", "Sg360")
#: Seconds by which a clock may differ from the time to which it was set.
CLOCK_TOLERANCE = 10.0
#: The most NMEA sentences that are read to find an RMC sentence, and seconds for each: they are sent in blocks.
MAX_SENTENCES, SENTENCE_TIMEOUT = 8, 2.5


def get_site(mount: Lx200Driver, _: GetSite) -> Steps:
    """:Gt :Gg -> Place (degrees, east positive)."""
    latitude = (yield from ask(mount, "Gt"))["latitude"]
    longitude = -(yield from ask(mount, "Gg"))["longitude"]
    mount.site = Place(latitude, wrap180(longitude))
    return mount.site


def _retry_once(attempt: Callable[[], Steps]) -> Steps:
    """Send a setting, once more if it is refused: the line may have lost a byte of it. Raises Invalid, Refused."""
    try:
        yield from attempt()
    except (Invalid, Refused):
        yield from attempt()


def set_site(mount: Lx200Driver, operation: SetSite) -> Steps:
    """:St :Sg - set the site and read it back, because some telescopes reply 0 to a valid site.

    Raises Refused if the site read back is more than an arcminute off, Unsupported if a coordinate is missing.
    """
    yield from _retry_once(lambda: _send_site(mount, operation))


def _send_site(mount: Lx200Driver, operation: SetSite) -> Steps:
    if operation.latitude is None or operation.longitude is None:
        raise Unsupported("A site has a latitude and a longitude.")
    with suppress(Invalid):
        yield from ask(mount, "St", latitude=operation.latitude)
    for form in filter(mount.supports, LONGITUDE_COMMANDS):
        with suppress(Invalid):
            yield from ask(mount, form, longitude=-operation.longitude)
        place = yield from get_site(mount, GetSite())
        far = max(abs(place.latitude - operation.latitude), abs(wrap180(place.longitude - operation.longitude)))
        if far <= 1.01 * ARCMINUTE:
            return
    raise Refused(mount.dialect.get("site", {}).get("refused", "The mount refused the site."))


def get_clock(mount: Lx200Driver, _: GetClock) -> Steps:
    """:GG :GC :GL -> Moment; the date is read again if midnight may have passed in between."""
    offset = -(yield from ask(mount, "GG"))["offset"]
    if mount.supports("GXT2"):
        return Moment(float((yield from ask(mount, "GXT2"))["time"]), offset)
    day = (yield from ask(mount, "GC"))["date"]
    seconds = (yield from ask(mount, "GL"))["time"]
    if seconds < 5:
        day = (yield from ask(mount, "GC"))["date"]
    return Moment(calendar.timegm(day.timetuple()) + seconds - offset * 3600.0, offset)


def read_gps(mount: Lx200Driver, _: GetGps) -> Steps:
    """Return the Gps of the first RMC sentence of :gps; not ``linked`` without a fix, or if the receiver sends none."""
    for _attempt in range(MAX_SENTENCES):
        try:
            position = parse_fix((yield Send("gps", timeout=SENTENCE_TIMEOUT))["text"])
        except (Silence, Busy):
            break
        if position is not None:
            return position
    return Gps(linked=False)


def set_clock_from_gps(mount: Lx200Driver, _: ClockFromGps) -> Steps:
    """:gT - set the clock by GPS; blocks the hand control for minutes. Raises Busy in motion, NoDevice without fix."""
    if mount.goto is not None or mount.moving or mount.seeking:
        raise Busy("The mount is moving: it can set its clock by GPS when it stands still.")
    yield from ask(mount, "gT")


def _set_zone(mount: Lx200Driver, wanted_zone: float) -> Steps:
    """Send :SG with this offset, hours, else whole hours, else 0; return the one taken. Raises Invalid if none."""
    for offset in (wanted_zone, float(int(wanted_zone))):
        with suppress(Invalid):
            yield from ask(mount, "SG", offset=-offset)
            return -(yield from ask(mount, "GG"))["offset"] if mount.dialect else offset
    yield from ask(mount, "SG", offset=0.0)
    return 0.0


def set_clock(mount: Lx200Driver, operation: SetClock) -> Steps:
    """Set zone, time and date by :SG :SL :SC. An offset in quarter hours is rounded down to the half hour; if it is
    refused, whole hours are tried, then an offset of 0. The local time is set to match, so that UTC is right.
    """
    ahead = operation.unix - mount.now()
    yield from _retry_once(lambda: _send_clock(mount, ahead, operation.offset * 2 // 1 / 2))


def _send_clock(mount: Lx200Driver, clock_ahead: float, zone: float) -> Steps:
    """Set the clock ``clock_ahead`` seconds ahead of the driver's own clock, and the zone, hours east."""
    offset = yield from _set_zone(mount, zone)
    if mount.supports("SXT2"):
        yield from ask(mount, "SXT2", unix=round(mount.now() + clock_ahead))
        yield from _verify_clock(mount, clock_ahead)
        return
    universal = datetime.fromtimestamp(round(mount.now() + clock_ahead), UTC)  # :SG may have taken long
    local = universal + timedelta(hours=offset)
    day = universal.date() if mount.facts["utc_date"] else local.date()
    yield from ask(mount, "SL", time=local.hour * 3600 + local.minute * 60 + local.second)
    yield from ask(mount, "SC", date=day)
    if mount.dialect:
        yield from _verify_clock(mount, clock_ahead)


def _verify_clock(mount: Lx200Driver, clock_ahead: float) -> Steps:
    """Read the clock back. Raises Refused if it is not ``clock_ahead`` seconds (within 10) ahead of the driver's."""
    moment = yield from get_clock(mount, GetClock())
    if abs(moment.unix - mount.now() - clock_ahead) > CLOCK_TOLERANCE:
        shown = datetime.fromtimestamp(moment.unix, UTC)
        raise Refused(f"The mount did not take the time: it reports {shown:%Y-%m-%d %H:%M:%S} UTC.")
