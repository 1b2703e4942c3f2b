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
    """``h`` ``i``: local date and time in a zone."""
    local = _utc(sim.utc() + (zone + sim.daylight) * 3600)
    return {**fields_of(local), "dst": sim.daylight, "zone": int(zone), "quarters": round(zone * 4)}


def _set_time(sim: SimulatedMount, values: Values, zone: float) -> Values:
    """``H`` ``I``: UTC is local time less the zone less daylight saving; impossible values change nothing."""
    if not WEST_MOST <= zone <= EAST_MOST or values["dst"] > 1 or values["year"] > 99:
        return {}
    try:
        local = unix_of(values)
    except ValueError:
        return {}
    sim.zone, sim.daylight = zone, values["dst"]
    sim.relocate(sim.mechanics.sky._replace(ahead=local - (zone + sim.daylight) * 3600 - sim.now))
    return {}


def _set_site(sim: SimulatedMount, values: Values) -> None:
    sim.relocate(Sky(values["latitude"], values["longitude"], sim.mechanics.sky.ahead))


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
        wanted = time.replace(**{name: value for name, value in values.items() if name != "device"})
    except ValueError:
        return {}
    sim.rtc_ahead += (wanted - time).total_seconds()
    return {}


CLOCKS: dict[str, Handler] = {
    # The zone byte of h holds whole hours, so a zone of 5:45 is told as 5, with the time to it.
    "h": lambda sim, _: _local(sim, math.floor(sim.zone)),
    "H": lambda sim, values: _set_time(sim, values, values["zone"]),
    "i": lambda sim, _: _local(sim, sim.zone),
    "I": lambda sim, values: _set_time(sim, values, values["quarters"] / 4),
    "w": lambda sim, _: {"latitude": sim.mechanics.sky.latitude, "longitude": sim.mechanics.sky.longitude},
    "W": _set_site,
    "l": lambda sim, _: {"sidereal": sim.mechanics.sky.sidereal(sim.now)},
    **dict.fromkeys(("gps_linked", "gps_time_valid"), lambda sim, _: {"linked": 1, "valid": 1}),
    "gps_latitude": lambda sim, _: {"latitude": sim.site[0]},
    "gps_longitude": lambda sim, _: {"longitude": sim.site[1]},
    "gps_date": _parts(GPS, "month", "day"),
    "gps_year": _parts(GPS, "year"),
    "gps_time": _parts(GPS, "hour", "minute", "second"),
    "rtc_date": _parts(RTC, "month", "day"),
    "rtc_year": _parts(RTC, "year"),
    "rtc_time": _parts(RTC, "hour", "minute", "second"),
    **dict.fromkeys(("rtc_set_date", "rtc_set_year", "rtc_set_time"), _set_rtc),
}
