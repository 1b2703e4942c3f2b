"""Site and clock of the hand control.

UTC is preserved: a hand control counts its time zone in whole hours, so any other offset is rounded and the local time
is shifted to match. Before 2.3 the GPS unit, the clock of a CGE, and the settings replace site and clock commands.
"""

from __future__ import annotations

from datetime import UTC, datetime, timedelta

from gateway.astro.spherical import wrap180
from gateway.core.errors import Fault, NoDevice, Unsupported
from gateway.core.operations import ClockFromGps, GetClock, GetGps, GetSite, Gps, Moment, Place, SetClock, SetSite
from gateway.protocols.base.driver import Send, Steps
from gateway.protocols.nexstar.counting import clock_fields, unix_time
from gateway.protocols.nexstar.driver.state import NexStar

#: If setting the clock took this many seconds, the time was late and is set again; at most this many attempts.
MAX_SET_DURATION, SET_TRIES = 2.0, 3
#: Every time zone is less than this many hours from UTC.
MAX_OFFSET_HOURS = 15.0


def get_site(mount: NexStar, _: GetSite) -> Steps:
    """Return the Place by ``w``, else from the GPS unit, else from the settings. Raises Unsupported if none has it."""
    if mount.supports("w"):
        answer = yield Send("w")
        mount.site = Place(answer["latitude"], answer["longitude"])
        return mount.site
    try:
        receiver = yield from read_gps(mount, GetGps())
    except Fault:
        receiver = Gps(linked=False)
    if receiver.place is not None:
        mount.site = receiver.place
        return mount.site
    if mount.settings.site is None:
        raise Unsupported("This hand control does not report its site.")
    mount.site = Place(*mount.settings.site)
    return mount.site


def set_site(mount: NexStar, operation: SetSite) -> Steps:
    """Send ``W``. Raises Unsupported if a coordinate or the command is missing, or on an aligned StarSense."""
    if not mount.supports("W") or operation.latitude is None or operation.longitude is None:
        raise Unsupported("The site of this hand control cannot be set.")
    yield from _check_not_aligned(mount)
    yield Send("W", {"latitude": operation.latitude, "longitude": wrap180(operation.longitude)})
    mount.site = Place(operation.latitude, operation.longitude)


def _check_not_aligned(mount: NexStar) -> Steps:
    """Ask a StarSense first whether the user has aligned it meanwhile. Raises Unsupported if it is aligned."""
    if mount.starsense and (yield Send("J"))["aligned"]:
        mount.aligned = True
        raise Unsupported("An aligned StarSense would lose its alignment if its site or time were set.")


def get_clock(mount: NexStar, _: GetClock) -> Steps:
    """Return the Moment by ``i`` or ``h``, else of the GPS unit or a CGE's clock. Raises Unsupported without any."""
    if mount.supports("i"):
        a = yield Send("i")
        return _to_moment(a, a["quarters"] / 4.0)
    if mount.supports("h"):
        a = yield Send("h")
        return _to_moment(a, float(a["zone"]))
    for part in ("gps", "rtc"):
        if not (mount.has_part(part) and mount.supports(f"{part}_date")):
            continue
        try:
            if part == "gps" and not (yield Send("gps_linked"))["linked"]:
                continue
            time = yield from _read_utc(part)
        except Fault:
            continue
        return _to_moment(time, 0.0, century=0)
    raise Unsupported("This hand control does not report the time.")


def read_gps(mount: NexStar, _: GetGps) -> Steps:
    """Return the Gps state of GPS unit 176. Raises NoDevice if the mount has no such unit."""
    if not mount.has_part("gps") or not mount.supports("gps_linked"):
        raise NoDevice("This mount has no GPS unit.")
    if not (yield Send("gps_linked"))["linked"]:
        return Gps(linked=False)
    latitude = (yield Send("gps_latitude"))["latitude"]
    longitude = (yield Send("gps_longitude"))["longitude"]
    time = yield from _read_utc("gps")
    return Gps(True, Place(latitude, wrap180(longitude)), _to_moment(time, 0.0, century=0).unix)


def _read_utc(part: str) -> Steps:
    """Return the fields of UTC from the GPS unit or the clock of a CGE; the year has all four digits."""
    day = yield Send(f"{part}_date")
    year = yield Send(f"{part}_year")
    time = yield Send(f"{part}_time")
    return {**day, **year, **time}


def set_clock_from_gps(mount: NexStar, _: ClockFromGps) -> Steps:
    """Set the hand control's clock from GPS unit 176; its time zone stays. Raises NoDevice without a linked unit."""
    receiver = yield from read_gps(mount, GetGps())
    if not receiver.linked:
        raise NoDevice("The GPS is not linked.")
    offset, dst = 0.0, None
    if mount.supports("h"):
        present = yield Send("h")
        offset, dst = float(present["zone"] + present["dst"]), present["dst"]
    yield from set_clock(mount, SetClock(receiver.unix, offset, dst))


def _to_moment(fields: dict[str, int], zone: float, century: int = 2000) -> Moment:
    offset = zone + fields.get("dst", 0)
    if fields.get("dst", 0) > 1 or not -MAX_OFFSET_HOURS < offset < MAX_OFFSET_HOURS:
        raise Unsupported(f"The hand control's zone is impossible: {zone:g} hours, daylight saving {fields['dst']}.")
    try:
        local = unix_time({**fields, "second": min(fields["second"], 59)}, century)
    except ValueError as error:
        raise Unsupported(f"The hand control's clock is impossible: {error}.") from None
    return Moment(unix=local - offset * 3600.0, offset=offset, dst=fields.get("dst"))


def set_clock(mount: NexStar, operation: SetClock) -> Steps:
    """Send ``I`` or ``H``: the nearest zone that the mount can count, and the local time to match; UTC is exact.

    Without ``dst`` the offset counts as standard time; with ``H``, if the mount's own zone and daylight saving already
    make up the offset, both stay as they are. Without ``I`` and ``H`` set a CGE's clock to UTC. Raises Unsupported.
    """
    dst, began = operation.dst or 0, mount.now()
    if mount.supports("I"):
        quarters = round((operation.offset - dst) * 4)
        name, zone, fields = "I", quarters / 4.0, {"quarters": quarters}
    elif mount.supports("H"):
        hours = int(operation.offset - dst + 100.5) - 100  # the nearest, halves upwards
        present = yield Send("h")
        if operation.dst is None and present["zone"] + present["dst"] == operation.offset:
            hours, dst = present["zone"], present["dst"]
        name, zone, fields = "H", float(hours), {"zone": hours}
    elif mount.has_part("rtc") and mount.supports("rtc_set_date"):
        yield from _set_rtc(operation.unix)
        return
    else:
        raise Unsupported("The clock of this hand control cannot be set.")
    for _ in range(SET_TRIES):
        yield from _check_not_aligned(mount)
        asked = mount.now()
        local = datetime.fromtimestamp(round(operation.unix + asked - began), UTC) + timedelta(hours=zone + dst)
        yield Send(name, {**clock_fields(local), "dst": dst, **fields})
        if mount.now() - asked < MAX_SET_DURATION:
            return


def _set_rtc(unix: float) -> Steps:
    moment = datetime.fromtimestamp(round(unix), UTC)
    yield Send("rtc_set_date", {"month": moment.month, "day": moment.day})
    yield Send("rtc_set_year", {"year": moment.year})
    yield Send("rtc_set_time", {"hour": moment.hour, "minute": moment.minute, "second": moment.second})
