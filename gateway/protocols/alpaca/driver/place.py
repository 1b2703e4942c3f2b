"""Site and clock of the telescope. Some servers accept a site or time and ignore it, so the driver reads it back."""

from __future__ import annotations

from gateway.astro.spherical import wrap180
from gateway.core.errors import Refused, Unsupported
from gateway.core.operations import GetClock, GetSite, Moment, Place, SetClock, SetSite
from gateway.protocols.alpaca.driver.pointing import send_order
from gateway.protocols.alpaca.driver.state import AlpacaDriver
from gateway.protocols.base.driver import Send, Steps, Wait

#: Degrees by which the site that is read back may differ, and seconds for the time; how many times the driver reads it,
#: and the seconds between.
SITE_TOLERANCE, CLOCK_TOLERANCE = 0.02, 3.0
MAX_CHECKS, CHECK_PERIOD = 3, 0.5


def get_site(mount: AlpacaDriver, _: GetSite) -> Steps:
    latitude = (yield Send("sitelatitude"))["latitude"]
    mount.site = Place(latitude, wrap180((yield Send("sitelongitude"))["longitude"]))
    return mount.site


def set_site(mount: AlpacaDriver, operation: SetSite) -> Steps:
    """Set latitude and longitude. Raises Refused if the server keeps the old site, Unsupported if it cannot set one."""
    if operation.latitude is None or operation.longitude is None:
        raise Unsupported("A site has a latitude and a longitude.")
    longitude = wrap180(operation.longitude)
    yield from send_order(mount, "set_sitelatitude", latitude=operation.latitude)
    yield from send_order(mount, "set_sitelongitude", longitude=longitude)
    for _look in range(MAX_CHECKS):
        place = yield from get_site(mount, GetSite())
        away = max(abs(place.latitude - operation.latitude), abs(wrap180(place.longitude - longitude)))
        if away < SITE_TOLERANCE:
            return
        yield Wait(CHECK_PERIOD)
    raise Refused("The server has accepted the site, but reports another one.")


def get_clock(mount: AlpacaDriver, _: GetClock) -> Steps:
    """Return the mount's time as a Moment. Servers have no time zone, so its UTC offset is the one set last."""
    return Moment((yield Send("utcdate"))["unix"], mount.utc_offset)


def set_clock(mount: AlpacaDriver, operation: SetClock) -> Steps:
    """Set UTC. Raises Refused if the server keeps its own time, Unsupported if it cannot set the time."""
    began, mount.utc_offset = mount.now(), operation.offset
    yield from send_order(mount, "set_utcdate", unix=operation.unix)
    for _look in range(MAX_CHECKS):
        reported = (yield Send("utcdate"))["unix"]
        if abs(reported - operation.unix - (mount.now() - began)) < CLOCK_TOLERANCE:
            return
        yield Wait(CHECK_PERIOD)
    raise Refused("The server has accepted the time, but reports another one.")
