"""Site and clock of the hand control.

What is preserved is UTC: a hand control counts its zone in whole hours, so an odd offset goes out rounded and the local
time goes with it. Versions before 2.3 have neither; there the GPS unit, the clock of a CGE, and the settings stand in.
"""

from __future__ import annotations

from datetime import UTC, datetime, timedelta

from gateway.astro.spherical import wrap180
from gateway.core.errors import Fault, NoDevice, Unsupported
from gateway.core.operations import ClockFromGps, GetClock, GetGps, GetSite, Gps, Moment, Place, SetClock, SetSite
from gateway.protocols.base.driver import Send, Steps
from gateway.protocols.nexstar.counting import fields_of, unix_of
from gateway.protocols.nexstar.driver.state import NexStar

#: A time that had to wait so many seconds for the line was late: it is set again, so often at most.
SET_LATE, SET_TRIES = 2.0, 3
#: Hours that no local time is away from UTC.
FARTHEST = 15.0


def get_site(mount: NexStar, _: GetSite) -> Steps:
    """``w``; else the GPS unit; else the site of the settings. -> Place."""
    if mount.supports("w"):
        answer = yield Send("w")
        mount.site = Place(answer["latitude"], answer["longitude"])
        return mount.site
    try:
        seen = yield from gps(mount, GetGps())
    except Fault:
        seen = Gps(linked=False)
    if seen.place is not None:
        mount.site = seen.place
        return mount.site
    if mount.settings.site is None:
        raise Unsupported("This hand control does not tell its site.")
    mount.site = Place(*mount.settings.site)
    return mount.site


def set_site(mount: NexStar, operation: SetSite) -> Steps:
    """``W``. Both halves are needed."""
    if not mount.supports("W") or operation.latitude is None or operation.longitude is None:
        raise Unsupported("This hand control takes no site.")
    yield from _not_aligned(mount)
    yield Send("W", {"latitude": operation.latitude, "longitude": wrap180(operation.longitude)})
    mount.site = Place(operation.latitude, operation.longitude)


def _not_aligned(mount: NexStar) -> Steps:
    """A StarSense is asked first: somebody may have aligned it since anybody looked. Raises Unsupported."""
    if mount.starsense and (yield Send("J"))["aligned"]:
        mount.aligned = True
        raise Unsupported("A StarSense that is told site or time while it is aligned loses its alignment.")


def get_clock(mount: NexStar, _: GetClock) -> Steps:
    """``i`` or ``h``; else the clock of a CGE; else the GPS unit. -> Moment."""
    if mount.supports("i"):
        a = yield Send("i")
        return _moment(a, a["quarters"] / 4.0)
    if mount.supports("h"):
        a = yield Send("h")
        return _moment(a, float(a["zone"]))
    for part in ("gps", "rtc"):
        if not (mount.has(part) and mount.supports(f"{part}_date")):
            continue
        try:
            if part == "gps" and not (yield Send("gps_linked"))["linked"]:
                continue
            told = yield from _universal_time(part)
        except Fault:
            continue
        return _moment(told, 0.0, century=0)
    raise Unsupported("This hand control does not tell the time.")


def gps(mount: NexStar, _: GetGps) -> Steps:
    """GPS unit 176 -> Gps. Raises NoDevice."""
    if not mount.has("gps") or not mount.supports("gps_linked"):
        raise NoDevice("This mount has no GPS unit.")
    if not (yield Send("gps_linked"))["linked"]:
        return Gps(linked=False)
    latitude = (yield Send("gps_latitude"))["latitude"]
    longitude = (yield Send("gps_longitude"))["longitude"]
    told = yield from _universal_time("gps")
    return Gps(True, Place(latitude, wrap180(longitude)), _moment(told, 0.0, century=0).unix)


def _universal_time(part: str) -> Steps:
    """Date and time of the GPS unit or of the clock of a CGE, as fields of whole years."""
    day = yield Send(f"{part}_date")
    year = yield Send(f"{part}_year")
    time = yield Send(f"{part}_time")
    return {**day, **year, **time}


def clock_from_gps(mount: NexStar, _: ClockFromGps) -> Steps:
    """GPS unit 176, when it is linked, into the hand control's own clock; its zone stays."""
    seen = yield from gps(mount, GetGps())
    if not seen.linked:
        raise NoDevice("The GPS is not linked.")
    offset, dst = 0.0, None
    if mount.supports("h"):
        present = yield Send("h")
        offset, dst = float(present["zone"] + present["dst"]), present["dst"]
    yield from set_clock(mount, SetClock(seen.unix, offset, dst))


def _moment(fields: dict[str, int], zone: float, century: int = 2000) -> Moment:
    offset = zone + fields.get("dst", 0)
    if fields.get("dst", 0) > 1 or not -FARTHEST < offset < FARTHEST:
        raise Unsupported(f"The hand control's zone is impossible: {zone:g} hours, daylight saving {fields['dst']}.")
    try:
        local = unix_of({**fields, "second": min(fields["second"], 59)}, century)
    except ValueError as error:
        raise Unsupported(f"The hand control's clock is impossible: {error}.") from None
    return Moment(unix=local - offset * 3600.0, offset=offset, dst=fields.get("dst"))


def set_clock(mount: NexStar, operation: SetClock) -> Steps:
    """``I`` or ``H``: zone as near as the mount can count, local time to match; UTC is exact.

    Where nobody has told whether daylight saving is in it there is none, unless the mount's own zone and daylight
    saving already make that offset: then they are left as they are.
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
    elif mount.has("rtc") and mount.supports("rtc_set_date"):
        yield from _set_rtc(operation.unix)
        return
    else:
        raise Unsupported("This hand control takes no time.")
    for _ in range(SET_TRIES):
        yield from _not_aligned(mount)
        asked = mount.now()
        local = datetime.fromtimestamp(round(operation.unix + asked - began), UTC) + timedelta(hours=zone + dst)
        yield Send(name, {**fields_of(local), "dst": dst, **fields})
        if mount.now() - asked < SET_LATE:
            return


def _set_rtc(unix: float) -> Steps:
    moment = datetime.fromtimestamp(round(unix), UTC)
    yield Send("rtc_set_date", {"month": moment.month, "day": moment.day})
    yield Send("rtc_set_year", {"year": moment.year})
    yield Send("rtc_set_time", {"hour": moment.hour, "minute": moment.minute, "second": moment.second})
