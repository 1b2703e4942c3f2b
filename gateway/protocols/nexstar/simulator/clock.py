"""Clocks and places of a simulated mount: the hand control's own, the GPS unit (176) and the RTC (178).

The hand control runs on from the time it was set to and believes the site it was told. The GPS unit knows
where the mount really stands and the true time; the RTC keeps the true time until it is set. Both speak
Universal Time (NexStar protocol, Time/Location, GPS and RTC Commands).
"""

from __future__ import annotations

import math
from datetime import UTC, datetime, timedelta

from gateway.astro.axes import Sky
from gateway.core.operations import Values
from gateway.protocols.nexstar.counting import fields_of, unix_of
from gateway.protocols.nexstar.simulator.mount import GPS, RTC, Handler, SimulatedMount

WEST_MOST, EAST_MOST = -12, 14  # hours: the zones in use


def _utc(unix: float) -> datetime:
    return datetime(1970, 1, 1, tzinfo=UTC) + timedelta(seconds=unix)


# --- the hand control's own -----------------------------------------------------------------------------


def _local(sim: SimulatedMount, zone: float) -> Values:
    """Local date and time in a zone, as both clock commands write it."""
    local = _utc(sim.utc() + (zone + sim.daylight) * 3600)
    return {**fields_of(local), "dst": sim.daylight}


def get_time(sim: SimulatedMount, _: Values) -> Values:
    """``h``: the zone byte holds whole hours, so a zone of 5:45 is told as 5, with the time to it."""
    zone = math.floor(sim.zone)
    return {**_local(sim, zone), "zone": zone}


def get_time_quarters(sim: SimulatedMount, _: Values) -> Values:
    """``i``: the zone in quarters of an hour."""
    return {**_local(sim, sim.zone), "quarters": round(sim.zone * 4)}


def _set_time(sim: SimulatedMount, values: Values, zone: float) -> None:
    """UTC is local time less the zone less daylight saving; impossible values change nothing."""
    if not WEST_MOST <= zone <= EAST_MOST or values["dst"] > 1 or values["year"] > 99:
        return
    try:
        local = unix_of(values)
    except ValueError:
        return
    sim.zone, sim.daylight = zone, values["dst"]
    unix = local - (zone + sim.daylight) * 3600
    sim.relocate(sim.mechanics.sky._replace(ahead=unix - sim.now))


def set_time(sim: SimulatedMount, values: Values) -> None:
    """``H``."""
    _set_time(sim, values, values["zone"])


def set_time_quarters(sim: SimulatedMount, values: Values) -> None:
    """``I``."""
    _set_time(sim, values, values["quarters"] / 4)


def get_site(sim: SimulatedMount, _: Values) -> Values:
    """``w``."""
    return {"latitude": sim.mechanics.sky.latitude, "longitude": sim.mechanics.sky.longitude}


def set_site(sim: SimulatedMount, values: Values) -> None:
    """``W``."""
    sim.relocate(Sky(values["latitude"], values["longitude"], sim.mechanics.sky.ahead))


def sidereal_time(sim: SimulatedMount, _: Values) -> Values:
    """``l``: by the clock and the site that the hand control believes in."""
    return {"sidereal": sim.mechanics.sky.sidereal(sim.now)}


# --- GPS unit and real-time clock -----------------------------------------------------------------------


def _true_time(sim: SimulatedMount, device: int) -> datetime:
    return _utc(sim.now + (sim.rtc_ahead if device == RTC else 0.0))


def _parts(device: int, *names: str) -> Handler:
    """Parts of the date and time that a device shows."""

    def parts(sim: SimulatedMount, _: Values) -> Values:
        time = _true_time(sim, device)
        return {name: getattr(time, name) for name in names}

    return parts


def _set_rtc(sim: SimulatedMount, values: Values) -> Values:
    """Replace a part of the RTC's date or time; an impossible one changes nothing."""
    time = _true_time(sim, RTC)
    try:
        wanted = time.replace(**values)
    except ValueError:
        return {}
    sim.rtc_ahead += (wanted - time).total_seconds()
    return {}


def _linked(sim: SimulatedMount, _: Values) -> Values:
    return {"linked": 1, "valid": 1}


CLOCKS: dict[str, Handler] = {
    "h": get_time,
    "H": set_time,
    "i": get_time_quarters,
    "I": set_time_quarters,
    "w": get_site,
    "W": set_site,
    "l": sidereal_time,
    "gps_linked": _linked,
    "gps_time_valid": _linked,
    "gps_latitude": lambda sim, _: {"latitude": sim.site[0]},
    "gps_longitude": lambda sim, _: {"longitude": sim.site[1]},
    "gps_date": _parts(GPS, "month", "day"),
    "gps_year": _parts(GPS, "year"),
    "gps_time": _parts(GPS, "hour", "minute", "second"),
    "rtc_date": _parts(RTC, "month", "day"),
    "rtc_year": _parts(RTC, "year"),
    "rtc_time": _parts(RTC, "hour", "minute", "second"),
    "rtc_set_date": _set_rtc,
    "rtc_set_year": _set_rtc,
    "rtc_set_time": _set_rtc,
}
